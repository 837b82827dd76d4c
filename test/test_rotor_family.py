"""The rotor family's closed forms against its integrated equation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.instruments import cup, rotor_family
from wind_sensors.instruments.periodic import periodic_rate
from wind_sensors.station.signals import FloatArray


def integrated(a4: float, initial: float, wind_run: float) -> float:
    solution = integrate.solve_ivp(
        lambda x, y: (1.0 - y) * (a4 + (1.0 - a4) * y),
        (0.0, wind_run),
        [initial],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    return float(solution.y[0, -1])


@pytest.mark.parametrize("a4", [0.0, 0.3, 1.0 / 1.3, 1.0, 1.09])
@pytest.mark.parametrize("initial", [0.05, 0.9999999, 1.0, 2.5])
def test_response_to_constant_wind(a4: float, initial: float) -> None:
    for wind_run in (0.1, 1.3, 6.0):
        closed = float(rotor_family.response_to_constant_wind(wind_run, initial, a4))
        assert closed == pytest.approx(integrated(a4, initial, wind_run), rel=1e-10)


def test_runaway_is_not_a_number_and_calm_propeller_never_starts() -> None:
    assert math.isnan(float(rotor_family.response_to_constant_wind(3.0, -0.5, 0.0)))
    assert float(rotor_family.response_to_constant_wind(3.0, 0.0, 0.0)) == 0.0
    assert math.isinf(rotor_family.wind_run_to_fraction(0.5, 0.0, 0.0))


@pytest.mark.parametrize("a4", [0.4, 0.77, 1.0])
def test_wind_run_inverts_the_response(a4: float) -> None:
    wind_run = rotor_family.wind_run_to_fraction(0.8, 0.2, a4)
    assert float(rotor_family.response_to_constant_wind(wind_run, 0.2, a4)) == pytest.approx(0.8)


@pytest.mark.parametrize("a4", [0.0, 0.2, 0.5, 0.51, 0.8, 1.0])
@pytest.mark.parametrize("lift", [-0.1, 0.0, 1e-9, 0.3])
def test_steady_rate_is_the_stable_root(a4: float, lift: float) -> None:
    y = float(rotor_family.steady_rate(1.4, lift, a4))
    torque = (1.4 - y) * (a4 * 1.4 + (1.0 - a4) * y) + lift
    slope = -(a4 * 1.4 + (1.0 - a4) * y) + (1.0 - a4) * (1.4 - y)
    assert torque == pytest.approx(0.0, abs=1e-12)
    assert slope < 0.0


def test_constraints_hold_identically_and_lengths_round_trip() -> None:
    for a4 in (0.0, 0.3, 0.77, 1.0, 1.1):
        c = rotor_family.second_order_coefficients(a4, 0.07, 0.6)
        assert np.allclose(rotor_family.constraint_residuals(c), 0.0, atol=1e-15)
    assert rotor_family.torque_share(0.2, 0.2 * rotor_family.second_length_ratio(0.7)) == (
        pytest.approx(0.7)
    )
    assert rotor_family.torque_share(0.2, math.inf) == 0.0
    assert math.isinf(rotor_family.second_length_ratio(0.0))
    assert rotor_family.blade_element_torque_share(0.1, 0.2) == pytest.approx(0.8)


def test_second_order_expansion_describes_the_torque() -> None:
    """K94 (16) from K94 (2): the remainder after the quadratic form is of third order."""
    rotor = cup.CupConstants(0.2, 1.7, 0.06, 0.05, 0.8)
    c = rotor_family.second_order_coefficients(rotor.a4, rotor.mu1, rotor.mu2)
    mean, rate = 7.0, 7.0 / 0.2
    generator = np.random.default_rng(0)
    remainders = []
    for size in (1e-2, 1e-3):
        sigma, u, v, w = size * generator.standard_normal(4)
        h = math.hypot(mean * (1.0 + u), mean * v)
        exact = (
            float(cup.angular_acceleration(rate * (1.0 + sigma), h, mean * w, rotor))
            * rotor.distance_constant
            / (mean * rate)
        )
        series = (
            -sigma + c.a1 * u + c.a2 * w + c.a3 * sigma**2 + c.a4 * u**2 + c.a_vv * v**2
            + c.a5 * w**2 + c.a6 * sigma * u + c.a7 * u * w + c.a8 * w * sigma
        )
        remainders.append(abs(exact - series) / size**3)
        assert abs(exact - series) < 20.0 * size**3
    assert remainders[1] > 0.0


@pytest.mark.parametrize("a4", [0.0, 0.3, 0.77, 1.0])
def test_overspeeding_is_what_the_rotor_does_not_follow(a4: float) -> None:
    """K14 (75) against the mean of the integrated equation in a small sinusoidal gust."""
    amplitude, k = 0.05, 0.8
    y = periodic_by_integration(a4, amplitude, k, 0.0)
    gust = amplitude * np.sin(np.linspace(0.0, 2.0 * math.pi, 401)[:-1])
    variance, covariance = float(np.mean(gust**2)), float(np.mean(y * gust))
    bias = rotor_family.longitudinal_bias(a4, variance, covariance, 1.0)
    assert bias == pytest.approx(float(np.mean(y)) - 1.0, abs=amplitude**4)
    assert rotor_family.longitudinal_bias(a4, 36.0 * variance, 36.0 * covariance, 6.0) == (
        pytest.approx(bias)
    )


def periodic_by_integration(a4: float, amplitude: float, k: float, lift: float) -> FloatArray:
    def slope(theta: float, y: FloatArray) -> FloatArray:
        a = 1.0 + amplitude * math.sin(theta)
        forcing = (a - y) * (a4 * a + (1.0 - a4) * y) + lift
        return np.asarray(forcing / k)

    periods = 4 + round(12.0 * k)
    start = integrate.solve_ivp(
        slope, (0.0, 2.0 * math.pi * periods), [1.0], method="DOP853", rtol=1e-11, atol=1e-12
    ).y[0, -1]
    theta = np.linspace(0.0, 2.0 * math.pi, 401)[:-1]
    y: FloatArray = integrate.solve_ivp(
        slope,
        (0.0, 2.0 * math.pi),
        [start],
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
        t_eval=theta,
    ).y[0]
    return y


@pytest.mark.parametrize(
    ("a4", "amplitude", "k", "lift"),
    [(0.0, 0.9, 0.3, 0.0), (0.77, 0.6, 0.1, 0.0), (1.0, 0.8, 0.4, -0.02), (0.5, 0.4, 3.0, 0.05)],
)
def test_periodic_rate(a4: float, amplitude: float, k: float, lift: float) -> None:
    rate = periodic_rate(
        lambda theta: 1.0 + amplitude * np.sin(theta),
        a4,
        k,
        lambda theta: np.full(theta.shape, lift),
    )
    record = periodic_by_integration(a4, amplitude, k, lift)
    theta = np.linspace(0.0, 2.0 * math.pi, 401)[:-1]
    assert np.allclose(rate.at(theta), record, rtol=1e-8)
    assert rate.mean == pytest.approx(float(np.mean(record)), rel=1e-9)
    assert rate.maximum() == pytest.approx(float(np.max(record)), rel=1e-4)
    harmonic = 2j * np.mean(record * np.exp(-1j * theta))
    assert rate.first_harmonic() == pytest.approx(complex(harmonic), abs=1e-8)
    if a4 == 0.0 and lift == 0.0:
        assert rate.mean == pytest.approx(1.0, rel=1e-12)


def test_a_rotor_that_stops_has_no_smooth_periodic_rate() -> None:
    with pytest.raises(ValueError, match="stop"):
        periodic_rate(
            lambda theta: 1.0 + 0.9 * np.sin(theta), 1.0, 0.02, lambda theta: 0.0 * theta - 0.3
        )


@pytest.mark.parametrize("a4", [0.0, 0.3, 0.77, 1.0, 1.09])
def test_forcing_is_recovered_from_rate_and_acceleration(a4: float) -> None:
    generator = np.random.default_rng(5)
    y = generator.uniform(1.0, 12.0, 3000)
    forcing = y * generator.uniform(0.6, 1.8, 3000)
    lift = generator.uniform(-0.05, 0.05, 3000)
    rate = ((forcing - y) * (a4 * forcing + (1.0 - a4) * y) + lift) / 1.7
    inverse = rotor_family.forcing_from_rate(y, rate, a4, 1.7, lift)
    assert np.all(inverse.possible)
    assert np.allclose(inverse.value, forcing, rtol=1e-10)
    if a4 > 0.0:
        assert not bool(rotor_family.forcing_from_rate(1.0, -50.0, a4, 1.7).possible)
