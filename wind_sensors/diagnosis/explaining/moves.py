"""Moves that remove, replace or merge the terms of an explanation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter

from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.diagnosis.explaining.acceptance import (
    ACCEPTED_FURTHER_GAIN,
    ACCEPTED_GAIN,
    all_plausible,
    brought,
    inexact,
    inexactness,
    is_plausible,
    large_enough,
    may_be_form,
    may_join,
    needed_gain,
    only_makes_good,
    owed,
    plausible,
    times_beside,
    too_small,
)
from wind_sensors.diagnosis.explaining.bounds import without_spare
from wind_sensors.diagnosis.explaining.explanation import (
    Alternative,
    Judged,
    empty_fit,
    judged,
    penalised_cost,
    penalised_deviance,
    seen_in,
)
from wind_sensors.diagnosis.explaining.fitting import (
    ROUGHLY,
    Fit,
    cost_of,
    covariance_of,
    fit,
    without_term,
)
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_FURTHER_PARAMETER, Searcher
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, reached_by
from wind_sensors.diagnosis.healthy.whitening import Whitener

MERGE_CANDIDATES = 8
"""So many of the best effects of the screening are tried in the place of several, beside those that
did well alone: one that stands for two need not be the best of them."""

MERGE_FINALISTS = 3
"""So many of those that fit best there are judged in the noise that they leave, which takes a null
and a fit each."""

SWAP_CANDIDATES = 5
"""So many of the best effects of the screening are tried in the place of one, beside those that
competed with it: fewer, for it is done for each place."""

SWAP_FINALISTS = 4
"""So many of those that fit best there are judged in the noise that they leave."""

SWAP_GAIN = 1.0
"""What takes the place of another one must fit better by more than this: two that fit alike would
take turns for what fits leave undone (`ROUGHLY`)."""

LOOKS = (0.75, 0.88, 1.14, 1.33)
"""Sizes at which a fit is looked at again, in its own: a vane that turns round the other way, or a
pulse on the other side of a bin's border, leaves hollows in the cost that small steps stay in."""

MOST_LOOKS = 4
"""So often a fit is looked at again from where the last look led."""


def looked_around(searcher: Searcher, whitener: Whitener, current: Fit) -> Fit:
    """The fit from the best of the sizes around its own, while that is clearly better.

    Args:
        searcher: The search.
        whitener: The null.
        current: The explanation.
    """
    for _ in range(MOST_LOOKS):
        around = _around(current.terms)
        costs = in_parallel(
            partial(cost_of, whitener, searcher.station), around, searcher.workers
        )
        cost, terms = min(
            zip(costs, around, strict=True), key=itemgetter(0), default=(current.cost, ())
        )
        if cost > current.cost - ROUGHLY:
            return current
        current = fit(whitener, searcher.station, terms, searcher.bank.without)
    return current


def _around(terms: Sequence[Term]) -> list[tuple[Term, ...]]:
    """The terms with one parameter larger or smaller, or growing."""
    found: list[tuple[Term, ...]] = []
    for k, term in enumerate(terms):
        found.extend((*terms[:k], grown, *terms[k + 1 :]) for grown in term.growing)
        for parameter in term.effect.parameters:
            healthy, value = parameter.healthy, term.values[parameter.name]
            if healthy is None or value == healthy or not term.fits(parameter):
                continue
            for factor in LOOKS:
                moved = healthy + factor * (value - healthy)
                if parameter.low <= moved <= parameter.high:
                    other = replace(term, values={**term.values, parameter.name: moved})
                    found.append((*terms[:k], other, *terms[k + 1 :]))
    return found


def pruned(searcher: Searcher, whitener: Whitener, current: Fit) -> Fit:
    """The fit without terms that later ones made superfluous."""
    while len(current.terms) > 1:
        best = min(_without_each(searcher, whitener, current), key=penalised_cost)
        if penalised_cost(best) - penalised_cost(current) > ACCEPTED_GAIN and all(
            large_enough(t) for t in current.terms
        ):
            break
        current = best
    return current


