"""Diagnostics over real DDS: dead drivers, paused clocks, wrong types and qualities, lost winds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistWithCovarianceStamped, Vector3, Vector3Stamped
from nodes_harness import Graph, overrides, stamps_and_velocities, status, values
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from ruamel.yaml import YAML
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Header, Int32

from wind_sensors.diagnosis.watch import WatchSettings
from wind_sensors.estimation import EstimatorSettings
from wind_sensors.nodes import estimator_node
from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import CUP_VANE
from wind_sensors.nodes.monitor import MonitorNode
from wind_sensors.nodes.quality import advertise, input_quality, output_quality
from wind_sensors.nodes.watch_rehearsal import warm_up_watch
from wind_sensors.recordings import load_station
from wind_sensors.station.model import Input, Reference

OK, WARN, ERROR, STALE = (bytes([level]) for level in range(4))
SECOND = 1_000_000_000
START = 1_800_000_000 * SECOND
STEP = SECOND // 20


def _stamp(time: int) -> Time:
    return Time(sec=time // SECOND, nanosec=time % SECOND)


class Drivers:
    """A cup, a vane, a reference and the clock of a simulation, some seconds at a time."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self.node = graph.listener()
        deep = output_quality(depth=10_000)
        self._clock = advertise(self.node, Clock, "/clock", deep)
        self._cup = advertise(self.node, Header, "/cup/pulses", deep)
        self._vane = advertise(self.node, JointState, "/vane/joint_states", deep)
        self._wind = advertise(self.node, Vector3Stamped, "/reference/wind", deep)
        self.time = START

    def wait_for(self, *topics: str) -> None:
        """Until somebody listens to the clock and to these topics."""
        wanted = ("/clock", *topics)
        self._graph.spin(lambda: all(self.node.count_subscribers(t) for t in wanted))

    def run(
        self, seconds: float, speaks: bool = True, blows: bool = False, lost: float = 0.0
    ) -> None:
        """Let time pass.

        Args:
            seconds: So much.
            speaks: Whether cup and vane do.
            blows: Whether the reference does.
            lost: What the reference says.
        """
        stop = self.time + round(seconds * SECOND)
        while self.time < stop:
            for _ in range(20):
                self.time += STEP
                if speaks:
                    self._cup.publish(Header(stamp=_stamp(self.time)))
                    self._vane.publish(
                        JointState(header=Header(stamp=_stamp(self.time)), position=[0.3])
                    )
                if blows:
                    wind = Vector3Stamped(header=Header(stamp=_stamp(self.time)))
                    wind.vector = Vector3(x=-5.0 + lost, y=0.0, z=0.0)
                    self._wind.publish(wind)
            self._clock.publish(Clock(clock=_stamp(self.time)))
            for _ in range(5):
                self._graph.spin_once()


def _estimator(graph: Graph, **parameters: Any) -> Any:
    return graph.add(
        EstimatorNode,
        kind=CUP_VANE,
        parameter_overrides=overrides(
            station="mast_cup_vane", diagnostics_period=0.05, **parameters
        ),
    )


def test_dead_drivers_end_the_wind_and_a_paused_clock_does_not(graph: Graph) -> None:
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    wind = graph.listen(listener, TwistWithCovarianceStamped, "/wind")
    speed = graph.listen(listener, Float64, "/wind/speed")
    _estimator(
        graph, use_sim_time=True, silence=0.25, window=10.0, input_depth=10_000,
        reliable_inputs=True,
    )
    drivers = Drivers(graph)
    drivers.wait_for("/cup/pulses", "/vane/joint_states")

    def level(name: str) -> bytes:
        found = status(diagnostics, f"cup_vane_node: {name}")
        return b"" if found is None else bytes(found.level)

    drivers.run(25.0)
    graph.spin(lambda: len(speed) >= 2)
    # A simulation that pauses is no dead driver, however long it does.
    paused = len(diagnostics) + 20
    graph.spin(lambda: len(diagnostics) >= paused)
    assert {level(n) for n in ("topic /cup/pulses", "topic /vane/joint_states", "estimate")} == {OK}
    last = drivers.time
    drivers.run(30.0, speaks=False)
    graph.spin(lambda: level("estimate") == ERROR)
    graph.spin(lambda: level("topic /cup/pulses") == STALE)
    graph.spin(lambda: level("topic /vane/joint_states") == STALE)
    assert "Silent for" in status(diagnostics, "topic /cup/pulses").message
    assert "driver is dead" in status(diagnostics, "cup_vane_node: cup").message
    stamps, _, _ = stamps_and_velocities(wind)
    stop_time = EstimatorSettings().stop_time
    assert stamps[-1] <= last + stop_time * SECOND
    assert all(m.data != m.data for m in speed[3:]), "no mean of a window without data"
    drivers.run(12.0)
    graph.spin(lambda: level("estimate") == OK and level("topic /cup/pulses") == OK)
    graph.spin(lambda: stamps_and_velocities(wind)[0][-1] > drivers.time - 3 * SECOND)


