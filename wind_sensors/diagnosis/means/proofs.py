"""What a term removes of the misfit on blocks that were not fitted, with its bootstrap interval."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.bench import FloatArray
from wind_sensors.diagnosis.proving.proof import DRAWS, Proof


def share_removed(
    gain: FloatArray,
    before: FloatArray,
    floor: FloatArray,
    picks: npt.NDArray[np.intp] | None = None,
) -> float:
    """Share of the excess misfit that a gain is; 0 where there is no excess.

    Args:
        gain: Drop of the held-out cost of each block.
        before: That cost without the term.
        floor: What of it no explanation can remove.
        picks: Blocks that count, as often as they are named; None: all once.
    """
    chosen = slice(None) if picks is None else picks
    excess = float((before - floor)[chosen].sum())
    return float(gain[chosen].sum()) / excess if excess > 0.0 else 0.0


def proof_of(
    gain: FloatArray,
    before: FloatArray,
    rows: int,
    rival: FloatArray | None,
    floor: FloatArray | None = None,
    seed: int = 1,
) -> Proof:
    """The proof of a term, from the held-out costs of the blocks.

    Args:
        gain, before: As in `share_removed`, without and with what was named earlier.
        rows: How many residuals the costs are sums of.
        rival: Gain of the next-best explanation, or of a placebo; None: there is none.
        floor: As in `share_removed`; None: nobody knows what cannot be removed, so that the excess
            is the whole misfit.
        seed: Of the bootstrap.
    """
    least = np.zeros(before.size) if floor is None else floor
    blocks = gain.size
    rng = np.random.default_rng(seed)
    drawn = [
        share_removed(gain, before, least, rng.integers(0, blocks, blocks)) for _ in range(DRAWS)
    ]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Proof(
        before=float(np.sqrt(before.sum() / rows)),
        after=float(np.sqrt(max(float((before - gain).sum()), 0.0) / rows)),
        floor=float(np.sqrt(least.sum() / rows)),
        excess_removed=share_removed(gain, before, least),
        low=float(low),
        high=float(high),
        placebo_removed=None if rival is None else share_removed(rival, before, least),
    )