def _without_each(searcher: Searcher, whitener: Whitener, current: Fit) -> list[Fit]:
    """Fits without the first term, without the second, and so on."""

    def without(k: int) -> Fit:
        part = without_term(current, k)
        return fit(
            whitener, searcher.station, part.terms, searcher.bank.without, known=part,
            least=ROUGHLY,
        )

    return in_parallel(without, range(len(current.terms)), searcher.workers)


def simplified(searcher: Searcher, whitener: Whitener, current: Fit) -> Fit:
    """The fit without what ran into its bounds, or became too small, when all were fitted together.

    Too small is also what may only make good the form of another.

    Of an effect that says too much (ice without weight) what it contains may stay.

    Args:
        searcher: The search.
        whitener: The null.
        current: The explanation.
    """
    nothing = empty_fit(whitener, searcher)
    while (
        (mends := _only_mends(searcher, whitener, current))
        or not all_plausible(current)
        or too_small(searcher, current, penalised_cost(nothing))
    ):
        fewer = searcher.refit_all(whitener, _simpler(searcher, current.terms, mends))
        sound = [f for f in fewer if f.terms and all_plausible(f)]
        sound = sound or [f for f in fewer if f.terms]
        if not sound:
            return nothing
        current = min(sound, key=penalised_cost)
        needed = min(needed_gain(nothing, term, searcher.baseline) for term in current.terms)
        if penalised_cost(nothing) - penalised_cost(current) < needed:
            return nothing
    return current


def spared(searcher: Searcher, whitener: Whitener, current: Fit) -> Fit:
    """The fit without those shares of its effects that the recording does not ask for.

    Args:
        searcher: The search.
        whitener: The null.
        current: The explanation.
    """
    if not any(p.spare for term in current.terms for p in term.effect.parameters):
        return current
    # What small differences change is in part chance, and would pass for knowledge.
    sure = replace(current, covariance=covariance_of(whitener, searcher.station, current))
    terms = without_spare(sure, PENALTY_PER_FURTHER_PARAMETER)
    if terms == current.terms:
        return current
    fewer = fit(whitener, searcher.station, terms, searcher.bank.without)
    return fewer if penalised_cost(fewer) < penalised_cost(current) else current


def _only_mends(
    searcher: Searcher, whitener: Whitener, current: Fit
) -> frozenset[tuple[str, str]]:
    """Terms that may only make good the form of larger ones, and bring less than these.

    A carrier's motion left in altogether has no more than two of its smallest sizes; what brings
    most of all mends nothing.

    Args:
        searcher: The search.
        whitener: The null.
        current: The explanation.
    """
    small = {t.key for t in current.terms if only_makes_good(searcher, t, current.terms)}
    if not small:
        return frozenset()
    fewer = _without_each(searcher, whitener, current)
    missed = {term.key: penalised_cost(f) for term, f in zip(current.terms, fewer, strict=True)}
    most = max(cost for key, cost in missed.items() if key not in small)
    return frozenset(
        term.key
        for term, f in zip(current.terms, fewer, strict=True)
        if term.key in small
        and missed[term.key] < most
        and may_be_form(searcher, whitener, f, current)
    )


def _simpler(
    searcher: Searcher, terms: Sequence[Term], mends: frozenset[tuple[str, str]]
) -> list[list[Term]]:
    """The terms without the implausible ones, and with what these contain in their place.

    Args:
        searcher: The search.
        terms: The terms.
        mends: Those that only make good the form of others.
    """
    sound = [term for term in terms if is_plausible(term) and term.key not in mends]
    out = [sound] if sound else []
    for term in terms:
        if is_plausible(term):
            continue
        for contained in sorted(term.effect.contains & searcher.effects.keys()):
            effect = searcher.effects[contained]
            values = {p.name: term.values[p.name] for p in effect.parameters
                      if p.name in term.values}
            if len(values) == len(effect.parameters):
                out.append([*sound, replace(term, effect=effect, values=values)])
    return out


