"""Recent messages that a method without a filter needs again."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import NoseAxis, axes_of, rotors_of
from wind_sensors.estimation.intake import Block, Series
from wind_sensors.estimation.readings import headings
from wind_sensors.station.model import Cup, Propeller, Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


class RotorTrack:
    """Edges of one rotor.

    Args:
        rotor: The rotor.

    Attributes:
        time: [ns], shape (n,).
        angle: Turned angle at the edges [rad], shape (n,).
    """

    def __init__(self, rotor: Cup | Propeller) -> None:
        self.rotor = rotor
        self._count = 0.0
        self.time: TimeArray = np.empty(0, dtype=np.int64)
        self.angle: FloatArray = np.empty(0)

    def take(self, part: Series) -> int:
        """Add a block's edges; their number."""
        if part.time.size:
            step = 2.0 * np.pi / self.rotor.pulses_per_revolution
            turns = part.value[:, 0]
            counted = self._count + step * np.arange(1, part.time.size + 1)
            angle = np.where(np.isnan(turns), counted, 2.0 * np.pi * turns)
            self._count = float(angle[-1])
            self.time = np.concatenate((self.time, part.time))
            self.angle = np.concatenate((self.angle, angle))
        return int(part.time.size)

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
        axis: The axis.
        origin: Start of the recording [ns].

    Attributes:
        time: [ns], shape (n,).
        angle: Continuous heading of the nose [rad], shape (n,).
    """

    def __init__(self, axis: NoseAxis, origin: int) -> None:
        self._axis = axis
        self._origin = origin
        self.time: TimeArray = np.empty(0, dtype=np.int64)
        self.angle: FloatArray = np.empty(0)

    def take(self, part: Series) -> int:
        """Add a block's readings; the number of usable ones."""
        new = headings(self._axis.instrument, part.time, part.value[:, 0], self._origin)
        if new.time.size:
            angle = np.concatenate((self.angle[-1:], new.heading))
            self.angle = np.concatenate((self.angle, np.unwrap(angle)[-new.heading.size :]))
            self.time = np.concatenate((self.time, new.time))
        return int(new.time.size)

    def forget_before(self, since: int) -> None:
        """Drop what is older than a time [ns]; one reading stays, however old."""
        cut = min(int(np.searchsorted(self.time, since)), max(self.time.size - 1, 0))
        self.time, self.angle = self.time[cut:], self.angle[cut:]

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
        station: The station.
        origin: Start of the recording [ns].
        seconds: How much to keep.

    Attributes:
        rotor: The rotor.
        vane: The vane or bivane.
        edges: Of the rotor.
        nose: Headings, or azimuths of a bivane.
        elevation: Of a bivane, else None.
    """

    def __init__(self, station: Station, origin: int, seconds: float) -> None:
        self.rotor = rotors_of(station)[0]
        carried_by = getattr(self.rotor, "mounted_on", "")
        axes = axes_of(station)
        nose = next((a for a in axes if a.name == carried_by), axes[0])
        self.vane = nose.instrument
        self._keep = round(seconds * 1e9)
        self._names = [nose.name]
        self.edges = RotorTrack(self.rotor)
        self.nose = NoseTrack(nose, origin)
        self.elevation: NoseTrack | None = None
        for axis in axes:
            if axis.azimuth >= 0 and axis.instrument is self.vane:
                self._names.append(axis.name)
                self.elevation = NoseTrack(axis, origin)

    def take(self, block: Block) -> tuple[int, int]:
        """Add a block's messages; the numbers of new readings and edges."""
        edges = self.edges.take(block.pulses[self.rotor.name])
        readings = self.nose.take(block.readings[self._names[0]])
        if self.elevation is not None:
            self.elevation.take(block.readings[self._names[1]])
        return readings, edges

    def forget_before(self, now: int) -> None:
        """Drop what is older than the time to keep; two edges stay, however old."""
        since = now - self._keep
        self.edges.forget_before(since)
        self.nose.forget_before(since)
        if self.elevation is not None:
            self.elevation.forget_before(since)
