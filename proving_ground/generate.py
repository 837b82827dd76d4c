"""Make recordings: a station, its weather, and what is concealed in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from proving_ground.bag_writer import write_bag
from proving_ground.concealed.kinds import activity_between
from proving_ground.concealed.registry import CATALOGUED, cause
from proving_ground.measure import run_scene
from proving_ground.minimum_sizes import MINIMUM_SIZES
from proving_ground.scene import Scene, build_scene
from proving_ground.sheets import write_sheet
from proving_ground.stations import Station, random_station
from proving_ground.weather import Weather, random_weather

__all__ = [
    "Planted",
    "RecordingSpec",
    "generate_recording",
    "healthy",
    "random_station",
    "with_effect",
    "write_answers",
]


@dataclass(frozen=True)
class Planted:
    """One concealed cause: its name, its size in multiples of the smallest worth reporting, and
    the part of the record (0 to 1) at which it begins and ends (None: it does not)."""

    effect: str
    size_factor: float
    begin: float | None = None
    end: float | None = None


@dataclass(frozen=True)
class RecordingSpec:
    """Everything that determines a recording to the last bit."""

    station: Station
    weather: Weather
    seed: int
    minutes: float = 15.0
    planted: tuple[Planted, ...] = ()
    folder: Path = field(default_factory=lambda: Path("recording"))

    def into(self, folder: Path | str) -> RecordingSpec:
        """The same recording, to be written to another folder."""
        return replace(self, folder=Path(folder))


def healthy(station: Station, seed: int, minutes: float = 15.0) -> RecordingSpec:
    """A recording in which nothing is wrong."""
    weather = random_weather(np.random.default_rng([seed, station.seed, ord(station.kind)]))
    return RecordingSpec(station, weather, seed, minutes)


def with_effect(
    station: Station,
    effect: str | Sequence[Planted],
    size_factor: float,
    seed: int,
    minutes: float = 15.0,
) -> RecordingSpec:
    """A recording with one effect of a size in multiples of its minimum, or with several."""
    planted = (Planted(effect, size_factor),) if isinstance(effect, str) else tuple(effect)
    return replace(healthy(station, seed, minutes), planted=planted)


def generate_recording(spec: RecordingSpec) -> list[dict[str, Any]]:
    """Write the recording's folder and return its answer: one entry for each concealed cause.

    The answer is not written into the folder. Raises FileExistsError if the folder exists.
    """
    spec.folder.mkdir(parents=True)
    scene = build_scene(spec.station, spec.weather, spec.minutes, spec.seed)
    return record(scene, spec.planted, spec.folder)


def record(scene: Scene, planted: Sequence[Planted], folder: Path) -> list[dict[str, Any]]:
    """Conceal causes in a scene, run it and write what was recorded into an existing folder."""
    answers = [plant(scene, each) for each in planted]
    signals = run_scene(scene)
    write_bag(folder / "bag", signals, scene.station.rotor_name)
    write_sheet(folder / "recording.yaml", scene.station)
    return [_plain(entry) for entry in answers]


def plant(scene: Scene, planted: Planted) -> dict[str, Any]:
    """Conceal a cause in a scene that has not run yet; its answer."""
    found = cause(planted.effect)
    known = planted.effect in CATALOGUED
    smallest = MINIMUM_SIZES[planted.effect].value if known else 1.0
    begin = None if planted.begin is None else planted.begin * scene.duration
    end = None if planted.end is None else planted.end * scene.duration
    activity = activity_between(scene.time, begin, end)
    instrument = scene.station.rotor_name if found.instrument == "rotor" else found.instrument
    entry: dict[str, Any] = {
        "effect": planted.effect if known else "unknown",
        "instrument": instrument,
        "size_factor": planted.size_factor,
    }
    if not known:
        entry["stranger"] = planted.effect
    if begin is not None or end is not None:
        entry["interval_s"] = [begin or 0.0, scene.duration if end is None else end]
    parameters = found.plant(scene, smallest * planted.size_factor, activity)
    entry["parameters"] = parameters
    return entry


def _plain(entry: dict[str, Any]) -> dict[str, Any]:
    """The entry with its parameters, some of them filled in while the scene ran, side by side."""
    parameters = entry.pop("parameters")
    return {**entry, **parameters}


def write_answers(path: Path, answers: dict[str, list[dict[str, Any]]]) -> None:
    """Write an answers file: a list of concealed causes for each recording."""
    writer = YAML()
    writer.width = 200
    writer.dump(answers, path)
