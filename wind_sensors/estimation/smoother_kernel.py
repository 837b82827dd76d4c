"""Fixed-lag smoother: the backward recursion over the last steps of the filter.

Modified Bryson-Frazier form: the adjoint lambda and its covariance Lambda run back through
corrections and transitions, and the smoothed state is x - P lambda with covariance
P - P Lambda P; no matrix is inverted. The same adjoints are the exact scores of the
log-likelihood with respect to process and measurement noise (Koopman & Shephard (1992)), so that
turbulence levels, reading noise and slot places follow the data by maximum likelihood.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.filter_state import EDGE, OUTPUT, READING, FilterState, Ring
from wind_sensors.estimation.forward import Instruments
from wind_sensors.estimation.turbulence_process import (
    LEVELS,
    PAIRS,
    SMALL_SCALES,
    VERTICAL_LEVEL,
    WIND_STATES,
)
from wind_sensors.estimation.wind_state import component

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_START_BLOCKS = 30.0
"""The first blocks move the levels faster than later ones."""
_LARGEST_MOVE = 0.3
_STRONGEST = 2.0 / 60.0 ** (2.0 / 3.0)
"""Highest level over the speed squared: a turbulence intensity of one within a minute."""
_EDGE_LIMITS = (1e-4**2, 0.3**2)
_READING_LIMITS = (math.radians(0.01) ** 2, math.radians(6.0) ** 2)


@compiled
def _deliver(
    ring: Ring,
    at: int,
    adjoint: FloatArray,
    adjoint_covariance: FloatArray,
    states: FloatArray,
    covariance: FloatArray,
) -> None:
    """Smoothed wind and instrument states of the step `at`, written to the last two arguments."""
    p = ring.covariance[at]
    n = p.shape[0]
    w = WIND_STATES
    count = n - w
    size = 3 + count
    rows = np.zeros((size, n))
    mean = np.zeros(size)
    for k in range(w):
        a = component(k)
        mean[a] += ring.mean[at, k]
        for j in range(n):
            rows[a, j] += p[k, j]
    for r in range(count):
        mean[3 + r] = ring.mean[at, w + r]
        for j in range(n):
            rows[3 + r, j] = p[w + r, j]
    moved = np.zeros((size, n))
    for a in range(size):
        value = mean[a]
        for j in range(n):
            value -= rows[a, j] * adjoint[j]
        states[a] = value
        for k in range(n):
            left = rows[a, k]
            for j in range(n):
                moved[a, j] += left * adjoint_covariance[k, j]
    for a in range(size):
        for b in range(size):
            value = 0.0
            if b < 3:
                for k in range(w):
                    if component(k) == b:
                        value += rows[a, k]
            else:
                value = rows[a, w + b - 3]
            for j in range(n):
                value -= moved[a, j] * rows[b, j]
            covariance[a, b] = value


@compiled
def _score_levels(
    ring: Ring,
    at: int,
    adjoint: FloatArray,
    adjoint_covariance: FloatArray,
    score: FloatArray,
    expected: FloatArray,
) -> None:
    """Scores of the turbulence levels in one transition: found and expected."""
    w = WIND_STATES
    count = adjoint.shape[0] - w
    gain = ring.noise_gain[at]
    shared = np.zeros(2)
    both = np.zeros((2, 2))
    for a in range(2):
        for r in range(count):
            shared[a] += gain[r, a] * adjoint[w + r]
            for b in range(2):
                for q in range(count):
                    both[a, b] += gain[r, a] * adjoint_covariance[w + r, w + q] * gain[q, b]
    for i in range(2 * PAIRS, w):
        g = adjoint[i]
        m = adjoint_covariance[i, i]
        for r in range(count):
            g += gain[r, 2] * adjoint[w + r]
            m += 2.0 * gain[r, 2] * adjoint_covariance[i, w + r]
            for q in range(count):
                m += gain[r, 2] * adjoint_covariance[w + r, w + q] * gain[q, 2]
        upwards = ring.noise[at, i - PAIRS, 0]
        score[VERTICAL_LEVEL] += upwards * g * g
        expected[VERTICAL_LEVEL] += upwards * m
    e = ring.heading[at, 0]
    n = ring.heading[at, 1]
    cross = np.empty((2, 2))
    for i in range(PAIRS):
        for a in range(2):
            for b in range(2):
                value = 0.0
                for r in range(count):
                    value += adjoint_covariance[2 * i + a, w + r] * gain[r, b]
                cross[a, b] = value
        m_ee = adjoint_covariance[2 * i, 2 * i] + 2.0 * cross[0, 0] + both[0, 0]
        m_nn = adjoint_covariance[2 * i + 1, 2 * i + 1] + 2.0 * cross[1, 1] + both[1, 1]
        m_en = adjoint_covariance[2 * i, 2 * i + 1] + cross[0, 1] + cross[1, 0] + both[0, 1]
        g_e = adjoint[2 * i] + shared[0]
        g_n = adjoint[2 * i + 1] + shared[1]
        group = 0 if i < SMALL_SCALES else 1
        along = e * g_e + n * g_n
        across = e * g_n - n * g_e
        score[group] += ring.noise[at, i, 0] * along * along
        score[2 + group] += ring.noise[at, i, 1] * across * across
        expected[group] += ring.noise[at, i, 0] * (e * e * m_ee + 2 * e * n * m_en + n * n * m_nn)
        expected[2 + group] += ring.noise[at, i, 1] * (
            n * n * m_ee - 2 * e * n * m_en + e * e * m_nn
        )


@compiled
def _back_through_transition(
    ring: Ring, at: int, adjoint: FloatArray, adjoint_covariance: FloatArray, work: FloatArray
) -> None:
    """lambda := F^T lambda and Lambda := F^T Lambda F, in place."""
    n = adjoint.shape[0]
    w = WIND_STATES
    count = n - w
    decay = ring.decay[at]
    transition = ring.transition[at]
    tail = adjoint[w:].copy()
    for k in range(n):
        value = decay[k] * adjoint[k] if k < w else 0.0
        for r in range(count):
            value += transition[r, k] * tail[r]
        adjoint[k] = value
    for i in range(n):
        for k in range(w):
            work[i, k] = adjoint_covariance[i, k] * decay[k]
        for k in range(w, n):
            work[i, k] = 0.0
        for r in range(count):
            left = adjoint_covariance[i, w + r]
            for k in range(n):
                work[i, k] += left * transition[r, k]
    for i in range(w):
        for k in range(n):
            adjoint_covariance[i, k] = decay[i] * work[i, k]
    for i in range(w, n):
        for k in range(n):
            adjoint_covariance[i, k] = 0.0
    for r in range(count):
        for i in range(n):
            left = transition[r, i]
            if left != 0.0:
                for k in range(n):
                    adjoint_covariance[i, k] += left * work[w + r, k]


@compiled
def smooth(
    f: FilterState,
    s: Instruments,
    ring: Ring,
    until: int,
    weight: float,
    out_time: IntArray,
    out_states: FloatArray,
    out_covariance: FloatArray,
    out_circumstances: FloatArray,
    filled: int,
) -> int:
    """Run back over the ring, deliver what is final, and let the noise levels follow.

    Args:
        f, s, ring: Filter, station, steps.
        until: Estimates up to this time are final [ns].
        weight: Weight of the new block in the running averages.
        out_time, out_states, out_covariance, out_circumstances: Receive the estimates.
        filled: How many of those are in use.

    Returns:
        The new number in use.
    """
    n = f.mean.shape[0]
    rotors = s.rotor.shape[0]
    vanes = s.vane.shape[0]
    capacity = ring.time.shape[0]
    adjoint = np.zeros(n)
    adjoint_covariance = np.zeros((n, n))
    work = np.empty((n, n))
    score = np.zeros(LEVELS)
    expected = np.zeros(LEVELS)
    noise_score = np.zeros(rotors + vanes)
    noise_expected = np.zeros(rotors + vanes)
    steps = f.clock[2]
    oldest = max(0, steps - capacity)
    first = filled
    weight = max(weight, 1.0 / (_START_BLOCKS + f.clock[3]))
    k = steps - 1
    while k >= oldest:
        at = k % capacity
        if ring.time[at] <= f.clock[1]:
            break
        counted = ring.time[at] <= until
        if counted and ring.kind[at] == OUTPUT:
            out_time[filled] = ring.time[at]
            _deliver(
                ring, at, adjoint, adjoint_covariance, out_states[filled], out_covariance[filled]
            )
            out_circumstances[filled] = ring.circumstances[at]
            filled += 1
        j = ring.measured[at]
        if j >= 0:
            gain = ring.gain[at]
            projected = adjoint_covariance @ gain
            dot = 0.0
            quadratic = 0.0
            for i in range(n):
                dot += gain[i] * adjoint[i]
                quadratic += gain[i] * projected[i]
            error = ring.innovation[at] / ring.variance[at] + dot
            information = 1.0 / ring.variance[at] + quadratic
            if counted:
                if ring.kind[at] == EDGE:
                    r = ring.which[at]
                    width = 2.0 * math.pi / f.slots[r]
                    noise = f.edge_variance[r] * width * width
                    noise_score[r] += noise * error * error
                    noise_expected[r] += noise * information
                    if ring.slot[at] >= 0:
                        f.slot_score[r, ring.slot[at]] += error
                        f.slot_information[r, ring.slot[at]] += weight * information * width
                elif ring.kind[at] == READING:
                    v = ring.which[at]
                    noise = f.reading_variance[v]
                    noise_score[rotors + v] += noise * error * error
                    noise_expected[rotors + v] += noise * information
            adjoint[j] -= error
            for i in range(n):
                adjoint_covariance[j, i] -= projected[i]
                adjoint_covariance[i, j] -= projected[i]
            adjoint_covariance[j, j] += information
        if ring.moved[at] == 1:
            if counted:
                _score_levels(ring, at, adjoint, adjoint_covariance, score, expected)
            _back_through_transition(ring, at, adjoint, adjoint_covariance, work)
        k -= 1
    low, high = first, filled - 1
    while low < high:
        _swap(out_time, out_states, out_covariance, out_circumstances, low, high)
        low += 1
        high -= 1
    # A block without events is smoothed again with the next one: nothing is delivered twice.
    f.clock[1] = max(f.clock[1], until)
    f.clock[3] += 1
    _follow(f, rotors, weight, score, expected, noise_score, noise_expected)
    return filled


@compiled
def _swap(
    out_time: IntArray,
    out_states: FloatArray,
    out_covariance: FloatArray,
    out_circumstances: FloatArray,
    a: int,
    b: int,
) -> None:
    """Exchange two estimates: the recursion delivers them backwards."""
    out_time[a], out_time[b] = out_time[b], out_time[a]
    states = out_states[a].copy()
    out_states[a] = out_states[b]
    out_states[b] = states
    covariance = out_covariance[a].copy()
    out_covariance[a] = out_covariance[b]
    out_covariance[b] = covariance
    circumstances = out_circumstances[a].copy()
    out_circumstances[a] = out_circumstances[b]
    out_circumstances[b] = circumstances


@compiled
def _moved(
    value: float, score: float, expected: float, average: float, weight: float
) -> float:
    """A variance after one step of stochastic approximation to its maximum-likelihood value."""
    move = weight * (score - expected) / average
    return value * math.exp(min(max(move, -_LARGEST_MOVE), _LARGEST_MOVE))


@compiled
def _follow(
    f: FilterState,
    rotors: int,
    weight: float,
    score: FloatArray,
    expected: FloatArray,
    noise_score: FloatArray,
    noise_expected: FloatArray,
) -> None:
    """Move turbulence levels, noise variances and slot places towards their likeliest values."""
    speed = max(math.hypot(f.mean[2 * PAIRS - 2], f.mean[2 * PAIRS - 1]), 1.0)
    for r in range(rotors):
        speed = max(speed, f.mean[WIND_STATES + 2 * r])
    highest = _STRONGEST * speed * speed
    for g in range(LEVELS):
        if expected[g] <= 0.0:
            continue
        old = f.level_information[g]
        f.level_information[g] = old + weight * (expected[g] - old) if old > 0.0 else expected[g]
        level = _moved(f.levels[g], score[g], expected[g], f.level_information[g], weight)
        f.levels[g] = min(max(level, 1e-6), highest)
    if f.height[1] == 0.0:
        f.levels[VERTICAL_LEVEL] = f.levels[2]
    for i in range(noise_score.shape[0]):
        if noise_expected[i] <= 0.0:
            continue
        old = f.noise_information[i]
        f.noise_information[i] = (
            old + weight * (noise_expected[i] - old) if old > 0.0 else noise_expected[i]
        )
        average = f.noise_information[i]
        if i < rotors:
            value = _moved(f.edge_variance[i], noise_score[i], noise_expected[i], average, weight)
            f.edge_variance[i] = min(max(value, _EDGE_LIMITS[0]), _EDGE_LIMITS[1])
        else:
            v = i - rotors
            value = _moved(
                f.reading_variance[v], noise_score[i], noise_expected[i], average, weight
            )
            f.reading_variance[v] = min(max(value, _READING_LIMITS[0]), _READING_LIMITS[1])
    for r in range(rotors):
        if f.slots[r] < 2:
            continue
        total = 0.0
        for place in range(f.slots[r]):
            if f.slot_information[r, place] > 0.0:
                move = weight * f.slot_score[r, place] / f.slot_information[r, place]
                f.slot_error[r, place] -= min(max(move, -0.01), 0.01)
            f.slot_score[r, place] = 0.0
            f.slot_information[r, place] *= 1.0 - weight
            total += f.slot_error[r, place]
        for place in range(f.slots[r]):
            f.slot_error[r, place] -= total / f.slots[r]
