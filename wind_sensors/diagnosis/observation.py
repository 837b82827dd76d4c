"""What is compared: series on a common grid and statistics of the raw signals.

The same functions look at a recording and at its simulation, so that whatever they do to the
signals (binning, interpolation between pulses) they do to both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.station.model import Angle, Cup, Propeller, Rotor, Station
from wind_sensors.station.signals import Angles, Pulses, erratic

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

SERIES_INTERVAL = 0.2
"""Interval of the compared series [s]."""

NORMALISED_BANDS = np.array([0.12, 0.25, 0.45, 0.8, 1.3, 2.0, 3.2, 5.0])
"""Edges of the spectral bands in k times the instrument's length."""

LOWEST_BAND_FREQUENCY = 0.12
"""Spectral ratios begin here [Hz]; below, errors of the reference dominate."""

INTERVALS = 6
"""Number of statistics of the pulse intervals."""

STATISTICS = {
    "rotor_rate": (
        "share of long pulse intervals",
        "share of short pulse intervals",
        "unevenness of the slots",
        "unevenness of the slots once per turn",
        "beat of the pulses with the wind, once per turn",
        "beat of the pulses with the wind, twice per turn",
        "largest changes of the rate",
    ),
    "vane_angle": (
        "smallest turns in slow wind",
        "small turns in slow wind",
        "small turns in faster wind",
        "share of erratic readings",
        "direction in which readings are erratic",
        "direction in which readings are erratic",
        "steps of the readings",
        "largest turns",
    ),
}
"""What the statistics of a channel beyond its spectrum are, for people."""


@dataclass(frozen=True)
class Grid:
    """Bins of the compared series: [start, start + dt), ...

    Attributes:
        start: Recording's clock [ns].
        dt: [s].
        n: Number of bins.
    """

    start: int
    dt: float
    n: int

    @property
    def edges(self) -> FloatArray:
        """Edges of the bins, seconds since `start`, shape (n + 1,)."""
        return np.asarray(np.arange(self.n + 1) * self.dt, dtype=np.float64)

    @property
    def centres(self) -> FloatArray:
        """Middles of the bins, seconds since `start`, shape (n,)."""
        return np.asarray((np.arange(self.n) + 0.5) * self.dt, dtype=np.float64)

    def seconds(self, time: TimeArray) -> FloatArray:
        """Seconds since `start`."""
        return np.asarray((time - self.start) * 1e-9, dtype=np.float64)


@dataclass(frozen=True)
class Channel:
    """One compared quantity.

    Attributes:
        name: E.g. `cup/rotor_rate`, `vane/vane_angle`.
        instrument: Name of the instrument.
        kind: Rotor rate (as wind speed, m/s) or vane angle (rad).
        length: Length constant of the instrument's response [m].
    """

    name: str
    instrument: str
    kind: Literal["rotor_rate", "vane_angle"]
    length: float


def channels_of(station: Station) -> tuple[Channel, ...]:
    """The compared channels of a station, rotors first."""
    rotors = [
        Channel(f"{i.name}/rotor_rate", i.name, "rotor_rate", i.distance_constant)
        for i in station.instruments
        if isinstance(i, Rotor)
    ]
    vanes = [
        Channel(f"{i.name}/vane_angle", i.name, "vane_angle", i.distance_constant)
        for i in station.instruments
        if isinstance(i, Angle)
    ]
    return (*rotors, *vanes)


def rate_series(pulses: Pulses, rotor: Cup | Propeller, grid: Grid) -> FloatArray:
    """Wind speed that the turns within each bin mean, l times rotor rate [m/s], shape (n,).

    Times and turns are averaged over a revolution of pulses, so that slots and cups that differ do
    not beat with the bins. In between the rotor is taken to turn evenly, and as fast before the
    first and after the last for two pulses more; beyond that it stands.
    """
    time = grid.seconds(pulses.time)
    if time.size < 2:
        return np.zeros(grid.n)
    if pulses.turns is not None:
        turns = np.asarray(pulses.turns, dtype=np.float64)
    else:
        turns = np.arange(time.size) / rotor.pulses_per_revolution
    if np.any(np.diff(time) < 0.0):
        order = np.argsort(time, kind="stable")
        time, turns = time[order], np.sort(turns)
    slots = min(rotor.pulses_per_revolution, time.size - 1)
    at = _turns_at(grid.edges, time, turns, slots)
    return np.asarray(
        np.diff(at) * (2.0 * np.pi * rotor.calibration_distance / grid.dt), dtype=np.float64
    )


