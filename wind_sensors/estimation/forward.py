"""Compiled forward model of a station over one short interval, with its Jacobian.

The same equations of motion as the simulation (`instruments.dynamics`), arranged for a filter:
wind at the start and at the end of the interval in ENU, linear between, and the states of all
instruments: y [m/s] and psi [rad] of each rotor, phi [rad] and its rate [rad/s] of each vane.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.instruments.dynamics.rotor import (
    RotorParameters,
    advance_rotor,
    rotor_forcing,
)
from wind_sensors.instruments.dynamics.vane import VaneParameters, advance_vane, propeller_axes
from wind_sensors.instruments.dynamics.wake import wake_factor

FloatArray = npt.NDArray[np.float64]

CUP, ON_VANE, FIXED_AXIS = 0, 1, 2

CREEP = 0.05
"""A nose that turns faster than this certainly moves against its friction [rad/s]."""

MOUNT_VELOCITY = 0
MOUNT_ROTATION = 3
MOUNT_YAW_RATE = 12
MOUNT_GRAVITY_X = 13
MOUNT_GRAVITY_Y = 14
AIR_DENSITY = 15
AIR_TEMPERATURE = 16
VELOCITY_VARIANCE = 17
ATTITUDE_VARIANCE = 18
MOUNT_ROLL_RATE = 19
MOUNT_PITCH_RATE = 20
MOUNT_GRAVITY_Z = 21
MOUNTING_VARIANCE = 22
CIRCUMSTANCES = 23
"""Columns of the circumstances of an instant: velocity of the sensor (ENU), rotation of the sensor
frame into ENU (by rows), yaw rate, gravity felt along x and y, air, variances of the mount's
velocity and of rotations of the whole wind, roll and pitch rate, gravity felt along z, variance of
rotations of the apparent wind alone. The variances are infinite where nothing is known."""


class Instruments(NamedTuple):
    """Constants of all rotors and vanes of a station as arrays.

    Attributes:
        rotor: `RotorParameters` without the table, shape (rotors, 16).
        response: Angular response tables, shape (rotors, 181).
        mounting: Kind, index of the carrying vane, arm [m], axis x, y, z, reference density
            [kg/m^3]; shape (rotors, 7).
        vane: `VaneParameters` of each nose axis, shape (vanes, 14).
        vane_density: Reference densities [kg/m^3], shape (vanes,).
        azimuth: For the elevation of a bivane the index of its azimuth, else -1; shape (vanes,).
        shadow: Wake shadows of rotors then vanes: bearing of its middle against x [rad], depth,
            width [rad], flank; shape (rotors + vanes, shadows, 4).
        distortion: cos, sin, cos 2, sin 2 of the speed-up, deflection; shape
            (rotors + vanes, 5).
        lean: Matrices that turn instrument axes into sensor axes, shape (rotors + vanes, 3, 3).
        plain: 1 where neither shadow nor distortion nor lean changes the wind.
    """

    rotor: FloatArray
    response: FloatArray
    mounting: FloatArray
    vane: FloatArray
    vane_density: FloatArray
    azimuth: npt.NDArray[np.int64]
    shadow: FloatArray
    distortion: FloatArray
    lean: FloatArray
    plain: npt.NDArray[np.int64]


@compiled
def rotor_of(s: Instruments, i: int) -> RotorParameters:
    """Constants of rotor i."""
    r = s.rotor[i]
    return RotorParameters(
        int(r[0]), r[1], r[2], r[3], r[4], r[5], r[6], s.response[i], r[7], r[8], r[9], r[10],
        r[11], r[12], r[13], r[14], r[15],
    )


@compiled
def vane_with_friction(s: Instruments, i: int) -> VaneParameters:
    """Constants of vane i."""
    v = s.vane[i]
    return VaneParameters(
        v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9], v[10], v[11], v[12], v[13]
    )


@compiled
def grip_of(s: Instruments, i: int) -> float:
    """Angular acceleration that the friction of vane i can withstand [rad/s^2]."""
    length = s.vane[i, 0]
    return float(s.vane[i, 4] / (length * length * s.vane[i, 2]))


@compiled
def vane_of(s: Instruments, i: int) -> VaneParameters:
    """Constants of vane i without friction: a vane that sticks has no slope that a filter could
    follow. It is added smoothly, and what it withstands at rest is left to the filter's noise."""
    v = s.vane[i]
    return VaneParameters(
        v[0], v[1], v[2], v[3], 0.0, v[5], v[6], 0.0, v[8], v[9], v[10], v[11], v[12], v[13]
    )


@compiled
def apparent(wind: FloatArray, c: FloatArray) -> tuple[float, float, float]:
    """Wind in the sensor frame [m/s] under the circumstances c."""
    e = wind[0] - c[0]
    n = wind[1] - c[1]
    u = wind[2] - c[2]
    return (
        c[3] * e + c[6] * n + c[9] * u,
        c[4] * e + c[7] * n + c[10] * u,
        c[5] * e + c[8] * n + c[11] * u,
    )


