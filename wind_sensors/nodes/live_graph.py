"""A simulated station and its estimator as processes of their own, recorded over DDS.

The simulator waits for receipts of estimator and recorder, so that a busy machine makes the run
slower instead of different.
"""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import wind_sensors
from wind_sensors.errors import UserError
from wind_sensors.nodes import execution
from wind_sensors.recordings import load_station
from wind_sensors.simulation.run import recording_start

if TYPE_CHECKING:
    from wind_sensors.estimation import EstimatorSettings
    from wind_sensors.nodes.recorder import RecorderNode

_DOMAIN = 50
_FASTEST = 100.0
"""No topic carries more messages a simulated second than this."""

_DEEPEST = 1_000_000
_PATIENCE = 1200.0
"""Longest wait for the first message: kernels may have to be compiled first [s]."""

_QUIET = 2.5
"""Silence that ends the recording once the last estimates have come [s]."""

_STALLED = 60.0
"""Silence after which what is missing will not come any more [s]."""

_LONGEST_SILENCE = 600.0
"""Of the estimator's own clock [s]: inputs that starve on a busy machine have not ended."""

_CLOSE_TOPICS = ("wind", "wind/apparent", "wind/vector")
"""Outputs with a message for every estimate."""


@dataclass(frozen=True)
class LiveRun:
    """What a live run was.

    Attributes:
        wall_seconds: From the first message to the last.
        counts: Messages recorded, by topic.
    """

    wall_seconds: float
    counts: dict[str, int]


@dataclass
class _Watch:
    """Sees the messages come and notices when no more do.

    Args:
        processes: By node.
        estimates: So many must have come before a short silence means the end.
    """

    processes: Mapping[str, subprocess.Popen[bytes]]
    estimates: int
    begin: float = field(default_factory=time.monotonic)
    first: float | None = None
    last: float = 0.0
    messages: int = 0
    over: bool = False

    def is_over(self, counts: Mapping[str, int]) -> bool:
        """Whether everything has arrived, or nothing will any more.

        Raises:
            UserError: A process ended by itself, or nothing ever came.
        """
        now = time.monotonic()
        messages = sum(n for topic, n in counts.items() if topic != "/diagnostics")
        if messages != self.messages:
            self.messages, self.last = messages, now
            self.first = self.first or now
        for name, process in self.processes.items():
            status = process.poll()
            if status:
                raise UserError(f"{name} has ended with status {status}.", "live graph")
        if self.first is None and now - self.begin > _PATIENCE:
            raise UserError("no message has arrived.", "live graph", "See the nodes' messages.")
        silence = _QUIET if counts.get("/wind", 0) >= self.estimates else _STALLED
        self.over = self.first is not None and now - self.last > silence
        return self.over


def run_live(
    station_file: str,
    simulation: Mapping[str, object],
    settings: EstimatorSettings,
    folder: Path,
    estimates: int,
    progress: Callable[[int, float], None],
) -> LiveRun:
    """Run simulator and estimator as processes and record everything they publish.

    Simulated time never goes further ahead of estimator or recorder than the estimator's
    reordering window, so that the messages' order is kept however slowly they follow.

    Args:
        station_file: Station file with a cup, a vane and the recording's start.
        simulation: Parameters of the simulator, with `duration` and `speed`.
        settings: Of the estimator.
        folder: Recording to write; replaced if it is one.
        estimates: So many are expected at least; a recording with fewer is waited for longer.
        progress: Called with the number of messages recorded so far and the simulated time [s].

    Raises:
        UserError: There is no rclpy, or a node failed.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ["ROS_DOMAIN_ID"] = str(_DOMAIN + os.getpid() % 50)
    station = load_station(station_file)
    begin = recording_start(station)
    # Queues hold the whole run: whoever falls behind gets everything later, and nothing is dropped.
    depth = min(round(_FASTEST * float(str(simulation["duration"]))), _DEEPEST)
    estimator = _start("cup_vane_node", _estimator_parameters(station_file, settings, depth))
    simulator = _start(
        "sim_node",
        {
            "station": station_file,
            **simulation,
            "publish_clock": True,
            "publish_truth": True,
            "wait_for_subscribers": 2,
            "wait_for_receipts": 2,
            "longest_lead": settings.reordering_window,
            "output_depth": depth,
        },
    )
    processes = {"cup_vane_node": estimator, "sim_node": simulator}
    watch = _Watch(processes, estimates)
    made: list[RecorderNode] = []

    def build() -> list[RecorderNode]:
        from rclpy.parameter import Parameter

        from wind_sensors.nodes.recorder import RecorderNode
        from wind_sensors.nodes.topics import TRUTH_TOPIC, raw_topics, station_topics

        made.append(
            RecorderNode(
                folder,
                station_topics(station),
                station,
                force=True,
                depth=depth,
                receipts_for=[*raw_topics(station), TRUTH_TOPIC],
                parameter_overrides=[Parameter("use_sim_time", value=True)],
            )
        )
        return made

    def until() -> bool:
        elapsed = made[0].get_clock().now().nanoseconds - begin
        progress(watch.messages, max(elapsed * 1e-9, 0.0))
        return watch.is_over(made[0].counts)

    try:
        execution.run(build, [], until=until, last=False)
    finally:
        for process in processes.values():
            _stop(process)
    if not watch.over:
        raise KeyboardInterrupt
    return LiveRun(watch.last - (watch.first or watch.last), dict(made[0].counts))


def _estimator_parameters(
    station_file: str, settings: EstimatorSettings, depth: int
) -> dict[str, object]:
    """Of a node that loses nothing and is moved by its messages' stamps alone."""
    return {
        "station": station_file,
        **dataclasses.asdict(settings),
        "use_sim_time": True,
        "reliable_inputs": True,
        "input_depth": depth,
        "send_receipts": True,
        "wait_for_subscribers": 1,
        "silence": _LONGEST_SILENCE,
        **{f"qos_overrides./{topic}.publisher.depth": depth for topic in _CLOSE_TOPICS},
    }


def _start(node: str, parameters: Mapping[str, object]) -> subprocess.Popen[bytes]:
    code = f"import sys; from wind_sensors.nodes.{node} import main; sys.exit(main())"
    arguments = ["--ros-args", "--log-level", "warn"]
    for name, value in parameters.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        arguments += ["-p", f"{name}:={text}"]
    package_parent = str(Path(wind_sensors.__file__).resolve().parent.parent)
    paths = [package_parent, *filter(None, [os.environ.get("PYTHONPATH")])]
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )


def _stop(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(timeout=10.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
