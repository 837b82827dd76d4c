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

HEALTHY_PARTS = 3
HEALTHY_FACTOR = 2.5
"""A finding must be so many times as large as the largest in the parts of a healthy record."""

MOST_TERMS = 7


@dataclass(frozen=True)
class Named:
    """An accepted term.

    Attributes:
        key: Effect and instrument.
        p: Probability of the best template's score by chance, all templates considered.
        gain: Drop of the cost on held-out blocks, block by block.
        equal: Other explanations of the same, as fitted, with how far they stay behind.
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


def _t(gain: FloatArray) -> float:
    error = float(np.std(gain, ddof=1)) / np.sqrt(gain.size)
    return float(gain.mean() / max(error, 1e-12))


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

    With `given` terms, which are fitted along but not named, only beginnings and endings are
    looked for. A term that is `normal` on healthy days is not accepted.

    A term is accepted when the family-wide p value of its screening and the t value of its gain
    over held-out blocks say so, whatever its size. An effect that `wider` knows with more
    parameters gets them when they explain still more of the held-out blocks.
    """
    terms = fit(bench, (), given, bench.everything) if given else ()
    cost, fits = held_out(bench, [(), ()], terms)
    costs = [cost]
    named: list[Named] = []
    refused: set[tuple[str, str]] = set()
    p = 1.0
    needed = float(stats.t.ppf(1.0 - 0.005, bench.blocks - 1))
    while len(named) < most:
        screened = screen(bench, effects, instruments, terms, not given)
        p = screened.p
        if p > FAMILY_P:
            break
        trials: list[tuple[Term, FloatArray, list[tuple[Term, ...]]]] = []
        for candidate in screened.candidates:
            taken = any(
                t.key == candidate.term.key and t.effect.name != "wake_shadow" for t in terms
            )
            if candidate.term.key in refused or (taken and candidate.term.interval == ALWAYS):
                continue
            cost, both = held_out(bench, fits, (candidate.term,))
            whole = fit(bench, terms, (candidate.term,), bench.everything, 4)[0]
            trials.append((whole, costs[-1] - cost, both))
        trials = [t for t in trials if _inside(t[0]) and _t(t[1]) > needed]
        if not trials:
            break
        trials.sort(key=lambda t: -float(t[1].sum()))
        best, gain, _ = trials[0]
        if float(gain.sum()) < SMALLEST_GAIN * float(costs[0].sum()):
            break
        equal, others, runner = [], [], None
        for other, its_gain, _ in trials[1:]:
            behind = gain - its_gain
            lost = float(behind.sum()) / float(gain.sum())
            if lost < EQUAL_SHARE or _t(behind) < EQUAL_T:
                equal.append((other, 0.5 * float(behind.sum())))
            else:
                others.append((other, 0.5 * float(behind.sum())))
                runner = its_gain if runner is None else runner
        if normal is not None and normal(best):
            refused.add(best.key)
            continue
        if wider is not None and best.effect.name in wider:
            best = _widened(bench, best, wider[best.effect.name], terms, fits, needed)
        together = fit(bench, (), (*terms, best), bench.everything)
        if not all(_inside(t) for t in together[len(given) :]):
            # Two names for one thing push each other out of what is possible.
            refused.add(best.key)
            continue
        terms = together
        cost, fits = held_out(bench, [(), ()], terms)
        named.append(
            Named(terms[-1], p, costs[-1] - cost, tuple(equal), tuple(others), runner)
        )
        costs.append(cost)
        if progress:
            progress(len(named) / most)
    return Explained(terms, tuple(named), tuple(costs), p)


def _widened(
    bench: Bench,
    term: Term,
    effect: Effect,
    terms: Sequence[Term],
    fits: Sequence[Sequence[Term]],
    needed: float,
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
            if float((before - cost).sum()) > gain and _t(before - cost) > needed:
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
        if p.healthy is None and not p.wraps and term.values[p.name] > 0.98 * p.high:
            return False
        if p.healthy is None or p.minimum <= 0.0:
            continue
        margin = 0.005 * (p.high - p.low)
        value = term.values[p.name]
        if abs(value - p.healthy) > margin and not p.low + margin < value < p.high - margin:
            return False
    return True
