"""Bags of every storage and in any state of damage."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recording_cases import START, cup, full_recording, recorded, vane
from representatives import represented
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from wind_sensors.errors import UserError
from wind_sensors.recordings import read_recording, write_recording
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.reading import read_estimates
from wind_sensors.station.model import (
    Input,
    Station,
)
from wind_sensors.station.signals import (
    Pulses,
)
from wind_sensors.station.writing import station_to_yaml

SHARED = Path(__file__).parent.parent.parent / "shared" / "recordings"
TYPES = typestore()


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "small", full_recording(np.random.default_rng(2)))


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
    max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture]
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


def test_a_cut_bag_without_a_topic_is_not_an_unreadable_one(small: Path) -> None:
    file = next((small / "bag").glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-1000])
    assert read_recording(small).pulses["cup"].time.size
    assert read_estimates(small) is None


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
        messages: list[tuple[str, Any]] = [
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
