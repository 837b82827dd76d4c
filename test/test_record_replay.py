"""`wind record`, `wind replay` and `wind compose` as a user runs them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from nodes_harness import Graph, overrides

from wind_sensors.nodes.player import PlayerNode
from wind_sensors.nodes.recorder import RecorderNode
from wind_sensors.nodes.scenario_parameters import SCENARIO_PARAMETERS, scenario_of
from wind_sensors.recordings import load_station, read_recording, write_recording
from wind_sensors.recordings.bag import read_bag
from wind_sensors.simulation.run import simulate
from wind_sensors.station.signals import Recording

SECONDS = 20.0


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    made = Graph(tmp_path, monkeypatch)
    yield made
    made.close()


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
    )  # fmt: skip
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
    )  # fmt: skip
    output, _ = composing.communicate(timeout=180)
    assert composing.returncode == 0, output
    content = read_bag(target / "bag")
    # Blocks of half a second are completed at both ends.
    assert 20.0 * SECONDS <= len(content.topics["/wind"].raw) <= 20.0 * (SECONDS + 1.0)
    assert len(content.topics["/wind/mean"].raw) == 1


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
