"""Compiled parts of the inverse method: local fits, and the wind that makes a motion."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.forward import (
    AIR_DENSITY,
    AIR_TEMPERATURE,
    CREEP,
    MOUNT_ROTATION,
    MOUNT_VELOCITY,
    Instruments,
    at_instrument,
    gravity,
    leant,
    rotor_axes,
    rotor_of,
    turning,
    vane_with_friction,
)
from wind_sensors.instruments.dynamics.rotor import (
    PROPELLER_JACKSON,
    PROPELLER_KRISTENSEN_1994,
    RotorParameters,
    bearing_friction,
    table_at,
    torque_slope_ratio,
)
from wind_sensors.instruments.dynamics.vane import VaneParameters

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_FEWEST = 5
"""A fit reaches as far as it must to have so many points."""
_LEAST_UPRIGHT = 0.5
"""Cosine of the lean beyond which a mount's vertical wind is no longer followed."""
_ROUNDS = 12
_FASTEST = 150.0
"""[m/s]"""

@compiled
def local_parabola(
    time: TimeArray, value: FloatArray, unsharp: FloatArray, at: int, width: float
) -> tuple[float, float, float, float, float, float]:
    """Weighted parabola through samples around an instant; a chord where there are none around it.

    Args:
        time: [ns], increasing, shape (n,), n >= 3.
        value: Shape (n,).
        unsharp: Variance of each sample beyond the usual one, in units of that, shape (n,) or (0,).
        at: The instant [ns].
        width: Standard deviation of the weights [s].

    Returns:
        Value, first and second derivative at the instant, the variances of value and first
        derivative for samples of unit variance, and how far from any sample a chord was drawn [s].
    """
    n = time.shape[0]
    first = np.searchsorted(time, at - int(4.0e9 * width))
    last = np.searchsorted(time, at + int(4.0e9 * width))
    nearest = np.searchsorted(time, at)
    step = (time[n - 1] - time[0]) // (n - 1)
    patience = max(int(4.0e9 * width), 4 * step)
    before = at - time[nearest - 1] if nearest > 0 else patience + 1
    after = time[nearest] - at if nearest < n else patience + 1
    if before > patience or after > patience:
        return _chord(time, value, at, int(nearest))
    while last - first < min(_FEWEST, n):
        if first > 0 and (last >= n or at - time[first - 1] < time[last] - at):
            first -= 1
        else:
            last += 1
    span = max(abs(time[first] - at), abs(time[last - 1] - at)) * 1e-9
    scale = max(width, 0.5 * span if last - first <= _FEWEST else 0.0, 1e-6)
    base = value[first]
    m = np.zeros(5)
    r = np.zeros(3)
    q = np.zeros(5)
    for i in range(first, last):
        x = (time[i] - at) * 1e-9 / scale
        w = math.exp(-0.5 * x * x)
        if unsharp.shape[0] > 0:
            w /= 1.0 + unsharp[i]
        p = w
        own = w if unsharp.shape[0] == 0 else w * (1.0 + unsharp[i])
        for k in range(5):
            m[k] += p
            q[k] += p * own
            if k < 3:
                r[k] += p * (value[i] - base)
            p *= x
    a = np.empty((3, 3))
    b = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a[i, j] = m[i + j]
            b[i, j] = q[i + j]
        a[i, i] += 1e-9 * m[0]
    inverse = np.linalg.inv(a)
    c = inverse @ r
    spread = inverse @ b @ inverse
    return (
        c[0] + base,
        c[1] / scale,
        2.0 * c[2] / (scale * scale),
        spread[0, 0],
        spread[1, 1] / (scale * scale),
        0.0,
    )


@compiled
def _chord(
    time: TimeArray, value: FloatArray, at: int, nearest: int
) -> tuple[float, float, float, float, float, float]:
    """Straight on between two samples far apart; beyond the first or last, its value and rate."""
    n = time.shape[0]
    if 0 < nearest < n:
        span = (time[nearest] - time[nearest - 1]) * 1e-9
        rate = (value[nearest] - value[nearest - 1]) / span
        since = (at - time[nearest - 1]) * 1e-9
        away = min(since, span - since)
        return value[nearest - 1] + rate * since, rate, 0.0, 1.0, 1.0, away
    few = min(_FEWEST, n) - 1
    end, other = (0, few) if nearest == 0 else (n - 1, n - 1 - few)
    rate = (value[end] - value[other]) / ((time[end] - time[other]) * 1e-9)
    return value[end], rate, 0.0, 1.0, 1.0, abs(at - time[end]) * 1e-9


