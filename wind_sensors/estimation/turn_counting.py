"""The angle that a rotor has turned, from the edges that its electronics let through."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.slot_places import SlotPlaces
from wind_sensors.station.losses import lost_share
from wind_sensors.station.model import Rotor

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_WITHIN_DEAD_TIME = 1.1
"""Allowance for slots of unequal width and for wind that changes between two edges."""
_USUAL_CHANGE = 0.1
"""Standard deviation of the logarithm of one interval over the one before. An edge more is taken
for lost by chance where that is likelier than so large a change."""
_RAREST = 1e-9
"""No loss is held for rarer than this."""
_FEW = 8
"""So many intervals tell the first rate."""
_LONGEST_BOUNCE = 3.0
"""An edge that follows within so many mean bounce delays is a false one. Most contacts are at rest
after two."""
_TOO_SOON = 0.7
"""But no edge after this part of the interval before: that is the next slot."""


def slots_between(intervals: FloatArray, dead_time: float) -> FloatArray:
    """Slots passed between successive edges at the start, when no rate is known yet.

    A counter that is known to lose pulses by its dead time, and whose intervals all lie between
    one and two dead times, has lost every second one: a rotor slow enough to lose none would
    hardly ever keep just within those bounds.

    Args:
        intervals: Between recorded edges [s], shape (n,).
        dead_time: [s], 0 for none.

    Returns:
        Shape (n,), each 1 or 2.
    """
    slots: FloatArray = np.ones(intervals.size)
    if dead_time > 0.0 and intervals.size and intervals.max() < 2.0 * dead_time:
        slots += 1.0
    return slots


def loses_edges(rotor: Rotor) -> bool:
    """Whether the station file says that edges get lost or doubled on their way."""
    e = rotor.electronics
    return max(e.dead_time, e.loss_probability, e.bounce_probability) > 0.0


class TurnCounter:
    """Turned angle at recorded edges, with lost edges restored and false ones left out.

    Only what the station file states is undone: dead time, random losses, bounces, outages, slots
    out of their places. The number of slots between two edges follows from the rate before.

    Args:
        rotor: The rotor as it is at first.
        origin: Start of the recording [ns]; outages count from there.
    """

    def __init__(self, rotor: Rotor, origin: int) -> None:
        self._rotor = rotor
        self._origin = origin
        self._last: int | None = None
        self._slots = 0.0
        self._interval = 0.0
        self._bridge: tuple[int, float] | None = None
        self._places = SlotPlaces()

    def count(self, rotor: Rotor, time: TimeArray) -> tuple[TimeArray, FloatArray]:
        """Edges that count, in order of time, with the angle turned since the start.

        Args:
            rotor: The rotor as it is now.
            time: Recorded edges that follow the last ones [ns], shape (n,).

        Returns:
            Times [ns] and angles [rad], shape (m,) each. The first edge after an outage waits
            for the second.
        """
        self._rotor = rotor
        step = 2.0 * math.pi / rotor.pulses_per_revolution
        if not loses_edges(rotor) and not rotor.outages:
            numbers = self._slots + np.arange(1.0, time.size + 1.0)
            if time.size:
                before = self._last if self._last is not None else int(time[0])
                self._interval = (
                    (int(time[-1]) - int(time[-2])) * 1e-9
                    if time.size > 1
                    else (int(time[0]) - before) * 1e-9
                )
                self._last, self._slots = int(time[-1]), float(numbers[-1])
            return time, step * (numbers + self._places.displaced(rotor, time, numbers))
        if self._interval == 0.0 and time.size > 1:
            first = np.diff(time[: _FEW + 1]) * 1e-9
            if rotor.electronics.bounce_probability > 0.0:
                first = first[first > _LONGEST_BOUNCE * rotor.electronics.bounce_delay]
            slots = slots_between(first, rotor.electronics.dead_time)
            self._interval = float(np.median(first / slots)) if first.size else 0.0
        times: list[int] = []
        slots_at: list[float] = []
        for t in time.tolist():
            self._edge(t, times, slots_at)
        counted, numbers = np.array(times, dtype=np.int64), np.array(slots_at, dtype=np.float64)
        return counted, step * (numbers + self._places.displaced(rotor, counted, numbers))

    def _edge(self, t: int, times: list[int], slots_at: list[float]) -> None:
        if self._last is None:
            self._slots += 1.0
            self._last = t
            times.append(t)
            slots_at.append(self._slots)
            return
        since = (t - self._last) * 1e-9
        if self._is_false(since):
            return
        if self._bridge is not None:
            begin, before = self._bridge
            slots = self._passed(since, since)
            rate = slots / since
            # Across an outage the rotor turned as it did before and after, on average.
            self._slots += max(round(0.5 * (before + rate) * (self._last - begin) * 1e-9), 1)
            self._bridge = None
            times.append(self._last)
            slots_at.append(self._slots)
        elif self._is_silenced(self._last, t):
            self._bridge = self._last, 1.0 / self._interval if self._interval > 0.0 else 0.0
            self._last = t
            return
        else:
            slots = self._passed(since, self._interval)
        self._slots += slots
        self._interval = since / slots
        self._last = t
        times.append(t)
        slots_at.append(self._slots)

    def _is_false(self, since: float) -> bool:
        e = self._rotor.electronics
        longest = min(_LONGEST_BOUNCE * e.bounce_delay, _TOO_SOON * self._interval)
        return e.bounce_probability > 0.0 and since < longest

    def _is_silenced(self, last: int, now: int) -> bool:
        """Whether an outage lies between two edges."""
        first, second = ((t - self._origin) * 1e-9 for t in (last, now))
        return any(o.start < second and o.stop > first for o in self._rotor.outages)

    def _lost(self, edges: float) -> float:
        """Share of the edges that is lost at a rate of so many a second."""
        turns = edges / self._rotor.pulses_per_revolution
        speed = 2.0 * math.pi * turns * self._rotor.calibration_distance
        return float(lost_share(self._rotor.electronics, speed))

    def _passed(self, since: float, usual: float) -> int:
        """Slots passed in a time in which one used to pass in `usual` [s]."""
        e = self._rotor.electronics
        if usual <= 0.0 or (e.dead_time == 0.0 and e.loss_probability == 0.0):
            return 1
        most = max(math.floor(since / usual + 0.5), 1)
        # The last of the edges that the dead time took fell into it.
        slots = most
        while slots > 1 and since * (slots - 1) > _WITHIN_DEAD_TIME * e.dead_time * slots:
            slots -= 1
        if e.loss_probability == 0.0:
            return slots
        rare = -math.log(max(self._lost(1.0 / usual), _RAREST))

        def unlikely(passed: int) -> float:
            changed = math.log(since / (passed * usual)) / _USUAL_CHANGE
            return 0.5 * changed**2 + rare * (passed - slots)

        return min(range(slots, most + 1), key=unlikely)
