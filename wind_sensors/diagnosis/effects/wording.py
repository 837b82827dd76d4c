"""Sizes of effects in words."""

from __future__ import annotations

from math import isfinite

from wind_sensors.diagnosis.effects.definition import Parameter


def number_text(value: float, digits: int = 3) -> str:
    """A number as people write it: 1660 and not 1.66e+03.

    Args:
        value: The number.
        digits: Significant ones; numbers from a million on, and those below 1e-4, have a power of
            ten.
    """
    return f"{float(f'{value:.{digits}g}'):g}" if isfinite(value) else "?"


def parameter_text(parameter: Parameter, value: float) -> str:
    """A parameter with its value and its unit."""
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    return f"{parameter.name.replace('_', ' ')} {number_text(value)}{unit}"
