"""Recordings: written and read back, from every kind of input, and in any state of damage."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from representatives import represented
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from wind_sensors.errors import UserError
from wind_sensors.recordings import read_recording, write_recording
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.plausible import strays
from wind_sensors.recordings.reading import order_notes
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.recordings.writing import write_topics
from wind_sensors.station.inputs import TurnCounter
from wind_sensors.station.model import (
    Air,
    Bivane,
    Cup,
    Input,
    Platform,
    Reference,
    Station,
    Vane,
)
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    Winds,
)
from wind_sensors.station.writing import station_to_yaml

SHARED = Path(__file__).parent.parent.parent / "shared" / "recordings"
START = 1_767_225_600_000_000_000
TYPES = typestore()


def cup(pulses: Input, **constants: float) -> Cup:
    return Cup(
        name="cup",
        pulses=pulses,
        pulses_per_revolution=4,
        calibration_distance=0.2,
        distance_constant=1.7,
        starting_speed=constants.get("starting_speed", 0.0),
    )


def vane(joint_states: Input) -> Vane:
    return Vane(name="vane", joint_states=joint_states, distance_constant=0.5, damping_ratio=0.4)


def recorded(station: Station, **signals: Any) -> Recording:
    return Recording("test", station, START, START + 10_000_000_000, **signals)


def full_recording(rng: np.random.Generator) -> Recording:
    station = Station(
        instruments=(
            cup(Input(topic="/cup/pulses")),
            vane(Input(topic="/vane")),
            Bivane(
                name="bivane",
                azimuth=Input(topic="/bivane"),
                elevation=Input(topic="/bivane"),
                distance_constant=2.4,
                damping_ratio=0.15,
            ),
        ),
        reference=Reference(topic=Input(topic="/reference/wind")),
        air=Air(temperature=Input(topic="/t"), pressure=Input(topic="/p")),
        platform=Platform(odometry=Input(topic="/odom")),
    )
    time = START + np.sort(rng.integers(0, 10_000_000_000, 50))
    attitude = rng.normal(size=(50, 4))
    attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    return recorded(
        station,
        pulses={"cup": Pulses(time)},
        angles={
            "vane": Angles(time, rng.uniform(-np.pi, np.pi, 50)),
            "bivane": Angles(time, rng.uniform(-np.pi, np.pi, 50)),
            "bivane/elevation": Angles(time, rng.uniform(-0.5, 0.5, 50)),
        },
        reference=Winds(time, rng.normal(size=(50, 3))),
        truth=Winds(time, rng.normal(size=(50, 3))),
        platform=PlatformStates(time, attitude, *(rng.normal(size=(50, 3)) for _ in range(3))),
        temperature=Series(time, rng.normal(15.0, 3.0, 50)),
        pressure=Series(time, rng.normal(101_300.0, 300.0, 50)),
    )


@settings(
    max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
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
    )  # fmt: skip
    after = read_recording(write_recording(tmp_path / "r", moved)).platform
    assert after is not None and moved.platform is not None
    assert np.allclose(after.velocity, moved.platform.velocity, atol=1e-9)
    assert np.array_equal(after.angular_rate, moved.platform.angular_rate)
    assert not after.position.any()


EDGES = START + np.cumsum(np.full(40, 37_000_000, dtype=np.int64))


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


def counter(tmp_path: Path, values: list[float], source: Input) -> Recording:
    time = START + np.arange(len(values), dtype=np.int64) * 1_000_000_000
    raw = serialised(TYPES, template(TYPES, source.type), {("data",): np.asarray(values)})
    text = station_to_yaml(Station(instruments=(cup(source),)))
    topics = [TopicMessages("/c", source.type, time, raw)]
    return read_recording(write_topics(tmp_path / "r", text, topics))


def test_a_counter_that_restarts_counts_on(tmp_path: Path) -> None:
    source = Input(topic="/c", type="std_msgs/msg/Int32")
    after = counter(tmp_path, [100, 104, 108, 4, 8], source)
    turns = after.pulses["cup"].turns
    assert turns is not None
    assert turns.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert any("restarted 1 times" in note for note in after.notes)


@pytest.mark.parametrize(
    ("stated", "values"),
    [
        (65536, [250, 254, 2, 6, 10]),
        (512, [250, 254, 2, 6, 10]),
        (65536, [40000, 40004, 0, 4, 8]),
        (65536, [20000, 20004, 0, 4, 8]),
        (None, [10, 14, 900_000, 900_004, 900_008]),
    ],
)
def test_a_step_that_no_wind_makes_is_told_and_left_out(
    tmp_path: Path, stated: int | None, values: list[float]
) -> None:
    after = counter(
        tmp_path, values, Input(topic="/c", type="std_msgs/msg/Int32", modulus=stated)
    )
    turns = after.pulses["cup"].turns
    assert turns is not None
    assert turns.tolist() == [0.0, 1.0, 1.0, 2.0, 3.0]
    (note,) = after.notes
    assert note.startswith(
        f"/c: 1 steps that no wind turns 'cup' to were left out (the first at 2.000 s, from "
        f"{values[1]:g} to {values[2]:g})"
    )
    assert "`modulus`" in note


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


@pytest.mark.parametrize(
    ("signal", "unit", "wrong", "remedy"),
    [
        ("temperature", 15.0, 288.15, "`offset: -273.15`"),
        ("pressure", 101_300.0, 1013.0, "`scale: 100`"),
    ],
)
def test_air_in_another_unit_is_told_and_not_used(
    tmp_path: Path, signal: str, unit: float, wrong: float, remedy: str
) -> None:
    time = START + np.arange(4, dtype=np.int64) * 1_000_000_000
    air = Air.model_validate({signal: {"topic": f"/{signal}"}})
    station = Station(instruments=(cup(Input(topic="/c")),), air=air)

    def after(name: str, values: list[float]) -> Recording:
        series = Series(time, np.asarray(values))
        recording = recorded(station, pulses={"cup": Pulses(time)}, **{signal: series})
        return read_recording(write_recording(tmp_path / name, recording))

    assert after("right", [unit] * 4).notes == ()
    mixed = after("mixed", [unit, wrong, unit, unit])
    assert getattr(mixed, signal).value.tolist() == [unit] * 3
    (note,) = mixed.notes
    assert note.startswith(f"/{signal}: 1 of 4 values are no {signal} of the air in ")
    assert f"{wrong:g}" in note and remedy in note
    assert getattr(after("wrong", [wrong] * 4), signal) is None


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


def test_what_is_odd_in_the_signals_is_noted_and_not_fatal(tmp_path: Path) -> None:
    time = START + np.asarray([0, 1, 2, 2, 1, 5, 6], dtype=np.int64) * 1_000_000_000
    angle = np.asarray([0.0, 0.1, np.nan, 0.2, 0.3, np.inf, 0.4])
    station = Station(instruments=(cup(Input(topic="/c")), vane(Input(topic="/v"))))
    recording = recorded(
        station, pulses={"cup": Pulses(time)}, angles={"vane": Angles(time, angle)}
    )
    after = read_recording(write_recording(tmp_path / "r", recording))
    assert np.array_equal(after.pulses["cup"].time, time), "the order of arrival stays"
    assert after.angles["vane"].angle.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    notes = "\n".join(after.notes)
    assert "/v: 2 of 7 values are not numbers and were left out (the first at 2.000 s)" in notes
    assert "/c: 1 stamps repeated (the first at 2.000 s)" in notes
    assert "/c: 1 stamps earlier than the one before (the first at 1.000 s)" in notes


DAY = 86_400_000_000_000


def spread(stray: dict[int, int]) -> np.ndarray:
    """Stamps of 200 s, some of them moved by so many nanoseconds."""
    time = START + np.arange(2000, dtype=np.int64) * 100_000_000
    for index, by in stray.items():
        time[index] += by
    return time


@pytest.mark.parametrize(
    "stray",
    [{700: 3000 * DAY}, {0: -3000 * DAY}, {0: -20_000 * DAY, 1999: DAY}, {3: DAY, 9: 900 * DAY}],
)
def test_single_stamps_far_from_all_others_are_left_out_and_noted(
    tmp_path: Path, stray: dict[int, int]
) -> None:
    time = spread(stray)
    near = np.delete(time, list(stray))
    before = recorded(
        Station(
            instruments=(cup(Input(topic="/c")), vane(Input(topic="/v"))),
            reference=Reference(topic=Input(topic="/w")),
            air=Air(temperature=Input(topic="/t")),
            platform=Platform(odometry=Input(topic="/odom")),
        ),
        pulses={"cup": Pulses(time)},
        angles={"vane": Angles(time, np.zeros(time.size))},
        reference=Winds(time, np.ones((time.size, 3))),
        temperature=Series(time, np.full(time.size, 15.0)),
        platform=PlatformStates(
            time, np.tile([0.0, 0.0, 0.0, 1.0], (time.size, 1)),
            *(np.zeros((time.size, 3)) for _ in range(3)),
        ),
    )  # fmt: skip
    after = read_recording(write_recording(tmp_path / "r", before))
    for signal in (
        after.pulses["cup"], after.angles["vane"], after.reference, after.temperature,
        after.platform,
    ):  # fmt: skip
        assert signal is not None
        assert np.array_equal(signal.time, near)
    assert (after.start, after.stop) == (int(near.min()), int(near.max()))
    for topic in ("/c", "/v", "/w", "/t", "/odom"):
        (note,) = (n for n in after.notes if n.startswith(f"{topic}: {len(stray)} of 2000 stamps"))
        assert "lie far from all others" in note


def test_clocks_that_are_set_and_long_gaps_are_no_strays() -> None:
    set_anew = np.concatenate((spread({}), spread({})[:20] + DAY))
    days = START + np.arange(40, dtype=np.int64) * DAY
    for time in (set_anew, days, spread({})[:5] * 2, spread({0: -600_000_000_000})):
        assert not strays(time).any()


def test_impossible_winds_are_left_out_and_noted(tmp_path: Path) -> None:
    time = spread({})
    velocity = np.full((time.size, 3), 5.0)
    velocity[10, 0], velocity[20, 2], velocity[30, 1] = 1e300, -151.0, 149.0
    station = Station(
        instruments=(cup(Input(topic="/c")),), reference=Reference(topic=Input(topic="/w"))
    )
    before = recorded(station, reference=Winds(time, velocity))
    after = read_recording(write_recording(tmp_path / "r", before))
    assert after.reference is not None
    assert np.array_equal(after.reference.time, np.delete(time, [10, 20]))
    assert "/w: 2 of 2000 winds are faster than 150 m/s and were left out" in after.notes


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "small", full_recording(np.random.default_rng(2)))


def set_back_at(times: np.ndarray, index: int, by: int) -> np.ndarray:
    """Times of a clock that is set back before the index-th message."""
    return times - by * (np.arange(len(times)) >= index)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("by", [30_000_000_000, 12_345_678_901], ids=["on the grid", "off it"])
def test_a_clock_that_is_set_back_mixes_nothing(
    tmp_path: Path, plugin: StoragePlugin, by: int
) -> None:
    station = Station(instruments=(vane(Input(topic="/v")),))
    true = START + np.arange(2400, dtype=np.int64) * 50_000_000
    time = set_back_at(true, 1200, by)
    angle = np.linspace(0.0, 1.0, len(time))
    kind = "sensor_msgs/msg/JointState"
    blank = template(TYPES, kind, [("position", 0)])
    raw = serialised(TYPES, blank, {("header", "stamp"): time, ("position", 0): angle})
    folder = tmp_path / "r"
    folder.mkdir()
    (folder / "recording.yaml").write_text(station_to_yaml(station))
    with Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/v", kind, typestore=TYPES)
        for when, message in zip(time.tolist(), raw, strict=True):
            writer.write(connection, when, message)
    after = read_recording(folder)
    assert np.array_equal(after.angles["vane"].time, time)
    assert np.array_equal(after.angles["vane"].angle, angle)
    went = f"clock went back by {by * 1e-9 - 0.05:.1f} s at "
    assert [went in note for note in after.notes] == [True, True], after.notes
    assert "recorder" in after.notes[0] and after.notes[1].startswith("/v: ")


def test_topics_that_were_written_one_after_the_other_are_no_clock_set_back(small: Path) -> None:
    before = read_recording(small)
    with Reader(small / "bag") as reader:
        messages = [(c.topic, c.msgtype, time, raw) for c, time, raw in reader.messages()]
    shutil.rmtree(small / "bag")
    with Writer(small / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        made = {}
        for topic, kind, time, raw in sorted(messages, key=lambda message: message[0]):
            if topic not in made:
                made[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(made[topic], time, raw)
    after = read_recording(small)
    assert after.notes == before.notes
    assert np.array_equal(after.pulses["cup"].time, before.pulses["cup"].time)


def test_one_stray_stamp_is_no_clock_set_back() -> None:
    time = START + np.arange(10, dtype=np.int64) * 1_000_000_000
    stray = time.copy()
    stray[4] += 3 * 10**17
    assert order_notes("/v", stray) == [
        "/v: 1 stamps earlier than the one before (the first at 5.000 s)"
    ]
    back = set_back_at(time, 5, 300 * 10**9)
    assert order_notes("/v", back) == ["/v: the clock went back by 299.0 s at 4.000 s"]


def as_sqlite(folder: Path) -> None:
    """Turn the recording's bag into an sqlite3 one."""
    with Reader(folder / "bag") as reader:
        writer = Writer(folder / "lite", version=9, storage_plugin=StoragePlugin.SQLITE3)
        with writer:
            made = {
                c.id: writer.add_connection(c.topic, c.msgtype, typestore=TYPES)
                for c in reader.connections
            }
            for connection, time, raw in reader.messages():
                writer.write(made[connection.id], time, raw)
    shutil.rmtree(folder / "bag")
    (folder / "lite").rename(folder / "bag")