def test_a_wrong_type_and_a_wrong_quality_are_told_apart_from_silence(graph: Graph) -> None:
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    _estimator(graph, reliable_inputs=True)

    def told(topic: str, text: str) -> bool:
        found = status(diagnostics, f"topic {topic}")
        return found is not None and text in found.message

    graph.spin(lambda: told("/cup/pulses", "nobody publishes it"))
    assert status(diagnostics, "topic /cup/pulses").level == WARN
    listener.create_publisher(Int32, "/cup/pulses", 10)
    listener.create_publisher(JointState, "/vane/joint_states", input_quality())
    graph.spin(lambda: told("/cup/pulses", "std_msgs/msg/Int32, but std_msgs/msg/Header"))
    graph.spin(lambda: told("/vane/joint_states", "best effort"))
    assert "/listener" in status(diagnostics, "topic /cup/pulses").message
    assert "reliable_inputs" in status(diagnostics, "topic /vane/joint_states").message
    for topic in ("/cup/pulses", "/vane/joint_states"):
        assert status(diagnostics, f"topic {topic}").level == ERROR


def test_a_method_is_warmed_up_before_messages_wait_for_it(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    warmed: list[str] = []
    monkeypatch.setattr(
        estimator_node, "warm_up", lambda station, settings: warmed.append(settings.method)
    )
    node = _estimator(graph, method="naive")
    for method in ("inverse", "inverse", "naive"):
        (result,) = node.set_parameters([Parameter("method", value=method)])
        assert result.successful
    node.set_parameters([Parameter("window", value=60.0)])
    assert warmed == ["naive", "inverse", "naive"]


@pytest.mark.parametrize("drive", ["reference", "estimate"])
@pytest.mark.parametrize("name", ["mast_cup_vane", "usv", "propeller_array"])
def test_the_monitor_rehearses_a_whole_block(name: str, drive: str) -> None:
    station = load_station(name)
    reference = Reference(
        topic=Input(topic="/reference/wind"), separation=0.5, path_length=0.15
    )
    watched = station.model_copy(update={"reference": reference})
    assert warm_up_watch(watched, WatchSettings(drive=drive))


def test_the_monitor_notices_that_its_reference_is_gone_or_no_number(
    graph: Graph, tmp_path: Path
) -> None:
    document = load_station("mast_cup_vane").model_dump(mode="json", exclude_unset=True)
    document["reference"] = {"topic": "/reference/wind", "separation": 0.5, "path_length": 0.15}
    file = tmp_path / "station.yaml"
    YAML().dump(document, file)
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    graph.add(
        MonitorNode,
        parameter_overrides=overrides(
            station=str(file), use_sim_time=True, diagnostics_period=0.05, input_depth=10_000,
            reliable_inputs=True,
        ),
    )
    drivers = Drivers(graph)
    drivers.wait_for("/cup/pulses", "/vane/joint_states", "/reference/wind")

    def told(level: bytes, text: str) -> bool:
        found = status(diagnostics, "monitor_node: comparison")
        return found is not None and found.level == level and text in found.message

    drivers.run(20.0, blows=True)
    graph.spin(lambda: told(OK, "Learning"))
    drivers.run(2.0, blows=True, lost=float("nan"))
    graph.spin(lambda: told(WARN, "were unusable"))
    comparison = "monitor_node: comparison"
    graph.spin(lambda: values(status(diagnostics, comparison))["unusable winds"] == "40")
    drivers.run(80.0)
    graph.spin(lambda: told(STALE, "No wind from reference /reference/wind for"))
    drivers.run(5.0, blows=True)
    graph.spin(lambda: told(OK, "Learning"))
