"""What `wind process` tells of its windows, on the screen and in `windows.csv`."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from estimation_cases import mast
from test_cli import steady_recording
from test_output_topics import window

from wind_sensors.cli.main import main
from wind_sensors.estimation.bias_terms import WindowTurbulence, array_terms
from wind_sensors.estimation.constants import told_by
from wind_sensors.estimation.core import SmallScales
from wind_sensors.recordings import write_recording
from wind_sensors.report.window_table import bias_quantities, wind_quantities

NAIVE = ("--method", "naive", "--window", "60")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose folder and vane have names like the markup of a screen."""
    recording = steady_recording()
    cup, vane = recording.station.instruments
    station = recording.station.model_copy(
        update={"instruments": (cup, vane.model_copy(update={"name": "vane [north]"}))}
    )
    angles = {"vane [north]": recording.angles["vane"]}
    folder = tmp_path_factory.mktemp("recorded") / "cal[red]m"
    return write_recording(folder, replace(recording, station=station, angles=angles))


def test_brackets_are_told_as_they_are(
    tmp_path: Path, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["process", str(recorded), "-o", str(tmp_path / "wind"), *NAIVE]) == 0
    told = capsys.readouterr().out
    assert told.startswith("cal[red]m, naive: wind of cup, vane [north]; raw speed of cup")
    assert "[s]" in told and "[m/s]" in told and "[deg]" in told
    assert "±: standard uncertainty" in told
    assert "propeller" not in told, "a cup has no translation of its propeller"
    assert main(["info", str(recorded)]) == 0
    told = capsys.readouterr().out
    assert told.startswith("cal[red]m ") and "vane [north] " in told


def test_a_long_list_of_windows_is_cut_on_the_screen_and_whole_in_the_file(
    tmp_path: Path, recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "wind"
    command = ["process", str(recorded), "-o", str(out), "--method", "naive", "--window", "2"]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "the first 40 of 60 windows; windows.csv has all of them" in told
    assert len((out / "windows.csv").read_text(encoding="utf-8").splitlines()) == 61


def test_windows_are_a_table_for_spreadsheets(tmp_path: Path, recorded: Path) -> None:
    assert main(["process", str(recorded), "-o", str(tmp_path / "wind"), *NAIVE]) == 0
    with (tmp_path / "wind" / "windows.csv").open(encoding="utf-8", newline="") as file:
        first, second = csv.DictReader(file)
    assert first["start [UTC]"] == "2026-01-01T00:00:00.000Z"
    assert first["stop [UTC]"] == second["start [UTC]"] == "2026-01-01T00:01:00.000Z"
    assert float(first["mean speed [m/s]"]) == pytest.approx(8.0, rel=0.01)
    assert float(first["from [deg]"]) == pytest.approx(270.0, abs=2.0)
    assert float(first["standard uncertainty of mean speed [m/s]"]) > 0.0
    above = "mean speed above vector mean (v) [% of vector mean]"
    assert float(first[above]) == pytest.approx(
        100.0 * (float(first["mean speed [m/s]"]) / float(first["vector mean [m/s]"]) - 1.0),
        abs=0.01,
    )
    assert "bias: arithmetic mean [% of mean speed]" in first
    assert "raw mean speed [m/s]" in first
    assert first["raw speed of"] == "cup"


def test_the_title_tells_whose_wind_it_is() -> None:
    station = mast()
    cup = station.instrument("cup")
    other = cup.model_copy(update={"name": "other"})
    both = station.model_copy(update={"instruments": (*station.instruments, other)})
    assert told_by(both, "kalman") == ("cup", "other", "vane")
    assert told_by(both, "naive") == told_by(both, "inverse") == ("cup", "vane")


def test_on_board_the_raw_speed_is_told_as_what_is_felt() -> None:
    there, on_board = (
        [q.name for q in wind_quantities(window(0, 5.0), with_vertical=False, on_board=moving)]
        for moving in (False, True)
    )
    assert "raw mean speed" in there
    assert "raw mean speed felt on board" in on_board and "raw mean speed" not in on_board


def test_each_term_says_what_it_is_a_share_of() -> None:
    turbulence = WindowTurbulence(5.0, 4.0, 0.1, False, SmallScales(0.01, 0.01), 0.0)
    terms = array_terms(turbulence, 4.4)
    assert terms["u"].value == pytest.approx(0.1) and terms["u"].relative_to == "vector mean"
    told = bias_quantities(replace(window(0, 5.0), bias_terms=terms), ["u", "w", "v"])
    assert [q.unit for q in told] == ["% of vector mean", "% of mean speed", "% of vector mean"]
    assert told[2].value == pytest.approx(25.0)
