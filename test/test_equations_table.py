"""Every function that docs/equations.md names exists, and every public one is named there."""

from __future__ import annotations

import inspect
import pkgutil
import re
from importlib import import_module
from pathlib import Path

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


def named(cell: str) -> list[tuple[str, str]]:
    """Module and name, or pattern with a star, of each function of a cell."""
    found: list[tuple[str, str]] = []
    module = ""
    for token in re.findall(r"[TIM](?:\.\w+)+\.[\w*]+|\.[\w*]+|\*\w+", cell):
        if token[0] in PACKAGES:
            place, function = token.rsplit(".", 1)
            module = PACKAGES[place[0]] + place[1:]
        else:
            function = token.removeprefix(".")
        assert module, cell
        found.append((module, function))
    return found


def matches(pattern: str, name: str) -> bool:
    return re.fullmatch(re.escape(pattern).replace(r"\*", r"\w*"), name) is not None


def public_functions(package: str) -> list[tuple[str, str]]:
    """Module and name of the functions that a package's own modules define.

    The kernels in the package below (`dynamics`) are the equations' compiled form.
    """
    found = []
    for info in pkgutil.iter_modules(import_module(package).__path__, f"{package}."):
        if not info.ispkg:
            functions = inspect.getmembers(import_module(info.name), inspect.isfunction)
            found += [
                (info.name, name) for name, function in functions
                if function.__module__ == info.name and not name.startswith("_")
            ]
    return found


def test_a_star_stands_for_the_rest_of_a_name() -> None:
    """A whole module, which any name would match, is no row."""
    stars = [function for cell in rows() for _, function in named(cell) if "*" in function]
    assert stars
    assert all(len(pattern.strip("*_")) > 3 for pattern in stars)


@pytest.mark.parametrize("cell", rows())
def test_named_functions_exist(cell: str) -> None:
    for module, function in named(cell):
        known = vars(import_module(module))
        assert any(matches(function, name) for name in known), f"{module} has no {function}"


AXES = "where axes point, no equation"
MODES = "how records are drawn; their row is that of the stream"
WITHOUT_ROW = {
    ("instruments.propeller_array", "orthogonal_axes"): AXES,
    ("instruments.propeller_array", "tripod_axes"): AXES,
    ("instruments.propeller_array", "wind_angles"): AXES,
    ("turbulence.modes", "draw_modes"): MODES,
    ("turbulence.modes", "modal_variances"): MODES,
    ("turbulence.modes", "sum_modes"): MODES,
    ("turbulence.modes", "taper"): MODES,
    ("turbulence.synthesis", "isotropic_spec"): MODES,
    ("turbulence.synthesis", "surface_layer_spec"): MODES,
    ("turbulence.synthesis", "synthesize"): MODES,
    ("turbulence.quadrature", "integrate_over_wavenumbers"): "a rule of quadrature",
}
"""Public functions that stand for no equation, and why."""


@pytest.mark.parametrize("package", [PACKAGES["I"], PACKAGES["T"]])
def test_public_functions_have_a_row(package: str) -> None:
    told = [pair for cell in rows() for pair in named(cell)]
    missing = {
        (module.removeprefix("wind_sensors."), name)
        for module, name in public_functions(package)
        if not any(module == place and matches(pattern, name) for place, pattern in told)
    }
    here = package.removeprefix("wind_sensors.")
    assert missing == {key for key in WITHOUT_ROW if key[0].startswith(here)}


def test_named_figures_exist() -> None:
    names = set(re.findall(r"wind figures (\w+-\d+)", TEXT))
    assert names
    assert names <= set(FIGURES)
