"""The smallest size of an effect that a recording could have shown, with what it is a size of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect


@dataclass(frozen=True)
class SmallestSize:
    """How far from health a parameter has to be to be told from it, all else being known.

    Attributes:
        value: Departure from the healthy value.
        unit: Its unit, `1` for a share.
        parameter: Its name; of an effect with equal components all of them, with `or`.
    """

    value: float
    unit: str
    parameter: str


def smallest_size(effect: Effect, value: float, unit: str, relative: float) -> SmallestSize:
    """A size with the name of its parameter.

    Args:
        effect: Of which it is a size.
        value: Departure from health.
        unit: Its unit.
        relative: The same in units of the smallest worth reporting, which tells the parameter.
    """
    names = [
        p.name
        for p in effect.parameters
        if p.healthy is not None
        and p.unit == unit
        and bool(np.isclose(relative * p.minimum, value))
        and any(template[p.name] != p.healthy for template in effect.templates)
    ]
    return SmallestSize(value, unit, " or ".join(names))
