"""One step of the extended Kalman filter: time passes, then an edge or a reading corrects.

The state's wind part moves linearly (`turbulence_process`), the instruments by their equations of
motion (`forward`). Because those are not linear, the mean of a rotor's rate is corrected to second
order: E[(A - y)(a4 A + (1 - a4) y)] differs from its value at the means by
a4 var A + (1 - 2 a4) cov(A, y) - (1 - a4) var y. Without this the unresolved gusts would
overspeed the estimate as they overspeed the cup.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.filter_state import EDGE, READING, FilterState, Ring
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
    SMALL_SCALES,
    TIME_CONSTANTS,
    UNRESOLVED_VARIANCE,
    VARIANCES,
    VERTICAL_CONSTANTS,
    VERTICAL_VARIANCES,
    WANDERING,
    WIND_STATES,
    slow_vertical_variance,
)

FloatArray = npt.NDArray[np.float64]

_PROCESSES = len(TIME_CONSTANTS)
_VERTICAL = len(VERTICAL_CONSTANTS)
_MODEL_ERROR = 0.003
"""Standard deviation of the forcing relative to the wind (radians for a vane), over a time of
response."""
_CALM = 0.3
"""[m/s]"""
_RARE = 7.0
"""Log of the odds against a lost or an extra edge before any was seen."""
_FAR_OUT = 5.0
"""Innovations beyond this many standard deviations are cut back to it."""


@compiled
def wind_of(mean: FloatArray, out: FloatArray) -> None:
    """Total wind of the state, ENU [m/s], written to `out` (3,)."""
    east = 0.0
    north = 0.0
    up = 0.0
    for i in range(PAIRS):
        east += mean[2 * i]
        north += mean[2 * i + 1]
    for i in range(_VERTICAL):
        up += mean[2 * PAIRS + i]
    out[0] = east
    out[1] = north
    out[2] = up


@compiled
def component(state: int) -> int:
    """Which wind component (0 east, 1 north, 2 up) a wind state belongs to."""
    return state % 2 if state < 2 * PAIRS else 2


@compiled
def wind_covariance(covariance: FloatArray, out: FloatArray) -> None:
    """Covariance of the total wind, written to `out` (3, 3)."""
    out[:] = 0.0
    for i in range(WIND_STATES):
        a = component(i)
        for j in range(WIND_STATES):
            out[a, component(j)] += covariance[i, j]


@compiled
def prepare_wind_noise(
    f: FilterState, ring: Ring, slot: int, dt: float, noise: FloatArray
) -> None:
    """Decay factors and process noise of the wind states over dt.

    Args:
        f: The filter.
        ring: Receives decay, noise along and across, and the mean wind's direction.
        slot: Where in the ring.
        dt: Seconds.
        noise: Filled with east variance, north variance, east-north covariance of each pair, and
            the variances of the vertical processes in the first column below them.
    """
    east = f.mean[2 * PAIRS - 2] + f.mean[2 * PAIRS - 4]
    north = f.mean[2 * PAIRS - 1] + f.mean[2 * PAIRS - 3]
    size = math.hypot(east, north)
    if size > 1e-6:
        east, north = east / size, north / size
    else:
        east, north = 1.0, 0.0
    ring.heading[slot, 0] = east
    ring.heading[slot, 1] = north
    for i in range(PAIRS):
        group = 0 if i < SMALL_SCALES else 1
        if i < _PROCESSES:
            d = math.exp(-dt / TIME_CONSTANTS[i])
            unit = VARIANCES[i] * (1.0 - d * d)
        else:
            d = 1.0
            unit = WANDERING * dt
        along = f.levels[group] * unit
        across = f.levels[2 + group] * unit
        ring.decay[slot, 2 * i] = d
        ring.decay[slot, 2 * i + 1] = d
        ring.noise[slot, i, 0] = along
        ring.noise[slot, i, 1] = across
        noise[i, 0] = along * east * east + across * north * north
        noise[i, 1] = along * north * north + across * east * east
        noise[i, 2] = (along - across) * east * north
    for i in range(_VERTICAL):
        d = math.exp(-dt / VERTICAL_CONSTANTS[i])
        ring.decay[slot, 2 * PAIRS + i] = d
        variance = VERTICAL_VARIANCES[i]
        if i == _VERTICAL - 1:
            variance = slow_vertical_variance(f.height[0], size)
        noise[PAIRS + i, 0] = f.levels[2] * variance * (1.0 - d * d)


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
) -> float:
    """Second-order part of the mean dy/dt [m/s^2] of a rotor in a wind that is not known exactly.

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
    curvature = 0.0
    a_0, b_0 = 0.0, 0.0
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
        ahead = 0.0
        for side in range(2):
            sign = 0.0 if k < 0 else (delta if side == 0 else -delta)
            moved[0] = wind[0] + sign * along_e
            moved[1] = wind[1] + sign * along_n
            moved[2] = wind[2] + sign * along_u
            a, b = forcing_of(s, rotor, moved, c, phi, air_turn)
            if k < 0:
                a_0, b_0 = a, b
                break
            if side == 0:
                ahead = a
                continue
            curvature += 0.5 * (ahead + a - 2.0 * a_0)
            slope = (ahead - a) / (2.0 * delta)
            gradient[0] += slope * along_e
            gradient[1] += slope * along_n
            gradient[2] += slope * along_u
    forcing_variance = 0.0
    with_forcing = 0.0
    for i in range(3):
        with_forcing += gradient[i] * with_rate[i]
        forcing_variance += gradient[i] * gradient[i] * unresolved
        for j in range(3):
            forcing_variance += gradient[i] * spread[i, j] * gradient[j]
    a4 = s.rotor[rotor, 4]
    slope_wind = a4 * b_0 + (1.0 - a4) * y
    second = (
        a4 * forcing_variance
        + (1.0 - 2.0 * a4) * with_forcing
        - (1.0 - a4) * rate_variance
        + slope_wind * curvature
    )
    density = c[AIR_DENSITY] / s.mounting[rotor, 6]
    return float(density * second / (s.rotor[rotor, 3] * s.rotor[rotor, 12]))


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
    with_rate = np.empty(3)
    for i in range(rotors):
        if state[2 * i] <= 0.02:
            continue
        phi, turn = 0.0, 0.0
        if int(s.mounting[i, 0]) == ON_VANE:
            j = 2 * (rotors + int(s.mounting[i, 1]))
            phi, turn = state[j], state[j + 1] + f.circumstances[MOUNT_YAW_RATE]
        with_rate[:] = 0.0
        for k in range(w):
            with_rate[component(k)] += f.covariance[k, w + 2 * i]
        extra[i] = overspeeding(
            s, i, wind_0, spread, with_rate, f.covariance[w + 2 * i, w + 2 * i], state[2 * i],
            f.circumstances, phi, turn, unresolved,
        )  # fmt: skip
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
    )  # fmt: skip
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


