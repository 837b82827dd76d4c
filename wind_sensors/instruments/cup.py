"""Cup anemometer: equation of motion, angular response, first-order dynamics.

Sources: Kristensen (1994), (1) to (20); Kristensen, Hansen & Hansen (2014), (58) to (89).
Wind is horizontal speed h and vertical velocity w [m/s]; s is the rotor rate [rad/s].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments import rotor_family

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class CupConstants:
    """Constants of a cup anemometer.

    Attributes:
        calibration_distance: l [m/rad], wind run per radian.
        distance_constant: l0 [m].
        second_length: Lambda [m], the rotor length of K94 (2); 0 gives K14's assumption (76).
        mu1: Skewness of the angular response [1/rad].
        mu2: Curvature of the angular response [1]; 0 is cosine, 1 is flat.
        starting_speed: Calibration offset U0 [m/s]: l S = U - U0.
    """

    calibration_distance: float
    distance_constant: float
    second_length: float = 0.0
    mu1: float = 0.0
    mu2: float = 0.0
    starting_speed: float = 0.0

    @property
    def a4(self) -> float:
        """Share of the torque's slope that follows the wind, l/(l + Lambda) [1]."""
        return rotor_family.torque_share(self.calibration_distance, self.second_length)


def calibration_factor(calibration_distance: float, arm_radius: float) -> float:
    """Anemometer factor f = l/r [1]; K94 (5)."""
    return calibration_distance / arm_radius


def steady_rate(speed: npt.ArrayLike, cup: CupConstants) -> FloatArray:
    """S = (U - U0)/l [rad/s], zero below the starting speed [m/s]; K14 (58)."""
    excess = np.asarray(speed, dtype=np.float64) - cup.starting_speed
    return np.maximum(excess, 0.0) / cup.calibration_distance


def distance_constant_from_inertia(
    inertia: float,
    density: float,
    drag_coefficient: float,
    cup_area: float,
    arm_radius: float,
    calibration_distance: float,
    second_length: float,
) -> float:
    """l0 = 2 I / (rho C A r (l + Lambda)) [m]; K94 (6).

    Args:
        inertia: I [kg m^2].
        density: rho [kg/m^3].
        drag_coefficient: C [1], of order one.
        cup_area: A [m^2].
        arm_radius: r [m].
        calibration_distance: l [m/rad].
        second_length: Lambda [m].
    """
    length_sum = calibration_distance + second_length
    return 2.0 * inertia / (density * drag_coefficient * cup_area * arm_radius * length_sum)


def angular_acceleration(
    rate: npt.ArrayLike, speed: npt.ArrayLike, vertical: npt.ArrayLike, cup: CupConstants
) -> FloatArray:
    """ds/dt = F(s, h, w) [rad/s^2]; K94 (2), with h replaced by h - U0.

    Args:
        rate: s [rad/s].
        speed: h [m/s].
        vertical: w [m/s].
        cup: Constants.
    """
    s = np.asarray(rate, dtype=np.float64)
    w = np.asarray(vertical, dtype=np.float64)
    forcing = np.asarray(speed, dtype=np.float64) - cup.starting_speed + cup.mu1 * w
    l0 = cup.distance_constant
    torque = (forcing - cup.calibration_distance * s) * (forcing + cup.second_length * s)
    return torque / (l0 * (cup.calibration_distance + cup.second_length)) + (
        cup.mu2 * w * w / (2.0 * l0 * cup.calibration_distance)
    )


def equivalent_speed(
    speed: npt.ArrayLike, vertical: npt.ArrayLike, mu1: float, mu2: float
) -> FloatArray:
    """h' = h + mu1 w + mu2 (sqrt(h^2 + w^2) - h) [m/s]; K14 (83), (85)."""
    h = np.asarray(speed, dtype=np.float64)
    w = np.asarray(vertical, dtype=np.float64)
    return h + mu1 * w + mu2 * (np.hypot(h, w) - h)


def angular_response(
    elevation: npt.ArrayLike, mu1: float, mu2: float, second_order: bool = False
) -> FloatArray:
    """g(theta) = cos + mu1 sin + mu2 (1 - cos) [1], or its second-order form; K14 (83), (84).

    Args:
        elevation: Angle of the wind above the plane of rotation [rad].
        mu1: Skewness.
        mu2: Curvature.
        second_order: 1 + mu1 theta - (1 - mu2) theta^2/2 instead.
    """
    theta = np.asarray(elevation, dtype=np.float64)
    if second_order:
        return 1.0 + mu1 * theta - 0.5 * (1.0 - mu2) * theta * theta
    # 1 - cos = 2 sin^2(theta/2) keeps small angles exact.
    return np.cos(theta) + mu1 * np.sin(theta) + 2.0 * mu2 * np.sin(0.5 * theta) ** 2


def steady_response(elevation: npt.ArrayLike, cup: CupConstants) -> FloatArray:
    """l S/U [1] of K94 (2) in a steady wind at an elevation angle [rad].

    Agrees with `angular_response` to second order in the angle only.
    """
    theta = np.asarray(elevation, dtype=np.float64)
    sine = np.sin(theta)
    forcing = np.cos(theta) + cup.mu1 * sine
    return rotor_family.steady_rate(forcing, 0.5 * cup.mu2 * sine * sine, cup.a4)


def time_constant(speed: float, distance_constant: float) -> float:
    """tau0 = l0/U [s]; K94 (8)."""
    return distance_constant / speed


def step_response(time_ratio: npt.ArrayLike) -> FloatArray:
    """1 - exp(-t/tau0) [1], linear dynamics; K94 (11), Fig. 2."""
    return -np.expm1(-np.asarray(time_ratio, dtype=np.float64))


def impulse_response(time_ratio: npt.ArrayLike) -> FloatArray:
    """tau0 times the impulse response, exp(-t/tau0) [1]; K14 (78)."""
    return np.exp(-np.asarray(time_ratio, dtype=np.float64))


def transfer_function(reduced_wavenumber: npt.ArrayLike) -> ComplexArray:
    """1/(1 + i k l0) [1]; K94 (13). Its modulus is the gain, its argument the phase.

    Args:
        reduced_wavenumber: k l0 = omega l0/U [1].
    """
    return np.asarray(1.0 / (1.0 + 1j * np.asarray(reduced_wavenumber, dtype=np.float64)))


def gain(reduced_wavenumber: npt.ArrayLike) -> FloatArray:
    """(1 + k^2 l0^2)^(-1/2) [1]."""
    return 1.0 / np.hypot(1.0, np.asarray(reduced_wavenumber, dtype=np.float64))


def phase(reduced_wavenumber: npt.ArrayLike) -> FloatArray:
    """-arctan(k l0) [rad]."""
    return -np.arctan(np.asarray(reduced_wavenumber, dtype=np.float64))
