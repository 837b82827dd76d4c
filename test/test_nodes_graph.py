"""The live graph over DDS: simulator, estimator, recorder, player."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistWithCovarianceStamped
from nodes_harness import Graph, overrides, stamps_and_velocities, status, values

from wind_sensors.estimation import EstimatorSettings
from wind_sensors.estimation.processing import process
from wind_sensors.nodes.diagnostics import Level
from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import CUP_VANE, kind_for
from wind_sensors.nodes.player import PlayerNode
from wind_sensors.nodes.recorder import RecorderNode
from wind_sensors.nodes.scenario_parameters import SCENARIO_PARAMETERS, scenario_of
from wind_sensors.nodes.simulator import SimulatorNode
from wind_sensors.nodes.topics import TRUTH_TOPIC, raw_topics, station_topics
from wind_sensors.recordings import load_station, read_recording
from wind_sensors.recordings.bag import read_bag
from wind_sensors.simulation.run import simulate
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Recording

DURATION = 16.0
SPEED = 20.0
SEED = 5


class LiveRun:
    """A simulated station, its estimator and a recorder, run to the end of the simulation."""

    def __init__(
        self, graph: Graph, folder: Path, station: str, *, waits: bool = False, **simulation: Any
    ) -> None:
        self._graph = graph
        self.settings = EstimatorSettings(reordering_window=1.0 if waits else 0.2)
        listener = graph.listener()
        self.wind = graph.listen(listener, TwistWithCovarianceStamped, "/wind")
        self.diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
        loaded = load_station(station)
        self.recorder = graph.add(
            RecorderNode,
            folder=folder,
            topics=station_topics(loaded),
            station=loaded,
            receipts_for=[*raw_topics(loaded), TRUTH_TOPIC] if waits else (),
            parameter_overrides=overrides(use_sim_time=True),
        )
        self.estimator = graph.add(
            EstimatorNode,
            kind=kind_for(loaded),
            parameter_overrides=overrides(
                station=station,
                use_sim_time=True,
                reliable_inputs=True,
                input_depth=20_000,
                diagnostics_period=0.1,
                reordering_window=self.settings.reordering_window,
                send_receipts=waits,
                silence=600.0 if waits else 2.0,
                **{"qos_overrides./wind.publisher.depth": 1000},
            ),
        )
        self.simulator = graph.add(
            SimulatorNode,
            parameter_overrides=overrides(
                **{
                    "station": station,
                    "duration": DURATION,
                    "speed": SPEED,
                    "publish_clock": True,
                    "publish_truth": True,
                    "wait_for_subscribers": 2,
                    "wait_for_receipts": 2 if waits else 0,
                    "output_depth": 20_000,
                    "seed": SEED,
                    **simulation,
                }
            ),
        )
        graph.spin(lambda: self.simulator.finished, 300.0)
        raw = [self.recorder.resolve_topic_name(t) for t in [*raw_topics(loaded), TRUTH_TOPIC]]
        counts = self.recorder.counts
        graph.spin(lambda: sum(counts[t] for t in raw) == self.simulator.published)
        received = sum(counts[t] for t in raw if t in self.estimator.topics)
        graph.spin(lambda: self.estimator.received == received)
        self.estimator.finish()
        enough = len(self.diagnostics) + 10
        graph.spin(lambda: len(self.diagnostics) >= enough)
        self.recorder.close()
        self.recording = read_recording(folder)

    def status(self, name: str) -> Any:
        """The estimator's newest status of that name."""
        return status(self.diagnostics, f"{self.estimator.get_name()}: {name}")

    def assert_live_equals_offline(self) -> None:
        """The bag gives the numbers that went over DDS, to the last bit."""
        offline = process(self.recording, self.settings)
        self._graph.spin(lambda: len(self.wind) >= offline.time.size)
        time, velocity, covariance = stamps_and_velocities(self.wind)
        assert len(time) > 0.9 * DURATION * self.settings.output_rate
        np.testing.assert_array_equal(time, offline.time)
        np.testing.assert_array_equal(velocity, offline.velocity)
        np.testing.assert_array_equal(covariance, offline.covariance)