@compiled
def correct(
    f: FilterState, ring: Ring, slot: int, measured: int, innovation: float, variance: float
) -> float:
    """Scalar measurement of one state; returns the squared normalised innovation.

    An innovation far outside its scatter is given the noise that makes it believable.
    """
    n = f.mean.shape[0]
    p = f.covariance
    total = p[measured, measured] + variance
    squared = innovation * innovation / total
    if squared > _FAR_OUT * _FAR_OUT:
        total = innovation * innovation / (_FAR_OUT * _FAR_OUT)
    gain = ring.gain[slot]
    for i in range(n):
        gain[i] = p[i, measured] / total
    for i in range(n):
        f.mean[i] += gain[i] * innovation
    for i in range(n):
        for j in range(i + 1):
            value = p[i, j] - gain[i] * total * gain[j]
            p[i, j] = value
            p[j, i] = value
    ring.measured[slot] = measured
    ring.innovation[slot] = innovation
    ring.variance[slot] = total
    return float(squared)


@compiled
def correct_by_reading(f: FilterState, s: Instruments, ring: Ring, slot: int, v: int, angle: float,
                       extra_variance: float) -> None:  # fmt: skip
    """A vane's reading, already turned into a heading of the nose [rad]."""
    rotors = s.rotor.shape[0]
    measured = WIND_STATES + 2 * (rotors + v)
    innovation = angle - f.mean[measured]
    innovation -= 2.0 * math.pi * math.floor((innovation + math.pi) / (2.0 * math.pi))
    squared = correct(f, ring, slot, measured, innovation, f.reading_variance[v] + extra_variance)
    ring.kind[slot] = READING if extra_variance == 0.0 else -READING
    ring.which[slot] = v
    _note(f, rotors + v, squared)


