"""Which seconds of a recording count when it is compared with a simulation."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

LONGEST_GAP = 1.0
"""Where the reference is silent for longer [s], nothing is compared."""

BESIDE_GAP = 1.0
"""Nor so close to such a gap [s]."""

EDGE = 9
"""Weights rise and fall within so many bins."""


def where_reference_is(recording: Recording, grid: Grid) -> FloatArray:
    """Weights that are zero where the reference has a gap, shape (n,)."""
    weight = np.ones(grid.n)
    reference = recording.reference
    if reference is None:
        return weight
    time = grid.seconds(reference.time[np.isfinite(reference.velocity).all(axis=1)])
    for k in np.flatnonzero(np.diff(time) > LONGEST_GAP):
        begin, end = time[k] - BESIDE_GAP, time[k + 1] + BESIDE_GAP
        weight[(grid.centres > begin) & (grid.centres < end)] = 0.0
    return soft(weight)


def soft(weight: FloatArray) -> FloatArray:
    """Weights of nought and one with soft edges, nought where they were."""
    return np.clip(2.0 * uniform_filter1d(weight, EDGE, mode="mirror") - 1.0, 0.0, 1.0)
