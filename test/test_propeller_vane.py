"""Propeller-vane: the forms of its bias agree with each other and with the kinematics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wind_sensors.instruments import propeller_vane, vane_variance
from wind_sensors.turbulence import inertial_range, surface_layer, von_karman
from wind_sensors.turbulence.quadrature import integrate_over_wavenumbers


@pytest.mark.parametrize(
    ("zeta", "arm", "mu2", "length"),
    [(0.6, 0.35, -0.7, 0.05), (0.3, 1.0, 0.5, 2.0), (1.4, 0.0, 0.0, 0.3)],
)
def test_weight_and_moments_give_one_bias(
    zeta: float, arm: float, mu2: float, length: float
) -> None:
    """K94 (108), (109) integrated directly against (107) from the moments."""
    i_v, i_w = 0.12, 0.07

    def integrand(k: np.ndarray) -> np.ndarray:
        weight = propeller_vane.bias_weight(k * length, zeta, arm, mu2)
        return 2.0 * i_v**2 * weight * von_karman.transverse_spectrum(k, 1.0, 1.0)

    direct = integrate_over_wavenumbers(integrand, 1e-2, 1e2, resonance_width=0.2)
    direct += 0.5 * mu2 * i_w**2
    bias = propeller_vane.von_karman_bias(length, zeta, arm, mu2, i_v, i_w)
    assert bias.total == pytest.approx(direct, rel=1e-11)


def test_limits_of_the_lateral_bias() -> None:
    """A perfect vane sees the whole speed, a frozen one only the propeller's response."""
    for mu2 in (-0.7, 0.4):
        perfect = propeller_vane.von_karman_bias(1e-9, 0.6, 0.35, mu2, 0.1, 0.0)
        frozen = propeller_vane.von_karman_bias(1e6, 0.6, 0.0, mu2, 0.1, 0.0)
        assert perfect.total == pytest.approx(0.005, rel=1e-4)
        assert frozen.total == pytest.approx(mu2 * 0.005, rel=1e-3)


def test_inertial_form_is_the_small_vane_limit() -> None:
    q, dissipation, length, zeta, arm, mu2, speed = 1e-3, 0.01, 0.01, 0.5, 0.4, -0.3, 5.0
    variance = von_karman.variance_from_dissipation(dissipation, q, 1.7)
    intensity = math.sqrt(variance) / speed
    exact = propeller_vane.von_karman_bias(q * length, zeta, arm, mu2, intensity, 0.0).total
    alpha_1 = inertial_range.one_sided_longitudinal_constant(1.7)
    delta = propeller_vane.inertial_delta(zeta, arm, mu2, length, dissipation, alpha_1, speed)
    assert exact - 0.5 * intensity**2 == pytest.approx(delta, rel=5e-3)


def test_surface_layer_forms_agree_without_stratification() -> None:
    """(114) is (126) in units of <v^2>/(2 U^2)."""
    zeta, arm, mu2, length, height, ratio = 0.6, 0.35, -0.7, 1.0, 10.0, 1000.0
    delta = propeller_vane.surface_layer_delta(zeta, arm, mu2, length, height, ratio, 0.0)
    half_v2 = 0.5 * 2.68 * (0.4 / math.log(ratio)) ** 2
    relative = propeller_vane.neutral_relative_bias(zeta, arm, mu2, length, height)
    constant = propeller_vane.neutral_constant(mu2)
    assert (relative - constant) * half_v2 == pytest.approx(delta, rel=1e-12)
    u_star = float(surface_layer.friction_velocity(1.0, ratio))
    dissipation = float(surface_layer.dissipation(u_star, height))
    alpha_1 = 0.165 / 0.4 ** (4.0 / 3.0)
    assert propeller_vane.inertial_delta(
        zeta, arm, mu2, length, dissipation, alpha_1, 1.0
    ) == pytest.approx(delta, rel=1e-12)


def test_relative_wind_is_a_rotation_plus_the_arm() -> None:
    axial, lateral = propeller_vane.relative_wind(7.0, 1.5, 0.2, 0.0, 0.35)
    assert math.hypot(float(axial), float(lateral)) == pytest.approx(math.hypot(7.0, 1.5))
    aligned = math.atan2(1.5, 7.0)
    axial, lateral = propeller_vane.relative_wind(7.0, 1.5, aligned, 2.0, 0.35)
    assert float(axial) == pytest.approx(math.hypot(7.0, 1.5))
    assert float(lateral) == pytest.approx(0.7)


def test_small_gusts_give_the_second_order_bias() -> None:
    """The nonlinear periodic mean against (107) for one wavenumber."""
    zeta, arm, mu2, k, amplitude = 0.6, 0.35, -0.7, 0.8, 0.01
    rate = propeller_vane.rate_in_lateral_gusts(amplitude, k, zeta, arm, mu2, 1.3)
    variance = 0.5 * amplitude**2
    expected = variance * float(propeller_vane.bias_weight(k, zeta, arm, mu2))
    assert rate.mean - 1.0 == pytest.approx(expected, rel=1e-3)


def test_jackson_s_rotor_adds_the_overspeeding_of_a_cup() -> None:
    assert propeller_vane.rotor_overspeeding(0.0, 0.5, 0.1) == 0.0
    assert propeller_vane.rotor_overspeeding(1.0, 0.5, 0.1) == pytest.approx(0.004477, abs=1e-6)


def test_bias_from_a_measured_spectrum() -> None:
    k = np.geomspace(1e-5, 1e4, 40_001)
    measured = propeller_vane.bias_from_spectrum(
        lambda x: von_karman.transverse_spectrum(x, 0.25, 0.1), k, 1.0, 0.6, 0.35, -0.7, 5.0
    )
    model = propeller_vane.von_karman_bias(0.1, 0.6, 0.35, -0.7, 0.1, 0.0).total
    assert measured == pytest.approx(model, rel=2e-3)
    assert vane_variance.von_karman_moments(0.1, 0.6).turning > 0.0
