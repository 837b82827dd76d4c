"""Time told on /clock by the node that makes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosgraph_msgs.msg import Clock

from wind_sensors.nodes.outputs import stamp
from wind_sensors.nodes.quality import advertise, output_quality

if TYPE_CHECKING:
    from rclpy.node import Node


class SimulatedTime:
    """Tells a time that runs forward, not more often than it must be told.

    Args:
        node: Who tells it.
        period: Between messages [ns of the time that is told].
    """

    def __init__(self, node: Node, period: int) -> None:
        self._outlet = advertise(node, Clock, "/clock", output_quality(1))
        self._period = period
        self._next = 0

    def start_at(self, begin: int) -> None:
        """Time starts, or jumps back, to `begin` [ns]."""
        self._next = begin

    def tell(self, now: int) -> None:
        """It is `now` [ns]; said only if the period since the last message is over."""
        if now >= self._next:
            self._outlet.publish(Clock(clock=stamp(now)))
            self._next = now + self._period
