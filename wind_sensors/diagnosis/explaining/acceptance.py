"""What an explanation must bring to be accepted, alone or beside another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import OF_EDDIES
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.diagnosis.explaining.bounds import run_away
from wind_sensors.diagnosis.explaining.explanation import (
    CLEARLY_BETTER,
    Judged,
    empty_fit,
    penalised_cost,
)
from wind_sensors.diagnosis.explaining.fitting import ROUGHLY, Fit, fit
from wind_sensors.diagnosis.explaining.moments import (
    is_its_moment,
    is_late_again,
    is_steady,
    single_event,
)
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, reached_by
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.calibrated_range import is_calm
from wind_sensors.diagnosis.healthy.reference_lag import is_a_way_of_the_wind
from wind_sensors.diagnosis.healthy.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

ACCEPTED_GAIN = 12.0
"""Drop of the cost beyond its parameters that a name needs; healthy recordings stay below."""

LOUDEST_FACTOR = 1.2
"""A name needs this many times what the loudest of the healthy recordings promises."""

PASSING_GAIN = 14.0
"""What an effect must bring that begins or ends inside the record, beyond the cost of its edges."""

PASSING_SMOOTH_GAIN = 16.0
"""The same if it smooths: for some minutes the reference sees other eddies than the instrument."""

PASSING_FORM_GAIN = 40.0
"""The same with several parameters: in a few minutes of wind from a few directions they fit many a
wandering of the reference with sizes that undo each other (33 on a healthy day)."""

PASSING_FURTHER = 2.0
"""So many times as much beside another effect: what that leaves is no healthy day's."""

MANY_FORMS = 3
"""So many fitted parameters that have a healthy value count as several, whichever of them says how
large the effect is: a lean makes of an imbalance what the wind's wandering needs."""

ACCEPTED_ELSEWHERE_GAIN = 18.0
"""The same as `ACCEPTED_GAIN` for a second effect on signals that the first does not reach: what
that leaves is no healthy day's."""

LEAST_BESIDE_GAIN = 24.0
"""The same for a second effect on signals that the first reaches, where its form errs, too."""

FURTHER_SHARE = 0.1
"""What the simulation's form may err by, as a share of the gain so far: a further effect on the
same signals must bring more than that."""

ACCEPTED_FURTHER_GAIN = 20.0
"""It is never taken to err by less: of a small gain the share is less than what chance brings."""

LARGEST_INEXACTNESS = 1000.0
"""Nor by more, unless `LEAST_SHARE_BESIDE` is more."""

FURTHER_EXACT_SHARE = 0.05
"""`FURTHER_SHARE` where the forms of the effects so far are certain: what errs is the reference."""

LARGEST_EXACT_INEXACTNESS = 150.0
"""`LARGEST_INEXACTNESS` where they are certain, unless `LEAST_EXACT_SHARE_BESIDE` is more."""

ALIKE = 0.05
"""Further effects act in a part of what is compared (series, bands, statistics, activity) with
this share of all that they change, in squares."""

TRACE = 0.01
"""An effect acts where it changes a signal by more than this share of its largest change: filters
and inertia let any change die out slowly."""

ROUNDING = 1e-6
"""And by more than this [m/s]: bounces that are told from edges leave the rate as it is, but for
its last digits."""

PASSING_BESIDE = 3.0
"""So many times more, if it begins or ends inside the record: effects grow and fade themselves."""

LEAST_SHARE_BESIDE = 0.02
"""What brings less than this share of the gain so far is the form of what brought that, however
much that is."""

LEAST_EXACT_SHARE_BESIDE = 0.005
"""The same where that form is certain."""

SMALLEST_SIZE = 0.7
"""In units of the smallest size worth reporting."""

SMALLEST_SURE = 0.35
"""The same of the only effect, if it always holds and brings `SURE_ALONE_GAIN`: half as large, for
another name would have to take its place."""

SURE_ALONE_GAIN = 50.0
"""Gain of an effect that nobody doubts, however small it is."""

SMALLEST_TOLD = 0.4
"""The same of what the signals tell without a fit: left out, it would be a riddle."""

SMALLEST_BESIDE = 1.9
"""The same beside a larger effect on the same signals, whose form a small one may make good."""

