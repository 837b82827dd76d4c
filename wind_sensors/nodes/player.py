"""A bag as live topics, with the clock that belongs to it."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from wind_sensors.errors import UserError
from wind_sensors.nodes.inputs import message_class
from wind_sensors.nodes.quality import SETTLING, advertise, output_quality
from wind_sensors.nodes.simulated_time import SimulatedTime

if TYPE_CHECKING:
    from wind_sensors.recordings.bag import BagContent
    from wind_sensors.station.signals import TimeArray

_TICK = 0.002
_CLOCK_PERIOD = 10_000_000
"""Wall time between messages on /clock [ns]."""
_DEPTH = 10_000

LONGEST_GAP = 3600.0
"""Wall time that the player waits for a message at the most, at a rate of 1 or more [s]."""

_NEVER_PUBLISHED = frozenset({"/clock", "/rosout", "/parameter_events"})


class PlayerNode(Node):
    """Publishes the messages of a bag at their times of recording.

    Every topic is offered as reliable, which any subscriber can match, and a topic that was latched
    (transient local) is latched again: who comes late gets the messages so far.

    Args:
        content: The bag.
        topics: Topics to publish, of which those that the bag lacks are told; relative names count
            from the node's namespace. None: all whose message type is installed.
        rate: Bag seconds per second of wall time.
        loop: Start again at the end; the clock then jumps back.
        with_clock: Publish /clock.
        wait_for_subscribers: Begin when every topic has so many subscribers.
        options: Further arguments of rclpy's Node.

    Attributes:
        notes: What is not published, or not at its time of recording, and why.
        published: Messages published.
        finished: The end has been reached (never with `loop`).

    Raises:
        UserError: The bag has none of the topics, or the message type of one that was asked for
            is not installed.
    """

    def __init__(
        self,
        content: BagContent,
        topics: Collection[str] | None = None,
        *,
        rate: float = 1.0,
        loop: bool = False,
        with_clock: bool = True,
        wait_for_subscribers: int = 0,
        **options: Any,
    ) -> None:
        super().__init__("player", **options)
        self.notes: list[str] = []
        self.published = 0
        self.finished = False
        self._rate = rate
        self._loop = loop
        self._waits_for = wait_for_subscribers
        chosen = self._chosen(content, topics)
        classes = self._installed(content, chosen, asked=topics is not None)
        data = [content.topics[name] for name in classes]
        self._outlets = [
            advertise(self, found, name, output_quality(_DEPTH, latched=topic.latched))
            for (name, found), topic in zip(classes.items(), data, strict=True)
        ]
        self._raw = [message for topic in data for message in topic.raw]
        times = np.concatenate([np.asarray(topic.log_time, dtype=np.int64) for topic in data])
        owner = np.repeat(np.arange(len(data)), [len(topic.raw) for topic in data])
        self._order = np.argsort(times, kind="stable")
        self._times = self._with_time(times[self._order])
        self._owner = owner[self._order]
        self._due = self._without_long_gaps(self._times, rate)
        self._time = SimulatedTime(self, round(_CLOCK_PERIOD * rate)) if with_clock else None
        self._next = 0
        self._ready_at = 0.0
        self._started: float | None = None
        self._timer = self.create_timer(
            _TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _chosen(self, content: BagContent, topics: Collection[str] | None) -> list[str]:
        """Names of the topics to publish; notes tell of those that were asked for in vain."""
        there = {name for name, data in content.topics.items() if data.raw} - _NEVER_PUBLISHED
        if topics is not None:
            # Names in the bag are those that publishers had, whatever they are published as now.
            asked = {self.resolve_topic_name(topic, only_expand=True): topic for topic in topics}
            self.notes += [
                f"{topic} {_why_not(content, name)}"
                for name, topic in asked.items()
                if name not in there
            ]
            there &= set(asked)
        chosen = [name for name in content.topics if name in there]
        if not chosen:
            raise UserError(
                "the bag has none of the topics.",
                remedy=f"Topics in the bag: {', '.join(sorted(content.topics)) or 'none'}.",
            )
        return chosen

    def _installed(
        self, content: BagContent, names: Sequence[str], *, asked: bool
    ) -> dict[str, type[Any]]:
        """Message class by topic; a topic that nobody asked for by name may lack one."""
        classes: dict[str, type[Any]] = {}
        for name in names:
            message_type = content.topics[name].message_type
            try:
                classes[name] = message_class(message_type)
            except UserError as problem:
                package = message_type.partition("/")[0]
                remedy = f"Install the ROS package {package}, or leave {name} out."
                if asked:
                    raise UserError(problem.what, name, remedy) from None
                self.notes.append(f"{name} is left out: {problem.what} {remedy}")
        if not classes:
            raise UserError(
                "none of the bag's message types is installed.", remedy=" ".join(self.notes)
            )
        return classes

    def _with_time(self, times: TimeArray) -> TimeArray:
        """Times of recording [ns], the first real one where a message has none."""
        without = int(np.searchsorted(times, 0, side="right"))
        if without == 0:
            return times
        self.notes.append(
            f"{without} messages were recorded at time 0, before simulated time ran; they are "
            "published at the beginning"
        )
        first = times[without] if without < len(times) else 1
        return np.maximum(times, first)

    def _without_long_gaps(self, times: TimeArray, rate: float) -> TimeArray:
        """When each message is due [ns of bag time since the start], long gaps left out."""
        step = np.diff(times, prepend=times[0])
        # At a slow rate too: who slows a bag down means its messages, not its gaps.
        long = step > LONGEST_GAP * max(rate, 1.0) * 1e9
        if long.any():
            hours = float(step[long].sum()) * 1e-9 / 3600.0
            self.notes.append(f"{hours:.1f} hours in which nothing was recorded are skipped")
        return np.cumsum(np.where(long, 0, step))

    @property
    def duration(self) -> float:
        """Length of what is played [s of bag time], without the gaps that are skipped."""
        return float(self._due[-1]) * 1e-9

    @property
    def position(self) -> float:
        """Bag time since the start [s], without the gaps that are skipped."""
        if self._started is None:
            return 0.0
        return min(self._elapsed(), self.duration)

    def _elapsed(self) -> float:
        started = self._started if self._started is not None else time.monotonic()
        return (time.monotonic() - started) * self._rate

    def _tick(self) -> None:
        if self.finished:
            return
        if self._started is None:
            if any(o.get_subscription_count() < self._waits_for for o in self._outlets):
                self._ready_at = time.monotonic() + SETTLING
            if time.monotonic() < self._ready_at:
                return
            self._start()
        elapsed = round(self._elapsed() * 1e9)
        due = int(np.searchsorted(self._due, elapsed, side="right"))
        for index in range(self._next, due):
            self._tell_time(int(self._times[index]))
            self._outlets[self._owner[index]].publish(self._raw[self._order[index]])
        self.published += due - self._next
        self._next = due
        since = elapsed - int(self._due[due - 1]) if due < len(self._due) else 0
        self._tell_time(int(self._times[due - 1]) + since)
        if due == len(self._times):
            self._at_end()

    def _start(self) -> None:
        self._started = time.monotonic()
        if self._time is not None:
            self._time.start_at(int(self._times[0]))

    def _tell_time(self, now: int) -> None:
        if self._time is not None:
            self._time.tell(now)

    def _at_end(self) -> None:
        if self._loop:
            self._next = 0
            self._start()
        else:
            self.finished = True


def _why_not(content: BagContent, name: str) -> str:
    """Why a topic is not published, as the end of a sentence."""
    if name in _NEVER_PUBLISHED:
        return "is not published again"
    if name in content.topics:
        return "has no messages"
    close = get_close_matches(name, sorted(content.topics), n=1, cutoff=0.8)
    hint = f": did you mean {close[0]}?" if close else ""
    return f"is not in the bag{hint}"
