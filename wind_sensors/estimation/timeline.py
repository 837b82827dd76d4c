"""A station whose file states changes, as an estimator meets it: which constants hold when."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.intake import Correction, clock_correction
from wind_sensors.station.changes import segments
from wind_sensors.station.model import Clock, Station

TimeArray = npt.NDArray[np.int64]


class Timeline:
    """The stations of a recording in order.

    Args:
        station: The station with its changes.
        origin: Start of the recording [ns], where changes count from.

    Attributes:
        stations: One for each stretch without changes.
    """

    def __init__(self, station: Station, origin: int) -> None:
        parts = segments(station)
        self.stations: tuple[Station, ...] = tuple(p.station for p in parts)
        self._starts = np.array(
            [origin + round(p.start * 1e9) for p in parts[1:]], dtype=np.int64
        )

    def number(self, time: int) -> int:
        """Index of the station that holds at a time [ns]."""
        return int(np.searchsorted(self._starts, time, side="right"))

    def parts(self, times: TimeArray) -> Iterator[tuple[int, slice]]:
        """Increasing times [ns] by station: its index and the times that fall into its stretch."""
        cuts = [0, *np.searchsorted(times, self._starts).tolist(), times.size]
        for number in range(len(self.stations)):
            if cuts[number + 1] > cuts[number]:
                yield number, slice(cuts[number], cuts[number + 1])


def changing_correction(clocks: list[tuple[float, Clock]]) -> Correction | None:
    """Stamp to time of measurement for a clock that changes; None where stamps are true.

    Args:
        clocks: Begin of each stretch [s since the start of the recording] and the clock in it.
    """
    if all(clock == clocks[0][1] for _, clock in clocks):
        return clock_correction(clocks[0][1].latency, clocks[0][1].drift)
    known = [(since, clock_correction(c.latency, c.drift)) for since, c in clocks]
    stops = [since for since, _ in known[1:]] + [math.inf]

    def corrected(stamp: int, origin: int) -> int:
        time = stamp
        for (_, correction), stop in zip(known, stops, strict=True):
            time = stamp if correction is None else correction(stamp, origin)
            if (time - origin) * 1e-9 < stop:
                break
        return time

    return corrected