EDDIES_AGAINST = 10.0
"""What smooths a signal shows in the power of its eddies: there it may not cost more than this,
whatever the course of the signal gains. True effects bring more than nothing there; a delay does
not show."""

STALL_SPEED = 4.5
"""Up to this wind speed [m/s] a sticking bearing may hold a rotor."""


def needed_gain(current: Fit, further: Term, baseline: Baseline) -> float:
    """Gain that a further term has to bring.

    Args:
        current: The explanation so far.
        further: The term.
        baseline: Knows how loud healthy days are.
    """
    least = ACCEPTED_ELSEWHERE_GAIN if current.terms else ACCEPTED_GAIN
    loudness = baseline.loudness(further.instrument, further.effect)
    return max(least, LOUDEST_FACTOR * loudness)


def passing_gain(term: Term, beside: bool = False) -> float:
    """Gain that a term has to bring for its beginning or end inside the record; else nothing.

    Args:
        term: The term.
        beside: Whether there are others.
    """
    if term.interval == ALWAYS or term.effect.legible:
        return 0.0
    times = PASSING_FURTHER if beside else 1.0
    effect = term.effect
    graded = sum(p.healthy is not None and p.minimum > 0.0 for p in effect.parameters)
    shaping = sum(p.healthy is not None and p.value_from == "fit" for p in effect.parameters)
    if graded > 1 or shaping >= MANY_FORMS:
        return times * PASSING_FORM_GAIN
    return times * (PASSING_SMOOTH_GAIN if term.effect.smooths else PASSING_GAIN)


def brought(searcher: Searcher, candidate: Judged, current: Fit, before_deviance: float) -> float:
    """What a candidate gains over the terms before: in its own null and in likelihood, the less.

    In its own null alone a flexible effect gains from the noise that it has fitted away. What one
    event in the record brings does not count.
    """
    newest = candidate.fit.terms[-1]
    comparison = searcher.comparison
    if not plausible(candidate.fit):
        return -np.inf
    if ruled_out(comparison, searcher.station, candidate.fit.terms):
        return -np.inf
    if is_a_way_of_the_wind(comparison, newest, current.simulated):
        return -np.inf
    before = _before(searcher, candidate, current)
    if not is_steady(comparison, before, candidate.fit):
        return -np.inf
    if not is_late_again(comparison, before, candidate.fit):
        return -np.inf
    if too_small(searcher, candidate.fit, penalised_cost(before)):
        return -np.inf
    if _calms_too_much(candidate, before):
        return -np.inf
    gain = penalised_cost(before) - penalised_cost(candidate.fit)
    gain -= single_event(comparison, before, candidate.fit)
    return min(gain, before_deviance - candidate.penalised_deviance)


def calms_too_much(searcher: Searcher, candidate: Judged, current: Fit) -> bool:
    """Whether a candidate's newest term takes eddies away that the signals have.

    Args:
        searcher: The search.
        candidate: An explanation.
        current: The terms before.
    """
    return _calms_too_much(candidate, _before(searcher, candidate, current))


def _calms_too_much(candidate: Judged, before: Fit) -> bool:
    effect = candidate.fit.terms[-1].effect
    calming = effect.smooths and effect.entrance != "clock"
    return calming and (
        gained_by_eddies(candidate.whitener, before, candidate.fit) < -EDDIES_AGAINST
    )


def _before(searcher: Searcher, candidate: Judged, current: Fit) -> Fit:
    """The terms before a candidate's newest one, fitted in its null."""
    whitener = candidate.whitener
    if not current.terms:
        return empty_fit(whitener, searcher)
    return fit(whitener, searcher.station, current.terms, searcher.bank.without, least=ROUGHLY)


def gained_by_eddies(whitener: Whitener, before: Fit, after: Fit) -> float:
    """Drop of the cost in the power of eddies: that of the record, and that of its half-minutes.

    Seen in the noise alone: what healthy days allow of other effects would carry what the course of
    a signal gains over to them.

    Args:
        whitener: A null.
        before, after: Two explanations.
    """
    drop = (
        whitener.noise_whitened(before.simulated) ** 2
        - whitener.noise_whitened(after.simulated) ** 2
    )
    return float(drop[np.isin(whitener.comparison.kind_of_each, OF_EDDIES)].sum())


