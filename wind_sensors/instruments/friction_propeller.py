"""Propeller with bearing friction (Jackson, undated report c. 1980, (4) to (10)), signs corrected.

    L P domega/dt = U g(theta)/g(0) [U f(theta) - P omega] - U_s^2 sgn(omega)

U is the total relative speed [m/s], theta its angle to the axis [rad], P the calibration distance
[m/rad], L the response length [m], U_s the stall speed [m/s]. f(0) = 1; f and g/g(0) are functions
of theta.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import optimize

FloatArray = npt.NDArray[np.float64]
Response = Callable[[npt.ArrayLike], FloatArray]

TORQUE_SLOPE_STRETCH = 0.98
"""c of g(theta)/g(0) = sqrt(cos(c theta)), Jackson, sec. 3.3."""


def cosine_response(angle: npt.ArrayLike) -> FloatArray:
    """f = cos(theta) [1], the ideal propeller."""
    return np.cos(np.asarray(angle, dtype=np.float64))


def torque_slope_ratio(angle: npt.ArrayLike) -> FloatArray:
    """g(theta)/g(0) = sqrt(cos(0.98 theta)) [1], mirrored behind the rotor plane.

    Real up to 91.8 degrees as printed; flow from behind sees the same blades, so the angle is
    folded at 90 degrees.
    """
    theta = np.abs(np.asarray(angle, dtype=np.float64))
    folded = np.minimum(theta, math.pi - theta)
    return np.sqrt(np.maximum(np.cos(TORQUE_SLOPE_STRETCH * folded), 0.0))


@dataclass(frozen=True)
class FrictionPropeller:
    """Constants and angular responses of a propeller.

    Attributes:
        calibration_distance: P [m/rad].
        response_length: L [m].
        stall_speed: U_s [m/s].
        f: Angular response f(theta) [1].
        g: Torque slope ratio g(theta)/g(0) [1].
    """

    calibration_distance: float
    response_length: float
    stall_speed: float = 0.0
    f: Response = cosine_response
    g: Response = torque_slope_ratio


class AxialInversion(NamedTuple):
    """Both roots of (10) for the axial wind X = U f(theta).

    Attributes:
        value: The root taken [m/s].
        other: The other root [m/s].
        ambiguous: Both roots turn the rotor the same way, so that rate and acceleration alone
            cannot tell them apart (a strong lull). The larger root in the rotor's sense is taken.
        noisy: The bracket was negative, which no noise-free rotor shows; its absolute value is
            used.
    """

    value: FloatArray
    other: FloatArray
    ambiguous: npt.NDArray[np.bool_]
    noisy: npt.NDArray[np.bool_]


def response_length_from_inertia(
    inertia: float, density: float, radius: float, torque_slope: float
) -> float:
    """L = I/(rho R^4 g(0)) [m].

    Args:
        inertia: I [kg m^2].
        density: rho [kg/m^3].
        radius: R [m].
        torque_slope: g(0) [1], slope of the torque coefficient.
    """
    return inertia / (density * radius**4 * torque_slope)


def stall_speed_from_torque(
    friction_torque: float,
    calibration_distance: float,
    density: float,
    radius: float,
    torque_slope: float,
) -> float:
    """U_s = sqrt(P Q_s/(rho R^4 g(0))) [m/s]; Jackson after (5), radius restored.

    Args:
        friction_torque: Q_s [N m].
        calibration_distance: P [m/rad].
        density: rho [kg/m^3].
        radius: R [m].
        torque_slope: g(0).
    """
    return math.sqrt(calibration_distance * friction_torque / (density * radius**4 * torque_slope))


def aerodynamic_torque(
    rate: npt.ArrayLike,
    speed: npt.ArrayLike,
    angle: npt.ArrayLike,
    propeller: FrictionPropeller,
    density: float,
    radius: float,
    torque_slope: float,
) -> FloatArray:
    """Q_A = rho R^4/P U g(theta) (U f(theta) - omega P) [N m]; Jackson (4).

    Args:
        rate: omega [rad/s].
        speed: U [m/s].
        angle: theta [rad].
        propeller: Constants.
        density: rho [kg/m^3].
        radius: R [m].
        torque_slope: g(0).
    """
    u = np.asarray(speed, dtype=np.float64)
    p = propeller.calibration_distance
    slip = u * propeller.f(angle) - p * np.asarray(rate, dtype=np.float64)
    return density * radius**4 / p * u * torque_slope * propeller.g(angle) * slip


def angular_acceleration(
    rate: npt.ArrayLike, speed: npt.ArrayLike, angle: npt.ArrayLike, propeller: FrictionPropeller
) -> FloatArray:
    """domega/dt [rad/s^2]; Jackson (5). A rotor at rest stays so while friction holds it.

    Args:
        rate: omega [rad/s].
        speed: U [m/s], total relative speed.
        angle: theta [rad].
        propeller: Constants.
    """
    omega = np.asarray(rate, dtype=np.float64)
    u = np.asarray(speed, dtype=np.float64)
    p = propeller.calibration_distance
    friction = propeller.stall_speed**2
    torque = u * propeller.g(angle) * (u * propeller.f(angle) - p * omega)
    sense = np.where(omega != 0.0, np.sign(omega), np.sign(torque))
    net = torque - friction * sense
    net = np.where((omega == 0.0) & (np.abs(torque) <= friction), 0.0, net)
    return net / (propeller.response_length * p)


def steady_axial(speed: npt.ArrayLike, stall_speed: float) -> FloatArray:
    """P omega = U - U_s^2/U [m/s], zero at and below the stall speed; Jackson (6), Fig. 1."""
    u = np.asarray(speed, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(u > stall_speed, u - stall_speed**2 / u, 0.0)


def axial_speed_from_rate(indicated: npt.ArrayLike, stall_speed: float) -> FloatArray:
    """U [m/s] from P omega > 0 [m/s]: (6) solved for U."""
    y = np.asarray(indicated, dtype=np.float64)
    return 0.5 * (y + np.sqrt(y * y + 4.0 * stall_speed**2))


def stall_speed_from_excess(speed: float, ratio: float) -> float:
    """U_s [m/s] when U/(P omega) = `ratio` at the axial speed U [m/s]; Jackson (6)."""
    return speed * math.sqrt(1.0 - 1.0 / ratio)


def steady_oblique(
    speed: npt.ArrayLike, angle: npt.ArrayLike, propeller: FrictionPropeller
) -> FloatArray:
    """P omega [m/s] in steady oblique flow: zero inside the stall band; Jackson (5), (7).

    Args:
        speed: U [m/s].
        angle: theta [rad].
        propeller: Constants.
    """
    u = np.asarray(speed, dtype=np.float64)
    f = np.asarray(propeller.f(angle), dtype=np.float64)
    friction = propeller.stall_speed**2
    with np.errstate(divide="ignore", invalid="ignore"):
        loss = friction / (u * propeller.g(angle)) if friction > 0.0 else 0.0
        size = np.abs(f) * u - loss
    return np.where(size > 0.0, np.sign(f) * size, 0.0)


def oblique_ratio(
    speed: npt.ArrayLike, angle: npt.ArrayLike, propeller: FrictionPropeller
) -> FloatArray:
    """omega(theta)/omega(0) [1] in steady flow; Jackson (7), sign of friction corrected."""
    return steady_oblique(speed, angle, propeller) / steady_axial(speed, propeller.stall_speed)


def stall_angle(speed: float, propeller: FrictionPropeller) -> float:
    """Smallest angle [rad] at which |f| g/g(0) = U_s^2/U^2: where the dead sector begins.

    Args:
        speed: U [m/s].
        propeller: Constants.

    Returns:
        The angle; 0 at and below the stall speed.
    """
    level = (propeller.stall_speed / speed) ** 2
    if level >= 1.0:
        return 0.0

    def excess(theta: float) -> float:
        return float(propeller.f(theta)) * float(propeller.g(theta)) - level

    if excess(0.0) <= 0.0:
        return 0.0
    grid = np.linspace(0.0, 0.5 * math.pi, 721)
    for low, high in itertools.pairwise(grid.tolist()):
        if excess(high) <= 0.0:
            return float(optimize.brentq(excess, low, high, xtol=1e-15, rtol=1e-15))
    return 0.5 * math.pi


def relaxation_time(speed: float, angle: float, propeller: FrictionPropeller) -> float:
    """T = L g(0)/(U g(theta)) [s]; Jackson, sec. 3.3."""
    return propeller.response_length / (speed * float(propeller.g(angle)))


def recovery(
    time: npt.ArrayLike, initial: float, speed: float, angle: float, propeller: FrictionPropeller
) -> FloatArray:
    """P omega(t) [m/s] at constant U and theta, exact while the rotor keeps its sense of rotation.

    Args:
        time: t [s].
        initial: P omega(0) [m/s], positive.
        speed: U [m/s].
        angle: theta [rad].
        propeller: Constants.

    Returns:
        P omega; a rotor that would reverse comes to rest at zero (then (5) decides anew).
    """
    t = np.asarray(time, dtype=np.float64)
    g = float(propeller.g(angle))
    final = speed * float(propeller.f(angle)) - propeller.stall_speed**2 / (speed * g)
    rate = final + (initial - final) * np.exp(-t / relaxation_time(speed, angle, propeller))
    return np.maximum(rate, 0.0)


def axial_response_length(speed: float, angle: float, propeller: FrictionPropeller) -> float:
    """U T cos(theta) [m]: wind run along the axis in one relaxation time; Jackson, sec. 3.3."""
    return speed * relaxation_time(speed, angle, propeller) * math.cos(angle)


def invert_axial(
    indicated: npt.ArrayLike,
    indicated_rate: npt.ArrayLike,
    angle: npt.ArrayLike,
    propeller: FrictionPropeller,
) -> AxialInversion:
    """X = U f(theta) from rate and acceleration; Jackson (10), the minus read as an equals sign.

    The two roots share X1 + X2 = P omega. The default root, the one beyond P omega/2 in the
    rotor's sense of rotation, is wrong exactly when the axial wind has dropped below half the
    indicated speed.

    Args:
        indicated: P omega [m/s].
        indicated_rate: P domega/dt [m/s^2].
        angle: theta [rad]; f must not be zero where the rotor turns.
        propeller: Constants.
    """
    y = np.asarray(indicated, dtype=np.float64)
    acceleration = np.asarray(indicated_rate, dtype=np.float64)
    ratio = propeller.f(angle) / propeller.g(angle)
    torque = propeller.response_length * acceleration + propeller.stall_speed**2 * np.sign(y)
    bracket = y * y + 4.0 * ratio * torque
    sense = np.where(y != 0.0, np.sign(y), np.sign(acceleration))
    root = np.sqrt(np.abs(bracket))
    value = 0.5 * (y + sense * root)
    other = 0.5 * (y - sense * root)
    return AxialInversion(value, other, value * other > 0.0, bracket < 0.0)
