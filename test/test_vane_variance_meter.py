"""A simulated vane in synthetic turbulence as a meter of the lateral variance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wind_sensors.instruments import cup_vane, vane_variance
from wind_sensors.instruments.dynamics.vane import VaneParameters, integrate_vane
from wind_sensors.turbulence import von_karman
from wind_sensors.turbulence.synthesis import TurbulenceSpec, TurbulenceStream

SPEED, LENGTH, RATE = 6.0, 0.5, 100.0


def seen_and_true(integral_length: float, zeta: float, seed: int) -> tuple[float, float]:
    """Variance of the vane's angle [rad^2] and of the lateral wind [m^2/s^2]."""
    sigma = 0.02 * SPEED
    spec = TurbulenceSpec(
        mean_speed=SPEED,
        standard_deviations=(sigma, sigma, sigma),
        integral_lengths=(integral_length,) * 3,
        seed=seed,
    )
    count = 2**18
    wind = TurbulenceStream(spec, RATE).read(count)
    headings, _ = integrate_vane(
        VaneParameters(LENGTH, zeta, 1.0, 1.0, 0.0, 0.0, 0.0),
        wind,
        np.zeros(count),
        np.zeros((count, 2)),
        np.ones(count),
        1.0 / RATE,
        math.nan,
        0.0,
    )
    settled = slice(1000, None)
    # The nose points upwind: the air goes the other way.
    air = headings[settled] + math.pi
    return cup_vane.direction_variance(air), float(np.var(wind[settled, 1]))


def test_a_vane_at_zeta_0_keeps_the_variance() -> None:
    zeta = vane_variance.damping_without_loss()
    assert zeta == pytest.approx(0.3827, abs=1e-4)
    angle, true = seen_and_true(40.0, zeta, seed=11)
    assert SPEED**2 * angle == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize("zeta", [0.2, 0.4, 0.7, 1.0])
def test_the_correction_recovers_the_variance(zeta: float) -> None:
    integral_length = 8.0
    angle, true = seen_and_true(integral_length, zeta, seed=12)
    reduced = von_karman.wavenumber_from_integral_length(integral_length) * LENGTH
    corrected = cup_vane.lateral_variance(angle, SPEED, reduced, zeta)
    assert corrected == pytest.approx(true, rel=0.03)
    if zeta in {0.2, 1.0}:
        # Uncorrected it is off by far more than the tolerance.
        assert abs(SPEED**2 * angle / true - 1.0) > 0.06
