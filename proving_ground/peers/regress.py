"""What each peer makes of each recording, before anybody knows the answers."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.progress import track

from proving_ground.inflow import Array
from proving_ground.peers.methods import METHODS, Method, require_peers
from proving_ground.sealing.seal import HEALTHY, RECORDINGS
from proving_ground.sealing.trial import read_manifest
from wind_sensors.processes import ONE_THREAD

REGRESSORS = "regressors"
LONGEST_MEMORY = 20

Importance = dict[str, float]
Item = TypeVar("Item")
Made = TypeVar("Made")


@dataclass(frozen=True)
class Said:
    """What one method makes of one recording: the importance of each effect, setting by setting,
    and the seconds of one setting."""

    settings: list[Importance]
    seconds: float


def regress_all(folder: Path, jobs: int = 1) -> dict[bool, dict[str, dict[str, Said]]]:
    """What every method makes of every recording of a set, plain (False) and whitened (True), by
    recording and method; kept beside the regressors, so that it is done once.

    Raises UserError if a library is missing.
    """
    require_peers()
    collect_regressors(folder, jobs)
    manifest = read_manifest(folder)["recordings"]
    paths = sorted((folder / REGRESSORS).glob("*.npz"))
    out: dict[bool, dict[str, dict[str, Said]]] = {}
    for whitened in (False, True):
        done = _each(_said, [(p, whitened, _without(manifest, p)) for p in paths], jobs)
        title = f"peers{', whitened' if whitened else ''}"
        out[whitened] = {
            path.stem: said
            for path, said in zip(paths, track(done, title, total=len(paths)), strict=True)
        }
    return out


def _said(item: tuple[Path, bool, Sequence[str]]) -> dict[str, Said]:
    path, whitened, without = item
    kept = path.with_suffix(".whitened.json" if whitened else ".plain.json")
    if kept.is_file():
        entries = json.loads(kept.read_text(encoding="utf-8"))
        return {name: Said(**entry) for name, entry in entries.items()}
    found = {}
    for name, settings in METHODS.items():
        begun = time.process_time()
        importance = importances(path, settings, whitened, without)
        found[name] = Said(importance, (time.process_time() - begun) / len(settings))
    entries = {name: asdict(said) for name, said in found.items()}
    kept.write_text(json.dumps(entries), encoding="utf-8")
    return found


def _without(manifest: dict[str, Any], regressors: Path) -> list[str]:
    """Effects left out for a recording; healthy ones of a station have no entry and lack none."""
    return [str(effect) for effect in manifest.get(regressors.stem, {}).get("without", ())]


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
    environment = {**os.environ, **ONE_THREAD}
    environment["PYTHONPATH"] = os.pathsep.join(
        filter(None, [root, environment.get("PYTHONPATH", "")])
    )
    command = [sys.executable, "-m", "wind_sensors.report.regressors", str(source)]
    part = target.with_suffix(".part")
    with tempfile.TemporaryDirectory(prefix="wind-peers-") as place:
        written = Path(place) / target.name
        subprocess.run(
            [*command, "-o", str(written)], env=environment, check=False, capture_output=True
        )
        if written.is_file():
            shutil.copyfile(written, part)
            part.replace(target)


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
