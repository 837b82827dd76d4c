"""What a sealed set is made of: kinds of cases and their shares."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from proving_ground.concealed.strangers import STRANGERS
from proving_ground.generate import Planted, RecordingSpec, healthy, with_effect
from proving_ground.minimum_sizes import MINIMUM_SIZES, applicable
from proving_ground.stations import Station, random_station

SIZES = (0.5, 1.0, 1.5, 3.0, 6.0, 12.0)
SHARES = {
    "healthy": 0.22,
    "single": 0.36,
    "onset": 0.07,
    "pair": 0.08,
    "confusable": 0.06,
    "unknown": 0.09,
    "withheld": 0.07,
    "too_little": 0.05,
}
MANNERS = ("plain", "white", "coloured", "mismatch")
CONFUSABLE = (
    ("bearing_friction", "calibration_offset"),
    ("calibration_drift", "air_density"),
    ("rotor_inertia", "timestamp_latency"),
    ("vane_offset", "axis_tilt"),
    ("missed_pulses", "calibration_drift"),
    ("vane_inertia", "vane_damping"),
    ("low_pass_filter", "timestamp_latency"),
    ("flow_distortion", "wake_shadow"),
    ("vane_eccentricity", "heading_deviation"),
    ("lever_arm", "platform_velocity_scale"),
)
ALONE = ("sensor_swap",)
"""Effects that no pair holds: they hide whatever is planted beside them."""

NOTHING_TO_ACT_ON = {"platform_velocity": ("platform_velocity_scale", "frame_error")}
"""Effects beside which others change nothing: a velocity of nought, scaled or turned, is one."""

SPECIAL_CASES = ("platform_velocity", "air_density", "calibration_drift")
"""Effects that another one contains: a velocity scale of nought is a missing velocity, thin air of
one temperature is a heavy rotor, ice without weight is a gain. Without them in the catalogue the
other one would still be true, so they would not be unknown."""

FIRST_SCORING_STATION = 10_000
"""Stations below are for development; scoring never draws them."""


@dataclass(frozen=True)
class Case:
    """One recording of a sealed set: its stratum, which station it is of, how it is made, and the
    effects that are taken out of the catalogue when it is diagnosed."""

    stratum: str
    station: int
    spec: RecordingSpec
    without: tuple[str, ...] = ()

    @property
    def planted(self) -> tuple[str, ...]:
        """Names of the concealed causes."""
        return tuple(p.effect for p in self.spec.planted)


@dataclass(frozen=True)
class Plan:
    """A sealed set before it is written: stations with their healthy recordings, and cases."""

    stations: tuple[Station, ...]
    healthy: tuple[tuple[RecordingSpec, ...], ...]
    cases: tuple[Case, ...]


def manner_of(station: Station, manner: str, rng: np.random.Generator) -> Station:
    """The station with a reference or a certificate of a certain manner.

    white: a near and noisy reference; coloured: a far one; mismatch: certificates within
    tolerance only.
    """
    if manner == "white":
        return replace(station, sonic=replace(station.sonic, separation=0.15, noise=0.12))
    if manner == "coloured":
        return replace(station, sonic=replace(station.sonic, separation=1.2))
    if manner == "mismatch":
        keys = ("calibration_distance", "distance_constant", "vane_distance_constant")
        spread = (0.01, 0.08, 0.08)
        errors = tuple(
            (key, float(1.0 + s * rng.standard_normal()))
            for key, s in zip(keys, spread, strict=True)
        )
        return replace(station, sheet_errors=errors)
    return station


def counts(total: int) -> dict[str, int]:
    """Cases for each stratum, by largest remainder, so that they add up to `total`."""
    exact = {name: share * total for name, share in SHARES.items()}
    whole = {name: int(value) for name, value in exact.items()}
    left = sorted(exact, key=lambda name: whole[name] - exact[name])
    for name in left[: total - sum(whole.values())]:
        whole[name] += 1
    return whole


def make_plan(
    total: int,
    rng: np.random.Generator,
    minutes: float,
    healthy_count: int,
    kinds: str = "ABC",
    strata: dict[str, int] | None = None,
) -> Plan:
    """Draw a set of `total` cases, each with its stratum, or of the given strata."""
    wanted = strata if strata is not None else counts(total)
    size = sum(wanted.values())
    number = len(kinds) * max(1, round(size / (18 * len(kinds))))
    stations = tuple(
        manner_of(
            random_station(kinds[i % len(kinds)], FIRST_SCORING_STATION + int(s)),
            MANNERS[(i // len(kinds)) % len(MANNERS)],
            rng,
        )
        for i, s in enumerate(rng.choice(2**31, number, replace=False))
    )
    seeds = iter(rng.permutation(2**20)[: size + number * healthy_count].tolist())
    well = tuple(
        tuple(healthy(station, next(seeds), minutes) for _ in range(healthy_count))
        for station in stations
    )
    singles = _deck(stations, rng)
    strangers = iter(_shuffled(list(STRANGERS), rng, size))
    cases = []
    turn = 0
    for stratum, count in wanted.items():
        for _ in range(count):
            if stratum == "single":
                index, planted = next(singles)
            else:
                index = turn % number
                turn += 1
                planted = _planted(stratum, stations[index], rng, strangers)
            spec = with_effect(stations[index], planted, 0.0, next(seeds), minutes)
            if stratum == "too_little":
                spec = _too_little(spec, rng)
            without = tuple(p.effect for p in planted) if stratum == "withheld" else ()
            cases.append(Case(stratum, index, spec, without))
    cases = _with_decoys(cases, stations, rng)
    order = rng.permutation(len(cases))
    return Plan(stations, well, tuple(cases[i] for i in order))


def _with_decoys(
    cases: list[Case], stations: tuple[Station, ...], rng: np.random.Generator
) -> list[Case]:
    """The cases, as many of them as effects are withheld without an effect that is not theirs.

    Whoever reads that an effect is taken out so learns nothing of whether it is concealed.
    """
    withheld = [c for c in cases if c.stratum == "withheld"]
    others = [i for i, c in enumerate(cases) if c.stratum not in ("withheld", "too_little")]
    out = list(cases)
    for i in rng.permutation(others)[: len(withheld)].tolist():
        able = set(_withholdable(stations[cases[i].station])) - set(cases[i].planted)
        out[i] = replace(cases[i], without=(str(rng.choice(sorted(able))),))
    return out


def _withholdable(station: Station) -> list[str]:
    names = applicable(station.kind, station.pulses_per_revolution)
    return [n for n in names if n not in SPECIAL_CASES]


def _shuffled(names: list[str], rng: np.random.Generator, length: int) -> list[str]:
    repeats = length // len(names) + 1
    return [str(n) for _ in range(repeats) for n in rng.permutation(names)]


def _deck(
    stations: tuple[Station, ...], rng: np.random.Generator
) -> Iterator[tuple[int, tuple[Planted, ...]]]:
    """Single effects without end: every effect comes once before any comes again, and every size
    of an effect before any size again."""
    sizes: dict[str, list[float]] = {}
    while True:
        for effect in rng.permutation(list(MINIMUM_SIZES)).tolist():
            able = [
                i
                for i, s in enumerate(stations)
                if effect in applicable(s.kind, s.pulses_per_revolution)
            ]
            if not able:
                continue
            if not sizes.get(effect):
                graded = MINIMUM_SIZES[effect].graded
                sizes[effect] = [float(s) for s in rng.permutation(SIZES)] if graded else [3.0]
            size = min(sizes[effect].pop(), MINIMUM_SIZES[effect].most)
            yield int(rng.choice(able)), (Planted(str(effect), size),)


def _planted(
    stratum: str, station: Station, rng: np.random.Generator, strangers: Iterator[str]
) -> tuple[Planted, ...]:
    names = applicable(station.kind, station.pulses_per_revolution)
    if stratum == "unknown":
        return (Planted(next(strangers), float(rng.choice([2.0, 3.0, 5.0]))),)
    if stratum == "withheld":
        effect = str(rng.choice(_withholdable(station)))
        return (Planted(effect, float(rng.choice([2.0, 3.0, 5.0]))),)
    if stratum == "large":
        return (Planted(str(rng.choice(names)), 4.0),)
    if stratum == "pair":
        return _pair([n for n in names if n not in ALONE], rng)
    if stratum == "confusable":
        able = [p for p in CONFUSABLE if p[0] in names and p[1] in names]
        first, second = able[int(rng.integers(len(able)))]
        chosen = (first, second) if rng.random() < 0.5 else (str(rng.choice([first, second])),)
        return tuple(Planted(n, 3.0) for n in chosen)
    if stratum == "onset":
        able_names = [n for n in names if n not in ("stuck_sensor", "clock_drift")]
        begin = float(rng.uniform(0.2, 0.6))
        end = float(rng.uniform(begin + 0.25, 1.0)) if rng.random() < 0.4 else None
        return (Planted(str(rng.choice(able_names)), 4.0, begin, end),)
    if stratum == "too_little" and rng.random() < 0.5:
        return (Planted(str(rng.choice(names)), 2.0),)
    return ()


def _pair(names: Sequence[str], rng: np.random.Generator) -> tuple[Planted, ...]:
    """Two effects, of which neither takes away what the other acts on."""
    order = [str(n) for n in rng.permutation(names)]
    first = order[0]
    second = next(n for n in order[1:] if not _idle_together(first, n))
    return Planted(first, 3.0), Planted(second, 3.0)


def _idle_together(one: str, other: str) -> bool:
    return other in NOTHING_TO_ACT_ON.get(one, ()) or one in NOTHING_TO_ACT_ON.get(other, ())


def _too_little(spec: RecordingSpec, rng: np.random.Generator) -> RecordingSpec:
    """A record too short, or too calm, to say anything."""
    if rng.random() < 0.5:
        return replace(spec, minutes=float(rng.uniform(0.3, 0.8)))
    calm = replace(spec.weather, mean_speed=0.25, gust_fronts=0, wander_speed=0.1)
    return replace(spec, weather=replace(calm, slowest=0.1))
