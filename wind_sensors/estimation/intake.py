"""Messages into order: the stamps alone decide, whatever the order of arrival.

Messages wait until every message of their block must have arrived, then the whole block is
released, sorted and without doubles. The clock is the largest stamp seen (or told by `advance`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.recent import Tally

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

PULSES, READINGS, PLATFORM, VELOCITY, TEMPERATURE, PRESSURE = range(6)
_MOTION = (PLATFORM, VELOCITY)
_CONFIRMED = 3
"""So many messages in a row make a jump of the clock believable."""
FAR_AHEAD_NS = 60_000_000_000
"""A step further ahead is no pause of the signals but another clock [ns]."""
_KEPT_OFFSETS = 64
_INTERVALS_AHEAD = 1.5
"""So many intervals between states of the platform are waited for, so that one may be missing."""


class Series(NamedTuple):
    """One input's messages in a block: times [ns] (n,) and values (n, width), nan where absent."""

    time: TimeArray
    value: FloatArray


def _nothing() -> Series:
    return Series(np.empty(0, dtype=np.int64), np.empty((0, 1)))


@dataclass(frozen=True)
class Block:
    """All messages of an interval, in order.

    Attributes:
        start, stop: The interval [ns].
        pulses: By rotor; the value is the turns where the source tells.
        readings: By vane (`<bivane>/elevation` for elevations) [rad].
        platform: States, some of them shortly after `stop`: attitude xyzw, velocity, angular rate,
            position; width 13.
        temperature: [deg C].
        pressure: [Pa].
        velocity: Of the platform, where it comes apart from the states; shortly after `stop`, too.
            Width 3.
    """

    start: int
    stop: int
    pulses: dict[str, Series]
    readings: dict[str, Series]
    platform: Series
    temperature: Series
    pressure: Series
    velocity: Series = field(default_factory=_nothing)


@dataclass
class InputRecord:
    """What is known about one input.

    Attributes:
        kind: PULSES, READINGS, ...
        width: Numbers in a message.
        accepted, doubled, invalid, gaps: Messages that were used, came twice, were no numbers;
            pauses.
        late, ahead: Messages left out because their stamps are behind or ahead of the others.
        offsets: By how much the last of those were ahead of the clock [ns].
        longest_gap: [s].
        first, last: Times of the first and the last released message [ns], 0 without any.
        newest: Time of the newest message, released or not [ns]; 0 without any since the clock was
            set.
        rate: Recent rate [Hz].
    """

    kind: int
    width: int
    accepted: Tally = field(default_factory=Tally)
    doubled: Tally = field(default_factory=Tally)
    late: Tally = field(default_factory=Tally)
    ahead: Tally = field(default_factory=Tally)
    invalid: Tally = field(default_factory=Tally)
    gaps: Tally = field(default_factory=Tally)
    offsets: deque[int] = field(default_factory=lambda: deque(maxlen=_KEPT_OFFSETS))
    longest_gap: float = 0.0
    first: int = 0
    last: int = 0
    newest: int = 0
    rate: float = 0.0
    times: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)

    def set_clock_anew(self) -> None:
        """The last minute is another one; totals stay."""
        self.offsets.clear()
        for tally in (self.accepted, self.doubled, self.late, self.ahead, self.invalid, self.gaps):
            tally.forget()


_Message = tuple[str, int, tuple[float, ...]]
Correction = Callable[[int, int], int]
"""Stamp and start of the recording to the time of measurement [ns]."""


