"""Explanations of a recording: what they cost, what they must bring, what a naming holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis import spectra
from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.comparison import Simulated
from wind_sensors.diagnosis.fitting import ALWAYS, ROUGHLY, Fit, Term, fit
from wind_sensors.diagnosis.search import (
    PENALTY_PER_FURTHER_PARAMETER,
    PENALTY_PER_INTERVAL,
    PENALTY_PER_PARAMETER,
    Searcher,
)
from wind_sensors.diagnosis.signatures import in_parallel
from wind_sensors.diagnosis.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

ACCEPTED_GAIN = 14.0
"""Drop of the cost beyond its parameters that a name needs; healthy recordings stay below."""

LOUDEST_FACTOR = 1.2
"""A name needs this many times what the loudest of the healthy recordings promises."""

PASSING_GAIN = 25.0
"""What an effect must bring that begins or ends inside the record: any of many may do."""

PASSING_SMOOTH_GAIN = 40.0
"""The same if it smooths: for some minutes the reference sees other eddies than the instrument."""

PASSING_FORM_GAIN = 60.0
"""The same with several parameters: in a few minutes of wind from a few directions they fit many a
wandering of the reference with sizes that undo each other."""

ACCEPTED_FURTHER_GAIN = 32.0
"""The same for a second effect on the same signals."""

ACCEPTED_ELSEWHERE_GAIN = 22.0
"""The same for a second effect on signals that the first does not reach."""

FURTHER_SHARE = 0.1
"""A further effect on the same signals must also bring this share of the gain so far."""

LARGEST_INEXACTNESS = 1000.0
"""But never more than this, or than the least share."""

FURTHER_EXACT_SHARE = 0.05
LARGEST_EXACT_INEXACTNESS = 150.0
"""The same beside effects whose form is certain."""

TRACE = 0.01
"""An effect acts where it changes a signal by more than this share of its largest change."""

PASSING_BESIDE = 3.0
"""So many times more, if it begins or ends inside the record: effects grow and fade themselves."""

LEAST_SHARE_BESIDE = 0.02
"""What brings less than this share of the gain so far is the form of what brought that."""

EQUAL_SHARE = 0.03
"""Explanations that differ by less than this share of the gain are equal: the simulation is not
exact enough to tell them apart."""

MOMENTS = 24
"""Parts of the record."""

EVENT = 3
"""So many in a row may hold a single event; one, of an effect that passes anyway."""

SMALLEST_SIZE = 0.7
"""In units of the smallest size worth reporting."""

SMALLEST_TOLD = 0.4
"""The same of what the signals tell without a fit: left out, it would be a riddle."""

SMALLEST_BESIDE = 1.8
"""The same beside another effect on the same signals, whose form a small one may make good."""


def parameter_cost(terms: Sequence[Term], parameters: int) -> float:
    """What parameters and intervals cost; a term's second parameter costs more than its first."""
    firsts = min(len(terms), parameters)
    cost = PENALTY_PER_PARAMETER * firsts + PENALTY_PER_FURTHER_PARAMETER * (parameters - firsts)
    for term in terms:
        if term.interval != ALWAYS and not term.effect.legible:
            cost += PENALTY_PER_INTERVAL * sum(
                (term.interval[0] > 0.0, term.interval[1] is not None)
            )
    return cost


def needed_gain(current: Fit, further: Term, baseline: Baseline) -> float:
    """Gain that a further term has to bring.

    Args:
        current: The explanation so far.
        further: The term.
        baseline: Knows how loud healthy days are.
    """
    least = ACCEPTED_ELSEWHERE_GAIN if current.terms else ACCEPTED_GAIN
    return max(least, LOUDEST_FACTOR * baseline.loudness(further.instrument))


def passing_gain(term: Term) -> float:
    """Gain that a term has to bring for its beginning or end inside the record; else nothing."""
    if term.interval == ALWAYS or term.effect.legible:
        return 0.0
    graded = sum(p.healthy is not None and p.minimum > 0.0 for p in term.effect.parameters)
    if graded > 1:
        return PASSING_FORM_GAIN
    return PASSING_SMOOTH_GAIN if term.effect.smooths else PASSING_GAIN


def inexact(current: Fit, nothing: float) -> float:
    """What the simulation's own inexactness is worth on the signals that an effect reaches.

    Args:
        current: The explanation so far.
        nothing: Cost without any effect.
    """
    gained = nothing - current.cost
    if all(term.effect.exact for term in current.terms):
        share, largest = FURTHER_EXACT_SHARE, LARGEST_EXACT_INEXACTNESS
    else:
        share, largest = FURTHER_SHARE, LARGEST_INEXACTNESS
    most = max(largest, LEAST_SHARE_BESIDE * gained)
    return min(max(share * gained, ACCEPTED_FURTHER_GAIN), most)


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
    reached = {
        name
        for term in more.terms
        if term.key not in known
        for name in comparison.affected(searcher.station, term.instrument)
    }
    there = everywhere = 0.0
    for channel in comparison.channels:
        if channel.instrument not in reached:
            continue
        name = channel.name
        acts = np.abs(fewer.simulated.series[name] - searcher.bank.without.series[name])
        changed = (more.simulated.series[name] - fewer.simulated.series[name]) ** 2
        there += float(np.sum(changed[acts > TRACE * float(acts.max(initial=0.0))]))
        everywhere += float(np.sum(changed))
    return there / everywhere if everywhere > 0.0 else 1.0


@dataclass(frozen=True)
class Alternative:
    """An explanation that lost.

    Attributes:
        fit: Its fit.
        behind: How far its penalised cost lies above the winner's.
    """

    fit: Fit
    behind: float


