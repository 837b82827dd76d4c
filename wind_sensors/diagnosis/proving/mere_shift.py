"""Whether what is said to go with the direction has been shown to: a constant may do as well."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.intervals import window_of
from wind_sensors.diagnosis.explaining.search import (
    PENALTY_PER_FURTHER_PARAMETER,
    PENALTY_PER_PARAMETER,
)
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

SHOWN = 4.0
"""What goes with the direction must bring this much more than constants do, its parameters paid
for: as much as one name must be ahead of another."""


def is_a_mere_shift(naming: Naming, station: Station) -> bool:
    """Whether constants explain as much as an effect that goes with the direction.

    Where the wind comes from few sides every effect of the direction is a shift of a vane's
    readings, or a share of a rotor's rate, there. Which one it is, nobody has seen.

    Args:
        naming: The explanation.
        station: As commissioned.
    """
    return any(
        beyond_constants(naming, station, term) < SHOWN
        for term in naming.fit.terms
        if term.effect.goes_with_direction
    )


def beyond_constants(naming: Naming, station: Station, term: Term) -> float:
    """What an effect brings beyond constants in its place, parameters of both paid for.

    Constants are a shift of a vane's readings and a share of a rotor's rate, while the effect
    holds.

    Args:
        naming: The explanation.
        station: As commissioned.
        term: One of its effects.
    """
    null = naming.adequate
    comparison = null.comparison
    others = [t for t in naming.fit.terms if t is not term]
    without = comparison.possible(planted(station, others))
    if without is None:
        return np.inf
    begin, end = window_of(comparison, term.interval)
    while_held = (comparison.grid.centres >= begin) & (comparison.grid.centres <= end)
    corrected = naming.fit.simulated.series
    left = null.of(without)
    n = comparison.coefficients
    shifts = []
    for k, channel in enumerate(comparison.channels):
        if np.any(corrected[channel.name] != without.series[channel.name]):
            shift = np.zeros(left.size)
            shift[k * n : (k + 1) * n] = _shift(naming, without, channel, while_held)
            shifts.append(shift)
    if not shifts:
        return np.inf
    white = null.through_standing(np.array(shifts))
    sizes = np.linalg.lstsq(white.T, left, rcond=None)[0]
    by_constants = left - sizes @ white
    by_effect = null.of(naming.fit.simulated)
    return (
        float(by_constants @ by_constants)
        + _price(len(shifts))
        - float(by_effect @ by_effect)
        - _price(len(term.effect.parameters))
    )


def _price(parameters: int) -> float:
    """What parameters cost."""
    return PENALTY_PER_PARAMETER + PENALTY_PER_FURTHER_PARAMETER * (parameters - 1)


def _shift(
    naming: Naming, without: Simulated, channel: Channel, while_held: npt.NDArray[np.bool_]
) -> FloatArray:
    """Whitened change of one channel's coefficients by a constant, shape (coefficients,)."""
    null = naming.adequate
    comparison = null.comparison
    of_vane = channel.kind == "vane_angle"
    series = comparison.speed if of_vane else without.series[channel.name]
    trust = null.trust[channel.name]
    change = spectra.to_cosine(comparison.masked(series * while_held))[: comparison.coefficients]
    return np.asarray(trust.slope * change / trust.deviation)