class Intake:
    """Buffer in front of an estimator.

    Args:
        inputs: Kind, width and clock correction by input name.
        block_ns: Length of a block.
        wait_ns: How long to wait for messages that arrive late.
        look_ahead_ns: How much of the platform's motion after a block is released with it, at
            least and at most; between them as much as a slow source needs for its next state.
        gap_ns: Silence that counts as a gap.
        jump_ns: Step of the clock, back or ahead, that one message alone does not prove.

    Attributes:
        records: What came in, by input name.
        jumps: Steps of the clock with which all began anew.
        pauses: Those of them that were ahead: no input may have been heard for so long.
        longest_pause: The longest of these [ns].
        watermark: Latest time of measurement [ns].
        origin: Start of the first block [ns]; None before it.
        released: End of the latest block [ns].
    """

    def __init__(
        self,
        inputs: dict[str, tuple[int, int, Correction | None]],
        block_ns: int,
        wait_ns: int,
        look_ahead_ns: tuple[int, int],
        gap_ns: int,
        jump_ns: int,
    ) -> None:
        self.records = {name: InputRecord(kind, width) for name, (kind, width, _) in inputs.items()}
        self._corrections = {name: c for name, (_, _, c) in inputs.items() if c is not None}
        self._block = block_ns
        self._wait = wait_ns
        self._look_ahead, self._longest_look_ahead = look_ahead_ns
        self._shortest_look_ahead = self._look_ahead
        self._gap = gap_ns
        self._jump = jump_ns
        self.jumps = Tally()
        self.pauses = Tally()
        self.longest_pause = 0
        self.watermark = 0
        self.origin: int | None = None
        self.released = 0
        self._earliest = 0
        self._zero = 0
        self._seen = False
        self._early: list[_Message] = []
        self._astray: list[_Message] = []

    def forget(self) -> None:
        """Start anew with the next message; counts stay."""
        self._leave_out(self._astray)
        for record in self.records.values():
            record.times.clear()
            record.values.clear()
            record.newest = 0
        self.origin = None
        self.released = 0
        self._seen = False
        self._early.clear()
        self._astray.clear()

    def add(self, name: str, stamp: int, value: tuple[float, ...]) -> bool:
        """Take a message; True: the clock has jumped, finish and `restart`."""
        if not self._seen:
            self._seen = True
            self._zero = stamp
            self.watermark = self._earliest = self._true(name, stamp)
        time = self._true(name, stamp)
        ahead = time - self.watermark
        if abs(ahead) > self._jump:
            return self._is_jump(name, stamp, value)
        self._leave_out(self._astray)
        self._astray = []
        if ahead > 0:
            self.watermark = time
        self._keep(name, stamp, value)
        return False

    def _true(self, name: str, stamp: int) -> int:
        """Time of measurement by a stamp; a drift counts from the first message."""
        correction = self._corrections.get(name)
        return stamp if correction is None else correction(stamp, self._zero)

    def advance(self, time: int) -> None:
        """Time has passed although no message came."""
        if not self._seen or not 0 < time - self.watermark < FAR_AHEAD_NS:
            return
        held, self._astray = self._astray, []
        self.watermark = time
        for message in held:
            # What was ahead of the clock may be so no more.
            self.add(*message)

    def _is_jump(self, name: str, stamp: int, value: tuple[float, ...]) -> bool:
        """Hold a message that is far from the others until as many more agree with it."""
        time = self._true(name, stamp)
        steps_ahead = time > self.watermark
        # Signals that pause are followed by stamps ahead, which may be seconds apart.
        before = FAR_AHEAD_NS if steps_ahead else self._jump
        agreeing: list[_Message] = []
        apart: list[_Message] = []
        for message in self._astray:
            at = self._true(message[0], message[1])
            if (at > self.watermark) != steps_ahead or at > time + self._jump:
                self._leave_out([message])
            else:
                (agreeing if at >= time - before else apart).append(message)
        agreeing.append((name, stamp, value))
        if len(agreeing) < _CONFIRMED:
            # The newest may be the stray.
            self._leave_out(apart[:-_CONFIRMED])
            self._astray = [*apart[-_CONFIRMED:], *agreeing]
            return False
        self._leave_out(apart)
        self._astray = agreeing
        if not steps_ahead or time - self.watermark > FAR_AHEAD_NS:
            return True
        held, self._astray = self._astray, []
        self.watermark = max(self._true(n, s) for n, s, _ in held)
        for message in held:
            self._keep(*message)
        return False

    def _leave_out(self, strays: list[_Message]) -> None:
        """Count messages that nothing confirmed."""
        for name, stamp, _ in strays:
            record = self.records[name]
            offset = self._true(name, stamp) - self.watermark
            (record.ahead if offset > 0 else record.late).add(self.watermark)
            record.offsets.append(offset)

    def restart(self) -> None:
        """After a jump: forget, and begin with the messages that proved it."""
        proof, self._astray = self._astray, []
        pause = min(self._true(n, s) for n, s, _ in proof) - self.watermark
        self.forget()
        for record in self.records.values():
            record.set_clock_anew()
        self.jumps.forget()
        self.pauses.forget()
        for name, stamp, value in proof:
            self.add(name, stamp, value)
        self.jumps.add(self.watermark)
        if pause > 0:
            self.pauses.add(self.watermark)
            self.longest_pause = max(self.longest_pause, pause)

    def _keep(self, name: str, stamp: int, value: tuple[float, ...]) -> None:
        time = self._true(name, stamp)
        if self.origin is None:
            self._early.append((name, stamp, value))
            self._earliest = min(self._earliest, time)
            return
        record = self.records[name]
        if time < self.released:
            record.late.add(self.watermark)
            record.offsets.append(time - self.watermark)
            return
        record.newest = max(record.newest, time)
        record.times.append(time)
        record.values.append(value)

    def is_due(self) -> bool:
        """Whether `blocks` would have something to release."""
        if self.origin is None:
            return self.watermark >= self._earliest + self._wait
        return self.watermark >= self.released + self._block + self._wait + self._look_ahead

    def blocks(self, finish: bool = False) -> list[Block]:
        """Blocks that are complete; with `finish` everything that is left."""
        if not self._seen:
            return []
        wait = 0 if finish else self._wait
        if self.origin is None:
            start = self._earliest
            if not finish and self.watermark < start + self._wait:
                return []
            early, self._early = self._early, []
            self._zero = min(stamp for _, stamp, _ in early)
            self.origin = self._zero = min(self._true(name, stamp) for name, stamp, _ in early)
            self.released = self.origin // self._block * self._block
            for name, stamp, value in early:
                self._keep(name, stamp, value)
        out = []
        while self._is_complete(self.released + self._block, wait, finish):
            out.append(self._release(self.released + self._block))
        return out

    def _is_complete(self, stop: int, wait: int, finish: bool) -> bool:
        """Whether the block up to `stop` can be released; what is left with `finish`."""
        if finish and self.released <= self.watermark:
            return True
        return stop <= self.watermark - wait - self._look_ahead

    def _release(self, stop: int) -> Block:
        start = self.released
        parts = {name: self._taken(record, stop) for name, record in self.records.items()}
        self.released = stop
        seconds = self._block * 1e-9
        for name, record in self.records.items():
            self._account(record, parts[name], stop, seconds)
        look_ahead = self._look_ahead
        self._follow_platform_rate()
        return Block(
            start=start,
            stop=stop,
            pulses=self._of_kind(PULSES, parts),
            readings=self._of_kind(READINGS, parts),
            platform=self._single(PLATFORM, parts, stop + look_ahead),
            temperature=self._single(TEMPERATURE, parts, stop),
            pressure=self._single(PRESSURE, parts, stop),
            velocity=self._single(VELOCITY, parts, stop + look_ahead),
        )

    def _follow_platform_rate(self) -> None:
        """Look far enough ahead to see the next state of a slow platform, within bounds."""
        rates = [r.rate for r in self.records.values() if r.kind in _MOTION and r.rate > 0.0]
        if rates:
            wanted = round(_INTERVALS_AHEAD * 1e9 / min(rates))
            self._look_ahead = min(max(wanted, self._shortest_look_ahead), self._longest_look_ahead)

    def _of_kind(self, kind: int, parts: dict[str, Series]) -> dict[str, Series]:
        return {n: parts[n] for n, r in self.records.items() if r.kind == kind}

    def _single(self, kind: int, parts: dict[str, Series], until: int) -> Series:
        for name, record in self.records.items():
            if record.kind != kind:
                continue
            if kind in _MOTION and record.times:
                ahead = _sorted(
                    [t for t in record.times if t < until],
                    [v for t, v in zip(record.times, record.values, strict=True) if t < until],
                    record.width,
                )[0]
                part = parts[name]
                return Series(
                    np.concatenate((part.time, ahead.time)),
                    np.concatenate((part.value, ahead.value)),
                )
            return parts[name]
        return _nothing()

    def _taken(self, record: InputRecord, stop: int) -> Series:
        times, values = record.times, record.values
        if not times:
            return Series(np.empty(0, dtype=np.int64), np.empty((0, record.width)))
        if max(times) < stop:
            taken_times, taken_values = times, values
            record.times, record.values = [], []
        else:
            taken_times = [t for t in times if t < stop]
            taken_values = [v for t, v in zip(times, values, strict=True) if t < stop]
            record.values = [v for t, v in zip(times, values, strict=True) if t >= stop]
            record.times = [t for t in times if t >= stop]
        series, doubled = _sorted(taken_times, taken_values, record.width)
        if doubled:
            record.doubled.add(stop, doubled)
        return series

    def _account(self, record: InputRecord, part: Series, stop: int, seconds: float) -> None:
        count = int(part.time.size)
        share = min(1.0, seconds / 5.0) if record.rate > 0.0 else 1.0
        record.rate += share * (count / seconds - record.rate)
        if count == 0:
            return
        record.accepted.add(stop, count)
        times = part.time
        before = record.last if record.last else int(times[0])
        if before > times[0]:
            before = int(times[0])
        silent = np.diff(times, prepend=before)
        longest = int(silent.max())
        if longest > self._gap:
            record.gaps.add(stop, int(np.count_nonzero(silent > self._gap)))
            record.longest_gap = max(record.longest_gap, longest * 1e-9)
        if not record.first:
            record.first = int(times[0])
        record.last = int(times[-1])


