"""One round of the search: single effects fitted, alone or beside one, and which of them leads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION, Effect
from wind_sensors.diagnosis.explaining.acceptance import (
    calms_too_much,
    is_a_stall,
    may_join,
    needed_gain,
    plausible,
    too_small,
)
from wind_sensors.diagnosis.explaining.explanation import (
    Alternative,
    Judged,
    evidence,
    in_own_noise,
    judged,
    no_terms,
    seen_in,
    total,
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
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener

FIRST_CANDIDATES = 9
LATER_CANDIDATES = 6

LATER_WIDE = 2
"""So many of the effects that turn or carry the whole wind are tried from the best moment on."""

LARGE_CANDIDATES = 5
"""So many of the best single effects are tried beside another in the size that they have alone."""

FINALISTS = 7
CONTENDERS = 5
FAR_BEHIND = 0.8
"""Fits that miss more than this share of the leader's gain do not compete with it."""

WORTH_JUDGING = 0.5
"""Share of the needed gain that a fit must bring before the noise is judged again."""

WORTH_ANOTHER_TURN = 14.0
"""Largest linear score below which no further effect is looked for."""


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
    return _one_more(searcher, whitener, no_terms(whitener, searcher), allowed, None)


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
    sound = [f for f in fits if plausible(f) and not too_small(searcher, f, total(current))]
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
    leader = held_throughout(
        searcher, best, named, evidence(current, whitener) - best.evidence, ranked
    )
    losers = tuple(
        Alternative(r.fit, r.evidence - leader.evidence) for r in ranked if r is not best
    )
    return leader, losers


@dataclass
class Beside:
    """What is tried beside the terms so far, each once however often it is asked for.

    Attributes:
        searcher: The search.
        first: The terms so far.
        singles: Fits of single effects: of the best the size that they have alone is tried, too,
            where a small one shows no way.
    """

    searcher: Searcher
    first: Fit
    singles: Sequence[Fit]
    _fitted: list[tuple[Sequence[Term], Fit]] = field(default_factory=list, repr=False)

    @cached_property
    def whitener(self) -> Whitener:
        """The null of the terms so far, in whatever form they have."""
        return self.searcher.whitener(self.first.simulated, self.first)

    @cached_property
    def current(self) -> Fit:
        """The terms so far in that null."""
        return seen_in(self.whitener, self.first)

    @cached_property
    def _windowed(self) -> list[list[Term]]:
        used = {t.key for t in self.current.terms}
        return window_starts(self.searcher, self.whitener, self.current.vector, used)

    @cached_property
    def _apart(self) -> list[Fit]:
        return _promising_apart(self.searcher, self.current, self.singles)

    @cached_property
    def _hidden(self) -> list[Term]:
        return _hidden_beside(self.searcher, self.whitener, self.current)

    def fits(self, excluded: frozenset[str]) -> list[Fit]:
        """Fits of the terms so far with one more each.

        Args:
            excluded: Names of effects that are not to be used.
        """
        candidates = self._candidates(excluded)
        tried = [starts for starts, _ in self._fitted]
        new = [starts for starts in candidates if starts not in tried]
        fits = self.searcher.fit_each(self.whitener, self.current, new)
        self._fitted += zip(new, fits, strict=True)
        chosen = [
            next(fit for starts, fit in self._fitted if starts == wanted)
            for wanted in candidates
        ]
        return self.searcher.possible(chosen)

    def _candidates(self, excluded: frozenset[str]) -> list[list[Term]]:
        """Starting points of what may be worth a fit, several for each effect."""
        searcher, whitener, current = self.searcher, self.whitener, self.current

        def eligible(starts: Sequence[Term]) -> bool:
            return may_join(starts[0], current.terms) and starts[0].effect.name not in excluded

        windowed = [starts for starts in self._windowed if eligible(starts)]
        hidden = [term for term in self._hidden if eligible([term])]
        if not windowed and not self._apart and not hidden:
            used = {t.key for t in current.terms}
            scores = searcher.scores(whitener, current.vector)
            if all(
                s.gain < WORTH_ANOTHER_TURN
                for s in scores
                if (s.effect, s.instrument) not in used
            ):
                return []
        candidates = [
            starts
            for starts in searcher.single_candidates(
                whitener, current.vector, LATER_CANDIDATES
            )
            if eligible(starts) and not is_a_stall(searcher, current, starts[0])
        ]
        known = {starts[0].key: starts for starts in candidates}
        alone = [f for f in self.singles if f.terms[0].interval == ALWAYS and eligible(f.terms)]
        large = [*sorted(alone, key=total)[:LARGE_CANDIDATES], *self._apart]
        for term in (*(single.terms[0] for single in large), *hidden):
            if not eligible([term]):
                continue
            if term.key not in known:
                known[term.key] = []
                candidates.append(known[term.key])
            known[term.key] += [
                replace(term, values=values) for values in term.effect.either_sign(term.values)
            ]
        return [*candidates, *windowed]


def _promising_apart(searcher: Searcher, current: Fit, singles: Sequence[Fit]) -> list[Fit]:
    """Single effects on signals of their own that explain much in the noise that they leave.

    What makes a signal more or less lively hides in the noise as long as it is not simulated.

    Args:
        searcher: The search.
        current: The terms so far.
        singles: Fits of single effects.
    """
    null = searcher.whitener(searcher.bank.without)
    so_far = evidence(no_terms(null, searcher), null)
    apart = [
        f
        for f in singles
        if f.terms[0].interval == ALWAYS and searcher.is_apart(current, f.terms[0])
    ]
    own = in_parallel(lambda f: in_own_noise(searcher, f), apart, searcher.workers)
    promising = [
        (cost, f)
        for cost, f in zip(own, apart, strict=True)
        if so_far - cost > WORTH_ANOTHER_TURN
    ]
    return [f for _, f in sorted(promising, key=lambda pair: pair[0])[:LARGE_CANDIDATES]]


