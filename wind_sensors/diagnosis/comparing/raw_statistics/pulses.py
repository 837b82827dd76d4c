"""Intervals of pulses: lost and doubled edges, uneven slots, beats with the wind."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.station.model import Cup, Propeller
from wind_sensors.station.signals import Pulses

FloatArray = npt.NDArray[np.float64]

INTERVALS = 6
"""Number of statistics of the pulse intervals."""

SLOW_TURN = 2.5
"""A rotor that takes so many times longer for its turns than the wind asks for is about to stop:
its intervals tell of the wind that it stops in."""


def interval_statistics(
    pulses: Pulses,
    rotor: Cup | Propeller,
    direction: FloatArray,
    speed: FloatArray,
    grid: Grid,
    mask: FloatArray | None = None,
) -> FloatArray:
    """How the pulse intervals are distributed within a revolution, whatever the wind.

    Args:
        pulses: Edges.
        rotor: The rotor.
        direction: Direction of the wind in the plane of rotation at the bins' centres [rad].
        speed: Slow wind speed at the bins [m/s]; what turns far slower does not count.
        grid: Bins of both.
        mask: Weight of the bins; intervals where it is below a half do not count.

    Returns:
        Share of intervals over 1.6 and under 0.4 times their neighbourhood's mean; of the slots'
        mean relative intervals the scatter without, and the amplitude of, the part that swings
        once per revolution; of what departs from those means the amplitudes once and twice per
        revolution locked to the wind's direction (0 where the pulses are too few to tell).
    """
    weight = np.ones(grid.n) if mask is None else mask
    usual = 2.0 * np.pi * rotor.calibration_distance / np.maximum(speed, 0.1)
    longest = SLOW_TURN * usual / rotor.pulses_per_revolution
    return _interval_statistics(
        grid.seconds(pulses.time), rotor.pulses_per_revolution, direction, longest, weight, grid.dt
    )


@compiled
def _interval_statistics(
    time: FloatArray,
    slots: int,
    direction: FloatArray,
    longest: FloatArray,
    weight: FloatArray,
    dt: float,
) -> FloatArray:
    out = np.zeros(INTERVALS)
    edges = time.size
    if edges < 200:
        return out
    window = max(5, 2 * (slots // 2) + 1) if slots > 1 else 5
    half = window // 2
    long = 0
    short = 0
    counted = 0
    bins_per_second = 1.0 / dt
    last_bin = weight.size - 1
    for i in range(window, edges - 1 - window):
        place = min(max(int(time[i] * bins_per_second), 0), last_bin)
        if weight[place] <= 0.5:
            continue
        around = time[i + half + 1] - time[i - half]
        if around > longest[place] * window:
            continue
        interval = (time[i + 1] - time[i]) * window
        counted += 1
        if interval > 1.6 * around:
            long += 1
        elif interval < 0.4 * around:
            short += 1
    if counted < 100:
        return out
    out[0] = long / counted
    out[1] = short / counted
    if slots < 3:
        return out
    # By slot: number, deviation, and both times the wind's direction once and twice per turn.
    number = np.zeros((slots, 5))
    total = np.zeros((slots, 5))
    squares = 0.0
    wind = np.empty((weight.size, 4))
    wind[:, 0], wind[:, 1] = np.cos(direction), np.sin(direction)
    wind[:, 2], wind[:, 3] = np.cos(2.0 * direction), np.sin(2.0 * direction)
    first = slots // 2
    slot = first - 1
    kept = 0
    for j in range(edges - slots):
        i = j + first
        slot = 0 if slot + 1 == slots else slot + 1
        place = min(max(int(time[i] * bins_per_second), 0), last_bin)
        if weight[place] <= 0.5:
            continue
        revolution = max(time[j + slots] - time[j], 1e-9)
        if revolution > longest[place] * slots:
            continue
        deviation = (time[i + 1] - time[i]) * slots / revolution - 1.0
        deviation = min(max(deviation, -0.8), 0.8)
        squares += deviation * deviation
        kept += 1
        number[slot, 0] += 1.0
        total[slot, 0] += deviation
        for m in range(4):
            number[slot, m + 1] += wind[place, m]
            total[slot, m + 1] += deviation * wind[place, m]
    if kept < 100:
        return out
    means = total[:, 0] / np.maximum(number[:, 0], 1.0)
    angle = 2.0 * math.pi / slots * np.arange(slots)
    slot_cos, slot_sin = np.cos(angle), np.sin(angle)
    error = max(squares / kept - np.mean(means**2), 0.0) / kept
    once = (2.0 * np.sum(means * slot_cos) / slots) ** 2
    once += (2.0 * np.sum(means * slot_sin) / slots) ** 2
    once = max(once - 4.0 * error, 0.0)
    out[2] = math.sqrt(max(np.var(means) - 0.5 * once - error * slots, 0.0))
    out[3] = math.sqrt(once)
    for m in range(2 if slots > 4 else 1):
        if m == 1:
            slot_cos, slot_sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
        # What is fixed to the disc says nothing about the wind's direction.
        away = total[:, 2 * m + 1] - means * number[:, 2 * m + 1]
        across = total[:, 2 * m + 2] - means * number[:, 2 * m + 2]
        along = np.sum(slot_cos * away + slot_sin * across)
        aside = np.sum(slot_sin * away - slot_cos * across)
        out[4 + m] = 2.0 * math.hypot(along, aside) / kept
    return out
