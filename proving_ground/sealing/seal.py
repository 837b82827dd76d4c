"""Write a sealed set: recordings under random names, hidden answers, a public commitment."""

from __future__ import annotations

import json
import secrets
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from proving_ground.generate import RecordingSpec, generate_recording
from proving_ground.sealing.chosen import chosen_plan
from proving_ground.sealing.cipher import commitment, derive, encrypt
from proving_ground.sealing.strata import Plan, make_plan
from wind_sensors.errors import UserError

MANIFEST = "manifest.json"
ANSWERS = "answers.sealed"
RECORDINGS = "recordings"
HEALTHY = "healthy"


@dataclass(frozen=True)
class Sealed:
    """What sealing leaves: the folder, the commitment and how many recordings it holds."""

    folder: Path
    commitment: str
    recordings: int


def seal(
    folder: Path,
    total: int,
    seed: int,
    key: bytes,
    *,
    minutes: float = 15.0,
    healthy_count: int = 6,
    kinds: str = "ABC",
    strata: dict[str, int] | None = None,
    causes: Sequence[str] = (),
    jobs: int = 1,
) -> Sealed:
    """Draw, write and seal a set: of `total` cases, of given strata, or of causes one chose
    (see `parse_causes`).

    The weather and what is concealed follow from `seed` and the secret `key` together, so that
    the seed alone gives nothing away and the key alone lets anyone make the set again.

    Raises UserError if the folder exists already, or if a chosen cause cannot be read.
    """
    if folder.exists():
        raise UserError("the folder exists already", str(folder), "Give another one with -o.")
    drawing = {
        "total": total,
        "seed": seed,
        "minutes": minutes,
        "healthy_count": healthy_count,
        "kinds": kinds,
        "strata": strata,
        "causes": list(causes),
    }
    plan, names = draw(key, drawing)
    answers = _write(folder, plan, names, jobs)
    plain = json.dumps(
        {"salt": secrets.token_hex(32), "drawing": drawing, "answers": answers}
    ).encode()
    committed = commitment(plain)
    entries = {
        name: {"healthy": f"station-{case.station + 1}", "without": list(case.without)}
        for name, case in zip(names, plan.cases, strict=True)
    }
    manifest = {
        "commitment": committed,
        "recordings": {name: entries[name] for name in sorted(names)},
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1), encoding="utf-8")
    (folder / ANSWERS).write_bytes(encrypt(key, plain))
    return Sealed(folder, committed, len(names))


def draw(key: bytes, drawing: dict[str, Any]) -> tuple[Plan, list[str]]:
    """The plan of a set and the names of its recordings, from the secret and how it was drawn."""
    seed = int(drawing["seed"])
    rng = np.random.default_rng(int.from_bytes(derive(key, f"plan {seed}"), "big"))
    minutes, healthy_count = float(drawing["minutes"]), int(drawing["healthy_count"])
    kinds = str(drawing["kinds"])
    if drawing.get("causes"):
        return chosen_plan(drawing["causes"], rng, minutes, healthy_count, kinds)
    plan = make_plan(
        int(drawing["total"]), rng, minutes, healthy_count, kinds, drawing["strata"]
    )
    return plan, _names(len(plan.cases), key, seed)


def _names(count: int, key: bytes, seed: int) -> list[str]:
    return [derive(key, f"name {seed} {i}").hex()[:10] for i in range(count)]


def _write(folder: Path, plan: Plan, names: list[str], jobs: int) -> dict[str, Any]:
    specs: list[RecordingSpec] = []
    for i, well in enumerate(plan.healthy):
        place = folder / HEALTHY / f"station-{i + 1}"
        specs += [spec.into(place / f"healthy-{j + 1}") for j, spec in enumerate(well)]
    first = len(specs)
    specs += [
        case.spec.into(folder / RECORDINGS / name)
        for name, case in zip(names, plan.cases, strict=True)
    ]
    if jobs > 1:
        with ProcessPoolExecutor(jobs) as pool:
            made = list(track(pool.map(generate_recording, specs), "writing", total=len(specs)))
    else:
        made = [generate_recording(spec) for spec in track(specs, "writing")]
    return {
        name: {
            "stratum": case.stratum,
            "station": case.station + 1,
            "kind": case.spec.station.kind,
            "without": list(case.without),
            "causes": answer,
        }
        for name, case, answer in zip(names, plan.cases, made[first:], strict=True)
    }
