"""The wind part of the filter's state: totals, covariances, process noise."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.filter_state import FilterState, Ring
from wind_sensors.estimation.turbulence_process import (
    PAIRS,
    SMALL_SCALES,
    TIME_CONSTANTS,
    VARIANCES,
    VERTICAL_CONSTANTS,
    VERTICAL_LEVEL,
    VERTICAL_VARIANCES,
    WANDERING,
    WIND_STATES,
    slow_vertical_variance,
)

FloatArray = npt.NDArray[np.float64]

_PROCESSES = len(TIME_CONSTANTS)
_VERTICAL = len(VERTICAL_CONSTANTS)


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
        if i == _VERTICAL - 1 and f.height[1] == 0.0:
            variance = slow_vertical_variance(f.height[0], size)
        upwards = f.levels[VERTICAL_LEVEL] * variance * (1.0 - d * d)
        ring.noise[slot, PAIRS + i, 0] = upwards
        noise[PAIRS + i, 0] = upwards
