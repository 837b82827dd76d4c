"""Wind vane: a second-order instrument for the wind's direction, in the small-angle limit.

Source: Kristensen (1994), (36) to (51). tau = omega0 t is dimensionless time, s = k l_v =
omega/omega0 dimensionless frequency, zeta the damping ratio, l_v the vane's distance constant.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

LIFT_SLOPE_THIN_AEROFOIL = 2.0 * math.pi
"""K of a thin aerofoil of infinite span [1/rad]."""
LIFT_SLOPE_MEASURED = 1.9
"""K measured on a vane's fin, K94 [1/rad]."""


class VaneDynamics(NamedTuple):
    """Dynamic constants of a vane.

    distance_constant: l_v = U/omega0 [m]; damping_ratio: zeta [1].
    """

    distance_constant: float
    damping_ratio: float


def dynamics_from_geometry(
    density: float, arm: float, fin_area: float, lift_slope: float, inertia: float
) -> VaneDynamics:
    """l_v and zeta = r/(2 l_v) from a vane's build; K94 (40) to (43).

    Args:
        density: rho [kg/m^3].
        arm: r, axis to centre of pressure of the fin [m].
        fin_area: A [m^2].
        lift_slope: K [1/rad].
        inertia: I [kg m^2].
    """
    length = 1.0 / math.sqrt(density * arm * fin_area * lift_slope / (2.0 * inertia))
    return VaneDynamics(length, arm / (2.0 * length))


def natural_frequency(speed: float, distance_constant: float) -> float:
    """omega0 = U/l_v [rad/s]; K94 (42)."""
    return speed / distance_constant


def damping_from_fin(
    density: float, fin_height: float, fin_width: float, arm_mass: float, lift_slope: float
) -> float:
    """zeta = B sqrt(rho h d/sigma_t) [1] of a fin on an arm that holds all the inertia; K94 (48).

    Args:
        density: rho [kg/m^3].
        fin_height, fin_width: h, d [m].
        arm_mass: Mass of the arm per length sigma_t [kg/m].
        lift_slope: K [1/rad].
    """
    ratio = density * fin_height * fin_width / arm_mass
    return arm_coefficient(lift_slope) * math.sqrt(ratio)


def arm_coefficient(lift_slope: float) -> float:
    """B = sqrt(3 K/2)/2 [1]; K94 (49), from an inertia of sigma_t r^3/3."""
    return 0.5 * math.sqrt(1.5 * lift_slope)


