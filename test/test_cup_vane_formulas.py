"""Vector wind run, direction variance, and what a vane leaves of the lateral bias."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wind_sensors.instruments import cup_vane, speed_bias, vane_variance


def test_vector_run_of_a_steady_wind() -> None:
    heading = np.full(60, 2.5)
    run = cup_vane.vector_wind_run(heading, 12.0, 0.2, pulses_per_revolution=3.0)
    expected = 2.0 * math.pi * 0.2 * 20.0 / 12.0
    assert run.speed == pytest.approx(expected)
    assert run.scalar_speed == pytest.approx(expected)
    assert run.heading == pytest.approx(2.5)
    assert run.resultant == pytest.approx(1.0)
    calm = cup_vane.vector_wind_run([], 12.0, 0.2)
    assert (calm.speed, calm.scalar_speed, calm.resultant) == (0.0, 0.0, 0.0)


def test_direction_convention() -> None:
    """Air going east comes from 270 degrees, going south from 0."""
    assert float(cup_vane.direction_from(0.0)) == pytest.approx(270.0)
    assert float(cup_vane.direction_from(-0.5 * math.pi)) == pytest.approx(0.0)
    for direction in (0.0, 33.0, 180.0, 359.0):
        back = cup_vane.direction_from(cup_vane.heading_of(direction))
        assert math.remainder(float(back) - direction, 360.0) == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("sigma", [1e-6, 0.05, 0.3, 0.6])
def test_direction_variance_of_normal_and_uniform_headings(sigma: float) -> None:
    generator = np.random.default_rng(4)
    headings = 3.0 + sigma * generator.standard_normal(400_000)
    found = cup_vane.direction_variance(headings)
    assert found == pytest.approx(cup_vane.variance_85_of_normal(sigma), rel=0.01)
    assert cup_vane.direction_variance_logarithmic(found) == pytest.approx(sigma**2, rel=0.01)
    grid = sigma * (2.0 * (np.arange(20_001) + 0.5) / 20_001 - 1.0)
    assert cup_vane.direction_variance(grid) == pytest.approx(
        cup_vane.variance_85_of_uniform(sigma), rel=1e-6
    )


def test_fourth_order_correction() -> None:
    """Better than (85) by an order in the variance, for a flat distribution as well."""
    for width in (0.1, 0.3, 0.6):
        raw = cup_vane.variance_85_of_uniform(width)
        corrected = cup_vane.direction_variance_fourth_order(raw, kurtosis=1.8)
        exact = width**2 / 3.0
        assert abs(corrected - exact) < 0.05 * abs(raw - exact)
    with pytest.raises(ValueError, match="spread"):
        cup_vane.direction_variance_fourth_order(0.9)


def test_a_vane_without_loss_cancels_the_lateral_bias() -> None:
    lengths, intensities = (0.1, 0.1, 0.1), (0.1, 0.1, 0.1)
    scalar = speed_bias.anisotropic_bias(lengths, intensities, 0.8, 0.0, 0.4)
    vector = cup_vane.vector_run_bias(lengths, 0.01, 0.3827, intensities, 0.8, 0.0, 0.4)
    assert abs(vector.v) < 3e-4 * scalar.v
    assert vector.u == scalar.u
    slow = cup_vane.vector_run_bias(lengths, 1e5, 0.6, intensities, 0.8)
    assert slow.v == pytest.approx(scalar.v, rel=1e-3)


def test_lateral_variance_is_recovered() -> None:
    seen = vane_variance.von_karman_moments(0.2, 0.5).direction * 0.8 / 36.0
    assert cup_vane.lateral_variance(seen, 6.0, 0.2, 0.5) == pytest.approx(0.8)
    assert cup_vane.matched_damping(1.5, 0.25) == pytest.approx(3.0)
