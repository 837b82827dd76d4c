"""The vane's closed forms against its integrated equation and defining integrals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate

from wind_sensors.instruments import vane, vane_variance
from wind_sensors.turbulence import von_karman


@pytest.mark.parametrize("zeta", [0.0, 0.15, 0.7, 0.999999, 1.0, 1.000001, 2.0, 30.0])
def test_step_and_impulse_responses(zeta: float) -> None:
    times = np.array([0.3, 1.7, 9.0])

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -2.0 * zeta * state[1] + 1.0 - state[0]]

    solution = integrate.solve_ivp(
        motion, (0.0, 9.0), [0.0, 0.0], t_eval=times, method="DOP853", rtol=1e-11, atol=1e-13
    )
    assert np.allclose(vane.step_response(times, zeta), solution.y[0], rtol=1e-8, atol=1e-10)
    assert np.allclose(vane.impulse_response(times, zeta), solution.y[1], rtol=1e-8, atol=1e-10)


def test_strong_damping_tends_to_first_order() -> None:
    tau = np.linspace(0.0, 400.0, 200)
    exact = vane.step_response(tau, 40.0)
    assert np.max(np.abs(exact - vane.first_order_step_response(tau, 40.0))) < 2e-3
    assert vane.slow_pole_length_ratio(2.0) == pytest.approx(2.0 * 2.0 * 0.933, rel=1e-3)
    assert vane.slow_pole_length_ratio(0.5) == 2.0
    dynamics = vane.VaneDynamics(0.5, 3.0)
    assert vane.effective_length(dynamics) == pytest.approx(3.0)


def test_overshoot_is_the_maximum_of_the_step() -> None:
    tau = np.linspace(0.0, 12.0, 240_001)
    for zeta in (0.2, 0.6, math.sqrt(0.5)):
        assert vane.overshoot(zeta) == pytest.approx(
            float(np.max(vane.step_response(tau, zeta))) - 1.0, abs=1e-9
        )
        assert vane.damping_from_overshoot(vane.overshoot(zeta)) == pytest.approx(zeta)
    assert vane.overshoot(1.3) == 0.0
    assert vane.damping_from_logarithmic_decrement(0.15) == pytest.approx(0.02387, abs=1e-5)


def test_transfer_function_is_the_transform_of_the_impulse_response() -> None:
    tau = np.linspace(0.0, 120.0, 600_001)
    for zeta, s in ((0.3, 0.9), (1.5, 2.0)):
        transform = integrate.trapezoid(
            vane.impulse_response(tau, zeta) * np.exp(-1j * s * tau), tau
        )
        transfer = complex(vane.transfer_function(s, zeta))
        assert transfer == pytest.approx(transform, abs=1e-7)
        assert abs(transfer) == pytest.approx(float(vane.gain(s, zeta)))
        assert np.angle(transfer) == pytest.approx(float(vane.phase(s, zeta)))


def test_geometry_of_a_fin_on_an_arm() -> None:
    """Larsen and Busch's vane as K94 gives it: zeta about .94 for K = 1.9, 1.72 for 2 pi."""
    for slope, expected in (
        (vane.LIFT_SLOPE_MEASURED, 0.94),
        (vane.LIFT_SLOPE_THIN_AEROFOIL, 1.72),
    ):
        assert vane.damping_from_fin(1.3, 0.20, 0.10, 0.02079, slope) == pytest.approx(
            expected, abs=0.01
        )
        arm, area = 0.20, 0.02
        inertia = 0.02079 * arm**3 / 3.0
        dynamics = vane.dynamics_from_geometry(1.3, arm, area, slope, inertia)
        assert dynamics.damping_ratio == pytest.approx(
            vane.damping_from_fin(1.3, 0.20, 0.10, 0.02079, slope)
        )
        assert vane.natural_frequency(5.0, dynamics.distance_constant) == pytest.approx(
            5.0 / dynamics.distance_constant
        )