def test_sqlite_and_mcap_hold_the_same(small: Path) -> None:
    before = read_recording(small)
    as_sqlite(small)
    after = read_recording(small)
    assert np.array_equal(after.pulses["cup"].time, before.pulses["cup"].time)
    assert np.array_equal(after.angles["vane"].angle, before.angles["vane"].angle)


@pytest.mark.parametrize("sqlite", [False, True])
def test_a_bag_without_metadata_is_read_from_its_file(small: Path, sqlite: bool) -> None:
    before = read_recording(small)
    if sqlite:
        as_sqlite(small)
    (small / "bag" / "metadata.yaml").unlink()
    after = read_recording(small)
    assert np.array_equal(after.pulses["cup"].time, before.pulses["cup"].time)
    assert any("no usable metadata.yaml" in note for note in after.notes)
    single = next((small / "bag").iterdir())
    alone = read_recording(single, station_file=small / "recording.yaml")
    assert np.array_equal(alone.pulses["cup"].time, before.pulses["cup"].time)


def long_recording(folder: Path, edges: int) -> tuple[Path, np.ndarray]:
    time = START + np.cumsum(np.random.default_rng(5).integers(1, 10**8, edges))
    recording = recorded(
        Station(instruments=(cup(Input(topic="/c")),)), pulses={"cup": Pulses(time)}
    )
    return write_recording(folder, recording), time


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(share=st.floats(0.0, 0.999))
def test_a_bag_cut_anywhere_gives_its_beginning_or_a_clear_refusal(
    tmp_path: Path, share: float
) -> None:
    folder = tmp_path / "cut"
    shutil.rmtree(folder, ignore_errors=True)
    _, time = long_recording(folder, 3000)
    file = folder / "bag" / "bag.mcap"
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    try:
        after = read_recording(folder)
    except UserError as refusal:
        assert "cannot be read" in str(refusal)
        assert share < 0.5
        return
    found = after.pulses["cup"].time
    assert np.array_equal(found, time[: len(found)])
    assert after.notes


