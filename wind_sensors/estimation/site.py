"""How sure the corrections for the site are: wakes and flow around the mount."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.core import Estimates
from wind_sensors.instruments.dynamics.wake import wake_factor
from wind_sensors.station.model import Rotor, Station

FloatArray = npt.NDArray[np.float64]

WAKE_UNCERTAINTY = 0.2
"""Relative standard uncertainty of a wake's deficit at any bearing: none has quite this shape."""


def wake_deviation(station: Station, apparent: FloatArray) -> FloatArray:
    """Relative standard uncertainty of the speed that wakes leave after their correction.

    Args:
        station: The station, without changes.
        apparent: Wind in the sensor frame [m/s], shape (n, 3).

    Returns:
        Shape (n,); of the rotor that knows the wind best.
    """
    bearing = np.arctan2(-apparent[:, 1], -apparent[:, 0])
    best: FloatArray | None = None
    for rotor in station.instruments:
        if not isinstance(rotor, Rotor):
            continue
        factor = np.ones(apparent.shape[0])
        lost = np.zeros(apparent.shape[0])
        for wake in rotor.wake_shadows:
            off = bearing - np.radians(wake.bearing_from_deg)
            left = np.array(
                [wake_factor(a, wake.depth, np.radians(wake.width_deg), wake.flank) for a in off]
            )
            factor *= left
            lost = np.hypot(lost, 1.0 - left)
        deviation = WAKE_UNCERTAINTY * lost / np.maximum(factor, 0.05)
        best = deviation if best is None else np.minimum(best, deviation)
    return np.zeros(apparent.shape[0]) if best is None else best


def has_wakes(station: Station) -> bool:
    """Whether every rotor of the station stands in some wake."""
    rotors = [i for i in station.instruments if isinstance(i, Rotor)]
    return bool(rotors) and all(r.wake_shadows for r in rotors)


def site_covariance(station: Station, apparent: FloatArray) -> FloatArray:
    """Covariance that the correction of wakes adds to the apparent wind [m^2/s^2], (n, 3, 3).

    It lies along the wind and does not average out while the wind stays in the sector.
    """
    along = wake_deviation(station, apparent)[:, np.newaxis] * apparent
    covariance: FloatArray = along[:, :, np.newaxis] * along[:, np.newaxis, :]
    return covariance


def with_site_covariance(station: Station, estimates: Estimates) -> Estimates:
    """Estimates with what the correction of wakes leaves unsure."""
    if not has_wakes(station):
        return estimates
    added = site_covariance(station, estimates.apparent)
    turn = estimates.to_earth
    return estimates._replace(
        covariance=estimates.covariance + turn @ added @ turn.transpose(0, 2, 1),
        apparent_covariance=estimates.apparent_covariance + added,
    )
