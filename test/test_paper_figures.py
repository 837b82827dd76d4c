"""Every figure is drawn, in every format, and shows what its paper says or its formula gives."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.figure import Figure
from scipy import integrate

from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.report.bivane_reduction import compare_reductions
from wind_sensors.report.paper_figures import FIGURES, render

FloatArray = npt.NDArray[np.float64]


@pytest.mark.parametrize("name", list(FIGURES))
def test_every_figure_is_drawn(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.png"
    render(name, path)
    assert path.read_bytes().startswith(b"\x89PNG")
    figure = Figure()
    FIGURES[name].draw(figure)
    for axes in figure.axes:
        sharing = axes.get_shared_x_axes().get_siblings(axes)
        assert any(panel.get_xlabel() for panel in sharing)
        assert axes.get_ylabel()
        for line in axes.lines:
            assert np.all(np.isfinite(np.asarray(line.get_xdata(), dtype=float)))
    assert any(len(axes.lines) > 0 for axes in figure.axes)


def curve(name: str, number: int) -> tuple[FloatArray, FloatArray]:
    """Points of one of a figure's lines."""
    figure = Figure()
    FIGURES[name].draw(figure)
    line = figure.axes[0].lines[number]
    return np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)


def distorted(phase: float) -> float:
    """Of J80 Fig. 4: (5) in axial flow, L dy/dx = U^2 - U_s^2 - U y over Ubar, integrated."""
    wavenumber, stall = 2.0 * math.pi / 16.0, 0.015

    def slope(at: float, rate: FloatArray) -> FloatArray:
        wind = 1.0 + 0.8 * math.sin(at)
        return np.asarray((wind * wind - stall * stall - wind * rate) / wavenumber)

    end = 20.0 * math.pi + phase
    found = integrate.solve_ivp(slope, (0.0, end), [1.0], rtol=1e-10, atol=1e-12)
    return (float(found.y[0, -1]) - 1.0) / 0.8


STRONG = 2.0 + math.sqrt(3.0), 2.0 - math.sqrt(3.0)
SHOWN: dict[str, tuple[str, int, float, float, float]] = {
    # What the papers say of their figures.
    "K94 after (11), Fig. 2": ("k94-2", 0, 1.0, 0.63, 0.005),
    "K94 (70), Fig. 8: no loss at 0.383": ("k94-8", 0, 0.383, 0.0, 0.01),
    "K94 after (73): -5 % at 0.3": ("k94-8", 0, 0.3, -0.05 / 0.513 * 20.0 ** (2.0 / 3.0), 0.08),
    "K94 after (73): 17 % at 1": ("k94-8", 0, 1.0, 0.17 / 0.513 * 20.0 ** (2.0 / 3.0), 0.08),
    "K94 (82), Fig. 13: one": ("k94-13", 0, 1.01, 1.0, 0.05),
    "K14 after (54), Fig. 3: two": ("k14-3", 1, 8.0, 2.0, 0.01),
    "J80 sec. 3.1, Fig. 1: nothing turns below the stall": ("j80-1", 0, 0.03, 0.0, 1e-12),
    # What their formulas give, worked out apart from the package.
    "K94 (45), Fig. 5: overshoot of a Butterworth filter": (
        "k94-5", 2, math.sqrt(2.0) * math.pi, 1.0 + math.exp(-math.pi), 1e-4,
    ),
    "K94 (45), Fig. 6": (
        "k94-6", 0, 4.0, 1.0 - (
            STRONG[0] * math.exp(-4.0 * STRONG[1]) - STRONG[1] * math.exp(-4.0 * STRONG[0])
        ) / (STRONG[0] - STRONG[1]), 1e-3,
    ),
    "K94 (46), Fig. 6": ("k94-6", 1, 4.0, 1.0 - math.exp(-1.0), 1e-3),
    "K94 (55), Fig. 7: g with critical damping": (
        "k94-7", 0, 1.0, 0.5 * math.gamma(2.0 / 3.0) * math.gamma(4.0 / 3.0), 1e-4,
    ),
    "K94 (56), Fig. 7: h with critical damping": (
        "k94-7", 1, 1.0, 0.5 * math.gamma(5.0 / 3.0) * math.gamma(1.0 / 3.0), 1e-4,
    ),
    "K94 (51), Fig. 9 at resonance": ("k94-9", 1, 1.0, 1.0 + math.sqrt(0.5), 0.01),
    "K94 (51), Fig. 10 at resonance": ("k94-10", 1, 1.0, 1.5 + math.sqrt(1.25), 0.01),
    "K94 (51), Fig. 12 at resonance": ("k94-12", 1, 1.0, 1.0, 0.01),
    "K94 (127), Fig. 16, neutral": (
        "k94-16", 0, 0.0, 0.11 / math.log(100.0) ** 2, 1e-6,
    ),
    "K94 (127), Fig. 16, stable": (
        "k94-16", 2, 1.0, 0.11 * 5.0 ** (2.0 / 3.0) / (math.log(1000.0) + 5.0) ** 2, 1e-6,
    ),
    "K14 (46), Fig. 2 at its peak": (
        "k14-2", 0, math.sqrt(1.5), math.sqrt(1.5) * 2.5 ** (-5.0 / 6.0) / 4.2065463, 1e-4,
    ),
    "K14 (105), Fig. 5 in the inertial range": (
        "k14-5", 1, 1e-3, 27.0 / 110.0 * math.gamma(1.0 / 3.0) * math.gamma(5.0 / 3.0)
        / (9.0 / 55.0 * 4.2065463) * 1e-2, 3e-4,
    ),
    "M66 Fig. 1 at resonance": ("m66-1", 0, 1.0, 1.0 / 0.3, 0.02),
    "J80 (6), Fig. 1": ("j80-1", 0, 1.0, 0.96, 1e-9),
    "J80 Fig. 2 at 60 degrees": ("j80-2", 0, 60.0, math.cos(math.radians(58.8)) ** 0.5, 1e-5),
    "J80 (9b), Fig. 3": ("j80-3", 0, 0.3, 2.0, 1e-3),
    "J80 (5), Fig. 4 where the wind has calmed down": (
        "j80-4", 3, 1.5 * math.pi, distorted(1.5 * math.pi), 1e-3,
    ),
    "J80 (5), Fig. 4 at its peak": ("j80-4", 3, 2.0, distorted(2.0), 1e-3),
}
"""Figure, line, where, what is there, and how nearly."""


