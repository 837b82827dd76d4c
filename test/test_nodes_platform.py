"""Nodes on moving platforms: the sensor's pose from tf2, wind along the body's axes, sentences."""

from __future__ import annotations

import itertools
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from geometry_msgs.msg import TransformStamped, TwistWithCovarianceStamped
from nodes_harness import Graph, overrides, stamps_and_velocities
from std_msgs.msg import String

from wind_sensors.estimation.outputs import WindEstimate
from wind_sensors.motion import rotations
from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import CUP_VANE
from wind_sensors.nodes.mounting import tf2_is_installed


@pytest.fixture
def tf2(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A stand-in with tf2_ros' interface that knows a transform once `known` is filled."""
    state = SimpleNamespace(known={}, listening=0)

    class Unknown(Exception):
        pass

    class Buffer:
        def lookup_transform(self, target: str, source: str, time: Any) -> Any:
            if (target, source) not in state.known:
                raise Unknown(target)
            return state.known[target, source]

    class Listener:
        def __init__(self, buffer: Any, node: Any, *, spin_thread: bool) -> None:
            assert not spin_thread
            state.listening += 1

        def unregister(self) -> None:
            state.listening -= 1

    module = ModuleType("tf2_ros")
    module.__spec__ = ModuleSpec("tf2_ros", None)
    vars(module).update(Buffer=Buffer, TransformListener=Listener, TransformException=Unknown)
    monkeypatch.setitem(sys.modules, "tf2_ros", module)
    return state


def _usv(graph: Graph, **parameters: Any) -> Any:
    parameters = {"station": "usv", **parameters}
    return graph.add(EstimatorNode, kind=CUP_VANE, parameter_overrides=overrides(**parameters))


def _mounted(x: float, z: float, yaw_deg: float) -> TransformStamped:
    transform = TransformStamped()
    transform.transform.translation.x, transform.transform.translation.z = x, z
    quaternion = rotations.from_roll_pitch_yaw(0.0, 0.0, np.radians(yaw_deg))
    for axis, value in zip("xyzw", quaternion, strict=True):
        setattr(transform.transform.rotation, axis, float(value))
    return transform


def test_tf2_tells_where_the_sensor_sits_as_soon_as_it_knows(graph: Graph, tf2: Any) -> None:
    node = _usv(graph, sensor_frame_id="mast_top")
    stated = node.station.platform.sensor_position
    graph.spin(lambda: node._mounting is not None, at_most=30.0)
    assert node.station.platform.sensor_position == stated
    tf2.known["base_link", "mast_top"] = _mounted(0.4, 3.0, 90.0)
    graph.spin(lambda: node.station.platform.sensor_position != stated, at_most=30.0)
    assert node.station.platform.sensor_position == pytest.approx((0.4, 0.0, 3.0))
    assert node.station.platform.sensor_rotation_deg == pytest.approx((0.0, 0.0, 90.0))
    assert tf2.listening == 0
    (mounting,) = [s for s in node._health() if s.name == "mounting"]
    assert "tf2" in mounting.message


@pytest.mark.parametrize("wanted", [True, False])
def test_without_tf2_or_without_wanting_it_the_station_file_counts(
    graph: Graph, wanted: bool, request: pytest.FixtureRequest
) -> None:
    if not wanted:
        tf2 = request.getfixturevalue("tf2")
        tf2.known["base_link", "wind_sensor"] = _mounted(9.0, 9.0, 9.0)
    elif tf2_is_installed():
        pytest.skip("tf2 is installed")
    node = _usv(graph, use_tf=wanted)
    assert node._mounting is None
    assert node.station.platform.sensor_position == (-0.2, 0.0, 2.5)
    (mounting,) = [s for s in node._health() if s.name == "mounting"]
    assert "station file" in mounting.message


def test_the_same_wind_is_told_in_earth_body_and_bow(graph: Graph, tf2: Any) -> None:
    """Heading north, sensor turned by 90 degrees, wind towards the east: from port, MWV 270."""
    tf2.known["base_link", "wind_sensor"] = _mounted(-0.2, 2.5, 90.0)
    node = _usv(graph, nmea=True)
    graph.spin(lambda: node._mounting.pose is not None, at_most=30.0)
    listener = graph.listener()
    body = graph.listen(listener, TwistWithCovarianceStamped, "wind/body")
    sentences = graph.listen(listener, String, "wind/nmea")
    north = rotations.matrix(rotations.from_roll_pitch_yaw(0.0, 0.0, np.radians(90.0)))
    sensor_in_body = rotations.matrix(rotations.from_roll_pitch_yaw(0.0, 0.0, np.radians(90.0)))
    to_earth = north @ sensor_in_body
    wind = np.array([6.0, 0.0, 0.0])
    covariance = np.diag((0.01, 0.04, 1.0))
    estimate = WindEstimate(
        10**18, wind, covariance, to_earth.T @ wind, np.eye(3), to_earth
    )

    seconds = itertools.count()

    def told() -> bool:
        later = estimate._replace(time=estimate.time + next(seconds) * 10**9)
        node._outputs.publish_estimates([later])
        return len(body) > 0 and len(sentences) > 1

    graph.spin(told, at_most=30.0)
    _, velocity, spread = stamps_and_velocities(body[:1])
    np.testing.assert_allclose(velocity[0], (0.0, -6.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(spread[0], np.diag((0.04, 0.01, 1.0)), atol=1e-9)
    assert body[0].header.frame_id == "base_link"
    texts = {s.data.split(",")[0]: s.data.split(",") for s in sentences}
    assert texts["$WIMWV"][1:3] == ["270.0", "R"]
    # Magnetic north lies 2.5 degrees east of true north in the ready configuration.
    assert texts["$WIMWD"][1:5] == ["270.0", "T", "267.5", "M"]