@compiled
def _note(f: FilterState, which: int, squared: float) -> None:
    """Running consistency of the innovations."""
    keep = 0.998
    f.innovation[which, 0] = keep * f.innovation[which, 0] + min(squared, 100.0)
    f.innovation[which, 1] = keep * f.innovation[which, 1] + 1.0
    if squared > _FAR_OUT * _FAR_OUT:
        f.outliers[which] += 1


@compiled
def correct_by_edge(f: FilterState, ring: Ring, slot: int, r: int, time: int) -> None:
    """An edge of rotor r at a time [ns], the number of lost edges resolved.

    Edges were lost (or came extra) when the filter says so and the interval has grown (or shrunk)
    as much: no rotor changes so quickly by itself.
    """
    measured = WIND_STATES + 2 * r + 1
    width = 2.0 * math.pi / f.slots[r]
    number = f.edge_count[r]
    place = int(number % f.slots[r])
    expected = (number + f.slot_error[r, place]) * width
    off = (expected - f.mean[measured]) / width
    spread = math.sqrt(f.covariance[measured, measured]) / width
    lost = -math.floor(off + 0.5)
    interval = (time - f.last_used[r]) * 1e-9 / f.stride[r]
    even = (1.0 + 0.5 * lost / f.stride[r]) * f.slot_interval[r]
    if (lost > 0 and interval < even) or (lost < 0 and interval > even):
        lost = 0
    if f.slot_interval[r] == 0.0:
        lost = 0
    if lost != 0:
        # An edge too many or too few is rare: the evidence must outweigh that.
        share = (f.tally[r, 1] + f.tally[r, 2] + 0.5) / (f.tally[r, 0] + 1.0)
        doubt = min(max(-math.log(share), 1.0), _RARE)
        gained = 0.5 * (off * off - (off + lost) * (off + lost))
        if gained < doubt * (spread * spread + f.edge_variance[r]):
            lost = 0
    if lost != 0:
        number += lost
        f.edge_count[r] = number
        if lost > 0:
            f.tally[r, 1] += lost
        else:
            f.tally[r, 2] -= lost
        place = int(number % f.slots[r])
        expected = (number + f.slot_error[r, place]) * width
    if f.last_used[r] > 0:
        f.slot_interval[r] = interval * f.stride[r] / max(f.stride[r] + lost, 1)
    f.last_used[r] = time
    innovation = expected - f.mean[measured]
    variance = f.edge_variance[r] * width * width
    squared = correct(f, ring, slot, measured, innovation, variance)
    ring.kind[slot] = EDGE
    ring.which[slot] = r
    ring.slot[slot] = place
    _note(f, r, squared)


@compiled
def correct_by_turns(f: FilterState, ring: Ring, slot: int, r: int, angle: float) -> None:
    """The angle that rotor r has turned through [rad], from a counter or an encoder.

    A reading far from what the rotor can have done means that the counter began anew.
    """
    measured = WIND_STATES + 2 * r + 1
    width = 2.0 * math.pi / f.slots[r]
    innovation = angle - f.mean[measured]
    spread = math.sqrt(f.covariance[measured, measured])
    if abs(innovation) > 4.0 * spread + 20.0 * width:
        f.rejected[r] += 1
        if f.rejected[r] >= 3:
            f.mean[measured] = angle
            f.rejected[r] = 0
            f.tally[r, 3] += 1
        return
    f.rejected[r] = 0
    squared = correct(f, ring, slot, measured, innovation, f.edge_variance[r] * width * width)
    ring.kind[slot] = EDGE
    ring.which[slot] = r
    _note(f, r, squared)


@compiled
def correct_by_silence(f: FilterState, ring: Ring, slot: int, r: int, limit: float) -> None:
    """No edge yet: rotor r has not passed `limit` [rad]; a truncated normal distribution.

    Its mean and variance are matched by an equivalent measurement, so that the smoother sees an
    ordinary one.
    """
    measured = WIND_STATES + 2 * r + 1
    variance = f.covariance[measured, measured]
    deviation = math.sqrt(variance)
    z = (limit - f.mean[measured]) / deviation
    if z > 2.5:
        return
    if z > -5.0:
        ratio = math.exp(-0.5 * z * z) / (
            math.sqrt(2.0 * math.pi) * 0.5 * math.erfc(-z / math.sqrt(2.0))
        )
    else:
        ratio = -z - 1.0 / z
    left = min(max(1.0 - z * ratio - ratio * ratio, 1e-4), 0.999)
    noise = variance * left / (1.0 - left)
    innovation = -deviation * ratio * (variance + noise) / variance
    correct(f, ring, slot, measured, innovation, noise)
