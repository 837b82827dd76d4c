"""What was removed of the misfit, against what the true model removes on the same blocks.

The oracle is the same diagnosis with a catalogue that holds the concealed effects and no others.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from proving_ground.minimum_sizes import MINIMUM_SIZES
from proving_ground.scoring.outcome import UNKNOWN, Judged, excess_removed
from proving_ground.scoring.rates import LARGE, clopper_pearson
from proving_ground.sealing.trial import DIAGNOSIS, read_manifest, run_one
from wind_sensors.errors import UserError

FILE = "oracle.json"
RUNS = "oracle"
ENOUGH = 0.95


@dataclass(frozen=True)
class Share:
    """One recording: shares of the excess misfit removed on held-out blocks [1], by what was
    named (0 where nothing was) and by the true model."""

    name: str
    effects: tuple[str, ...]
    outcome: str
    removed: float
    oracle: float

    @property
    def share(self) -> float:
        """What was removed of what could be [1]."""
        return self.removed / self.oracle


def shares(
    folder: Path, judged: Sequence[Judged], jobs: int = 1, timeout: float = 300.0
) -> list[Share]:
    """The share of every recording with effects of the catalogue at three minima or more.

    Recordings in which the true model itself cannot be fitted have none.
    """
    asked = [j for j in judged if j.truth and UNKNOWN not in j.truth and j.size >= LARGE]
    entries = read_manifest(folder)["recordings"]

    def fit_truth(one: Judged) -> float | None:
        target = folder / RUNS / one.name
        if not (target / DIAGNOSIS).is_file():
            others = [w for n in MINIMUM_SIZES if n not in one.truth for w in ("--without", n)]
            station = str(entries[one.name]["healthy"])
            run_one(folder, one.name, station, timeout, options=others, kind=RUNS)
        return _removed(target / DIAGNOSIS)

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        best = list(track(pool.map(fit_truth, asked), "oracle", total=len(asked)))
    return [
        Share(one.name, one.truth, one.outcome, one.removed or 0.0, removed)
        for one, removed in zip(asked, best, strict=True)
        if removed is not None and removed > 0.0
    ]


def _removed(path: Path) -> float | None:
    if not path.is_file():
        return None
    diagnosis: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return excess_removed(diagnosis)


def write_shares(folder: Path, found: Sequence[Share]) -> Path:
    """Write the shares as numbers; the path."""
    path = folder / FILE
    path.write_text(json.dumps([asdict(s) for s in found], indent=1) + "\n", encoding="utf-8")
    return path


def read_shares(path: Path) -> list[Share]:
    """The shares of a file of numbers. Raises UserError if it is something else."""
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        return [Share(**{**e, "effects": tuple(e["effects"])}) for e in entries]
    except (ValueError, TypeError, KeyError):
        raise UserError(
            "these are no shares", str(path), "`wind prove open` writes them."
        ) from None


def oracle_lines(found: Sequence[Share]) -> list[str]:
    """The shares for people: how many are enough, and a table."""
    if not found:
        return ["No recording in which the true model could be fitted."]
    lines = []
    exact = [s for s in found if s.outcome == "exact"]
    for title, some in (("exact findings", exact), ("all recordings asked", list(found))):
        enough = sum(s.share >= ENOUGH for s in some)
        low, high = clopper_pearson(enough, len(some))
        middle = f"median share {np.median([s.share for s in some]):.2f}, " if some else ""
        lines.append(
            f"- {title}: {middle}at least {ENOUGH:g} of what the true model removes in {enough} of "
            f"{len(some)} ({100 * low:.0f} to {100 * high:.0f} %)"
        )
    low, high = clopper_pearson(len(exact), len(found))
    lines.append(
        f"- of the recordings in which the true model is named where it has no rival: exact in "
        f"{len(exact)} of {len(found)} ({100 * low:.0f} to {100 * high:.0f} %)"
    )
    lines += ["", "| recording | concealed | said | removed | by the true model | share |"]
    lines += ["|---|---|---|---|---|---|"]
    lines += [
        f"| {s.name} | {' + '.join(s.effects)} | {s.outcome} | {s.removed:.2f} | {s.oracle:.2f} | "
        f"{s.share:.2f} |"
        for s in sorted(found, key=lambda s: s.share)
    ]
    return lines
