"""Which of two rotors changed: the other heights decide, where they can."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.averages import BLOWING, Averages, BoolArray, blocks_of

FloatArray = npt.NDArray[np.float64]

_FEWEST = 300
_FEWEST_BLOCKS = 6


def _columns(averages: Averages, others: list[str], own: list[str]) -> tuple[FloatArray, BoolArray]:
    """Regressors of a height's log speed: those of the other heights, and turbulence."""
    logs = np.log(np.maximum(np.array([averages.speed[o] for o in others]), 0.1))
    good = np.isfinite(logs).all(axis=0)
    for name in own:
        good &= np.isfinite(averages.speed[name]) & (averages.speed[name] > BLOWING)
    intensity = np.minimum.reduce([averages.intensity(o) for o in others])
    columns = np.vstack([np.ones(len(averages)), logs, intensity, intensity**2])
    return columns.T, good


def likelihood_of_first(
    before: Averages,
    after: Averages,
    first: str,
    second: str,
    others: list[str],
    inside: tuple[BoolArray, BoolArray],
) -> float | None:
    """Log-likelihood of a change at `first` minus that of the opposite change at `second`.

    The other heights predict what both should read; the changed one departs from the prediction,
    the other does not.

    Args:
        before, after: Means in which the change is absent and present.
        first, second: The pair.
        others: Rotors of other heights that did not change.
        inside: Rows of `before` and `after` to be used.

    Returns:
        None where the other heights cannot tell.
    """
    if not others:
        return None
    x, good = _columns(before, others, [first, second])
    z, usable = _columns(after, others, [first, second])
    good, usable = good & inside[0], usable & inside[1]
    if good.sum() < _FEWEST or usable.sum() < _FEWEST:
        return None
    shifts = {}
    for name in (first, second):
        y = np.log(np.maximum(before.speed[name], 0.1))
        weights = np.linalg.lstsq(x[good], y[good], rcond=None)[0]
        rest_before = y[good] - x[good] @ weights
        rest = np.log(np.maximum(after.speed[name][usable], 0.1)) - z[usable] @ weights
        shifts[name] = (
            rest, rest_before, blocks_of(after)[usable], blocks_of(before)[good],
        )  # fmt: skip
    move, error = {}, 0.0
    for name, (rest, rest_before, block, block_before) in shifts.items():
        now = [np.median(rest[block == b]) for b in np.unique(block)]
        then = [np.median(rest_before[block_before == b]) for b in np.unique(block_before)]
        if min(len(now), len(then)) < _FEWEST_BLOCKS:
            return None
        move[name] = float(np.mean(now) - np.mean(then))
        # Neighbouring blocks share their weather: half of them count.
        error = max(
            error,
            float(np.sqrt(2.0 * (np.var(now) / len(now) + np.var(then) / len(then)))),
        )
    return (move[first] ** 2 - move[second] ** 2) / (2.0 * error**2)
