"""What the diagnosis says when the true effect is not in its catalogue.

    python benchmarks/left_out_effects.py                       # recordings of the package's own
    python -m proving_ground devset -o devset
    python benchmarks/left_out_effects.py --folder devset       # recordings of the proving ground

Every effect of the catalogue is planted alone, and its recording is diagnosed twice: with the whole
catalogue, and with that effect taken out. Right answers to the second are `unknown`, an ambiguous
set, and `none` where the effect is not seen even with its name; a single name is wrong, unless the
names say the same physics in other words (ice is a loss of speed with an inertia).
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing import Pool
from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.signatures import Template, signature_bank, templates_of
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.recordings import read_recording
from wind_sensors.recordings.station_files import load_station
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.simulation.trajectories import boat
from wind_sensors.station.model import Input, Reference, Station
from wind_sensors.station.signals import Recording
from wind_sensors.turbulence.synthesis import TurbulenceSpec

STATIONS = ("mast_cup_vane", "usv", "mast_propeller_vane")
HEALTHY = 5
SIZE = 5.0
"""In units of the smallest size worth reporting."""

WITHIN_BOUNDS = 0.7
"""Nothing is planted further than this share of the way to the bounds of the search: what is found
there is taken for the wrong effect."""

SEPARATION = 2.0
"""Of the reference from the instruments [m]."""

SWELL, TURN = 0.35, 1.2
"""Slow swing of the speed [relative] and of the direction [rad]: where the wind hardly changes, or
speed and direction change together, effects of other forms are the same, and nothing can tell that
the true one is missing."""

PROCESSES = 2

SAME_PHYSICS = {
    "air_density": frozenset({"rotor_inertia", "vane_inertia"}),
    "vane_offset": frozenset({"heading_deviation"}),
    "axis_tilt": frozenset({"frame_error"}),
}
"""What says the same, beyond what effects contain: at one temperature thin air makes a rotor and a
vane answer as if they were heavier; a compass that is off by a constant turns the wind that the
vane sees as the vane's own offset does; a frame that is rolled and pitched leans every axis.
"""


@dataclass(frozen=True)
class Case:
    """A recording with one effect.

    Attributes:
        name: For the table.
        effect: What was planted.
        recording: What was recorded.
        baseline: What is normal for its station.
    """

    name: str
    effect: str
    recording: Recording
    baseline: Baseline


def own_station(name: str) -> Station:
    """A ready station beside a reference."""
    ready = load_station(name)
    reference = Reference(
        topic=Input(topic="/reference/wind"), separation=SEPARATION, noise=0.05
    )
    return ready.model_copy(update={"reference": reference})


def recorded(station: Station, seed: int, made_by: Station | None = None) -> Recording:
    """A quarter of an hour in a wind of its own; the station file may not say what made it."""
    rng = np.random.default_rng(seed)
    speed = float(rng.uniform(5.0, 9.0))
    wind = TurbulenceSpec(
        mean_speed=speed,
        direction=float(rng.uniform(-np.pi, np.pi)),
        standard_deviations=(0.14 * speed, 0.11 * speed, 0.07 * speed),
        integral_lengths=(120.0, 60.0, 20.0),
        slow_amplitude=SWELL * speed,
        slow_period=700.0,
        turn_amplitude=TURN,
        turn_period=430.0,
        seed=seed,
    )
    moving = boat(seed=seed) if station.platform is not None else None
    scenario = Scenario(
        wind, duration=900.0, seed=seed, trajectory=moving, temperature_amplitude=3.0
    )
    made = simulate(made_by or station, scenario)
    return replace(made, station=station, truth=None, name=f"seed {seed}")


def _most_visible(station: Station, recording: Recording, name: str) -> Template | None:
    """The template of an effect that changes the recording's signals most."""
    comparison = prepare(recording)
    templates = [
        template
        for template in templates_of(comparison, station, {name: catalogue()[name]})
        if template.effect.relative_size(template.values) > 0.0
    ]
    if not templates:
        return None
    bank = signature_bank(comparison, station, templates)

    def change(k: int) -> float:
        return sum(
            float(np.var(bank.with_each[k].series[c.name] - bank.without.series[c.name]))
            for c in comparison.channels
        )

    return templates[max(range(len(templates)), key=change)]


