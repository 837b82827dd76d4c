"""Nonlinear fits of effects: the compiled simulation inside a damped least-squares search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION, Parameter
from wind_sensors.diagnosis.explaining.descent import descended
from wind_sensors.diagnosis.explaining.problem import (
    Problem,
    parameters_of,
    values_of,
    with_values,
)
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

_LEAST_INFORMATION = 1e-4
"""Of a parameter with less information, in units of its difference, the recording sees nothing."""

WIDEST = 4.0
"""Differences for covariances go up to so many smallest sizes."""

EXACT = 0.02
"""Drop of the cost that moves the parameters by a seventh of their standard deviations."""

ROUGHLY = 0.3
"""The same where explanations are only compared with each other."""


@dataclass(frozen=True)
class Fit:
    """Terms fitted to a recording.

    Attributes:
        terms: With the fitted values.
        cost: Squared length of the white vector (minus twice the log-likelihood).
        vector: White vector at the fit.
        simulated: Simulation at the fit.
        covariance: Of all parameters, in the order of the terms and their parameters; infinite
            variance where the recording cannot see one.
        evaluations: Number of simulations it took.
        active: Number of parameters that the recording can see.
        slopes: Derivatives of what is compared (`Simulated.flat`) by the parameters in units of
            their steps, shape (l, parameters); None: not known. They hold in any null.
    """

    terms: tuple[Term, ...]
    cost: float
    vector: FloatArray
    simulated: Simulated
    covariance: FloatArray
    evaluations: int
    active: int = 0
    slopes: FloatArray | None = None


def without_term(known: Fit, left_out: int) -> Fit:
    """A fit's other terms where they are, with their derivatives; not fitted again."""
    owners = [k for k, _ in parameters_of(known.terms)]
    kept = [place for place, owner in enumerate(owners) if owner != left_out]
    return replace(
        known,
        terms=tuple(t for k, t in enumerate(known.terms) if k != left_out),
        slopes=None if known.slopes is None else known.slopes[:, kept],
    )


def fit(
    whitener: Whitener,
    station: Station,
    terms: Sequence[Term],
    rest: Simulated | None = None,
    iterations: int = 8,
    known: Fit | None = None,
    least: float = EXACT,
) -> Fit:
    """Fit terms by damped least squares within their bounds.

    Derivatives are taken by differences at the start, and anew after a step that gained less than
    those carried along promised.

    Args:
        whitener: The null of the recording.
        station: The station as commissioned.
        terms: Effects with starting values.
        rest: Simulation of the station whose untouched instruments are reused.
        iterations: Largest number of Gauss-Newton steps.
        known: Fit of the same effects, or of the first ones, near the same values, in whatever
            null, from which the derivatives are carried along.
        least: Drop of the cost that is worth another step, beside a share of the cost.

    Returns:
        The fit; without terms, what there is without any effect.
    """
    problem = Problem(whitener, station, terms, rest)
    start = problem.start(np.clip(values_of(terms), problem.low, problem.high))
    if not problem.parameters:
        return Fit(
            tuple(terms), start.cost, start.vector, start.simulated, np.zeros((0, 0)),
            problem.evaluations,
        )
    slopes = None
    if known is not None and known.slopes is not None:
        base = problem.compared(start.simulated)
        slopes = problem.slopes(start.values, base, carried=known.slopes)
    hollow = any(term.instrument in (STATION, PLATFORM) for term in terms)
    found = descended(problem, start, slopes, iterations, least, hollow)
    return Fit(
        with_values(terms, found.point.values),
        found.point.cost,
        found.point.vector,
        found.point.simulated,
        _covariance(found.normal, problem.parameters),
        problem.evaluations,
        int(np.count_nonzero(np.diag(found.normal) > _LEAST_INFORMATION)),
        found.slopes,
    )


def _covariance(normal: FloatArray, parameters: Sequence[Parameter]) -> FloatArray:
    """Covariance of parameters, infinite for those that are not seen.

    Args:
        normal: Products of the white derivatives, in units of `difference`.
        parameters: What they are by.
    """
    seen = np.diag(normal) > _LEAST_INFORMATION
    covariance = np.diag(np.where(seen, 0.0, np.inf))
    width = np.array([p.high - p.low for p in parameters])
    scale = np.array([p.difference for p in parameters])
    information = normal / np.outer(scale, scale) + np.diag(1e-9 / width**2)
    covariance[np.ix_(seen, seen)] = np.linalg.pinv(information[np.ix_(seen, seen)])
    return covariance


def cost_of(whitener: Whitener, station: Station, terms: Sequence[Term]) -> float:
    """Cost of terms as they are; infinite where the station is impossible.

    Args:
        whitener: The null.
        station: The station as commissioned.
        terms: Effects with their values.
    """
    simulated = whitener.comparison.possible(planted(station, terms))
    if simulated is None:
        return np.inf
    vector = whitener.of(simulated)
    return float(vector @ vector)


def covariance_of(whitener: Whitener, station: Station, explanation: Fit) -> FloatArray:
    """Covariance of the parameters of a fit in a null, from differences that matter.

    What a small difference changes is in part on which side of a bin's border a pulse falls: it
    looks like information and is none. So they are taken over the smallest size worth reporting
    and more, towards health.

    Args:
        whitener: The null.
        station: The station as commissioned.
        explanation: The fit.
    """
    problem = Problem(whitener, station, explanation.terms, explanation.simulated)
    values = np.clip(values_of(explanation.terms), problem.low, problem.high)
    steps = []
    for value, parameter in zip(values, problem.parameters, strict=True):
        departure = 0.0 if parameter.healthy is None else value - parameter.healthy
        size = np.clip(0.5 * abs(departure), parameter.minimum, WIDEST * parameter.minimum)
        back = -1.0 if departure > 0.0 else 1.0
        steps.append(back * max(float(size), parameter.difference))
    base = problem.compared(problem.simulate(values))
    jacobian = problem.whitened(problem.slopes(values, base, steps=np.array(steps)))
    return _covariance(jacobian.T @ jacobian, problem.parameters)
