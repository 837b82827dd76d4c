"""Equation of motion of a vane in a wind that turns, on a mount that may turn and tilt.

With phi the heading of the nose in the sensor frame, alpha the heading the wind comes from, h the
speed across the vane's axis and Omega the yaw rate of the mount::

    phi'' = -2 zeta (h/l_v) (phi' + Omega) - (h/l_v)^2 sin(phi - alpha) - Omega'
            + (-b g_x sin phi + b g_y cos phi) - (h_f/l_v)^2 sgn(phi') - c phi'
            - (h_k/l_v)^2 (phi - phi_k)

(Kristensen (1994), (36) to (43), with sin for large deviations). Damping acts on the turning
against the air, friction and an oil in the bearing on the turning against the mount. A cable that
the vane winds up pulls it back to phi_k, the more, the farther and the more often it has turned.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled, inlined
from wind_sensors.instruments.dynamics.rotor import RotorParameters
from wind_sensors.instruments.dynamics.rotor_record import integrate_rotor

FloatArray = npt.NDArray[np.float64]


class VaneParameters(NamedTuple):
    """Constants of one vane, healthy values first, then what can go wrong. SI units, rad."""

    distance_constant: float
    """l_v = U / omega_0 [m] at the calibration's air density."""
    damping_ratio: float
    """zeta."""
    inertia_factor: float
    """Moment of inertia relative to the healthy vane's."""
    damping_factor: float
    """Damping relative to the healthy vane's."""
    friction: float
    """h_f^2 [m^2/s^2]: the vane sticks while h^2 |sin(phi - alpha)| stays below it."""
    imbalance: float
    """b = m r / I [1/m]: angular acceleration per acceleration across the nose."""
    aerodynamic_offset: float
    """Angle at which the fin balances, relative to the wind [rad] (a bent fin)."""
    catch: float = 0.0
    """h_c^2 [m^2/s^2]: friction added where the race catches, at one heading."""
    catch_heading: float = 0.0
    """That heading [rad]."""
    catch_width: float = 1.0
    """Standard width of the place [rad]."""
    softness: float = 0.0
    """1/h_y^2 [s^2/m^2]: a fin that bends away holds by 1/(1 + h^2/h_y^2) of a stiff one's."""
    viscosity: float = 0.0
    """c [1/s]: torque of the oil in the bearing per turning rate and healthy moment of inertia."""
    cable: float = 0.0
    """h_k^2 [m^2/s^2]: a cable pulls per radian as wind of h_k does at a small angle."""
    cable_rest: float = 0.0
    """Heading at which the cable is not wound up, counted on over turns [rad]."""


@compiled
def vane_acceleration(
    p: VaneParameters,
    phi: float,
    phi_rate: float,
    wind_x: float,
    wind_y: float,
    yaw_rate: float,
    yaw_acceleration: float,
    gravity_x: float,
    gravity_y: float,
    density_ratio: float,
) -> float:
    """phi'' [rad/s^2] without friction; see the module's text for the terms.

    The restoring term is written as h (h sin(phi - alpha)), which needs no direction of the wind.
    """
    balanced = phi - p.aerodynamic_offset
    across = wind_y * math.cos(balanced) - wind_x * math.sin(balanced)
    speed = math.hypot(wind_x, wind_y)
    pull = _pull(p, phi, gravity_x, gravity_y)
    pace = density_ratio / (p.inertia_factor * p.distance_constant)
    return _acceleration(
        p, phi_rate, speed, across, phi_rate + yaw_rate, pull - yaw_acceleration, pace
    )


@inlined
def _acceleration(
    p: VaneParameters,
    phi_rate: float,
    speed: float,
    across: float,
    air_turn: float,
    pushed: float,
    pace: float,
) -> float:
    """phi'' [rad/s^2] without friction.

    Args:
        p: Constants of the vane.
        phi_rate: Turning rate against the mount [rad/s].
        speed: Of the wind across the vane's axis, h [m/s].
        across: Wind across the heading at which the fin balances, h sin(phi - alpha) [m/s].
        air_turn: Turning rate against the air [rad/s].
        pushed: Angular acceleration by gravity and by the mount [rad/s^2].
        pace: Air density over inertia and distance constant [1/m].
    """
    if p.softness > 0.0:
        pace /= 1.0 + p.softness * speed * speed
    held = pace * speed
    damping = 2.0 * p.damping_ratio * p.damping_factor * held * air_turn
    if p.viscosity > 0.0:
        damping += p.viscosity / p.inertia_factor * phi_rate
    return pushed - damping - held / p.distance_constant * across


