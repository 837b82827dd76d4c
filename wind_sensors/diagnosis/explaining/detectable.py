"""The smallest size of each effect that a recording could have shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect, Parameter
from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.explaining.acceptance import ACCEPTED_GAIN
from wind_sensors.diagnosis.explaining.screening import group_templates
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_PARAMETER, Searcher
from wind_sensors.diagnosis.healthy.whitening import Whitener


@dataclass(frozen=True)
class Detectable:
    """A size that a recording could have shown.

    Attributes:
        size: With its parameter and unit.
        relative: In units of the smallest worth reporting.
    """

    size: SmallestSize
    relative: float


def smallest_detectable(searcher: Searcher, whitener: Whitener) -> dict[str, Detectable]:
    """Smallest size of each effect that the recording could have shown.

    Returns:
        By `effect`, at the most sensitive instrument.
    """
    signatures = searcher.white_signatures(whitener)
    power = np.einsum("ij,ij->i", signatures, signatures)
    templates = searcher.probes.templates
    out: dict[str, Detectable] = {}
    for (effect_name, _), members in group_templates(templates).items():
        # Of a small size much of what it changes may be chance: where larger ones were simulated,
        # they tell how much an effect shows.
        largest = max(abs(templates[k].multiple) for k in members)
        best = max(
            (k for k in members if abs(templates[k].multiple) == largest),
            key=lambda k: float(power[k]),
        )
        if power[best] < 1e-6:
            continue
        template = templates[best]
        effect: Effect = template.effect
        needed = ACCEPTED_GAIN + PENALTY_PER_PARAMETER * len(effect.parameters)
        amplitude = float(np.sqrt(needed / power[best]))
        moved = [p for p in _graded(effect) if template.values[p.name] != p.healthy]
        if not moved:
            continue
        parameter = moved[0]
        relative = amplitude * effect.relative_size(template.values)
        value = relative * parameter.minimum
        if effect_name not in out or relative < out[effect_name].relative:
            size = SmallestSize(value, parameter.unit, " or ".join(equals_of(effect, parameter)))
            out[effect_name] = Detectable(size, relative)
    return out


def equals_of(effect: Effect, parameter: Parameter) -> list[str]:
    """Names of the parameters in which an effect is tried as in this one, itself among them.

    A deviation's sine and cosine are one size in two directions.

    Args:
        effect: The effect.
        parameter: One of its parameters, with which it is tried.
    """
    return [
        p.name
        for p in _graded(effect)
        if (p.unit, p.minimum) == (parameter.unit, parameter.minimum)
        and any(template[p.name] != p.healthy for template in effect.templates)
    ]


def _graded(effect: Effect) -> list[Parameter]:
    """Parameters that have a healthy value and a smallest size worth reporting."""
    return [p for p in effect.parameters if p.healthy is not None and p.minimum > 0.0]