def _offline_simulation(station_name: str, start: int) -> Recording:
    station = load_station(station_name)
    defaults = {p.name: p.default for p in SCENARIO_PARAMETERS} | {"seed": SEED}
    scenario = replace(scenario_of(defaults, station), duration=DURATION)
    return simulate(station, scenario, start=start)


@pytest.mark.parametrize(
    "station",
    ["mast_cup_vane", "mast_propeller_vane", "usv", "multirotor", "propeller_array", "bivane"],
)
def test_live_equals_offline_to_the_bit(graph: Graph, tmp_path: Path, station: str) -> None:
    run = LiveRun(graph, tmp_path / "recording", station)
    run.assert_live_equals_offline()
    # Names of joints, frames and noises of the ready stations contradict nothing.
    names = {s.name: s for s in [*run.estimator._health(), *run.estimator._topics.statuses()]}
    assert ("odometry" in names) == (station == "usv")
    for name, found in names.items():
        if name == "odometry" or name.startswith("topic"):
            # The run is over, and the clock of the simulation has gone.
            assert found.level == Level.OK or "Silent" in found.message, found.message


def test_listeners_that_cannot_follow_make_the_run_slower_and_not_different(
    graph: Graph, tmp_path: Path
) -> None:
    run = LiveRun(graph, tmp_path / "recording", "mast_cup_vane", waits=True, speed=1000.0)
    run.assert_live_equals_offline()
    assert values(run.status("clock"))["jumps"] == "0"
    assert values(run.status("vane"))["late"] == "0"


def test_live_signals_are_those_of_an_offline_simulation(graph: Graph, tmp_path: Path) -> None:
    live = LiveRun(graph, tmp_path / "recording", "mast_cup_vane").recording
    offline = _offline_simulation("mast_cup_vane", int(live.angles["vane"].time[0]))
    assert live.truth is not None
    assert offline.truth is not None
    np.testing.assert_array_equal(live.pulses["cup"].time, offline.pulses["cup"].time)
    np.testing.assert_array_equal(live.angles["vane"].time, offline.angles["vane"].time)
    np.testing.assert_array_equal(live.angles["vane"].angle, offline.angles["vane"].angle)
    np.testing.assert_array_equal(live.truth.velocity, offline.truth.velocity)