def test_a_damaged_sqlite_bag_gives_what_is_left(tmp_path: Path) -> None:
    folder, time = long_recording(tmp_path / "cut", 5000)
    as_sqlite(folder)
    file = next((folder / "bag").glob("*.db3"))
    with sqlite3.connect(file) as database:
        database.execute("PRAGMA journal_mode=DELETE")
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    after = read_recording(folder)
    found = after.pulses["cup"].time
    assert 0 < len(found) < len(time)
    assert np.array_equal(found, time[: len(found)])
    assert any("damaged" in note for note in after.notes)


def test_refusals_say_what_to_do(tmp_path: Path, small: Path) -> None:
    with pytest.raises(UserError, match="no such recording"):
        read_recording(tmp_path / "nothing")
    shutil.copytree(small / "bag", tmp_path / "alone" / "bag")
    for lonely in ("alone", "alone/bag"):
        with pytest.raises(UserError, match="--station"):
            read_recording(tmp_path / lonely)
    (tmp_path / "void").mkdir()
    with pytest.raises(UserError, match=r"void: this folder is empty.*recording\.yaml and bag/"):
        read_recording(tmp_path / "void")
    other = tmp_path / "other.yaml"
    other.write_text(station_to_yaml(Station(instruments=(cup(Input(topic="/x")),))))
    with pytest.raises(UserError, match=r"none of the station's topics.*/cup/pulses"):
        read_recording(small, other)
    wrong = Station(instruments=(cup(Input(topic="/vane", meaning="edge")),))
    other.write_text(station_to_yaml(wrong))
    with pytest.raises(UserError, match="sensor_msgs/msg/JointState"):
        read_recording(small, other)
    text = Station(instruments=(vane(Input(topic="/vane", field="header.frame_id")),))
    other.write_text(station_to_yaml(text))
    with pytest.raises(UserError, match="not a number"):
        read_recording(small, other)


