"""Fetch the real records, diagnose them, plant doses into them, and write the page."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from proving_ground.generate import Planted
from proving_ground.real.doses import DOSES, STRETCH, read_rows, write_stretch
from proving_ground.real.sources import SOURCES, Source, fetch
from proving_ground.real.turbulence import on_grid, read_sonic, record_in
from proving_ground.scoring.outcome import findings_of, outcome_of
from proving_ground.scoring.wording import verdict_line
from proving_ground.sealing.trial import program_version
from proving_ground.stations import random_station
from wind_sensors.errors import UserError

NUMBERS = "real.json"
STATION_SEED = 20_001
ADDED_WIND = 4.0
LONGEST = 900.0
TURBULENCE_DOSES = (
    (),
    (Planted("rotor_inertia", 4.0),),
    (Planted("bearing_friction", 4.0),),
    (Planted("vane_offset", 4.0),),
    (Planted("vane_friction", 4.0),),
    (Planted("missed_pulses", 4.0),),
)


@dataclass(frozen=True)
class Row:
    """One line of the page; outcome: what was said against what was planted, empty where nobody
    knows."""

    record: str
    planted: str
    verdict: str
    seconds: float
    outcome: str = ""


def run_real(output: Path, local: Path | None = None) -> Path:
    """Do everything; the page's path. What cannot be fetched is told on the page."""
    output.mkdir(parents=True)
    say = Console().print
    rows: list[Row] = []
    notes: list[str] = []
    for source in SOURCES:
        say(f"[bold]{source.package} {source.version}[/bold]")
        try:
            files = fetch(source, output / "files" / source.mapping, local)
        except UserError as problem:
            notes.append(str(problem))
            say(f"   {problem}", markup=False)
            continue
        for found in _rows_of(source, files, output):
            rows.append(found)
            say(f"   {found.record}, {found.planted}: {found.verdict}", markup=False)
    page = output / "real.md"
    about = program_version()
    entries = [vars(r) for r in rows]
    page.write_text(_page(entries, about, notes), encoding="utf-8")
    numbers = json.dumps({"about": about, "rows": entries}, indent=1)
    (output / NUMBERS).write_text(numbers + "\n", encoding="utf-8")
    return page


def _rows_of(source: Source, files: list[Path], output: Path) -> list[Row]:
    if source.mapping == "toa5_sonic":
        return _turbulence_rows(files, output)
    recording = output / "recordings" / source.mapping
    problem = _import(files, source.mapping, recording)
    if problem:
        return [Row(source.mapping, "as it is", problem, 0.0)]
    rows = [_diagnosed(source.mapping, "as it is", recording, [], output)]
    if source.mapping == "mast_10min":
        rows += _mast_doses(files[0], output)
    return rows


def _mast_doses(table: Path, output: Path) -> list[Row]:
    columns, rows = read_rows(table)
    first = [next(rows) for _ in range(STRETCH)]
    second = [next(rows) for _ in range(STRETCH)]
    folder = output / "doses"
    write_stretch(columns, first, folder / "before.csv", lambda row: None)
    before = output / "recordings" / "mast_before"
    problem = _import([folder / "before.csv"], "mast_10min", before)
    if problem:
        return [Row("mast, eight weeks", "", problem, 0.0)]
    found = []
    for dose in DOSES:
        name = f"mast_{dose.effect}"
        write_stretch(columns, second, folder / f"{name}.csv", dose.change)
        recording = output / "recordings" / name
        problem = _import([folder / f"{name}.csv"], "mast_10min", recording)
        planted = f"{dose.effect} {dose.instrument}, {dose.amount}"
        if problem:
            found.append(Row("mast, eight weeks", planted, problem, 0.0))
        else:
            truth = () if dose.effect == "none" else (dose.effect,)
            found.append(
                _diagnosed("mast, eight weeks", planted, recording, [before], output, truth)
            )
    return found


def _turbulence_rows(files: list[Path], output: Path) -> list[Row]:
    station = random_station("A", STATION_SEED)
    winds = [on_grid(read_sonic(path), ADDED_WIND) for path in files]
    place = output / "recordings"
    healthy = []
    for i, wind in enumerate(winds):
        for seed in (1, 2):
            folder = place / f"sonic_healthy_{i}_{seed}"
            record_in(station, wind, 10 * i + seed, (), folder)
            healthy.append(folder)
    found = []
    for number, planted in enumerate(TURBULENCE_DOSES):
        folder = place / f"sonic_dose_{number}"
        record_in(station, winds[-1], 100 + number, planted, folder)
        name = ", ".join(f"{p.effect} {p.size_factor:g} x" for p in planted) or "nothing"
        truth = tuple(p.effect for p in planted)
        record = "instruments in real turbulence"
        found.append(_diagnosed(record, name, folder, healthy, output, truth))
    return found


def _wind(arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "wind_sensors.cli", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, -1, "", f"still at work after {LONGEST:.0f} s")


def _import(files: list[Path], mapping: str, target: Path) -> str:
    done = _wind(["import", *map(str, files), "--mapping", mapping, "-o", str(target)])
    return "" if done.returncode == 0 else f"import failed: {_last_line(done.stderr)}"


def _diagnosed(
    record: str,
    planted: str,
    recording: Path,
    healthy: list[Path],
    output: Path,
    truth: tuple[str, ...] | None = None,
) -> Row:
    target = output / "diagnoses" / recording.name
    arguments = ["diagnose", str(recording), "-o", str(target)]
    if healthy:
        arguments += ["--healthy", *map(str, healthy)]
    begun = time.monotonic()
    done = _wind(arguments)
    seconds = time.monotonic() - begun
    file = target / "diagnosis.json"
    if done.returncode or not file.exists():
        return Row(record, planted, f"no verdict: {_last_line(done.stderr)}", seconds)
    diagnosis = json.loads(file.read_text("utf-8"))
    line = verdict_line(diagnosis)
    if truth is None:
        return Row(record, planted, line, seconds)
    outcome = outcome_of(truth, str(diagnosis["verdict"]), *findings_of(diagnosis))
    return Row(record, planted, line, seconds, outcome)


def _last_line(text: str) -> str:
    lines = [line for line in text.strip().splitlines() if line.strip()]
    return lines[-1] if lines else "it said nothing"


def _page(rows: Sequence[dict[str, Any]], about: dict[str, Any], notes: Sequence[str]) -> str:
    lines = ["# Real records", ""]
    lines += [f"- {s.mapping}: PyPI package {s.package} {s.version} ({s.licence})" for s in SOURCES]
    lines += [
        "",
        "Nobody knows what is wrong with the records as they are; the doses are known, because "
        "they were planted. Instruments in real turbulence are the proving ground's, driven by "
        f"the sonic's wind with {ADDED_WIND:g} m/s of steady wind added.",
        "",
        *row_table(rows, about),
    ]
    lines += ["", *[f"- {note}" for note in notes]] if notes else []
    return "\n".join(lines) + "\n"


def row_table(rows: Sequence[dict[str, Any]], about: dict[str, Any]) -> list[str]:
    """What was planted into real records and what was said, as a table below what diagnosed."""
    lines = [f"- {key}: {value}" for key, value in about.items()]
    lines += ["", "| record | planted | outcome | verdict | seconds |", "|---|---|---|---|---|"]
    return lines + [
        f"| {r['record']} | {r['planted']} | {r['outcome']} | {r['verdict']} | {r['seconds']:.0f} |"
        for r in rows
    ]