@compiled
def _turns_at(at: FloatArray, time: FloatArray, turns: FloatArray, slots: int) -> FloatArray:
    """Turns at given times, between the means over so many successive edges.

    Straight on for two edges beyond the first and the last; constant from there on.

    Args:
        at: Ascending, shape (n,).
        time, turns: Of the edges, ascending, shape (m,), m > slots.
        slots: Number of edges that are averaged.
    """
    beyond = 0.5 * (slots - 1) + 2.0
    points = time.size - slots + 1
    time_sum, turns_sum = 0.0, 0.0
    for k in range(slots):
        time_sum += time[k]
        turns_sum += turns[k]
    x_1, y_1 = time_sum / slots, turns_sum / slots
    x_0 = x_1 - beyond * (time[slots] - time[0]) / slots
    y_0 = y_1 - beyond * (turns[slots] - turns[0]) / slots
    point = 0
    out = np.empty(at.size)
    for i in range(at.size):
        while at[i] > x_1 and point < points:
            point += 1
            if point < points:
                x_0, y_0 = x_1, y_1
                time_sum += time[point + slots - 1] - time[point - 1]
                turns_sum += turns[point + slots - 1] - turns[point - 1]
                x_1, y_1 = time_sum / slots, turns_sum / slots
            else:
                time_step, turns_step = x_1 - x_0, y_1 - y_0
                x_0, y_0 = x_1, y_1
                x_1 += beyond * time_step
                y_1 += beyond * turns_step
        if at[i] >= x_1:
            out[i] = y_1
        elif at[i] <= x_0:
            out[i] = y_0
        else:
            out[i] = y_0 + (y_1 - y_0) * (at[i] - x_0) / (x_1 - x_0)
    return out


def angle_series(
    angles: Angles, around: FloatArray, grid: Grid, expected: FloatArray | None = None
) -> FloatArray:
    """Mean reading in each bin, as the deviation from a slow heading [rad], shape (n,).

    Args:
        angles: Readings.
        around: Slow heading at the bins' centres [rad, continuous], shape (n,).
        grid: Bins.
        expected: Deviation that stands in where readings jump about, shape (n,); None: none does.

    Returns:
        Deviations within (-pi, pi], continued where a bin holds no reading.
    """
    loose = erratic(angles)
    time = grid.seconds(angles.time)
    place = np.floor(time / grid.dt).astype(np.intp)
    usable = np.isfinite(angles.angle) & ~loose
    index, reading = place[usable], angles.angle[usable]
    inside = (index >= 0) & (index < grid.n)
    index, reading = index[inside], reading[inside]
    deviation = reading - around[index]
    c = np.bincount(index, np.cos(deviation), grid.n)
    s = np.bincount(index, np.sin(deviation), grid.n)
    filled = (c != 0.0) | (s != 0.0)
    if not filled.any():
        return np.zeros(grid.n)
    mean = np.arctan2(s, c)
    if expected is not None and loose.any():
        unknown = np.zeros(grid.n, dtype=np.bool_)
        unknown[place[loose & (place >= 0) & (place < grid.n)]] = True
        unknown &= ~filled
        mean[unknown] = expected[unknown]
        filled |= unknown
    if not filled.all():
        mean = np.interp(np.arange(grid.n), np.flatnonzero(filled), mean[filled])
    return np.asarray(mean, dtype=np.float64)


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
    wrong = erratic(angles)[inside].astype(np.float64)
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


def _smallness(turns: FloatArray, usual: FloatArray, shares: tuple[float, ...]) -> FloatArray:
    """Logarithms of quantiles over the 90 % one; neither is less than a part of the usual one."""
    large = float(np.quantile(usual, 0.9)) + 1e-9
    reach = max(float(np.quantile(turns, 0.9)), LEAST_REACH * large)
    small = np.quantile(turns, shares) + STANDSTILL * large
    return np.asarray(np.log(small / reach), dtype=np.float64)


CHANGES = 1
"""Number of statistics of the largest changes of a series."""

FEWEST_CHANGES = 500
"""Two per cent of fewer tell of single events."""

LEAST_USUAL = 0.2
"""Usual changes are no less than this share of the largest: what mostly stands tells its stillness,
and would drown all else here."""


def change_statistics(
    series: FloatArray, speed: FloatArray, mask: FloatArray | None = None
) -> FloatArray:
    """How large the largest changes from bin to bin are against the usual ones.

    Damping and inertia make all changes smaller, in proportion. A limit, a play or a catch does
    not.

    Args:
        series: Value in each bin, shape (n,).
        speed: Slow wind speed at the bins [m/s], shape (n,); its slowest third does not count.
        mask: Weight of the bins; those below a half do not count.

    Returns:
        Logarithm of the 98 % quantile over the 75 % one; 0 where too little changes.
    """
    counted = speed[1:] >= np.quantile(speed, 1.0 / 3.0)
    if mask is not None:
        counted &= (mask[1:] > 0.5) & (mask[:-1] > 0.5)
    changes = np.abs(np.diff(series))[counted]
    if changes.size < FEWEST_CHANGES:
        return np.zeros(CHANGES)
    usual, large = np.quantile(changes, (0.75, 0.98))
    if large <= 0.0:
        return np.zeros(CHANGES)
    return np.array([np.log(large / max(usual, LEAST_USUAL * large))])