@pytest.mark.parametrize("what", list(SHOWN))
def test_a_figure_shows_what_its_paper_says_or_its_formula_gives(what: str) -> None:
    name, number, at, value, tolerance = SHOWN[what]
    x, y = curve(name, number)
    assert x[0] <= at <= x[-1] * (1.0 + 1e-12)
    assert float(np.interp(at, x, y)) == pytest.approx(value, abs=tolerance)


def test_figure_14_walks_to_the_end_of_the_vector_run() -> None:
    steps, run = (np.stack(curve("k94-14", number)) for number in (0, 1))
    assert np.hypot(*np.diff(steps, axis=1)) == pytest.approx(0.4 * math.pi)
    assert run[:, -1] == pytest.approx(steps[:, -1])


def test_figure_13_shows_both_limits() -> None:
    """Equal areas by quadrature; printed limits take another part of the spectrum."""
    slope, zeta = 2.5, math.cos(math.pi / 3.5)
    right, printed = math.sqrt(2.0 - 4.0 * zeta**2), 2.0 * math.sin(math.pi / 7.0)
    for number, edge in ((0, right), (1, printed)):
        area = integrate.quad(
            lambda s: (1.0 - 1.0 / ((1.0 - s * s) ** 2 + 4.0 * zeta**2 * s * s)) * s**-slope,
            edge, math.inf,
        )[0]
        x, y = curve("k94-13", number)
        expected = (slope - 1.0) * edge ** (slope - 1.0) * area
        assert float(np.interp(slope, x, y)) == pytest.approx(expected, abs=1e-3)


def test_unknown_names_and_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no figure"):
        render("k94-99", tmp_path / "a.png")
    with pytest.raises(UserError, match="written as"):
        render("k94-2", tmp_path / "a.txt")


def test_the_command_writes_what_it_says_and_protects_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "figures"
    arguments = ["figures", "k94-2", "j80-1", "-o", str(target), "--format", "svg"]
    assert main(arguments) == 0
    assert (target / "k94-2.svg").read_text().lstrip().startswith("<?xml")
    assert main(arguments) == 2
    assert "already there" in capsys.readouterr().err
    assert main([*arguments, "--force"]) == 0
    assert main(["figures", "k94-1", "-o", str(target)]) == 2


def test_mitsuta_s_experiment() -> None:
    """The peak at the free period goes; printed (6) keeps it; wide ones reach 0.8 Nyquist."""
    result = compare_reductions(realisations=8)
    inside = (result.frequency > 0.0) & (result.frequency <= 0.8)
    true = result.true[inside]
    assert np.max(result.plain[inside] / true) > 5.0
    assert np.max(result.printed[inside] / true) > 5.0
    assert np.max(np.abs(result.wide[inside] / true - 1.0)) < 0.1
    plain, reduced, wide, printed = result.errors
    assert printed > 0.8 * plain
    assert reduced < 0.3 * plain
    assert wide < 0.05
    # (6) itself, where it is sampled finely enough: 0.8 of the Nyquist frequency of half a second.
    fine = compare_reductions(interval=0.1, realisations=4, band=0.18)
    shown = (fine.frequency > 0.0) & (fine.frequency <= 0.8)
    assert np.max(np.abs(fine.reduced[shown] / fine.true[shown] - 1.0)) < 0.1
