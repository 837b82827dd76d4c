"""Naming in a pair: effects that explain blocks of the record they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.means.bench import Bench, FloatArray
from wind_sensors.diagnosis.means.fits import fit, held_out
from wind_sensors.diagnosis.means.screening import SMALLEST_KEPT, screen

FAMILY_P = 0.01
"""Probability that the best of all templates looks so good by chance."""

EQUAL_T = 2.0
"""Explanations whose block-wise difference is smaller than so many standard errors are equal."""

EQUAL_SHARE = 0.05
"""So are those that lose less than this share of the winner's gain."""

SMALLEST_GAIN = 0.005
"""Share of the whole cost that a term must remove from held-out blocks."""

GAIN_P = 0.005
"""Probability that a mean gain over held-out blocks is so large by chance, one-sided. The blocks
are few (some tens) and their gains not normal, so that it is stricter than the usual 0.05. A
choice; a larger one lets in terms that a few blocks carry."""

HEALTHY_PARTS = 3
HEALTHY_FACTOR = 2.5
"""A finding must be so many times as large as the largest in the parts of a healthy record."""

MOST_TERMS = 7

ALREADY_AT_THE_END = 0.98
"""Share of its upper bound from which what shapes an effect, the width of a wake, is at the end of
the search: the best value lies beyond, and the effect is not what it is called."""

AT_AN_END = 0.005
"""The same of a size, as a share of the distance between its bounds. Both are choices of little
weight: fits that run away stop at the bound itself."""


@dataclass(frozen=True)
class Named:
    """An accepted term.

    Attributes:
        term: Effect, instrument and values, fitted together with those that were accepted earlier.
        p: Probability of the best template's score by chance, all templates considered.
        gain: Drop of the cost on held-out blocks, block by block.
        equal: Other explanations of the same, as fitted, with how far their log-likelihood stays
            behind: no further than by chance.
        others: Explanations that stay further behind, likewise.
        runner_up: Gain of the best explanation that is not equal, block by block.
    """

    term: Term
    p: float
    gain: FloatArray
    equal: tuple[tuple[Term, float], ...]
    others: tuple[tuple[Term, float], ...]
    runner_up: FloatArray | None


@dataclass(frozen=True)
class Explained:
    """What a search found.

    Attributes:
        terms: Fitted together: the given ones, then in the order in which they were accepted.
        named: How each was accepted.
        cost: Held-out cost of each block after each acceptance; the first without any term.
        p: Of what is left.
    """

    terms: tuple[Term, ...]
    named: tuple[Named, ...]
    cost: tuple[FloatArray, ...]
    p: float


@dataclass(frozen=True)
class _Trial:
    """A candidate, fitted to all rows, and its gain on held-out blocks, block by block."""

    term: Term
    gain: FloatArray

    @property
    def whole_gain(self) -> float:
        """Over all blocks."""
        return float(self.gain.sum())


def t_of(gain: FloatArray) -> float:
    """How many of its standard errors the mean gain of a block is."""
    error = float(np.std(gain, ddof=1)) / np.sqrt(gain.size)
    return float(gain.mean() / max(error, 1e-12))


def needed_t(bench: Bench) -> float:
    """The t value that a gain over held-out blocks must exceed; see `GAIN_P`."""
    return float(stats.t.ppf(1.0 - GAIN_P, bench.blocks - 1))


def search(
    bench: Bench,
    effects: dict[str, Effect],
    instruments: Sequence[str],
    progress: Callable[[float], None] | None = None,
    most: int = MOST_TERMS,
    given: Sequence[Term] = (),
    normal: Callable[[Term], bool] | None = None,
    wider: Mapping[str, Effect] | None = None,
) -> Explained:
    """Add effects while they explain held-out blocks.

    A term is accepted when the family-wide p value of its screening and the t value of its gain
    over held-out blocks say so, whatever its size.

    Args:
        bench: Rows.
        effects: Catalogue.
        instruments: Which ones may have them.
        progress: Called with the share that is done.
        most: So many terms are accepted at most.
        given: Terms that are fitted along but not named. With them only beginnings and endings
            are looked for.
        normal: Whether healthy days show a term; then it is not accepted. None: nobody knows.
        wider: Effects with more parameters, by name. They get them when these explain still more
            of the held-out blocks.
    """
    terms = fit(bench, (), given, bench.everything) if given else ()
    cost, fits = held_out(bench, [(), ()], terms)
    costs = [cost]
    named: list[Named] = []
    refused: set[tuple[str, str]] = set()
    p = 1.0
    while len(named) < most:
        screened = screen(bench, effects, instruments, terms, not given)
        p = screened.p
        if p > FAMILY_P:
            break
        candidates = [
            c.term for c in screened.candidates
            if c.term.key not in refused and not _is_taken(c.term, terms)
        ]
        trials = _trials(bench, candidates, terms, fits, costs[-1])
        if not trials or trials[0].whole_gain < SMALLEST_GAIN * float(costs[0].sum()):
            break
        best = trials[0].term
        if normal is not None and normal(best):
            refused.add(best.key)
            continue
        if wider is not None and best.effect.name in wider:
            best = _widened(bench, best, wider[best.effect.name], terms, fits)
        together = fit(bench, (), (*terms, best), bench.everything)
        if not all(_inside(t) for t in together[len(given) :]):
            # Two names for one thing push each other out of what is possible.
            refused.add(best.key)
            continue
        terms = together
        cost, fits = held_out(bench, [(), ()], terms)
        equal, others = _rivals(trials)
        named.append(
            Named(
                terms[-1], p, costs[-1] - cost, _behind(trials[0], equal),
                _behind(trials[0], others), others[0].gain if others else None,
            )
        )
        costs.append(cost)
        if progress:
            progress(len(named) / most)
    return Explained(terms, tuple(named), tuple(costs), p)