SLOW_TURN = 2.5
"""A rotor that takes so many times longer for its turns than the wind asks for is about to stop:
its intervals tell of the wind that it stops in."""


def interval_statistics(
    pulses: Pulses,
    rotor: Cup | Propeller,
    direction: FloatArray,
    speed: FloatArray,
    grid: Grid,
    mask: FloatArray | None = None,
) -> FloatArray:
    """How the pulse intervals are distributed within a revolution, whatever the wind.

    Args:
        pulses: Edges.
        rotor: The rotor.
        direction: Direction of the wind in the plane of rotation at the bins' centres [rad].
        speed: Slow wind speed at the bins [m/s]; what turns far slower does not count.
        grid: Bins of both.
        mask: Weight of the bins; intervals where it is below a half do not count.

    Returns:
        Share of intervals over 1.6 and under 0.4 times their neighbourhood's mean; of the slots'
        mean relative intervals the scatter without, and the amplitude of, the part that swings
        once per revolution; of what departs from those means the amplitudes once and twice per
        revolution locked to the wind's direction (0 where the pulses are too few to tell).
    """
    weight = np.ones(grid.n) if mask is None else mask
    usual = 2.0 * np.pi * rotor.calibration_distance / np.maximum(speed, 0.1)
    longest = SLOW_TURN * usual / rotor.pulses_per_revolution
    return _interval_statistics(
        grid.seconds(pulses.time), rotor.pulses_per_revolution, direction, longest, weight, grid.dt
    )


@compiled
def _interval_statistics(
    time: FloatArray,
    slots: int,
    direction: FloatArray,
    longest: FloatArray,
    weight: FloatArray,
    dt: float,
) -> FloatArray:
    out = np.zeros(INTERVALS)
    edges = time.size
    if edges < 200:
        return out
    window = max(5, 2 * (slots // 2) + 1) if slots > 1 else 5
    half = window // 2
    long = 0
    short = 0
    counted = 0
    bins_per_second = 1.0 / dt
    last_bin = weight.size - 1
    for i in range(window, edges - 1 - window):
        place = min(max(int(time[i] * bins_per_second), 0), last_bin)
        if weight[place] <= 0.5:
            continue
        around = time[i + half + 1] - time[i - half]
        if around > longest[place] * window:
            continue
        interval = (time[i + 1] - time[i]) * window
        counted += 1
        if interval > 1.6 * around:
            long += 1
        elif interval < 0.4 * around:
            short += 1
    if counted < 100:
        return out
    out[0] = long / counted
    out[1] = short / counted
    if slots < 3:
        return out
    # By slot: number, deviation, and both times the wind's direction once and twice per turn.
    number = np.zeros((slots, 5))
    total = np.zeros((slots, 5))
    squares = 0.0
    wind = np.empty((weight.size, 4))
    wind[:, 0], wind[:, 1] = np.cos(direction), np.sin(direction)
    wind[:, 2], wind[:, 3] = np.cos(2.0 * direction), np.sin(2.0 * direction)
    first = slots // 2
    slot = first - 1
    kept = 0
    for j in range(edges - slots):
        i = j + first
        slot = 0 if slot + 1 == slots else slot + 1
        place = min(max(int(time[i] * bins_per_second), 0), last_bin)
        if weight[place] <= 0.5:
            continue
        revolution = max(time[j + slots] - time[j], 1e-9)
        if revolution > longest[place] * slots:
            continue
        deviation = (time[i + 1] - time[i]) * slots / revolution - 1.0
        deviation = min(max(deviation, -0.8), 0.8)
        squares += deviation * deviation
        kept += 1
        number[slot, 0] += 1.0
        total[slot, 0] += deviation
        for m in range(4):
            number[slot, m + 1] += wind[place, m]
            total[slot, m + 1] += deviation * wind[place, m]
    if kept < 100:
        return out
    means = total[:, 0] / np.maximum(number[:, 0], 1.0)
    angle = 2.0 * math.pi / slots * np.arange(slots)
    slot_cos, slot_sin = np.cos(angle), np.sin(angle)
    error = max(squares / kept - np.mean(means**2), 0.0) / kept
    once = (2.0 * np.sum(means * slot_cos) / slots) ** 2
    once += (2.0 * np.sum(means * slot_sin) / slots) ** 2
    once = max(once - 4.0 * error, 0.0)
    out[2] = math.sqrt(max(np.var(means) - 0.5 * once - error * slots, 0.0))
    out[3] = math.sqrt(once)
    for m in range(2 if slots > 4 else 1):
        if m == 1:
            slot_cos, slot_sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
        # What is fixed to the disc says nothing about the wind's direction.
        away = total[:, 2 * m + 1] - means * number[:, 2 * m + 1]
        across = total[:, 2 * m + 2] - means * number[:, 2 * m + 2]
        along = np.sum(slot_cos * away + slot_sin * across)
        aside = np.sum(slot_sin * away - slot_cos * across)
        out[4 + m] = 2.0 * math.hypot(along, aside) / kept
    return out
