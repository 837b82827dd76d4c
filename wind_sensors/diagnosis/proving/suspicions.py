"""Whether a fault that is in no catalogue explains more than what would be named."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect, entry_of, touched
from wind_sensors.diagnosis.effects.suspected import SUSPECTS
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.fitting import Fit, Term, fit, planted
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_PARAMETER
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.station.model import Station

OUTDONE = 10.0
"""A name is withdrawn if a suspected fault in its place lowers the cost by more than this, each
parameter paid for."""


STARTS = 3
"""From so many of its templates a fault is fitted."""


@dataclass(frozen=True)
class Suspicion:
    """A fault without an identifier that explains more than an effect.

    Attributes:
        fault: What it would be, with its size.
        effect: Name of the effect in whose place it was tried.
        gain: Drop of the cost by the exchange, parameters paid for.
    """

    fault: Term
    effect: str
    gain: float

    @property
    def words(self) -> str:
        """For people."""
        sizes = ", ".join(
            f"{self.fault.values[p.name]:.2g} {p.unit}" for p in self.fault.effect.parameters
        )
        return (
            f"{self.fault.effect.meaning} ({self.fault.instrument}, {sizes}), which the catalogue "
            f"does not hold, would explain more by {self.gain:.0f} in minus twice the "
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
    whitener = naming.whitener
    known = _price(whitener, naming.fit)

    def tried(exchange: tuple[Term, Effect]) -> Suspicion:
        term, fault = exchange
        others = [t for t in naming.fit.terms if t is not term]
        found = min(
            (
                fit(whitener, station, [*others, start])
                for start in _starts(whitener, station, others, term, fault)
            ),
            key=lambda f: f.cost,
        )
        return Suspicion(found.terms[-1], term.effect.name, known - _price(whitener, found))

    exchanges = [(t, fault) for t in naming.fit.terms for fault in _mistaken_for(t, station)]
    best = max(in_parallel(tried, exchanges, workers), key=lambda s: s.gain, default=None)
    return best if best is not None and best.gain > OUTDONE else None


def _mistaken_for(term: Term, station: Station) -> list[Effect]:
    """Suspected faults that can be mistaken for a term."""
    return [
        fault
        for fault in SUSPECTS
        if term.effect.name in fault.confusable
        and any(
            fault.applies(entry_of(station, entry), station)
            for entry in touched(station, fault, term.instrument)
        )
    ]


def _starts(
    whitener: Whitener, station: Station, others: list[Term], term: Term, fault: Effect
) -> list[Term]:
    """Those sizes and places of a fault, in a term's place, that explain most as they are."""
    terms = [Term(fault, term.instrument, dict(v), term.interval) for v in fault.templates]

    def cost(start: Term) -> float:
        simulated = whitener.comparison.possible(planted(station, [*others, start]))
        return math.inf if simulated is None else float(np.sum(whitener.of(simulated) ** 2))

    return sorted(terms, key=cost)[:STARTS]


def _price(whitener: Whitener, explanation: Fit) -> float:
    """Cost of an explanation, its parameters paid for."""
    left = whitener.of(explanation.simulated)
    parameters = sum(len(t.effect.parameters) for t in explanation.terms)
    return float(left @ left) + PENALTY_PER_PARAMETER * parameters
