"""`wind record`, `wind replay` and `wind compose` as a user runs them."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from nodes_harness import Graph, overrides
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String

from wind_sensors.errors import UserError
from wind_sensors.nodes import recorder as recorder_module
from wind_sensors.nodes.player import PlayerNode
from wind_sensors.nodes.quality import input_quality, output_quality
from wind_sensors.nodes.recorder import RecorderNode
from wind_sensors.nodes.scenario_parameters import SCENARIO_PARAMETERS, scenario_of
from wind_sensors.recordings import load_station, read_recording, write_recording
from wind_sensors.recordings.bag import read_bag
from wind_sensors.recordings.serialising import template
from wind_sensors.simulation.run import simulate
from wind_sensors.station.signals import Recording
from wind_sensors.station.writing import station_to_yaml

SECONDS = 20.0


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    station = load_station("mast_cup_vane")
    values = {parameter.name: parameter.default for parameter in SCENARIO_PARAMETERS}
    scenario = replace(scenario_of(values, station), duration=SECONDS)
    folder = tmp_path_factory.mktemp("original") / "recording"
    return write_recording(folder, simulate(station, scenario, start=10**18))


def _wind(domain: int, tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    environment = os.environ | {
        "ROS_LOG_DIR": str(tmp_path),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(domain),
    }
    return subprocess.Popen(
        [sys.executable, "-m", "wind_sensors.cli", *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def _readable(bag: Path) -> int:
    """Messages that are in a bag by now."""
    try:
        return sum(len(topic.raw) for topic in read_bag(bag).topics.values())
    except UserError:
        return 0


def _wait(until: Callable[[], bool], at_most: float = 180.0) -> None:
    """Leave the machine to other processes until the condition holds."""
    end = time.monotonic() + at_most
    while not until():
        assert time.monotonic() < end, "what the test waits for never happened"
        time.sleep(0.1)


def _assert_same_signals(first: Recording, second: Recording) -> None:
    np.testing.assert_array_equal(first.pulses["cup"].time, second.pulses["cup"].time)
    np.testing.assert_array_equal(first.angles["vane"].time, second.angles["vane"].time)
    np.testing.assert_array_equal(first.angles["vane"].angle, second.angles["vane"].angle)


def test_what_is_recorded_is_what_was_sent(graph: Graph, tmp_path: Path, original: Path) -> None:
    target = tmp_path / "copy"
    recording = _wind(
        graph.domain, tmp_path, "record", "--station", "mast_cup_vane", "-o", str(target)
    )
    player = graph.add(
        PlayerNode,
        content=read_bag(original / "bag"),
        rate=20.0,
        with_clock=False,
        wait_for_subscribers=1,
    )
    graph.spin(lambda: player.finished, at_most=40.0)
    for _ in range(200):
        graph.spin(lambda: True)
    bag = target / "bag"
    assert bag.exists()
    subprocess.run(["sleep", "0.5"], check=True)
    recording.send_signal(signal.SIGINT)
    recording.send_signal(signal.SIGINT)
    output, _ = recording.communicate(timeout=20)
    assert recording.returncode == 0, output
    assert "/cup/pulses" in output
    _assert_same_signals(read_recording(target), read_recording(original))


def test_what_is_replayed_is_what_was_recorded(
    graph: Graph, tmp_path: Path, original: Path
) -> None:
    target = tmp_path / "copy"
    station = load_station("mast_cup_vane")
    topics = ["/cup/pulses", "/vane/joint_states"]
    recorder = graph.add(
        RecorderNode,
        folder=target,
        topics=topics,
        station=station,
        parameter_overrides=overrides(use_sim_time=True),
    )
    replay = _wind(
        graph.domain, tmp_path, "replay", str(original), "--rate", "20", "--wait-for", "1",
        "--topics", *topics,
    )
    expected = read_recording(original)
    wanted = len(expected.pulses["cup"].time) + len(expected.angles["vane"].time)
    graph.spin(
        lambda: sum(recorder.counts.values()) >= wanted,
        at_most=40.0,
        so_far=lambda: f"{recorder.counts}, of {wanted}; replay: {replay.poll()}",
    )
    output, _ = replay.communicate(timeout=20)
    assert sum(recorder.counts.values()) == wanted
    assert replay.returncode == 0, output
    assert f"{wanted} messages" in output
    recorder.close()
    _assert_same_signals(read_recording(target), expected)


def test_compose_runs_a_station_to_its_end(graph: Graph, tmp_path: Path) -> None:
    target = tmp_path / "composed"
    composing = _wind(
        graph.domain, tmp_path, "compose", "mast_cup_vane", "--rate", "20", "--duration",
        str(SECONDS), "-o", str(target),
    )
    output, _ = composing.communicate(timeout=180)
    assert composing.returncode == 0, output
    content = read_bag(target / "bag")
    # Blocks of half a second are completed at both ends.
    assert 20.0 * SECONDS <= len(content.topics["/wind"].raw) <= 20.0 * (SECONDS + 1.0)
    assert len(content.topics["/wind/mean"].raw) == 1
    assert all(min(topic.log_time) > 0 for topic in content.topics.values() if topic.raw)


def test_a_composition_that_is_interrupted_publishes_the_window_under_way(
    graph: Graph, tmp_path: Path
) -> None:
    target = tmp_path / "interrupted"
    composing = _wind(
        graph.domain, tmp_path, "compose", "mast_cup_vane", "--rate", "20", "-o", str(target)
    )
    _wait(lambda: composing.poll() is not None or _readable(target / "bag") > 0)
    composing.send_signal(signal.SIGINT)
    composing.send_signal(signal.SIGINT)
    output, _ = composing.communicate(timeout=20)
    assert composing.returncode == 0, output
    content = read_bag(target / "bag")
    assert len(content.topics["/wind/mean"].raw) == 1
    wind = content.topics["/wind"]
    message: Any = content.types.deserialize_cdr(wind.raw[-1], wind.message_type)
    last = message.header.stamp
    heard = read_recording(target).angles["vane"].time[-1]
    assert heard - (last.sec * 10**9 + last.nanosec) < 500_000_000


_STOPPED_AT_AN_IMPORT = """
import os, signal, sys

