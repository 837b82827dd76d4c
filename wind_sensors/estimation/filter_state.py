"""Memory of the Kalman estimator: arrays of constant size, changed in place by the kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.forward import CIRCUMSTANCES
from wind_sensors.estimation.turbulence_process import (
    LEVELS,
    PAIRS,
    VERTICAL_CONSTANTS,
    WIND_STATES,
)

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

OUTPUT, READING, EDGE, TURNS = 0, 1, 2, 3
"""Kinds of events. The order decides between events of the same nanosecond."""

LARGEST_SLOTS = 64


class FilterState(NamedTuple):
    """Everything the filter knows.

    Attributes:
        mean: States: pairs (east, north) of each time constant and of the wandering mean, vertical
            processes, then y, psi of each rotor and phi, rate of each vane; shape (n,).
        covariance: Shape (n, n).
        clock: Time of the state [ns]; time up to which estimates have been delivered [ns]; steps
            in the ring since the start; blocks since the start.
        circumstances: At the time of the state, shape (23,).
        levels: Turbulence levels, shape (5,), see `turbulence_process`.
        level_information: Running expected scores of the levels.
        edge_variance: Variance of an edge's place [slots^2], one per rotor.
        reading_variance: Of a vane's reading [rad^2], one per vane.
        noise_information: Running expected scores of those variances (rotors, then vanes).
        slots: Edges per revolution of each rotor.
        stride: Every stride-th edge is used, one per rotor.
        slot_error: Place of each edge against an even division [slots], shape (rotors, 64).
        slot_score, slot_information: Running scores of `slot_error`.
        last_edge: Time of the last accepted edge of each rotor [ns].
        last_used: Time of the last edge that corrected the filter [ns].
        slot_interval: Time per slot before that edge, lost edges counted [s]; 0 before the first.
        edge_count: Edges since the start, lost ones included.
        last_angle: Angle last told by each rotor with a counter or encoder [rad].
        largest_step: Largest step of that angle from message to message [slots].
        rejected: Consecutive rejections of each rotor.
        tally: By rotor: accepted, lost, extra, wind found again; shape (rotors, 4).
        innovation: Running sum of squared normalised innovations and their number (rotors, then
            vanes), shape (rotors + vanes, 2).
        height: Above the ground [m]; 1 where the station measures the vertical wind, shape (2,).
        outliers: Readings and edges far outside their expected scatter (rotors, then vanes).
    """

    mean: FloatArray
    covariance: FloatArray
    clock: IntArray
    circumstances: FloatArray
    levels: FloatArray
    level_information: FloatArray
    edge_variance: FloatArray
    reading_variance: FloatArray
    noise_information: FloatArray
    slots: IntArray
    stride: IntArray
    slot_error: FloatArray
    slot_score: FloatArray
    slot_information: FloatArray
    last_edge: IntArray
    last_used: IntArray
    slot_interval: FloatArray
    edge_count: IntArray
    last_angle: FloatArray
    largest_step: FloatArray
    rejected: IntArray
    tally: IntArray
    innovation: FloatArray
    outliers: IntArray
    height: FloatArray


class Ring(NamedTuple):
    """The last steps of the filter, for the smoother; index modulo the capacity.

    Attributes:
        time: [ns], shape (c,).
        kind: Kind of event, shape (c,).
        which: Rotor or vane of the event.
        slot: Slot of an edge, -1 otherwise.
        measured: Index of the measured state, -1 without a measurement.
        innovation, variance: nu and S of the measurement.
        gain: K, shape (c, n).
        moved: 1 where time passed in the step.
        decay: exp(-dt/tau) of the wind states, shape (c, w).
        transition: Rows of F of the instruments' states, shape (c, i, n).
        noise_gain: Derivative of the instruments' states by the new wind, shape (c, i, 3).
        noise: Variance added to each pair along and across, then to the vertical processes (first
            column), shape (c, pairs + vertical, 2).
        heading: Unit vector of the mean wind, shape (c, 2).
        circumstances: Shape (c, 23).
        mean, covariance: After the step, at output instants, shape (c, n) and (c, n, n).
    """

    time: IntArray
    kind: IntArray
    which: IntArray
    slot: IntArray
    measured: IntArray
    innovation: FloatArray
    variance: FloatArray
    gain: FloatArray
    moved: IntArray
    decay: FloatArray
    transition: FloatArray
    noise_gain: FloatArray
    noise: FloatArray
    heading: FloatArray
    circumstances: FloatArray
    mean: FloatArray
    covariance: FloatArray


def empty_filter(rotors: int, vanes: int) -> FilterState:
    """A filter that knows nothing."""
    n = WIND_STATES + 2 * (rotors + vanes)
    return FilterState(
        mean=np.zeros(n),
        covariance=np.zeros((n, n)),
        clock=np.zeros(4, dtype=np.int64),
        circumstances=np.zeros(CIRCUMSTANCES),
        levels=np.ones(LEVELS),
        level_information=np.zeros(LEVELS),
        edge_variance=np.full(rotors, 0.02**2),
        reading_variance=np.full(vanes, np.radians(0.3) ** 2),
        noise_information=np.zeros(rotors + vanes),
        slots=np.ones(rotors, dtype=np.int64),
        stride=np.ones(rotors, dtype=np.int64),
        slot_error=np.zeros((rotors, LARGEST_SLOTS)),
        slot_score=np.zeros((rotors, LARGEST_SLOTS)),
        slot_information=np.zeros((rotors, LARGEST_SLOTS)),
        last_edge=np.zeros(rotors, dtype=np.int64),
        last_used=np.zeros(rotors, dtype=np.int64),
        slot_interval=np.zeros(rotors),
        edge_count=np.zeros(rotors, dtype=np.int64),
        last_angle=np.zeros(rotors),
        largest_step=np.zeros(rotors),
        rejected=np.zeros(rotors, dtype=np.int64),
        tally=np.zeros((rotors, 4), dtype=np.int64),
        innovation=np.zeros((rotors + vanes, 2)),
        outliers=np.zeros(rotors + vanes, dtype=np.int64),
        height=np.array([10.0, 0.0]),
    )


def empty_ring(capacity: int, rotors: int, vanes: int) -> Ring:
    """Room for `capacity` steps."""
    instruments = 2 * (rotors + vanes)
    n = WIND_STATES + instruments
    return Ring(
        time=np.zeros(capacity, dtype=np.int64),
        kind=np.zeros(capacity, dtype=np.int64),
        which=np.zeros(capacity, dtype=np.int64),
        slot=np.zeros(capacity, dtype=np.int64),
        measured=np.zeros(capacity, dtype=np.int64),
        innovation=np.zeros(capacity),
        variance=np.zeros(capacity),
        gain=np.zeros((capacity, n)),
        moved=np.zeros(capacity, dtype=np.int64),
        decay=np.zeros((capacity, WIND_STATES)),
        transition=np.zeros((capacity, instruments, n)),
        noise_gain=np.zeros((capacity, instruments, 3)),
        noise=np.zeros((capacity, PAIRS + len(VERTICAL_CONSTANTS), 2)),
        heading=np.zeros((capacity, 2)),
        circumstances=np.zeros((capacity, CIRCUMSTANCES)),
        mean=np.zeros((capacity, n)),
        covariance=np.zeros((capacity, n, n)),
    )


def larger_ring(ring: Ring, steps: int, capacity: int) -> Ring:
    """A ring of at least `capacity` with the last steps of another.

    Args:
        ring: The old one.
        steps: Steps made since the start.
        capacity: Wanted size; rounded up to a power of two.
    """
    size = 1 << (capacity - 1).bit_length()
    old = ring.time.size
    kept = np.arange(max(0, steps - old), steps)
    arrays = []
    for array in ring:
        new = np.zeros((size, *array.shape[1:]), dtype=array.dtype)
        new[kept % size] = array[kept % old]
        arrays.append(new)
    return Ring(*arrays)
