"""A bag as live topics, with the clock that belongs to it."""

from __future__ import annotations

import time
from collections.abc import Collection
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

_TICK = 0.002
_CLOCK_PERIOD = 10_000_000
"""Wall time between messages on /clock [ns]."""
_DEPTH = 10_000
_NEVER_PUBLISHED = frozenset({"/clock", "/rosout", "/parameter_events"})


class PlayerNode(Node):
    """Publishes the messages of a bag at their times of recording.

    Every topic is offered as reliable, which any subscriber can match, and a topic that was latched
    (transient local) is latched again: who comes late gets the messages so far.

    Args:
        content: The bag.
        topics: Topics to publish; None: all.
        rate: Bag seconds per second of wall time.
        loop: Start again at the end; the clock then jumps back.
        with_clock: Publish /clock.
        wait_for_subscribers: Begin when every topic has so many subscribers.
        options: Further arguments of rclpy's Node.

    Attributes:
        published: Messages published.
        finished: The end has been reached (never with `loop`).

    Raises:
        UserError: The bag has none of the topics, or a message type is not installed.
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
        chosen = [
            name
            for name, data in content.topics.items()
            if data.raw and name not in _NEVER_PUBLISHED and (topics is None or name in topics)
        ]
        if not chosen:
            raise UserError(
                "the bag has none of the topics.",
                remedy=f"Topics in the bag: {', '.join(sorted(content.topics)) or 'none'}.",
            )
        self.published = 0
        self.finished = False
        self._rate = rate
        self._loop = loop
        self._waits_for = wait_for_subscribers
        self._outlets = [
            advertise(
                self,
                message_class(content.topics[name].message_type),
                name,
                output_quality(_DEPTH, latched=content.topics[name].latched),
            )
            for name in chosen
        ]
        data = [content.topics[name] for name in chosen]
        self._raw = [message for topic in data for message in topic.raw]
        times = np.concatenate([np.asarray(topic.log_time, dtype=np.int64) for topic in data])
        owner = np.repeat(np.arange(len(data)), [len(topic.raw) for topic in data])
        self._order = np.argsort(times, kind="stable")
        self._times = times[self._order]
        self._owner = owner[self._order]
        self._time = SimulatedTime(self, round(_CLOCK_PERIOD * rate)) if with_clock else None
        self._next = 0
        self._ready_at = 0.0
        self._started: float | None = None
        self._timer = self.create_timer(
            _TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @property
    def duration(self) -> float:
        """Length of the bag [s]."""
        return float(self._times[-1] - self._times[0]) * 1e-9

    @property
    def position(self) -> float:
        """Bag time since the start [s]."""
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
        now = int(self._times[0]) + round(self._elapsed() * 1e9)
        due = int(np.searchsorted(self._times, now, side="right"))
        for index in range(self._next, due):
            self._tell_time(int(self._times[index]))
            self._outlets[self._owner[index]].publish(self._raw[self._order[index]])
        self.published += due - self._next
        self._next = due
        self._tell_time(min(now, int(self._times[-1])))
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