@pytest.mark.parametrize("zeta", [0.2, 0.9999999, 1.0, 1.0000001, 3.0])
@pytest.mark.parametrize("slope", [1.2, 5.0 / 3.0, 2.0, 2.8])
def test_power_law_integrals(zeta: float, slope: float) -> None:
    def integral(power: float) -> float:
        def integrand(t: float) -> float:
            s = math.exp(t)
            return math.exp((power + 1.0) * t) / ((1.0 - s * s) ** 2 + 4.0 * zeta**2 * s * s)

        return float(integrate.quad(integrand, -90.0, 90.0, points=[-1.0, 0.0, 1.0], limit=400)[0])

    g, h = integral(2.0 - slope), integral(4.0 - slope)
    assert vane_variance.g_integral(zeta, slope) == pytest.approx(g, rel=1e-6)
    assert vane_variance.h_integral(zeta, slope) == pytest.approx(h, rel=1e-6)
    assert vane_variance.loss_integral(zeta, slope) == pytest.approx(
        h - 2.0 * (1.0 - 2.0 * zeta**2) * g, rel=1e-6, abs=1e-6
    )


@pytest.mark.parametrize("slope", [1.1, 1.5, 5.0 / 3.0, 2.0, 2.5, 2.9])
def test_no_net_loss_at_zeta_0(slope: float) -> None:
    zeta = vane_variance.damping_without_loss(slope)
    assert vane_variance.loss_integral(zeta, slope) == pytest.approx(0.0, abs=1e-12)
    edge = vane_variance.crossing(slope)
    assert float(vane.gain(edge, zeta)) == pytest.approx(1.0, rel=1e-12)

    def beyond(s: float) -> float:
        return (1.0 - 1.0 / float(vane.inverse_gain_squared(s, zeta))) * math.pow(s, -slope)

    area = integrate.quad(beyond, edge, 20.0)[0] + integrate.quad(beyond, 20.0, math.inf)[0]
    expected = (slope - 1.0) * edge ** (slope - 1.0) * area
    assert vane_variance.recovered_fraction(slope) == pytest.approx(expected, rel=1e-7)


def test_the_printed_limit_is_right_at_two_only() -> None:
    assert vane_variance.crossing_as_printed(2.0) == pytest.approx(vane_variance.crossing(2.0))
    assert vane_variance.crossing_as_printed() == pytest.approx(1.11114, abs=1e-5)
    assert vane_variance.crossing() == pytest.approx(1.18921, abs=1e-5)


def test_von_karman_moments() -> None:
    """q l_v = 1, zeta = 1: the ratio is 16/85; elsewhere against plain quadrature."""
    assert vane_variance.von_karman_moments(1.0, 1.0).direction == pytest.approx(
        16.0 / 85.0, rel=1e-13
    )
    for length, zeta in ((0.05, 0.2), (0.4, 0.383), (3.0, 1.7)):
        found = vane_variance.von_karman_moments(length, zeta)
        assert found.direction + found.loss == pytest.approx(1.0, rel=1e-12)
        direct = (
            2.0
            * integrate.quad(
                lambda k, length=length, z=zeta: float(
                    von_karman.transverse_spectrum(k, 1.0, 1.0)
                    / vane.inverse_gain_squared(k * length, z)
                ),
                0.0,
                200.0,
                points=[1.0, 1.0 / length],
                limit=500,
            )[0]
        )
        assert found.direction == pytest.approx(direct, rel=1e-6)


def test_inertial_loss_is_the_small_vane_limit() -> None:
    q, dissipation, length = 1e-3, 0.01, 0.01
    variance = von_karman.variance_from_dissipation(dissipation, q, 1.7)
    loss = vane_variance.inertial_loss(length, 0.6, dissipation, 18.0 / 55.0 * 1.7)
    exact = vane_variance.von_karman_moments(q * length, 0.6).loss * variance
    assert loss == pytest.approx(exact, rel=5e-3)


def test_undamped_vane_and_slopes_out_of_range_are_refused() -> None:
    with pytest.raises(ValueError, match="damping"):
        vane_variance.g_integral(0.0)
    with pytest.raises(ValueError, match="slope"):
        vane_variance.h_integral(0.5, 3.0)


def test_wind_angle_inverts_the_vane() -> None:
    """A vane driven by a sine wind: its angle and derivatives give the wind back."""
    omega0, zeta, omega = 5.0, 0.4, 7.0
    response = complex(vane.transfer_function(omega / omega0, zeta))
    time = np.linspace(0.0, 3.0, 50)
    wave = 0.1 * response * np.exp(1j * omega * time)
    angle, rate, bend = np.imag(wave), np.imag(1j * omega * wave), np.imag(-(omega**2) * wave)
    found = vane.wind_angle(angle, rate, bend, omega0, zeta)
    assert np.allclose(found, 0.1 * np.sin(omega * time), atol=1e-14)