def test_the_bag_of_a_recording_stands_for_it(
    small: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = read_recording(small)
    (file,) = (small / "bag").glob("*.mcap")
    monkeypatch.chdir(small / "bag")
    for path in (small / "bag", file, Path()):
        found = read_recording(path)
        assert found.name == whole.name == "small"
        assert found.station == whole.station
        assert np.array_equal(found.pulses["cup"].time, whole.pulses["cup"].time)


def test_nothing_is_overwritten_without_force_and_only_recordings_with_it(
    tmp_path: Path, small: Path
) -> None:
    recording = read_recording(small)
    with pytest.raises(UserError, match="--force"):
        write_recording(small, recording)
    write_recording(small, recording, force=True)
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "thesis.txt").write_text("years")
    with pytest.raises(UserError, match="not a recording"):
        write_recording(precious, recording, force=True)
    assert (precious / "thesis.txt").exists()


@pytest.mark.skipif(not SHARED.exists(), reason="shared material absent")
@pytest.mark.parametrize(
    "name",
    represented(
        ["station-a/healthy-1", "station-b/open-1", "station-c/healthy-2"], by=("station-b/open-1",)
    ),
)
def test_shared_recordings_equal_rosbags_and_survive_a_round_trip(
    tmp_path: Path, name: str
) -> None:
    recording = read_recording(SHARED / name)
    assert recording.notes == ()
    with Reader(SHARED / name / "bag") as reader:
        chosen = [c for c in reader.connections if c.topic != "/platform/odom"]
        messages = [
            (c.topic, TYPES.deserialize_cdr(raw, c.msgtype))
            for c, _, raw in reader.messages(connections=chosen)
        ]
    angles = [m.position[0] for topic, m in messages if topic == "/vane/joint_states"]
    assert np.array_equal(recording.angles["vane"].angle, angles)
    winds = [m.vector.y for topic, m in messages if topic == "/reference/wind"]
    assert recording.reference is not None
    assert np.array_equal(recording.reference.velocity[:, 1], winds)
    for rotor, pulses in recording.pulses.items():
        stamps = [m.stamp for topic, m in messages if topic == f"/{rotor}/pulses"]
        assert np.array_equal(pulses.time, [s.sec * 10**9 + s.nanosec for s in stamps])
    again = read_recording(write_recording(tmp_path / "r", recording))
    assert again.station == recording.station
    assert np.array_equal(again.angles["vane"].angle, recording.angles["vane"].angle)
    assert (again.start, again.stop) == (recording.start, recording.stop)