@compiled
def forcing_from_motion(
    p: RotorParameters,
    y: float,
    y_rate: float,
    angle: float,
    density_ratio: float,
    temperature: float,
) -> float:
    """Horizontal wind speed [m/s] that gives a rotor y = l s and its rate of change.

    Args:
        p: Constants.
        y: [m/s].
        y_rate: [m/s^2].
        angle: Between wind and rotor axis [rad], for a propeller.
        density_ratio: Air density relative to the calibration's.
        temperature: [deg C].
    """
    friction = bearing_friction(p, y, temperature)
    push = (p.distance_constant * p.inertia_factor * y_rate + friction) / density_ratio
    if p.form == PROPELLER_JACKSON:
        # (G x + o - y) (a4 x g/f + (1 - a4) y) = push for x = U f.
        f = max(table_at(p.angular_response, angle), 0.2)
        slope = p.a4 * max(torque_slope_ratio(angle), 0.2) / f
        free = (y - p.calibration_offset) / p.calibration_gain
        push /= p.calibration_gain
        constant = (1.0 - p.a4) * y
        if slope < 0.05:
            return max(free + push / max(constant, 0.1), 0.0) / f
        own = constant + slope * free
        root = math.sqrt(max(own * own + 4.0 * slope * push, 0.0))
        return max(free + (root - own) / (2.0 * slope), 0.0) / f
    if p.a4 > 0.05:
        b = (1.0 - 2.0 * p.a4) * y
        root = max(b * b + 4.0 * p.a4 * ((1.0 - p.a4) * y * y + push), 0.0)
        forcing = (-b + math.sqrt(root)) / (2.0 * p.a4)
    else:
        forcing = y + push / max(y, 0.1)
    return max((forcing + p.starting_speed - p.calibration_offset) / p.calibration_gain, 0.0)


@compiled
def wind_heading_from_motion(
    p: VaneParameters,
    phi: float,
    rate: float,
    acceleration: float,
    speed: float,
    yaw_rate: float,
    pull: tuple[float, float, float],
    density_ratio: float,
) -> float:
    """Heading the wind comes from [rad] that gives a vane its motion; see `vane_acceleration`.

    Args:
        p: Constants.
        phi, rate, acceleration: Of the nose [rad].
        speed: Across the vane's axis [m/s].
        yaw_rate: Of the mount [rad/s].
        pull: Gravity minus the mount's acceleration in the vane's axes [m/s^2].
        density_ratio: Air density relative to the calibration's.
    """
    omega = max(speed, 0.3) / p.distance_constant
    stiffness = density_ratio / (1.0 + p.softness * speed * speed) / p.inertia_factor
    other = 2.0 * p.damping_ratio * p.damping_factor * stiffness * omega * (rate + yaw_rate)
    other += p.viscosity / p.inertia_factor * rate
    if p.imbalance != 0.0:
        across = -pull[0] * math.sin(phi) + pull[1] * math.cos(phi)
        other -= p.imbalance / p.inertia_factor * across
    if p.cable > 0.0:
        length = p.distance_constant
        other += p.cable / (length * length * p.inertia_factor) * (phi - p.cable_rest)
    if p.friction > 0.0:
        length = p.distance_constant
        grip = p.friction / (length * length * p.inertia_factor)
        other += grip * rate / (abs(rate) + CREEP)
    deviation = -(acceleration + other) / (stiffness * omega * omega)
    return phi - p.aerodynamic_offset - math.asin(min(max(deviation, -1.0), 1.0))


@compiled
def _shown(
    p: RotorParameters, axial: float, transverse: float
) -> tuple[float, float]:
    """The speed that `forcing_from_motion` tells for a wind in rotor axes, and its angle [rad]."""
    if p.form == PROPELLER_JACKSON:
        return math.hypot(axial, transverse), math.atan2(transverse, axial)
    if p.form == PROPELLER_KRISTENSEN_1994:
        return axial, 0.0
    h = transverse
    return h + p.mu1 * axial + p.mu2 * (math.hypot(h, axial) - h), 0.0