def merged(blocks: list[Block]) -> Block:
    """Successive blocks as one."""

    def series(parts: list[Series]) -> Series:
        return Series(
            np.concatenate([p.time for p in parts]), np.concatenate([p.value for p in parts])
        )

    def once(parts: list[Series]) -> Series:
        both = series(parts)
        times, first = np.unique(both.time, return_index=True)
        return Series(times, both.value[first])

    if len(blocks) == 1:
        return blocks[0]
    return Block(
        start=blocks[0].start,
        stop=blocks[-1].stop,
        pulses={n: series([b.pulses[n] for b in blocks]) for n in blocks[0].pulses},
        readings={n: series([b.readings[n] for b in blocks]) for n in blocks[0].readings},
        platform=once([b.platform for b in blocks]),
        temperature=series([b.temperature for b in blocks]),
        pressure=series([b.pressure for b in blocks]),
        velocity=once([b.velocity for b in blocks]),
    )


def _sorted(
    times: list[int], values: list[tuple[float, ...]], width: int
) -> tuple[Series, int]:
    """In order of time, doubles dropped (the smallest value stays); and how many those were."""
    t = np.array(times, dtype=np.int64)
    v = np.array(values, dtype=np.float64).reshape(len(times), width)
    if t.size < 2:
        return Series(t, v), 0
    if not np.all(t[1:] > t[:-1]):
        order = np.lexsort((v[:, 0], t)) if width else np.argsort(t, kind="stable")
        t, v = t[order], v[order]
        first = np.concatenate(([True], t[1:] != t[:-1]))
        doubled = int(t.size - np.count_nonzero(first))
        return Series(t[first], v[first]), doubled
    return Series(t, v), 0


def clock_correction(latency: float, drift: float) -> Correction | None:
    """How stamps become times of measurement; None where they already are."""
    if latency == 0.0 and drift == 0.0:
        return None

    def corrected(stamp: int, origin: int) -> int:
        since = (stamp - origin) - latency * 1e9
        return origin + math.floor(since / (1.0 + drift) + 0.5)

    return corrected
