"""The diagnosis of a recording of means, from the first look to the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.means import panels, silences
from wind_sensors.diagnosis.means.averages import Averages
from wind_sensors.diagnosis.means.bench import bench_of
from wind_sensors.diagnosis.means.corrected import corrected, uncorrected
from wind_sensors.diagnosis.means.culprit import attributed
from wind_sensors.diagnosis.means.findings import (
    PairWork,
    finding_of_ice,
    finding_of_silence,
    findings_of_pair,
    findings_of_vane,
    last_set,
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
from wind_sensors.diagnosis.means.search import is_normal, search
from wind_sensors.diagnosis.means.vanes import (
    vane_bench,
    vane_effects,
    vane_standing,
)
from wind_sensors.diagnosis.outcome import Outcome, Panel
from wind_sensors.diagnosis.proving.findings import Finding, Unexplained
from wind_sensors.diagnosis.proving.rules import verdict_on_findings
from wind_sensors.errors import UserError
from wind_sensors.station.signals import Recording, Series

Progress = Callable[[str, float], None]
PairNames = tuple[str, str]

CLEAN_CELL = 0.04
"""Ice is not looked for in directions in which a rotor's mount changes the wind by more."""

REMAINDER_SHARE = 0.35
"""Share of a pair's misfit above which a remainder makes the cause unknown."""

MOST_OF_A_VANE = 2
"""Effects that are looked for on a vane: it can be turned, and its disc eccentric."""

NOTHING_LEFT = Unexplained(1.0, 0.0, (), "")


@dataclass(frozen=True)
class _Told:
    """What one comparison says, that of a pair or that of a vane with the others.

    Attributes:
        findings: What is named.
        declined: What was seen and not claimed, and why.
        shown: Figures.
        smallest: By effect and pair: the least size that would have shown.
        left: What is left of a pair.
    """

    findings: Sequence[Finding] = ()
    declined: Sequence[str] = ()
    shown: Sequence[Panel] = ()
    smallest: Mapping[str, SmallestSize] = field(default_factory=dict)
    left: Unexplained = NOTHING_LEFT


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
    report = progress or (lambda phase, share: None)
    averages, silent = cleaned(recording, deviations)
    findings: list[Finding] = [finding_of_silence(averages, s) for s in silent]
    declined: list[str] = []
    if healthy is not None:
        healthy, averages = healthy.of_same_vanes(averages)
        declined += healthy.reservations(averages)
    pairs, notes = _usable_pairs(recording.name, averages, healthy)
    declined += notes
    averages, icy = _without_ice(averages, pairs)
    findings += [finding_of_ice(averages, i) for i in icy]
    told = []
    for pair in pairs:
        told.append(_of_pair(pair, pairs, averages, healthy, last_set(findings), report))
        findings += told[-1].findings
    vanes = _of_vanes(averages, healthy, last_set(findings), report)
    findings += vanes.findings
    for each in (*told, vanes):
        declined += each.declined
    left = max((NOTHING_LEFT, *(each.left for each in told)), key=lambda u: u.share)
    return Outcome(
        recording=recording.name,
        verdict=verdict_on_findings(tuple(findings), left, REMAINDER_SHARE),
        calibrated=healthy is not None,
        findings=tuple(findings),
        unexplained=left,
        smallest_detectable={key: s for each in told for key, s in each.smallest.items()},
        station=corrected(recording.station, findings),
        start=recording.start,
        length=(recording.stop - recording.start) * 1e-9,
        reference="borrowed: the rotors of a pair and the vanes are each other's reference",
        declined=(*declined, *uncorrected(findings)),
        panels=tuple(panel for each in (*told, vanes) for panel in each.shown),
        healthy=healthy.names if healthy is not None else (),
    )


def _usable_pairs(
    recording: str, averages: Averages, healthy: Healthy | None
) -> tuple[list[PairNames], list[str]]:
    """Pairs with enough common means, in healthy recordings too, and a word on the others.

    Raises:
        UserError: There is none.
    """
    known = pairs_of(averages) if healthy is None else healthy.pairs
    both = (averages,) if healthy is None else (averages, healthy.averages)
    usable = [pair for pair in known if all(is_comparable(a, *pair) for a in both)]
    if not usable:
        raise UserError(
            "no two rotors agree well enough to be each other's reference.",
            recording,
            "Two rotors at one height are needed.",
        )
    return usable, [
        f"{' and '.join(pair)}: too few common means to compare them."
        for pair in known
        if pair not in usable
    ]


