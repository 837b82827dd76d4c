"""Stamps, counts and units that cannot be: told, left out, and never fatal."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from recording_cases import START, counter, cup, full_recording, recorded, vane
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from wind_sensors.recordings import read_recording, write_recording
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.plausible import dropouts, strays
from wind_sensors.recordings.reading import order_notes
from wind_sensors.recordings.serialising import serialised, template
from wind_sensors.station.model import (
    Air,
    Input,
    Platform,
    Reference,
    Station,
)
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    TimeArray,
    Winds,
)
from wind_sensors.station.writing import station_to_yaml

TYPES = typestore()
DAY = 86_400_000_000_000


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


def test_zeros_for_a_moment_in_a_fair_wind_are_noted(tmp_path: Path) -> None:
    source = Input(topic="/c", type="std_msgs/msg/Float64", meaning="value")
    told = [5.0, 5.2, 0.0, 0.0, 5.1, 5.0, 2.0, 0.0, 2.0, 0.0]
    (note,) = counter(tmp_path, told, source).notes
    assert "2 of 10 readings are 0 for a moment" in note and "3 m/s" in note
    time = np.arange(3, dtype=np.int64) * 20_000_000_000
    assert not dropouts(time, np.array([5.0, 0.0, 5.0])).any(), "a rotor may stop in a minute"


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
    )
    after = read_recording(write_recording(tmp_path / "r", before))
    for signal in (
        after.pulses["cup"], after.angles["vane"], after.reference, after.temperature,
        after.platform,
    ):
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


def set_back_at(times: TimeArray, index: int, by: int) -> TimeArray:
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


def test_topics_that_were_written_one_after_the_other_are_no_clock_set_back(
    tmp_path: Path,
) -> None:
    folder = write_recording(tmp_path / "r", full_recording(np.random.default_rng(2)))
    before = read_recording(folder)
    with Reader(folder / "bag") as reader:
        messages = [(c.topic, c.msgtype, time, raw) for c, time, raw in reader.messages()]
    shutil.rmtree(folder / "bag")
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        made = {}
        for topic, kind, time, raw in sorted(messages, key=lambda message: message[0]):
            if topic not in made:
                made[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(made[topic], time, raw)
    after = read_recording(folder)
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