@inlined
def _pull(p: VaneParameters, phi: float, gravity_x: float, gravity_y: float) -> float:
    """Angular acceleration of a vane out of balance, or that winds up a cable [rad/s^2]."""
    pull = 0.0
    if p.imbalance != 0.0:
        across = gravity_y * math.cos(phi) - gravity_x * math.sin(phi)
        pull = p.imbalance / p.inertia_factor * across
    if p.cable > 0.0:
        length = p.distance_constant
        pull -= p.cable / (length * length * p.inertia_factor) * (phi - p.cable_rest)
    return pull


_SMALL_TURN = 0.25
"""Up to this angle [rad] the series of `small_turn` hold to the last digit."""


@inlined
def small_turn(angle: float) -> tuple[float, float]:
    """Cosine and sine of a small angle [rad].

    A library's functions take so long that each stage of a step would wait for them.
    """
    if abs(angle) > _SMALL_TURN:
        return math.cos(angle), math.sin(angle)
    q = angle * angle
    r = q * q
    cosine = (1.0 - q / 2.0) + r * (
        (1.0 / 24.0 - q * (1.0 / 720.0)) + r * (1.0 / 40320.0 - q * (1.0 / 3628800.0))
    )
    sine = (1.0 - q * (1.0 / 6.0)) + r * (
        (1.0 / 120.0 - q * (1.0 / 5040.0)) + r * (1.0 / 362880.0 - q * (1.0 / 39916800.0))
    )
    return cosine, angle * sine


@inlined
def _grip(p: VaneParameters, phi: float) -> float:
    """Angular acceleration that the friction withstands at a heading [rad/s^2]."""
    friction = p.friction
    if p.catch > 0.0:
        away = phi - p.catch_heading
        away -= 2.0 * math.pi * math.floor((away + math.pi) / (2.0 * math.pi))
        friction += p.catch * math.exp(-0.5 * (away / p.catch_width) ** 2)
    return friction / (p.distance_constant * p.distance_constant * p.inertia_factor)


