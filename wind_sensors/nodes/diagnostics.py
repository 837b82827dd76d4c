"""Health of a node on /diagnostics, about once a second of wall time.

The timer runs on the steady clock, so that a node which waits for a simulated clock that never
comes says so instead of hanging in silence; the stamps are those of the node's own clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType

from wind_sensors.nodes.quality import advertise, output_quality

if TYPE_CHECKING:
    from rclpy.node import Node


class Level(IntEnum):
    """Severity, as in diagnostic_msgs."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """One line of health.

    Attributes:
        name: What it is about, e.g. `cup`.
        level: Severity.
        message: One sentence.
        values: Details, key by key.
    """

    name: str
    level: Level
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


class Updater:
    """Publishes statuses periodically.

    Args:
        node: The node that publishes; its name prefixes every status.
        sources: Called at each update.
        period: Between updates, wall time [s].
        hardware_id: Of all statuses, e.g. the station's name.
    """

    def __init__(
        self,
        node: Node,
        sources: Sequence[Callable[[], Iterable[Status]]],
        period: float = 1.0,
        hardware_id: str = "",
    ) -> None:
        self._node = node
        self._sources = [*sources, self._simulated_time]
        self._hardware_id = hardware_id
        self._publisher = advertise(node, DiagnosticArray, "/diagnostics", output_quality())
        self._timer = node.create_timer(
            period, self.update, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._periods_without_time = 0

    def update(self) -> None:
        """Publish all statuses now."""
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        prefix = self._node.get_fully_qualified_name().lstrip("/")
        for source in self._sources:
            for status in source():
                array.status.append(
                    DiagnosticStatus(
                        name=f"{prefix}: {status.name}",
                        level=bytes([status.level]),
                        message=status.message,
                        hardware_id=self._hardware_id,
                        values=[KeyValue(key=k, value=v) for k, v in status.values.items()],
                    )
                )
        self._publisher.publish(array)

    def _simulated_time(self) -> Iterable[Status]:
        if not self._node.get_parameter("use_sim_time").value:
            return
        if self._node.get_clock().now().nanoseconds > 0:
            self._periods_without_time = 0
            yield Status("simulated time", Level.OK, "Simulated time is running.")
            return
        self._periods_without_time += 1
        yield Status(
            "simulated time",
            Level.ERROR if self._periods_without_time > 1 else Level.WARN,
            "use_sim_time is set but nothing arrives on /clock: start the bag with its clock "
            "(`wind replay`, `ros2 bag play --clock`) or set use_sim_time to false.",
        )
