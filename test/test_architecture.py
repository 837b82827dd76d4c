"""The rooms of the house import downwards only, and only the edges know files and ROS."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "wind_sensors"

BELOW = {
    "turbulence": set(),
    "instruments": {"turbulence"},
    "station": {"instruments"},
    "motion": {"station"},
    "simulation": {"station", "instruments", "turbulence", "motion"},
    "estimation": {"station", "instruments", "turbulence", "motion"},
    "diagnosis": {"simulation", "estimation", "station", "instruments", "turbulence", "motion"},
}
"""For each inner room the rooms that it may import."""

EARLIER = {
    "comparing": {"effects"},
    "healthy": {"comparing", "effects", "explaining"},
    "explaining": {"comparing", "effects", "healthy", "regions"},
    "proving": {"comparing", "effects", "healthy", "regions", "explaining"},
}
"""For each step of a diagnosis what it may import: nothing that comes after it."""

OUTER = {"recordings", "report", "nodes", "cli"}
FOUNDATION = {"errors", "compiled"}
FOREIGN = {"rclpy", "rosbags", "matplotlib", "rich"}
"""Libraries of ROS, bags and screens, which the inner rooms do without."""


def imports(path: Path) -> set[str]:
    """Full names of the modules that a file imports, inside functions too."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


def opens_files(path: Path) -> list[int]:
    """Lines on which a file calls `open` or a path's reading and writing methods."""
    methods = {"read_text", "read_bytes", "write_text", "write_bytes", "open"}
    lines = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            called = node.func
            if (isinstance(called, ast.Name) and called.id == "open") or (
                isinstance(called, ast.Attribute) and called.attr in methods
            ):
                lines.append(node.lineno)
    return lines


@pytest.mark.parametrize("room", sorted(BELOW))
def test_inner_rooms_import_downwards_only(room: str) -> None:
    allowed = BELOW[room] | FOUNDATION | {room}
    files = sorted((PACKAGE / room).rglob("*.py"))
    assert files
    wrong = []
    for path in files:
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == "wind_sensors" and len(parts) > 1 and parts[1] not in allowed:
                wrong.append(f"{path.relative_to(PACKAGE)} imports {name}")
            if parts[0] in FOREIGN:
                wrong.append(f"{path.relative_to(PACKAGE)} imports {name}")
    assert wrong == []


@pytest.mark.parametrize("step", sorted(EARLIER))
def test_steps_of_a_diagnosis_know_nothing_of_later_ones(step: str) -> None:
    allowed = EARLIER[step] | {step}
    files = sorted((PACKAGE / "diagnosis" / step).rglob("*.py"))
    assert files
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in files
        for name in imports(path)
        if name.startswith("wind_sensors.diagnosis.") and name.split(".")[2] not in allowed
    ]
    assert wrong == []


@pytest.mark.parametrize("room", sorted(BELOW))
def test_inner_rooms_open_no_files(room: str) -> None:
    found = {
        str(path.relative_to(PACKAGE)): lines
        for path in sorted((PACKAGE / room).rglob("*.py"))
        if (lines := opens_files(path))
    }
    assert found == {}


def test_commands_are_imported_by_nobody() -> None:
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] != "cli"
        for name in imports(path)
        if name.startswith("wind_sensors.cli")
    ]
    assert wrong == []


def test_only_nodes_and_commands_know_ros() -> None:
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] not in {"nodes", "cli"}
        for name in imports(path)
        if name.split(".")[0] == "rclpy"
    ]
    assert wrong == []


def test_every_room_is_known() -> None:
    rooms = {p.name for p in PACKAGE.iterdir() if p.is_dir() and (p / "__init__.py").exists()}
    assert rooms == set(BELOW) | OUTER
