"""The smallest size of each effect that a recording could have shown."""

from __future__ import annotations

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.explaining.acceptance import ACCEPTED_GAIN
from wind_sensors.diagnosis.explaining.screening import group_templates
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_PARAMETER, Searcher
from wind_sensors.diagnosis.healthy.whitening import Whitener


def smallest_detectable(
    searcher: Searcher, whitener: Whitener
) -> dict[str, tuple[float, str, float]]:
    """Smallest size of each effect that the recording could have shown.

    Returns:
        By `effect` (the most sensitive instrument): value, unit and size in units of the
        smallest worth reporting.
    """
    signatures = searcher.white_signatures(whitener)
    power = np.einsum("ij,ij->i", signatures, signatures)
    templates = searcher.probes.templates
    out: dict[str, tuple[float, str, float]] = {}
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
        graded = [p for p in effect.parameters if p.healthy is not None and p.minimum > 0.0]
        moved = [p for p in graded if template.values[p.name] != p.healthy]
        if not moved:
            continue
        parameter = moved[0]
        healthy = parameter.healthy or 0.0
        value = amplitude * abs(template.values[parameter.name] - healthy)
        size = value / parameter.minimum
        if effect_name not in out or size < out[effect_name][2]:
            out[effect_name] = (value, parameter.unit, size)
    return out
