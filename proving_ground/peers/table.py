"""Run the peers over a sealed set and put them beside the diagnosis, at equal false alarms."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from proving_ground.inflow import Array
from proving_ground.peers.methods import METHODS, require_peers
from proving_ground.scoring.outcome import NAMES_SOMETHING, Judged
from proving_ground.scoring.rates import LARGE, clopper_pearson
from proving_ground.sealing.seal import HEALTHY, RECORDINGS
from proving_ground.sealing.trial import read_manifest

REGRESSORS = "regressors"
FALSE_ALARMS = 0.05
LONGEST_MEMORY = 20

Importance = dict[str, float]


@dataclass(frozen=True)
class PeerScore:
    """One method's row: counts of hits and cases by column, and median seconds."""

    method: str
    false_alarms: tuple[int, int]
    exact: tuple[int, int]
    included: tuple[int, int]
    wrong: tuple[int, int]
    unknown_named: tuple[int, int]
    seconds: float


def collect_regressors(folder: Path, jobs: int = 1) -> None:
    """Write the regressors of every recording of a set, healthy ones included, once."""
    sources = [*(folder / RECORDINGS).iterdir(), *(folder / HEALTHY).glob("*/*")]
    todo = [(s, regressor_file(folder, s)) for s in sources]
    todo = [(s, t) for s, t in todo if not t.exists()]
    (folder / REGRESSORS).mkdir(exist_ok=True)
    with ProcessPoolExecutor(max(1, jobs)) as pool:
        list(track(pool.map(_collect, todo), "simulating signatures", total=len(todo)))


def regressor_file(folder: Path, recording: Path) -> Path:
    """Where a recording's regressors are kept."""
    name = "-".join(recording.relative_to(folder).parts[1:])
    return folder / REGRESSORS / f"{name}.npz"


def _collect(item: tuple[Path, Path]) -> None:
    source, target = item
    root = str(Path(__file__).resolve().parents[2])
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(
        filter(None, [root, environment.get("PYTHONPATH", "")])
    )
    command = [sys.executable, "-m", "wind_sensors.report.regressors", str(source)]
    subprocess.run([*command, "-o", str(target)], env=environment, check=False, capture_output=True)


def whiten(residual: Array, signatures: Array, channel: Array) -> tuple[Array, Array]:
    """Residual and signatures, channel by channel, through the autoregressive filter (order by
    BIC) that whitens the residual."""
    residuals, columns = [], []
    for number in np.unique(channel):
        inside = channel == number
        weights = autoregression(residual[inside])
        residuals.append(np.convolve(residual[inside], weights, mode="valid"))
        columns.append(
            np.stack([np.convolve(g, weights, mode="valid") for g in signatures[inside].T], axis=1)
        )
    scale = [1.0 / max(float(r.std()), 1e-12) for r in residuals]
    return (
        np.concatenate([r * s for r, s in zip(residuals, scale, strict=True)]),
        np.concatenate([c * s for c, s in zip(columns, scale, strict=True)]),
    )