def inexactness(searcher: Searcher, whitener: Whitener, current: Fit, longer: Fit) -> float:
    """What a further term must bring if it acts on signals that the terms so far change."""
    further = longer.terms[-1]
    if not acts_beside(searcher, further, current.terms) or further.is_told:
        return 0.0
    small = further.relative_size < SMALLEST_BESIDE
    if small and may_be_form(searcher, searcher.whitener(longer.simulated), current, longer):
        # Judged as at the end, where the forms of the others are not taken for granted.
        return np.inf
    if is_its_moment(searcher, current, further):
        return np.inf
    own = times_beside(further) * inexact(searcher, whitener, current, longer)
    return max(own, LEAST_BESIDE_GAIN) if own > 0.0 else 0.0


def may_be_form(searcher: Searcher, whitener: Whitener, fewer: Fit, more: Fit) -> bool:
    """Whether what further terms bring may be the form of those before.

    Not if they bring more than these do in the kinds of comparison in which the further ones act:
    what moves a rotor's mean is not the form of what a damaged cup does within its turns.

    Args:
        searcher: The search.
        whitener: A null.
        fewer: An explanation.
        more: One with further effects.
    """
    before, after = whitener.of(fewer.simulated), whitener.of(more.simulated)
    brings = float(before @ before - after @ after)
    return brings <= gained_alike(searcher, whitener, fewer, more)


def acts_beside(searcher: Searcher, further: Term, terms: Sequence[Term]) -> bool:
    """Whether a term acts on signals that others change.

    Args:
        searcher: The search.
        further: The term.
        terms: The others.
    """
    reached = reached_by(searcher.comparison, searcher.station, terms)
    return bool(terms) and further.instrument in (reached | {STATION, PLATFORM})


def only_makes_good(searcher: Searcher, term: Term, terms: Sequence[Term]) -> bool:
    """Whether one of several terms is so small that the form of a larger one may be all it mends.

    Args:
        searcher: The search.
        term: The term.
        terms: All of them.
    """
    larger = [t for t in terms if t.relative_size > term.relative_size]
    small = term.relative_size < SMALLEST_BESIDE and not term.is_told
    return small and acts_beside(searcher, term, larger)


def times_beside(further: Term) -> float:
    """How many times the inexactness of other effects a further one on the same signals brings."""
    passing = further.interval != ALWAYS and not further.effect.legible
    return PASSING_BESIDE if passing else 1.0


def inexact(searcher: Searcher, whitener: Whitener, fewer: Fit, more: Fit) -> float:
    """What the simulation's own inexactness is worth where further effects act.

    Args:
        searcher: The search.
        whitener: A null.
        fewer: An explanation.
        more: One with further effects.
    """
    gained = gained_alike(searcher, whitener, fewer, more)
    if all(term.has_certain_form for term in fewer.terms):
        share, largest = FURTHER_EXACT_SHARE, LARGEST_EXACT_INEXACTNESS
        least = LEAST_EXACT_SHARE_BESIDE
    else:
        share, largest, least = FURTHER_SHARE, LARGEST_INEXACTNESS, LEAST_SHARE_BESIDE
    most = max(largest, least * gained)
    own = min(max(share * gained, ACCEPTED_FURTHER_GAIN), most)
    return own * overlap(searcher, fewer, more)


def gained_alike(searcher: Searcher, whitener: Whitener, fewer: Fit, more: Fit) -> float:
    """What an explanation gains in the kinds of comparison in which further effects act.

    Slots of the wrong width are seen in the intervals of pulses, with certainty; what moves the
    mean of the same rotor has nothing to do with their form. Of what holds and lets go, when it
    does so is noise to an explanation with it, and may be all that it explains: judged without.

    Args:
        searcher: The search.
        whitener: A null.
        fewer: An explanation.
        more: One with further effects.
    """
    if any(term.sticks for term in fewer.terms):
        whitener = searcher.whitener(searcher.bank.without)
    nothing = whitener.of(searcher.bank.without)
    before, after = whitener.of(fewer.simulated), whitener.of(more.simulated)
    part = searcher.comparison.part_of_each
    gained = np.bincount(part, nothing**2 - before**2)
    changed = np.bincount(part, (after - before) ** 2)
    alike = changed >= ALIKE * changed.sum()
    return float(np.maximum(gained[alike], 0.0).sum())


