"""Readings of vanes: erratic ones, coarse ones, and how still a vane stands."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.station.signals import Angles

FloatArray = npt.NDArray[np.float64]

ERRATIC = 3
"""Number of statistics of erratic readings."""


def erratic_statistics(
    angles: Angles, around: FloatArray, grid: Grid, mask: FloatArray | None = None
) -> FloatArray:
    """How much of the time a vane's readings jump about, and where it should point then.

    Args:
        angles: Readings.
        around: Slow heading at the bins' centres [rad, continuous], shape (n,).
        grid: Bins.
        mask: Weight of the bins; those below a half do not count.

    Returns:
        Share of the readings; mean cosine and sine of the heading, zero for good readings.
    """
    place = np.floor(grid.seconds(angles.time) / grid.dt).astype(np.intp)
    inside = (place >= 0) & (place < grid.n)
    if mask is not None:
        inside[inside] = mask[place[inside]] > 0.5
    wrong = angles.erratic[inside].astype(np.float64)
    if wrong.size == 0 or not wrong.any():
        return np.zeros(ERRATIC)
    heading = around[place[inside]]
    return np.array(
        [np.mean(wrong), np.mean(wrong * np.cos(heading)), np.mean(wrong * np.sin(heading))]
    )


STEPS = 1
"""Number of statistics of coarse readings."""

_STEP_PARTS = 4
_ENOUGH_READINGS = 6000
_FINE = 0.1
_WAVES = (0.6, 1.25)
"""Waves per degree: for steps from 0.8 degrees on, a multiple of one over the step is there."""


def step_statistics(
    angles: Angles, grid: Grid, mask: FloatArray | None = None
) -> FloatArray:
    """How far a vane's readings come in even steps, 0 (not at all) to 1 (all of them).

    Steps tell themselves by readings that lie a whole number of them apart. A vane that sticks
    repeats its readings, too, but at any angle.

    Args:
        angles: Readings.
        grid: Bins.
        mask: Weight of the bins; those below a half do not count.

    Returns:
        Largest power of the readings' distribution at a fine wave, mean over parts of the record.
    """
    thinned = slice(None, None, max(1, angles.angle.size // _ENOUGH_READINGS))
    time, angle = angles.time[thinned], angles.angle[thinned]
    place = np.floor(grid.seconds(time) / grid.dt).astype(np.intp)
    counted = np.isfinite(angle) & (place >= 0) & (place < grid.n)
    if mask is not None:
        counted[counted] = mask[place[counted]] > 0.5
    size = round(360.0 / _FINE)
    fine = np.floor(np.degrees(angle[counted]) / _FINE).astype(np.intp) % size
    low, high = (round(2.0 * wave * 360.0) for wave in _WAVES)
    powers = []
    for part in np.array_split(fine, _STEP_PARTS):
        if part.size:
            counts = np.bincount(part, minlength=size) / part.size
            waves = np.abs(np.fft.rfft(counts, 2 * size)[low : high + 1])
            powers.append(float(np.max(waves)) ** 2)
    return np.array([np.mean(powers) if powers else 0.0])


LEAST_TURNS = 150
"""Bins with fewer turns say nothing about a vane's stillness."""

LEAST_REACH = 0.3
"""A vane that moves less than this share of its usual large turns stands."""

STANDSTILL = 0.01
"""Turns below this share of the usual large ones are none."""

STILLNESS = 3
"""Number of statistics of how still a vane stands between its movements."""


def stillness_statistics(
    series: FloatArray, usual: FloatArray, speed: FloatArray, mask: FloatArray | None = None
) -> FloatArray:
    """How small a vane's small turns are against its large ones.

    Args:
        series: Angle in each bin [rad], shape (n,).
        usual: What a healthy vane would show [rad], shape (n,).
        speed: Slow wind speed at the bins [m/s], shape (n,).
        mask: Weight of the bins; those below a half do not count.

    Returns:
        Logarithms of the 10 and 25 % quantiles of the turns from bin to bin over the 90 % one, in
        the slowest third of the record; the second for the rest. A vane that stands is compared
        with the usual turns.
    """
    out = np.zeros(STILLNESS)
    counted = np.ones(series.size - 1, dtype=np.bool_) if mask is None else mask[1:] > 0.5
    turns, expected = np.abs(np.diff(series))[counted], np.abs(np.diff(usual))[counted]
    speed = speed[1:][counted]
    if turns.size < LEAST_TURNS:
        return out
    slow = speed < np.quantile(speed, 0.33)
    if np.count_nonzero(slow) < LEAST_TURNS // 3:
        return out
    out[:2] = _smallness(turns[slow], expected[slow], (0.1, 0.25))
    out[2:] = _smallness(turns[~slow], expected[~slow], (0.25,))
    return out


COARSE_STILLNESS = 1.5
"""Standard deviation of the statistics of stillness where all readings come in steps."""


def chance_of_stillness(steps: float, other_steps: float) -> FloatArray:
    """How far `stillness_statistics` of two records may differ by the last digit of readings.

    Where readings come in steps a turn is a whole step or none, and a quantile jumps from one to
    the other with a few of them. Only steps that both records have are the last digit's.

    Args:
        steps, other_steps: Of the two records, see `step_statistics`.

    Returns:
        Standard deviation of each difference.
    """
    return np.full(STILLNESS, COARSE_STILLNESS * min(steps, other_steps))


def _smallness(turns: FloatArray, usual: FloatArray, shares: tuple[float, ...]) -> FloatArray:
    """Logarithms of quantiles over the 90 % one; neither is less than a part of the usual one."""
    large = float(np.quantile(usual, 0.9)) + 1e-9
    reach, *small = np.quantile(turns, (0.9, *shares))
    reach = max(float(reach), LEAST_REACH * large)
    return np.asarray(np.log((np.array(small) + STANDSTILL * large) / reach), dtype=np.float64)
