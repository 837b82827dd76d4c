"""What is compared: series on a common grid.

The same functions look at a recording and at its simulation, so that whatever they do to the
signals (binning, interpolation between pulses) they do to both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.station.model import Angle, Cup, Propeller, Rotor, Station
from wind_sensors.station.signals import Angles, Pulses

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
TimeArray = npt.NDArray[np.int64]

UNHEARD = 1.0
"""So long [s] at its ends a record may lack the pulses of a rotor that turns: a clock that is late
stamps those of the first moments before it was there to hear them."""

SERIES_INTERVAL = 0.2
"""Interval of the compared series [s]."""

NORMALISED_BANDS = np.array([0.12, 0.25, 0.45, 0.8, 1.3, 2.0, 3.2, 5.0])
"""Edges of the spectral bands in k times the instrument's length."""

LOWEST_BAND_FREQUENCY = 0.12
"""Spectral ratios begin here [Hz]; below, errors of the reference dominate."""


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
        return _seconds_since(np.asarray(time, dtype=np.int64), self.start)


@compiled
def _seconds_since(time: TimeArray, start: int) -> FloatArray:
    """Nanoseconds as seconds, without the large temporary arrays of whole-array arithmetic."""
    out = np.empty(time.size)
    for i in range(time.size):
        out[i] = (time[i] - start) * 1e-9
    return out


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
    first and after the last for two pulses more, or for `UNHEARD` at the ends of the record; beyond
    that it stands.
    """
    time = grid.seconds(pulses.time)
    if time.size < 2:
        return np.zeros(grid.n)
    # Without angles each edge is one slot more: no array is needed to say so.
    turns = np.empty(0) if pulses.turns is None else np.asarray(pulses.turns, dtype=np.float64)
    if np.any(time[1:] < time[:-1]):
        # Only few are out of order: stable sorts are quick then, the usual one is not.
        time, turns = np.sort(time, kind="stable"), np.sort(turns, kind="stable")
    slots = min(rotor.pulses_per_revolution, time.size - 1)
    at = _turns_at(grid.edges, time, turns, 1.0 / rotor.pulses_per_revolution, slots)
    return np.asarray(
        np.diff(at) * (2.0 * np.pi * rotor.calibration_distance / grid.dt), dtype=np.float64
    )


@compiled
def _interval(time: FloatArray, slots: int, first: int) -> float:
    """Time from one edge to the next [s]: the middle of three, each a mean over `slots` of them.

    Args:
        time: Of the edges [s], ascending, shape (m,).
        slots: Number of intervals that are averaged.
        first: Edge with which the first of the three begins.
    """
    first = max(first, 0)
    last = min(first + 2 * slots, time.size - slots - 1)
    one = time[first + slots] - time[first]
    other = time[last + slots] - time[last]
    middle = (first + last) // 2
    between = time[middle + slots] - time[middle]
    others = max(one, other, between) + min(one, other, between)
    return float((one + other + between - others) / slots)


@compiled
def _turns_at(
    at: FloatArray, time: FloatArray, turns: FloatArray, turns_each: float, slots: int
) -> FloatArray:
    """Turns at given times, between the means over so many successive edges.

    Straight on for two edges beyond the first and the last, and to the ends of the record if those
    are near; constant from there on. How fast, the middle of three intervals says: one of them may
    be a bounce.

    Args:
        at: Ascending, shape (n,).
        time: Of the edges, ascending, shape (m,), m > slots.
        turns: At the edges, ascending, shape (m,); empty: `turns_each` at each.
        turns_each: From one edge to the next.
        slots: Number of edges that are averaged.
    """
    even = turns.size == 0
    beyond = 0.5 * (slots - 1) + 2.0
    points = time.size - slots + 1
    time_sum = float(np.sum(time[:slots]))
    turns_sum = turns_each * 0.5 * slots * (slots - 1) if even else float(np.sum(turns[:slots]))
    turns_step = turns_each * slots if even else turns[slots] - turns[0]
    per_slot = 1.0 / slots
    x_1, y_1 = time_sum * per_slot, turns_sum * per_slot
    x_0 = x_1 - beyond * _interval(time, slots, 0)
    y_0 = y_1 - beyond * turns_step * per_slot
    if at[0] < x_0 < at[0] + UNHEARD and x_0 < x_1:
        y_0 -= (x_0 - at[0]) * (y_1 - y_0) / (x_1 - x_0)
        x_0 = at[0]
    point = 0
    out = np.empty(at.size)
    for i in range(at.size):
        while at[i] > x_1 and point < points:
            point += 1
            if point < points:
                x_0, y_0 = x_1, y_1
                time_sum += time[point + slots - 1] - time[point - 1]
                if not even:
                    turns_step = turns[point + slots - 1] - turns[point - 1]
                turns_sum += turns_step
                x_1, y_1 = time_sum * per_slot, turns_sum * per_slot
            else:
                time_step, turns_step = _interval(time, slots, time.size - 3 * slots - 1), y_1 - y_0
                x_0, y_0 = x_1, y_1
                x_1 += beyond * time_step
                y_1 += beyond * turns_step
                if at[-1] - UNHEARD < x_1 < at[-1] and time_step > 0.0:
                    y_1 += (at[-1] - x_1) * turns_step / time_step
                    x_1 = at[-1]
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
    loose = angles.erratic
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
        unknown = where_untold(angles, grid)
        mean[unknown] = expected[unknown]
        filled |= unknown
    if not filled.all():
        mean = np.interp(np.arange(grid.n), np.flatnonzero(filled), mean[filled])
    return np.asarray(mean, dtype=np.float64)


def where_untold(angles: Angles, grid: Grid) -> BoolArray:
    """Bins in which every reading jumps about, shape (n,): no direction is told there."""
    loose = angles.erratic
    if not loose.any():
        return np.zeros(grid.n, dtype=np.bool_)
    place = np.floor(grid.seconds(angles.time) / grid.dt).astype(np.intp)
    inside = (place >= 0) & (place < grid.n)
    told = inside & np.isfinite(angles.angle) & ~loose
    without, with_direction = (
        np.bincount(place[which], minlength=grid.n) > 0 for which in (inside & loose, told)
    )
    return without & ~with_direction