def autoregression(signal: Array) -> Array:
    """Whitening filter (1, -a1, ..., -ap) of a signal, its order p by BIC (Yule-Walker)."""
    signal = signal - signal.mean()
    count = signal.size
    lags = np.array([signal[: count - k] @ signal[k:] for k in range(LONGEST_MEMORY + 1)]) / count
    best, chosen = np.inf, np.ones(1)
    for order in range(1, LONGEST_MEMORY + 1):
        matrix = lags[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        weights = np.linalg.solve(matrix + 1e-9 * lags[0] * np.eye(order), lags[1 : order + 1])
        noise = max(float(lags[0] - weights @ lags[1 : order + 1]), 1e-12)
        score = count * np.log(noise) + order * np.log(count)
        if score < best:
            best, chosen = score, np.concatenate([[1.0], -weights])
    return chosen


def importances(path: Path, methods: Sequence[str], whitened: bool) -> dict[str, Importance]:
    """Share of the residual's deviation that each effect explains, for each method."""
    with np.load(path) as file:
        residual, signatures = file["residual"], file["signatures"]
        effects, channel = file["effects"], file["channel"]
    residual = np.nan_to_num(residual)
    signatures = np.nan_to_num(signatures)
    if whitened:
        residual, signatures = whiten(residual, signatures, channel)
    scale = signatures.std(axis=0)
    seen = scale > 1e-9
    columns = signatures[:, seen] / scale[seen]
    size = float(np.sqrt(np.mean(residual**2)))
    found = {}
    for method in methods:
        coefficients = METHODS[method](columns, residual / size)
        parts = {
            str(name): float(
                np.sqrt(
                    np.mean(
                        (columns[:, effects[seen] == name] @ coefficients[effects[seen] == name])
                        ** 2
                    )
                )
            )
            for name in np.unique(effects[seen])
        }
        found[method] = {name: part for name, part in parts.items() if part > 0.0}
    return found


def _timed(item: tuple[Path, bool]) -> tuple[dict[str, Importance], float]:
    path, whitened = item
    begun = time.process_time()
    found = importances(path, list(METHODS), whitened)
    return found, (time.process_time() - begun) / len(METHODS)


def excess(found: Importance, healthy: Sequence[Importance]) -> Importance:
    """Importance of each effect over the largest it has in healthy recordings of the station."""
    floor = 0.02
    return {
        name: value / max([floor, *(h.get(name, 0.0) for h in healthy)])
        for name, value in found.items()
    }


def threshold(healthy: Sequence[Sequence[Importance]]) -> float:
    """Excess above which an effect is named, so that at most the wanted share of healthy
    recordings, each judged against the others of its station, is given a name."""
    largest = []
    for group in healthy:
        for i, one in enumerate(group):
            rest = [h for j, h in enumerate(group) if j != i]
            largest.append(max(excess(one, rest).values(), default=0.0))
    return max(1.0, float(np.quantile(largest, 1.0 - FALSE_ALARMS, method="higher")))


def compare(
    folder: Path, answers: dict[str, Any], judged: Sequence[Judged], jobs: int = 1
) -> list[PeerScore]:
    """Every method's row, plain and whitened, and the diagnosis's own."""
    require_peers()
    collect_regressors(folder, jobs)
    manifest = read_manifest(folder)["recordings"]
    rows = [own_row(judged)]
    for whitened in (False, True):
        paths = sorted((folder / REGRESSORS).glob("*.npz"))
        with ProcessPoolExecutor(max(1, jobs)) as pool:
            done = pool.map(_timed, [(p, whitened) for p in paths])
            results = dict(zip(paths, track(done, "peers", total=len(paths)), strict=True))
        for method in METHODS:
            by_name = {p.stem: results[p][0][method] for p in paths}
            seconds = float(np.median([results[p][1] for p in paths]))
            groups: dict[str, list[Importance]] = {}
            for stem, found in by_name.items():
                if stem.startswith("station-"):
                    groups.setdefault(stem.rsplit("-healthy", 1)[0], []).append(found)
            limit = threshold(list(groups.values()))
            named = {
                name: {
                    effect
                    for effect, value in excess(
                        by_name[name], groups[manifest[name]["healthy"]]
                    ).items()
                    if value > limit
                }
                for name in answers
                if name in by_name
            }
            label = f"{method}{', whitened' if whitened else ''}"
            rows.append(peer_row(label, named, answers, seconds))
    return rows


def peer_row(
    label: str, named: dict[str, set[str]], answers: dict[str, Any], seconds: float
) -> PeerScore:
    """Count a method's names against the answers."""
    truth = {n: {str(c["effect"]) for c in answers[n]["causes"]} for n in named}
    size = {
        n: min((float(c["size_factor"]) for c in answers[n]["causes"]), default=0.0) for n in named
    }
    stratum = {n: str(answers[n]["stratum"]) for n in named}
    well = [n for n in named if stratum[n] == "healthy"]
    large = [n for n in named if stratum[n] in ("single", "onset") and size[n] >= LARGE]
    strange = [n for n in named if stratum[n] == "unknown"]
    return PeerScore(
        method=label,
        false_alarms=(sum(bool(named[n]) for n in well), len(well)),
        exact=(sum(named[n] == truth[n] for n in large), len(large)),
        included=(sum(truth[n] <= named[n] for n in large), len(large)),
        wrong=(sum(bool(named[n] - truth[n]) for n in named), len(named)),
        unknown_named=(sum(bool(named[n]) for n in strange), len(strange)),
        seconds=seconds,
    )


def own_row(judged: Sequence[Judged]) -> PeerScore:
    """The diagnosis's own row."""
    well = [j for j in judged if j.stratum == "healthy"]
    large = [j for j in judged if j.stratum in ("single", "onset") and j.size >= LARGE]
    strange = [j for j in judged if j.stratum == "unknown"]
    wrong = [j for j in judged if j.outcome in ("wrong name", "wrong set")]
    times = [j.seconds for j in judged if j.verdict != "failed"]
    return PeerScore(
        method="wind diagnose",
        false_alarms=(sum(j.outcome in NAMES_SOMETHING for j in well), len(well)),
        exact=(sum(j.outcome == "exact" for j in large), len(large)),
        included=(sum(j.found for j in large), len(large)),
        wrong=(len(wrong), len(judged)),
        unknown_named=(sum(j.outcome in NAMES_SOMETHING for j in strange), len(strange)),
        seconds=float(np.median(times)) if times else float("nan"),
    )


def write_table(folder: Path, rows: Sequence[PeerScore]) -> Path:
    """Write the comparison as a page and as numbers; the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [
        "# Peers on the same recordings",
        "",
        "Same residuals, same signatures of the same catalogue, the same healthy recordings to "
        f"tune on; the peers' thresholds are set for {100 * FALSE_ALARMS:.0f} % false alarms on "
        "those. Intervals at 95 %.",
        "",
        "| method | healthy named | exact (single, 3 x and more) | truth included | a wrong name, "
        "all | unknown named | seconds |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            _cell(c)
            for c in (row.false_alarms, row.exact, row.included, row.wrong, row.unknown_named)
        ]
        lines.append(f"| {row.method} | " + " | ".join(cells) + f" | {row.seconds:.1f} |")
    page = folder / "peers.md"
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")
    numbers = json.dumps([asdict(r) for r in rows], indent=1)
    (folder / "peers.json").write_text(numbers, encoding="utf-8")
    return page


def _cell(count: tuple[int, int]) -> str:
    hits, total = count
    if not total:
        return ""
    low, high = clopper_pearson(hits, total)
    return f"{100 * hits / total:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
