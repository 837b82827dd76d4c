"""Pairs of effects: put together from what single effects explain, neither of which leads alone.

Adding the best effect and then the next goes astray where two simple effects move the same signals:
one effect with many parameters imitates both better than either of them does.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explaining.acceptance import (
    ACCEPTED_FURTHER_GAIN,
    inexact,
    is_plausible,
    large_enough,
    may_join,
    plausible,
)
from wind_sensors.diagnosis.explaining.explanation import (
    CLEARLY_BETTER,
    EQUAL_SHARE,
    Judged,
    empty_fit,
    judged,
    penalised_cost,
    penalty_of,
    seen_in,
)
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.healthy.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

FITTED_PAIRS = 5
"""So many of the most promising starting points are fitted."""

SEVERAL = 2
"""An effect of so many fitted parameters is challenged by pairs built on simple effects: it may
imitate both."""

SIMPLE_SHARE = 0.4
"""On those that gain this share of what it gains: the larger of two that it imitates does."""

BUILT_PAIRS = 2
"""So many of them, the best."""

BESIDE_CANDIDATES = 4
"""So many effects are tried beside each, the best of the screening."""

SMALLEST_SHARE = 0.3
"""A fit of a pair begins with no less of an effect's size alone: with less there is no way to see
where it helps."""

LARGEST_SHARE = 2.5
"""Nor with more: two that undo each other ask for any size."""


def better_pair(
    searcher: Searcher, whitener: Whitener, singles: Sequence[Fit], current: Fit
) -> Judged | None:
    """Two effects that explain clearly more than what leads, without it; None: there are none.

    With more parameters than it they also bring what its own inexactness is worth.

    Args:
        searcher: The search.
        whitener: The null in which `singles` were fitted.
        singles: Fits of single effects.
        current: What leads.
    """
    leading = {term.key for term in current.terms}
    pairs = [
        terms
        for terms in promising_pairs(searcher, whitener, singles, current)
        if not leading & {term.key for term in terms}
    ][:FITTED_PAIRS]
    pairs += built_on_simple(searcher, whitener, singles, current)
    if not pairs:
        return None
    leader, *_ = judged(searcher, [current])
    fits = searcher.refit_all(leader.whitener, pairs)
    sound = [f for f in fits if all(is_plausible(t) and large_enough(t) for t in f.terms)]
    ranked = [r for r in judged(searcher, sound) if plausible(r.fit)]
    if not ranked:
        return None
    best = ranked[0]
    nothing = empty_fit(leader.whitener, searcher)
    gained = penalised_cost(nothing) - penalised_cost(leader.fit)
    margin = max(CLEARLY_BETTER, EQUAL_SHARE * gained)
    if best.fit.active > leader.fit.active:
        own = inexact(searcher, leader.whitener, leader.fit, best.fit)
        margin = max(ACCEPTED_FURTHER_GAIN, own, margin)
    return best if best.penalised_deviance < leader.penalised_deviance - margin else None


def built_on_simple(
    searcher: Searcher, whitener: Whitener, singles: Sequence[Fit], current: Fit
) -> list[list[Term]]:
    """Pairs of a simple effect that explains much by itself and what fits best beside it.

    Where one effect with several parameters leads, an effect of which the simple one hides the
    direction (a lean beside an offset) promises nothing by itself.

    Args:
        searcher: The search.
        whitener: The null in which `singles` were fitted.
        singles: Fits of single effects.
        current: What leads.
    """
    if len(current.terms) > 1 or current.active < SEVERAL:
        return []
    leading = current.terms[0].key
    nothing = penalised_cost(empty_fit(whitener, searcher))
    led = nothing - penalised_cost(seen_in(whitener, current))
    simple = [
        f
        for f in sorted(singles, key=penalised_cost)
        if f.active == 1
        and f.terms[0].interval == ALWAYS
        and f.terms[0].key != leading
        and plausible(f)
        and nothing - penalised_cost(f) > SIMPLE_SHARE * led
    ]
    found: list[list[Term]] = []
    for first in simple[:BUILT_PAIRS]:
        null = searcher.whitener(first.simulated)
        base = seen_in(null, first)
        candidates = [
            starts
            for starts in searcher.single_candidates(
                null, base.vector, BESIDE_CANDIDATES, blind=True
            )
            if starts[0].key != leading and may_join(starts[0], first.terms)
        ]
        beside = [f for f in searcher.fit_all(null, base, candidates) if plausible(f)]
        if beside:
            found.append(list(min(beside, key=penalised_cost).terms))
    return found


def promising_pairs(
    searcher: Searcher, whitener: Whitener, singles: Sequence[Fit], current: Fit
) -> list[list[Term]]:
    """Pairs whose fits together, each scaled, promise more than what leads; best first.

    Only of effects that always hold: two of which one passes imitate any form of one that does not.
    What smooths a signal does not go with its size: such a pair starts from the sizes that both
    have alone, too.

    Args:
        searcher: The search.
        whitener: The null in which `singles` were fitted.
        singles: Fits of single effects.
        current: What leads.
    """
    nothing = whitener.of(searcher.bank.without)
    best: dict[tuple[str, str], Fit] = {}
    for one in singles:
        if one.terms[0].interval != ALWAYS:
            continue
        key = one.terms[0].key
        if key not in best or penalised_cost(one) < penalised_cost(best[key]):
            best[key] = one
    kept = list(best.values())
    explained = [*(one.simulated for one in kept), current.simulated]
    changes = nothing - np.array([whitener.of(simulated) for simulated in explained])
    gram, seen = changes @ changes.T, changes @ nothing
    led, _ = promise(gram, seen, [len(kept)])
    promised = led - penalty_of(current.terms, current.active)
    found: list[tuple[float, list[Term]]] = []
    for i, j in itertools.combinations(range(len(kept)), 2):
        terms = [kept[i].terms[0], kept[j].terms[0]]
        if not may_join(terms[1], terms[:1]):
            continue
        gain, sizes = promise(gram, seen, [i, j])
        gain -= penalty_of(terms, kept[i].active + kept[j].active)
        if gain > promised + CLEARLY_BETTER:
            found.append((gain, [_scaled(t, float(s)) for t, s in zip(terms, sizes, strict=True)]))
            if any(t.effect.smooths for t in terms):
                found.append((gain, terms))
    return [terms for _, terms in sorted(found, key=lambda pair: -pair[0])]


def promise(
    gram: FloatArray, seen: FloatArray, members: list[int]
) -> tuple[float, FloatArray]:
    """Drop of the cost by the best multiples of some changes, and those multiples.

    Args:
        gram: Products of the changes with each other.
        seen: Products of the changes with what is to be explained.
        members: Which changes.
    """
    multiples = np.linalg.pinv(gram[np.ix_(members, members)], rcond=1e-4) @ seen[members]
    return float(multiples @ seen[members]), np.asarray(multiples)


def _scaled(term: Term, share: float) -> Term:
    """A term with a part of its size; what the signals tell stays as told."""
    if term.is_told or term.effect.legible:
        return term
    values = term.effect.scaled(term.values, float(np.clip(share, SMALLEST_SHARE, LARGEST_SHARE)))
    return replace(term, values={**values, **{name: term.values[name] for name in term.held}})
