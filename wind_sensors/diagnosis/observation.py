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
from wind_sensors.station.signals import Angles, Pulses

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

    The rotor is taken to turn evenly between two pulses; before the first and after the last it
    stands.
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
    at = np.interp(grid.edges, time, turns)
    return np.asarray(
        np.diff(at) * (2.0 * np.pi * rotor.calibration_distance / grid.dt), dtype=np.float64
    )


def angle_series(angles: Angles, around: FloatArray, grid: Grid) -> FloatArray:
    """Mean reading in each bin, as the deviation from a slow heading [rad], shape (n,).

    Args:
        angles: Readings.
        around: Slow heading at the bins' centres [rad, continuous], shape (n,).
        grid: Bins.

    Returns:
        Deviations within (-pi, pi], continued where a bin holds no reading.
    """
    time = grid.seconds(angles.time)
    usable = np.isfinite(angles.angle)
    time, reading = time[usable], angles.angle[usable]
    index = np.floor(time / grid.dt).astype(np.intp)
    inside = (index >= 0) & (index < grid.n)
    index, reading = index[inside], reading[inside]
    deviation = reading - around[index]
    c = np.bincount(index, np.cos(deviation), grid.n)
    s = np.bincount(index, np.sin(deviation), grid.n)
    filled = (c != 0.0) | (s != 0.0)
    if not filled.any():
        return np.zeros(grid.n)
    mean = np.arctan2(s, c)
    if not filled.all():
        mean = np.interp(np.arange(grid.n), np.flatnonzero(filled), mean[filled])
    return np.asarray(mean, dtype=np.float64)


STILLNESS = 3
"""Number of statistics of how still a vane stands between its movements."""


def stillness_statistics(
    series: FloatArray, speed: FloatArray, mask: FloatArray | None = None
) -> FloatArray:
    """How still a vane stands between its movements: small turns against large ones.

    Args:
        series: Angle in each bin [rad], shape (n,).
        speed: Slow wind speed at the bins [m/s], shape (n,).
        mask: Weight of the bins; those below a half do not count.

    Returns:
        Logarithms of the ratios of quantiles (25 to 75 %, 10 to 50 %) of the turns from bin to bin
        in the slowest third of the record, and the first for the rest.
    """
    turns = np.abs(np.diff(series)) + 1e-6
    if mask is not None:
        turns, speed = turns[mask[1:] > 0.5], speed[mask > 0.5]
        speed = speed[: turns.size]
        turns = turns[: speed.size]
    else:
        speed = speed[1:]
    if turns.size < 150:
        return np.zeros(STILLNESS)
    slow = speed < np.quantile(speed, 0.33)
    out = np.zeros(STILLNESS)
    if np.count_nonzero(slow) < 50:
        return out
    q = np.quantile(turns[slow], (0.1, 0.25, 0.5, 0.75))
    out[0], out[1] = np.log(q[1] / q[3]), np.log(q[0] / q[2])
    q = np.quantile(turns[~slow], (0.25, 0.75))
    out[2] = np.log(q[0] / q[1])
    return out


def interval_statistics(
    pulses: Pulses,
    rotor: Cup | Propeller,
    direction: FloatArray,
    grid: Grid,
    mask: FloatArray | None = None,
) -> FloatArray:
    """How the pulse intervals are distributed within a revolution, whatever the wind.

    Args:
        pulses: Edges.
        rotor: The rotor.
        direction: Direction of the wind in the plane of rotation at the bins' centres [rad].
        grid: Bins of `direction`.
        mask: Weight of the bins; intervals where it is below a half do not count.

    Returns:
        Share of intervals over 1.6 and under 0.4 times their neighbourhood's mean; relative
        scatter of the slots' mean intervals; amplitude of the relative interval once per
        revolution locked to the slot, once and twice per revolution locked to the wind's
        direction (0 where the pulses are too few to tell).
    """
    weight = np.ones(grid.n) if mask is None else mask
    return _interval_statistics(
        grid.seconds(pulses.time), rotor.pulses_per_revolution, direction, weight, grid.dt
    )


@compiled
def _interval_statistics(
    time: FloatArray, slots: int, direction: FloatArray, weight: FloatArray, dt: float
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
    for i in range(window, edges - 1 - window):
        place = min(max(int(time[i] / dt), 0), weight.size - 1)
        if weight[place] <= 0.5:
            continue
        local = (time[i + half + 1] - time[i - half]) / window
        relative = (time[i + 1] - time[i]) / max(local, 1e-9)
        counted += 1
        if relative > 1.6:
            long += 1
        elif relative < 0.4:
            short += 1
    if counted < 100:
        return out
    out[0] = long / counted
    out[1] = short / counted
    if slots < 3:
        return out
    total = np.zeros(slots)
    number = np.zeros(slots)
    squares = 0.0
    angle = 2.0 * math.pi / slots * np.arange(slots)
    slot_cos, slot_sin = np.cos(angle), np.sin(angle)
    wind_cos, wind_sin = np.cos(direction), np.sin(direction)
    slot_x, slot_y, once_x, once_y, twice_x, twice_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    first = slots // 2
    slot = first - 1
    kept = 0
    for j in range(edges - slots):
        i = j + first
        slot = 0 if slot + 1 == slots else slot + 1
        place = min(max(int(time[i] / dt), 0), weight.size - 1)
        if weight[place] <= 0.5:
            continue
        revolution = (time[j + slots] - time[j]) / slots
        deviation = (time[i + 1] - time[i]) / max(revolution, 1e-9) - 1.0
        deviation = min(max(deviation, -0.8), 0.8)
        total[slot] += deviation
        number[slot] += 1.0
        squares += deviation * deviation
        kept += 1
        c, s = slot_cos[slot], slot_sin[slot]
        slot_x += deviation * c
        slot_y += deviation * s
        away_cos = c * wind_cos[place] + s * wind_sin[place]
        away_sin = s * wind_cos[place] - c * wind_sin[place]
        once_x += deviation * away_cos
        once_y += deviation * away_sin
        twice_x += deviation * (away_cos * away_cos - away_sin * away_sin)
        twice_y += deviation * 2.0 * away_cos * away_sin
    if kept < 100:
        return out
    means = total / np.maximum(number, 1.0)
    variance = squares / kept - (np.sum(total) / kept) ** 2
    out[2] = math.sqrt(max(np.var(means) - variance * slots / kept, 0.0))
    out[3] = 2.0 * math.hypot(slot_x, slot_y) / kept
    out[4] = 2.0 * math.hypot(once_x, once_y) / kept
    if slots > 4:
        out[5] = 2.0 * math.hypot(twice_x, twice_y) / kept
    return out
