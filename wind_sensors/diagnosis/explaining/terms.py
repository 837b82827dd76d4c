"""What may be said of a recording: effects at work, each on one instrument, in one interval."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect, Parameter, with_effect
from wind_sensors.station.model import Station

Interval = tuple[float, float | None]
ALWAYS: Interval = (0.0, None)

HALFWAY = math.log(2.0)
"""Time constants until what grows has half of its size: then a step would begin that fits it."""


@dataclass(frozen=True)
class Term:
    """An effect at work: one instrument, one set of values, one interval.

    Attributes:
        effect: The effect.
        instrument: Name of the instrument, or `platform`.
        values: Parameters, and what else the signals tell the effect's simulation.
        interval: Start and end [s since the start of the recording]; (0, None) is always.
        held: Names of parameters that keep their values in a fit: the signals tell them, or the
            recording does not.
    """

    effect: Effect
    instrument: str
    values: Mapping[str, float]
    interval: Interval = ALWAYS
    held: frozenset[str] = frozenset()

    def planted(self, station: Station) -> Station:
        """The station with the effect."""
        return with_effect(station, self.effect, self.instrument, self.values, self.interval)

    @property
    def grows(self) -> bool:
        """Whether it approaches its size while it holds."""
        return self.effect.growth(self.values) > 0.0

    @property
    def growing(self) -> tuple[Term, ...]:
        """The same, growing, where it is taken to begin at its full size.

        It grows from there, from so much earlier that half of it has grown by then, or always.
        """
        if self.grows or not self.effect.grows or self.interval == ALWAYS:
            return ()
        (parameter,) = (p for p in self.effect.parameters if p.name == self.effect.grows)
        begin, end = self.interval
        return tuple(
            replace(self, values={**self.values, parameter.name: time}, interval=interval)
            for time in parameter.starts
            for interval in (self.interval, (max(begin - HALFWAY * time, 0.0), end), ALWAYS)
        )

    @property
    def relative_size(self) -> float:
        """Size in units of the smallest worth reporting."""
        return self.effect.relative_size(self.values)

    @property
    def key(self) -> tuple[str, str]:
        """Effect and instrument."""
        return self.effect.name, self.instrument

    @property
    def leaves_noise(self) -> bool:
        """Whether what it does is drawn at random or hangs on the last digit."""
        return self.effect.noisy or self.sticks

    @property
    def sticks(self) -> bool:
        """Whether it holds and lets go."""
        sticks = self.effect.sticks
        return sticks is not None and sticks(self.values)

    def fits(self, parameter: Parameter) -> bool:
        """Whether a fit may move one of its parameters."""
        return parameter.value_from == "fit" and parameter.name not in self.held

    @property
    def has_certain_form(self) -> bool:
        """Whether nothing that others leave beside it can be its own form: that is certain, or the
        signals tell how large it is."""
        return self.effect.exact or any(
            p.told_to > 0.0 and p.name in self.held for p in self.effect.parameters
        )

    @property
    def is_told(self) -> bool:
        """Whether the signals tell everything about it, that it is this among it."""
        return self.effect.unmistakable


def suggested(effect: str, instrument: str, **values: float) -> Term:
    """A term of the catalogue that always holds, with values to begin a fit from."""
    return Term(catalogue()[effect], instrument, values)


def planted(station: Station, terms: Sequence[Term]) -> Station:
    """The station with all terms.

    Terms that hold as they are all the time come first, so that changes build on them.
    """
    for term in sorted(terms, key=lambda t: t.interval != ALWAYS or t.grows):
        station = term.planted(station)
    return station


def reached_by(comparison: Comparison, station: Station, terms: Sequence[Term]) -> frozenset[str]:
    """Instruments whose signals any of some terms can change.

    Args:
        comparison: The recording.
        station: As commissioned.
        terms: Some terms.
    """
    return frozenset(
        name for term in terms for name in comparison.affected(station, term.instrument)
    )


def of_one_equation(terms: Sequence[Term]) -> bool:
    """Whether terms are constants of one linear equation of one instrument, which tells each.

    Args:
        terms: Some terms.
    """
    equations = {(t.effect.constant_of, t.instrument) for t in terms}
    return len(terms) > 1 and len(equations) == 1 and terms[0].effect.constant_of != ""


def simulated_with(comparison: Comparison, station: Station, terms: Sequence[Term]) -> Simulated:
    """Simulation with a part of an explanation; without any effect, if that part cannot be.

    A torque that grows with the rate runs away where the effect that held it back is left out.

    Args:
        comparison: The recording.
        station: The station as commissioned.
        terms: Some of the terms of an explanation that can be.
    """
    return comparison.possible(planted(station, terms)) or comparison.simulate(station)
