"""Parameters, quality of service and diagnostics of the nodes, seen from outside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistWithCovarianceStamped, Vector3Stamped
from nodes_harness import Graph, overrides, status, values
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import QoSDurabilityPolicy, QoSReliabilityPolicy
from std_msgs.msg import String

from wind_sensors.errors import UserError
from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import BIVANE, CUP_VANE, PROPELLER_VANE, kind_for
from wind_sensors.nodes.parameters import Parameter, unknown_parameters
from wind_sensors.nodes.recorder import RecorderNode
from wind_sensors.nodes.simulator import SimulatorNode
from wind_sensors.nodes.topics import station_topics
from wind_sensors.recordings import load_station, read_recording
from wind_sensors.recordings.station_files import configuration_folder


def _estimator(graph: Graph, **parameters: Any) -> Any:
    parameters = {"station": "mast_cup_vane", **parameters}
    return graph.add(EstimatorNode, kind=CUP_VANE, parameter_overrides=overrides(**parameters))


def _set(node: Any, **changes: Any) -> Any:
    return node.set_parameters_atomically(overrides(**changes))


def test_whole_numbers_are_welcome_where_a_fraction_is_meant(graph: Graph) -> None:
    node = _estimator(graph, output_rate=5)
    assert node.get_parameter("output_rate").value == 5.0
    assert _set(node, smoother_lag=2).successful
    assert node.get_parameter("smoother_lag").value == 2.0


def test_changes_at_run_time_take_effect_or_say_why_not(graph: Graph) -> None:
    node = _estimator(graph)
    assert _set(node, method="inverse", bandwidth=0.5).successful
    assert _set(node, **{"cup.calibration_distance": 0.25}).successful
    assert node.station.instrument("cup").calibration_distance == 0.25
    for change, reason in (
        ({"method": "guess"}, "kalman"),
        ({"output_rate": 1000.0}, "200"),
        ({"output_rate": float("nan")}, ""),
        ({"cup.distance_constant": -1.0}, ""),
        ({"cup.distance_constant": 0.0}, "above 0"),
        ({"input_depth": 5}, "read-only"),
        ({"cup.pulses.topic": "/elsewhere"}, "read-only"),
        ({"nmea_talker": 7}, "text"),
        ({"cup.calibration_distance": None}, "cannot be unset"),
        ({"output_rate": None}, "cannot be unset"),
    ):
        result = _set(node, **change)
        assert not result.successful
        assert reason in result.reason
    assert _set(node, **{"cup.calibration_distance": 0.24}).successful
    assert node.station.instrument("cup").distance_constant == 1.7


def test_parameters_show_the_constants_of_file_and_profile(graph: Graph) -> None:
    node = _estimator(graph)
    assert node.get_parameter("cup.calibration_distance").value == 0.2
    assert node.get_parameter("vane.damping_ratio").value == 0.38
    descriptor = node.describe_parameter("cup.distance_constant")
    assert "[m]" in descriptor.description


def test_parameters_alone_make_a_station(graph: Graph) -> None:
    node = _estimator(
        graph,
        station="",
        **{
            "cup.profile": "risoe_cup",
            "cup.pulses_per_revolution": 3,
            "vane.distance_constant": 1,
            "vane.damping_ratio": 0.4,
        },
    )
    cup = node.station.instrument("cup")
    assert (cup.pulses_per_revolution, cup.calibration_distance) == (3, 0.2)
    assert node.topics == {"/cup/pulses", "/vane/joint_states"}


def test_a_word_that_ros_reads_as_a_boolean_is_the_word(graph: Graph) -> None:
    node = _estimator(graph, station="usv", **{"platform.heading_reference": True})
    assert node.station.platform.heading_reference == "true"
    assert _set(node, **{"platform.heading_reference": "magnetic"}).successful
    assert _set(node, **{"platform.heading_reference": True}).successful
    assert node.station.platform.heading_reference == "true"
    assert not _set(node, **{"platform.heading_reference": False}).successful


def test_parameters_that_nobody_knows_are_told_with_what_may_be_meant(graph: Graph) -> None:
    diagnostics = graph.listen(graph.listener(), DiagnosticArray, "/diagnostics")
    node = _estimator(
        graph,
        widnow=5.0,
        **{
            "diagnostics_period": 0.05,
            "cup.calibraton_distance": 0.2,
            "qos_overrides./elsewhere.subscription.depth": 5,
        },
    )
    nearest = {"widnow": "window", "cup.calibraton_distance": "cup.calibration_distance"}
    assert unknown_parameters(node) == nearest
    graph.spin(lambda: status(diagnostics, "settings") is not None)
    found = status(diagnostics, "settings")
    assert found.level == b"\x01"
    assert "'widnow' is not known and has no effect: did you mean 'window'?" in found.message


def test_what_is_meant_for_a_peer_is_not_unknown(graph: Graph) -> None:
    node = _estimator(graph, mean_speed=5.0)
    assert unknown_parameters(node) == {"mean_speed": ""}
    peer = graph.add(SimulatorNode)
    assert unknown_parameters(node, [peer]) == {}


def test_the_earth_fixed_frame_is_the_one_that_the_station_file_states(
    graph: Graph, tmp_path: Path
) -> None:
    assert _estimator(graph).get_parameter("frame_id").value == "enu"
    assert _estimator(graph, frame_id="odom").get_parameter("frame_id").value == "odom"
    text = (configuration_folder() / "mast_cup_vane.yaml").read_text(encoding="utf-8")
    file = tmp_path / "station.yaml"
    file.write_text(text.replace("frame: enu", "start: 2024-01-01T00:00:00Z"), encoding="utf-8")
    silent = _estimator(graph, station=str(file))
    assert silent.get_parameter("frame_id").value == "map"
    file.write_text(text.replace("frame: enu", "frame: two words"), encoding="utf-8")
    with pytest.raises(UserError, match=r"recording\.frame"):
        _estimator(graph, station=str(file))


def test_wind_carries_the_frame_of_the_station_file(graph: Graph) -> None:
    wind = graph.listen(graph.listener(), TwistWithCovarianceStamped, "/wind")
    truth = graph.listen(graph.listener(), Vector3Stamped, "/truth/wind")
    _estimator(graph, smoother_lag=0.1)
    graph.add(
        SimulatorNode,
        parameter_overrides=overrides(
            station="mast_cup_vane", speed=10.0, publish_truth=True, wait_for_subscribers=1
        ),
    )
    graph.spin(lambda: bool(wind and truth))
    assert wind[0].header.frame_id == truth[0].header.frame_id == "enu"


@pytest.mark.parametrize("name", ["frame_id", "sensor_frame_id", "body_frame_id"])
def test_what_tf2_does_not_take_as_a_frame_is_refused(graph: Graph, name: str) -> None:
    node = _estimator(graph)
    assert _set(node, **{name: "robot_1/base-link"}).successful
    for wrong in ("", "/map", "two words"):
        assert not _set(node, **{name: wrong}).successful
        with pytest.raises(UserError, match=name):
            _estimator(graph, **{name: wrong})


def test_a_missing_constant_is_named(graph: Graph) -> None:
    with pytest.raises(UserError, match="damping_ratio"):
        _estimator(graph, station="", **{"cup.profile": "risoe_cup"})


@pytest.mark.parametrize("kind", [PROPELLER_VANE, BIVANE])
def test_a_node_refuses_a_station_without_its_instrument(graph: Graph, kind: Any) -> None:
    with pytest.raises(UserError, match=f"{kind.name} needs a"):
        graph.add(EstimatorNode, kind=kind, parameter_overrides=overrides(station="mast_cup_vane"))


def test_raw_inputs_are_best_effort_and_outputs_reliable_unless_overridden(graph: Graph) -> None:
    node = _estimator(
        graph,
        **{
            "qos_overrides./vane/joint_states.subscription.reliability": "reliable",
            "qos_overrides./vane/joint_states.subscription.durability": "transient_local",
        },
    )
    (pulses,) = node.get_subscriptions_info_by_topic("/cup/pulses")
    assert pulses.qos_profile.durability == QoSDurabilityPolicy.VOLATILE
    assert pulses.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT
    (angles,) = node.get_subscriptions_info_by_topic("/vane/joint_states")
    assert angles.qos_profile.reliability == QoSReliabilityPolicy.RELIABLE
    assert angles.qos_profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
    (wind,) = node.get_publishers_info_by_topic("/wind")
    assert wind.qos_profile.reliability == QoSReliabilityPolicy.RELIABLE
    assert node.get_parameter("qos_overrides./wind.publisher.depth").value == 10
    assert node.get_parameter("qos_overrides./cup/pulses.subscription.depth").value >= 100


def test_a_namespace_moves_every_relative_topic(graph: Graph) -> None:
    node = graph.add(
        EstimatorNode,
        kind=CUP_VANE,
        namespace="/mast",
        parameter_overrides=overrides(
            **{
                "cup.profile": "risoe_cup",
                "cup.pulses_per_revolution": 2,
                "vane.distance_constant": 0.5,
                "vane.damping_ratio": 0.4,
            }
        ),
    )
    assert node.topics == {"/mast/cup/pulses", "/mast/vane/joint_states"}
    assert node.count_publishers("/mast/wind") == 1
    assert node.count_publishers("/diagnostics") == 1


@pytest.mark.parametrize(
    "station", sorted(file.stem for file in configuration_folder().glob("*.yaml"))
)
def test_shipped_stations_listen_within_their_namespace(graph: Graph, station: str) -> None:
    node = graph.add(
        EstimatorNode,
        kind=kind_for(load_station(station)),
        namespace="/b",
        parameter_overrides=overrides(station=station),
    )
    assert {topic.split("/")[1] for topic in node.topics} == {"b"}


def test_two_stations_of_one_file_are_kept_apart_by_their_namespaces(
    graph: Graph, tmp_path: Path
) -> None:
    diagnostics = graph.listen(graph.listener(), DiagnosticArray, "/diagnostics")
    recorder = graph.add(
        RecorderNode,
        folder=tmp_path / "a",
        topics=station_topics(load_station("usv")),
        station=load_station("usv"),
        namespace="/a",
    )
    one, other = (
        graph.add(
            EstimatorNode,
            kind=CUP_VANE,
            namespace=name,
            parameter_overrides=overrides(station="usv", diagnostics_period=0.1),
        )
        for name in ("/a", "/b")
    )
    graph.add(
        SimulatorNode,
        namespace="/a",
        parameter_overrides=overrides(station="usv", speed=10.0, wait_for_subscribers=2),
    )
    graph.spin(lambda: recorder.counts.get("/a/cup/pulses", 0) > 20)
    graph.spin(lambda: recorder.counts.get("/a/wind", 0) > 0)
    assert one.received > 0
    assert other.received == 0
    assert status(diagnostics, "topic /a/cup/pulses").level == b"\x00"
    assert status(diagnostics, "topic /b/cup/pulses").level == b"\x01"
    recorder.close()
    recording = read_recording(tmp_path / "a")
    assert recording.pulses["cup"].time.size > 20
    assert recording.platform is not None


def test_an_input_nobody_publishes_is_a_warning_that_names_the_topic(graph: Graph) -> None:
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    _estimator(graph, diagnostics_period=0.05)
    graph.spin(lambda: status(diagnostics, "topic /cup/pulses") is not None)
    found = status(diagnostics, "topic /cup/pulses")
    assert found.level == b"\x01"
    assert values(found)["purpose"] == "pulses of cup"


def test_marine_sentences_flow_when_asked_for(graph: Graph) -> None:
    listener = graph.listener()
    sentences = graph.listen(listener, String, "/wind/nmea")
    _estimator(graph, nmea=True, nmea_rate=20.0, smoother_lag=0.1, use_sim_time=False)
    graph.add(
        SimulatorNode,
        parameter_overrides=overrides(
            station="mast_cup_vane", speed=10.0, direction_from=0.0, wait_for_subscribers=1
        ),
    )
    graph.spin(lambda: len(sentences) >= 4)
    assert {message.data[:6] for message in sentences[:2]} == {"$WIMWV", "$WIMWD"}


@pytest.mark.parametrize(
    ("parameter", "good", "bad"),
    [
        (Parameter("x", float, 1.0, "", minimum=0.0), 3, -1.0),
        (Parameter("x", float, 1.0, ""), 2.5, "2.5"),
        (Parameter("x", float, 1.0, ""), 2.5, float("inf")),
        (Parameter("x", int, 1, "", maximum=5), 5, 6),
        (Parameter("x", int, 1, ""), 5, 1.5),
        (Parameter("x", bool, True, ""), False, 1),
        (Parameter("x", str, "a", "", choices=("a", "b")), "b", "c"),
        (Parameter("x", str, "WI", "", pattern="[A-Z]{2}"), "II", "TO*LONG,"),
        (Parameter("x", str, "WI", "", pattern="[A-Z]{2}"), "II", "WI\n"),
        (Parameter("x", tuple, (), ""), [1, 2.5], "12"),
        (Parameter("x", float, None, ""), None, True),
        (Parameter("x", float, 1.0, ""), 1.0, None),
    ],
)
def test_a_parameter_accepts_its_own_kind_only(parameter: Any, good: Any, bad: Any) -> None:
    assert parameter.accept(good) == (tuple(good) if isinstance(good, list) else good)
    with pytest.raises(ValueError, match="'x'"):
        parameter.accept(bad)


def test_ros_parameters_of_an_unknown_node_do_not_disturb(graph: Graph) -> None:
    node = _estimator(graph)
    assert node.set_parameters([RosParameter("use_sim_time", value=False)])[0].successful
