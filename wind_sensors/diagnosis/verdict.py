"""The diagnosis of one recording: verdict, findings, what is left, what could have been seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import PLATFORM, Effect, entry_of, with_keys
from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.explaining.explanation import Alternative, Naming
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.guesses import (
    as_counted,
    guesses_of,
    hidden_by_a_dead_log,
)
from wind_sensors.diagnosis.explaining.naming import (
    name,
    named_alone,
    named_instead,
)
from wind_sensors.diagnosis.explaining.rounds import FirstRound, first_round
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.calibrated_range import is_calm
from wind_sensors.diagnosis.progress import Phases
from wind_sensors.diagnosis.proving.findings import Finding, Unexplained, equal_explanations
from wind_sensors.diagnosis.proving.judging import Judgement, judgement_of, with_suspicion
from wind_sensors.diagnosis.proving.rules import Verdict, with_silence
from wind_sensors.diagnosis.regions import Found, RegionBank
from wind_sensors.station.model import Angle, Rotor, Station
from wind_sensors.station.signals import Recording
from wind_sensors.station.silence import Silent, silent_instruments

TURNING_MISFIT = 0.1
"""The seconds in which vanes turn round apart are left out if they hold this share of the misfit
that the leading effect leaves of a vane."""

OTHER_SPEED = 0.1
"""The search runs again with the wind at the sensors that a named motion of the platform gives, if
that differs by this share: by the old one eddies have the wrong sizes."""


@dataclass(frozen=True)
class Diagnosis:
    """Everything that is said about one recording.

    Attributes:
        recording: Its name.
        verdict: In one word.
        calibrated: Whether healthy recordings stand behind the null.
        findings: Named effects; of an ambiguous set, all members.
        unexplained: What is left of what speaks, and why no name is given.
        smallest_detectable: By effect: the least size that would have been told from nought.
        station: The station with the named physics.
        baseline: What was normal.
        comparison, naming, simulated, corrected: For reports.
        objection: Why what fits best is not named; empty: no name was withdrawn.
        silent: Instruments of the station that say nothing in the whole recording.
    """

    recording: str
    verdict: Verdict
    calibrated: bool
    findings: tuple[Finding, ...]
    unexplained: Unexplained
    smallest_detectable: Mapping[str, SmallestSize]
    station: Station
    baseline: Baseline
    comparison: Comparison = field(repr=False)
    naming: Naming = field(repr=False)
    simulated: Simulated = field(repr=False)
    corrected: Simulated = field(repr=False)
    regions_before: tuple[Found, ...] = ()
    objection: str = ""
    bank: RegionBank | None = field(default=None, repr=False)
    silent: tuple[Silent, ...] = ()


def _explained(
    comparison: Comparison,
    search: Callable[[Comparison], Searcher],
    dead_log: Sequence[Term],
    phases: Phases,
) -> tuple[Searcher, Naming]:
    """The explanation of a recording, and the search that found it.

    Where it holds a motion of the platform that makes another wind at the sensors, it is the
    explanation of the recording seen in that wind.

    Args:
        comparison: The recording.
        search: Prepares the search of a comparison.
        dead_log: The motion that a log hides which does not go with the positions; empty: none.
        phases: Are told how much is done.
    """

    def seen_moving(
        terms: Sequence[Term], other_speed: float = OTHER_SPEED
    ) -> tuple[Searcher, Naming] | None:
        moved = _moving(comparison, terms, other_speed)
        if moved is None:
            return None
        again, anew = _first_look(moved, search)
        naming = name(again, anew, phases.run("fitting effects"))
        return (again, naming) if _motion(naming.fit.terms) else None

    found = seen_moving(dead_log, 0.0)
    if found is not None:
        return found
    searcher, first = _first_look(comparison, search)
    found = seen_moving(first.terms)
    if found is not None:
        return found
    naming = name(searcher, first, phases.run("fitting effects"))
    if _motion(naming.fit.terms) != _motion(first.terms):
        found = seen_moving(naming.fit.terms)
    return found or (searcher, naming)


def _first_look(
    comparison: Comparison, search: Callable[[Comparison], Searcher]
) -> tuple[Searcher, FirstRound]:
    """Single effects of a recording, without the seconds in which vanes turn round apart.

    Args:
        comparison: The recording.
        search: Prepares the search of a comparison.
    """
    searcher = search(comparison)
    first = first_round(searcher)
    if first.led is None:
        return searcher, first
    leader, losers = first.led
    following = _where_vanes_follow(comparison, leader.fit, losers)
    if following is None:
        return searcher, first
    searcher = search(following)
    return searcher, first_round(searcher)


def _where_vanes_follow(
    comparison: Comparison, leader: Fit, losers: Sequence[Alternative]
) -> Comparison | None:
    """The comparison without the seconds in which a vane turns round apart from one of its
    simulations; None: they hold too little of the misfit that the leader leaves."""
    explained = [leader.simulated, *(a.fit.simulated for a in losers)]
    follows = comparison.where_vanes_follow(explained)
    if comparison.misfit_outside(follows, leader.simulated) <= TURNING_MISFIT:
        return None
    return comparison.within(follows)


def _motion(terms: Sequence[Term]) -> list[Term]:
    return [term for term in terms if term.instrument == PLATFORM]


def _moving(comparison: Comparison, terms: Sequence[Term], other_speed: float) -> Comparison | None:
    """The comparison with eddies measured by the wind that a wrong motion of the platform hid.

    Args:
        comparison: The recording.
        terms: What explains it.
        other_speed: Share by which that wind differs at least.

    Returns:
        None: no motion is among it, or it makes no such difference.
    """
    motion = _motion(terms)
    if not motion:
        return None
    station = comparison.station
    moved = prepare(comparison.recording, station, comparison.place, planted(station, motion))
    change = np.abs(moved.speed - comparison.speed)
    return moved if np.mean(change) > other_speed * np.mean(comparison.speed) else None


def _to_plant_on(baseline: Baseline, named: Sequence[Term]) -> Station:
    """The station as its file describes it, with what named factors of inertia are relative to.

    What else commissioning found makes up for the reference as much as for the instrument.
    """
    station = baseline.original
    for term in named:
        if any(p.name == "inertia_factor" for p in term.effect.parameters):
            healthy = entry_of(baseline.station, term.instrument)
            assert isinstance(healthy, Rotor | Angle)
            keys = {"inertia_factor": healthy.inertia_factor}
            station = with_keys(station, term.instrument, keys)
    return station


def first_claim(
    searcher: Searcher, naming: Naming, judge: Callable[[Naming], Judgement]
) -> Judgement:
    """What is to be said of a recording, by the first explanation of it that may be claimed.

    Args:
        searcher: The search.
        naming: The explanation that leads.
        judge: Judges one.
    """
    judged = judge(naming)
    if judged.is_claim:
        return judged
    # A second effect that does not hold must not take the first one along.
    alone = named_alone(searcher, naming)
    if alone is not None:
        single = judge(alone)
        if single.is_claim:
            return single
    if judged.contradicted:
        for _, rival in equal_explanations(naming):
            instead = judge(named_instead(searcher, naming, rival))
            if instead.is_claim:
                return instead
    return judged


def diagnose(
    recording: Recording,
    baseline: Baseline,
    effects: Mapping[str, Effect] | None = None,
    workers: int = 1,
    progress: Callable[[str, float], None] | None = None,
    with_proof: bool = True,
) -> Diagnosis:
    """Find the physics that a station file leaves out.

    Args:
        recording: With a reference wind.
        baseline: What is normal for the station.
        effects: Catalogue; None: all known effects.
        workers: Processes; see `wind_sensors.processes` before asking for more than one.
        progress: Called with a phase and the share of it that is done.
        with_proof: Fit and score held-out blocks.

    Raises:
        UserError: The recording cannot be compared with its station.
    """
    known = catalogue() if effects is None else effects
    phases = Phases(progress)
    baseline = baseline.for_station(recording.station)
    comparison = prepare(recording, baseline.station, baseline.place)
    if is_calm(comparison):
        baseline = baseline.in_calm()

    def search(seen: Comparison) -> Searcher:
        guesses = {
            key: terms
            for key, terms in guesses_of(seen, baseline.station).items()
            if key[0] in known
        }
        return searcher_of(
            as_counted(seen, guesses), baseline, known, guesses, workers,
            phases.run("simulating the catalogue"),
        )

    dead_log = [term for term in hidden_by_a_dead_log(comparison) if term.effect.name in known]
    searcher, naming = _explained(comparison, search, dead_log, phases)
    phases.done()
    comparison = searcher.comparison
    judged = first_claim(
        searcher,
        naming,
        lambda each: judgement_of(searcher, each, baseline, workers, phases, with_proof),
    )
    phases.done()
    judged = with_suspicion(judged, baseline.station, workers)
    naming = judged.naming
    named = naming.fit.terms if judged.is_claim else ()
    station = planted(_to_plant_on(baseline, named), named)
    remainder = judged.remainder
    silent = silent_instruments(recording, baseline.station)
    return Diagnosis(
        recording=recording.name,
        verdict=with_silence(judged.verdict, silent),
        calibrated=baseline.calibrated,
        findings=judged.findings,
        unexplained=Unexplained(
            remainder.p, remainder.share, judged.regions, judged.words(baseline)
        ),
        smallest_detectable={name: each.size for name, each in judged.detectable.items()},
        station=station,
        baseline=baseline,
        comparison=comparison,
        naming=naming,
        simulated=searcher.bank.without,
        corrected=naming.fit.simulated if named else searcher.bank.without,
        regions_before=judged.regions_before,
        objection=judged.objection,
        bank=judged.bank,
        silent=silent,
    )