class Stopping:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), int(sys.argv[2]))

sys.meta_path.insert(0, Stopping())
from wind_sensors.cli.main import main
sys.exit(main(sys.argv[3:]) or "the signal was lost")
"""


@pytest.mark.parametrize(
    ("module", "number", "arguments"),
    [
        ("rich.console", signal.SIGINT, ["record", "--all", "-o", "out"]),
        ("rosbags.rosbag2", signal.SIGTERM, ["replay", "."]),
        ("rclpy", signal.SIGINT, ["compose", "mast_cup_vane"]),
    ],
)
def test_a_command_that_is_stopped_while_it_loads_ends_with_status_zero(
    module: str, number: signal.Signals, arguments: list[str], tmp_path: Path
) -> None:
    stopped = subprocess.run(
        [sys.executable, "-c", _STOPPED_AT_AN_IMPORT, module, str(int(number)), *arguments],
        check=False,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parent.parent)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert stopped.returncode == 0, stopped.stderr
    assert "Traceback" not in stopped.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["record", "-o", "new"], "--station"),
        (["record", "--all", "-o", "."], "exists already"),
        (["replay", "nowhere"], "no such recording"),
        (["compose", "nowhere.yaml"], "no such station file"),
    ],
)
def test_mistakes_end_with_status_two(
    arguments: list[str], told: str, tmp_path: Path, graph: Graph
) -> None:
    process = _wind(graph.domain, tmp_path, *arguments)
    output, _ = process.communicate(timeout=30)
    assert process.returncode == 2, output
    assert told in output
    assert "Traceback" not in output


def test_a_killed_recorder_leaves_what_it_had_recorded(
    graph: Graph, tmp_path: Path, original: Path
) -> None:
    target = tmp_path / "killed"
    recording = _wind(
        graph.domain, tmp_path, "record", "--station", "mast_cup_vane", "-o", str(target)
    )
    player = graph.add(
        PlayerNode,
        content=read_bag(original / "bag"),
        topics=["/cup/pulses", "/vane/joint_states"],
        rate=20.0,
        with_clock=False,
        wait_for_subscribers=1,
    )
    graph.spin(lambda: player.finished, at_most=40.0)
    _wait(lambda: _readable(target / "bag") == player.published)
    assert not (target / "bag" / "metadata.yaml").exists()
    recording.kill()
    recording.communicate(timeout=20)
    _assert_same_signals(read_recording(target), read_recording(original))


def test_a_full_disk_ends_a_recording_in_words_and_keeps_what_it_has(
    graph: Graph, tmp_path: Path, original: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "full"
    recorder = graph.add(RecorderNode, folder=target, topics=["/cup/pulses"])
    graph.add(
        PlayerNode, content=read_bag(original / "bag"), topics=["/cup/pulses"],
        with_clock=False, wait_for_subscribers=1,
    )
    graph.spin(lambda: _readable(target / "bag") > 0)
    kept = _readable(target / "bag")

    def refuse(self: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(McapWriter, "close_chunk", refuse)
    with pytest.raises(UserError, match="No space left on device"):
        graph.spin(lambda: False)
    assert _readable(target / "bag") == kept
    recorder.close()


def _latched(graph: Graph, topic: str, texts: list[str]) -> Any:
    """A node that has published some texts and keeps them for those who come late."""
    node = graph.listener()
    quality = output_quality(len(texts), latched=True)
    node.latched = node.create_publisher(String, topic, quality)
    for text in texts:
        node.latched.publish(String(data=text))
    return node


def test_what_was_latched_is_recorded_and_latched_again(graph: Graph, tmp_path: Path) -> None:
    target = tmp_path / "latched"
    _latched(graph, "robot_description", ["first", "second"])
    recorder = graph.add(RecorderNode, folder=target, topics=None)
    graph.spin(lambda: recorder.counts.get("/robot_description") == 2)
    recorder.close()

    player = graph.add(
        PlayerNode, content=read_bag(target / "bag"), topics=["/robot_description"],
        rate=1000.0, with_clock=False,
    )
    graph.spin(lambda: player.finished)
    late = graph.listener()
    texts: list[str] = []
    late.create_subscription(
        String,
        "/robot_description",
        lambda message: texts.append(message.data),
        input_quality(reliable=True, latched=True),
    )
    # The first publisher is there still: twice two.
    graph.spin(lambda: len(texts) == 4, so_far=lambda: texts)
    assert sorted(texts) == ["first", "first", "second", "second"]


def test_of_a_killed_recorder_too_the_latched_topics_are_known(
    graph: Graph, tmp_path: Path
) -> None:
    target = tmp_path / "killed"
    _latched(graph, "robot_description", ["text"])
    graph.add(RecorderNode, folder=target, topics=None)
    graph.spin(lambda: _readable(target / "bag") == 1)
    content = read_bag(target / "bag")
    assert content.salvaged
    assert content.topics["/robot_description"].latched


def test_a_publisher_that_comes_back_as_best_effort_is_recorded(
    graph: Graph, tmp_path: Path
) -> None:
    reliable = graph.listener()
    first = reliable.create_publisher(String, "/text", output_quality())
    recorder = graph.add(RecorderNode, folder=tmp_path / "restarted", topics=["/text"])
    graph.spin(lambda: first.get_subscription_count() == 1)
    graph.spin(lambda: first.publish(String(data="a")) or recorder.counts["/text"] > 0)
    reliable.destroy_publisher(first)
    again = graph.listener()
    second = again.create_publisher(String, "/text", input_quality())
    graph.spin(lambda: "/text" in recorder.notes)
    before = recorder.counts["/text"]
    graph.spin(lambda: second.publish(String(data="b")) or recorder.counts["/text"] > before)
    recorder.close()
    raw = read_bag(tmp_path / "restarted" / "bag").topics["/text"].raw
    assert any(b"b" in message for message in raw)


def _bag(folder: Path, topics: dict[str, str], times: Sequence[int]) -> Path:
    """A bag of empty messages, one for each time on each topic, which comes with its type."""
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg("float64 speed", "boat_msgs/msg/Engine"))
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for name, message_type in topics.items():
            connection = writer.add_connection(name, message_type, typestore=types)
            raw = types.serialize_cdr(template(types, message_type), message_type)
            for time_ns in times:
                writer.write(connection, time_ns, bytes(raw))
    return folder


_HEADER = "std_msgs/msg/Header"
_TWIST = "geometry_msgs/msg/TwistWithCovarianceStamped"
_START = 1_700_000_000 * 10**9


def _replayed(graph: Graph, tmp_path: Path, *arguments: str) -> str:
    """What `wind replay` says."""
    replay = _wind(graph.domain, tmp_path, "replay", *arguments, "--rate", "50")
    output, _ = replay.communicate(timeout=60)
    assert replay.returncode == 0, output
    return " ".join(output.split())


def test_what_comes_before_simulated_time_is_recorded_at_its_beginning(
    graph: Graph, tmp_path: Path
) -> None:
    target = tmp_path / "early"
    recorder = graph.add(
        RecorderNode, folder=target, topics=["/text"],
        parameter_overrides=overrides(use_sim_time=True),
    )
    sender = graph.listener()
    texts = sender.create_publisher(String, "/text", output_quality())
    clock = sender.create_publisher(Clock, "/clock", output_quality())
    graph.spin(lambda: texts.get_subscription_count() == 1 == clock.get_subscription_count())
    for text in ("first", "second"):
        texts.publish(String(data=text))
    graph.spin(lambda: recorder.counts["/text"] == 2)
    assert recorder.waits_for_clock
    graph.spin(lambda: recorder.get_clock().now().nanoseconds > 0 or clock.publish(_clock(5)))
    texts.publish(String(data="third"))
    graph.spin(lambda: recorder.counts["/text"] == 3)
    recorder.close()
    found = read_bag(target / "bag").topics["/text"]
    assert len(found.raw) == 3
    assert set(found.log_time) == {5 * 10**9}
    for sent, raw in zip((b"first", b"second", b"third"), found.raw, strict=True):
        assert sent in raw
    assert "2 messages" in recorder.notes["/clock"]


def _clock(seconds: int) -> Clock:
    return Clock(clock=Time(sec=seconds))


def test_without_a_clock_what_came_is_recorded_at_wall_time(graph: Graph, tmp_path: Path) -> None:
    target = tmp_path / "timeless"
    recorder = graph.add(
        RecorderNode, folder=target, topics=["/text"],
        parameter_overrides=overrides(use_sim_time=True),
    )
    texts = graph.listener().create_publisher(String, "/text", output_quality())
    graph.spin(lambda: texts.get_subscription_count() == 1)
    begin = time.time_ns()
    texts.publish(String(data="only"))
    graph.spin(lambda: recorder.counts["/text"] == 1)
    recorder.close()
    (at,) = read_bag(target / "bag").topics["/text"].log_time
    assert begin <= at <= time.time_ns()
    assert "no /clock came" in recorder.notes["/clock"]


def test_messages_at_time_nought_and_years_without_any_keep_nobody_waiting(
    graph: Graph, tmp_path: Path
) -> None:
    second = 10**9
    year = 365 * 86_400 * second
    times = [0, 0, _START, _START + second, _START + year, _START + year + second]
    content = read_bag(_bag(tmp_path / "odd", {"/pulses": _HEADER}, times))
    player = graph.add(PlayerNode, content=content, rate=50.0, wait_for_subscribers=1)
    listener = graph.listener()
    clock = graph.listen(listener, Clock, "/clock")
    graph.spin(lambda: player.count_subscribers("/clock") == 1)
    graph.listen(listener, Header, "/pulses")
    graph.spin(lambda: player.finished and len(clock) > 0)
    assert player.published == len(times)
    assert player.duration == 2.0
    told = [message.clock.sec * second + message.clock.nanosec for message in clock]
    assert told == sorted(told)
    assert told[0] >= _START
    assert "2 messages were recorded at time 0" in player.notes[0]
    assert "8760.0 hours in which nothing was recorded are skipped" in player.notes[1]


def test_inputs_only_are_the_topics_of_the_station_file(graph: Graph, tmp_path: Path) -> None:
    folder = tmp_path / "boat"
    text = station_to_yaml(load_station("usv")).replace("cup/pulses", "wind/cup/pulses")
    topics = {
        "/wind/cup/pulses": _HEADER,
        "/tf_static": "std_msgs/msg/String",  # where tf2 is not installed, too
        "/wind": _TWIST,
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        "/truth/wind": "geometry_msgs/msg/Vector3Stamped",
    }
    folder.mkdir()
    (folder / "recording.yaml").write_text(text, encoding="utf-8")
    _bag(folder / "bag", topics, [_START])
    assert "Published 2 messages" in _replayed(graph, tmp_path, str(folder), "--inputs-only")
    assert "Published 2 messages" in _replayed(graph, tmp_path, f"{folder}/bag", "--inputs-only")


def test_inputs_only_of_a_bag_alone_leave_out_what_an_estimator_publishes(
    graph: Graph, tmp_path: Path
) -> None:
    kept = {
        "/wind/cup/pulses": _HEADER,
        "/sonic/wind": "geometry_msgs/msg/Vector3Stamped",
        "/headwind": _TWIST,
    }
    left_out = {
        "/wind": _TWIST,
        "/a/wind": _TWIST,
        "/a/wind/bias/vane_lag": "std_msgs/msg/Float64",
        "/a/b/wind/nmea": "std_msgs/msg/String",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }
    bag = _bag(tmp_path / "bag", kept | left_out, [_START])
    output = _replayed(graph, tmp_path, str(bag), "--inputs-only")
    assert f"Published {len(kept)} messages" in output
    bare = _bag(tmp_path / "outputs", left_out, [_START])
    replay = _wind(graph.domain, tmp_path, "replay", str(bare), "--inputs-only")
    output, _ = replay.communicate(timeout=60)
    assert replay.returncode == 2
    assert "no topic of the station's inputs" in " ".join(output.split())


def test_a_type_that_is_not_installed_costs_its_own_topic_alone(
    graph: Graph, tmp_path: Path
) -> None:
    topics = {"/cup/pulses": _HEADER, "/engine": "boat_msgs/msg/Engine"}
    content = read_bag(_bag(tmp_path / "bag", topics, [_START]))
    player = graph.add(PlayerNode, content=content)
    graph.spin(lambda: player.finished)
    assert player.published == 1
    (note,) = player.notes
    assert note.startswith("/engine is left out")
    assert "boat_msgs" in note
    assert "station file" not in note
    with pytest.raises(UserError, match="boat_msgs"):
        graph.add(PlayerNode, content=content, topics=list(topics))


def test_topics_to_replay_may_be_relative_and_misspelt_ones_are_told(
    graph: Graph, tmp_path: Path
) -> None:
    bag = _bag(tmp_path / "bag", {"/cup/pulses": _HEADER, "/a/vane": _HEADER}, [_START])
    output = _replayed(graph, tmp_path, str(bag), "--topics", "cup/pulses", "/cup/pulse")
    assert "Published 1 messages" in output
    assert "/cup/pulse is not in the bag: did you mean /cup/pulses?" in output
    player = graph.add(PlayerNode, content=read_bag(bag), topics=["vane"], namespace="/a")
    graph.spin(lambda: player.finished)
    assert (player.published, player.notes) == (1, [])


def test_what_has_no_room_before_simulated_time_is_counted(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "_MOST_HELD", 30)
    recorder = graph.add(
        RecorderNode, folder=tmp_path / "full", topics=["/text"],
        parameter_overrides=overrides(use_sim_time=True),
    )
    texts = graph.listener().create_publisher(String, "/text", output_quality())
    graph.spin(lambda: texts.get_subscription_count() == 1)
    for text in ("fits", "does not fit any more"):
        texts.publish(String(data=text))
    graph.spin(lambda: recorder.without_room == 1)
    recorder.close()
    (raw,) = read_bag(tmp_path / "full" / "bag").topics["/text"].raw
    assert b"fits" in raw
    assert "no room for 1 more" in recorder.notes["/clock"]