def overlap(searcher: Searcher, fewer: Fit, more: Fit) -> float:
    """Share of what further effects change in the parts of the record where the others act.

    A wake of another form slows the wind in another way behind the mast, not on the other side.

    Args:
        searcher: The search.
        fewer: An explanation.
        more: One with further effects.
    """
    comparison = searcher.comparison
    known = {term.key for term in fewer.terms}
    further = [term for term in more.terms if term.key not in known]
    reached = reached_by(comparison, searcher.station, further)
    there = everywhere = 0.0
    for channel in comparison.channels:
        if channel.instrument not in reached:
            continue
        name = channel.name
        acts = np.abs(fewer.simulated.series[name] - searcher.bank.without.series[name])
        changed = (more.simulated.series[name] - fewer.simulated.series[name]) ** 2
        least = max(TRACE * float(acts.max(initial=0.0)), ROUNDING)
        there += float(np.sum(changed[acts > least]))
        everywhere += float(np.sum(changed))
    return there / everywhere if everywhere > 0.0 else 1.0


def is_a_stall(searcher: Searcher, current: Fit, start: Term) -> bool:
    """Whether a rotor's silence is what a braked bearing does in the wind of that time.

    A bearing that sticks lets go later than the simulated friction does.
    """
    braked = any(t.effect.brakes for t in current.terms)
    if not start.effect.silences or not braked:
        return False
    comparison = searcher.comparison
    for channel in comparison.channels:
        if channel.instrument == start.instrument and channel.kind == "rotor_rate":
            at = comparison.grid.centres + comparison.drive.elapsed
            inside = (at > start.values["start"]) & (at < start.values["stop"])
            if not inside.any():
                return False
            return float(np.median(comparison.speed[inside])) < STALL_SPEED
    return False


def may_join(further: Term, terms: Sequence[Term]) -> bool:
    """Whether a term says something that others do not say already."""
    return all(
        further.key != term.key
        and not (
            further.instrument == term.instrument
            and (
                further.effect.name in term.effect.contains
                or term.effect.name in further.effect.contains
            )
        )
        for term in terms
    )


def owed(term: Term, other: Term) -> float:
    """What a term must bring more than another one that it contains; nought if it does not.

    A damaged cup that pulls as the others do is a rotor of another calibration.
    """
    contains = term.instrument == other.instrument and other.effect.name in term.effect.contains
    return CLEARLY_BETTER if contains else 0.0


def plausible(candidate: Fit) -> bool:
    """Whether the newest term is large enough to matter and its parameters are determined.

    A search that ran into the bounds of a parameter has found the wrong effect.
    """
    return is_plausible(candidate.terms[-1], least_size(candidate.terms))


def all_plausible(candidate: Fit) -> bool:
    """Whether all terms are."""
    least = least_size(candidate.terms)
    return all(is_plausible(term, least) for term in candidate.terms)


def least_size(terms: Sequence[Term]) -> float:
    """How large terms have to be, in units of the smallest size worth reporting."""
    alone = len(terms) == 1 and terms[0].interval == ALWAYS
    return SMALLEST_SURE if alone else SMALLEST_SIZE


def too_small(searcher: Searcher, candidate: Fit, nothing: float) -> bool:
    """Whether the only term is small, and not so sure that it counts all the same.

    In a calm nothing is sure: rotors near their starting speed do what no simulation does.

    Args:
        searcher: The search.
        candidate: The explanation.
        nothing: Cost beyond parameters without any effect, in the same null.
    """
    if len(candidate.terms) != 1 or large_enough(candidate.terms[0]):
        return False
    return is_calm(searcher.comparison) or nothing - penalised_cost(candidate) < SURE_ALONE_GAIN


def large_enough(term: Term, least: float = SMALLEST_SIZE) -> bool:
    """Whether a term matters."""
    return term.relative_size >= (SMALLEST_TOLD if term.is_told else least)


def is_plausible(term: Term, least: float = SMALLEST_SIZE) -> bool:
    """Whether one term is.

    Args:
        term: The term.
        least: Size that it must have, in units of the smallest worth reporting.
    """
    possible = term.relative_size <= term.effect.largest and not run_away(term)
    return possible and large_enough(term, least)
