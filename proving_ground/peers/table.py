"""Run the peers over a sealed set and put them beside the diagnosis, at equal false alarms."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.progress import track

from proving_ground.inflow import Array
from proving_ground.peers.methods import METHODS, Method, require_peers
from proving_ground.peers.rows import PeerScore
from proving_ground.scoring.outcome import NAMES_SOMETHING, UNKNOWN, Judged
from proving_ground.scoring.rates import LARGE
from proving_ground.sealing.seal import HEALTHY, RECORDINGS
from proving_ground.sealing.trial import read_manifest

REGRESSORS = "regressors"
FALSE_ALARMS = 0.05
FLOORS = (0.02, 0.1, 0.5)
"""Importances below which nothing is compared; every method gets the one that suits it best."""

LONGEST_MEMORY = 20

Importance = dict[str, float]
Item = TypeVar("Item")
Made = TypeVar("Made")


def collect_regressors(folder: Path, jobs: int = 1) -> None:
    """Write the regressors of every recording of a set, healthy ones included, once."""
    sources = [*(folder / RECORDINGS).iterdir(), *(folder / HEALTHY).glob("*/*")]
    todo = [(s, regressor_file(folder, s)) for s in sources]
    todo = [(s, t) for s, t in todo if not t.exists()]
    (folder / REGRESSORS).mkdir(exist_ok=True)
    list(track(_each(_collect, todo, jobs), "simulating signatures", total=len(todo)))


def _each(function: Callable[[Item], Made], items: Iterable[Item], jobs: int) -> Iterator[Made]:
    """Results in the order of the items, from so many processes."""
    if jobs == 1:
        yield from map(function, items)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(function, items)


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


def importances(
    path: Path, methods: Sequence[Method], whitened: bool, without: Sequence[str] = ()
) -> list[Importance]:
    """Share of the residual's deviation that each effect explains, for each method.

    The signatures of effects `without` are left out, as they are for the diagnosis.
    """
    with np.load(path) as file:
        residual, signatures = file["residual"], file["signatures"]
        effects, channel = file["effects"], file["channel"]
    residual = np.nan_to_num(residual)
    signatures = np.nan_to_num(signatures)
    if whitened:
        residual, signatures = whiten(residual, signatures, channel)
    scale = signatures.std(axis=0)
    seen = (scale > 1e-9) & ~np.isin(effects, list(without))
    columns, names = signatures[:, seen] / scale[seen], effects[seen]
    size = float(np.sqrt(np.mean(residual**2)))
    found = []
    for method in methods:
        coefficients = method(columns, residual / size)
        parts = {
            str(name): columns[:, names == name] @ coefficients[names == name]
            for name in np.unique(names)
        }
        sizes = {name: float(np.sqrt(np.mean(part**2))) for name, part in parts.items()}
        found.append({name: value for name, value in sizes.items() if value > 0.0})
    return found


def _timed(
    item: tuple[Path, bool, Sequence[str]],
) -> dict[str, tuple[list[Importance], float]]:
    path, whitened, without = item
    found = {}
    for name, settings in METHODS.items():
        begun = time.process_time()
        importance = importances(path, settings, whitened, without)
        found[name] = (importance, (time.process_time() - begun) / len(settings))
    return found


def excess(
    found: Importance, healthy: Sequence[Importance], floor: float = FLOORS[0]
) -> Importance:
    """Importance of each effect over the largest it has in healthy recordings of the station."""
    return {
        name: value / max([floor, *(h.get(name, 0.0) for h in healthy)])
        for name, value in found.items()
    }


def threshold(healthy: Sequence[Sequence[Importance]], floor: float = FLOORS[0]) -> float:
    """Excess above which an effect is named, so that at most the wanted share of healthy
    recordings, each judged against the others of its station, is given a name."""
    largest = []
    for group in healthy:
        for i, one in enumerate(group):
            rest = [h for j, h in enumerate(group) if j != i]
            largest.append(max(excess(one, rest, floor).values(), default=0.0))
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
        done = _each(_timed, [(p, whitened, _without(manifest, p)) for p in paths], jobs)
        results = dict(zip(paths, track(done, "peers", total=len(paths)), strict=True))
        for method, settings in METHODS.items():
            label = f"{method}{', whitened' if whitened else ''}"
            seconds = float(np.median([results[p][method][1] for p in paths]))
            tried = [
                row
                for number in range(len(settings))
                for row in _rows_of(
                    label,
                    {p.stem: results[p][method][0][number] for p in paths},
                    manifest,
                    answers,
                    rows[0].false_alarms[0],
                    seconds,
                )
            ]
            best = max(tried, key=lambda r: (r.exact[0], r.included[0], -r.wrong[0]))
            rows.append(replace(best, matched=max(r.matched for r in tried)))
    return rows


def _rows_of(
    label: str,
    by_name: Mapping[str, Importance],
    manifest: dict[str, Any],
    answers: dict[str, Any],
    alarms: int,
    seconds: float,
) -> Iterator[PeerScore]:
    """The rows of one setting of a method, one for each floor."""
    groups: dict[str, list[Importance]] = {}
    for stem, found in by_name.items():
        if stem.startswith("station-"):
            groups.setdefault(stem.rsplit("-healthy", 1)[0], []).append(found)
    for floor in FLOORS:
        over = {
            name: excess(by_name[name], groups[manifest[name]["healthy"]], floor)
            for name in answers
            if name in by_name
        }
        limits = threshold(list(groups.values()), floor), limit_with(over, answers, alarms)
        row, matched = (
            peer_row(label, names_above(over, limit), answers, seconds) for limit in limits
        )
        yield replace(row, matched=matched.exact)


def names_above(over: Mapping[str, Importance], limit: float) -> dict[str, set[str]]:
    """Effects whose excess is above a limit, for each recording."""
    return {
        name: {effect for effect, value in found.items() if value > limit}
        for name, found in over.items()
    }


def limit_with(over: Mapping[str, Importance], answers: dict[str, Any], alarms: int) -> float:
    """The lowest limit with so many false alarms among the sealed healthy recordings, or fewer.

    It is set with the answers in hand, in the method's favour.
    """
    largest = sorted(
        (max(over[name].values(), default=0.0) for name in over if _is_healthy(answers[name])),
        reverse=True,
    )
    return largest[alarms] if alarms < len(largest) else 0.0


def _is_healthy(answer: dict[str, Any]) -> bool:
    return str(answer["stratum"]) == "healthy"


def _without(manifest: dict[str, Any], regressors: Path) -> list[str]:
    """Effects left out for a recording; healthy ones of a station have no entry and lack none."""
    return [str(effect) for effect in manifest.get(regressors.stem, {}).get("without", ())]


def peer_row(
    label: str, named: dict[str, set[str]], answers: dict[str, Any], seconds: float
) -> PeerScore:
    """Count a method's names against the answers."""
    gone = {n: set(answers[n].get("without", ())) for n in named}
    truth = {
        n: {UNKNOWN if c["effect"] in gone[n] else str(c["effect"]) for c in answers[n]["causes"]}
        for n in named
    }
    size = {
        n: min((float(c["size_factor"]) for c in answers[n]["causes"]), default=0.0) for n in named
    }
    stratum = {n: str(answers[n]["stratum"]) for n in named}
    well = [n for n in named if stratum[n] == "healthy"]
    large = [n for n in named if stratum[n] in ("single", "onset") and size[n] >= LARGE]
    strange = [n for n in named if UNKNOWN in truth[n]]
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
    strange = [j for j in judged if UNKNOWN in j.truth]
    wrong = [j for j in judged if set(j.named) - set(j.truth)]
    exact = (sum(j.outcome == "exact" for j in large), len(large))
    times = [j.seconds for j in judged if j.verdict != "failed"]
    return PeerScore(
        method="wind diagnose",
        false_alarms=(sum(j.outcome in NAMES_SOMETHING for j in well), len(well)),
        exact=exact,
        matched=exact,
        included=(sum(j.found for j in large), len(large)),
        wrong=(len(wrong), len(judged)),
        unknown_named=(sum(bool(j.named) for j in strange), len(strange)),
        seconds=float(np.median(times)) if times else float("nan"),
    )
