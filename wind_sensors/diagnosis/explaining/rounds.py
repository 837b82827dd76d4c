"""One round of the search: single effects fitted, alone or beside one, and which of them leads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.diagnosis.explaining.acceptance import (
    calms_too_much,
    may_join,
    needed_gain,
    plausible,
    too_small,
)
from wind_sensors.diagnosis.explaining.beside import Beside
from wind_sensors.diagnosis.explaining.explanation import (
    Alternative,
    Judged,
    deviance_in_own_noise,
    empty_fit,
    judged,
    penalised_cost,
    penalised_deviance,
)
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.guesses import BLIND_IN_PARTS
from wind_sensors.diagnosis.explaining.leading import (
    held_throughout,
    leader_of,
    not_told,
)
from wind_sensors.diagnosis.explaining.onsets import (
    in_a_part,
    moves_a_clock,
    refined_interval,
    window_starts,
)
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, reached_by
from wind_sensors.diagnosis.healthy.whitening import Whitener

FIRST_CANDIDATES = 9
"""So many of the best effects of the screening are fitted alone."""

LATER_WIDE = 2
"""So many of the effects that turn or carry the whole wind are tried from the best moment on."""

FINALISTS = 7
"""So many of the best fits, in the common noise and in their own, are judged in the noise that they
leave, with derivatives carried along."""

CONTENDERS = 5
"""So many of the best of these are judged once more, with derivatives of their own."""

FAR_BEHIND = 0.8
"""Fits that miss more than this share of the leader's gain do not compete with it."""

WORTH_JUDGING = 0.5
"""Share of the needed gain that a fit must bring before the noise is judged again."""


@dataclass(frozen=True)
class FirstRound:
    """Single effects, each fitted, and the one that leads.

    Attributes:
        whitener: The null without any effect.
        singles: Fits in it.
        led: The leader and those that lost against it; None: none brings enough.
    """

    whitener: Whitener
    singles: Sequence[Fit]
    led: tuple[Judged, tuple[Alternative, ...]] | None

    @property
    def terms(self) -> tuple[Term, ...]:
        """The leading effect, or nothing."""
        return () if self.led is None else self.led[0].fit.terms


def first_round(searcher: Searcher) -> FirstRound:
    """Fit single effects and tell which leads."""
    whitener = searcher.whitener(searcher.bank.without)
    singles = _single_fits(searcher, whitener)
    return FirstRound(whitener, singles, best_single(searcher, whitener, singles, frozenset()))


def best_single(
    searcher: Searcher, whitener: Whitener, singles: Sequence[Fit], excluded: frozenset[str]
) -> tuple[Judged, tuple[Alternative, ...]] | None:
    """The single effect that leads, and those that lost; None: none brings enough.

    Args:
        searcher: The search.
        whitener: The null without any effect.
        singles: Fits of single effects in it.
        excluded: Names of effects that are not to be used.
    """
    allowed = [f for f in singles if f.terms[0].effect.name not in excluded]
    return _one_more(searcher, whitener, empty_fit(whitener, searcher), allowed, None)


def best_beside(
    beside: Beside, excluded: frozenset[str]
) -> tuple[Judged, tuple[Alternative, ...]] | None:
    """The best effect beside those so far; None: none brings enough.

    What is left is judged as what the named effects, in another form, do not explain.

    Args:
        beside: What is tried.
        excluded: Names of effects that are not to be used.
    """
    fits = beside.fits(excluded)
    return _one_more(beside.searcher, beside.whitener, beside.current, fits, beside.first)


def _one_more(
    searcher: Searcher, whitener: Whitener, current: Fit, fits: Sequence[Fit], named: Fit | None
) -> tuple[Judged, tuple[Alternative, ...]] | None:
    """The best explanation with one effect more, and those that lost; None: none brings enough.

    Args:
        searcher: The search.
        whitener: The null of the terms so far.
        current: The terms so far.
        fits: With one more each.
        named: The terms so far; None: there are none.
    """
    so_far = penalised_cost(current)
    sound = [f for f in fits if plausible(f) and not too_small(searcher, f, so_far)]
    pool = _finalists(searcher, whitener, current, sound, named)
    if not pool:
        return None
    ranked = [r for r in judged(searcher, pool, named, roughly=True) if plausible(r.fit)]
    ranked.sort(key=not_told)
    ranked = judged(searcher, [r.fit for r in ranked[:CONTENDERS]], named)
    ranked = [r for r in ranked if plausible(r.fit)]
    ranked += _where_they_calm(searcher, current, ranked, named)
    ranked = _with_sharp_intervals(searcher, whitener, ranked, named)
    best = leader_of(searcher, whitener, current, ranked)
    if best is None:
        return None
    gain = penalised_deviance(current, whitener) - best.penalised_deviance
    leader = held_throughout(searcher, best, named, gain, ranked)
    losers = tuple(
        Alternative(r.fit, r.penalised_deviance - leader.penalised_deviance)
        for r in ranked
        if r is not best
    )
    return leader, losers


