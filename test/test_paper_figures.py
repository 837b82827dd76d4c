"""Every figure is drawn, in every format, and shows what its formula gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.instruments import vane_variance
from wind_sensors.report.bivane_reduction import compare_reductions
from wind_sensors.report.paper_figures import FIGURES, render


@pytest.mark.parametrize("name", list(FIGURES))
def test_every_figure_is_drawn(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.png"
    render(name, path)
    assert path.read_bytes().startswith(b"\x89PNG")
    figure = Figure()
    FIGURES[name].draw(figure)
    for axes in figure.axes:
        assert axes.get_xlabel() or len(figure.axes) > 1
        for line in axes.lines:
            assert np.all(np.isfinite(np.asarray(line.get_xdata(), dtype=float)))
    assert any(len(axes.lines) > 0 for axes in figure.axes)


def test_figure_13_shows_both_limits() -> None:
    figure = Figure()
    FIGURES["k94-13"].draw(figure)
    right, printed = figure.axes[0].lines[:2]
    for line, function in (
        (right, vane_variance.recovered_fraction),
        (printed, vane_variance.recovered_fraction_as_printed),
    ):
        slope, value = (np.asarray(data, dtype=float) for data in line.get_data())
        middle = slope.size // 2
        assert value[middle] == pytest.approx(function(float(slope[middle])))
    assert vane_variance.recovered_fraction_as_printed(5.0 / 3.0) == pytest.approx(
        0.82724, abs=1e-5
    )
    assert vane_variance.recovered_fraction_as_printed(2.5) == pytest.approx(0.67965, abs=1e-5)


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
