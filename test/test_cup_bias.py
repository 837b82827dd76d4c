"""Overspeeding formulas against each other, spectra against structure functions, limits."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.instruments import cup, speed_bias
from wind_sensors.instruments.filtered_turbulence import (
    exponential_loss,
    longitudinal_loss,
    longitudinal_loss_small,
    transverse_loss,
)
from wind_sensors.turbulence import inertial_range, surface_layer, von_karman


@pytest.mark.parametrize("length", [0.02, 0.59, 0.61, 2.0, 2.99, 3.01, 40.0])
def test_losses_are_their_defining_integrals(length: float) -> None:
    """phi = (1/2 sigma^2) int D exp(-r/l0) dr/l0, and the same from the spectrum."""
    for loss, structure, spectrum in (
        (
            longitudinal_loss,
            von_karman.longitudinal_structure_function,
            von_karman.longitudinal_spectrum,
        ),
        (transverse_loss, von_karman.transverse_structure_function, von_karman.transverse_spectrum),
    ):
        expected = speed_bias.longitudinal_bias_from_structure_function(
            partial(structure, variance=1.0, wavenumber_q=1.0), length, 1.0, 1.0
        )
        assert float(loss(length)) == pytest.approx(expected, rel=1e-10)
        spectral = speed_bias.longitudinal_bias_from_spectra(
            partial(spectrum, variance=1.0, wavenumber_q=1.0), length, 1.0, 1.0, 1.0
        )
        assert float(loss(length)) == pytest.approx(spectral, rel=1e-10)


def test_losses_meet_at_their_seams_and_small_argument_law() -> None:
    for loss in (longitudinal_loss, transverse_loss):
        for seam in (0.6, 3.0):
            below, above = loss(np.array([seam * (1 - 1e-12), seam * (1 + 1e-12)]))
            assert above == pytest.approx(below, rel=1e-11)
    assert float(longitudinal_loss_small(0.1) / longitudinal_loss(0.1)) == pytest.approx(
        1.033, abs=5e-4
    )
    assert float(transverse_loss(1e-9) / longitudinal_loss(1e-9)) == pytest.approx(4.0 / 3.0)
    assert float(longitudinal_loss(0.0)) == 0.0
    structure = speed_bias.longitudinal_bias_from_structure_function(
        lambda r: 2.0 * -np.expm1(-r / 3.0), 1.2, 1.0, 1.0
    )
    assert float(exponential_loss(0.4)) == pytest.approx(structure, rel=1e-10)


def test_isotropic_bias_is_the_general_spectral_form() -> None:
    a4, mu1, mu2, q, length, speed, sigma = 0.8, 0.15, 0.6, 0.3, 1.5, 6.0, 0.9
    filtered = speed_bias.longitudinal_bias_from_spectra(
        lambda k: von_karman.longitudinal_spectrum(k, sigma**2, q),
        length,
        speed,
        a4,
        q,
        mu1,
        lambda k: von_karman.transverse_spectrum(k, sigma**2, q),
    )
    bias = speed_bias.isotropic_bias(q * length, sigma / speed, a4, mu1, mu2)
    assert bias.total == pytest.approx(
        filtered + 0.5 * (1.0 + mu2) * (sigma / speed) ** 2, rel=1e-12
    )


def test_cross_term_of_correlated_u_and_w() -> None:
    """With F_uw = rho F_u the cross term is 2 mu1 rho times the u term (section 13's case)."""

    def spectrum(k: np.ndarray) -> np.ndarray:
        return von_karman.longitudinal_spectrum(k, 1.0, 1.0)

    plain = speed_bias.longitudinal_bias_from_spectra(spectrum, 0.5, 1.0, 1.0, 1.0)
    crossed = speed_bias.longitudinal_bias_from_spectra(
        spectrum, 0.5, 1.0, 1.0, 1.0, 0.2, spectrum, lambda k: -0.4 * spectrum(k)
    )
    assert crossed / plain == pytest.approx(1.0 + 0.04 - 0.16, rel=1e-12)


def test_small_cups_meet_the_inertial_formula() -> None:
    q, dissipation, length, speed = 0.01, 0.02, 1e-4, 5.0
    variance = von_karman.variance_from_dissipation(dissipation, q, 1.7)
    intensity = math.sqrt(variance) / speed
    exact = speed_bias.isotropic_bias(q * length, intensity, 0.9, 0.1, 0.3)
    inertial = speed_bias.inertial_bias(
        length, dissipation, speed, variance, variance, 0.9, 0.1, 0.3
    )
    assert inertial.u == pytest.approx(exact.u, rel=1e-3)
    assert inertial.total == pytest.approx(exact.total, rel=1e-4)


def test_neutral_and_diabatic_forms_agree_without_stratification() -> None:
    ratios = surface_layer.KRISTENSEN_1994_RATIOS
    alpha1_kappa43 = inertial_range.one_sided_longitudinal_constant() * 0.4 ** (4.0 / 3.0)
    neutral = speed_bias.neutral_bias(1.7, 10.0, 0.01, ratios, 0.8, 0.2, 0.5)
    diabatic = speed_bias.diabatic_longitudinal_bias(
        1.7, 10.0, 1000.0, 0.0, 0.8, 0.2, alpha1_kappa43
    )
    filtered = neutral.u + (neutral.w - 0.25 * ratios.w * (0.4 / math.log(1000.0)) ** 2)
    assert filtered == pytest.approx(diabatic, rel=1e-12)
    turbulence = 2.39**2 * (0.4 / math.log(1000.0)) ** 2
    coefficient = speed_bias.neutral_longitudinal_coefficient()
    assert neutral.u == pytest.approx(
        0.8 * coefficient * turbulence * (1.7 / 10.0) ** (2.0 / 3.0), rel=1e-12
    )


def test_transfer_function_is_the_transform_of_the_impulse_response() -> None:
    time = np.linspace(0.0, 60.0, 600_001)
    for k in (0.3, 2.0):
        transform = integrate.trapezoid(cup.impulse_response(time) * np.exp(-1j * k * time), time)
        transfer = complex(cup.transfer_function(k))
        assert transfer == pytest.approx(transform, abs=1e-8)
        assert abs(transfer) == pytest.approx(float(cup.gain(k)))
        assert np.angle(transfer) == pytest.approx(float(cup.phase(k)))
    area = np.cumsum(cup.impulse_response(time)) * time[1]
    assert np.allclose(cup.step_response(time), area, atol=2e-4)


def test_calibration_and_angular_responses() -> None:
    rotor = cup.CupConstants(0.2, 1.7, 0.06, 0.05, 0.8, starting_speed=0.25)
    assert float(cup.steady_rate(8.25, rotor)) == pytest.approx(40.0)
    assert float(cup.steady_rate(0.1, rotor)) == 0.0
    assert cup.time_constant(5.0, 1.7) == pytest.approx(0.34)
    theta = np.radians(np.array([-5.0, 0.0, 5.0]))
    flat = cup.angular_response(theta, 0.0, 1.0)
    assert np.allclose(flat, 1.0, atol=1e-15)
    horizontal, vertical = 7.0 * np.cos(theta), 7.0 * np.sin(theta)
    assert np.allclose(
        cup.equivalent_speed(horizontal, vertical, 0.05, 0.8) / 7.0,
        cup.angular_response(theta, 0.05, 0.8),
    )
    difference = cup.steady_response(theta, rotor) - cup.angular_response(
        theta, 0.05, 0.8, second_order=True
    )
    assert np.all(np.abs(difference) < 2.0 * np.abs(theta) ** 3 + 1e-15)


def test_the_symmetric_cup_feels_the_total_speed() -> None:
    """K94 (3): with Lambda = l, mu1 = 0 and mu2 = 1 the torque is that of the 3-D speed."""
    even = cup.CupConstants(0.2, 1.7, second_length=0.2, mu2=1.0)
    for u, v, w, s in ((7.0, 1.0, -0.8, 33.0), (3.0, -2.0, 1.5, 10.0)):
        expected = (u**2 + v**2 + w**2 - (0.2 * s) ** 2) / (2.0 * 0.2 * 1.7)
        found = float(cup.angular_acceleration(s, math.hypot(u, v), w, even))
        assert found == pytest.approx(expected, rel=1e-12)
