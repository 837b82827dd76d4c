"""Every function that docs/equations.md names exists."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from wind_sensors.report.paper_figures import FIGURES

TEXT = (Path(__file__).resolve().parents[1] / "docs" / "equations.md").read_text(encoding="utf-8")
PACKAGES = {
    "T": "wind_sensors.turbulence", "I": "wind_sensors.instruments", "M": "wind_sensors.motion"
}


def rows() -> list[str]:
    """Function cells of the tables."""
    cells = [line.split("|")[2].strip() for line in TEXT.splitlines() if line.startswith("|")]
    return [cell for cell in cells if re.match(r"[TIM]\.", cell)]


def exists(module: ModuleType, name: str) -> bool:
    pattern = re.compile(re.escape(name).replace(r"\*", r"\w*") + r"\Z")
    return any(pattern.match(known) for known in vars(module))


@pytest.mark.parametrize("cell", rows())
def test_named_functions_exist(cell: str) -> None:
    module: ModuleType | None = None
    for token in re.findall(r"[TIM](?:\.\w+)+\.[\w*]+|\.[\w*]+|\*\w+", cell):
        if token[0] in PACKAGES:
            place, function = token.rsplit(".", 1)
            module = import_module(PACKAGES[place[0]] + place[1:])
        else:
            function = token.removeprefix(".")
        assert module is not None
        assert exists(module, function), f"{module.__name__} has no {function}"


def test_named_figures_exist() -> None:
    names = set(re.findall(r"wind figures (\w+-\d+)", TEXT))
    assert names
    assert names <= set(FIGURES)
