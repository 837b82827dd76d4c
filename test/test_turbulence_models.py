"""Turbulence models against their defining integrals and relations."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.turbulence import inertial_range, isotropic, surface_layer, von_karman
from wind_sensors.turbulence.quadrature import integrate_over_wavenumbers

STEP = 1e-4


@pytest.mark.parametrize("separation", [0.03, 0.7, 1.999, 2.001, 6.0])
@pytest.mark.parametrize("transverse", [False, True])
def test_correlations_are_the_transforms_of_the_spectra(
    separation: float, transverse: bool
) -> None:
    spectrum = von_karman.transverse_spectrum if transverse else von_karman.longitudinal_spectrum
    closed = (
        von_karman.transverse_correlation if transverse else von_karman.longitudinal_correlation
    )
    value = isotropic.correlation_from_spectrum(lambda k: spectrum(k, 2.0, 1.0), separation)
    assert float(closed(separation, 2.0, 1.0)) == pytest.approx(value, abs=2e-8)


def test_isotropic_relations_hold_for_the_model() -> None:
    k = np.array([0.05, 0.4, 1.3, 6.0])
    h = STEP * k

    def longitudinal(x: np.ndarray) -> np.ndarray:
        return von_karman.longitudinal_spectrum(x, 1.0, 1.0)

    slope = (longitudinal(k + h) - longitudinal(k - h)) / (2.0 * h)
    curvature = (longitudinal(k + h) - 2.0 * longitudinal(k) + longitudinal(k - h)) / h**2
    transverse = isotropic.transverse_spectrum(k, longitudinal(k), slope)
    assert np.allclose(transverse, von_karman.transverse_spectrum(k, 1.0, 1.0), rtol=1e-6)
    energy = isotropic.energy_spectrum(k, slope, curvature)
    assert np.allclose(energy, von_karman.energy_spectrum(k, 1.0, 1.0), rtol=1e-5)
    r = np.array([0.1, 1.0, 4.0])
    dr = STEP * r

    def structure(x: np.ndarray) -> np.ndarray:
        return von_karman.longitudinal_structure_function(x, 1.0, 1.0)

    rate = (structure(r + dr) - structure(r - dr)) / (2.0 * dr)
    assert np.allclose(
        isotropic.transverse_from_longitudinal(r, structure(r), rate),
        von_karman.transverse_structure_function(r, 1.0, 1.0),
        rtol=1e-7,
    )


def test_variances_and_tails() -> None:
    for spectrum, tail in (
        (von_karman.longitudinal_spectrum, von_karman.longitudinal_tail),
        (von_karman.transverse_spectrum, von_karman.transverse_tail),
    ):
        model = partial(spectrum, variance=3.0, wavenumber_q=0.2)
        total = 2.0 * integrate_over_wavenumbers(model, 0.2, 0.2)
        assert total == pytest.approx(3.0, rel=1e-12)
        inside = 2.0 * integrate.quad(lambda k, f=model: float(f(k)), 0.0, 1.5)[0]
        assert inside + tail(1.5, 3.0, 0.2) == pytest.approx(3.0, rel=1e-8)


def test_small_scales_join_the_inertial_subrange() -> None:
    dissipation, q, alpha = 0.03, 0.05, 1.7
    variance = von_karman.variance_from_dissipation(dissipation, q, alpha)
    assert von_karman.dissipation_from_variance(variance, q, alpha) == pytest.approx(dissipation)
    k = 5e3 * q
    for model, limit in (
        (von_karman.longitudinal_spectrum, inertial_range.longitudinal_spectrum),
        (von_karman.transverse_spectrum, inertial_range.transverse_spectrum),
        (von_karman.energy_spectrum, inertial_range.energy_spectrum),
    ):
        assert float(model(k, variance, q)) == pytest.approx(float(limit(k, dissipation)), rel=1e-6)
    r = 1e-6 / q
    assert float(von_karman.longitudinal_structure_function(r, variance, q)) == pytest.approx(
        float(inertial_range.longitudinal_structure_function(r, dissipation)), rel=1e-3
    )
    assert float(von_karman.transverse_structure_function(r, variance, q)) == pytest.approx(
        float(inertial_range.transverse_structure_function(r, dissipation)), rel=1e-3
    )
    assert inertial_range.kolmogorov_constant_from_one_sided(
        inertial_range.one_sided_longitudinal_constant(1.6)
    ) == pytest.approx(1.6)


def test_integral_length_is_the_integral_of_the_correlation() -> None:
    length, _ = integrate.quad(
        lambda r: float(von_karman.longitudinal_correlation(r, 1.0, 1.0)), 0.0, 60.0
    )
    assert von_karman.integral_length_from_wavenumber(1.0) == pytest.approx(length, rel=1e-8)
    q = von_karman.wavenumber_from_integral_length(37.0)
    assert von_karman.integral_length_from_wavenumber(q) == pytest.approx(37.0)


def test_tensors_obey_incompressibility_and_their_traces() -> None:
    k = np.array([0.3, -1.1, 0.7])
    tensor = isotropic.spectral_tensor(k, 2.5)
    assert np.allclose(tensor @ k, 0.0, atol=1e-15)
    assert np.trace(tensor) == pytest.approx(2.0 * 2.5 / (4.0 * math.pi * float(k @ k)))
    r = np.array([0.0, 2.0, 0.0])
    structure = isotropic.structure_tensor(r, 1.3, 1.7)
    assert np.allclose(structure, np.diag([1.7, 1.3, 1.7]))


@pytest.mark.parametrize("exponent", [surface_layer.THIRD, surface_layer.QUARTER])
@pytest.mark.parametrize("stability", [-3.0, -0.2, -1e-4, 0.3])
def test_profile_correction_is_the_integral_of_the_shear(stability: float, exponent: str) -> None:
    value, _ = integrate.quad(
        lambda t: (1.0 - float(surface_layer.wind_shear_function(t, exponent))) / t,
        0.0,
        stability,
        epsabs=1e-13,
    )
    assert float(surface_layer.profile_correction(stability, exponent)) == pytest.approx(
        value, rel=1e-8
    )


def test_wind_profile_round_trip() -> None:
    u_star = float(surface_layer.friction_velocity(6.0, 300.0, -0.4))
    assert float(surface_layer.mean_speed(u_star, 300.0, -0.4)) == pytest.approx(6.0)
    assert float(surface_layer.friction_velocity_from_flux(-0.09)) == pytest.approx(0.3)
    assert math.isnan(float(surface_layer.friction_velocity_from_flux(0.09)))
    with pytest.raises(ValueError, match="exponent"):
        surface_layer.wind_shear_function(-1.0, "fifth")