def _single_fits(searcher: Searcher, whitener: Whitener) -> list[Fit]:
    """Fits of the most promising effects, each alone."""
    vector = whitener.of(searcher.bank.without)
    return searcher.fit_all(
        whitener,
        None,
        [
            *searcher.single_candidates(whitener, vector, FIRST_CANDIDATES, blind=True),
            *window_starts(searcher, whitener, vector, set()),
        ],
    )


def _finalists(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    fits: Sequence[Fit],
    named: Fit | None,
) -> list[Fit]:
    """The fits that may win, in the null of the terms so far or in that which each leaves itself.

    In the former, noise and coherence were judged with the mismatch still in them.

    Args:
        searcher: The search.
        whitener: The null of the terms so far.
        current: The terms so far.
        fits: With one term more each.
        named: The terms so far; None: there are none.
    """
    found: dict[int, Fit] = {k: f for k, f in enumerate(fits) if f.terms[-1].is_told}
    own = in_parallel(lambda f: deviance_in_own_noise(searcher, f, named), fits, searcher.workers)
    worth = False
    for costs, so_far in (
        ([penalised_cost(f) for f in fits], penalised_cost(current)),
        (own, penalised_deviance(current, whitener)),
    ):
        order = np.argsort(costs, kind="stable")[:FINALISTS]
        best = min(costs, default=so_far)
        for k in order:
            if costs[k] - best <= FAR_BEHIND * (so_far - best):
                found[int(k)] = fits[k]
        worth = worth or any(
            so_far - cost >= WORTH_JUDGING * needed_gain(current, f.terms[-1], searcher.baseline)
            for cost, f in zip(costs, fits, strict=True)
        )
    return list(found.values()) if worth else []


def _where_they_calm(
    searcher: Searcher, current: Fit, ranked: Sequence[Judged], named: Fit | None
) -> list[Judged]:
    """In a part of the record, what would take eddies away if it always held.

    A vane that sticks from the middle on is seen by how it turns, of which the record has one
    statistic; the screening of parts does not see it. If that explains less than what always
    holds, the part only leaves out where its eddies are missed.

    Args:
        searcher: The search.
        current: The terms so far.
        ranked: Explanations with one more.
        named: The terms so far; None: there are none.
    """
    found = []
    for one in ranked:
        newest = one.fit.terms[-1]
        always = newest.interval == ALWAYS and not newest.effect.legible
        if always and calms_too_much(searcher, one, current):
            part = in_a_part(searcher, one.whitener, one.fit)
            if plausible(part):
                found += [
                    again
                    for again in judged(searcher, [part], named)
                    if again.penalised_deviance <= one.penalised_deviance
                ]
    return found


def _with_sharp_intervals(
    searcher: Searcher, null: Whitener, ranked: Sequence[Judged], named: Fit | None
) -> list[Judged]:
    """The same explanations with beginnings and ends where they fit best, or growing; best first.

    Args:
        searcher: The search.
        null: Of the terms so far.
        ranked: Explanations with one more.
        named: The terms so far; None: there are none.
    """

    def sharper(one: Judged) -> Fit:
        return refined_interval(searcher, one.whitener, one.fit)

    passing = [
        r
        for r in ranked
        if r.fit.terms[-1].interval != ALWAYS and not r.fit.terms[-1].effect.legible
    ]
    lasting = [r for r in ranked if not any(r is p for p in passing)]
    # Several processes look for the moments of a clock, and one each for those of the others.
    clocks = [r for r in passing if moves_a_clock(r.fit)]
    others_passing = [r for r in passing if not moves_a_clock(r.fit)]
    moved = in_parallel(sharper, others_passing, searcher.workers)
    sharp = judged(searcher, [*map(sharper, clocks), *moved], named)
    others = searcher.refit_all(null, _fuller(searcher, sharp))
    if sharp:
        starts = [*blind_starts(searcher, sharp), *later_starts(sharp, lasting)]
        others += searcher.fit_all(null, named, starts)
    sound = judged(searcher, [f for f in others if plausible(f)], named)
    if sound and sound[0].penalised_deviance < sharp[0].penalised_deviance:
        # The interval is that of another effect so far.
        sound += judged(searcher, [sharper(sound[0])], named)
    growing = searcher.refit_all(null, _growing([*sharp, *sound]))
    sound += judged(searcher, [f for f in growing if plausible(f)], named)
    return sorted([*lasting, *sharp, *sound], key=lambda r: r.penalised_deviance)