def _is_taken(candidate: Term, terms: Sequence[Term]) -> bool:
    """Whether an instrument has an effect that always holds already; wakes it may have several."""
    again = any(t.key == candidate.key and t.effect.name != "wake_shadow" for t in terms)
    return again and candidate.interval == ALWAYS


def _trials(
    bench: Bench,
    candidates: Sequence[Term],
    terms: Sequence[Term],
    fits: Sequence[Sequence[Term]],
    cost: FloatArray,
) -> list[_Trial]:
    """Candidates that can be and whose gain is no chance, the best one first.

    Args:
        bench: Rows.
        candidates: From the screening.
        terms: What has been accepted, fitted to all rows.
        fits: The same, fitted to each half.
        cost: Held-out cost of each block with them.
    """
    trials = []
    for candidate in candidates:
        left, _ = held_out(bench, fits, (candidate,))
        whole = fit(bench, terms, (candidate,), bench.everything, 4)[0]
        trials.append(_Trial(whole, cost - left))
    possible = [t for t in trials if _inside(t.term) and t_of(t.gain) > needed_t(bench)]
    return sorted(possible, key=lambda t: -t.whole_gain)


def _rivals(trials: Sequence[_Trial]) -> tuple[list[_Trial], list[_Trial]]:
    """Of trials, the best one first: which others are equal to it, and which are not."""
    best, *rest = trials
    equal: list[_Trial] = []
    others: list[_Trial] = []
    for trial in rest:
        behind = best.gain - trial.gain
        lost = float(behind.sum()) / best.whole_gain
        near = lost < EQUAL_SHARE or t_of(behind) < EQUAL_T
        (equal if near else others).append(trial)
    return equal, others


def _behind(best: _Trial, rivals: Sequence[_Trial]) -> tuple[tuple[Term, float], ...]:
    """How far the log-likelihood of each rival, half its cost, stays behind the best one's."""
    return tuple((r.term, 0.5 * float((best.gain - r.gain).sum())) for r in rivals)


def _widened(
    bench: Bench,
    term: Term,
    effect: Effect,
    terms: Sequence[Term],
    fits: Sequence[Sequence[Term]],
) -> Term:
    """The term with an effect's further parameters where held-out blocks ask for them."""
    before, _ = held_out(bench, fits, (term,))
    best, gain = term, SMALLEST_GAIN * float(before.sum())
    for p in effect.parameters:
        if p in term.effect.parameters:
            continue
        for start in p.starts:
            tried = replace(term, effect=effect, values={**term.values, p.name: start})
            cost, _ = held_out(bench, fits, (tried,))
            if float((before - cost).sum()) > gain and t_of(before - cost) > needed_t(bench):
                gain = float((before - cost).sum())
                best = fit(bench, terms, (tried,), bench.everything, 6)[0]
    return best


def is_normal(healthy: Bench) -> Callable[[Term], bool]:
    """Whether a term is no larger than what healthy days show between themselves.

    The same effect is fitted to each third of the healthy record, after the record's standing
    difference has been taken out.
    """
    parts = min(HEALTHY_PARTS, healthy.blocks)
    third = healthy.block * parts // healthy.blocks
    sizes: dict[tuple[str, str], float] = {}

    def normal(term: Term) -> bool:
        if term.key not in sizes:
            start = replace(term, interval=ALWAYS)
            found = [
                fit(healthy, (), (start,), third == k, 4)[0].relative_size
                for k in range(parts)
            ]
            sizes[term.key] = max(found)
        return term.relative_size < HEALTHY_FACTOR * sizes[term.key]

    return normal


def _inside(term: Term) -> bool:
    """Not at the end of what the search allows, and not nothing."""
    if term.relative_size < SMALLEST_KEPT:
        return False
    for p in term.effect.parameters:
        if p.healthy is None and not p.wraps and term.values[p.name] > ALREADY_AT_THE_END * p.high:
            return False
        if p.healthy is None or p.minimum <= 0.0:
            continue
        margin = AT_AN_END * (p.high - p.low)
        value = term.values[p.name]
        if abs(value - p.healthy) > margin and not p.low + margin < value < p.high - margin:
            return False
    return True