def step_response(time: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """phi/alpha [1] after a sudden turn of the wind; K94 (45), Fig. 5.

    Args:
        time: tau = omega0 t [1].
        damping_ratio: zeta [1], positive or zero.
    """
    tau = np.asarray(time, dtype=np.float64)
    zeta = damping_ratio
    width2 = (1.0 - zeta) * (1.0 + zeta)
    if width2 > 0.0:
        w = math.sqrt(width2)
        return 1.0 - np.exp(-zeta * tau) * (np.cos(w * tau) + zeta * tau * np.sinc(w * tau / np.pi))
    if width2 == 0.0:
        return 1.0 - np.exp(-tau) * (1.0 + tau)
    w = math.sqrt(-width2)
    slow = 1.0 / (zeta + w)
    fast = zeta + w
    # Two exponentials: no overflow; expm1 keeps zeta close to 1 exact.
    difference = -np.expm1(-2.0 * w * tau) / (2.0 * w)
    return 1.0 - np.exp(-slow * tau) * (
        0.5 * (1.0 + np.exp(-(fast - slow) * tau)) + zeta * difference
    )


def first_order_step_response(time: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """1 - exp(-tau/(2 zeta)) [1]: a strongly damped vane taken as first order; K94 (46), Fig. 6."""
    return -np.expm1(-np.asarray(time, dtype=np.float64) / (2.0 * damping_ratio))


def impulse_response(time: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """Impulse response over omega0 [1] at tau = omega0 t; K94 (101)."""
    tau = np.asarray(time, dtype=np.float64)
    zeta = damping_ratio
    width2 = (1.0 - zeta) * (1.0 + zeta)
    if width2 >= 0.0:
        return np.exp(-zeta * tau) * tau * np.sinc(math.sqrt(width2) * tau / np.pi)
    w = math.sqrt(-width2)
    return np.exp(-tau / (zeta + w)) * -np.expm1(-2.0 * w * tau) / (2.0 * w)


def overshoot(damping_ratio: float) -> float:
    """exp(-pi zeta/sqrt(1 - zeta^2)) [1]: first overshoot of the step response, 0 for zeta >= 1."""
    if damping_ratio >= 1.0:
        return 0.0
    width = math.sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio))
    return math.exp(-math.pi * damping_ratio / width)


def damping_from_overshoot(overshoot_ratio: float) -> float:
    """zeta [1] from the first overshoot (0..1) of a released vane."""
    decrement = -math.log(overshoot_ratio)
    return decrement / math.hypot(math.pi, decrement)


def damping_from_logarithmic_decrement(decrement: float) -> float:
    """zeta = delta/sqrt(4 pi^2 + delta^2) [1] from the decrement per full oscillation."""
    return decrement / math.hypot(2.0 * math.pi, decrement)


def transfer_function(frequency: npt.ArrayLike, damping_ratio: float) -> ComplexArray:
    """H = 1/(1 - s^2 + 2 i zeta s) [1] at s = omega/omega0; K94 (51), M66 (1)."""
    s = np.asarray(frequency, dtype=np.float64)
    return np.asarray(1.0 / ((1.0 - s) * (1.0 + s) + 2j * damping_ratio * s))


def gain(frequency: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """|H| [1]."""
    return 1.0 / np.sqrt(inverse_gain_squared(frequency, damping_ratio))


def phase(frequency: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """arg H [rad], from 0 to -pi."""
    s = np.asarray(frequency, dtype=np.float64)
    return -np.arctan2(2.0 * damping_ratio * s, (1.0 - s) * (1.0 + s))


def inverse_gain_squared(frequency: npt.ArrayLike, damping_ratio: float) -> FloatArray:
    """D(s) = (1 - s^2)^2 + 4 zeta^2 s^2 = |H|^-2 [1]; K94 (51)."""
    s = np.asarray(frequency, dtype=np.float64)
    return ((1.0 - s) * (1.0 + s)) ** 2 + (2.0 * damping_ratio * s) ** 2


def slow_pole_length_ratio(damping_ratio: float) -> float:
    """Length of the slowest exponential of a step response over l_v [1].

    zeta + sqrt(zeta^2 - 1) for zeta >= 1, which K94 (46), (47) approximate by 2 zeta = r/l_v;
    1/zeta for an oscillating vane.
    """
    if damping_ratio < 1.0:
        return 1.0 / damping_ratio
    return damping_ratio + math.sqrt((damping_ratio - 1.0) * (damping_ratio + 1.0))


def effective_length(dynamics: VaneDynamics) -> float:
    """l_eff = 2 zeta l_v [m]; K94 (47), for zeta much larger than 1."""
    return 2.0 * dynamics.damping_ratio * dynamics.distance_constant


def wind_angle(
    angle: npt.ArrayLike,
    rate: npt.ArrayLike,
    acceleration: npt.ArrayLike,
    natural_frequency: npt.ArrayLike,
    damping_ratio: float,
) -> FloatArray:
    """alpha = phi + 2 zeta phi'/omega0 + phi''/omega0^2 [rad]: K94 (39) solved for the wind.

    Args:
        angle, rate, acceleration: phi [rad] and its derivatives [rad/s], [rad/s^2].
        natural_frequency: omega0 = U/l_v [rad/s].
        damping_ratio: zeta.
    """
    omega = np.asarray(natural_frequency, dtype=np.float64)
    turning = 2.0 * damping_ratio * np.asarray(rate, dtype=np.float64) / omega
    bend = np.asarray(acceleration, dtype=np.float64) / (omega * omega)
    return np.asarray(angle, dtype=np.float64) + turning + bend
