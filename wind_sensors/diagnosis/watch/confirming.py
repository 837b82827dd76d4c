"""Whether an alarm of the sequential test is worth telling."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wind_sensors.diagnosis.watch.evidence import Evidence
from wind_sensors.diagnosis.watch.finding import UsualMisfit
from wind_sensors.diagnosis.watch.naming import Candidate

LEAST_GAIN = 30.0
"""A candidate must remove so much misfit from a block, in squares of whitened differences."""

LEAST_SIZE = 1.2
"""And be so large, in smallest sizes worth reporting."""

AS_GOOD = 0.7
"""Candidates that remove this share of what the best removes explain about as much."""

GROSS = 1.7
"""Misfit relative to the usual that is told even if no effect explains it."""


def confirmed(
    since: Sequence[Evidence], named: Sequence[Candidate], usual: UsualMisfit
) -> bool:
    """Whether a large enough cause removes misfit, or much misfit is there.

    Sums of many blocks notice differences that are real but too small to matter. If a cause too
    small to report explains them about as well as a large one, they are such.

    Args:
        since: Blocks since the onset.
        named: Candidates.
        usual: Misfit of healthy blocks.
    """
    strongest = max((c.gain for c in named), default=0.0)
    close = [c for c in named if c.gain >= AS_GOOD * strongest]
    if strongest >= LEAST_GAIN and all(c.size >= LEAST_SIZE for c in close):
        return True
    return any(
        np.mean([b.channels[name].chi_square / b.channels[name].count for b in since])
        > GROSS * usual.of(name)
        for name in since[-1].channels
        if all(name in b.channels for b in since)
    )
