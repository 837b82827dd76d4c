"""Pulses to speeds: identities of the means, uneven slots, silence."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wind_sensors.instruments import cup_vane, pulses


@given(st.lists(st.floats(0.01, 10.0), min_size=2, max_size=60))
def test_arithmetic_mean_is_never_below_the_count_mean(intervals: list[float]) -> None:
    """K94 (23) to (27), and (28) exactly with the time-weighted variance."""
    mean = pulses.mean_speed(intervals, 0.2)
    assert mean.arithmetic_mean >= mean.count_mean * (1.0 - 1e-12)
    assert mean.ratio == pytest.approx(1.0 + mean.time_variance / mean.count_mean**2, rel=1e-9)
    speeds = pulses.speeds_of_intervals(intervals, 0.2)
    assert mean.count_mean == pytest.approx(1.0 / float(np.mean(1.0 / speeds)), rel=1e-12)


def test_lognormal_ratio() -> None:
    speeds = np.exp(0.3 * np.random.default_rng(0).standard_normal(1_000_000))
    mean = pulses.mean_speed(1.0 / speeds, 1.0 / (2.0 * math.pi))
    assert mean.ratio == pytest.approx(pulses.lognormal_mean_ratio(0.3), rel=2e-3)


def test_frequency_calibration() -> None:
    calibration = pulses.FrequencyCalibration(0.22, 0.6201, 2.0)
    rate = (8.0 - 0.22) / calibration.calibration_distance
    frequency = 2.0 * rate / (2.0 * math.pi)
    assert float(calibration.speed(frequency)) == pytest.approx(8.0)
    mean = pulses.mean_speed(
        np.full(10, 1.0 / frequency), calibration.calibration_distance, 2.0, 0.22
    )
    assert mean.count_mean == pytest.approx(8.0)


def uneven_edges(fractions: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Edge times of a rotor whose rate rises and falls slowly, and the angles of the edges."""
    turns = np.tile(fractions, count // fractions.size + 1)
    angles = 2.0 * math.pi * np.concatenate([[0.0], np.cumsum(turns)])[:count]
    time = np.linspace(0.0, 400.0, 400_001)
    rate = 40.0 * (1.0 + 0.3 * np.sin(0.1 * time))
    angle = 40.0 * (time + 3.0 * (1.0 - np.cos(0.1 * time)))
    assert angle[-1] > angles[-1]
    assert rate.min() > 0.0
    return np.interp(angles, angle, time), angles


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_slots_are_found_and_whole_turns_do_not_see_them(n: int) -> None:
    fractions = np.ones(n) / n
    if n > 1:
        fractions[0] *= 1.2
        fractions[1] -= 0.2 / n
    edges, angles = uneven_edges(fractions, 2000)
    assert np.allclose(pulses.slot_fractions(edges, n), fractions, rtol=1e-3)
    turns = pulses.revolutions(edges, n)
    assert np.allclose(angles[n:] - angles[:-n], 2.0 * math.pi)
    rate = 2.0 * math.pi / turns.durations
    truth = 40.0 * (1.0 + 0.3 * np.sin(0.1 * turns.times))
    assert np.allclose(rate, truth, rtol=1e-3)
    assert np.array_equal(turns.slots, np.arange(n, 2000) % n)


def test_short_records() -> None:
    assert pulses.revolutions([0.0, 1.0], 3).durations.size == 0
    with pytest.raises(ValueError, match="two whole turns"):
        pulses.slot_fractions([0.0, 1.0, 2.0], 2)


def test_nothing_counted_is_no_number() -> None:
    assert all(math.isnan(value) for value in pulses.mean_speed([], 0.2))
    assert math.isnan(cup_vane.direction_variance([]))