def _hidden_beside(searcher: Searcher, whitener: Whitener, current: Fit) -> list[Term]:
    """Effects that smooth the same signals and explain much in the noise that they leave.

    The screening's signatures are those of healthy instruments: what damping does to a vane that
    sticks is not among them, and what it takes from the noise does not show in theirs.

    Args:
        searcher: The search.
        whitener: The null of the terms so far.
        current: The terms so far.
    """
    comparison, station = searcher.comparison, searcher.station
    reached = {n for t in current.terms for n in comparison.affected(station, t.instrument)}
    possible = {(t.effect.name, t.instrument) for t in searcher.bank.templates}
    starts = [
        start
        for name, instrument in sorted(possible)
        if instrument in reached
        and searcher.effects[name].smooths
        and searcher.effects[name].entrance != "clock"
        for start in _sizes_of(searcher.effects[name], instrument)
        if may_join(start, current.terms)
    ]

    def promise(start: Term) -> float:
        terms = [*current.terms, start]
        simulated = comparison.possible(planted(station, terms))
        if simulated is None:
            return -np.inf
        null = searcher.whitener(simulated, current)
        return whitener.deviance(current.simulated) - null.deviance(simulated)

    promises = in_parallel(promise, starts, searcher.workers)
    best: dict[tuple[str, str], tuple[float, Term]] = {}
    for gain, start in zip(promises, starts, strict=True):
        if gain > max(WORTH_ANOTHER_TURN, best.get(start.key, (0.0, start))[0]):
            best[start.key] = (gain, start)
    ranked = sorted(best.values(), key=lambda pair: -pair[0])
    return [start for _, start in ranked[:LARGE_CANDIDATES]]


def _sizes_of(effect: Effect, instrument: str) -> list[Term]:
    """An effect in the sizes of its templates, and in those from which its fits start."""
    starts = [Term(effect, instrument, dict(values)) for values in effect.templates]
    for parameter in effect.parameters:
        starts += [
            Term(effect, instrument, {**effect.templates[0], parameter.name: value})
            for value in parameter.starts
        ]
    return starts


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
    own = in_parallel(lambda f: in_own_noise(searcher, f, named), fits, searcher.workers)
    worth = False
    for costs, so_far in (
        ([total(f) for f in fits], total(current)),
        (own, evidence(current, whitener)),
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
                    if again.evidence <= one.evidence
                ]
    return found


def _with_sharp_intervals(
    searcher: Searcher, null: Whitener, ranked: Sequence[Judged], named: Fit | None
) -> list[Judged]:
    """The same explanations with beginnings and ends where they fit best; best first.

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
    if sound and sound[0].evidence < sharp[0].evidence:
        # The interval is that of another effect so far.
        sound += judged(searcher, [sharper(sound[0])], named)
    return sorted([*lasting, *sharp, *sound], key=lambda r: r.evidence)


def blind_starts(searcher: Searcher, passing: Sequence[Judged]) -> list[list[Term]]:
    """Starting points, in the best of the intervals, of effects that the screening hardly sees.

    Of those that act on the signals which the last effect there reaches: effects of which the raw
    signals give a guess, and on the same instrument those that one seen there is mistaken for.

    Args:
        searcher: The search.
        passing: Explanations whose last effect begins or ends inside the record, best first.
    """
    *others, last = passing[0].fit.terms
    reached = set(searcher.comparison.affected(searcher.station, last.instrument))
    newest = [one.fit.terms[-1] for one in passing]
    known = {term.key for term in newest if term.interval == last.interval}
    seen = [t.effect for t in newest if t.key in known and t.instrument == last.instrument]
    starts = {
        key: list(guesses)
        for key, guesses in searcher.guesses.items()
        if key[0] in BLIND_IN_PARTS
    }
    possible = {(t.effect.name, t.instrument) for t in searcher.bank.templates}
    for effect in searcher.effects.values():
        key = (effect.name, last.instrument)
        confusable = any(
            effect.name in other.confusable or other.name in effect.confusable for other in seen
        )
        if confusable and key in possible and key not in starts and not effect.legible:
            drive = searcher.comparison.drive
            starts[key] = [
                Term(effect, key[1], effect.begun(values, drive)) for values in effect.templates
            ]
    return [
        [replace(start, interval=last.interval) for start in of_one]
        for key, of_one in starts.items()
        if key not in known
        and reached & set(searcher.comparison.affected(searcher.station, key[1]))
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
    if begin <= 0.0 or any(one.evidence < passing[0].evidence for one in lasting):
        return []
    known = {(one.fit.terms[-1].key, one.fit.terms[-1].interval) for one in passing}
    wide = [
        one.fit.terms[-1]
        for one in sorted(lasting, key=lambda one: one.evidence)
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
    possible = {(t.effect.name, t.instrument) for t in searcher.bank.templates}
    found: dict[tuple[str, str], list[Term]] = {}
    for one in passing:
        *others, last = one.fit.terms
        for effect in searcher.effects.values():
            key = (effect.name, last.instrument)
            if last.effect.name not in effect.contains or key not in possible or key in found:
                continue
            shared = {p.name: last.values[p.name] for p in effect.parameters
                      if p.name in last.values}
            values = {**effect.templates[0], **shared}
            found[key] = [*others, replace(last, effect=effect, values=values)]
    return list(found.values())
