"""Both propeller models: steady states, dead sector, inversion, turbulence, limits."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.instruments import friction_propeller as jackson
from wind_sensors.instruments import propeller, propeller_turbulence
from wind_sensors.instruments.dynamics.rotor import (
    PROPELLER_JACKSON,
    PROPELLER_KRISTENSEN_1994,
    RotorParameters,
)
from wind_sensors.instruments.dynamics.rotor_record import integrate_rotor
from wind_sensors.instruments.friction_propeller import FrictionPropeller
from wind_sensors.turbulence import von_karman

ROTOR = FrictionPropeller(calibration_distance=0.2, response_length=1.1, stall_speed=0.3)


def settle(rotor: FrictionPropeller, speed: float, angle: float, start: float) -> float:
    """Integrate (5) until nothing changes; the rate [rad/s]."""
    rate = start
    step = 0.002
    for _ in range(20_000):
        k1 = float(jackson.angular_acceleration(rate, speed, angle, rotor))
        k2 = float(jackson.angular_acceleration(rate + step * k1, speed, angle, rotor))
        following = rate + 0.5 * step * (k1 + k2)
        if following * rate < 0.0:
            following = 0.0
        if abs(following - rate) < 1e-13 * (1.0 + abs(rate)):
            break
        rate = following
    return rate


@pytest.mark.parametrize("angle_deg", [0.0, 40.0, 75.0, 92.0, 150.0])
def test_steady_state_is_where_the_equation_settles(angle_deg: float) -> None:
    angle = math.radians(angle_deg)
    rate = settle(ROTOR, 4.0, angle, 1.0)
    expected = float(jackson.steady_oblique(4.0, angle, ROTOR))
    assert rate * ROTOR.calibration_distance == pytest.approx(expected, abs=1e-8)


def test_dead_sector_narrows_with_speed() -> None:
    edges = [jackson.stall_angle(speed, ROTOR) for speed in (0.5, 1.0, 3.0, 10.0)]
    assert edges == sorted(edges)
    assert jackson.stall_angle(0.3, ROTOR) == 0.0
    for speed, edge in zip((0.5, 1.0, 3.0, 10.0), edges, strict=True):
        assert float(jackson.steady_oblique(speed, edge + 1e-6, ROTOR)) == 0.0
        assert float(jackson.steady_oblique(speed, edge - 1e-6, ROTOR)) > 0.0
        assert settle(ROTOR, speed, edge + 1e-4, 0.0) == 0.0
        # Mirrored beyond 90 degrees, turning the other way.
        assert float(jackson.steady_oblique(speed, math.pi - edge + 1e-3, ROTOR)) < 0.0


def test_axial_relation_and_its_inverse() -> None:
    speed = np.array([0.1, 0.4, 1.0, 12.0])
    reading = jackson.steady_axial(speed, 0.3)
    assert reading[0] == 0.0
    assert np.allclose(jackson.axial_speed_from_rate(reading[1:], 0.3), speed[1:])
    assert jackson.stall_speed_from_excess(1.0, 1.14) == pytest.approx(0.350, abs=5e-4)


def test_recovery_follows_the_equation() -> None:
    angle, speed = math.radians(50.0), 3.0
    solution = integrate.solve_ivp(
        lambda _, w: jackson.angular_acceleration(w, speed, angle, ROTOR),
        (0.0, 0.8),
        [0.5 / 0.2],
        rtol=1e-10,
        atol=1e-12,
    )
    closed = float(jackson.recovery(0.8, 0.5, speed, angle, ROTOR))
    assert 0.2 * solution.y[0, -1] == pytest.approx(closed, rel=1e-8)
    # The axial response length hardly changes with the angle: that is why L is called a length.
    lengths = [jackson.axial_response_length(3.0, math.radians(a), ROTOR) for a in (0.0, 30.0)]
    assert lengths[0] == pytest.approx(1.1)
    assert lengths[1] == pytest.approx(
        1.1 * math.cos(math.radians(30.0)) / float(jackson.torque_slope_ratio(math.radians(30.0)))
    )


@pytest.mark.parametrize("seed", range(5))
def test_inversion_returns_the_wind_and_flags_the_ambiguity(seed: int) -> None:
    generator = np.random.default_rng(seed)
    speed = generator.uniform(0.5, 15.0, 2000)
    angle = generator.uniform(0.0, 1.4, 2000)
    rate = generator.uniform(0.2, 15.0, 2000) / 0.2
    acceleration = jackson.angular_acceleration(rate, speed, angle, ROTOR)
    truth = speed * np.cos(angle)
    roots = jackson.invert_axial(0.2 * rate, 0.2 * acceleration, angle, ROTOR)
    found = np.abs(roots.value - truth) < 1e-7 * speed
    swapped = np.abs(roots.other - truth) < 1e-7 * speed
    assert np.all(found | swapped)
    # The default root fails exactly in lulls below half the indicated speed, and all are flagged.
    assert np.array_equal(found, truth >= 0.5 * 0.2 * rate)
    assert np.all(roots.ambiguous[~found])
    assert not np.any(roots.noisy)
    noisy = jackson.invert_axial(1.0, -50.0, 0.0, ROTOR)
    assert bool(noisy.noisy)


def test_second_order_turbulence_formulas_against_their_spectral_integrals() -> None:
    """Jackson, sec. 3.4, over the one-sided angular-frequency spectrum E."""
    mean, length, stall, sigma, q = 7.0, 1.3, 2.0, 0.8, 0.4

    def spectrum(s: float) -> float:
        return 2.0 * float(von_karman.longitudinal_spectrum(s / mean, sigma**2, q)) / mean

    def integral(numerator: Callable[[float], float]) -> float:
        parts = [(0.0, 10.0), (10.0, 200.0), (200.0, math.inf)]
        return math.fsum(
            integrate.quad(
                lambda s: spectrum(s) * numerator(s) / (length**2 * s**2 + mean**2),
                low,
                high,
                limit=200,
            )[0]
            for low, high in parts
        )

    excess = integral(lambda s: length**2 * s**2 - stall**2) / mean
    variance = integral(lambda _: (mean**2 + stall**2) ** 2) / mean**2
    ratio = stall / mean
    assert excess == pytest.approx(
        float(propeller_turbulence.mean_excess_von_karman(q * length, ratio)) * sigma**2 / mean,
        rel=1e-6,
    )
    assert variance == pytest.approx(
        float(propeller_turbulence.variance_von_karman(q * length, ratio)) * sigma**2, rel=1e-6
    )


def test_small_sinusoids_follow_the_linear_response() -> None:
    k, stall = 2.0 * math.pi / 16.0, 0.015
    rate = propeller_turbulence.sinusoidal_rate(1e-4, k, stall)
    assert rate.first_harmonic() / 1e-4 == pytest.approx(
        propeller_turbulence.sinusoidal_gain(k, stall), rel=1e-6
    )
    # Jackson's figures for a wavelength of 16 L.
    assert abs(propeller_turbulence.sinusoidal_gain(k, 0.0)) == pytest.approx(0.931, abs=5e-4)
    assert math.degrees(np.angle(propeller_turbulence.sinusoidal_gain(k, 0.0))) == pytest.approx(
        -21.4, abs=0.1
    )


def test_transverse_form_is_the_equation_near_ninety_degrees() -> None:
    """(8) with f = a sin, g = b + c |sin| is (5) with the same functions."""
    a, b, c = 0.8, 0.2, 1.1
    rotor = FrictionPropeller(
        0.2,
        1.1,
        0.2,
        f=lambda t: a * np.cos(np.asarray(t)),
        g=lambda t: b + c * np.abs(np.cos(np.asarray(t))),
    )
    angle, speed, rate = 1.45, 6.0, 3.0
    full = 0.2 * float(jackson.angular_acceleration(rate, speed, angle, rotor))
    near = propeller_turbulence.transverse_acceleration(
        0.2 * rate, speed, speed * math.cos(angle), 1.1, 0.2, a, b, c
    )
    assert float(near) == pytest.approx(full, rel=1e-12)
    assert float(propeller_turbulence.effective_length_ratio(0.1, 0.05, 1.5)) == pytest.approx(5.0)
    fichtl = propeller_turbulence.fichtl_kumar_length_ratio(np.array([0.1, 0.8]), 1.0)
    assert fichtl[0] / fichtl[1] == pytest.approx(4.0)
    assert float(propeller_turbulence.transverse_spectral_ratio(1.0, 0.9)) == pytest.approx(0.405)


def test_torque_gives_the_lengths_of_the_equation() -> None:
    inertia, density, radius, slope, friction = 2e-5, 1.2, 0.115, 0.1, 1e-5
    length = jackson.response_length_from_inertia(inertia, density, radius, slope)
    stall = jackson.stall_speed_from_torque(friction, 0.2, density, radius, slope)
    rotor = FrictionPropeller(0.2, length, stall)
    torque = jackson.aerodynamic_torque(20.0, 7.0, 0.4, rotor, density, radius, slope)
    expected = (float(torque) - friction) / inertia
    assert float(jackson.angular_acceleration(20.0, 7.0, 0.4, rotor)) == pytest.approx(expected)


def test_kristensen_propeller() -> None:
    mu2 = -0.7
    for angle in np.radians([5.0, 20.0, 35.0]):
        y = float(propeller.steady_response(angle, mu2))
        acceleration = propeller.angular_acceleration(
            y * 6.0 / 0.2, 6.0 * math.cos(angle), 6.0 * math.sin(angle), 0.2, 1.0, mu2
        )
        assert float(acceleration) == pytest.approx(0.0, abs=1e-9)
        # The decay towards it has the oblique response length.
        above = propeller.angular_acceleration(
            1.0001 * y * 30.0, 6.0 * math.cos(angle), 6.0 * math.sin(angle), 0.2, 1.0, mu2
        )
        length = 6.0 * 0.0001 * y * 30.0 / -float(above)
        assert length == pytest.approx(
            float(propeller.oblique_response_length_ratio(angle, mu2)), rel=1e-3
        )
    assert math.isnan(float(propeller.steady_response(math.radians(41.0), mu2)))
    assert propeller.critical_angle(0.1) == pytest.approx(0.5 * math.pi)
    assert propeller.curvature_from_cosine_power(1.3) == pytest.approx(-0.69)
    small = np.radians(2.0)
    assert float(propeller.angular_response(small, mu2)) == pytest.approx(
        float(propeller.steady_response(small, mu2)), abs=1e-6
    )
    assert propeller.fixed_propeller_bias(mu2, 0.3, 0.1, 5.0) == pytest.approx(-0.0056)


def gain_of_kernel(form: int, angle: float, wave: float, across: bool) -> complex:
    """Response of the compiled equation to a small sinusoid, per unit of the gust."""
    speed, length, count = 5.0, 1.1, 200
    dt = 2.0 * math.pi * length / (wave * speed) / count
    phase = 2.0 * math.pi * np.arange(20 * count) / count
    gust = 1e-3 * np.sin(phase)
    along = speed + (0.0 if across else 1.0) * gust
    sideways = (1.0 if across else 0.0) * gust
    axial = along * math.cos(angle) + sideways * math.sin(angle)
    transverse = along * math.sin(angle) - sideways * math.cos(angle)
    table = np.cos(np.radians(np.arange(181.0)))
    friction = ROTOR.stall_speed**2 if form == PROPELLER_JACKSON else 0.0
    a4 = 1.0 if form == PROPELLER_JACKSON else 0.0
    parameters = RotorParameters(
        form, 0.2, 0.0, length, a4, 0.0, -0.3, table, 1.0, 0.0, friction, 0.0, 15.0, 1.0, 0.0, 0.0,
        1.0,
    )
    y, _ = integrate_rotor(
        parameters, axial, transverse, np.zeros(axial.size), np.ones(axial.size),
        np.full(axial.size, 15.0), dt, 1, math.nan, 0.0,
    )
    last = slice(-2 * count, None)
    return complex(2.0 * np.mean(y[last] * 1j * np.exp(-1j * phase[last])) / 1e-3)


@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 40.0])
@pytest.mark.parametrize("across", [False, True])
def test_oblique_transfer_functions_are_those_of_the_equations(
    angle_deg: float, across: bool
) -> None:
    angle = math.radians(angle_deg)
    for wave in (0.3, 1.0, 3.0):
        found = gain_of_kernel(PROPELLER_KRISTENSEN_1994, angle, wave, across)
        expected = propeller.transfer_function(wave, angle, -0.3)[int(across)]
        assert found == pytest.approx(expected, abs=2e-3)
        found = gain_of_kernel(PROPELLER_JACKSON, angle, wave, across)
        # The kernel's response table is linear from degree to degree.
        expected = propeller_turbulence.transfer_function(wave, 5.0, angle, ROTOR)[int(across)]
        assert found == pytest.approx(expected, abs=1e-2)
    axial = propeller_turbulence.transfer_function(1.0, 5.0, 0.0, ROTOR)
    assert axial[0] == pytest.approx(propeller_turbulence.sinusoidal_gain(1.0, 0.3 / 5.0))