def merged(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    singles: Sequence[Sequence[Term]],
    excluded: frozenset[str],
) -> Fit:
    """One effect in the place of several, where it does nearly as well.

    None takes the place of what the signals tell. One of the several themselves has to come as
    close as the others would have had to bring; another one may miss more.

    Args:
        searcher: The search.
        whitener: The null.
        current: The explanation by several effects.
        singles: Single effects that did well in the beginning.
        excluded: Names of effects that are not to be used.
    """
    if len(current.terms) < 2 or any(term.is_told for term in current.terms):
        return current
    instruments = [t.instrument for t in current.terms]
    crowded = {name for name in instruments if instruments.count(name) > 1}
    crowded |= {STATION, PLATFORM}
    nothing = empty_fit(whitener, searcher)
    known = {terms[0].key for terms in singles}
    more = [
        (starts[0],)
        for starts in searcher.single_candidates(whitener, nothing.vector, MERGE_CANDIDATES)
        if starts[0].key not in known and starts[0].effect.name not in excluded
    ]
    intervals = {ALWAYS, *(t.interval for t in current.terms)}
    candidates: dict[tuple[tuple[str, str], object], list[Term]] = {
        (terms[0].key, interval): [replace(terms[0], interval=interval)]
        for terms in (*more, *reversed(singles))
        if terms[0].instrument in crowded
        for interval in intervals
    }
    fits = searcher.refit_all(whitener, list(candidates.values()))
    promising = sorted((f for f in fits if plausible(f)), key=penalised_cost)[:MERGE_FINALISTS]
    ranked = [r for r in judged(searcher, promising) if plausible(r.fit)]
    if not ranked:
        return current
    alone = ranked[0]
    further = [t for t in current.terms if t.key != alone.fit.terms[0].key]
    if len(further) == len(current.terms):
        margin = ACCEPTED_FURTHER_GAIN + inexact(searcher, whitener, alone.fit, current)
    else:
        # As where the others were accepted: beside it, in whatever form it has. What passes follows
        # the swings of any form.
        times = max(times_beside(t) for t in further)
        form = whitener if times > 1.0 else searcher.whitener(alone.fit.simulated, alone.fit)
        margin = times * inexact(searcher, form, alone.fit, current)
    if alone.penalised_deviance < penalised_deviance(current, whitener) + margin:
        return alone.fit
    return current


def swapped(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    known: Sequence[Term] = (),
    excluded: frozenset[str] = frozenset(),
) -> tuple[Fit, tuple[Alternative, ...]]:
    """The explanation with single terms exchanged for better ones, and those that come close.

    A term goes if what is better in its place brings too little beside the others.

    Args:
        searcher: The search.
        whitener: The null.
        current: The explanation.
        known: Terms that did well before, to be tried beside what the screening suggests.
        excluded: Names of effects that are not to be used.
    """
    losers: list[Judged] = []
    leader = Judged(current, penalised_deviance(current, whitener), lambda: whitener)
    waiting = [term.key for term in current.terms]
    most = 2 * len(waiting)
    for key in waiting:  # grows while terms take the places of others
        k = [term.key for term in current.terms].index(key)
        replaced = current.terms[k]
        if replaced.is_told:
            continue
        part = without_term(current, k)
        others = part.terms
        without = fit(
            whitener, searcher.station, others, searcher.bank.without, iterations=3, known=part,
            least=ROUGHLY,
        )
        candidates = [
            starts
            for starts in _in_place_of(searcher, whitener, without, replaced, known)
            if may_join(starts[0], others) and starts[0].effect.name not in excluded
        ]
        rivals = [
            f for f in searcher.fit_all(whitener, without, candidates) if plausible(f)
        ]
        nearest = sorted(rivals, key=penalised_cost)[:SWAP_FINALISTS]
        ranked = [r for r in judged(searcher, nearest) if plausible(r.fit)]
        losers.extend(ranked)
        better = next(
            (r for r in ranked if _takes_over(searcher, whitener, r, leader, replaced)), None
        )
        if better is not None:
            losers.append(leader)
            if without.terms and not _brings_enough(searcher, without, better.fit):
                fewer = fit(
                    whitener, searcher.station, others, searcher.bank.without, known=without
                )
                losers = [r for r in losers if len(r.fit.terms) <= len(others)]
                leader = judged(searcher, [fewer])[0]
                current = leader.fit
                break
            leader = better
            current = leader.fit
            if len(waiting) < most:
                # What the new one is mistaken for has not been tried.
                waiting.append(current.terms[-1].key)
    behind = [
        Alternative(r.fit, _behind(whitener, r, leader)) for r in losers if r is not leader
    ]
    return current, tuple(sorted(behind, key=lambda a: a.behind))


