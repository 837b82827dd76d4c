"""Which seconds of a recording count when it is compared with a simulation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.station.signals import Angles, Recording

FloatArray = npt.NDArray[np.float64]

LONGEST_GAP = 1.0
"""Where the reference is silent for longer [s], nothing is compared."""

USUAL_GAPS = 5.0
"""A vane is silent if its readings are so many times as far apart as they usually are."""

BESIDE_GAP = 1.0
"""Nor so close to such a gap [s]."""

FORGETTING = 3.0
"""After it, a simulated instrument forgets the wind that was made up within so many times the time
in which it answers: else it would seem to be slower than it is."""

EDGE = 9
"""Weights rise and fall within so many bins."""


def without_repeats(recording: Recording) -> tuple[Recording, float]:
    """A recording whose sonic says nothing where it repeats the same wind for too long.

    A driver that fills gaps with the last good wind hides them: nothing blows to the last digit
    alike. A tunnel's wind and a simulator's may.

    Args:
        recording: With a reference or without.

    Returns:
        The recording, and the share of the reference's samples that were taken out of it.
    """
    reference, entry = recording.reference, recording.station.reference
    if reference is None or entry is None or entry.kind != "sonic" or reference.time.size < 2:
        return recording, 0.0
    changed = np.any(np.diff(reference.velocity, axis=0) != 0.0, axis=1)
    number = np.concatenate(([0], np.cumsum(changed)))
    first, count = np.unique(number, return_index=True, return_counts=True)[1:]
    lasting = (reference.time[first + count - 1] - reference.time[first]) * 1e-9 > LONGEST_GAP
    repeated = lasting[number]
    repeated[first] = False
    if not repeated.any():
        return recording, 0.0
    velocity = np.where(repeated[:, None], np.nan, reference.velocity)
    silent = replace(reference, velocity=velocity)
    return replace(recording, reference=silent), float(np.mean(repeated))


def where_reference_is(recording: Recording, grid: Grid, answering: FloatArray) -> FloatArray:
    """Weights that are zero where the reference has a gap, shape (n,).

    Args:
        recording: With a reference or without.
        grid: Bins.
        answering: Time in which the slowest instrument answers, at the bins [s], shape (n,).
    """
    weight = np.ones(grid.n)
    reference = recording.reference
    if reference is None:
        return weight
    time = grid.seconds(reference.time[np.isfinite(reference.velocity).all(axis=1)])
    for k in np.flatnonzero(np.diff(time) > LONGEST_GAP):
        forgetting = FORGETTING * float(np.interp(time[k + 1], grid.centres, answering))
        begin, end = time[k] - BESIDE_GAP, time[k + 1] + max(BESIDE_GAP, forgetting)
        weight[(grid.centres > begin) & (grid.centres < end)] = 0.0
    return soft(weight)


def silent_spans(readings: Angles, grid: Grid) -> list[tuple[float, float]]:
    """When a vane says nothing for longer than `LONGEST_GAP` and than is usual for it [s].

    Args:
        readings: Of the vane; those that are no number say nothing.
        grid: Bins; before the first and after the last reading it says nothing either.
    """
    time = grid.seconds(readings.time[np.isfinite(readings.angle)])
    at = np.concatenate(([0.0], np.clip(time, 0.0, grid.n * grid.dt), [grid.n * grid.dt]))
    between = np.diff(at)
    longest = max(LONGEST_GAP, USUAL_GAPS * float(np.median(between)))
    return [(float(at[k]), float(at[k + 1])) for k in np.flatnonzero(between > longest)]


def where_vanes_tell(spans: Iterable[tuple[float, float]], grid: Grid) -> FloatArray:
    """Weights that are zero where a vane says nothing, shape (n,).

    What is taken to have been read between two readings is a line, on which a vane would hardly
    move.

    Args:
        spans: When [s], of all vanes.
        grid: Bins.
    """
    weight = np.ones(grid.n)
    for begin, end in spans:
        weight[(grid.centres > begin) & (grid.centres < end)] = 0.0
    return soft(weight)


def soft(weight: FloatArray) -> FloatArray:
    """Weights of nought and one with soft edges, nought where they were."""
    return np.clip(2.0 * uniform_filter1d(weight, EDGE, mode="mirror") - 1.0, 0.0, 1.0)
