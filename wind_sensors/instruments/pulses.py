"""From pulse times to wind speed; K94 (21) to (28), K14 (107), (108).

A rotor's rate varies within a revolution and the slots of its wheel are never quite even, so one
full turn is the averaging unit: with n pulses per turn, every edge is compared with the edge n
before it, slot by slot.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class FrequencyCalibration(NamedTuple):
    """U = starting_speed + distance_per_pulse f_p.

    starting_speed: A0 = U0 [m/s]; distance_per_pulse: B0 [m]; pulses_per_revolution: n.
    """

    starting_speed: float
    distance_per_pulse: float
    pulses_per_revolution: float

    @property
    def calibration_distance(self) -> float:
        """l = n B0/(2 pi) [m/rad]; K14 (107), (108)."""
        return self.pulses_per_revolution * self.distance_per_pulse / (2.0 * math.pi)

    def speed(self, pulse_frequency: npt.ArrayLike) -> FloatArray:
        """U [m/s] from f_p [Hz], as calibrated (a stopped rotor reads U0)."""
        frequency = np.asarray(pulse_frequency, dtype=np.float64)
        return self.starting_speed + self.distance_per_pulse * frequency


class MeanSpeed(NamedTuple):
    """Mean speeds over whole revolutions.

    Attributes:
        count_mean: Wind run over time = harmonic mean of the revolutions = time mean [m/s].
        arithmetic_mean: Mean over revolutions [m/s], never below the count mean; K94 (22), (27).
        time_variance: Variance of the speed weighted by time [m^2/s^2].
    """

    count_mean: float
    arithmetic_mean: float
    time_variance: float

    @property
    def ratio(self) -> float:
        """Arithmetic over count mean [1]; without offset 1 + sigma_t^2/U^2; K94 (24), (28)."""
        return self.arithmetic_mean / self.count_mean


def speeds_of_intervals(
    intervals: npt.ArrayLike, calibration_distance: float, turns: float = 1.0
) -> FloatArray:
    """U_i = 2 pi l turns/dt_i [m/s].

    Args:
        intervals: Durations dt_i [s].
        calibration_distance: l [m/rad].
        turns: Revolutions per interval: 1, or 1/n for single pulses.
    """
    dt = np.asarray(intervals, dtype=np.float64)
    return 2.0 * math.pi * calibration_distance * turns / dt


def mean_speed(
    intervals: npt.ArrayLike,
    calibration_distance: float,
    pulses_per_revolution: float = 1.0,
    starting_speed: float = 0.0,
) -> MeanSpeed:
    """Count mean, arithmetic mean and time-weighted variance; K94 (21), (22), (28).

    Args:
        intervals: Durations between successive pulses dt_i [s], shape (N,).
        calibration_distance: l [m/rad].
        pulses_per_revolution: n; intervals are of 1/n turn.
        starting_speed: U0 [m/s], added to both means.

    Returns:
        The means and the variance; NaN without intervals.
    """
    dt = np.asarray(intervals, dtype=np.float64)
    if dt.size == 0:
        return MeanSpeed(math.nan, math.nan, math.nan)
    speeds = speeds_of_intervals(dt, calibration_distance, 1.0 / pulses_per_revolution)
    total = float(np.sum(dt))
    count = 2.0 * math.pi * calibration_distance * dt.size / (pulses_per_revolution * total)
    variance = float(np.sum(dt * (speeds - count) ** 2)) / total
    return MeanSpeed(starting_speed + count, starting_speed + float(np.mean(speeds)), variance)


def lognormal_mean_ratio(standard_deviation: float) -> float:
    """Arithmetic over count mean [1] when ln U_i is normal with this deviation; K94 (28)."""
    return math.exp(standard_deviation**2)


class Revolutions(NamedTuple):
    """Whole turns seen slot by slot.

    Attributes:
        times: Middle of each turn [s], shape (m,).
        durations: Time of one whole turn [s], shape (m,).
        slots: Slot index of the edges that bound the turn, shape (m,).
    """

    times: FloatArray
    durations: FloatArray
    slots: npt.NDArray[np.int64]


def revolutions(
    edges: npt.ArrayLike, pulses_per_revolution: int, first_slot: int = 0
) -> Revolutions:
    """Every edge against the edge one whole turn before it: uneven slots drop out exactly.

    Args:
        edges: Edge times [s], increasing, shape (N,).
        pulses_per_revolution: n.
        first_slot: Slot index of the first edge.
    """
    t = np.asarray(edges, dtype=np.float64)
    n = pulses_per_revolution
    if t.size <= n:
        empty = np.zeros(0)
        return Revolutions(empty, empty, np.zeros(0, dtype=np.int64))
    slots = (first_slot + np.arange(n, t.size)) % n
    return Revolutions(0.5 * (t[n:] + t[:-n]), t[n:] - t[:-n], slots.astype(np.int64))


def slot_fractions(edges: npt.ArrayLike, pulses_per_revolution: int) -> FloatArray:
    """Share of a turn of each slot [1], shape (n,), summing to one.

    Each interval is divided by the duration of the turns around it, so that changes of the wind
    cancel to second order. Slot i lies between edges i and i + 1 (modulo n), counted from the
    first edge.

    Args:
        edges: Edge times [s], shape (N,), N > 2 n.
        pulses_per_revolution: n.

    Raises:
        ValueError: If there are fewer than two turns.
    """
    t = np.asarray(edges, dtype=np.float64)
    n = pulses_per_revolution
    if t.size <= 2 * n:
        raise ValueError("at least two whole turns are needed to find the slots")
    first = np.arange(n // 2, t.size - 1 - n)
    # The turn centred on the interval: from edge i - n//2, n edges on.
    turn = t[first - n // 2 + n] - t[first - n // 2]
    if n % 2 == 0:
        after = t[first - n // 2 + n + 1] - t[first - n // 2 + 1]
        turn = 0.5 * (turn + after)
    share = (t[first + 1] - t[first]) / turn
    fractions = np.array([np.median(share[first % n == slot]) for slot in range(n)])
    return np.asarray(fractions / np.sum(fractions), dtype=np.float64)