@compiled
def _along(
    speed: float, heading: float, rise: float, with_lift: bool, c: FloatArray
) -> tuple[float, float, float]:
    """Wind in sensor axes [m/s] from its heading and its speed across the sensor's z axis.

    With a lift it rises by that angle, else it is level with the ground: a mount that leans, heaves
    or blows feels it from below or above.
    """
    x, y = -speed * math.cos(heading), -speed * math.sin(heading)
    if with_lift:
        return x, y, speed * math.tan(rise)
    upright = c[MOUNT_ROTATION + 8]
    level = -(c[MOUNT_ROTATION + 6] * x + c[MOUNT_ROTATION + 7] * y + c[MOUNT_VELOCITY + 2])
    return x, y, level / max(upright, _LEAST_UPRIGHT)


@compiled
def wind_from_motion(
    s: Instruments,
    which: tuple[int, int],
    rotor: tuple[float, float],
    nose: tuple[float, float, float],
    lift: tuple[float, float, float],
    with_lift: bool,
    c: FloatArray,
) -> tuple[float, float, float]:
    """Wind in sensor axes [m/s] that gives a rotor and a vane their motion.

    What the site does to the wind at each of them (wakes, speed-up and deflection, leaning axes)
    depends on the wind itself: from a first guess the wind is scaled and turned until both
    instruments feel what they show. Without a bivane the wind is taken as level with the ground.

    Args:
        s: The station.
        which: Indices of the rotor and of the nose axis.
        rotor: y = l s [m/s] and its rate [m/s^2].
        nose: Heading [rad], rate, acceleration of the nose.
        lift: The same of a bivane's elevation.
        with_lift: Whether there is a bivane.
        c: Circumstances.
    """
    i, v = which
    rotors = s.rotor.shape[0]
    p = rotor_of(s, i)
    q = vane_with_friction(s, v)
    density = c[AIR_DENSITY] / s.mounting[i, 6]
    vane_density = c[AIR_DENSITY] / s.vane_density[v]
    phi, rate = nose[0], nose[1]
    pull, turn = gravity(c), turning(c)
    if s.plain[rotors + v] == 0:
        pull, turn = leant(s, rotors + v, pull), leant(s, rotors + v, turn)
    speed = max(forcing_from_motion(p, rotor[0], rotor[1], 0.0, density, c[AIR_TEMPERATURE]), 0.01)
    heading = phi
    rise = 0.0
    for _ in range(_ROUNDS):
        wind = _along(speed, heading, rise, with_lift, c)
        at_vane = at_instrument(s, rotors + v, wind)
        h = math.hypot(at_vane[0], at_vane[1])
        wanted = wind_heading_from_motion(
            q, phi, rate, nose[2], h, turn[2], pull, vane_density
        )
        off = wanted - math.atan2(-at_vane[1], -at_vane[0])
        off -= 2.0 * math.pi * math.floor((off + math.pi) / (2.0 * math.pi))
        if with_lift:
            pitching = turn[1] * math.cos(phi) - turn[0] * math.sin(phi)
            down = (pull[0] * math.cos(phi) + pull[1] * math.sin(phi), -pull[2], 0.0)
            rise = wind_heading_from_motion(
                q, lift[0], lift[1], lift[2], h / math.cos(lift[0]), pitching, down, vane_density
            )
        axial, transverse, _ = rotor_axes(
            s, i, at_instrument(s, i, wind), phi, rate + turn[2]
        )
        felt, angle = _shown(p, axial, transverse)
        told = forcing_from_motion(p, rotor[0], rotor[1], angle, density, c[AIR_TEMPERATURE])
        ratio = told / max(felt, 0.05 * speed)
        speed = min(max(speed * ratio, 0.0), _FASTEST)
        heading += off
        if abs(off) < 1e-7 and abs(ratio - 1.0) < 1e-7:
            break
    return _along(speed, heading, rise, with_lift, c)