def blind_starts(searcher: Searcher, passing: Sequence[Judged]) -> list[list[Term]]:
    """Starting points, in the best of the intervals, of effects that the screening hardly sees.

    Of those that act on the signals which the last effect there reaches: effects of which the raw
    signals give a guess, and on the same instrument those that one seen there is mistaken for.

    Args:
        searcher: The search.
        passing: Explanations whose last effect begins or ends inside the record, best first.
    """
    *others, last = passing[0].fit.terms
    reached = reached_by(searcher.comparison, searcher.station, [last])
    newest = [one.fit.terms[-1] for one in passing]
    known = {term.key for term in newest if term.interval == last.interval}
    seen = [t.effect for t in newest if t.key in known and t.instrument == last.instrument]
    starts = {
        key: list(guesses)
        for key, guesses in searcher.guesses.items()
        if key[0] in BLIND_IN_PARTS
    }
    for effect in searcher.effects.values():
        key = (effect.name, last.instrument)
        confusable = any(effect.is_confusable_with(other) for other in seen)
        if confusable and key in searcher.applicable and key not in starts and not effect.legible:
            drive = searcher.comparison.drive
            starts[key] = [
                Term(effect, key[1], effect.begun(values, drive)) for values in effect.templates
            ]
    return [
        [replace(start, interval=last.interval) for start in of_one]
        for key, of_one in starts.items()
        if key not in known
        and reached & reached_by(searcher.comparison, searcher.station, of_one[:1])
        and may_join(of_one[0], others)
    ]


def later_starts(passing: Sequence[Judged], lasting: Sequence[Judged]) -> list[list[Term]]:
    """Starting points of what turns or carries the whole wind, from the best of the moments on.

    Its signals do not grow with its size, so that the screening of intervals, which knows a small
    one, sees it badly. As it always holds it explains something all the same.

    Args:
        passing: Explanations whose last effect begins or ends inside the record, best first.
        lasting: Those whose last effect always holds.
    """
    begin, end = passing[0].fit.terms[-1].interval
    least = passing[0].penalised_deviance
    if begin <= 0.0 or any(one.penalised_deviance < least for one in lasting):
        return []
    known = {(one.fit.terms[-1].key, one.fit.terms[-1].interval) for one in passing}
    wide = [
        one.fit.terms[-1]
        for one in sorted(lasting, key=lambda one: one.penalised_deviance)
        if one.fit.terms[-1].instrument in (STATION, PLATFORM)
        and not one.fit.terms[-1].effect.legible
    ]
    starts = [
        [
            replace(term, interval=interval)
            for interval in dict.fromkeys(((begin, None), (begin, end)))
            if (term.key, interval) not in known
        ]
        for term in wide[:LATER_WIDE]
    ]
    return [of_one for of_one in starts if of_one]


def _fuller(searcher: Searcher, passing: Sequence[Judged]) -> list[list[Term]]:
    """Explanations with an effect that contains the last one in its place, in the same interval.

    Of several effects that begin at the same time the simplest is screened first.
    """
    found: dict[tuple[str, str], list[Term]] = {}
    for one in passing:
        *others, last = one.fit.terms
        for effect in searcher.effects.values():
            key = (effect.name, last.instrument)
            possible = last.effect.name in effect.contains and key in searcher.applicable
            if not possible or key in found:
                continue
            shared = {p.name: last.values[p.name] for p in effect.parameters
                      if p.name in last.values}
            values = {**effect.templates[0], **shared}
            found[key] = [*others, replace(last, effect=effect, values=values)]
    return list(found.values())


def _growing(passing: Sequence[Judged]) -> list[list[Term]]:
    """Explanations whose last effect grows where it was taken to begin at its full size."""
    return [
        [*one.fit.terms[:-1], grown] for one in passing for grown in one.fit.terms[-1].growing
    ]
