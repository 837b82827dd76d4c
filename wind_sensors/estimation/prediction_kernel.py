"""Time passes: the filter's state and covariance over one interval.

The wind part moves linearly (`turbulence_process`), the instruments by their equations of motion
(`forward`). Because those are not linear, the mean of a rotor's rate is corrected to second order:
E[(A - y)(a4 B + (1 - a4) y)] differs from its value at the means by
a4 cov(A, B) + (1 - a4) cov(A, y) - a4 cov(B, y) - (1 - a4) var y and by what the curvatures of A
and B in the wind make of its variance; so does the lift E. Without this the unresolved gusts would
overspeed the estimate as they overspeed the rotor.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.filter_state import FilterState, Ring
from wind_sensors.estimation.forward import (
    AIR_DENSITY,
    MOUNT_YAW_RATE,
    ON_VANE,
    Instruments,
    advance_with_jacobian,
    forcing_of,
)
from wind_sensors.estimation.turbulence_process import (
    PAIRS,
    UNRESOLVED_VARIANCE,
    VERTICAL_CONSTANTS,
    WIND_STATES,
)
from wind_sensors.estimation.wind_state import (
    component,
    prepare_wind_noise,
    wind_covariance,
    wind_of,
)

FloatArray = npt.NDArray[np.float64]

_VERTICAL = len(VERTICAL_CONSTANTS)
_MODEL_ERROR = 0.003
"""Standard deviation of the forcing relative to the wind (radians for a vane), over a time of
response."""
_GUST_TIME = 0.2
"""How long an unknown gust of the wind lasts [s]."""
_CALM = 0.3
"""[m/s]"""
_AT_REST = 0.02
"""Slower rotors stand still or are about to [m/s]."""


@compiled
def overspeeding(
    s: Instruments,
    rotor: int,
    wind: FloatArray,
    spread: FloatArray,
    with_rate: FloatArray,
    rate_variance: float,
    y: float,
    c: FloatArray,
    phi: float,
    air_turn: float,
    unresolved: float,
) -> tuple[float, float]:
    """Second-order parts of mean [m/s^2] and variance [m^2/s^4] of dy/dt in an uncertain wind.

    The torque is quadratic in the wind: where its slope vanishes (half the rotor's own speed) the
    second-order variance is all there is.

    Args:
        s: The station.
        rotor: Index.
        wind: Mean wind, ENU [m/s].
        spread: Its covariance, shape (3, 3).
        with_rate: Covariance of wind and y, shape (3,).
        rate_variance: Variance of y.
        y: Mean of y [m/s].
        c: Circumstances.
        phi, air_turn: Heading of the carrying vane and its turning against the air.
        unresolved: Variance of each component faster than any process of the state.
    """
    size = max(math.hypot(wind[0] - c[0], wind[1] - c[1]), 0.5)
    e = (wind[0] - c[0]) / size
    n = (wind[1] - c[1]) / size
    moved = np.empty(3)
    gradient = np.zeros(3)
    slope_gradient = np.zeros(3)
    curvature = 0.0
    slope_curvature = 0.0
    lift_curvature = 0.0
    a_0, b_0, e_0 = 0.0, 0.0, 0.0
    for k in range(-1, 3):
        along_e, along_n, along_u = 0.0, 0.0, 0.0
        if k == 0:
            along_e, along_n = e, n
        elif k == 1:
            along_e, along_n = -n, e
        elif k == 2:
            along_u = 1.0
        variance = (
            along_e * along_e * spread[0, 0]
            + 2.0 * along_e * along_n * spread[0, 1]
            + along_n * along_n * spread[1, 1]
            + along_u * spread[2, 2]
            + unresolved
        )
        delta = min(math.sqrt(max(variance, 1e-8)), 0.5 * size)
        ahead, slope_ahead, lift_ahead = 0.0, 0.0, 0.0
        for side in range(2):
            sign = 0.0 if k < 0 else (delta if side == 0 else -delta)
            moved[0] = wind[0] + sign * along_e
            moved[1] = wind[1] + sign * along_n
            moved[2] = wind[2] + sign * along_u
            a, b, lift = forcing_of(s, rotor, moved, c, phi, air_turn)
            if k < 0:
                a_0, b_0, e_0 = a, b, lift
                break
            if side == 0:
                ahead, slope_ahead, lift_ahead = a, b, lift
                continue
            curvature += 0.5 * (ahead + a - 2.0 * a_0)
            slope_curvature += 0.5 * (slope_ahead + b - 2.0 * b_0)
            lift_curvature += 0.5 * (lift_ahead + lift - 2.0 * e_0)
            rise = (ahead - a) / (2.0 * delta)
            gradient[0] += rise * along_e
            gradient[1] += rise * along_n
            gradient[2] += rise * along_u
            rise = (slope_ahead - b) / (2.0 * delta)
            slope_gradient[0] += rise * along_e
            slope_gradient[1] += rise * along_n
            slope_gradient[2] += rise * along_u
    both = 0.0
    with_forcing = 0.0
    with_slope = 0.0
    for i in range(3):
        with_forcing += gradient[i] * with_rate[i]
        with_slope += slope_gradient[i] * with_rate[i]
        both += gradient[i] * slope_gradient[i] * unresolved
        for j in range(3):
            both += gradient[i] * spread[i, j] * slope_gradient[j]
    a4 = s.rotor[rotor, 4]
    second = (
        a4 * (both - with_slope)
        + (1.0 - a4) * (with_forcing - rate_variance)
        + (a4 * b_0 + (1.0 - a4) * y) * curvature
        + a4 * (a_0 - y) * slope_curvature
        + lift_curvature
    )
    density = c[AIR_DENSITY] / s.mounting[rotor, 6]
    factor = density / (s.rotor[rotor, 3] * s.rotor[rotor, 12])
    return float(factor * second), float(2.0 * (factor * a4 * both) ** 2)


@compiled
def predict(
    f: FilterState, s: Instruments, ring: Ring, slot: int, c: FloatArray, dt: float
) -> None:
    """Let dt [s] pass; the step's transition goes into the ring."""
    n = f.mean.shape[0]
    w = WIND_STATES
    count = n - w
    rotors = s.rotor.shape[0]
    noise = np.zeros((PAIRS + _VERTICAL, 3))
    prepare_wind_noise(f, ring, slot, dt, noise)
    decay = ring.decay[slot]
    wind_0 = np.empty(3)
    wind_1 = np.empty(3)
    wind_of(f.mean, wind_0)
    state = f.mean[w:].copy()
    spread = np.empty((3, 3))
    wind_covariance(f.covariance, spread)
    unresolved = 0.5 * (f.levels[0] + f.levels[2]) * UNRESOLVED_VARIANCE
    extra = np.zeros(rotors)
    second_variance = np.zeros(rotors)
    with_rate = np.empty(3)
    for i in range(rotors):
        if abs(state[2 * i]) <= _AT_REST:
            continue
        phi, turn = 0.0, 0.0
        if int(s.mounting[i, 0]) == ON_VANE:
            j = 2 * (rotors + int(s.mounting[i, 1]))
            phi, turn = state[j], state[j + 1] + f.circumstances[MOUNT_YAW_RATE]
        with_rate[:] = 0.0
        for k in range(w):
            with_rate[component(k)] += f.covariance[k, w + 2 * i]
        extra[i], second_variance[i] = overspeeding(
            s, i, wind_0, spread, with_rate, f.covariance[w + 2 * i, w + 2 * i], state[2 * i],
            f.circumstances, phi, turn, unresolved,
        )
    for k in range(w):
        f.mean[k] *= decay[k]
    wind_of(f.mean, wind_1)
    out = np.empty(count)
    by_wind_0 = np.empty((count, 3))
    by_wind_1 = ring.noise_gain[slot]
    by_state = np.empty((count, count))
    reach = np.empty(3)
    for a in range(3):
        reach[a] = min(max(math.sqrt(max(spread[a, a], 0.0)), 1e-3), 1.0)
    advance_with_jacobian(
        s, wind_0, wind_1, f.circumstances, c, state, dt, reach, out, by_wind_0, by_wind_1,
        by_state,
    )
    for i in range(rotors):
        out[2 * i] += dt * extra[i]
        out[2 * i + 1] += 0.5 * dt * dt * extra[i] / s.rotor[i, 1]
    transition = ring.transition[slot]
    for r in range(count):
        f.mean[w + r] = out[r]
        for k in range(w):
            a = component(k)
            transition[r, k] = by_wind_0[r, a] + by_wind_1[r, a] * decay[k]
        for k in range(count):
            transition[r, w + k] = by_state[r, k]
    _move_covariance(f.covariance, decay, transition, by_wind_1, noise)
    _add_model_noise(f.covariance, s, math.hypot(wind_1[0] - c[0], wind_1[1] - c[1]), dt)
    for i in range(rotors):
        f.covariance[w + 2 * i, w + 2 * i] += 2.0 * dt * _GUST_TIME * second_variance[i]
    f.circumstances[:] = c
    ring.moved[slot] = 1


@compiled
def _add_model_noise(p: FloatArray, s: Instruments, speed: float, dt: float) -> None:
    """What the equations of motion leave out: torques of a small share of the wind's."""
    rotors = s.rotor.shape[0]
    for i in range(rotors):
        length = s.rotor[i, 3] * s.rotor[i, 12]
        h = max(speed, _CALM)
        p[WIND_STATES + 2 * i, WIND_STATES + 2 * i] += (
            2.0 * dt * _MODEL_ERROR * _MODEL_ERROR * h * h * h / length
        )
    for v in range(s.vane.shape[0]):
        j = WIND_STATES + 2 * (rotors + v) + 1
        omega = max(speed, _CALM) / s.vane[v, 0]
        p[j, j] += 2.0 * dt * _MODEL_ERROR * _MODEL_ERROR * omega * omega * omega
        length = s.vane[v, 0]
        stuck = s.vane[v, 4] / (length * length * s.vane[v, 2])
        p[j, j] += 2.0 * dt * stuck * stuck / omega


@compiled
def _move_covariance(
    p: FloatArray,
    decay: FloatArray,
    transition: FloatArray,
    noise_gain: FloatArray,
    noise: FloatArray,
) -> None:
    """P := F P F^T + Gamma Q Gamma^T with the structure of F used."""
    n = p.shape[0]
    w = WIND_STATES
    count = n - w
    rows = np.zeros((count, n))
    for r in range(count):
        for k in range(n):
            g = transition[r, k]
            if g != 0.0:
                for j in range(n):
                    rows[r, j] += g * p[k, j]
    total = np.zeros((3, 3))
    for i in range(PAIRS):
        total[0, 0] += noise[i, 0]
        total[1, 1] += noise[i, 1]
        total[0, 1] += noise[i, 2]
    total[1, 0] = total[0, 1]
    for i in range(_VERTICAL):
        total[2, 2] += noise[PAIRS + i, 0]
    own = np.empty((count, 3))
    for r in range(count):
        for a in range(3):
            own[r, a] = (
                noise_gain[r, 0] * total[0, a]
                + noise_gain[r, 1] * total[1, a]
                + noise_gain[r, 2] * total[2, a]
            )
    for r in range(count):
        for q in range(r + 1):
            value = 0.0
            for k in range(n):
                value += rows[r, k] * transition[q, k]
            for a in range(3):
                value += own[r, a] * noise_gain[q, a]
            p[w + r, w + q] = value
            p[w + q, w + r] = value
    for r in range(count):
        for k in range(w):
            value = rows[r, k] * decay[k]
            if k < 2 * PAIRS:
                i = k // 2
                if k % 2 == 0:
                    value += noise_gain[r, 0] * noise[i, 0] + noise_gain[r, 1] * noise[i, 2]
                else:
                    value += noise_gain[r, 1] * noise[i, 1] + noise_gain[r, 0] * noise[i, 2]
            else:
                value += noise_gain[r, 2] * noise[PAIRS + k - 2 * PAIRS, 0]
            p[w + r, k] = value
            p[k, w + r] = value
    for i in range(w):
        for k in range(w):
            p[i, k] *= decay[i] * decay[k]
    for i in range(PAIRS):
        p[2 * i, 2 * i] += noise[i, 0]
        p[2 * i + 1, 2 * i + 1] += noise[i, 1]
        p[2 * i, 2 * i + 1] += noise[i, 2]
        p[2 * i + 1, 2 * i] += noise[i, 2]
    for i in range(_VERTICAL):
        p[2 * PAIRS + i, 2 * PAIRS + i] += noise[PAIRS + i, 0]
