"""A set of recordings with their answers beside them, for those who build the diagnosis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track
from ruamel.yaml import YAML

from proving_ground.concealed.strangers import STRANGERS
from proving_ground.generate import (
    Planted,
    RecordingSpec,
    generate_recording,
    healthy,
    random_station,
    with_effect,
    write_answers,
)
from proving_ground.minimum_sizes import MINIMUM_SIZES, applicable

SIZES = (3.0, 1.5)
HEALTHY = 6
STRANGER_COUNT = 10
ONSET_COUNT = 5
PAIR_COUNT = 4
SEED_BASE = 1000


@dataclass(frozen=True)
class Named:
    """A recording of a set with its place below the top folder."""

    name: str
    spec: RecordingSpec


def station_plan(kind: str, number: int, minutes: float) -> Iterator[Named]:
    """The recordings of one station of the set, healthy ones first."""
    station = random_station(kind, number)
    rng = np.random.default_rng([number, ord(kind), 404])
    names = applicable(kind, station.pulses_per_revolution)
    seed = SEED_BASE * number

    def planned(name: str, *planted: Planted) -> Named:
        nonlocal seed
        seed += 1
        return Named(f"{kind}{number}/{name}", with_effect(station, planted, 0.0, seed, minutes))

    for i in range(HEALTHY):
        seed += 1
        yield Named(f"{kind}{number}/healthy-{i + 1}", healthy(station, seed, minutes))
    for size in SIZES:
        for name in names:
            if MINIMUM_SIZES[name].graded or size == SIZES[0]:
                yield planned(f"{name}-{size:g}", Planted(name, size))
    for name in rng.permutation(list(STRANGERS))[:STRANGER_COUNT]:
        yield planned(f"stranger-{name}-3", Planted(str(name), 3.0))
    for name in rng.permutation(names)[:ONSET_COUNT]:
        begin = float(rng.uniform(0.2, 0.6))
        end = float(rng.uniform(begin + 0.2, 1.0)) if rng.random() < 0.5 else None
        yield planned(f"onset-{name}-4", Planted(str(name), 4.0, begin, end))
    for _ in range(PAIR_COUNT):
        first, second = (str(n) for n in rng.permutation(names)[:2])
        yield planned(f"pair-{first}-{second}-3", Planted(first, 3.0), Planted(second, 3.0))


def write_set(
    top: Path, kinds: str = "ABC", stations: tuple[int, ...] = (1, 2), minutes: float = 10.0
) -> None:
    """Write the set below `top`, with `answers.yaml`; what is already there is left as it is."""
    top.mkdir(parents=True, exist_ok=True)
    path = top / "answers.yaml"
    answers: dict[str, list[dict[str, Any]]] = {}
    if path.exists():
        answers = YAML(typ="safe").load(path) or {}
    plan = [n for number in stations for kind in kinds for n in station_plan(kind, number, minutes)]
    for named in track(plan, "writing recordings"):
        if named.name in answers:
            continue
        answers[named.name] = generate_recording(named.spec.into(top / named.name))
        write_answers(path, answers)
