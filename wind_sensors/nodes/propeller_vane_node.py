"""Corrected wind from a propeller on a vane."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from wind_sensors.nodes.execution import execute

if TYPE_CHECKING:
    from rclpy.node import Node


def build(arguments: Sequence[str]) -> list[Node]:
    """The node of this executable."""
    from wind_sensors.nodes import estimator_node, kinds

    return estimator_node.build(kinds.PROPELLER_VANE, arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is told to stop."""
    return execute("wind_sensors.nodes.propeller_vane_node:build", arguments)
