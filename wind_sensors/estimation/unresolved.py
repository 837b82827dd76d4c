"""What gusts above the bandwidth of the method `inverse` do to the speed that it tells.

The method solves the rotor's equation with its smoothed motion; the mean of that equation has the
products of what was smoothed away, too. To second order (Kristensen et al. (2014), (75), (92)) the
speed is too high by

    [a4 int F_u (1 - |G|^2) (k l0)^2/(1 + (k l0)^2) dk + int F_v (1 - |G|^2) dk/2 + mu2 <w^2>/2]/U

with the smoothing's gain G and inertial ranges F_u, F_v. A vertical wind that is not measured acts
at all frequencies. The term of v is that of a cup: the smoothed direction does not show it. A
propeller's vane turns it away in part, and it is left out.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.bias_terms import response_curvature
from wind_sensors.estimation.core import SmallScales
from wind_sensors.station.model import Cup, Propeller
from wind_sensors.station.parameters import rotor_parameters

FloatArray = npt.NDArray[np.float64]

VARIANCE_ABOVE = 0.1096
"""Variance above f of an inertial range with D(t) = level t^(2/3) is this level f^(-2/3)."""

_LOGARITHMS = np.linspace(np.log(1e-4), np.log(1e5), 1200)
_FREQUENCY = np.exp(_LOGARITHMS)
"""Relative to the half-power frequency of the smoothing."""
_LOST = _FREQUENCY ** (-2.0 / 3.0) * (1.0 - 2.0 ** -np.square(_FREQUENCY)) / 1.5
"""Variance per logarithm of frequency that a Gaussian smoothing takes, in units of that above the
half-power frequency."""
_CALM = 1.0
"""Slower winds are corrected as if they blew so fast [m/s]."""
_LARGEST = 0.3
"""No correction beyond this share of the speed: second order ends before."""
_LENGTHS = np.geomspace(1e-3, 1e3, 61)
_UNFOLLOWED = np.square(np.outer(_LENGTHS, _FREQUENCY))
_SHARES = (_LOST * _UNFOLLOWED / (1.0 + _UNFOLLOWED)).sum(axis=1) * (
    _LOGARITHMS[1] - _LOGARITHMS[0]
)
_SMOOTHED = float(_LOST.sum() * (_LOGARITHMS[1] - _LOGARITHMS[0]))


def excess_speed(
    rotor: Cup | Propeller,
    scales: SmallScales,
    bandwidth: float,
    vertical_variance: float,
    speed: FloatArray,
) -> FloatArray:
    """By how much the speed from a smoothed motion is too high [m/s], shape (n,).

    Args:
        rotor: The rotor.
        scales: Inertial range.
        bandwidth: Half-power frequency of the smoothing [Hz].
        vertical_variance: <w^2> where the vertical wind is not measured [m^2/s^2].
        speed: U [m/s], shape (n,).
    """
    u = np.maximum(speed, _CALM)
    length = 2.0 * np.pi * bandwidth * rotor.distance_constant * rotor.inertia_factor / u
    share = np.interp(np.log(length), np.log(_LENGTHS), _SHARES)
    above = VARIANCE_ABOVE * bandwidth ** (-2.0 / 3.0)
    total = rotor_parameters(rotor).a4 * above * scales.along * share
    if isinstance(rotor, Cup):
        total = total + 0.5 * _SMOOTHED * above * scales.across
    total = total + 0.5 * response_curvature(rotor) * vertical_variance
    return np.asarray(np.clip(total / u, -_LARGEST * speed, _LARGEST * speed))
