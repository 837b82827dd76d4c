"""Mitsuta's reduction: exact on parabolas, and its gain the one it shows on sine waves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.instruments import bivane, vane

RUN, SPEED, ZETA = 15.0, 5.3, 0.15


def test_reduction_is_the_vane_equation_on_a_parabola() -> None:
    time = np.arange(12) * 0.5
    angle = 0.03 + 0.02 * time - 0.004 * time**2
    reduced = bivane.reduce_samples(angle, SPEED, 0.5, RUN, ZETA)
    exact = bivane.vertical_velocity(angle, 0.02 - 0.008 * time, -0.008, SPEED, RUN, ZETA)
    assert np.allclose(reduced[1:-1], exact[1:-1], rtol=1e-12)
    assert np.isnan(reduced[0]) and np.isnan(reduced[-1])
    omega = vane.natural_frequency(SPEED, bivane.distance_constant(RUN))
    assert 2.0 * math.pi / omega == pytest.approx(bivane.free_period(RUN, SPEED))


def test_calm_samples_are_masked() -> None:
    angle = np.zeros(5) + 0.1
    speed = np.array([5.0, 5.0, 0.0, 5.0, 5.0])
    reduced = bivane.reduce_samples(angle, speed, 0.5, RUN, ZETA)
    assert np.isnan(reduced[2])
    assert reduced[1] == pytest.approx(0.5)


@pytest.mark.parametrize("frequency", [0.3, 1.0, 1.8])
def test_gain_of_reduction_and_bivane_on_a_sine_wave(frequency: float) -> None:
    """Integrate the bivane in a vertical sine wind, sample, reduce, compare amplitudes."""
    omega0 = 2.0 * math.pi * SPEED / RUN
    omega = frequency * omega0

    def motion(t: float, state: np.ndarray) -> list[float]:
        drive = omega0**2 * (0.1 * math.sin(omega * t) - state[0])
        return [state[1], drive - 2.0 * ZETA * omega0 * state[1]]

    interval = 0.25
    times = 80.0 + interval * np.arange(400)
    solution = integrate.solve_ivp(
        motion, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-11
    )
    reduced = bivane.reduce_samples(solution.y[0], SPEED, interval, RUN, ZETA)[1:-1]
    waves = np.stack([np.sin(omega * times), np.cos(omega * times)])[:, 1:-1]
    fit = np.linalg.lstsq(waves.T, reduced, rcond=None)[0]
    sampling = bivane.reduced_sampling(RUN, SPEED, interval)
    expected = 0.1 * SPEED * float(bivane.overall_gain(frequency, sampling, ZETA))
    assert math.hypot(*fit) == pytest.approx(expected, rel=1e-3)


def test_sampling_is_judged() -> None:
    """Mitsuta's own interval fails, 18 samples per free period serve."""
    own = bivane.judge_sampling(RUN, SPEED, 0.5, ZETA)
    assert not own.good
    assert own.gain_at_resonance == pytest.approx(0.871, abs=1e-3)
    assert own.samples_per_period == pytest.approx(5.66, abs=0.01)
    fine = bivane.judge_sampling(RUN, SPEED, bivane.free_period(RUN, SPEED) / 18.5, ZETA)
    assert fine.good
    assert bivane.damped_period(RUN, SPEED, ZETA) / bivane.free_period(RUN, SPEED) == (
        pytest.approx(1.0114, abs=1e-4)
    )


@pytest.mark.parametrize("half_width", [1, 3, 6])
def test_wider_differences_are_exact_for_their_polynomials(half_width: int) -> None:
    first, second = bivane.difference_weights(half_width)
    k = np.arange(1, half_width + 1)
    for degree in range(1, 2 * half_width + 1):
        slope = float(np.sum(first * (k.astype(float) ** degree - (-k.astype(float)) ** degree)))
        bend = float(np.sum(second * (k.astype(float) ** degree + (-k.astype(float)) ** degree)))
        assert slope == pytest.approx(1.0 if degree == 1 else 0.0, abs=1e-8)
        assert bend == pytest.approx(2.0 if degree == 2 else 0.0, abs=1e-8)
    with pytest.raises(ValueError, match="one sample"):
        bivane.difference_weights(0)


def test_wider_differences_reach_closer_to_the_nyquist_frequency() -> None:
    sampling = bivane.reduced_sampling(RUN, SPEED, 0.5)
    width = bivane.half_width_for(0.8, sampling, ZETA, 0.048)
    assert 2 <= width <= 16
    frequency = np.linspace(0.0, 0.8, 100) * math.pi / sampling
    worst = np.max(np.abs(bivane.overall_gain(frequency, sampling, ZETA, width) - 1.0))
    plain = np.max(np.abs(bivane.overall_gain(frequency, sampling, ZETA) - 1.0))
    assert worst < 0.05
    assert plain > 0.3


@pytest.mark.parametrize("count", [0, 3, 4])
def test_a_record_shorter_than_its_differences_gives_nothing(count: int) -> None:
    reduced = bivane.reduce_samples(np.zeros(count), SPEED, 0.1, RUN, ZETA, half_width=2)
    assert reduced.shape == (count,)
    assert np.isnan(reduced).all()
