"""Recordings written and read back, from every kind of input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording_cases import EDGES, START, counter, cup, full_recording, recorded, vane

from wind_sensors.recordings import read_recording, write_recording
from wind_sensors.station.inputs import TurnCounter
from wind_sensors.station.model import (
    Input,
    Platform,
    Station,
)
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Velocities,
)


@settings(
    max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.integers(0, 2**32))
def test_every_signal_comes_back_to_the_bit(tmp_path: Path, seed: int) -> None:
    before = full_recording(np.random.default_rng(seed))
    after = read_recording(write_recording(tmp_path / "r", before, force=True))
    assert after.station == before.station
    assert after.notes == ()
    for name, pulses in before.pulses.items():
        assert np.array_equal(after.pulses[name].time, pulses.time)
    for name, angles in before.angles.items():
        assert np.array_equal(after.angles[name].time, angles.time)
        assert np.array_equal(after.angles[name].angle, angles.angle)
    for field in ("reference", "truth"):
        ours, theirs = getattr(before, field), getattr(after, field)
        assert np.array_equal(ours.velocity, theirs.velocity)
        assert np.array_equal(ours.time, theirs.time)
    assert before.platform is not None and after.platform is not None
    for field in ("time", "velocity", "angular_rate", "position"):
        assert np.array_equal(getattr(after.platform, field), getattr(before.platform, field))
    assert np.allclose(after.platform.attitude, before.platform.attitude, rtol=0.0, atol=1e-15)
    for field in ("temperature", "pressure"):
        assert np.array_equal(getattr(after, field).value, getattr(before, field).value)


def test_an_imu_with_a_twist_makes_the_same_platform(tmp_path: Path) -> None:
    recording = full_recording(np.random.default_rng(1))
    platform = Platform(imu=Input(topic="/imu"), twist=Input(topic="/velocity"))
    station = recording.station.model_copy(update={"platform": platform})
    moved = Recording(
        "r", station, recording.start, recording.stop, recording.pulses,
        platform=recording.platform,
    )
    found = read_recording(write_recording(tmp_path / "r", moved))
    after = found.platform
    assert after is not None and moved.platform is not None
    assert np.allclose(after.velocity, moved.platform.velocity, atol=1e-9)
    assert np.array_equal(after.angular_rate, moved.platform.angular_rate)
    assert not after.position.any()
    assert found.platform_velocity is not None
    assert np.array_equal(found.platform_velocity.time, moved.platform.time)
    assert np.array_equal(found.platform_velocity.velocity, moved.platform.velocity)


def test_a_velocity_at_times_of_its_own_comes_back_and_is_not_stretched_over_gaps(
    tmp_path: Path,
) -> None:
    recording = full_recording(np.random.default_rng(1))
    states = recording.platform
    assert states is not None
    platform = Platform(imu=Input(topic="/imu"), twist=Input(topic="/velocity"))
    station = recording.station.model_copy(update={"platform": platform})
    second = 10**9
    start = int(states.time[0])
    time = start + np.array([0, 1, 6], dtype=np.int64) * second
    velocity = np.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0], [5.0, 0.0, np.pi]])
    at = start + np.array([0, 500, 1400, 1600, 3000, 5600, 6000]) * 10**6
    few = PlatformStates(
        at, states.attitude[:7], np.full((7, 3), np.nan), states.angular_rate[:7], np.zeros((7, 3))
    )
    before = Recording(
        "r", station, recording.start, recording.stop, recording.pulses, platform=few,
        platform_velocity=Velocities(time, velocity),
    )
    after = read_recording(write_recording(tmp_path / "r", before))
    assert after.platform is not None and after.platform_velocity is not None
    assert np.array_equal(after.platform_velocity.time, time)
    assert np.array_equal(after.platform_velocity.velocity, velocity)
    assert np.array_equal(after.platform.time, at)
    # The five seconds between the last two velocities are known of neither.
    np.testing.assert_allclose(
        after.platform.velocity[:, 0], [1.0, 2.0, np.nan, np.nan, np.nan, np.nan, 5.0]
    )


def test_an_imu_whose_velocity_is_not_in_the_bag_has_none_and_says_so(tmp_path: Path) -> None:
    recording = full_recording(np.random.default_rng(1))
    states = recording.platform
    assert states is not None
    platform = Platform(imu=Input(topic="/imu"), twist=Input(topic="/velocity"))
    station = recording.station.model_copy(update={"platform": platform})
    nothing = Velocities(np.empty(0, dtype=np.int64), np.empty((0, 3)))
    before = Recording(
        "r", station, recording.start, recording.stop, recording.pulses, platform=states,
        platform_velocity=nothing,
    )
    after = read_recording(write_recording(tmp_path / "r", before))
    assert after.platform is not None and np.isnan(after.platform.velocity).all()
    assert "/velocity: no messages (the platform)" in after.notes


@pytest.mark.parametrize(
    "source",
    [
        Input(topic="/c"),
        Input(topic="/c", type="sensor_msgs/msg/TimeReference"),
        Input(topic="/c", type="std_msgs/Int64MultiArray"),
        Input(topic="cup/relative"),
    ],
    ids=lambda source: source.type or source.topic,
)
def test_edges_travel_in_every_type_that_carries_times(tmp_path: Path, source: Input) -> None:
    recording = recorded(Station(instruments=(cup(source),)), pulses={"cup": Pulses(EDGES)})
    after = read_recording(write_recording(tmp_path / "r", recording))
    assert np.array_equal(after.pulses["cup"].time, EDGES)
    assert after.pulses["cup"].turns is None


@pytest.mark.parametrize(
    ("source", "tolerance"),
    [
        (Input(topic="/c", type="std_msgs/msg/Int64"), 0.0),
        (Input(topic="/c", type="std_msgs/msg/UInt8", modulus=256.0), 0.0),
        (Input(topic="/c", type="std_msgs/msg/Int16", modulus=100.0), 0.0),
        (Input(topic="/c", type="std_msgs/msg/Float64", meaning="count"), 0.0),
        (Input(topic="/c", type="sensor_msgs/msg/JointState"), 1e-12),
        (Input(topic="/c", type="std_msgs/msg/Float64"), 1e-9),
        (Input(topic="/c", type="std_msgs/msg/Float64", meaning="value"), 1e-9),
    ],
)
def test_counts_angles_and_rates_become_the_same_turns(
    tmp_path: Path, source: Input, tolerance: float
) -> None:
    time = START + np.arange(300, dtype=np.int64) * 50_000_000
    turns = np.cumsum(np.random.default_rng(3).integers(1, 9, 300)) / 4.0
    station = Station(instruments=(cup(source, starting_speed=0.2),))
    recording = recorded(station, pulses={"cup": Pulses(time, turns)})
    after = read_recording(write_recording(tmp_path / "r", recording)).pulses["cup"]
    assert after.turns is not None
    assert np.array_equal(after.time, time)
    assert np.allclose(after.turns, turns - turns[0], rtol=0.0, atol=tolerance)


def test_a_wrapped_shaft_angle_is_unwrapped(tmp_path: Path) -> None:
    source = Input(topic="/c", type="sensor_msgs/msg/JointState", modulus=2 * np.pi)
    time = START + np.arange(300, dtype=np.int64) * 50_000_000
    turns = np.cumsum(np.random.default_rng(4).uniform(-0.1, 0.45, 300))
    recording = recorded(Station(instruments=(cup(source),)), pulses={"cup": Pulses(time, turns)})
    after = read_recording(write_recording(tmp_path / "r", recording)).pulses["cup"]
    assert after.turns is not None
    assert np.allclose(after.turns, turns - turns[0], rtol=0.0, atol=1e-12)


def test_a_counter_that_restarts_counts_on(tmp_path: Path) -> None:
    source = Input(topic="/c", type="std_msgs/msg/Int32")
    after = counter(tmp_path, [100, 104, 108, 4, 8], source)
    turns = after.pulses["cup"].turns
    assert turns is not None
    assert turns.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert any("restarted once; if it wraps, state" in note for note in after.notes)


def test_a_counter_that_wraps_is_recognised(tmp_path: Path) -> None:
    source = Input(topic="/c", type="std_msgs/msg/Int32")
    (note,) = counter(tmp_path, [65520, 65528, 3, 11, 19], source).notes
    assert "restarted once" in note and note.endswith("write `modulus: 65536`")
    (note,) = counter(tmp_path / "reset", [40000, 40008, 3, 11, 40, 5], source).notes
    assert "restarted 2 times; if it wraps" in note


def test_counters_that_are_right_are_left_alone(tmp_path: Path) -> None:
    source = Input(topic="/c", type="std_msgs/msg/Int32", modulus=256)
    right = counter(tmp_path, [200, 230, 4, 34, 33, 64], source)
    assert right.notes == ()
    turns = right.pulses["cup"].turns
    assert turns is not None
    assert turns.tolist() == [0.0, 7.5, 15.0, 22.5, 22.25, 30.0]
    # A gap, and messages that wait for each other and then come at once.
    counting = TurnCounter(source.model_copy(update={"meaning": "count"}), cup(source))
    for second, value in ((0, 0), (60, 120), (60, 125)):
        reading = counting.add(second * 1_000_000_000, value)
        assert reading is not None and not reading.jumped


def test_a_propeller_angle_may_turn_backwards(tmp_path: Path) -> None:
    source = Input(topic="/c", type="std_msgs/msg/Float64", meaning="angle", scale=0.5)
    turns = counter(tmp_path, [0.0, 8 * np.pi, 4 * np.pi], source).pulses["cup"].turns
    assert turns is not None
    assert np.allclose(turns, [0.0, 2.0, 1.0], atol=1e-15)


@pytest.mark.parametrize(
    ("source", "angle", "tolerance"),
    [
        (Input(topic="/v", type="std_msgs/msg/Float32", scale=np.pi / 180.0), 1.0, 1e-6),
        (Input(topic="/v", type="std_msgs/msg/Int16", scale=2 * np.pi / 4096), 1.0, 1e-3),
        (Input(topic="/v", type="std_msgs/msg/Float64", scale=-1.2566, offset=3.0), 1.0, 1e-14),
        (
            Input(
                topic="/v",
                type="std_msgs/msg/Float64",
                steps=tuple((0.1 * k, 22.5 * k) for k in range(16)),
            ),
            np.radians(67.5),
            1e-14,
        ),
    ],
    ids=["degrees", "adc", "volts", "steps"],
)
def test_vanes_in_any_unit(tmp_path: Path, source: Input, angle: float, tolerance: float) -> None:
    time = START + np.arange(5, dtype=np.int64) * 50_000_000
    recording = recorded(
        Station(instruments=(vane(source),)), angles={"vane": Angles(time, np.full(5, angle))}
    )
    after = read_recording(write_recording(tmp_path / "r", recording)).angles["vane"]
    assert np.allclose(after.angle, angle, rtol=0.0, atol=tolerance)
