"""Schrenk's rotor from its torque, and the published coefficients against their constraints."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wind_sensors.instruments import rotor_family, schrenk
from wind_sensors.instruments.published_cups import PUBLISHED_CUPS, fit_constraints


@pytest.mark.parametrize(("driving", "braking"), [(20.0, 6.0), (9.0, 1.0), (30.0, 25.0)])
def test_schrenk_constants_come_from_the_torque(driving: float, braking: float) -> None:
    rotor = schrenk.SchrenkRotor(0.06, driving, braking)
    speed = 7.0
    rate = speed / rotor.calibration_distance
    assert rotor.angular_acceleration(speed, rate) == pytest.approx(0.0, abs=1e-10)
    h = 0.01

    def torque(u: float, s: float) -> float:
        return rotor.angular_acceleration(u, s)

    by_rate = (torque(speed, rate + h) - torque(speed, rate - h)) / (2.0 * h)
    assert -speed / by_rate == pytest.approx(rotor.distance_constant, rel=1e-8)
    curvature = (
        torque(speed + h, rate) - 2.0 * torque(speed, rate) + torque(speed - h, rate)
    ) / h**2
    tau = rotor.distance_constant / speed
    a4 = 0.5 * rotor.calibration_distance * speed * tau * curvature
    assert rotor.a4 == pytest.approx(a4, rel=1e-6)
    assert rotor_family.torque_share(
        rotor.calibration_distance, rotor.second_length
    ) == pytest.approx(rotor.a4, rel=1e-12)
    assert schrenk.drive_coefficient(0.06, 0.002, 1.2, 1.4, 2e-5) == pytest.approx(5.04)


def test_a_consistent_row_fits_without_residual() -> None:
    wyngaard = next(cup for cup in PUBLISHED_CUPS if cup.name == "Wyngaard")
    fit = fit_constraints(wyngaard)
    # K94's text says that the table agrees; the data give -0.19 +- 0.09.
    assert fit.slope_residual.value == pytest.approx(-0.19, abs=0.005)
    assert fit.slope_residual.uncertainty == pytest.approx(0.09, abs=0.005)
    # K94 (18) holds for this cup to the last printed digit.
    assert fit.sum_residual.value == pytest.approx(0.0, abs=1e-12)
    assert fit.sum_residual.uncertainty == pytest.approx(0.123, abs=0.0005)
    assert fit.mu2.value == pytest.approx(1.34)
    best = fit.a4.value
    candidates = best + np.linspace(-0.1, 0.1, 41)
    misfits = [
        ((-0.23 - (a - 1.0)) / 0.023) ** 2
        + ((0.96 - a) / 0.096) ** 2
        + ((-0.73 - (1.0 - 2.0 * a)) / 0.073) ** 2
        for a in candidates
    ]
    assert candidates[int(np.argmin(misfits))] == pytest.approx(best, abs=0.0026)
    assert min(misfits) == pytest.approx(fit.chi_square, rel=1e-6)


def test_normalised_rows_agree_with_a_linear_calibration() -> None:
    """Divided by a1, the rows give a4 - a3 = 1.04 and a4 = 0.90 on average."""
    fits = [fit_constraints(cup, normalise=True) for cup in PUBLISHED_CUPS]
    assert np.mean([fit.torque_residual.value for fit in fits]) == pytest.approx(0.04, abs=0.005)
    assert np.mean([cup.a4 / cup.a1 for cup in PUBLISHED_CUPS]) == pytest.approx(0.90, abs=0.005)
    raw = [fit_constraints(cup) for cup in PUBLISHED_CUPS]
    assert all(fit.torque_residual.value + 1e-9 >= 0.08 for fit in raw)
    assert all(0.5 < fit.a4.value < 1.1 and fit.a4.uncertainty < 0.1 for fit in raw)
    assert all(math.isfinite(fit.chi_square) for fit in raw)
