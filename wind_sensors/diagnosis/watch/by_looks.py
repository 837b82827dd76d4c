"""Judging by looks: the last minutes are diagnosed as a whole, every few blocks.

For stations with a baseline and a reference. What is wrong from the start is found as well as
what begins later.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future

from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.watch.blocks import Block, Told
from wind_sensors.diagnosis.watch.finding import Finding
from wind_sensors.diagnosis.watch.looking import Look, look
from wind_sensors.station.signals import Recording

FEWEST = 5
"""Blocks of a first look: five minutes."""

MOST = 10
"""Blocks of a look; older ones are left out."""

EVERY = 2
"""Blocks between two looks while nothing was seen."""

EVERY_WHILE_TOLD = 4
"""The same while a mismatch is told: it is weighed anew."""

STRENGTH = 50.0
"""Misfit, in squares of white differences, that a mismatch must account for."""

PLAIN = 100.0
"""From here on one look is enough; below, the next one must see it too, and what is named must
account for most of what is there."""

LOOKS_TO_END = 2
"""So many looks in a row must show nothing before a mismatch is over."""

MOST_OF_IT = 0.65
"""Share of the mismatch that a named effect must explain in a look that is not plain."""

UNNAMED = 60.0
"""Strength of a mismatch that no effect explains: gusts that come and go look like one."""

Cut = Callable[[int, int], Recording | None]


class LooksJudge:
    """Diagnoses the last minutes again and again.

    Args:
        baseline: From healthy recordings.
        cut: Gives the signals between two times [ns].
        block: Length of a block [ns].
        executor: Where looks are taken, so that signals need not wait; None: at once.

    Attributes:
        told: What was told.
    """

    def __init__(
        self, baseline: Baseline, cut: Cut, block: int, executor: Executor | None = None
    ) -> None:
        self.told = Told()
        self._baseline = baseline
        self._cut = cut
        self._block = block
        self._executor = executor
        self._pending: Future[Look] | None = None
        self._since = 0
        self._blocks = 0
        self._wait = 0
        self._unseen = 0
        self._suspect: Look | None = None
        self._latest: Look | None = None

    @property
    def learnt(self) -> bool:
        """A first look was taken."""
        return self._latest is not None

    @property
    def level(self) -> float:
        """Strength of the latest look relative to what is told."""
        return 0.0 if self._latest is None else self._latest.strength / STRENGTH

    @property
    def span(self) -> int:
        """A look needs so much before the newest block [ns]."""
        return MOST * self._block

    def restart(self) -> None:
        """Signals before now say nothing about those after."""
        self._blocks = 0
        self._suspect = None

    def judge(self, block: Block) -> bool:
        """Take a block in, and a look when one is due."""
        self.poll()
        told = self.told
        if block.odd:
            told.tell_oddity(block.odd, block.stop)
            self.restart()
            return True
        if told.finding is not None and told.finding.certain:
            told.end(block.start)
        self._since = block.start if self._blocks == 0 else self._since
        self._blocks += 1
        self._wait -= 1
        if self._blocks >= FEWEST and self._wait <= 0 and self._pending is None:
            self._take_look(block)
        return True

    def _take_look(self, block: Block) -> None:
        start = max(self._since, block.stop - MOST * self._block)
        recording = self._cut(start, block.stop)
        if recording is None:
            return
        if self._executor is None:
            self._weigh(look(recording, self._baseline))
        else:
            self._pending = self._executor.submit(look, recording, self._baseline)

    def poll(self) -> None:
        """Take in a look that was taken elsewhere and is ready."""
        if self._pending is None or not self._pending.done():
            return
        pending, self._pending = self._pending, None
        try:
            self._weigh(pending.result())
        except BrokenExecutor:
            # The process is gone: from now on signals wait while a look is taken.
            self._executor = None

    def _weigh(self, seen: Look) -> None:
        told = self.told
        self._latest = seen
        doubted, self._suspect = self._suspect, None
        passed = seen.end is not None and seen.end < seen.stop - self._block
        if not _counts(seen) or passed:
            self._wait = EVERY
            self._unseen += 1
            lasting = told.finding is not None and not told.finding.certain
            if lasting and (passed or self._unseen >= LOOKS_TO_END):
                told.end(seen.stop if seen.end is None else seen.end)
            return
        self._unseen = 0
        plain = seen.strength >= PLAIN and bool(seen.candidates)
        if told.finding is None and not plain and not _same(doubted, seen):
            self._suspect = seen
            self._wait = 1
            return
        self._wait = EVERY_WHILE_TOLD
        known = told.finding
        told.finding = Finding(
            onset=seen.onset if known is None else min(known.onset, seen.onset),
            detected=seen.stop if known is None else known.detected,
            latest=seen.stop,
            located=seen.located,
            candidates=seen.candidates,
            blocks=round((seen.stop - seen.onset) / self._block),
        )


def _counts(seen: Look) -> bool:
    """Whether a look shows enough to be told, or to be doubted and looked at again."""
    if seen.located is None:
        return False
    if not seen.candidates:
        return seen.strength >= UNNAMED
    explained = max(c.explained for c in seen.candidates)
    return seen.strength >= (STRENGTH if explained >= MOST_OF_IT else PLAIN)


def _instruments(of: Look) -> Sequence[str]:
    return [c.instrument for c in of.candidates] + (
        [] if of.located is None else [of.located.channel.partition("/")[0]]
    )


def _same(one: Look | None, other: Look) -> bool:
    """Whether two looks point at one instrument."""
    return one is not None and bool(set(_instruments(one)) & set(_instruments(other)))