def _of_pair(
    names: PairNames,
    pairs: Sequence[PairNames],
    averages: Averages,
    healthy: Healthy | None,
    number: int,
    report: Progress,
) -> _Told:
    """What a pair says.

    Args:
        names: The two rotors.
        pairs: All pairs; the rotors of the others tell which of the two changed.
        averages: Means of the recording.
        healthy: What is normal; None: the certificates.
        number: Of the last ambiguous set.
        report: Called with a phase and the share of it that is done.
    """
    station = averages.station
    phase = " and ".join(names)
    report(phase, 0.0)
    standing = standing_of(healthy.averages, *names) if healthy is not None else None
    pair = pair_of(averages, *names, standing)
    bench = bench_of(pair, station)
    normal = None
    if healthy is not None:
        normal = is_normal(bench_of(pair_of(healthy.averages, *names, standing), station))
    warm = warming(pair.averages.temperature)
    explained = search(
        bench, rotor_effects(), names, partial(report, phase), normal=normal,
        wider=None if warm is None else {warm.name: warm},
    )
    others = [rotor for p in pairs for rotor in p if rotor not in names]
    named = tuple(attributed(n, healthy, averages, names, others) for n in explained.named)
    # Values are those of the fit of all terms together; what moved to the other rotor has its own.
    terms = tuple(
        n.term if n.term.instrument != t.instrument else t
        for n, t in zip(named, explained.terms, strict=True)
    )
    work = PairWork(pair, bench, explained, named, terms, intervals(bench, terms))
    findings, declined, left = findings_of_pair(work, number)
    shown = panels.of_pair(pair, station, planted(station, explained.terms))
    report(phase, 1.0)
    return _Told(findings, declined, shown, work.smallest(), left)


def _of_vanes(
    averages: Averages, healthy: Healthy | None, number: int, report: Progress
) -> _Told:
    """What the vanes say about each other; arguments as in `_of_pair`."""
    findings: list[Finding] = []
    declined: list[str] = []
    shown: list[Panel] = []
    decisive = len(averages.heading) > 2
    for vane in averages.heading:
        phase = f"{vane} and the other vanes"
        report(phase, 0.0)
        told = _of_vane(
            vane, averages, healthy, None if decisive else number, partial(report, phase)
        )
        findings += told.findings
        declined += told.declined
        shown += told.shown
        report(phase, 1.0)
    if decisive:
        findings, notes = _one_vane(findings)
        declined += notes
    return _Told(findings, declined, shown)


def _of_vane(
    vane: str,
    averages: Averages,
    healthy: Healthy | None,
    number: int | None,
    report: Callable[[float], None],
) -> _Told:
    """What the others say about a vane; `number` as in `findings_of_vane`."""
    station = averages.station
    standing = None
    if healthy is not None:
        standing = vane_standing(healthy.averages, station, vane)
        if standing is None:
            return _Told()
    found = vane_bench(averages, station, vane, standing)
    if found is None:
        note = f"{vane}: no other vane works long enough to compare it with."
        return _Told(declined=[note])
    effects = vane_effects(healthy is not None)
    # Without healthy recordings the wind's own turning with height is fitted along.
    turning = Term(effects["vane_offset"], vane, {"offset": 0.1})
    explained = search(
        found.bench, effects, (vane,), report, MOST_OF_A_VANE,
        (turning,) if healthy is None else (),
    )
    findings, declined = findings_of_vane(averages, found, explained, standing, number)
    after = planted(station, explained.terms)
    return _Told(findings, declined, [panels.of_vane(found, station, after)])


def _without_ice(
    averages: Averages, pairs: Sequence[tuple[str, str]]
) -> tuple[Averages, list[silences.Ice]]:
    """The means without icy hours, and the ice of each rotor."""
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


def _one_vane(findings: Sequence[Finding]) -> tuple[list[Finding], list[str]]:
    """Of vanes that all seem to have turned, the one that turned most; the rest are its echo."""
    if len(findings) < 2:
        return list(findings), []
    largest = max(findings, key=lambda f: f.term.relative_size)
    return [largest], [
        f"{f.term.instrument}: {f.term.effect.name.replace('_', ' ')} is what the error of "
        f"{largest.term.instrument} makes of a comparison with it."
        for f in findings
        if f is not largest
    ]
