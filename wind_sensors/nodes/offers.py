"""What the publishers of a topic offer, and the most that all of them do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile


class Request(NamedTuple):
    """What a subscription asks for; a publisher that offers less sends it nothing.

    Attributes:
        reliable: Lost messages again.
        latched: What was published before the subscription (transient local).
    """

    reliable: bool
    latched: bool

    def __str__(self) -> str:
        """In the words of `ros2 topic info -v`, for people."""
        reliability = "reliable" if self.reliable else "best effort"
        return f"{reliability}, {'transient local' if self.latched else 'volatile'}"


def offers(node: Node, topic: str) -> list[QoSProfile]:
    """Quality of service of the publishers of a topic, by its full name."""
    return [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]


def most_offered(profiles: Sequence[QoSProfile]) -> Request:
    """The most that can be asked for without leaving a publisher out.

    Args:
        profiles: Of the publishers, at least one.
    """
    return Request(
        all(profile.reliability == QoSReliabilityPolicy.RELIABLE for profile in profiles),
        all(profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL for profile in profiles),
    )