def test_transport_faults_are_survived_told_and_repeated_offline(
    graph: Graph, tmp_path: Path
) -> None:
    faults: dict[str, Any] = {
        "faults.loss": 0.1,
        "faults.doubling": 0.1,
        "faults.jitter": 0.05,
        "faults.not_a_number": 0.05,
    }
    run = LiveRun(graph, tmp_path / "recording", "mast_cup_vane", **faults)
    run.assert_live_equals_offline()
    assert int(values(run.status("vane"))["doubled"]) > 20
    topic = run.status("topic /vane/joint_states")
    assert int(values(topic)["not numbers"]) > 5
    assert topic.level == b"\x01"
    _, velocity, _ = stamps_and_velocities(run.wind)
    truth = run.recording.truth
    assert truth is not None
    time, _, _ = stamps_and_velocities(run.wind)
    true = np.stack([np.interp(time, truth.time, truth.velocity[:, k]) for k in (0, 1)], axis=1)
    settled = slice(len(time) // 3, None)
    error = velocity[settled, :2] - true[settled]
    assert np.sqrt(np.mean(error**2)) < 0.5


def test_a_clock_that_jumps_back_is_reported_and_the_wind_goes_on(
    graph: Graph, tmp_path: Path
) -> None:
    faults: dict[str, Any] = {"faults.clock_jump_at": 8.0, "faults.clock_jump": -1000.0}
    run = LiveRun(graph, tmp_path / "recording", "mast_cup_vane", **faults)
    clock = run.status("clock")
    assert values(clock)["jumps"] == "1"
    assert "jump" in clock.message
    time, _, _ = stamps_and_velocities(run.wind)
    steps = np.diff(time)
    assert np.count_nonzero(steps < 0) == 1
    assert np.count_nonzero(time < time[0]) > 100
    run.assert_live_equals_offline()


def test_a_counter_that_wraps_gives_the_wind_of_single_edges(graph: Graph, tmp_path: Path) -> None:
    wrapping = tmp_path / "wrapping.yaml"
    edges = load_station("mast_cup_vane").instrument("cup")
    assert isinstance(edges, Cup)
    wrapping.write_text(
        "instruments:\n"
        "- {name: cup, profile: risoe_cup, pulses_per_revolution: 2, pulses: {topic: /cup/count, "
        "meaning: count, type: sensor_msgs/msg/JointState, modulus: 64}}\n"
        "- {name: vane, kind: vane, joint_states: /vane/joint_states, distance_constant: 0.5, "
        "damping_ratio: 0.38}\n",
        encoding="utf-8",
    )
    parameters: dict[str, Any] = {"faults.counter_modulus": 64}
    run = LiveRun(graph, tmp_path / "recording", str(wrapping), **parameters)
    counted = run.recording.pulses["cup"]
    assert counted.turns is not None
    assert counted.turns[-1] == pytest.approx((len(counted.time) - 1) / edges.pulses_per_revolution)
    _, velocity, _ = stamps_and_velocities(run.wind)
    from_edges = process(
        _offline_simulation("mast_cup_vane", run.recording.start), EstimatorSettings()
    )
    difference = velocity[:, :2] - from_edges.velocity[:, :2]
    # A missed wrap would be metres per second. What remains is the start, in which counts and edges
    # tell different things, and the very end, where an edge that did not come tells more than a
    # count that did not change: small against what the estimate itself claims to know.
    claimed = np.sqrt(np.mean(from_edges.covariance[:, (0, 1), (0, 1)]))
    assert np.sqrt(np.mean(difference[100:-40] ** 2)) < 0.25 * claimed


def test_a_looping_bag_makes_the_clock_jump_and_the_estimate_start_afresh(
    graph: Graph, tmp_path: Path
) -> None:
    folder = tmp_path / "recording"
    LiveRun(graph, folder, "mast_cup_vane")
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    estimator = graph.add(
        EstimatorNode,
        kind=CUP_VANE._replace(name="second"),
        parameter_overrides=overrides(
            station="mast_cup_vane",
            use_sim_time=True,
            reliable_inputs=True,
            input_depth=20_000,
            diagnostics_period=0.1,
        ),
    )
    player = graph.add(
        PlayerNode,
        content=read_bag(folder / "bag"),
        topics=["/cup/pulses", "/vane/joint_states"],
        rate=60.0,
        loop=True,
        wait_for_subscribers=1,
    )
    raw = read_bag(folder / "bag").topics
    one_pass = len(raw["/cup/pulses"].raw) + len(raw["/vane/joint_states"].raw)
    graph.spin(lambda: player.published > 3 * one_pass)
    # On a slow machine the player alone would go on forever faster than the estimator reads.
    graph.rest(player)

    def jumped() -> bool:
        clock = status(diagnostics, f"{estimator.get_name()}: clock")
        return clock is not None and values(clock).get("jumps", "0") != "0"

    graph.spin(jumped)
    assert not player.finished


def test_simulated_time_without_a_clock_is_an_error_and_not_silence(graph: Graph) -> None:
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    graph.add(
        EstimatorNode,
        kind=CUP_VANE,
        parameter_overrides=overrides(
            station="mast_cup_vane", use_sim_time=True, diagnostics_period=0.05
        ),
    )

    def told() -> bool:
        return any(
            s.level == b"\x02" and "/clock" in s.message for a in diagnostics for s in a.status
        )

    graph.spin(told)
