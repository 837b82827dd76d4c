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
from nav_msgs.msg import Odometry
from nodes_harness import Graph, overrides, stamps_and_velocities
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from wind_sensors.estimation import process
from wind_sensors.estimation.outputs import WindEstimate
from wind_sensors.motion import rotations
from wind_sensors.nodes.diagnostics import Level
from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import CUP_VANE, PROPELLER_VANE
from wind_sensors.nodes.mounting import tf2_is_installed
from wind_sensors.nodes.odometry_claims import claims_of, odometry_status
from wind_sensors.nodes.quality import output_quality
from wind_sensors.nodes.scenario_parameters import SCENARIO_PARAMETERS, scenario_of
from wind_sensors.nodes.signal_messages import SignalEncoder
from wind_sensors.recordings import load_station
from wind_sensors.recordings.bag import BagContent, TopicData, typestore
from wind_sensors.recordings.reading import signals_of
from wind_sensors.simulation.run import SignalStream
from wind_sensors.simulation.transport import live_events
from wind_sensors.station.inputs import absolute


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


def _odometry(frame: str, child: str, yaw_deg: float = 0.0, speed: float = 0.0) -> Odometry:
    """Says so of its frames and of the standard deviations of yaw and of the velocity."""
    message = Odometry(child_frame_id=child)
    message.header.frame_id = frame
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance[35] = np.radians(yaw_deg) ** 2
    message.twist.covariance[7] = speed**2
    # What a planar filter does not estimate.
    message.pose.covariance[14] = message.twist.covariance[14] = 1e6
    return message


@pytest.mark.parametrize(
    ("said", "station", "complaint"),
    [
        (_odometry("map", "base_link", 2.0, 0.2), "", ""),
        (_odometry("/map", ""), "", ""),
        (_odometry("", "base_link"), "", ""),
        (_odometry("enu", "base_link"), "recording: {frame: enu}", ""),
        (_odometry("map_ned", "base_link_frd"), "frame: ned", ""),
        (_odometry("odom", "base_link"), "", "set `frame_id` to odom"),
        (_odometry("map_ned", "base_link"), "", "set `frame_id` to map_ned"),
        (_odometry("map", "base_footprint"), "", "set `body_frame_id` to base_footprint"),
        (_odometry("map", "base_link", yaw_deg=10.0), "", "set `platform.attitude_noise_deg`"),
        (_odometry("map", "base_link", speed=2.0), "", "set `platform.velocity_noise`"),
    ],
)
def test_what_the_odometry_says_of_frames_and_noise_is_compared(
    said: Odometry, station: str, complaint: str
) -> None:
    stated = load_station("usv")
    assert stated.platform is not None
    if station == "frame: ned":
        platform = stated.platform.model_copy(update={"frame": "ned"})
        stated = stated.model_copy(update={"platform": platform})
    elif station:
        info = stated.recording.model_copy(update={"frame": "enu"})
        stated = stated.model_copy(update={"recording": info})
    found = odometry_status(claims_of(said), stated, "map", "base_link")
    assert (found.level == Level.WARN) == bool(complaint)
    assert complaint in found.message
    assert found.values["frame"] == said.header.frame_id.removeprefix("/")


def test_the_frames_of_the_odometry_are_shown_as_soon_as_it_is_heard(graph: Graph) -> None:
    node = _usv(graph, frame_id="odom")
    sender = graph.add(lambda **options: Node("sender", **options))
    publisher = sender.create_publisher(Odometry, "/odometry/filtered", output_quality())
    assert "odometry" not in {s.name for s in node._health()}

    def heard() -> bool:
        publisher.publish(_odometry("odom", "base_footprint"))
        return node._inputs.odometry is not None

    graph.spin(heard)
    (status,) = [s for s in node._health() if s.name == "odometry"]
    assert status.level == Level.WARN
    assert "velocity is that of base_footprint" in status.message
    assert "pose is in the frame" not in status.message


def test_a_velocity_that_dies_or_is_no_number_tells_no_wind_live_and_in_the_bag(
    graph: Graph,
) -> None:
    """A multirotor whose velocity is missing from 12 to 18 s and no number from 22 to 28 s."""
    node = graph.add(
        EstimatorNode,
        kind=PROPELLER_VANE,
        parameter_overrides=overrides(
            station="multirotor", reliable_inputs=True, input_depth=20_000, silence=600.0,
            **{"qos_overrides./wind.publisher.depth": 10_000},
        ),
    )
    station = load_station("multirotor")
    values = {parameter.name: parameter.default for parameter in SCENARIO_PARAMETERS}
    values |= {"carrier": "multirotor", "carrier_speed": 5.0}
    stream = SignalStream(station, scenario_of(values, station), start=10**18)
    encoder = SignalEncoder(station, "map", with_truth=False)
    sender = graph.add(lambda **options: Node("sender", **options))
    quality = output_quality(depth=20_000)
    publishers = {t: sender.create_publisher(k, t, quality) for t, k in encoder.topics.items()}
    got = graph.listen(graph.listener(), TwistWithCovarianceStamped, "wind")
    graph.spin(
        lambda: node.count_publishers("/velocity_body") > 0
        and all(p.get_subscription_count() > 0 for p in publishers.values())
        and node._outputs._wind.get_subscription_count() > 0
    )
    topics: dict[str, TopicData] = {}
    sent = 0

    def through() -> None:
        graph.spin(lambda: node.received == sent)

    for event in live_events(stream):
        since = (event.stamp - stream.start) * 1e-9
        if since > 36.0:
            break
        for topic, message in encoder.encode(event):
            if absolute(topic) == "/velocity_body":
                if 12.0 < since < 18.0:
                    continue
                message.twist.linear.x = np.nan if 22.0 < since < 28.0 else event.values[4]
            kind = type(message)
            name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            data = topics.setdefault(absolute(topic), TopicData(name))
            data.log_time.append(event.arrival)
            data.raw.append(serialize_message(message))
            publishers[topic].publish(message)
            sent += 1
        if sent - node.received > 200:
            through()
    through()
    node.finish()
    offline = process(signals_of(BagContent(topics, typestore()), station, "test", "test"))
    graph.spin(lambda: len(got) >= offline.time.size, so_far=lambda: len(got))
    time, velocity, covariance = stamps_and_velocities(got)
    np.testing.assert_array_equal(time, offline.time)
    np.testing.assert_array_equal(velocity, offline.velocity)
    np.testing.assert_array_equal(covariance, offline.covariance)
    since = (time - stream.start) * 1e-9
    for start, stop in ((12.6, 17.9), (22.6, 27.9)):
        assert not np.any((since > start) & (since < stop))
        assert np.any((since > stop) & (since < stop + 1.0))
    statuses = {s.name: s for s in [*node._health(), *node._topics.statuses()]}
    assert statuses["motion"].level == Level.WARN
    assert "attitude or velocity" in statuses["motion"].message
    assert "not a number" in statuses["topic /velocity_body"].message
