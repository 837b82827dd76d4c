"""The proving ground must share no physics with what it proves."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1] / "proving_ground"
FORBIDDEN = ("instruments", "simulation", "diagnosis", "estimation", "turbulence", "motion")


def imported_names(source: str) -> Iterator[str]:
    """Every dotted name that a module imports, also through importlib and relative imports."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module or ''}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and node.args:
            called = ast.unparse(node.func)
            if called.endswith(("import_module", "__import__")):
                yield ast.unparse(node.args[0]).strip("'\"")


def trespasses(source: str) -> list[str]:
    """Imports of the product's physics in a module's source."""
    return [
        name
        for name in imported_names(source)
        if name.split(".")[:1] == ["wind_sensors"]
        and any(part in FORBIDDEN for part in name.split(".")[1:])
    ]


@pytest.mark.parametrize("path", sorted(ROOT.rglob("*.py")), ids=lambda p: p.stem)
def test_no_module_of_the_world_imports_the_product_s_physics(path: Path) -> None:
    assert trespasses(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "line",
    [
        "from wind_sensors.instruments import cup",
        "import wind_sensors.diagnosis.effects",
        "from wind_sensors import simulation",
        "import_module('wind_sensors.estimation')",
    ],
)
def test_every_way_of_importing_is_seen(line: str) -> None:
    assert trespasses(line)


def test_the_world_runs_without_loading_the_product_s_physics() -> None:
    import subprocess
    import sys

    program = (
        "import sys, proving_ground.generate, proving_ground.sealing.seal\n"
        "print([m for m in sys.modules if m.startswith('wind_sensors.')])"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT.parent
    )
    loaded = ast.literal_eval(run.stdout.strip().splitlines()[-1])
    assert not [m for m in loaded if m.split(".")[1] in FORBIDDEN]