@dataclass(frozen=True)
class Naming:
    """The explanation of a recording.

    Attributes:
        fit: Named terms, fitted; no terms: nothing was accepted.
        whitener: The null in which the fit was made.
        adequate: The null in which the named effects need not have the simulation's exact form.
        nothing: White vector without any effect, in that null.
        gain: Drop of the cost.
        alternatives: Losers of the last round, for each accepted term, nearest first.
        screened: Best scores of the first screening: effect, instrument, gain.
    """

    fit: Fit
    whitener: Whitener
    adequate: Whitener
    nothing: FloatArray
    gain: float
    alternatives: tuple[Alternative, ...] = ()
    screened: tuple[tuple[str, str, float], ...] = field(default=())


def no_terms(whitener: Whitener, searcher: Searcher) -> Fit:
    vector = whitener.of(searcher.bank.without)
    return Fit((), float(vector @ vector), vector, searcher.bank.without, np.zeros((0, 0)), 0)


def seen_in(whitener: Whitener, current: Fit) -> Fit:
    """The same fit with its vector and cost in another null."""
    vector = whitener.of(current.simulated)
    return replace(current, vector=vector, cost=float(vector @ vector))


def total(candidate: Fit) -> float:
    return candidate.cost + parameter_cost(candidate.terms, candidate.active)


def evidence(candidate: Fit, whitener: Whitener) -> float:
    """Minus twice the log-likelihood with the noise as the candidate itself leaves it, penalised.

    Unlike the cost in one null it compares explanations that are each judged in their own: what
    explains more leaves less noise, and pays less for the sum of its logarithms.

    Args:
        candidate: A fit.
        whitener: The null in which it was made.
    """
    penalty = parameter_cost(candidate.terms, candidate.active)
    return whitener.deviance(candidate.simulated) + penalty


@dataclass(frozen=True)
class Judged:
    """A fit in the null that it leaves itself.

    Attributes:
        fit: The fit.
        whitener: Its null.
        evidence: Minus twice the penalised log-likelihood.
    """

    fit: Fit
    whitener: Whitener
    evidence: float


def judged(
    searcher: Searcher,
    explanations: Sequence[Fit],
    named: Simulated | None = None,
    roughly: bool = False,
    iterations: int = 3,
) -> list[Judged]:
    """Fits made again, each in its own null; best first.

    Args:
        searcher: The search.
        explanations: Fits in whatever null.
        named: Simulation of effects whose form need not be exact.
        roughly: Carry the fits' derivatives along, which may cost some units; for a first choice.
        iterations: Largest number of Gauss-Newton steps.
    """

    def one(candidate: Fit) -> tuple[Fit, float]:
        whitener = searcher.whitener(candidate.simulated, named)
        again = fit(
            whitener, searcher.station, candidate.terms, searcher.bank.without, iterations,
            known=candidate if roughly else None, least=ROUGHLY,
        )  # fmt: skip
        whitener = searcher.whitener(again.simulated, named)
        again = seen_in(whitener, again)
        return again, evidence(again, whitener)

    fits = in_parallel(one, list(explanations), searcher.workers)
    return [
        Judged(again, searcher.whitener(again.simulated, named), value)
        for again, value in sorted(fits, key=lambda pair: pair[1])
    ]


def single_event(searcher: Searcher, before: Fit, after: Fit) -> float:
    """How much more of a gain the best moment of the record brings than the second best.

    One gust that the reference missed, one swing of a vane can make any effect look better that
    moves the signals a little; if it always holds, it does so again and again. What acts in a
    sector or in a lull may show once.

    Args:
        searcher: The search.
        before, after: Two explanations in the same null.
    """
    newest = after.terms[-1]
    passing = newest.interval != ALWAYS
    if newest.effect.occasional and not passing:
        return 0.0
    comparison = searcher.comparison
    n = comparison.coefficients
    gain = np.zeros(MOMENTS)
    width = comparison.grid.n // MOMENTS
    for k in range(len(comparison.channels)):
        for sign, fitted in ((1.0, before), (-1.0, after)):
            white = np.zeros(comparison.grid.n)
            white[:n] = fitted.vector[k * n : (k + 1) * n]
            squares = spectra.from_cosine(white)[: MOMENTS * width] ** 2
            gain += sign * squares.reshape(MOMENTS, width).sum(axis=1)
    together = 1 if passing else EVENT
    around = np.convolve(gain, np.ones(together), "same")
    best = int(np.argmax(around))
    elsewhere = np.abs(np.arange(MOMENTS) - best) >= together
    return float(max(around[best] - max(np.max(around[elsewhere]), 0.0), 0.0))


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


def plausible(candidate: Fit) -> bool:
    """Whether the newest term is large enough to matter and its parameters are determined.

    A search that ran into the bounds of a parameter has found the wrong effect.
    """
    return is_plausible(candidate.terms[-1])


def large_enough(term: Term) -> bool:
    """Whether a term matters."""
    return term.relative_size >= (SMALLEST_TOLD if term.is_told else SMALLEST_SIZE)


def is_plausible(term: Term) -> bool:
    """Whether one term is."""
    if not large_enough(term):
        return False
    for parameter in term.effect.parameters:
        if parameter.healthy is None or parameter.minimum <= 0.0 or not parameter.fitted:
            continue
        margin = 0.02 * (parameter.high - parameter.low)
        reach = 0.85 * (parameter.high - 1.0)
        if parameter.healthy == 1.0 and term.values[parameter.name] > 1.0 + reach:
            return False
        value = term.values[parameter.name]
        at_bound = value < parameter.low + margin or value > parameter.high - margin
        if at_bound and abs(value - parameter.healthy) > margin:
            return False
    return True
