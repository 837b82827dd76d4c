"""Vanes whose readings tell no direction for a while: what their series is worth there."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import spectra

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

ROUNDS = 6
"""After so many rounds the share that is shown changes no more than chance does."""

DECAYS = np.append(np.geomspace(0.01, 10.0, 61), np.inf)
"""Frequencies [Hz] with which the share that is shown may decay, or not at all."""


def as_known_elsewhere(
    series: FloatArray, expected: FloatArray, untold: BoolArray, dt: float
) -> FloatArray:
    """A measured series, where nothing is told, as far as the simulation is right where it is.

    To put in what the simulation expects would let every eddy that only the reference felt look
    shared, and what differs where the vane does tell look like much less noise than it is. What
    is put in is the mean to be expected: of each frequency as much as the told series has of it,
    found in turns with the series that it completes (Dempster, Laird and Rubin 1977). It falls
    exponentially with the frequency, as eddies at a distance resemble each other (Davenport 1961).

    Args:
        series: Measured [m/s], shape (n,); what stands at `untold` is not looked at.
        expected: Simulated [m/s], shape (n,).
        untold: Where nothing is told, shape (n,).
        dt: Width of a bin [s].

    Returns:
        The series with other values at `untold`, shape (n,).
    """
    simulated = spectra.to_cosine(expected)
    frequency = spectra.cosine_frequencies(simulated.size, dt)
    shares = np.exp(-frequency / DECAYS[:, np.newaxis])
    power = shares**2 @ simulated**2
    completed = np.where(untold, expected, series)
    for _ in range(ROUNDS):
        shown = shares @ (simulated * spectra.to_cosine(completed))
        share = shares[np.argmin(power - 2.0 * shown)]
        completed = np.where(untold, spectra.from_cosine(share * simulated), series)
    return completed
