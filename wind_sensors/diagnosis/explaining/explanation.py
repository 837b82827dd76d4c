"""Explanations of a recording: what they cost, what they must bring, what a naming holds.

How well an explanation fits is measured in four ways, each the smaller the better:

- its *cost* (`Fit.cost`), minus twice the log-likelihood but for what the noise is worth, which
  compares explanations in the same null only;
- its *deviance* (`Whitener.deviance`), minus twice the whole log-likelihood, which compares
  explanations that are each judged in the noise that they leave themselves, too;
- either of them *penalised* for its parameters, beginnings and ends (`penalty_of`).

What it *brings*, or *gains*, is by how much one of these drops.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from operator import itemgetter

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explaining.fitting import ROUGHLY, Fit, fit
from wind_sensors.diagnosis.explaining.problem import parameters_of
from wind_sensors.diagnosis.explaining.search import (
    PENALTY_PER_FURTHER_PARAMETER,
    PENALTY_PER_PARAMETER,
    Searcher,
    interval_penalty,
)
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.whitening import Whitener

FloatArray = npt.NDArray[np.float64]


EQUAL_SHARE = 0.03
"""Explanations that differ by less than this share of the gain are equal: the simulation is not
exact enough to tell them apart."""

CLEARLY_BETTER = 12.0
"""Drop of the penalised deviance at which two effects take the place of another explanation, which
an explanation must not miss to compete with another, and which a beginning or an end must bring."""


def penalty_of(terms: Sequence[Term], parameters: int) -> float:
    """What an explanation pays for its parameters, beginnings and ends.

    A term's second parameter costs more than its first.

    Args:
        terms: The explanation.
        parameters: Number of them that the recording can see.
    """
    firsts = min(len(terms), parameters)
    paid = PENALTY_PER_PARAMETER * firsts + PENALTY_PER_FURTHER_PARAMETER * (parameters - firsts)
    return paid + sum(interval_penalty(term) for term in terms)


@dataclass(frozen=True)
class Alternative:
    """An explanation that lost.

    Attributes:
        fit: Its fit.
        behind: How far its penalised deviance lies above the winner's.
    """

    fit: Fit
    behind: float


@dataclass(frozen=True)
class Alone:
    """The single effect that led before others joined it.

    Attributes:
        terms: It.
        alternatives: The single effects that lost against it.
    """

    terms: tuple[Term, ...]
    alternatives: tuple[Alternative, ...]


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
        alone: The single effect from which the search went on; None: there was none.
    """

    fit: Fit
    whitener: Whitener
    adequate: Whitener
    nothing: FloatArray
    gain: float
    alternatives: tuple[Alternative, ...] = ()
    screened: tuple[tuple[str, str, float], ...] = field(default=())
    alone: Alone | None = None


def empty_fit(whitener: Whitener, searcher: Searcher) -> Fit:
    """The explanation without any effect: the station as commissioned.

    Args:
        whitener: The null in which it is seen.
        searcher: The search.
    """
    vector = whitener.of(searcher.bank.without)
    return Fit((), float(vector @ vector), vector, searcher.bank.without, np.zeros((0, 0)), 0)


def seen_in(whitener: Whitener, current: Fit) -> Fit:
    """The same fit with its vector and cost in another null."""
    vector = whitener.of(current.simulated)
    return replace(current, vector=vector, cost=float(vector @ vector))


def penalised_cost(candidate: Fit) -> float:
    """Cost of a fit in its null, and what it pays for parameters, beginnings and ends.

    Args:
        candidate: A fit.
    """
    return candidate.cost + penalty_of(candidate.terms, candidate.active)


def penalised_deviance(candidate: Fit, whitener: Whitener) -> float:
    """Deviance of a fit in a null, and what it pays for parameters, beginnings and ends.

    Unlike the cost in one null it compares explanations that are each judged in their own: what
    explains more leaves less noise, and pays less for the sum of its logarithms.

    Args:
        candidate: A fit.
        whitener: The null in which it was made; of what competes with others, the one that it
            leaves itself.
    """
    penalty = penalty_of(candidate.terms, candidate.active)
    return whitener.deviance(candidate.simulated) + penalty


def deviance_in_own_noise(searcher: Searcher, candidate: Fit, named: Fit | None = None) -> float:
    """Penalised deviance of a fit in the null that it leaves, where it is.

    Args:
        searcher: The search.
        candidate: A fit in whatever null.
        named: Effects that are taken for granted, in a form that need not be exact.
    """
    return penalised_deviance(candidate, searcher.whitener(candidate.simulated, named))


@dataclass(frozen=True)
class Judged:
    """A fit in the null that it leaves itself.

    Attributes:
        fit: The fit.
        penalised_deviance: Minus twice its log-likelihood there, parameters, beginnings and ends
            paid for: the smaller, the better.
        null: Makes the null; few are asked for.
    """

    fit: Fit
    penalised_deviance: float
    null: Callable[[], Whitener]

    @cached_property
    def whitener(self) -> Whitener:
        """The null."""
        return self.null()


def judged(
    searcher: Searcher,
    explanations: Sequence[Fit],
    named: Fit | None = None,
    roughly: bool = False,
    iterations: int = 3,
) -> list[Judged]:
    """Fits made again, each in its own null; best first.

    Args:
        searcher: The search.
        explanations: Fits in whatever null.
        named: Effects that are taken for granted, in a form that need not be exact.
        roughly: Carry the fits' derivatives along, which may cost some units; for a first choice.
        iterations: Largest number of Gauss-Newton steps.
    """

    def one(candidate: Fit) -> tuple[Fit, float]:
        whitener = searcher.whitener(candidate.simulated, named)
        again = fit(
            whitener, searcher.station, candidate.terms, searcher.bank.without, iterations,
            known=candidate if roughly else None, least=ROUGHLY,
        )
        whitener = searcher.whitener(again.simulated, named)
        again = seen_in(whitener, again)
        return again, penalised_deviance(again, whitener)

    how = (roughly, iterations)
    known = {
        k: judgement
        for k, candidate in enumerate(explanations)
        if (judgement := searcher.judgements.find((candidate, named), how)) is not None
    }
    new = [k for k in range(len(explanations)) if k not in known]
    found = in_parallel(
        one,
        [explanations[k] for k in new],
        searcher.workers,
        work=lambda candidate: len(parameters_of(candidate.terms)),
    )
    for k, judgement in zip(new, found, strict=True):
        known[k] = judgement
        searcher.judgements.keep((explanations[k], named), judgement, how)
    ranked = sorted((known[k] for k in range(len(explanations))), key=itemgetter(1))
    return [
        Judged(again, value, partial(searcher.whitener, again.simulated, named))
        for again, value in ranked
    ]


