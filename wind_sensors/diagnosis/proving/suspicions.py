"""Whether a fault that is in no catalogue explains more than what would be named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wind_sensors.diagnosis.effects.definition import STATION, Effect, entry_of, touched
from wind_sensors.diagnosis.effects.suspected import SUSPECTS
from wind_sensors.diagnosis.effects.wording import parameter_text
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.fitting import ROUGHLY, Fit, fit
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_PARAMETER, interval_penalty
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.station.model import Station

OUTDONE = 10.0
"""A name is withdrawn if a suspected fault in its place lowers the cost by more than this, each
parameter and each beginning and end paid for."""

STARTS = 2
"""From so many of its templates, those that explain most as they are, a fault is fitted."""

ALONE = 4
TOGETHER = 3
"""To describe an unknown, faults are fitted alone in so many steps, the best few of them with what
fits."""

BESIDE = 50.0
"""An unknown is described by a fault that lowers the cost by more than this beside what fits."""


class Trial(NamedTuple):
    """A suspected fault in the place of an effect, or beside all of them (None)."""

    term: Term | None
    fault: Term


@dataclass(frozen=True)
class Suspicion:
    """A fault without an identifier that explains more than an effect.

    Attributes:
        fault: What it would be, with its size.
        effect: Name of the effect in whose place it was tried; None: beside all of them.
        gain: Drop of the cost by it, parameters, beginnings and ends paid for.
    """

    fault: Term
    effect: str | None
    gain: float

    @property
    def words(self) -> str:
        """For people."""
        sizes = ", ".join(
            parameter_text(p, self.fault.values[p.name]) for p in self.fault.effect.parameters
        )
        against = f" than {self.effect}" if self.effect is not None else ""
        return (
            f"{self.fault.effect.meaning} ({self.fault.instrument}: {sizes}), which the catalogue "
            f"does not hold, would explain more{against}, by {self.gain:.0f} in minus twice the "
            "log-likelihood"
        )


def suspicion_of(naming: Naming, station: Station, workers: int = 1) -> Suspicion | None:
    """The suspected fault that explains most beyond what the effect in its place does.

    Args:
        naming: The explanation.
        station: As commissioned.
        workers: Processes.

    Returns:
        None: no suspected fault explains more than the effects with which it can be confused.
    """
    chosen = _promising(naming, station, _in_places(naming, station), workers)
    return _most_telling(naming, station, chosen, workers)


def suspicion_beside(naming: Naming, station: Station, workers: int = 1) -> Suspicion | None:
    """The same, beside what fits, too, where that is known not to be all.

    Nothing is decided by it: of the faults only those are fitted together with what fits that
    explain most when they are fitted alone.
    """
    compared = sorted({c.instrument for c in naming.whitener.comparison.channels})
    starts = [*_in_places(naming, station), *_beside_all(compared, station)]
    chosen = _promising(naming, station, starts, workers)

    def alone(start: Trial) -> float:
        others = planted(station, _with_fault(naming, start)[:-1])
        return fit(naming.whitener, others, [start.fault], None, ALONE, least=ROUGHLY).cost

    costs = in_parallel(alone, chosen, workers)
    best = sorted(zip(costs, chosen, strict=True), key=lambda pair: pair[0])[:TOGETHER]
    return _most_telling(naming, station, [start for _, start in best], workers)


def _with_fault(naming: Naming, start: Trial) -> list[Term]:
    """Terms of a trial, the fault last."""
    return [*(t for t in naming.fit.terms if t != start.term), start.fault]


def _promising(
    naming: Naming, station: Station, starts: Sequence[Trial], workers: int
) -> list[Trial]:
    """Of each fault in each place the templates that explain most as they are."""
    whitener = naming.whitener

    def as_it_is(start: Trial) -> float:
        tried = planted(station, _with_fault(naming, start))
        simulated = whitener.comparison.possible(tried)
        return math.inf if simulated is None else float(np.sum(whitener.of(simulated) ** 2))

    costs = in_parallel(as_it_is, starts, workers)
    cheapest: dict[tuple[object, ...], list[Trial]] = {}
    for cost, start in sorted(zip(costs, starts, strict=True), key=lambda pair: pair[0]):
        if math.isinf(cost):
            continue
        key = (
            start.term.key if start.term is not None else None,
            start.fault.key,
            start.fault.interval,
        )
        cheapest.setdefault(key, []).append(start)
    return [start for group in cheapest.values() for start in group[:STARTS]]


def _most_telling(
    naming: Naming, station: Station, starts: Sequence[Trial], workers: int
) -> Suspicion | None:
    """The fault that explains most when it is fitted with the other terms, if it is enough."""
    whitener = naming.whitener

    def fitted(start: Trial) -> Suspicion:
        found = fit(whitener, station, _with_fault(naming, start))
        gain = _price(whitener, naming.fit) - _price(whitener, found)
        effect = start.term.effect.name if start.term is not None else None
        return Suspicion(found.terms[-1], effect, gain)

    found = in_parallel(fitted, starts, workers)
    telling = [s for s in found if s.gain > (OUTDONE if s.effect is not None else BESIDE)]
    return max(telling, key=lambda s: s.gain, default=None)


def _in_places(naming: Naming, station: Station) -> list[Trial]:
    """Suspected faults in the place of each effect."""
    return [start for term in naming.fit.terms for start in _in_place_of(term, station)]


def _in_place_of(term: Term, station: Station) -> list[Trial]:
    """Suspected faults that can be mistaken for a term, in all their templates.

    What seems to begin or end inside the record may be one that always holds: a vane comes to the
    heading at which it catches when the wind has turned.
    """
    return [
        Trial(term, Term(fault, entry, dict(values), interval))
        for fault in SUSPECTS
        for interval in dict.fromkeys((term.interval, ALWAYS))
        if term.effect.name in fault.confusable
        for entry in _entries(fault, term.instrument, station)
        for values in fault.templates
    ]


def _entries(fault: Effect, instrument: str, station: Station) -> tuple[str, ...]:
    """Entries of the station that a fault of an instrument can be in: itself, its vanes, or all."""
    found = touched(station, fault, instrument)
    able = tuple(name for name in found if fault.applies(entry_of(station, name), station))
    return (STATION,) if able and fault.everywhere else able


def _beside_all(instruments: Sequence[str], station: Station) -> list[Trial]:
    """Suspected faults that instruments can have, or their reference once, in all templates."""
    return [
        Trial(None, Term(fault, entry, dict(values)))
        for fault in SUSPECTS
        for entry in dict.fromkeys(e for i in instruments for e in _entries(fault, i, station))
        for values in fault.templates
    ]


def _price(whitener: Whitener, explanation: Fit) -> float:
    """Cost of an explanation, its parameters, beginnings and ends paid for."""
    left = whitener.of(explanation.simulated)
    parameters = sum(len(t.effect.parameters) for t in explanation.terms)
    edges = sum(interval_penalty(t) for t in explanation.terms)
    return float(left @ left) + PENALTY_PER_PARAMETER * parameters + edges
