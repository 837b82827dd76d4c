"""Simulator, estimator and recorder of one station in one process."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from rclpy.node import Node
from rclpy.parameter import Parameter

from wind_sensors.nodes.estimator_node import EstimatorNode
from wind_sensors.nodes.kinds import kind_for
from wind_sensors.nodes.recorder import RecorderNode
from wind_sensors.nodes.simulator import SimulatorNode
from wind_sensors.nodes.topics import station_topics
from wind_sensors.recordings import load_station

_SETTLING = 0.5
"""Silence after which the last messages are taken to be through [s of wall time]."""

_PATIENCE = 5.0
"""The same while the estimator has not received all that was sent."""

_SHORT_PATIENCE = 1.5
"""The same after a stop signal."""


class Composition:
    """The nodes of `wind compose`.

    Args:
        station_file: Station file or name of a shipped configuration.
        simulation: Parameters of the simulator.
        estimation: Parameters of the estimator.
        output: Recording to write; None: nothing is recorded.
        force: Replace it.

    Attributes:
        simulator, estimator: The nodes.
        recorder: None where nothing is recorded.

    Raises:
        UserError: The station or a parameter is wrong, or no estimator fits.
    """

    def __init__(
        self,
        station_file: str,
        simulation: Mapping[str, object],
        estimation: Mapping[str, object],
        output: str | Path | None = None,
        *,
        force: bool = False,
    ) -> None:
        station = load_station(station_file)
        simulated_time = bool(simulation.get("publish_clock", False))
        common = {"station": station_file}
        recorded = output is not None
        self.recorder: RecorderNode | None = None
        if output is not None:
            self.recorder = RecorderNode(
                output,
                station_topics(station),
                station,
                force=force,
                parameter_overrides=_overrides({"use_sim_time": simulated_time}),
            )
        self.estimator = EstimatorNode(
            kind_for(station),
            parameter_overrides=_overrides(
                {**common, **estimation, "use_sim_time": simulated_time}
            ),
        )
        waits = 2 if recorded else 1
        self.simulator = SimulatorNode(
            parameter_overrides=_overrides({**common, **simulation, "wait_for_subscribers": waits})
        )
        self.estimator.peers = (self.simulator,)
        self._finished_at: float | None = None
        self._flushed = False

    def nodes(self) -> list[Node]:
        """All nodes, for one executor."""
        found: list[Node] = [self.simulator, self.estimator]
        return found if self.recorder is None else [*found, self.recorder]

    def wind_up(self) -> bool:
        """End the simulation; whether the last results are out. To be asked as `has_ended` is."""
        self.simulator.stop()
        return self._has_ended(_SHORT_PATIENCE)

    def has_ended(self) -> bool:
        """Whether the simulation has ended and the last results are out.

        To be asked repeatedly while the nodes spin: it makes the estimator finish.
        """
        return self._has_ended(_PATIENCE)

    def _has_ended(self, patience: float) -> bool:
        if not self.simulator.finished:
            return False
        now = time.monotonic()
        if self._finished_at is None:
            self._finished_at = now
        silence = now - max(self._finished_at, self.estimator.received_at)
        topics = self.estimator.topics
        sent = sum(n for t, n in self.simulator.published_by_topic().items() if t in topics)
        if silence < (_SETTLING if self.estimator.received >= sent else patience):
            return False
        if not self._flushed:
            self._flushed = True
            self._finished_at = now
            self.estimator.finish()
            return False
        return True


def _overrides(values: Mapping[str, object]) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in values.items() if value is not None]