def _sized(template: Template) -> dict[str, float]:
    """The template's values, so far from the healthy ones that the size is `SIZE`, or less."""
    factor = SIZE / max(template.effect.relative_size(template.values), 0.1)
    values = dict(template.values)
    for parameter in template.effect.parameters:
        if parameter.healthy is not None and parameter.graded:
            low, high = (
                parameter.healthy + WITHIN_BOUNDS * (bound - parameter.healthy)
                for bound in (parameter.low, parameter.high)
            )
            moved = parameter.healthy + factor * (values[parameter.name] - parameter.healthy)
            values[parameter.name] = float(np.clip(moved, low, high))
    if template.effect.name == "stuck_sensor":
        values.update(start=300.0, stop=300.0 + 20.0 * SIZE)
    return values


def own_cases(chosen: Sequence[str]) -> Iterator[Case]:
    """Every effect on every chosen station that can have it."""
    for number, station_name in enumerate(STATIONS):
        if station_name not in chosen:
            continue
        station = own_station(station_name)
        seed = 1000 * (number + 1)
        baseline = learn([recorded(station, seed + k) for k in range(HEALTHY)])
        for name in catalogue():
            seed += 10
            template = _most_visible(station, recorded(station, seed), name)
            if template is None:
                continue
            sized = replace(template, values=_sized(template))
            recording = recorded(station, seed, sized.planted(station))
            yield Case(f"{station_name}/{name}", name, recording, baseline)


def folder_cases(folder: Path) -> Iterator[Case]:
    """The single effects at three times their smallest size of a development set."""
    answers = YAML(typ="safe").load(folder / "answers.yaml")
    for station in sorted(p for p in folder.iterdir() if p.is_dir()):
        baseline = learn([read_recording(p) for p in sorted(station.glob("healthy-*"))])
        for bag in sorted(station.glob("*-3")):
            name = f"{station.name}/{bag.name}"
            truth = {entry["effect"] for entry in answers[name]}
            if len(truth) == 1 and truth <= set(catalogue()):
                yield Case(name, truth.pop(), read_recording(bag), baseline)


def _both(case: Case) -> tuple[Case, tuple[str, str], tuple[str, str]]:
    known = catalogue()
    rest = {key: effect for key, effect in known.items() if key != case.effect}
    return (
        case,
        _said(diagnose(case.recording, case.baseline, known)),
        _said(diagnose(case.recording, case.baseline, rest)),
    )


def in_other_words(effect: str, names: str) -> bool:
    """Whether names say what an effect that was taken out does."""
    known = catalogue()
    said = set(names.split(" + "))
    parts = SAME_PHYSICS.get(effect, frozenset()) | known[effect].contains
    return said <= parts or any(effect in known[name].contains for name in said)


def _said(found: Diagnosis) -> tuple[str, str]:
    names = dict.fromkeys(f.term.effect.name for f in found.findings)
    return found.verdict, " + ".join(names)


def main() -> None:
    """Print one row per recording, then the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, help="development set; none: own simulations")
    parser.add_argument("--station", action="append", choices=STATIONS, help="none: all")
    arguments = parser.parse_args()
    cases = (
        folder_cases(arguments.folder)
        if arguments.folder
        else own_cases(arguments.station or STATIONS)
    )
    exact: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    print("| recording | with the whole catalogue | without the true effect |\n|---|---|---|")
    with Pool(PROCESSES) as pool:
        for case, whole, without in pool.imap_unordered(_both, cases):
            exact["exact" if whole == ("named", case.effect) else whole[0]] += 1
            outcome = without[0]
            if outcome == "named" and in_other_words(case.effect, without[1]):
                outcome = "named in other words"
            counts[outcome] += 1
            said = ": ".join((outcome, without[1])) if without[1] else outcome
            print(f"| {case.name} | {': '.join(whole)} | {said} |", flush=True)
    print(f"\n{sum(exact.values())} recordings with it: {dict(exact)}; without: {dict(counts)}")


if __name__ == "__main__":
    main()
