"""The rooms of the house import downwards only, and only the edges know files and ROS."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "wind_sensors"

BELOW: dict[str, set[str]] = {
    "turbulence": set(),
    "instruments": {"turbulence"},
    "station": {"instruments"},
    "motion": {"station"},
    "simulation": {"station", "instruments", "turbulence", "motion"},
    "estimation": {"station", "instruments", "turbulence", "motion"},
    "diagnosis": {"simulation", "estimation", "station", "instruments", "turbulence", "motion"},
}
"""For each inner room the rooms that it may import."""

STEPS = (
    ("effects", "progress"),
    ("comparing",),
    ("healthy",),
    ("regions",),
    ("explaining",),
    ("proving",),
    ("verdict",),
    ("json_output",),
    ("outcome",),
    ("means", "watch"),
    ("latent",),
)
"""Parts of the diagnosis from the bottom to the top; those on one level do not know each other."""

UPWARD = {
    # Which signals tell of an effect, and its sizes, are words that both steps speak.
    ("healthy.calibrated_range", "explaining.terms"),
    ("healthy.learning", "explaining.signatures"),
    ("healthy.reference_lag", "explaining.signatures"),
    ("healthy.reference_lag", "explaining.terms"),
    # What a station is like on healthy days is sought as a diagnosis is.
    ("healthy.standing", "explaining.screening"),
    ("healthy.standing", "explaining.search"),
    ("healthy.standing", "explaining.signatures"),
}
"""Imports of the diagnosis that go upwards all the same: who of whom."""

OUTER = {
    "recordings": {"station", "motion", "estimation", "diagnosis"},
    "report": {*BELOW, "recordings"},
    "nodes": {*BELOW, "recordings", "processes"},
    "cli": {*BELOW, "recordings", "report", "nodes", "processes"},
}
"""For each room at the edge the rooms that it may import."""

FOUNDATION = {"errors", "compiled"}
FOREIGN = {"rclpy", "rosbags", "matplotlib", "rich"}
"""Libraries of ROS, bags and screens, which the inner rooms do without."""


def imports(path: Path) -> set[str]:
    """Full names of what a file imports, inside functions too."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are written in full"
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


def strangers(room: str, allowed: set[str]) -> list[str]:
    """Imports of a room from rooms that it may not know."""
    files = sorted((PACKAGE / room).rglob("*.py"))
    assert files
    return [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in files
        for name in sorted(imports(path))
        if name.startswith("wind_sensors.")
        and name.split(".")[1] not in allowed | FOUNDATION | {room}
    ]


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
    assert strangers(room, BELOW[room]) == []
    foreign = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in sorted((PACKAGE / room).rglob("*.py"))
        for name in imports(path)
        if name.split(".")[0] in FOREIGN
    ]
    assert foreign == []


@pytest.mark.parametrize("room", sorted(OUTER))
def test_rooms_at_the_edge_import_inwards_only(room: str) -> None:
    assert strangers(room, OUTER[room]) == []


def test_rooms_have_an_order() -> None:
    """No two rooms may import each other, not by way of others either."""
    known = {**BELOW, **OUTER, "processes": set()}
    placed: set[str] = set()
    while placed != set(known):
        ready = {room for room, below in known.items() if below <= placed} - placed
        assert ready, f"in a circle: {set(known) - placed}"
        placed |= ready


def test_the_diagnosis_imports_downwards_only() -> None:
    """Any import that is not of a lower step is one of the exceptions, each of which exists."""
    level = {part: number for number, parts in enumerate(STEPS) for part in parts}
    root = PACKAGE / "diagnosis"
    prefix = "wind_sensors.diagnosis."
    seen: set[tuple[str, str]] = set()
    found = {p.stem for p in root.glob("*.py") if p.stem != "__init__"}
    found |= {p.parent.name for p in root.glob("*/__init__.py")}
    assert found == set(level)
    for path in root.rglob("*.py"):
        parts = path.relative_to(root).with_suffix("").parts
        for name in imports(path):
            if parts == ("__init__",) or not name.startswith(prefix):
                continue
            part, *rest = name.removeprefix(prefix).split(".")
            if part != parts[0] and level[part] >= level[parts[0]]:
                seen.add((".".join(parts), ".".join([part, *rest[:1]])))
    assert seen == UPWARD


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
    assert rooms == set(BELOW) | set(OUTER)
