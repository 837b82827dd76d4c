"""What a turning rotor does not follow of the wind along, from the states of the Kalman method.

The mean of the rotor's equation, (A - y)(a4 A + (1 - a4) y), vanishes in a stationary wind. To
second order the mean rate is then too high by a4 (<A'^2> - <y' A'>)/<A> (Kristensen et al. (2014),
(75)). Both moments are those of the smoothed state: its own scatter over a window, its covariance
at each instant, and the variance faster than any process of the state, which no rotor follows. The
scatter is measured; only what the smoother does not resolve is left to the levels of the turbulence
process.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.estimation.forward import MOUNT_YAW_RATE, ON_VANE, Instruments, forcing_of

FloatArray = npt.NDArray[np.float64]

_AT_REST = 0.02
"""Slower rotors stand still: friction holds them, and they have no rate that could be too high
[m/s]."""


@compiled
def unfollowed_of(
    s: Instruments,
    states: FloatArray,
    covariance: FloatArray,
    circumstances: FloatArray,
    unresolved: float,
    out: FloatArray,
) -> None:
    """Forcing and lag of the first rotor at each instant, as `core.Estimates.unfollowed` has them.

    Args:
        s: The station.
        states: Wind (ENU), then y, psi of each rotor and phi, rate of each vane; shape (n, m).
        covariance: Of those, shape (n, m, m).
        circumstances: Shape (n, 23).
        unresolved: Variance of each component faster than any process of the state [m^2/s^2].
        out: Filled, shape (n, 3).
    """
    moved = np.empty(3)
    for k in range(states.shape[0]):
        y = states[k, 3]
        if y <= _AT_REST:
            out[k] = np.nan
            continue
        c = circumstances[k]
        phi, turn = 0.0, 0.0
        if int(s.mounting[0, 0]) == ON_VANE:
            j = 3 + 2 * (s.rotor.shape[0] + int(s.mounting[0, 1]))
            phi, turn = states[k, j], states[k, j + 1] + c[MOUNT_YAW_RATE]
        p = covariance[k]
        size = max(math.hypot(states[k, 0] - c[0], states[k, 1] - c[1]), 0.5)
        e = (states[k, 0] - c[0]) / size
        n = (states[k, 1] - c[1]) / size
        along = e * e * p[0, 0] + 2.0 * e * n * p[0, 1] + n * n * p[1, 1]
        delta = min(math.sqrt(max(along + unresolved, 1e-8)), 0.5 * size)
        moved[:] = states[k, :3]
        forcing, _, _ = forcing_of(s, 0, moved, c, phi, turn)
        moved[0] += delta * e
        moved[1] += delta * n
        ahead, _, _ = forcing_of(s, 0, moved, c, phi, turn)
        moved[0] -= 2.0 * delta * e
        moved[1] -= 2.0 * delta * n
        behind, _, _ = forcing_of(s, 0, moved, c, phi, turn)
        rise = (ahead - behind) / (2.0 * delta)
        out[k, 0] = forcing
        out[k, 1] = forcing - y
        out[k, 2] = rise * rise * (along + unresolved) - rise * (e * p[0, 3] + n * p[1, 3])
