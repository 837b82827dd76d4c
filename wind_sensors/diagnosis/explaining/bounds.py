"""Parameters that ran into their bounds, and those that a recording does not ask for."""

from __future__ import annotations

from dataclasses import replace

from wind_sensors.diagnosis.effects.definition import Parameter
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.terms import Term

_MARGIN = 0.02
"""A value is at a bound within this share of the bounds' distance."""

_REACH = 0.85
"""What multiplies (a gain, an inertia) is at its upper bound from this share of the way on, and not
at its lower one before: a share of all that it may grow by is much of what it may shrink by."""


def run_away(term: Term) -> frozenset[str]:
    """Names of the parameters that ended at a bound, where they cannot be."""
    return frozenset(
        p.name for p in term.effect.parameters if _is_at_bound(p, term.values[p.name])
    )


def _is_at_bound(parameter: Parameter, value: float) -> bool:
    margin = _MARGIN * (parameter.high - parameter.low)
    if parameter.healthy is None:
        beyond = value > parameter.high - margin
        if parameter.low == -parameter.high:
            beyond |= value < parameter.low + margin
        # A wake as wide as half the horizon is none, nor does a flow past a mast bend more.
        return beyond and not parameter.wraps and parameter.value_from == "fit"
    if not parameter.graded or not (parameter.minimum > 0.0 or parameter.limited):
        return False
    if parameter.healthy == 1.0 and value > 1.0 + _REACH * (parameter.high - 1.0):
        return True
    least = parameter.low + margin
    if parameter.healthy == 1.0:
        least = min(least, 1.0 - _REACH * (1.0 - parameter.low))
    at_bound = value < least or value > parameter.high - margin
    return at_bound and abs(value - parameter.healthy) > margin


def without_run_aways(term: Term) -> Term | None:
    """The term with what ran away held at its healthy value; None: then nothing would be left.

    A parameter that the recording hardly shows follows the errors of the others as far as it may.
    An effect that contains others would become one of those.

    Args:
        term: A fitted term.
    """
    gone = run_away(term)
    graded = [p for p in term.effect.parameters if p.graded and p.minimum > 0.0]
    tied = {p.name: p.healthy for p in graded if p.name in gone and p.healthy is not None}
    if not gone or term.effect.contains or len(tied) < len(gone) or len(tied) == len(graded):
        return None
    return replace(term, values={**term.values, **tied}, held=term.held | gone)


def without_idle(found: Fit, price: float) -> Term | None:
    """The newest term with what does not pay for itself held at its healthy value; None: all does.

    Only what goes with another quantity (grease that stiffens in the cold): without it the effect
    is the same one, only simpler.

    Args:
        found: A fit.
        price: What a further parameter costs.
    """
    number = len(found.terms) - 1
    goes_with = frozenset(p.name for p in found.terms[-1].effect.parameters if p.swing > 0.0)
    return _with_idle_held(found, number, goes_with, price)


def without_spare(found: Fit, price: float) -> tuple[Term, ...]:
    """The terms with what they are often there without held, where it does not pay for itself.

    What a fit leaves in it is noise (a tenth of a metre, half a degree), which a corrected station
    file would put into the wind. One of an effect's parameters stays.

    Args:
        found: A fit.
        price: What a further parameter costs.
    """
    return tuple(
        _with_idle_held(
            found, k, frozenset(p.name for p in term.effect.parameters if p.spare), price
        )
        or term
        for k, term in enumerate(found.terms)
    )


def _with_idle_held(
    found: Fit, number: int, may_rest: frozenset[str], price: float
) -> Term | None:
    """One term with some parameters held that do not pay for themselves; None: all do.

    Args:
        found: A fit.
        number: Of the term.
        may_rest: Names of those parameters that may be held.
        price: What a further parameter costs.
    """
    term = found.terms[number]
    parameters = term.effect.parameters
    first = sum(len(t.effect.parameters) for t in found.terms[:number])
    variances = found.covariance.diagonal()[first : first + len(parameters)]
    idle = {
        p.name: p.healthy
        for p, variance in zip(parameters, variances, strict=True)
        if p.name in may_rest
        and p.healthy is not None
        and term.fits(p)
        and (term.values[p.name] - p.healthy) ** 2 < price * variance
    }
    stays = any(
        p.graded and p.name not in idle and term.values[p.name] != p.healthy for p in parameters
    )
    if not idle or not stays:
        return None
    return replace(term, values={**term.values, **idle}, held=term.held | frozenset(idle))