@compiled
def advance_vane(
    p: VaneParameters,
    phi: float,
    phi_rate: float,
    wind_x: tuple[float, float],
    wind_y: tuple[float, float],
    yaw_rate: tuple[float, float],
    gravity: tuple[float, float],
    density_ratio: float,
    dt: float,
) -> tuple[float, float]:
    """One interval of the vane equation, the wind varying linearly over it.

    Args:
        p: Constants of the vane.
        phi, phi_rate: Heading of the nose [rad] and its rate [rad/s] against the mount.
        wind_x, wind_y: Wind in the sensor frame at start and end [m/s].
        yaw_rate: Yaw rate of the mount at start and end [rad/s].
        gravity: Gravity minus the mount's acceleration along the sensor's x and y [m/s^2].
        density_ratio: Air density relative to the calibration's.
        dt: Interval [s].

    Returns:
        phi [rad] and its rate [rad/s] at the end.
    """
    h_largest = max(math.hypot(wind_x[0], wind_y[0]), math.hypot(wind_x[1], wind_y[1]))
    stiffness = density_ratio / p.inertia_factor
    omega = h_largest / p.distance_constant * math.sqrt(stiffness)
    rate = omega * max(1.0, 2.0 * p.damping_ratio * p.damping_factor * math.sqrt(stiffness))
    rate += p.viscosity / p.inertia_factor
    rate += math.sqrt(p.cable / p.inertia_factor) / p.distance_constant
    substeps = 1 + int(2.0 * dt * rate)
    if p.friction > 0.0 or p.catch > 0.0:
        substeps = max(substeps, 4)
    step = dt / substeps
    pulled = p.imbalance != 0.0 or p.cable > 0.0
    yaw_acceleration = (yaw_rate[1] - yaw_rate[0]) / dt
    pace = density_ratio / (p.inertia_factor * p.distance_constant)
    c = math.cos(phi - p.aerodynamic_offset)
    s = math.sin(phi - p.aerodynamic_offset)
    for k in range(substeps):
        friction = _grip(p, phi)
        f_0 = k / substeps
        f_h = (k + 0.5) / substeps
        f_1 = (k + 1.0) / substeps
        x_0 = wind_x[0] + f_0 * (wind_x[1] - wind_x[0])
        y_0 = wind_y[0] + f_0 * (wind_y[1] - wind_y[0])
        x_h = wind_x[0] + f_h * (wind_x[1] - wind_x[0])
        y_h = wind_y[0] + f_h * (wind_y[1] - wind_y[0])
        x_1 = wind_x[0] + f_1 * (wind_x[1] - wind_x[0])
        y_1 = wind_y[0] + f_1 * (wind_y[1] - wind_y[0])
        h_0 = math.sqrt(x_0 * x_0 + y_0 * y_0)
        h_h = math.sqrt(x_h * x_h + y_h * y_h)
        h_1 = math.sqrt(x_1 * x_1 + y_1 * y_1)
        turn_0 = yaw_rate[0] + f_0 * (yaw_rate[1] - yaw_rate[0])
        turn_h = yaw_rate[0] + f_h * (yaw_rate[1] - yaw_rate[0])
        turn_1 = yaw_rate[0] + f_1 * (yaw_rate[1] - yaw_rate[0])
        pushed = _pull(p, phi, gravity[0], gravity[1]) - yaw_acceleration
        drag = 0.0
        drive = _acceleration(p, phi_rate, h_0, y_0 * c - x_0 * s, phi_rate + turn_0, pushed, pace)
        if friction > 0.0:
            if phi_rate == 0.0:
                if abs(drive) <= friction:
                    continue
                drag = -math.copysign(friction, drive)
            else:
                drag = -math.copysign(friction, phi_rate)
        along_h = x_h * c + y_h * s
        across_h = y_h * c - x_h * s
        k_1 = drive + drag
        v_2 = phi_rate + 0.5 * step * k_1
        d_2 = 0.5 * step * phi_rate
        cosine, sine = small_turn(d_2)
        if pulled:
            pushed = _pull(p, phi + d_2, gravity[0], gravity[1]) - yaw_acceleration
        k_2 = drag + _acceleration(
            p, v_2, h_h, across_h * cosine - along_h * sine, v_2 + turn_h, pushed, pace
        )
        v_3 = phi_rate + 0.5 * step * k_2
        d_3 = 0.5 * step * v_2
        cosine, sine = small_turn(d_3)
        if pulled:
            pushed = _pull(p, phi + d_3, gravity[0], gravity[1]) - yaw_acceleration
        k_3 = drag + _acceleration(
            p, v_3, h_h, across_h * cosine - along_h * sine, v_3 + turn_h, pushed, pace
        )
        v_4 = phi_rate + step * k_3
        d_4 = step * v_3
        cosine, sine = small_turn(d_4)
        if pulled:
            pushed = _pull(p, phi + d_4, gravity[0], gravity[1]) - yaw_acceleration
        along_1 = x_1 * c + y_1 * s
        across_1 = y_1 * c - x_1 * s
        k_4 = drag + _acceleration(
            p, v_4, h_1, across_1 * cosine - along_1 * sine, v_4 + turn_1, pushed, pace
        )
        moved = step / 6.0 * (phi_rate + 2.0 * v_2 + 2.0 * v_3 + v_4)
        phi += moved
        if k + 1 < substeps:
            cosine, sine = small_turn(moved)
            c, s = c * cosine - s * sine, s * cosine + c * sine
        rate_next = phi_rate + step / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
        if friction > 0.0 and rate_next * phi_rate < 0.0:
            rate_next = 0.0
        phi_rate = rate_next
    return phi, phi_rate


