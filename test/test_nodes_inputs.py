"""Messages of every kind become the numbers that a recording of them would hold."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import TwistStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import FluidPressure, Imu, JointState, Temperature
from std_msgs.msg import Float32, Float64MultiArray, Header, Int64

from wind_sensors.errors import UserError
from wind_sensors.nodes.diagnostics import Level, Status
from wind_sensors.nodes.inputs import EstimatorInputs
from wind_sensors.nodes.scenario_parameters import SCENARIO_PARAMETERS, scenario_of
from wind_sensors.nodes.signal_messages import SignalEncoder
from wind_sensors.nodes.topic_health import Reason, TopicHealth
from wind_sensors.recordings import load_station
from wind_sensors.recordings.bag import BagContent, TopicData, typestore
from wind_sensors.recordings.reading import signals_of
from wind_sensors.simulation.run import SignalStream
from wind_sensors.simulation.transport import live_events
from wind_sensors.station.model import Station

CUP = "{name: cup, profile: risoe_cup, pulses_per_revolution: 2, pulses: %s}"
VANE = "{name: vane, kind: vane, joint_states: %s, distance_constant: 0.5, damping_ratio: 0.4}"
BIVANE = (
    "{name: bivane, kind: bivane, azimuth: /b, elevation: /b, speed: cup, "
    "distance_constant: 0.7, damping_ratio: 0.5}"
)
SECONDS = 8.0


class Collector:
    """Stands in for an estimator and keeps what it is told."""

    def __init__(self) -> None:
        self.pulses: dict[str, list[tuple[int, float | None]]] = defaultdict(list)
        self.angles: dict[str, list[tuple[int, float]]] = defaultdict(list)
        self.platform: list[tuple[Any, ...]] = []
        self.velocity: list[tuple[int, Any]] = []
        self.air: list[tuple[int, float | None, float | None]] = []

    def add_pulse(self, name: str, time_ns: int, turns: float | None = None) -> None:
        self.pulses[name].append((time_ns, turns))

    def add_angle(self, name: str, time_ns: int, angle: float) -> None:
        self.angles[name].append((time_ns, angle))

    def add_platform(self, *state: Any) -> None:
        self.platform.append(state)

    def add_platform_velocity(self, time_ns: int, velocity: Any) -> None:
        self.velocity.append((time_ns, velocity))

    def add_air(
        self, time_ns: int, temperature: float | None = None, pressure: float | None = None
    ) -> None:
        self.air.append((time_ns, temperature, pressure))


def _station(tmp_path: Path, *instruments: str, more: str = "") -> Station:
    file = tmp_path / "station.yaml"
    lines = "".join(f"- {line}\n" for line in instruments)
    file.write_text(f"instruments:\n{lines}{more}", encoding="utf-8")
    return load_station(file)


def _statuses(inputs: EstimatorInputs) -> dict[str, Status]:
    health = TopicHealth(inputs, lambda: 5, lambda _: Reason(Level.WARN, "nobody."), str)
    return {status.name: status for status in health.statuses()}


def _through(station: Station) -> tuple[Collector, Any, EstimatorInputs]:
    """The same messages through the node's inputs and through a bag's reader."""
    values = {parameter.name: parameter.default for parameter in SCENARIO_PARAMETERS}
    if station.platform is not None:
        values |= {"carrier": "boat", "carrier_speed": 2.0}
    stream = SignalStream(station, scenario_of(values, station), start=10**18)
    encoder = SignalEncoder(station, "map", with_truth=False)
    now = [0]
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: now[0])
    receivers = {source.topic: source.receive for source in inputs.sources()}
    topics: dict[str, TopicData] = {}
    for event in live_events(stream):
        if event.arrival > stream.start + SECONDS * 1e9:
            break
        now[0] = event.arrival
        for topic, message in encoder.encode(event):
            kind = type(message)
            name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            data = topics.setdefault(topic, TopicData(name))
            data.log_time.append(event.arrival)
            data.raw.append(serialize_message(message))
            if topic in receivers:
                receivers[topic](deserialize_message(data.raw[-1], kind))
    offline = signals_of(BagContent(topics, typestore()), station, "test", "test")
    return heard, offline, inputs


@pytest.mark.parametrize(
    "pulses",
    [
        "/p",
        "{topic: /p, type: sensor_msgs/msg/TimeReference}",
        "{topic: /p, type: std_msgs/msg/Int64MultiArray}",
        "{topic: /p, type: std_msgs/msg/Int16, modulus: 16}",
        "{topic: /p, type: std_msgs/msg/Float32}",
        "{topic: /p, type: sensor_msgs/msg/JointState}",
        "{topic: /p, type: std_msgs/msg/Float64, meaning: value, scale: 0.514444}",
    ],
)
def test_pulses_of_every_type_arrive_as_in_a_recording(tmp_path: Path, pulses: str) -> None:
    station = _station(tmp_path, CUP % pulses, VANE % "/v")
    heard, offline, _ = _through(station)
    times = [time for time, _ in heard.pulses["cup"]]
    assert len(times) > 40
    np.testing.assert_array_equal(times, offline.pulses["cup"].time)
    if offline.pulses["cup"].turns is None:
        assert all(turns is None for _, turns in heard.pulses["cup"])
    else:
        turns = [turns for _, turns in heard.pulses["cup"]]
        np.testing.assert_array_equal(turns, offline.pulses["cup"].turns)


@pytest.mark.parametrize(
    "angle",
    [
        "/v",
        "{topic: /v, type: std_msgs/msg/Float64, scale: 0.017453292519943295}",
        "{topic: /v, type: std_msgs/msg/UInt16, scale: 0.00613592315, offset: -3.14159265}",
        "{topic: /v, type: std_msgs/msg/Float32, "
        "steps: [[0.5, 0], [1.5, 90], [2.5, 180], [3.5, 270]]}",
    ],
)
def test_angles_in_every_unit_arrive_as_in_a_recording(tmp_path: Path, angle: str) -> None:
    heard, offline, _ = _through(_station(tmp_path, CUP % "/p", VANE % angle))
    times, angles = zip(*heard.angles["vane"], strict=True)
    np.testing.assert_array_equal(times, offline.angles["vane"].time)
    np.testing.assert_array_equal(angles, offline.angles["vane"].angle)
    assert len(angles) > 100


def test_a_bivane_on_one_topic_delivers_azimuth_and_elevation(tmp_path: Path) -> None:
    heard, offline, _ = _through(_station(tmp_path, CUP % "/p", BIVANE))
    for name in ("bivane", "bivane/elevation"):
        angles = [angle for _, angle in heard.angles[name]]
        np.testing.assert_array_equal(angles, offline.angles[name].angle)
    assert np.std([angle for _, angle in heard.angles["bivane/elevation"]]) > 0.01


@pytest.mark.parametrize(
    ("names", "field", "doubt"),
    [
        (["vane"], "", ""),
        (["", ""], "", ""),
        (["masthead_joint", "rudder"], "", ""),
        (["wind_vane", "rudder"], "", ""),
        (["rudder", "Vane"], "", "state `field: position[1]`"),
        (["rudder", "Vane"], "position[1]", ""),
        (["rudder", "mast"], "", "none looks like 'masthead'"),
        (["rudder", "mast"], "position[1]", ""),
        (["masthead", "rudder"], "position[1]", "state `field: position[0]`"),
    ],
)
def test_a_joint_that_is_not_the_vane_is_told_live_and_offline(
    tmp_path: Path, names: list[str], field: str, doubt: str
) -> None:
    vane = VANE.replace("name: vane", "name: masthead")
    source = f"{{topic: /v, field: '{field}'}}" if field else "/v"
    station = _station(tmp_path, CUP % "/p", vane % source)
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: 5)
    receive = {source.topic: source.receive for source in inputs.sources()}
    message = JointState(name=names, position=[0.7] * len(names))
    for _ in range(2):
        receive["/v"](message)
    status = _statuses(inputs)["topic /v"]
    assert status.level == (Level.WARN if doubt else Level.OK)
    assert doubt in status.message
    assert len(heard.angles["masthead"]) == 2
    data = TopicData("sensor_msgs/msg/JointState", [10**9], [serialize_message(message)])
    offline = signals_of(BagContent({"/v": data}, typestore()), station, "test", "test")
    assert any("is the joint" in note for note in offline.notes) == bool(doubt)


def test_odometry_arrives_as_in_a_recording(tmp_path: Path) -> None:
    more = "platform: {odometry: /odom}\n"
    heard, offline, _ = _through(_station(tmp_path, CUP % "/p", VANE % "/v", more=more))
    time, attitude, velocity, rate, position = (
        np.array(part) for part in zip(*heard.platform, strict=True)
    )
    np.testing.assert_array_equal(time, offline.platform.time)
    np.testing.assert_array_equal(attitude, offline.platform.attitude)
    np.testing.assert_array_equal(velocity, offline.platform.velocity)
    np.testing.assert_array_equal(rate, offline.platform.angular_rate)
    np.testing.assert_array_equal(position, offline.platform.position)


def test_attitude_and_velocity_arrive_apart_as_in_a_recording(tmp_path: Path) -> None:
    more = "platform: {imu: /imu, twist: /velocity}\n"
    heard, offline, _ = _through(_station(tmp_path, CUP % "/p", VANE % "/v", more=more))
    time, attitude, told, rate, _ = zip(*heard.platform, strict=True)
    assert set(told) == {None}
    np.testing.assert_array_equal(time, offline.platform.time)
    np.testing.assert_array_equal(attitude, offline.platform.attitude)
    np.testing.assert_array_equal(rate, offline.platform.angular_rate)
    at, velocity = zip(*heard.velocity, strict=True)
    np.testing.assert_array_equal(at, offline.platform_velocity.time)
    np.testing.assert_array_equal(velocity, offline.platform_velocity.velocity)


def test_an_imu_that_says_it_has_no_orientation_is_not_believed(tmp_path: Path) -> None:
    station = _station(tmp_path, CUP % "/p", VANE % "/v", more="platform: {imu: /imu}\n")
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: 5)
    receive = {source.topic: source.receive for source in inputs.sources()}
    data = TopicData("sensor_msgs/msg/Imu")
    for second, variance in enumerate((0.0, -1.0, 0.01)):
        message = Imu()
        message.header.stamp.sec = 1 + second
        message.orientation.w = 1.0
        message.orientation_covariance[0] = variance
        receive["/imu"](message)
        data.log_time.append(second)
        data.raw.append(serialize_message(message))
    assert [state[0] for state in heard.platform] == [10**9, 3 * 10**9]
    assert inputs.counts["/imu"].without_orientation == 1
    told = {name: status.message for name, status in _statuses(inputs).items()}
    assert "1 without an orientation (orientation_covariance[0] is -1" in told["topic /imu"]
    pulses = TopicData("std_msgs/msg/Header", [1], [serialize_message(Header(stamp=Time(sec=1)))])
    offline = signals_of(
        BagContent({"/imu": data, "/p": pulses}, typestore()), station, "test", "test"
    )
    assert offline.platform is not None
    assert offline.platform.time.tolist() == [10**9, 3 * 10**9]
    assert any("1 of 3 messages say that they have no orientation" in n for n in offline.notes)


def test_a_velocity_that_is_no_number_is_left_out_and_counted(tmp_path: Path) -> None:
    more = "platform: {imu: /imu, twist: /velocity}\n"
    heard: Any = Collector()
    inputs = EstimatorInputs(
        _station(tmp_path, CUP % "/p", VANE % "/v", more=more), heard, lambda: 5
    )
    receive = {source.topic: source.receive for source in inputs.sources()}
    message = TwistStamped()
    message.twist.linear.y = np.nan
    receive["/velocity"](message)
    assert not heard.velocity
    assert inputs.counts["/velocity"].not_numbers == 1


def test_air_arrives_with_its_units(tmp_path: Path) -> None:
    more = "air: {temperature: {topic: /t, offset: -273.15}, pressure: /q}\n"
    heard, offline, _ = _through(_station(tmp_path, CUP % "/p", VANE % "/v", more=more))
    temperatures = [value for _, value, _ in heard.air if value is not None]
    pressures = [value for _, _, value in heard.air if value is not None]
    np.testing.assert_array_equal(temperatures, offline.temperature.value)
    np.testing.assert_array_equal(pressures, offline.pressure.value)


def test_air_and_counts_that_cannot_be_are_left_out_and_counted(tmp_path: Path) -> None:
    counter = "{topic: /p, type: std_msgs/msg/Int64, modulus: 65536}"
    more = "air: {temperature: /t, pressure: /q}\n"
    station = _station(tmp_path, CUP % counter, VANE % "/v", more=more)
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: 5)
    receive = {source.topic: source.receive for source in inputs.sources()}
    receive["/t"](Temperature(temperature=288.15))
    receive["/q"](FluidPressure(fluid_pressure=1013.0))
    for value in (40_000, 40_004, 0):
        receive["/p"](Int64(data=value))
    assert not heard.air
    assert {topic: inputs.counts[topic].implausible for topic in ("/t", "/q", "/p")} == {
        "/t": 1, "/q": 1, "/p": 1,
    }
    told = {name: status.message for name, status in _statuses(inputs).items()}
    assert "1 not plausible" in told["topic /t"] and "`scale`" in told["topic /t"]


def test_times_of_edges_that_are_no_numbers_are_left_out_and_counted(tmp_path: Path) -> None:
    source = "{topic: /p, type: std_msgs/msg/Float64MultiArray, field: data, meaning: edges}"
    station = _station(tmp_path, CUP % source, VANE % "/v")
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: 5)
    receive = {source.topic: source.receive for source in inputs.sources()}
    message = Float64MultiArray(data=[1e9, np.inf, np.nan, 2e9, -np.inf, 1e300])
    receive["/p"](message)
    assert [time for time, _ in heard.pulses["cup"]] == [1_000_000_000, 2_000_000_000]
    assert inputs.counts["/p"].not_numbers == 4
    assert inputs.counts["/p"].unusable == 0
    data = TopicData("std_msgs/msg/Float64MultiArray", [10**9], [serialize_message(message)])
    offline = signals_of(BagContent({"/p": data}, typestore()), station, "test", "test")
    assert offline.pulses["cup"].time.tolist() == [1_000_000_000, 2_000_000_000]
    assert any("4 times are not numbers" in note for note in offline.notes)


@pytest.mark.parametrize(
    ("meaning", "backwards", "at_rest"),
    [("frequency", -3.0, -0.01), ("value", -6.0, -0.1)],
)
def test_a_cup_that_turns_backwards_is_left_out_and_counted(
    tmp_path: Path, meaning: str, backwards: float, at_rest: float
) -> None:
    source = f"{{topic: /p, type: std_msgs/msg/Float32, meaning: {meaning}}}"
    station = _station(tmp_path, CUP % source, VANE % "/v")
    times = iter(range(1, 10))
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: 10**9 * next(times))
    receive = {source.topic: source.receive for source in inputs.sources()}
    for value in (5.0, 5.0, backwards, at_rest):
        receive["/p"](Float32(data=value))
    assert inputs.counts["/p"].implausible == 1
    turns = [turned for _, turned in heard.pulses["cup"]]
    assert 0.0 < turns[1] == turns[2]
    assert turns[3] == pytest.approx(turns[2], abs=0.01)


def test_a_counter_that_begins_anew_is_told(tmp_path: Path) -> None:
    source = "{topic: /p, type: std_msgs/msg/Int64, meaning: count}"
    station = _station(tmp_path, CUP % source, VANE % "/v")
    times = iter(range(1, 10))
    inputs = EstimatorInputs(station, Collector(), lambda: 10**9 * next(times))
    receive = {source.topic: source.receive for source in inputs.sources()}
    for value in (40, 44, 2, 6):
        receive["/p"](Int64(data=value))
    assert _statuses(inputs)["topic /p"].values["restarts of a counter"] == "1"


def test_edges_without_a_stamp_are_left_out_and_counted(tmp_path: Path) -> None:
    station = _station(tmp_path, CUP % "/p", VANE % "/v")
    heard: Any = Collector()
    inputs = EstimatorInputs(station, heard, lambda: 5)
    receive = {source.topic: source.receive for source in inputs.sources()}["/p"]
    receive(Header())
    assert not heard.pulses
    assert inputs.counts["/p"].without_stamp == 1
    assert "1 without a stamp" in _statuses(inputs)["topic /p"].message


def test_a_field_that_does_not_exist_is_the_users_error(tmp_path: Path) -> None:
    wrong = "{topic: /v, type: std_msgs/msg/Float64, field: angle}"
    station = _station(tmp_path, CUP % "/p", VANE % wrong)
    collector: Any = Collector()
    with pytest.raises(UserError, match="no field 'angle'"):
        EstimatorInputs(station, collector, lambda: 0)


def test_a_type_that_is_not_installed_is_the_users_error(tmp_path: Path) -> None:
    wrong = "{topic: /v, type: weather_msgs/msg/Vane, field: angle}"
    station = _station(tmp_path, CUP % "/p", VANE % wrong)
    collector: Any = Collector()
    with pytest.raises(UserError, match="weather_msgs"):
        EstimatorInputs(station, collector, lambda: 0)
