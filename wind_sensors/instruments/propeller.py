"""Propeller of Kristensen (1994), (29) to (31): torque proportional to the rotor's rate.

Its axial mean is exact for any bounded axial wind, l <s> = <u_a>, because <d ln s/dt> = 0. Angles
are between the wind and the axis [rad]; only s > 0 is meant. `friction_propeller` holds Jackson's
model with bearing friction.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments import rotor_family

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def angular_acceleration(
    rate: npt.ArrayLike,
    axial: npt.ArrayLike,
    transverse: npt.ArrayLike,
    calibration_distance: float,
    distance_constant: float,
    mu2: float,
) -> FloatArray:
    """ds/dt [rad/s^2]; K94 (30).

    Args:
        rate: s [rad/s], positive.
        axial: u_a [m/s].
        transverse: Wind across the axis [m/s].
        calibration_distance: l [m/rad].
        distance_constant: l0 [m].
        mu2: Curvature of the angular response [1].
    """
    s = np.asarray(rate, dtype=np.float64)
    across = np.asarray(transverse, dtype=np.float64)
    drive = (np.asarray(axial, dtype=np.float64) - calibration_distance * s) * s
    return drive / distance_constant + 0.5 * mu2 * across * across / (
        calibration_distance * distance_constant
    )


def angular_response(angle: npt.ArrayLike, mu2: float) -> FloatArray:
    """cos(theta) + mu2 theta^2/2 [1]; K94 (31)."""
    theta = np.asarray(angle, dtype=np.float64)
    return np.cos(theta) + 0.5 * mu2 * theta * theta


def steady_response(angle: npt.ArrayLike, mu2: float) -> FloatArray:
    """l S/U = [cos + sqrt(cos^2 + 2 mu2 sin^2)]/2 [1], the stable root of K94 (30).

    Agrees with `angular_response` to second order in the angle. NaN beyond `critical_angle`.
    """
    theta = np.asarray(angle, dtype=np.float64)
    return rotor_family.steady_rate(np.cos(theta), 0.5 * mu2 * np.sin(theta) ** 2, 0.0)


def critical_angle(mu2: float) -> float:
    """arctan((-2 mu2)^(-1/2)) [rad]: no steady state beyond; pi/2 for mu2 >= 0."""
    if mu2 >= 0.0:
        return 0.5 * math.pi
    return math.atan(1.0 / math.sqrt(-2.0 * mu2))


def curvature_from_cosine_power(stretch: float) -> float:
    """mu2 = 1 - c^2 [1] of a response cos(c theta), to second order; K94 (115)."""
    return 1.0 - stretch * stretch


def oblique_response_length_ratio(angle: npt.ArrayLike, mu2: float) -> FloatArray:
    """Response length over l0 [1] in oblique flow: 1/sqrt(cos^2 + 2 mu2 sin^2) (derived)."""
    theta = np.asarray(angle, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return 1.0 / np.sqrt(np.cos(theta) ** 2 + 2.0 * mu2 * np.sin(theta) ** 2)


def transfer_function(reduced_wavenumber: npt.ArrayLike, angle: float, mu2: float) -> ComplexArray:
    """l s'/(u', v') [1] of a fixed propeller in a steady oblique wind (derived from K94 (30)).

    Args:
        reduced_wavenumber: k l0 [1], shape (n,).
        angle: Of the mean wind to the axis [rad], smaller than `critical_angle`.
        mu2: Curvature of the angular response.

    Returns:
        Shape (n, 2): for gusts along the mean wind, and across it in the plane of wind and axis,
        positive where they turn the wind towards the axis. 1/(1 + i k l0) and 0 in axial flow.
    """
    c, s = math.cos(angle), math.sin(angle)
    rate = float(steady_response(angle, mu2))
    along = rate * c + mu2 * s * s
    across = rate * s - mu2 * s * c
    k = np.asarray(reduced_wavenumber, dtype=np.float64)
    slowness = 1.0 / float(oblique_response_length_ratio(angle, mu2)) + 1j * k
    return np.stack([along / slowness, across / slowness], axis=-1)


def fixed_propeller_bias(
    mu2: float, lateral_variance: float, vertical_variance: float, mean_speed: float
) -> float:
    """mu2 (<v^2> + <w^2>)/(2 U^2) [1]: bias of a propeller on a fixed axis; K94 (30).

    Args:
        mu2: Curvature of the angular response.
        lateral_variance, vertical_variance: <v^2>, <w^2> [m^2/s^2].
        mean_speed: U [m/s].
    """
    return 0.5 * mu2 * (lateral_variance + vertical_variance) / mean_speed**2
