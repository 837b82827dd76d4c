"""Recent messages that a method without a filter needs again."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import rotors_of, vanes_of
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.readings import headings
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


class History:
    """Edges of the first rotor and headings of the first vane over the last seconds.

    Args:
        station: The station.
        origin: Start of the recording [ns].
        seconds: How much to keep.

    Attributes:
        edge_time: [ns], shape (n,).
        edge_angle: Turned angle at the edges [rad], shape (n,).
        vane_time: [ns], shape (m,).
        heading: Continuous heading of the nose [rad], shape (m,).
    """

    def __init__(self, station: Station, origin: int, seconds: float) -> None:
        self.rotor = rotors_of(station)[0]
        carried_by = getattr(self.rotor, "mounted_on", "")
        vanes = vanes_of(station)
        self.vane = next((v for v in vanes if v.name == carried_by), vanes[0])
        self._origin = origin
        self._keep = round(seconds * 1e9)
        self._count = 0.0
        self.edge_time: TimeArray = np.empty(0, dtype=np.int64)
        self.edge_angle: FloatArray = np.empty(0)
        self.vane_time: TimeArray = np.empty(0, dtype=np.int64)
        self.heading: FloatArray = np.empty(0)

    def take(self, block: Block) -> tuple[int, int]:
        """Add a block's messages; the numbers of new readings and edges."""
        part = block.pulses[self.rotor.name]
        if part.time.size:
            step = 2.0 * np.pi / self.rotor.pulses_per_revolution
            turns = part.value[:, 0]
            counted = self._count + step * np.arange(1, part.time.size + 1)
            angle = np.where(np.isnan(turns), counted, 2.0 * np.pi * turns)
            self._count = float(angle[-1])
            self.edge_time = np.concatenate((self.edge_time, part.time))
            self.edge_angle = np.concatenate((self.edge_angle, angle))
        series = block.readings[self.vane.name]
        new = headings(self.vane, series.time, series.value[:, 0], self._origin)
        if new.time.size:
            angle = new.heading
            if self.heading.size:
                angle = np.unwrap(np.concatenate((self.heading[-1:], angle)))[1:]
            else:
                angle = np.unwrap(angle)
            self.vane_time = np.concatenate((self.vane_time, new.time))
            self.heading = np.concatenate((self.heading, angle))
        return int(new.time.size), int(part.time.size)

    def forget_before(self, now: int) -> None:
        """Drop what is older than the time to keep; two edges stay, however old."""
        since = now - self._keep
        cut = min(int(np.searchsorted(self.edge_time, since)), max(self.edge_time.size - 2, 0))
        self.edge_time, self.edge_angle = self.edge_time[cut:], self.edge_angle[cut:]
        cut = min(int(np.searchsorted(self.vane_time, since)), max(self.vane_time.size - 1, 0))
        self.vane_time, self.heading = self.vane_time[cut:], self.heading[cut:]