@compiled
def integrate_vane(
    p: VaneParameters,
    wind: FloatArray,
    yaw_rate: FloatArray,
    gravity: FloatArray,
    density_ratio: FloatArray,
    dt: float,
    phi_start: float,
    phi_rate_start: float,
) -> tuple[FloatArray, FloatArray]:
    """Heading of a vane's nose in a sampled wind.

    Args:
        p: Constants of the vane.
        wind: Wind in the sensor frame [m/s], shape (n, 3), linear between the samples.
        yaw_rate: Yaw rate of the mount [rad/s], shape (n,).
        gravity: Gravity minus the mount's acceleration along x and y [m/s^2], shape (n, 2).
        density_ratio: Air density relative to the calibration's, shape (n,).
        dt: Sampling interval [s].
        phi_start: Heading at the first sample [rad]; NaN means "into the wind".
        phi_rate_start: Its rate [rad/s].

    Returns:
        phi [rad], continuous (not wrapped), and its rate [rad/s], shape (n,) each.
    """
    n = wind.shape[0]
    phi_out = np.empty(n)
    rate_out = np.empty(n)
    phi = phi_start
    if math.isnan(phi):
        phi = math.atan2(-wind[0, 1], -wind[0, 0]) + p.aerodynamic_offset
    rate = phi_rate_start
    phi_out[0] = phi
    rate_out[0] = rate
    for i in range(1, n):
        phi, rate = advance_vane(
            p, phi, rate, (wind[i - 1, 0], wind[i, 0]), (wind[i - 1, 1], wind[i, 1]),
            (yaw_rate[i - 1], yaw_rate[i]), (gravity[i, 0], gravity[i, 1]), density_ratio[i], dt,
        )
        phi_out[i] = phi
        rate_out[i] = rate
    return phi_out, rate_out


@compiled
def propeller_axes(
    wind_x: float, wind_y: float, wind_z: float, phi: float, air_turn: float, arm: float
) -> tuple[float, float, float]:
    """Axial and transverse wind of a propeller on a vane, and the transverse wind's direction.

    Args:
        wind_x, wind_y, wind_z: Wind in the sensor frame [m/s].
        phi: Heading of the nose [rad].
        air_turn: Turning rate of the vane against the air [rad/s].
        arm: Distance of the propeller upwind of the vane's axis [m].

    Returns:
        Axial wind [m/s] (positive when it blows onto the nose), transverse speed [m/s], direction
        of the transverse wind in the plane of rotation [rad]. Kristensen (1994), (93).
    """
    c = math.cos(phi)
    s = math.sin(phi)
    axial = -(wind_x * c + wind_y * s)
    lateral = -wind_x * s + wind_y * c - arm * air_turn
    return axial, math.hypot(lateral, wind_z), math.atan2(wind_z, lateral)


@compiled
def propeller_vane_axes(
    wind: FloatArray, phi: FloatArray, air_turn: FloatArray, arm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`propeller_axes` for a whole record: wind (n, 3), the rest (n,); returns (n,) each."""
    n = wind.shape[0]
    axial = np.empty(n)
    transverse = np.empty(n)
    lateral = np.empty(n)
    for i in range(n):
        axial[i], transverse[i], lateral[i] = propeller_axes(
            wind[i, 0], wind[i, 1], wind[i, 2], phi[i], air_turn[i], arm
        )
    return axial, transverse, lateral


@compiled
def integrate_propeller_vane(
    rotor: RotorParameters,
    vane: VaneParameters,
    arm: float,
    wind: FloatArray,
    yaw_rate: FloatArray,
    gravity: FloatArray,
    density_ratio: FloatArray,
    temperature: FloatArray,
    dt: float,
    start: FloatArray,
) -> FloatArray:
    """A propeller on the nose of a vane in a sampled wind.

    Args:
        rotor: Constants of the propeller.
        vane: Constants of the vane.
        arm: Distance of the propeller upwind of the vane's axis [m].
        wind: Wind in the sensor frame [m/s], shape (n, 3), linear between the samples.
        yaw_rate, gravity, density_ratio, temperature: As in `integrate_vane`, `integrate_rotor`.
        dt: Sampling interval [s].
        start: y [m/s] (negative: in equilibrium), psi [rad], phi [rad] (NaN: into the wind),
            phi rate [rad/s]; shape (4,).

    Returns:
        Columns y [m/s], psi [rad], phi [rad, continuous], phi rate [rad/s]; shape (n, 4).
    """
    out = np.empty((wind.shape[0], 4))
    phi, rate = integrate_vane(vane, wind, yaw_rate, gravity, density_ratio, dt, start[2], start[3])
    axial, transverse, lateral = propeller_vane_axes(wind, phi, rate + yaw_rate, arm)
    y_start = start[0] if start[0] >= 0.0 else math.nan
    y, psi = integrate_rotor(
        rotor, axial, transverse, lateral, density_ratio, temperature, dt, 1, y_start, start[1]
    )
    out[:, 0] = y
    out[:, 1] = psi
    out[:, 2] = phi
    out[:, 3] = rate
    return out
