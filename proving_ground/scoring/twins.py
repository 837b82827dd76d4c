"""What a correction removes, against a twin: the same weather and noise with nothing concealed.

The twin is the oracle: it shows what would be left if the cause were removed altogether. A share of
one means that the corrected station leaves no more misfit than the twin has with its own station.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.progress import track

from proving_ground.generate import RecordingSpec, generate_recording
from proving_ground.inflow import Array
from proving_ground.scoring.outcome import Judged
from proving_ground.scoring.rates import LARGE
from proving_ground.sealing.opening import judge_all, open_sealed
from proving_ground.sealing.seal import RECORDINGS, draw
from proving_ground.sealing.trial import RUNS
from wind_sensors.errors import UserError

FILE = "twins.json"
CORRECTED = "station_corrected.yaml"


@dataclass(frozen=True)
class Removal:
    """One recording: mean squared misfit [m^2/s^2] before and after, and of its twin."""

    name: str
    effects: tuple[str, ...]
    before: float
    after: float
    twin: float

    @property
    def share(self) -> float:
        """Share of the excess over the twin that the correction removes [1]."""
        return (self.before - self.after) / (self.before - self.twin)


def removals(folder: Path, key: bytes) -> list[Removal]:
    """The removal of every exact finding at three times the minimum size or more."""
    sealed = open_sealed(folder, key)
    plan, names = draw(key, sealed["drawing"])
    specs = {name: case.spec for name, case in zip(names, plan.cases, strict=True)}
    judged = [
        j
        for j in judge_all(folder, sealed["answers"])
        if j.outcome == "exact"
        and j.size >= LARGE
        and (folder / RUNS / j.name / CORRECTED).exists()
    ]
    found = [_removal(folder, j, specs[j.name]) for j in track(judged, "twins")]
    return [r for r in found if r is not None and r.before > 1.02 * r.twin]


def _removal(folder: Path, judged: Judged, spec: RecordingSpec) -> Removal | None:
    recording = folder / RECORDINGS / judged.name
    with tempfile.TemporaryDirectory(prefix="wind-twin-") as place:
        twin = Path(place) / "twin"
        generate_recording(replace(spec, planted=()).into(twin))
        before = _residual(recording, Path(place) / "before.npz")
        after = _residual(
            recording, Path(place) / "after.npz", folder / RUNS / judged.name / CORRECTED
        )
        without = _residual(twin, Path(place) / "without.npz")
    if before is None or after is None or without is None:
        return None
    squares = [float(np.mean(np.square(r))) for r in (before, after, without)]
    return Removal(judged.name, judged.truth, *squares)


def _residual(recording: Path, target: Path, station: Path | None = None) -> Array | None:
    command = [sys.executable, "-m", "wind_sensors.report.regressors", str(recording)]
    command += ["--residual", "-o", str(target)]
    if station is not None:
        command += ["--station", str(station)]
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": path}, check=False, capture_output=True
    )
    if done.returncode or not target.exists():
        return None
    with np.load(target) as file:
        return np.asarray(np.nan_to_num(file["residual"]))


def write_removals(folder: Path, found: Sequence[Removal]) -> Path:
    """Write the removals as numbers; the path."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / FILE
    path.write_text(json.dumps([asdict(r) for r in found], indent=1) + "\n", encoding="utf-8")
    return path


def read_removals(path: Path) -> list[Removal]:
    """The removals of a file of numbers. Raises UserError if it is something else."""
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        return [Removal(**{**e, "effects": tuple(e["effects"])}) for e in entries]
    except (ValueError, TypeError, KeyError):
        raise UserError(
            "these are no removals", str(path), "`wind prove twins` writes them."
        ) from None


def twin_lines(found: Sequence[Removal]) -> list[str]:
    """The removals for people: how many are enough, and a table."""
    if not found:
        return ["No exact finding that changes the second's values."]
    shares = [r.share for r in found]
    lines = [
        f"Median share {np.median(shares):.2f}; at least 0.95 in {sum(s >= 0.95 for s in shares)}, "
        f"at least 0.8 in {sum(s >= 0.8 for s in shares)} of {len(shares)} exact findings.",
        "",
        "| recording | effect | before | after | twin | share |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r.name} | {' + '.join(r.effects)} | {r.before:.4f} | {r.after:.4f} | {r.twin:.4f} | "
        f"{r.share:.2f} |"
        for r in sorted(found, key=lambda r: r.share)
    ]
    return lines
