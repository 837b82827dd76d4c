"""The diagnosis of a recording of means, from the first look to the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.means import panels, silences
from wind_sensors.diagnosis.means.averages import Averages
from wind_sensors.diagnosis.means.bench import bench_of
from wind_sensors.diagnosis.means.culprit import likelihood_of_first
from wind_sensors.diagnosis.means.findings import (
    PairWork,
    finding_of_ice,
    finding_of_silence,
    findings_of_pair,
    findings_of_vane,
)
from wind_sensors.diagnosis.means.fits import intervals
from wind_sensors.diagnosis.means.healthy import Healthy, cleaned
from wind_sensors.diagnosis.means.pair import (
    cells,
    direction_of,
    is_comparable,
    pair_of,
    pairs_of,
    standing_of,
    table_of,
)
from wind_sensors.diagnosis.means.pair_effects import rotor_effects, warming
from wind_sensors.diagnosis.means.search import Named, is_normal, search
from wind_sensors.diagnosis.means.vanes import (
    vane_bench,
    vane_effects,
    vane_standing,
)
from wind_sensors.diagnosis.outcome import Outcome, verdict_of
from wind_sensors.diagnosis.proving.findings import Finding, Unexplained
from wind_sensors.errors import UserError
from wind_sensors.station.signals import Recording, Series

FloatArray = npt.NDArray[np.float64]
Progress = Callable[[str, float], None]

DECISIVE = 3.0
"""The other heights decide between two rotors when the log-likelihoods differ by so much."""

CLEAN_CELL = 0.04
"""Ice is not looked for in directions in which a rotor's mount changes the wind by more."""

REMAINDER_SHARE = 0.35
"""Share of a pair's misfit above which a remainder makes the cause unknown."""


def is_of_means(recording: Recording) -> bool:
    """Whether a recording holds means instead of signals."""
    return recording.station.recording.averaging_time > 0.0


def diagnose_means(
    recording: Recording,
    deviations: Mapping[str, Series] | None = None,
    healthy: Healthy | None = None,
    progress: Progress | None = None,
) -> Outcome:
    """Find the physics that a station file leaves out in a recording of means.

    Each rotor of a pair is the other one's reference; vanes are compared with each other.

    Args:
        recording: Of means.
        deviations: Standard deviations of the speeds within the intervals [m/s], by rotor.
        healthy: What is normal; None: the certificates.
        progress: Called with a phase and the share of it that is done.

    Raises:
        UserError: There are too few means, or no pair.
    """

    def report(phase: str, share: float) -> None:
        if progress:
            progress(phase, share)

    averages, silent = cleaned(recording, deviations)
    findings: list[Finding] = [finding_of_silence(averages, s) for s in silent]
    declined: list[str] = []
    pairs = pairs_of(averages) if healthy is None else list(healthy.pairs)
    if healthy is not None:
        healthy, averages = healthy.of_same_vanes(averages)
        declined += healthy.reservations(averages)
    for pair_names in list(pairs):
        both = (averages,) if healthy is None else (averages, healthy.averages)
        if not all(is_comparable(a, *pair_names) for a in both):
            pairs.remove(pair_names)
            declined.append(f"{' and '.join(pair_names)}: too few common means to compare them.")
    if not pairs:
        raise UserError(
            "no two rotors agree well enough to be each other's reference.",
            recording.name,
            "Two rotors at one height are needed.",
        )
    averages, icy = _without_ice(averages, pairs)
    findings += [finding_of_ice(averages, i) for i in icy]
    terms: list[Term] = []
    shown = []
    smallest: dict[str, SmallestSize] = {}
    worst = Unexplained(1.0, 0.0, (), "")
    number = 0
    for first, second in pairs:
        phase = f"{first} and {second}"
        report(phase, 0.0)
        along = partial(report, phase)
        standing = standing_of(healthy.averages, first, second) if healthy is not None else None
        pair = pair_of(averages, first, second, standing)
        bench = bench_of(pair, recording.station)
        normal = None
        if healthy is not None:
            usual = pair_of(healthy.averages, first, second, standing)
            normal = is_normal(bench_of(usual, recording.station))
        warm = warming(pair.averages.temperature)
        wider = None if warm is None else {warm.name: warm}
        explained = search(
            bench, rotor_effects(), (first, second), along, normal=normal, wider=wider
        )
        others = [r for p in pairs for r in p if r not in (first, second)]
        named = [
            _attributed(n, healthy, averages, (first, second), others) for n in explained.named
        ]
        blamed = [
            n.term if n.term.instrument != t.instrument else t
            for n, t in zip(named, explained.terms, strict=True)
        ]
        work = PairWork(
            pair, bench, explained, tuple(named), tuple(blamed), intervals(bench, blamed)
        )
        own, notes, number, left = findings_of_pair(work, number)
        findings += own
        declined += notes
        smallest.update(work.smallest())
        if left.share > worst.share:
            worst = left
        terms += blamed
        shown += panels.of_pair(
            pair, recording.station, planted(recording.station, explained.terms)
        )
        report(phase, 1.0)
    for vane in averages.heading:
        turned = None
        if healthy is not None:
            turned = vane_standing(healthy.averages, recording.station, vane)
        if healthy is not None and turned is None:
            continue
        found = vane_bench(averages, recording.station, vane, turned)
        if found is None:
            declined.append(f"{vane}: no other vane works long enough to compare it with.")
            continue
        effects = vane_effects(healthy is not None)
        # Without healthy recordings the wind's own turning with height is fitted along.
        turning = Term(effects["vane_offset"], vane, {"offset": 0.1})
        explained = search(
            found.bench, effects, (vane,), None, 2, (turning,) if healthy is None else ()
        )
        own, notes = findings_of_vane(found, explained, turned, len(averages.heading))
        findings += own
        declined += notes
        terms += [f.term for f in own]
        after = planted(recording.station, explained.terms)
        shown.append(panels.of_vane(found, recording.station, after))
    findings, terms = _one_vane(findings, terms, declined)
    station = planted(recording.station, [t for t in terms if t.interval == ALWAYS])
    station = planted(station, [t for t in terms if t.interval != ALWAYS])
    for f in findings:
        if f.term.effect.name == "stuck_sensor":
            station = f.term.planted(station)
    return Outcome(
        recording=recording.name,
        verdict=verdict_of(tuple(findings), worst, REMAINDER_SHARE),
        calibrated=healthy is not None,
        findings=tuple(findings),
        unexplained=worst,
        smallest_detectable=smallest,
        station=station,
        length=(recording.stop - recording.start) * 1e-9,
        reference="borrowed: the rotors of a pair and the vanes are each other's reference",
        declined=tuple(declined),
        panels=tuple(shown),
        healthy=healthy.names if healthy is not None else (),
    )


