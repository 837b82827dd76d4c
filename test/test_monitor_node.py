"""The monitor over real DDS: a simulated station in which the vane turns on its mount."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from diagnostic_msgs.msg import DiagnosticArray
from nodes_harness import Graph, overrides, status, values
from ruamel.yaml import YAML

from wind_sensors.diagnosis.healthy.learning import default_baseline
from wind_sensors.errors import UserError
from wind_sensors.nodes.monitor import MonitorNode
from wind_sensors.nodes.simulator import SimulatorNode
from wind_sensors.recordings import load_station

BEGINNING = 320.0
DURATION = 740.0
BLOCKS = 11


def _station_file(folder: Path, name: str, changes: list[dict[str, Any]]) -> str:
    document = load_station("mast_cup_vane").model_dump(mode="json", exclude_unset=True)
    document["reference"] = {"topic": "/reference/wind", "separation": 0.5, "path_length": 0.15}
    document["changes"] = changes
    path = folder / name
    YAML().dump(document, path)
    return str(path)


def test_a_turned_vane_is_told_live_on_diagnostics(graph: Graph, tmp_path: Path) -> None:
    turned = [{"start": BEGINNING, "instrument": "vane", "set": {"offset_deg": 4.0}}]
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    monitor = graph.add(
        MonitorNode,
        parameter_overrides=overrides(
            station=_station_file(tmp_path, "healthy.yaml", []),
            learning_blocks=3,
            wait=30.0,
            reliable_inputs=True,
            input_depth=200_000,
            diagnostics_period=0.2,
        ),
    )
    simulator = graph.add(
        SimulatorNode,
        parameter_overrides=overrides(
            station=_station_file(tmp_path, "turned.yaml", turned),
            duration=DURATION,
            speed=30.0,
            wait_for_subscribers=1,
            output_depth=200_000,
            seed=4,
            vane_rate=10.0,
            reference_rate=10.0,
        ),
    )
    graph.spin(lambda: simulator.finished, at_most=100.0)
    graph.spin(lambda: monitor.watch.blocks >= BLOCKS, at_most=60.0)
    enough = len(diagnostics) + 3
    graph.spin(lambda: len(diagnostics) >= enough)
    told = status(diagnostics, "monitor_node: mismatch")
    assert told.level in (b"\x01", b"\x02")
    assert values(told)["channel"] == "vane/vane_angle"
    assert any("vane_offset" in v for k, v in values(told).items() if k.startswith("candidate"))
    assert "wind diagnose" in told.message
    assert status(diagnostics, "monitor_node: comparison").level == b"\x00"


def test_a_monitor_without_wind_says_so(graph: Graph, tmp_path: Path) -> None:
    listener = graph.listener()
    diagnostics = graph.listen(listener, DiagnosticArray, "/diagnostics")
    file = _station_file(tmp_path, "healthy.yaml", [])
    graph.add(MonitorNode, parameter_overrides=overrides(station=file, diagnostics_period=0.1))
    graph.spin(lambda: len(diagnostics) > 1)
    told = status(diagnostics, "monitor_node: comparison")
    assert told.level == b"\x03"
    assert "/reference/wind" in told.message
    assert status(diagnostics, "monitor_node: mismatch").level == b"\x00"


def test_a_baseline_that_is_none_is_refused(graph: Graph, tmp_path: Path) -> None:
    file = _station_file(tmp_path, "healthy.yaml", [])
    with pytest.raises(UserError, match="not a baseline"):
        graph.add(MonitorNode, parameter_overrides=overrides(station=file, baseline=file))


def test_a_baseline_of_another_station_is_refused(graph: Graph, tmp_path: Path) -> None:
    other = load_station("usv")
    baseline = tmp_path / "baseline.json"
    baseline.write_text(default_baseline(other).to_json(), encoding="utf-8")
    file = _station_file(tmp_path, "healthy.yaml", [])
    with pytest.raises(UserError, match="not the station that is to be judged"):
        graph.add(MonitorNode, parameter_overrides=overrides(station=file, baseline=str(baseline)))
