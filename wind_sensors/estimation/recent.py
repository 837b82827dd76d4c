"""Counts that tell the whole story and the present state, and intervals that are usual."""

from __future__ import annotations

from collections import deque

import numpy as np
import numpy.typing as npt

TimeArray = npt.NDArray[np.int64]

MEMORY = 60
"""What happened longer ago says nothing of the present state [s]."""

_SLOT_NS = 10_000_000_000
_SLOTS = MEMORY // 10
_HOUR_NS = 3_600_000_000_000
_OFTEN = 3
"""An interval that came so often within an hour is usual, however long."""
_PATIENCE = 2
"""An input is silent when it keeps still for so many times its longest usual interval."""


class Tally:
    """How often something happened, since the start and within the last minute.

    Attributes:
        total: Since the start.
    """

    def __init__(self) -> None:
        self.total = 0
        self._slots: deque[tuple[int, int]] = deque()

    def add(self, time: int, count: int = 1) -> None:
        """It has happened `count` times at a moment [ns]; a negative count takes back."""
        self.total += count
        slot = time // _SLOT_NS
        if self._slots and slot < self._slots[-1][0]:
            # The clock was set back: the last minute is another one.
            self._slots.clear()
        if self._slots and self._slots[-1][0] == slot:
            count += self._slots.pop()[1]
        self._slots.append((slot, count))
        while self._slots[0][0] <= slot - _SLOTS:
            self._slots.popleft()

    def recent(self, time: int) -> int:
        """How often within the last minute before a moment [ns]."""
        slot = time // _SLOT_NS
        return sum(count for at, count in self._slots if slot - _SLOTS < at <= slot)

    def forget(self) -> None:
        """The clock begins anew; the total stays."""
        self._slots.clear()


class Rhythm:
    """Tells silence from the usual pause of an input.

    Some inputs speak at a fixed rate, some only when they have something new to say: edges of a
    slow rotor, a vane that is published on change. How long they usually keep still is learnt.

    Args:
        least_ns: No shorter pause counts as silence [ns].
    """

    def __init__(self, least_ns: int) -> None:
        self._least = least_ns
        self._longest: list[tuple[int, int]] = []

    def take(self, time: int, interval: int) -> None:
        """An interval that ended at a time, both in ns."""
        if _PATIENCE * interval <= self._least:
            return
        kept = [(length, at) for length, at in self._longest if 0 <= time - at <= _HOUR_NS]
        self._longest = sorted([*kept, (interval, time)], reverse=True)[:_OFTEN]

    @property
    def limit(self) -> int:
        """A longer pause is silence [ns]."""
        if len(self._longest) < _OFTEN:
            return self._least
        return max(self._least, _PATIENCE * self._longest[-1][0])