def _without_ice(
    averages: Averages, pairs: Sequence[tuple[str, str]]
) -> tuple[Averages, list[silences.Ice]]:
    heading = np.nan_to_num(direction_of(averages))
    found = []
    for first, second in pairs:
        pair = pair_of(averages, first, second)
        speed = pair.wind(averages.station)
        table = table_of(pair.residual(averages.station) / speed, speed, pair.heading)
        for rotor, partner, sign in ((first, second, -1.0), (second, first, 1.0)):
            there = averages.speed[partner]
            usual = table[cells(np.nan_to_num(there), heading)]
            expected = np.where(np.abs(usual) < CLEAN_CELL, there * (1.0 + sign * usual), np.nan)
            ice = silences.ice(averages, rotor, partner, expected)
            if ice is not None:
                found.append(ice)
    return silences.without_ice(averages, found), found


def _attributed(
    named: Named,
    healthy: Healthy | None,
    averages: Averages,
    pair: tuple[str, str],
    others: list[str],
) -> Named:
    """The same finding on the rotor that the other heights point at, if they do."""
    effect = named.term.effect.name
    if effect not in {"calibration_drift", "calibration_offset"}:
        return named
    mirror = [
        (t, b) for t, b in named.equal
        if t.effect.name == effect and t.instrument != named.term.instrument
        and (t.interval == ALWAYS) == (named.term.interval == ALWAYS)
    ]  # fmt: skip
    if not mirror:
        return named
    first, second = pair
    begin, end = named.term.interval
    inside = averages.elapsed >= begin
    if end is not None:
        inside &= averages.elapsed < end
    everything = np.ones(len(averages), dtype=bool)
    if named.term.interval != ALWAYS:
        before, rows = averages, (~inside, inside)
    elif healthy is not None:
        before, rows = healthy.averages, (np.ones(len(healthy.averages), dtype=bool), everything)
    else:
        return named
    evidence = likelihood_of_first(before, averages, first, second, others, rows)
    if evidence is None or abs(evidence) < DECISIVE:
        return named
    guilty = first if evidence > 0.0 else second
    rest = tuple((t, b) for t, b in named.equal if t.instrument == guilty)
    lost = tuple((t, b + abs(evidence)) for t, b in named.equal if t.instrument != guilty)
    if guilty == named.term.instrument:
        return replace(named, equal=rest, others=(*lost, *named.others))
    other = mirror[0][0]
    keep = tuple((t, b) for t, b in rest if t is not other)
    return replace(
        named, term=other, equal=keep, others=((named.term, abs(evidence)), *lost, *named.others)
    )


def _one_vane(
    findings: list[Finding], terms: list[Term], declined: list[str]
) -> tuple[list[Finding], list[Term]]:
    """Of vanes that all seem to have turned, the one that turned most; the rest are its echo."""
    turned = [f for f in findings if f.term.effect.name in {"vane_offset", "vane_eccentricity"}]
    if len(turned) < 2:
        return findings, terms
    largest = max(turned, key=lambda f: f.term.relative_size)
    declined.extend(
        f"{f.term.instrument}: {f.term.effect.name.replace('_', ' ')} is what the error of "
        f"{largest.term.instrument} makes of a comparison with it."
        for f in turned
        if f is not largest
    )
    gone = [f for f in turned if f is not largest]
    return (
        [f for f in findings if not any(f is g for g in gone)],
        [t for t in terms if not any(t is g.term for g in gone)],
    )
