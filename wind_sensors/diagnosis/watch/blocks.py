"""A block of compared signals, and what has been told about the blocks so far."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.watch.direct import Oddity
from wind_sensors.diagnosis.watch.finding import Finding


@dataclass(frozen=True)
class Block:
    """Signals of a minute or so, ready to be judged.

    Attributes:
        number: Counted from 0.
        start, stop: [ns]
        comparison: With the station's simulation.
        odd: What its readings show by themselves.
    """

    number: int
    start: int
    stop: int
    comparison: Comparison
    odd: Sequence[Oddity]

    @property
    def length(self) -> int:
        """[ns]"""
        return self.stop - self.start


@dataclass
class Told:
    """Mismatches that were told.

    Attributes:
        finding: The present one, None while there is none.
        past: The last ones that are over.
    """

    finding: Finding | None = None
    past: deque[Finding] = field(default_factory=lambda: deque(maxlen=5))

    def tell_oddity(self, odd: Sequence[Oddity], stop: int) -> None:
        """What readings show by themselves goes before everything else."""
        first = min(odd, key=lambda o: o.start)
        known = self.finding
        onset = first.start if known is None else min(first.start, known.onset)
        detected = stop if known is None else known.detected
        self.finding = Finding.of_oddity(first, onset, detected, stop)

    def end(self, time: int) -> None:
        """The present mismatch is over [ns]."""
        if self.finding is not None:
            self.past.append(replace(self.finding, ended=time))
            self.finding = None


class Judge(Protocol):
    """Decides from block after block whether something is wrong.

    Attributes:
        told: What was told.
        learnt: Whether it knows what is normal.
        level: How near an alarm is; 1 is one.
        span: So much before a block it still needs the signals [ns].
    """

    told: Told

    @property
    def learnt(self) -> bool: ...

    @property
    def level(self) -> float: ...

    @property
    def span(self) -> int: ...

    def judge(self, block: Block) -> bool:
        """Take a block in; False where it could not be simulated."""
        ...

    def poll(self) -> None:
        """Take in what was worked out elsewhere meanwhile."""
        ...

    def restart(self) -> None:
        """The clock was set back, or the signals paused."""
        ...
