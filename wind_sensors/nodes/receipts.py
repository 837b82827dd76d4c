"""How far a simulation's listeners have come, so that it can wait for the slowest.

A node that has fallen behind takes what queued up topic by topic, not in the order in which it was
sent. Faster than real time, that soon parts the inputs of an estimator by more than its reordering
window, although not one message is lost. A simulator that never runs further ahead of its listeners
than that window keeps their order, at whatever speed they can follow.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

from wind_sensors.nodes.quality import advertise, output_quality

if TYPE_CHECKING:
    from rclpy.node import Node

RECEIPTS_TOPIC = "receipts"
"""DiagnosticStatus: a listener's name, and by resolved topic how many messages it has had."""

RECEIPTS_DEPTH = 100
_PERIOD = 0.005
"""Between receipts, wall time [s]; at sixty times real time a third of a simulated second."""

_REPEATED_AFTER = 100
"""Periods without news after which a receipt is sent again: the simulator may have come later."""


class ReceiptSender:
    """Tells on `receipts` how many messages a node has had, whenever that has changed.

    The node's subscriptions must be reliable: a message that was lost is waited for without end.

    Args:
        node: The listener; its full name stands in the receipt.
        counts: Messages so far, by resolved topic, also where there are none yet.
        is_ready: Nothing is told, so that a simulator does not begin, before this is true.

    Attributes:
        has_begun: It was true.
    """

    def __init__(
        self,
        node: Node,
        counts: Callable[[], Mapping[str, int]],
        is_ready: Callable[[], bool] = lambda: True,
    ) -> None:
        self._name = node.get_fully_qualified_name()
        self._counts = counts
        self._is_ready = is_ready
        self.has_begun = False
        self._told: dict[str, int] = {}
        self._silent_for = 0
        self._publisher = advertise(
            node, DiagnosticStatus, RECEIPTS_TOPIC, output_quality(RECEIPTS_DEPTH)
        )
        self._timer = node.create_timer(
            _PERIOD, self.send, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def send(self) -> None:
        """Publish a receipt if there is something new, or nothing was said for a while."""
        self.has_begun = self.has_begun or self._is_ready()
        if not self.has_begun:
            return
        counts = dict(self._counts())
        self._silent_for += 1
        if counts == self._told and self._silent_for < _REPEATED_AFTER:
            return
        self._told = counts
        self._silent_for = 0
        values = [KeyValue(key=topic, value=str(n)) for topic, n in counts.items()]
        self._publisher.publish(DiagnosticStatus(name=self._name, values=values))


class ReceiptBook:
    """What has been sent until when, and how much of it every listener has had.

    Args:
        listeners: So many have to answer; 0: nobody is waited for.
    """

    def __init__(self, listeners: int) -> None:
        self._listeners = listeners
        self._received: dict[str, dict[str, int]] = {}
        self._sent: deque[tuple[float, dict[str, int]]] = deque()
        self._complete = 0.0

    def note_sent(self, elapsed: float, counts: Mapping[str, int]) -> None:
        """Everything up to a simulated time has been sent.

        Args:
            elapsed: Simulated time since the start [s], not less than before.
            counts: Messages sent so far, by resolved topic.
        """
        if not self._listeners:
            return
        if self._sent and self._sent[-1][1] == counts:
            self._sent.pop()
        self._sent.append((elapsed, dict(counts)))

    def note_received(self, receipt: DiagnosticStatus) -> None:
        """Take a listener's receipt."""
        self._received[receipt.name] = {pair.key: int(pair.value) for pair in receipt.values}

    @property
    def is_open(self) -> bool:
        """Whether all listeners have answered, if only that they have had nothing yet."""
        return len(self._received) >= self._listeners

    def listeners_of(self, topic: str) -> int:
        """How many say that they listen to a topic, by its resolved name."""
        return sum(topic in received for received in self._received.values())

    @property
    def complete_until(self) -> float:
        """Simulated time up to which every listener has had everything it listens to [s].

        Infinite where nobody is waited for, 0 until all have answered.
        """
        if not self._listeners:
            return math.inf
        if self.is_open:
            while self._sent and not self._missing(self._sent[0][1]):
                self._complete = self._sent.popleft()[0]
        return self._complete

    @property
    def late_listeners(self) -> list[str]:
        """Names of those that have not yet had all that was sent."""
        return self._missing(self._sent[-1][1]) if self._sent else []

    def _missing(self, sent: Mapping[str, int]) -> list[str]:
        return [
            name
            for name, received in self._received.items()
            if any(count < sent.get(topic, 0) for topic, count in received.items())
        ]
