"""Quality of service: raw inputs best effort and deep, outputs reliable; every one overridable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    QoSReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from rclpy.node import Node
    from rclpy.publisher import Publisher
    from rclpy.subscription import Subscription

INPUT_DEPTH = 1000
"""Messages kept for a slow reader: half a minute of a fast cup."""

OUTPUT_DEPTH = 10

SETTLING = 0.3
"""From the discovery of the last awaited subscriber to the first message [s]: the subscriber may
see the match a little later than the publisher."""

OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)
"""What parameters `qos_overrides.<topic>...` may change."""


def input_quality(
    *, reliable: bool = False, latched: bool = False, depth: int = INPUT_DEPTH
) -> QoSProfile:
    """Quality of a raw input.

    Args:
        reliable: True asks publishers to send lost messages again; it does not match a
            best-effort publisher.
        latched: True asks for what was published before (transient local); it does not match a
            volatile publisher.
        depth: Messages kept.
    """
    reliability = QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=reliability,
        durability=_durability(latched),
    )


def output_quality(depth: int = OUTPUT_DEPTH, *, latched: bool = False) -> QoSProfile:
    """Quality of an output: reliable, the last ones kept, for late subscribers too if latched."""
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE,
        durability=_durability(latched),
    )


def _durability(latched: bool) -> QoSDurabilityPolicy:
    return QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE


def subscribe(
    node: Node,
    message_type: type[Any],
    topic: str,
    callback: Callable[[Any], None],
    quality: QoSProfile,
    *,
    raw: bool = False,
    overridable: Collection[QoSPolicyKind] = OVERRIDABLE,
) -> Subscription:
    """Subscribe, with `qos_overrides.<topic>.subscription.*` parameters."""
    return node.create_subscription(
        message_type,
        topic,
        callback,
        quality,
        qos_overriding_options=QoSOverridingOptions(overridable),
        raw=raw,
    )


def advertise(node: Node, message_type: type[Any], topic: str, quality: QoSProfile) -> Publisher:
    """Publish, with `qos_overrides.<topic>.publisher.*` parameters."""
    return node.create_publisher(
        message_type,
        topic,
        quality,
        qos_overriding_options=QoSOverridingOptions(OVERRIDABLE),
    )
