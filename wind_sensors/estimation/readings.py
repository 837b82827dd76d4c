"""From a vane's readings back to the heading of its nose: what mounting and sensor did."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import axes_of
from wind_sensors.estimation.intake import Series
from wind_sensors.estimation.timeline import Timeline
from wind_sensors.station.model import Angle, Station
from wind_sensors.station.signals import Angles, BoolArray, erratic_readings

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_SHARE_OF_FILTER = 0.25
_LONGEST_STEP = 0.2
"""Readings behind a low-pass filter are compared over this share of its time constant, at most so
long [s]: long enough for noise not to swamp their difference."""

LOOSE_STEP = np.radians(25.0)
"""Jump of a wiper that is known to float [rad]."""

_RECENT_READINGS = 8
"""So many of the last block's readings are remembered to see jumps at a block's beginning."""


class Headings(NamedTuple):
    """Usable readings.

    Attributes:
        time: [ns], shape (n,).
        heading: Of the nose [rad], shape (n,).
        half_width: 0 for an ordinary reading; otherwise the nose is anywhere within so much of
            `heading` [rad], shape (n,).
    """

    time: TimeArray
    heading: FloatArray
    half_width: FloatArray

    def part(self, where: npt.NDArray[np.bool_]) -> Headings:
        """Some of them."""
        return Headings(self.time[where], self.heading[where], self.half_width[where])


def wrapped(angle: FloatArray) -> FloatArray:
    """Within -pi..pi [rad]."""
    out: FloatArray = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
    return out


def headings(
    vane: Angle, time: TimeArray, reading: FloatArray, origin: int, loose: BoolArray | None = None
) -> Headings:
    """Undo sensor and mounting.

    Args:
        vane: The vane with what is known to be wrong with it.
        time: Of the measurements [ns], shape (n,).
        reading: As delivered [rad], shape (n,).
        origin: Start of the recording [ns]; outages count from there.
        loose: Readings that jump about; None: as far as these readings show it.

    Returns:
        Readings outside outages. One inside the potentiometer's gap says only that the nose is
        somewhere in the gap, or in its nearer half where the reading stays at the edge. A
        floating wiper's readings jump about while the nose is there.
    """
    since = (time - origin) * 1e-9
    if loose is None:
        floats = vane.gap_width_deg > 0.0 and vane.gap_reading_deg == "floating"
        loose = erratic_readings(Angles(time, reading), LOOSE_STEP) & floats
    usable = np.isfinite(reading)
    for outage in vane.outages:
        usable &= (since < outage.start) | (since >= outage.stop)
    time, angle, loose = time[usable], reading[usable], loose[usable]
    half_width = np.zeros(angle.shape[0])
    if vane.reversed:
        angle = -angle
    if vane.gap_width_deg > 0.0:
        width, centre = np.radians(vane.gap_width_deg), np.radians(vane.gap_centre_deg)
        off = wrapped(angle - centre)
        tolerance = 0.5 * np.radians(vane.quantisation_deg) + 1e-6
        if vane.gap_reading_deg is None:
            inside = np.abs(off) <= 0.5 * width + tolerance
            middle, reach = centre + 0.25 * width * np.sign(off), 0.25 * width
        elif vane.gap_reading_deg == "floating":
            inside = loose | (np.abs(off) < 0.5 * width - tolerance)
            middle, reach = np.full_like(angle, centre), 0.5 * width
        else:
            shown = wrapped(angle - np.radians(vane.gap_reading_deg))
            inside = (np.abs(shown) <= tolerance) | (np.abs(off) < 0.5 * width - tolerance)
            middle, reach = np.full_like(angle, centre), 0.5 * width
        angle = np.where(inside, middle, angle)
        half_width = np.where(inside, reach, half_width)
    angle = wrapped(angle - np.radians(vane.offset_deg))
    amplitude = np.radians(vane.eccentricity_deg)
    if amplitude != 0.0:
        phase = np.radians(vane.eccentricity_phase_deg)
        heading = angle.copy()
        for _ in range(8):
            heading = angle - amplitude * np.sin(heading - phase)
        angle = heading
    return Headings(time, angle, half_width)


class NoseReader:
    """Headings from the readings of one vane, or one axis of a bivane, block by block.

    A low-pass filter is undone: reading + time constant * rate of the reading, taken over steps of
    some samples. The intake has already moved the stamps back by the time constant, so that every
    reading arrives before its heading belongs into a block.

    Args:
        name: Of the axis: `<vane>`, `<bivane>`, `<bivane>/elevation`.
        station: The station with its changes.
        origin: Start of the recording [ns].
    """

    def __init__(self, name: str, station: Station, origin: int) -> None:
        self._timeline = Timeline(station, origin)
        self._origin = origin
        self._instruments = [
            next(a.instrument for a in axes_of(s) if a.name == name)
            for s in self._timeline.stations
        ]
        self._last: tuple[int, float] | None = None
        self._floats = any(a.gap_reading_deg == "floating" for a in self._instruments)
        self._recent = Angles(np.empty(0, dtype=np.int64), np.empty(0))
        self._waiting = Headings(np.empty(0, dtype=np.int64), np.empty(0), np.empty(0))

    def read(self, part: Series, stop: int) -> Headings:
        """Headings before `stop` [ns] from a block's readings, and those that waited for it."""
        found = [self._waiting]
        loose = self._loose(part)
        for number, here in self._timeline.parts(part.time):
            vane = self._instruments[number]
            plain = headings(vane, part.time[here], part.value[here, 0], self._origin, loose[here])
            found.append(self._unfiltered(plain, vane.filter_time_constant))
        together = Headings(*(np.concatenate(columns) for columns in zip(*found, strict=True)))
        ready = together.time < stop
        self._waiting = together.part(~ready)
        return together.part(ready)

    def _loose(self, part: Series) -> BoolArray:
        """Readings that jump about, seen together with the last ones before."""
        if not self._floats:
            return np.zeros(part.time.size, dtype=np.bool_)
        known = self._recent.time.size
        together = Angles(
            np.concatenate((self._recent.time, part.time)),
            np.concatenate((self._recent.angle, part.value[:, 0])),
        )
        kept = slice(max(known + part.time.size - _RECENT_READINGS, 0), None)
        self._recent = Angles(together.time[kept], together.angle[kept])
        return erratic_readings(together, LOOSE_STEP)[known:]

    def _unfiltered(self, seen: Headings, constant: float) -> Headings:
        if constant <= 0.0:
            self._last = None
            return seen
        step = round(min(_SHARE_OF_FILTER * constant, _LONGEST_STEP) * 1e9)
        delay = round(constant * 1e9)
        time, angle, half_width = [], [], []
        for t, reading, reach in zip(*(c.tolist() for c in seen), strict=True):
            if self._last is not None and t - self._last[0] < step:
                continue
            before, self._last = self._last, (t, reading)
            if before is None or t - before[0] > delay:
                # Too far from the last one for a rate: the filter is taken for a mere delay.
                time.append(t)
                angle.append(reading)
            else:
                passed = (t - before[0]) * 1e-9
                turned = float(wrapped(np.array(reading - before[1])))
                time.append(t + delay - (t - before[0]) // 2)
                angle.append(reading + turned * (constant / passed - 0.5))
            half_width.append(reach)
        return Headings(
            np.array(time, dtype=np.int64), np.array(angle, dtype=np.float64),
            np.array(half_width, dtype=np.float64),
        )
