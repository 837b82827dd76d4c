"""Recent messages that a method without a filter needs again."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import axes_of, counted_pair, rotors_of
from wind_sensors.estimation.intake import Block, Series
from wind_sensors.estimation.readings import NoseReader
from wind_sensors.estimation.timeline import Timeline
from wind_sensors.estimation.turn_counting import TurnCounter
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


class RotorTrack:
    """Edges of one rotor.

    Args:
        name: Of the rotor.
        station: The station with its changes.
        origin: Start of the recording [ns].
        restored: Undo what the station file says about lost and false edges.

    Attributes:
        rotor: The rotor as it is at first.
        time: [ns], shape (n,).
        angle: Turned angle at the edges [rad], shape (n,).
    """

    def __init__(self, name: str, station: Station, origin: int, restored: bool = True) -> None:
        self._origin = origin
        self._timeline = Timeline(station, origin)
        self._rotors = [
            next(r for r in rotors_of(s) if r.name == name) for s in self._timeline.stations
        ]
        self.rotor = self._rotors[0]
        self._counter = TurnCounter(self.rotor, origin) if restored else None
        self._count = 0.0
        self.time: TimeArray = np.empty(0, dtype=np.int64)
        self.angle: FloatArray = np.empty(0)

    def take(self, part: Series) -> int:
        """Add a block's edges; their number."""
        turns = part.value[:, 0]
        told = not np.isnan(turns).any() or self._counter is None
        new = 0
        for number, here in self._timeline.parts(part.time):
            if told or self._counter is None:
                time, angle = part.time[here], self._as_told(turns[here])
            else:
                time, angle = self._counter.count(self._rotors[number], part.time[here])
            self.time = np.concatenate((self.time, time))
            self.angle = np.concatenate((self.angle, angle))
            new += int(time.size)
        return new

    def is_silenced(self, time: int) -> bool:
        """Whether an instant [ns] lies in an outage that the station file states."""
        rotor = self._rotors[self._timeline.number(time)]
        since = (time - self._origin) * 1e-9
        return any(o.start <= since < o.stop for o in rotor.outages)

    def _as_told(self, turns: FloatArray) -> FloatArray:
        if not turns.size:
            return turns
        step = 2.0 * np.pi / self.rotor.pulses_per_revolution
        counted = self._count + step * np.arange(1, turns.size + 1)
        angle: FloatArray = np.where(np.isnan(turns), counted, 2.0 * np.pi * turns)
        self._count = float(angle[-1])
        return angle

    def forget_before(self, since: int) -> None:
        """Drop what is older than a time [ns]; two edges stay, however old."""
        cut = min(int(np.searchsorted(self.time, since)), max(self.time.size - 2, 0))
        self.time, self.angle = self.time[cut:], self.angle[cut:]

    def latest_speed(self, times: TimeArray) -> FloatArray:
        """y = l s [m/s] of the latest interval between edges at some times, shape (n,).

        Silence longer than that interval lowers the speed to what the silence allows.
        """
        if self.time.size < 2:
            return np.zeros(times.size)
        last = np.clip(np.searchsorted(self.time, times, side="right") - 1, 1, self.time.size - 1)
        dt = (self.time[last] - self.time[last - 1]) * 1e-9
        turned = self.angle[last] - self.angle[last - 1]
        silent = np.maximum(dt, (times - self.time[last]) * 1e-9)
        speed: FloatArray = self.rotor.calibration_distance * turned / silent
        return speed


class NoseTrack:
    """Headings of one vane, or of one axis of a bivane.

    Args:
        name: Of the axis.
        station: The station with its changes.
        origin: Start of the recording [ns].

    Attributes:
        time: [ns], shape (n,).
        angle: Continuous heading of the nose [rad], shape (n,).
        half_width: Of the range that a reading stands for [rad], 0 for ordinary ones, shape (n,).
    """

    def __init__(self, name: str, station: Station, origin: int) -> None:
        self._reader = NoseReader(name, station, origin)
        self.time: TimeArray = np.empty(0, dtype=np.int64)
        self.angle: FloatArray = np.empty(0)
        self.half_width: FloatArray = np.empty(0)

    def take(self, part: Series, stop: int) -> int:
        """Add a block's readings, up to its end [ns]; the number of usable ones."""
        new = self._reader.read(part, stop)
        if new.time.size:
            angle = np.concatenate((self.angle[-1:], new.heading))
            self.angle = np.concatenate((self.angle, np.unwrap(angle)[-new.heading.size :]))
            self.time = np.concatenate((self.time, new.time))
            self.half_width = np.concatenate((self.half_width, new.half_width))
        return int(new.time.size)

    def forget_before(self, since: int) -> None:
        """Drop what is older than a time [ns]; one reading stays, however old."""
        cut = min(int(np.searchsorted(self.time, since)), max(self.time.size - 1, 0))
        self.time, self.angle = self.time[cut:], self.angle[cut:]
        self.half_width = self.half_width[cut:]

    def latest(self, times: TimeArray) -> FloatArray:
        """The latest reading at some times [rad], shape (n,); zero before the first."""
        if not self.time.size:
            return np.zeros(times.size)
        at = np.maximum(np.searchsorted(self.time, times, side="right") - 1, 0)
        latest: FloatArray = self.angle[at]
        return latest


class History:
    """Edges of the first rotor and headings of the nose that belongs to it.

    Args:
        station: The station with its changes.
        origin: Start of the recording [ns].
        seconds: How much to keep.
        restored: Undo what the station file says about lost and false edges.

    Attributes:
        rotor: The rotor as it is at first.
        vane: The vane or bivane as it is at first.
        nose_number: Index of the vane, or of the bivane's azimuth, among the station's nose axes.
        edges: Of the rotor.
        nose: Headings, or azimuths of a bivane.
        elevation: Of a bivane, else None.
    """

    def __init__(
        self, station: Station, origin: int, seconds: float, restored: bool = True
    ) -> None:
        rotor, nose = counted_pair(station)
        self.edges = RotorTrack(rotor.name, station, origin, restored)
        self.rotor = self.edges.rotor
        axes = axes_of(station)
        self.vane = nose.instrument
        self.nose_number = axes.index(nose)
        self._keep = round(seconds * 1e9)
        self._names = [nose.name]
        self.nose = NoseTrack(nose.name, station, origin)
        self.elevation: NoseTrack | None = None
        for axis in axes:
            if axis.azimuth >= 0 and axis.instrument is self.vane:
                self._names.append(axis.name)
                self.elevation = NoseTrack(axis.name, station, origin)

    def take(self, block: Block) -> tuple[int, int]:
        """Add a block's messages; the numbers of new readings and edges."""
        edges = self.edges.take(block.pulses[self.rotor.name])
        readings = self.nose.take(block.readings[self._names[0]], block.stop)
        if self.elevation is not None:
            self.elevation.take(block.readings[self._names[1]], block.stop)
        return readings, edges

    def forget_before(self, now: int) -> None:
        """Drop what is older than the time to keep; two edges stay, however old."""
        since = now - self._keep
        self.edges.forget_before(since)
        self.nose.forget_before(since)
        if self.elevation is not None:
            self.elevation.forget_before(since)