@compiled
def turning(c: FloatArray) -> tuple[float, float, float]:
    """Angular rate of the mount in sensor axes [rad/s]."""
    return c[MOUNT_ROLL_RATE], c[MOUNT_PITCH_RATE], c[MOUNT_YAW_RATE]


@compiled
def gravity(c: FloatArray) -> tuple[float, float, float]:
    """Gravity minus the mount's acceleration in sensor axes [m/s^2]."""
    return c[MOUNT_GRAVITY_X], c[MOUNT_GRAVITY_Y], c[MOUNT_GRAVITY_Z]


@compiled
def at_instrument(
    s: Instruments, which: int, wind: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Wind in the instrument's axes: wake shadow, speed-up, lean of its axis."""
    if s.plain[which] == 1:
        return wind
    x, y, z = wind
    factor = 1.0
    bearing = math.atan2(-y, -x)
    for k in range(s.shadow.shape[1]):
        off = bearing - s.shadow[which, k, 0]
        factor *= wake_factor(
            off, s.shadow[which, k, 1], s.shadow[which, k, 2], s.shadow[which, k, 3]
        )
    d = s.distortion[which]
    c_1, s_1 = math.cos(bearing), math.sin(bearing)
    c_2, s_2 = c_1 * c_1 - s_1 * s_1, 2.0 * c_1 * s_1
    factor *= 1.0 + d[0] * c_1 + d[1] * s_1 + d[2] * c_2 + d[3] * s_2
    x *= factor
    y *= factor
    z *= factor
    if d[4] != 0.0:
        turn = -d[4] * (d[0] * s_1 - d[1] * c_1 + d[2] * s_2 - d[3] * c_2)
        x, y = (
            math.cos(turn) * x - math.sin(turn) * y,
            math.sin(turn) * x + math.cos(turn) * y,
        )
    return leant(s, which, (x, y, z))


@compiled
def leant(
    s: Instruments, which: int, vector: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A vector in sensor axes as the axes of an instrument show it."""
    x, y, z = vector
    m = s.lean[which]
    return (
        m[0, 0] * x + m[1, 0] * y + m[2, 0] * z,
        m[0, 1] * x + m[1, 1] * y + m[2, 1] * z,
        m[0, 2] * x + m[1, 2] * y + m[2, 2] * z,
    )


@compiled
def rotor_axes(
    s: Instruments, i: int, wind: tuple[float, float, float], phi: float, air_turn: float
) -> tuple[float, float, float]:
    """Axial wind, transverse speed [m/s] and its direction [rad] for rotor i; wind in its axes."""
    x, y, z = wind
    kind = int(s.mounting[i, 0])
    if kind == CUP:
        return z, math.hypot(x, y), math.atan2(y, x)
    if kind == ON_VANE:
        return propeller_axes(x, y, z, phi, air_turn, s.mounting[i, 2])
    a, b, c = s.mounting[i, 3], s.mounting[i, 4], s.mounting[i, 5]
    axial = a * x + b * y + c * z
    p, q, r = x - axial * a, y - axial * b, z - axial * c
    return axial, math.sqrt(p * p + q * q + r * r), 0.0


@compiled
def forcing_of(
    s: Instruments, i: int, wind: FloatArray, c: FloatArray, phi: float, air_turn: float
) -> tuple[float, float, float]:
    """Effective forcing A, slope wind B [m/s] and lift E [m^2/s^2] of rotor i in an ENU wind."""
    local = at_instrument(s, i, apparent(wind, c))
    axial, transverse, _ = rotor_axes(s, i, local, phi, air_turn)
    return rotor_forcing(rotor_of(s, i), axial, transverse)


@compiled
def advance_station(
    s: Instruments,
    wind_0: FloatArray,
    wind_1: FloatArray,
    c_0: FloatArray,
    c_1: FloatArray,
    state: FloatArray,
    dt: float,
    out: FloatArray,
) -> None:
    """States of all instruments after dt [s], written to `out`."""
    rotors = s.rotor.shape[0]
    vanes = s.vane.shape[0]
    felt_0 = apparent(wind_0, c_0)
    felt_1 = apparent(wind_1, c_1)
    for v in range(vanes):
        j = 2 * (rotors + v)
        here_0 = at_instrument(s, rotors + v, felt_0)
        here_1 = at_instrument(s, rotors + v, felt_1)
        turning_0, turning_1, pull = turning(c_0), turning(c_1), gravity(c_1)
        if s.plain[rotors + v] == 0:
            turning_0 = leant(s, rotors + v, turning_0)
            turning_1 = leant(s, rotors + v, turning_1)
            pull = leant(s, rotors + v, pull)
        x_0, y_0, turn_0 = here_0[0], here_0[1], turning_0[2]
        x_1, y_1, turn_1 = here_1[0], here_1[1], turning_1[2]
        pull_x, pull_y = pull[0], pull[1]
        if s.azimuth[v] >= 0:
            # In the vertical plane through the nose: along it, and downwards across it.
            a = 2 * (rotors + s.azimuth[v])
            cos_0, sin_0 = math.cos(state[a]), math.sin(state[a])
            cos_1, sin_1 = math.cos(out[a]), math.sin(out[a])
            x_0, y_0 = x_0 * cos_0 + y_0 * sin_0, -here_0[2]
            x_1, y_1 = x_1 * cos_1 + y_1 * sin_1, -here_1[2]
            turn_0 = turning_0[1] * cos_0 - turning_0[0] * sin_0
            turn_1 = turning_1[1] * cos_1 - turning_1[0] * sin_1
            pull_x, pull_y = pull_x * cos_1 + pull_y * sin_1, -pull[2]
        phi, rate = advance_vane(
            vane_of(s, v), state[j], state[j + 1], (x_0, x_1), (y_0, y_1), (turn_0, turn_1),
            (pull_x, pull_y), c_1[AIR_DENSITY] / s.vane_density[v], dt,
        )
        out[j] = phi
        out[j + 1] = rate / (1.0 + dt * grip_of(s, v) / (abs(rate) + CREEP))
    for i in range(rotors):
        phi_0 = rate_0 = phi_1 = rate_1 = 0.0
        if int(s.mounting[i, 0]) == ON_VANE:
            j = 2 * (rotors + int(s.mounting[i, 1]))
            phi_0, rate_0, phi_1, rate_1 = state[j], state[j + 1], out[j], out[j + 1]
        axial_0, transverse_0, lateral_0 = rotor_axes(
            s, i, at_instrument(s, i, felt_0), phi_0, rate_0 + c_0[MOUNT_YAW_RATE]
        )
        axial_1, transverse_1, lateral_1 = rotor_axes(
            s, i, at_instrument(s, i, felt_1), phi_1, rate_1 + c_1[MOUNT_YAW_RATE]
        )
        y, psi = advance_rotor(
            rotor_of(s, i), state[2 * i], state[2 * i + 1], (axial_0, axial_1),
            (transverse_0, transverse_1), (lateral_0, lateral_1),
            c_1[AIR_DENSITY] / s.mounting[i, 6], c_1[AIR_TEMPERATURE], dt,
        )
        out[2 * i] = y
        out[2 * i + 1] = psi


@compiled
def advance_with_jacobian(
    s: Instruments,
    wind_0: FloatArray,
    wind_1: FloatArray,
    c_0: FloatArray,
    c_1: FloatArray,
    state: FloatArray,
    dt: float,
    reach: FloatArray,
    out: FloatArray,
    by_wind_0: FloatArray,
    by_wind_1: FloatArray,
    by_state: FloatArray,
) -> None:
    """`advance_station` and its derivatives.

    Those by the wind are differences over the wind's own uncertainty, so that a rotor below its
    starting speed or a vane in a calm still learns from what the wind may do (statistical
    linearisation).

    Args:
        reach: Half widths of those differences [m/s], shape (3,).
        by_wind_0, by_wind_1: Filled with d out / d wind, shape (states, 3) each.
        by_state: Filled with d out / d state, shape (states, states).
    """
    count = state.shape[0]
    rotors = s.rotor.shape[0]
    tried = np.empty((3, count))
    inputs = np.empty(6 + count)
    inputs[0:3] = wind_0
    inputs[3:6] = wind_1
    inputs[6:] = state
    small = 1e-4
    # One call in one loop: the compiler then keeps a single copy of the equations.
    for k in range(-1, 12 + count):
        which = k // 2 if k < 12 else k - 6
        keep = inputs[which] if k >= 0 else 0.0
        if k >= 12:
            r = k - 12
            if r < 2 * rotors and r % 2 == 1 and s.rotor[r // 2, 13] == 0.0:
                continue
            inputs[which] = keep + small
        elif k >= 0:
            inputs[which] = keep + (reach[which % 3] if k % 2 == 0 else -reach[which % 3])
        advance_station(
            s, inputs[0:3], inputs[3:6], c_0, c_1, inputs[6:], dt, tried[0] if k < 0 else tried[1]
        )
        if k < 0:
            for j in range(count):
                out[j] = tried[0, j]
            continue
        inputs[which] = keep
        for j in range(count):
            if k >= 12:
                by_state[j, k - 12] = (tried[1, j] - out[j]) / small
            elif k % 2 == 0:
                tried[2, j] = tried[1, j]
            elif which < 3:
                by_wind_0[j, which] = (tried[2, j] - tried[1, j]) / (2.0 * reach[which])
            else:
                by_wind_1[j, which - 3] = (tried[2, j] - tried[1, j]) / (2.0 * reach[which - 3])
    for i in range(rotors):
        # Where friction stops a rotor its equation has a step, and a difference across it no bound;
        # two rotors in one wind only come closer.
        by_state[2 * i, 2 * i] = min(max(by_state[2 * i, 2 * i], 0.0), 1.0)
        furthest = dt / s.rotor[i, 1]
        by_state[2 * i + 1, 2 * i] = min(max(by_state[2 * i + 1, 2 * i], 0.0), furthest)
        if s.rotor[i, 13] == 0.0:
            for j in range(count):
                by_state[j, 2 * i + 1] = 0.0
            by_state[2 * i + 1, 2 * i + 1] = 1.0