def _brings_enough(searcher: Searcher, fewer: Fit, more: Fit) -> bool:
    """Whether the newest term brings what a further one has to beside those before.

    What explains best what another one stood for may be the form of the effects beside it; then
    nothing stands there.

    Args:
        searcher: The search.
        fewer, more: An explanation, and one with the term.
    """
    form = searcher.whitener(fewer.simulated, fewer)
    before, after = seen_in(form, fewer), seen_in(form, more)
    candidate = Judged(after, penalised_deviance(after, form), lambda: form)
    gain = brought(searcher, candidate, before, penalised_deviance(before, form))
    return gain >= inexactness(searcher, form, before, after)


def _in_common(whitener: Whitener, rival: Judged, leader: Judged) -> float:
    """By how much an explanation is better than another in one null."""
    leading, other = (seen_in(whitener, one.fit) for one in (leader, rival))
    return penalised_cost(leading) - penalised_cost(other)


def _behind(whitener: Whitener, rival: Judged, leader: Judged) -> float:
    """How far an explanation that did not take over is behind.

    What is better in its own noise did not do so because it is worse in the common one.

    Args:
        whitener: The common null.
        rival, leader: The two.
    """
    own = rival.penalised_deviance - leader.penalised_deviance
    return own if own > 0.0 else max(own, -_in_common(whitener, rival, leader))


def _takes_over(
    searcher: Searcher, whitener: Whitener, rival: Judged, leader: Judged, replaced: Term
) -> bool:
    """Whether an explanation takes over: it is better in its own noise and in a common one.

    In its own alone it gains from what it leaves unexplained and takes for noise. With more
    parameters it may follow what the simulation is inexact about; what the replaced one contains
    may be a little worse.

    Args:
        searcher: The search.
        whitener: The common null.
        rival, leader: The two.
        replaced: The leader's term in whose place the rival has its last.
    """
    needed = SWAP_GAIN - owed(replaced, rival.fit.terms[-1])
    if rival.fit.active > leader.fit.active:
        needed = max(needed, inexact(searcher, whitener, leader.fit, rival.fit))
    own = leader.penalised_deviance - rival.penalised_deviance
    return min(own, _in_common(whitener, rival, leader)) > needed


def _in_place_of(
    searcher: Searcher, whitener: Whitener, without: Fit, term: Term, known: Sequence[Term]
) -> list[list[Term]]:
    """Starting points of effects that may take the place of one, on the signals that it reaches.

    Args:
        searcher: The search.
        whitener: The null.
        without: The fit without it.
        term: It.
        known: Terms that did well before.
    """
    comparison, station = searcher.comparison, searcher.station
    reached = reached_by(comparison, station, [term])
    suggested = searcher.single_candidates(whitener, without.vector, SWAP_CANDIDATES)
    found = {starts[0].key: starts for starts in suggested}
    if without.terms:
        # Beside another effect the screening does not see what only shows in its full size.
        for starts in _mistaken_for(searcher, term):
            found.setdefault(starts[0].key, starts)
    for other in known:
        starts = found.setdefault(other.key, [])
        if all(other.interval != start.interval for start in starts):
            starts.append(other)
    return [
        starts
        for key, starts in found.items()
        if key != term.key and reached & reached_by(comparison, station, starts[:1])
    ]


def _mistaken_for(searcher: Searcher, term: Term) -> list[list[Term]]:
    """Starting points of the effects that one is mistaken for, in its interval."""
    starts: dict[tuple[str, str], list[Term]] = {}
    for template in searcher.bank.templates:
        effect = template.effect
        if effect.is_confusable_with(term.effect) and not effect.legible:
            start = Term(effect, template.instrument, dict(template.values), term.interval)
            starts.setdefault(start.key, []).append(start)
    return list(starts.values())
