"""What is tried beside the terms so far, and from where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.explaining.acceptance import is_a_stall, may_join
from wind_sensors.diagnosis.explaining.explanation import (
    deviance_in_own_noise,
    empty_fit,
    penalised_cost,
    penalised_deviance,
    seen_in,
)
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.onsets import window_starts
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted, reached_by
from wind_sensors.diagnosis.healthy.whitening import Whitener

LATER_CANDIDATES = 6
"""So many of the best effects of the screening are tried beside another."""

LARGE_CANDIDATES = 5
"""So many of the best single effects are tried beside another in the size that they have alone."""

WORTH_ANOTHER_TURN = 14.0
"""Largest linear score below which no further effect is looked for."""


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
        large = [*sorted(alone, key=penalised_cost)[:LARGE_CANDIDATES], *self._apart]
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
    so_far = penalised_deviance(empty_fit(null, searcher), null)
    apart = [
        f
        for f in singles
        if f.terms[0].interval == ALWAYS and searcher.is_apart(current, f.terms[0])
    ]
    own = in_parallel(lambda f: deviance_in_own_noise(searcher, f), apart, searcher.workers)
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
    comparison = searcher.comparison
    reached = reached_by(comparison, searcher.station, current.terms)
    starts = [
        start
        for name, instrument in sorted(searcher.applicable)
        if instrument in reached
        and searcher.effects[name].smooths
        and searcher.effects[name].entrance != "clock"
        for start in _sizes_of(searcher.effects[name], instrument)
        if may_join(start, current.terms)
    ]

    def promise(start: Term) -> float:
        terms = [*current.terms, start]
        simulated = comparison.possible(planted(searcher.station, terms))
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
