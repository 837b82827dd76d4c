"""Readings of vanes: erratic ones, coarse ones, and how still a vane stands."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.station.signals import Angles

FloatArray = npt.NDArray[np.float64]

ERRATIC = 3
"""Number of statistics of readings that tell no direction."""


def erratic_statistics(
    angles: Angles, around: FloatArray, grid: Grid, mask: FloatArray | None = None
) -> FloatArray:
    """How much of the time a vane's readings tell no direction, and where it should point then.

    They jump about, or are one number again and again.

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
    wrong = np.maximum(angles.erratic, angles.at_one_number)[inside]
    if wrong.size == 0 or not wrong.any():
        return np.zeros(ERRATIC)
    heading = around[place[inside]]
    return np.array(
        [np.mean(wrong), np.mean(wrong * np.cos(heading)), np.mean(wrong * np.sin(heading))]
    )


ALONE_FOR = 1.5
"""Where a vane points is one draw for so long [s]: half of its turning follows eddies that the
reference knows. In 24 recordings with gaps (4 to 50 % of the readings) the shares depart from the
simulated ones by 1.0 times what this lets be chance."""


def chance_of_erratic(share: float, other_share: float, seconds: float) -> float:
    """How far `erratic_statistics` of two records may differ by where the vane pointed.

    What both records have hangs on eddies that no reference knows.

    Args:
        share, other_share: Of the readings of the two records.
        seconds: That count.

    Returns:
        Standard deviation of each of the differences.
    """
    both = min(share, other_share)
    return float(np.sqrt(both * (1.0 - both) * ALONE_FOR / max(seconds, ALONE_FOR)))


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
    some = Angles(angles.time[thinned], angles.angle[thinned])
    counted = _counted_readings(some, grid, mask)
    size = round(360.0 / _FINE)
    fine = np.floor(np.degrees(some.angle[counted]) / _FINE).astype(np.intp) % size
    low, high = (round(2.0 * wave * 360.0) for wave in _WAVES)
    powers = []
    for part in np.array_split(fine, _STEP_PARTS):
        if part.size:
            counts = np.bincount(part, minlength=size) / part.size
            waves = np.abs(np.fft.rfft(counts, 2 * size)[low : high + 1])
            powers.append(float(np.max(waves)) ** 2)
    return np.array([np.mean(powers) if powers else 0.0])


STEPS_OF_STANDS = 4.2
"""The statistic of coarse readings of a vane that rests here and there at any angle, in units of
`standing_share`: of M independent waves the largest has log M + 0.6 times that share (5.5 for 130)
where no rest is much longer than the others; 3.6 to 4.4 in four recordings of vanes that stick."""

SWINGING = 0.001
"""`standing_share` of a vane that swings is less (0.0002 to 0.0005 on healthy days)."""

STANDS_KNOWN_TO = 0.5
"""How long such a vane rests is simulated to about this share."""

SAME_READING = 0.25
"""Readings [deg] that lie no further from that at which a vane came to rest are at rest."""


def standing_share(angles: Angles, grid: Grid, mask: FloatArray | None = None) -> float:
    """How far few stands make up a vane's readings: sum of the squares of their shares of a part
    of the record, mean over the parts of `step_statistics`.

    One over the number of stands where all last equally long; next to nothing where the vane
    swings.

    Args:
        angles: Readings.
        grid: Bins.
        mask: Weight of the bins; those below a half do not count.
    """
    counted = _counted_readings(angles, grid, mask)
    shares = []
    for part in np.array_split(np.degrees(angles.angle[counted]), _STEP_PARTS):
        if part.size:
            lengths = _lengths_of_stands(part.tolist())
            shares.append(float(np.sum(np.square(lengths))) / part.size**2)
    return float(np.mean(shares)) if shares else 0.0


def _lengths_of_stands(readings: list[float]) -> list[int]:
    """Numbers of successive readings [deg] that do not leave the first of them."""
    lengths = [0]
    at = readings[0]
    for reading in readings:
        if abs((reading - at + 180.0) % 360.0 - 180.0) > SAME_READING:
            at = reading
            lengths.append(0)
        lengths[-1] += 1
    return lengths


def _counted_readings(
    angles: Angles, grid: Grid, mask: FloatArray | None
) -> npt.NDArray[np.bool_]:
    """Readings that are numbers, inside the bins that count."""
    place = np.floor(grid.seconds(angles.time) / grid.dt).astype(np.intp)
    counted = np.isfinite(angles.angle) & (place >= 0) & (place < grid.n)
    if mask is not None:
        counted[counted] = mask[place[counted]] > 0.5
    return np.asarray(counted)


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


def chance_of_steps(standing: float, other_steps: float) -> float:
    """How far `step_statistics` of two records may differ by where a vane came to rest.

    Where it stands long in both, a few angles decide. One that swings does not show steps.

    Args:
        standing: `standing_share` of one.
        other_steps: `step_statistics` of the other.
    """
    rests = STEPS_OF_STANDS * max(standing - SWINGING, 0.0)
    return STANDS_KNOWN_TO * min(rests, other_steps)


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
