"""Finding the reference's place: from the delays of healthy recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observation import channels_of
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.reference_place import Place
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.reference_lag import SINGLE_LAG
from wind_sensors.diagnosis.healthy.whitening import trust_of
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

PLACE_STEP = 0.2
LATENCY_STEP = 0.05
"""Steps of the reference's place [m] and of a delay [s] for differences."""

SURE_OF_PLACE = 4.0
"""Standard deviations that a place must lie away from the instruments to be believed: beside a
reference that stands across the wind delays come and go without following its direction."""

LATENCY_SCATTER = 0.02
LATENCY_PRIOR = 0.05
"""Delays of a healthy channel [s], from day to day and altogether: the rotor of a certificate
answers a little sooner or later than the real one."""


def located(recordings: Sequence[Recording], baseline: Baseline) -> Place | None:
    """Where the reference stands, from the delays of healthy recordings; None: they do not tell.

    A delay that does not change with the wind's direction is the instrument's own.

    Args:
        recordings: Healthy recordings.
        baseline: Knows their channels' noise.
    """
    station = baseline.station
    if station.reference is None or station.reference.separation <= 0.0:
        return None
    separation = station.reference.separation
    names = [c.name for c in channels_of(station)]
    latency = catalogue()["timestamp_latency"]
    own = np.full(len(names), 1.0)
    scatter = np.concatenate((np.full(2, SINGLE_LAG * separation), LATENCY_SCATTER * own))
    prior = np.concatenate((np.full(2, np.sqrt(0.5) * separation), LATENCY_PRIOR * own))
    place = Place(0.0, 0.0, float(prior[0]))
    for _ in range(2):
        here = np.concatenate(([place.x, place.y], np.zeros(len(names))))
        seen = []
        for recording in recordings:
            comparison = prepare(recording, station, place)
            without = comparison.simulate(station)
            trust = trust_of(comparison, without, baseline)
            size = comparison.coefficients * len(comparison.channels)
            nothing = comparison.vector(without, trust)[:size]
            rows = np.zeros((prior.size, size))
            for k, (dx, dy) in enumerate(((PLACE_STEP, 0.0), (0.0, PLACE_STEP))):
                moved = prepare(
                    recording, station, replace(place, x=place.x + dx, y=place.y + dy)
                )
                white = moved.vector(moved.simulate(station), trust)[:size]
                rows[k] = (nothing - white) / PLACE_STEP
            for channel in comparison.channels:
                late = with_effect(
                    station, latency, channel.instrument, {"latency": LATENCY_STEP}
                )
                only = comparison.affected(station, channel.instrument)
                white = comparison.vector(comparison.simulate(late, only, without), trust)[:size]
                rows[2 + names.index(channel.name)] += (nothing - white) / LATENCY_STEP
            information = rows @ rows.T
            seen.append((information, rows @ nothing + information @ here))
        solved, covariance = pooled(seen, scatter, prior)
        error = float(np.sqrt(np.max(np.linalg.eigvalsh(covariance[:2, :2]))))
        place = Place(float(solved[0]), float(solved[1]), error)
    return place if np.hypot(place.x, place.y) > SURE_OF_PLACE * place.error else None


def pooled(
    seen: Sequence[tuple[FloatArray, FloatArray]], scatter: FloatArray, prior: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """One vector from several witnesses, each of which scatters beyond its own error.

    Args:
        seen: Of each witness: the normal matrix, shape (k, k), and its product with what the
            witness says, shape (k,).
        scatter: Standard deviation of what witnesses say, shape (k,).
        prior: Standard deviation about nought of the vector, shape (k,).

    Returns:
        The vector, shape (k,), and its covariance, shape (k, k).
    """
    least = 1e-6 * np.eye(prior.size)
    normal, right = np.diag(prior**-2.0), np.zeros(prior.size)
    for information, product in seen:
        estimate = np.linalg.solve(information + least, product)
        weight = np.linalg.inv(np.linalg.inv(information + least) + np.diag(scatter**2))
        normal += weight
        right += weight @ estimate
    covariance = np.linalg.inv(normal)
    solved: FloatArray = np.asarray(covariance @ right, dtype=np.float64)
    return solved, np.asarray(covariance, dtype=np.float64)
