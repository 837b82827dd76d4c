"""Real records come in whole, and doses change what they say and nothing else."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from proving_ground.drive import GRID_RATE
from proving_ground.measure import wrap
from proving_ground.real.doses import DOSES, read_rows, write_stretch
from proving_ground.real.page import Row, row_table
from proving_ground.real.sources import SOURCES, fetch
from proving_ground.real.turbulence import on_grid, read_sonic
from proving_ground.scene import build_scene
from proving_ground.scoring.wording import answer_line, verdict_line
from proving_ground.stations import random_station
from proving_ground.weather import Weather
from wind_sensors.errors import UserError

SHARED = Path(__file__).resolve().parents[2] / "shared" / "real"


@pytest.fixture
def sonic_file(tmp_path: Path) -> Path:
    lines = ['"TOA5","x"', '"TIMESTAMP","RECORD","Ux","Uy","Uz"', '"TS","RN","m/s"', '"",""']
    for i in range(200):
        value = "NAN" if i == 50 else f"{2.0 + 0.01 * i}"
        lines.append(f'"2012-06-07 12:45:00",{i},{value},-1.0,0.1')
    path = tmp_path / "sonic.dat"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_sonic_file_is_read_and_its_gap_bridged(sonic_file: Path) -> None:
    wind = read_sonic(sonic_file)
    assert wind.shape == (200, 3)
    assert wind[50, 0] == pytest.approx(2.5)


def test_a_steady_wind_is_added_along_the_mean(sonic_file: Path) -> None:
    wind = read_sonic(sonic_file)
    grid = on_grid(wind, 4.0)
    assert len(grid) == int(199 / 20.0 * GRID_RATE) + 1
    before, after = wind[:, :2].mean(axis=0), grid[:, :2].mean(axis=0)
    assert np.hypot(*after) - np.hypot(*before) == pytest.approx(4.0, abs=0.02)
    turn = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    assert abs(wrap(np.array([turn]))[0]) < 0.01


def test_the_instruments_stand_in_the_measured_wind_and_the_reference_nearly() -> None:
    station = random_station("A", 1)
    count = int(20 * GRID_RATE) + 1
    wind = np.tile([3.0, 1.0, 0.2], (count, 1))
    weather = Weather(3.2, 0.1, 0.05, 0.05, 0.0, 0.3)
    scene = build_scene(station, weather, 20.0 / 60.0, 1, wind)
    assert np.allclose(np.hypot(*scene.rotor_flow[0, :2]), np.hypot(3.0, 1.0), atol=0.02)
    difference = scene.reference - wind
    assert 0.01 < difference[:, 0].std() < 0.5


def test_a_dose_changes_its_channel_and_nothing_else(tmp_path: Path) -> None:
    columns = ["Timestamp", "Spd80mN", "Spd80mNStd", "Spd80mNMax", "Spd60mN", "Dir58mS", "Other"]
    row = dict(zip(columns, ["2016", "8.0", "1.0", "10.0", "5.0", "355.0", "7"], strict=True))
    for dose in DOSES:
        write_stretch(columns, [row], tmp_path / f"{dose.effect}.csv", dose.change)
    _, rows = read_rows(tmp_path / "calibration_drift.csv")
    assert next(rows) == {**row, "Spd80mN": "7.76", "Spd80mNStd": "0.97", "Spd80mNMax": "9.7"}
    _, rows = read_rows(tmp_path / "vane_offset.csv")
    assert next(rows)["Dir58mS"] == "3"
    _, rows = read_rows(tmp_path / "bearing_friction.csv")
    assert float(next(rows)["Spd60mN"]) == pytest.approx(4.6)
    _, rows = read_rows(tmp_path / "none.csv")
    assert next(rows) == row


def test_copies_are_unpacked_and_missing_ones_told(tmp_path: Path) -> None:
    source = SOURCES[0]
    copies = tmp_path / "copies" / source.copies
    copies.mkdir(parents=True)
    with gzip.open(copies / "mast.csv.gz", "wt") as file:
        file.write("Timestamp\n")
    (found,) = fetch(source, tmp_path / "files", tmp_path / "copies")
    assert found.read_text() == "Timestamp\n"
    with pytest.raises(UserError, match="missing"):
        fetch(SOURCES[2], tmp_path / "none", tmp_path / "copies")


def test_a_verdict_is_told_in_one_line() -> None:
    finding = {
        "effect": "vane_offset",
        "instrument": "vane",
        "parameters": {"offset": {"value": 3.0, "low": 2.5, "high": 3.5, "unit": "deg"}},
    }
    line = verdict_line({"verdict": "named", "findings": [finding]})
    assert line == "named: vane_offset (vane) [offset 3 (2.5 to 3.5) deg]"
    stuck = {"start": {"value": 5.2e7, "low": 5.2e7, "high": 5.2e7, "unit": "s"}}
    gain = {"gain": {"value": 0.969, "low": 0.968, "high": 0.97, "unit": "1"}}
    findings = [
        {"effect": "stuck_sensor", "instrument": "cup", "parameters": stuck},
        {"effect": "calibration_drift", "instrument": "cup", "parameters": gain},
    ]
    line = verdict_line({"verdict": "named", "findings": findings})
    assert "start 601.85 (601.85 to 601.85) d" in line
    assert line.endswith("[gain 0.969 (0.968 to 0.97)]")
    assert verdict_line({"verdict": "none", "findings": []}) == "none"


def test_an_answer_is_told_in_one_line() -> None:
    cause = {"effect": "axis_tilt", "instrument": "station", "size_factor": 4.0, "tilt_deg": 24.0}
    line = answer_line(cause)
    assert line == "axis_tilt (station), 4 times the smallest size worth reporting: tilt deg 24.0"
    bird = {"effect": "unknown", "stranger": "bird", "instrument": "vane", "size_factor": 2.0}
    assert answer_line(bird).startswith("bird (vane), 2 times")


def test_what_was_planted_is_told_beside_what_was_said() -> None:
    rows = [
        Row("mast", "vane_offset vane, 8 degrees", "named: icing (cup)", 61.4, "wrong name"),
        Row("roof", "as it is", "none", 3.0),
    ]
    *about, _, head, _, wrong, free = row_table([vars(row) for row in rows], {"version": "x"})
    assert about == ["- version: x"]
    assert head.count("|") == wrong.count("|") == free.count("|")
    assert "| wrong name | named: icing (cup) | 61 |" in wrong
    assert "| as it is |  | none |" in free


@pytest.mark.skipif(not SHARED.exists(), reason="shared material absent")
def test_the_published_sonic_records_are_whole(tmp_path: Path) -> None:
    files = fetch(SOURCES[2], tmp_path / "files", SHARED)
    winds = [read_sonic(path) for path in files]
    assert [len(w) for w in winds] == [18000, 18000]
    assert all(np.isfinite(w).all() and np.abs(w).max() < 30.0 for w in winds)
