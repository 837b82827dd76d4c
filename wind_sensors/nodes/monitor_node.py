"""A running comparison of a station's signals with their simulation, told on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from wind_sensors.nodes.execution import execute

if TYPE_CHECKING:
    from rclpy.node import Node


def build(arguments: Sequence[str]) -> list[Node]:
    """The node of this executable."""
    from wind_sensors.nodes import monitor

    return monitor.build(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is told to stop."""
    return execute("wind_sensors.nodes.monitor_node:build", arguments)
