"""Delays that are no fault: the wind's way from the reference to the instruments.

It takes up to separation / speed, less when it comes from aside. That is common to all channels,
but not all of them follow the same eddies; and it changes while the wind turns, which looks like a
clock that drifts. Where healthy recordings told the reference's place, only what is uncertain of it
is left.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.reference_place import Place
from wind_sensors.diagnosis.effects.definition import STATION
from wind_sensors.diagnosis.explaining.signatures import Template
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

SLOW_WIND = 0.1
"""Quantile of the wind's speed that takes longest from the reference to the instruments."""

DETOUR = 1.5
"""Delays are up to so many times longer than the way at that speed."""

COMMON_LAG = 0.5
"""Standard deviation of the common delay, in separations over the wind's speed, where nobody knows
the reference's place."""

SINGLE_LAG = 0.25
"""The same of what a channel adds of its own, and of the change within half a record."""

APART = 0.75
"""What a delay of one instrument may differ from that of the others in the same eddies, in
separations: three times `SINGLE_LAG`."""

LONGEST_DELAY = 3.0
"""Delays of other instruments are looked for up to this [s]."""

SURELY = 2.0
"""Standard deviations that a delay may be long for the wind's way from a known place."""


def lag_weights(comparison: Comparison, templates: Sequence[Template]) -> FloatArray:
    """One standard deviation of each delay that the wind's way may bring, as sums of templates.

    Args:
        comparison: The recording.
        templates: Effects, those of the clocks among them.

    Returns:
        Shape (k, templates): the delay and the drift common to all channels, and the delay of each;
        no rows for a reference at the same place.
    """
    speed = float(np.mean(comparison.speed))
    delay = _separation(comparison) / speed
    place = comparison.place
    together = COMMON_LAG * delay if place is None else place.error / speed
    half = 0.5 * comparison.grid.n * comparison.grid.dt
    common, drifting = np.zeros((2, len(templates)))
    rows = []
    for k, template in enumerate(templates):
        if template.number != 0 or template.multiple != 1.0 or template.instrument == STATION:
            continue
        if template.effect.name == "timestamp_latency":
            common[k] = together / template.values["latency"]
            row = np.zeros(len(templates))
            row[k] = SINGLE_LAG * delay / template.values["latency"]
            rows.append(row)
        elif template.effect.name == "clock_drift":
            turning = min(SINGLE_LAG * delay, together)
            drifting[k] = 1e6 * turning / half / template.values["drift"]
    found = np.array([common, drifting, *rows])
    return np.asarray(found[np.any(found, axis=1)])


def misplaced(comparison: Comparison, station: Station, without: Simulated) -> FloatArray:
    """What the error of a learnt place of the reference changes, one standard deviation a row.

    Its delays follow the wind's direction, so that on a platform they change with the course.

    Args:
        comparison: The recording.
        station: The station as commissioned.
        without: Its simulation.

    Returns:
        Changes of what is compared, shape (2, l), or (0, l) without a known place.
    """
    healthy = without.flat(comparison.channels)
    place = comparison.place
    if place is None:
        return np.zeros((0, healthy.size))
    shifts = (Place(place.error, 0.0, 0.0), Place(0.0, place.error, 0.0))
    moved = [comparison.with_reference_at(shift).simulate(station) for shift in shifts]
    return np.array([np.nan_to_num(m.flat(comparison.channels) - healthy) for m in moved])


def is_a_way_of_the_wind(comparison: Comparison, term: Term, before: Simulated) -> bool:
    """Whether a delay is no longer than the wind takes between reference and instruments.

    A drift may come from delays of either sign at the record's ends. The way is much the same to
    all instruments, so that a delay of one which the others do not show is none.

    Args:
        comparison: The recording.
        term: The delay.
        before: Simulation without it.
    """
    slow = float(np.quantile(comparison.speed, SLOW_WIND))
    separation = _separation(comparison)
    place = comparison.place
    way = DETOUR * separation / slow
    if place is not None:
        uncertain = np.hypot(place.error, SINGLE_LAG * separation)
        way = min(way, SURELY * float(uncertain) / slow)
    if term.effect.name == "timestamp_latency":
        latency = term.values["latency"]
        others = _delays_of_others(comparison, term, before)
        alone = others and abs(latency - float(np.mean(others))) * slow > APART * separation
        return abs(latency) < way and not alone
    if term.effect.name == "clock_drift":
        length = comparison.grid.n * comparison.grid.dt
        return abs(term.values["drift"]) * 1e-6 * length < 2.0 * way
    return False


def _delays_of_others(comparison: Comparison, term: Term, simulated: Simulated) -> list[float]:
    """Delays [s] of the channels that an effect does not reach."""
    reached = comparison.affected(comparison.station, term.instrument)
    return [
        _delay(comparison.measured.series[c.name], simulated.series[c.name], comparison.grid.dt)
        for c in comparison.channels
        if c.instrument not in reached
    ]


def _delay(measured: FloatArray, simulated: FloatArray, dt: float) -> float:
    """By how much a series is late [s]: where its covariance with its simulation is largest."""
    reach = round(LONGEST_DELAY / dt)
    late = measured - np.mean(measured)
    early = (simulated - np.mean(simulated))[reach:-reach]
    shifts = np.arange(-reach, reach + 1)
    covariance = np.array([late[reach + k : late.size - reach + k] @ early for k in shifts])
    best = int(np.clip(np.argmax(covariance), 1, covariance.size - 2))
    below, top, above = covariance[best - 1 : best + 2]
    between = 0.5 * (below - above) / min(below - 2.0 * top + above, -1e-12)
    return float(shifts[best] + between) * dt


def _separation(comparison: Comparison) -> float:
    reference = comparison.recording.station.reference
    return 0.0 if reference is None else reference.separation
