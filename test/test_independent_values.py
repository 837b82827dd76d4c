"""One value or more for each family of formulas, from its definition and computed here.

Spectra are written down from the model's shape and integrated over the logarithm of the wavenumber,
rotors' steady states are roots of their equations; nothing of the library is on the right-hand
side, and no file is needed. Numbers without an integral were worked out by hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from scipy import integrate, optimize

from wind_sensors.instruments import (
    bivane,
    cup,
    cup_vane,
    filtered_turbulence,
    friction_propeller,
    propeller,
    propeller_vane,
    pulses,
    rotor_family,
    speed_bias,
    vane_variance,
)
from wind_sensors.turbulence import inertial_range, surface_layer, von_karman

FloatArray = npt.NDArray[np.float64]
KAPPA, ALPHA_1_KAPPA = 0.4, 0.165
ALPHA = 55.0 / 18.0 * ALPHA_1_KAPPA * KAPPA ** (-4.0 / 3.0)


def over_wavenumbers(integrand: Callable[[FloatArray], FloatArray]) -> float:
    """Integral from nought to infinity, by equal steps of ln k."""
    steps = np.linspace(-60.0, 60.0, 24_001)
    k = np.exp(steps)
    return float(np.sum(integrand(k) * k) * (steps[1] - steps[0]))


def shape_along(k: FloatArray) -> FloatArray:
    """F_L of von Karman but for its front, q = 1."""
    return (1.0 + k * k) ** (-5.0 / 6.0)


def shape_across(k: FloatArray) -> FloatArray:
    """F_T = (F_L - k dF_L/dk)/2 of incompressible turbulence."""
    return 0.5 * shape_along(k) + 5.0 / 6.0 * k * k * (1.0 + k * k) ** (-11.0 / 6.0)


AREA = 2.0 * over_wavenumbers(shape_along)


def share(
    shape: Callable[[FloatArray], FloatArray], seen: Callable[[FloatArray], FloatArray]
) -> float:
    """Share of a component's variance that a weight on k/q lets through."""
    return 2.0 * over_wavenumbers(lambda k: shape(k) * seen(k)) / AREA


def taken(length: float) -> Callable[[FloatArray], FloatArray]:
    """What a filter of first order takes of the power."""
    return lambda k: (k * length) ** 2 / (1.0 + (k * length) ** 2)


def resonance(s: FloatArray, zeta: float) -> FloatArray:
    """1/|H|^2 of a vane."""
    return (1.0 - s * s) ** 2 + 4.0 * zeta**2 * s * s


def inertial_u(length: float, dissipation: float, alpha: float) -> float:
    """Variance [m^2/s^2] that a filter takes of k^-5/3 turbulence."""
    front = 9.0 / 55.0 * alpha * math.pow(dissipation, 2.0 / 3.0)
    return 2.0 * front * over_wavenumbers(lambda k: k ** (-5.0 / 3.0) * taken(length)(k))


def profile(ratio: float, stability: float) -> float:
    """kappa U/u_*: the logarithm less the integral of (1 - phi_m)/t."""

    def missing(t: float) -> float:
        return (1.0 - math.pow(1.0 - 16.0 * t, -1.0 / 3.0)) / t

    return math.log(ratio) - float(integrate.quad(missing, 0.0, stability, epsrel=1e-12)[0])


def shorn(stability: float) -> float:
    """phi_eps of an unstable layer."""
    return math.pow(1.0 - 16.0 * stability, -1.0 / 3.0) - stability


def structure_coefficient() -> float:
    """4 int (1 - cos x) F dx of a spectrum 9/55 x^-5/3."""
    near = integrate.quad(lambda x: (1.0 - math.cos(x)) * x ** (-5.0 / 3.0), 0.0, 1.0)[0]
    waves = integrate.quad(lambda x: x ** (-5.0 / 3.0), 1.0, math.inf, weight="cos", wvar=1.0)[0]
    return 36.0 / 55.0 * float(near + 1.5 - waves)


def braces(zeta: float, arm: float, mu2: float) -> float:
    """Of K94 (110): g and h from their integrals."""
    g = over_wavenumbers(lambda s: s ** (1.0 / 3.0) / resonance(s, zeta))
    h = over_wavenumbers(lambda s: s ** (7.0 / 3.0) / resonance(s, zeta))
    moving = mu2 * (arm**2 + 4.0 * zeta * arm) * g
    return (1.0 - mu2) * (4.0 * zeta**2 * g + h) - moving


def neutral_variance_lost(length: float, height: float, zeta: float) -> float:
    """<v^2> - U^2 <phi^2> over u_*^2 of a vane in the neutral surface layer."""
    front = 12.0 / 55.0 * ALPHA * math.pow(KAPPA * height, -2.0 / 3.0)

    def lost(k: FloatArray) -> FloatArray:
        s = k * length
        # 1 - 1/D without the cancellation at small s.
        gap = s**4 - 2.0 * (1.0 - 2.0 * zeta**2) * s * s
        return np.asarray(2.0 * front * k ** (-5.0 / 3.0) * gap / resonance(s, zeta))

    return over_wavenumbers(lost)


def gained_over_lost(slope: float, zeta: float) -> float:
    """Variance gained below the frequency of gain one over all the variance beyond it."""
    edge = math.sqrt(2.0 * (1.0 - 2.0 * zeta**2))

    def gained(s: float) -> float:
        return float(s**-slope * (1.0 / resonance(np.float64(s), zeta) - 1.0))

    area = integrate.quad(gained, 0.0, edge, points=[0.9], epsrel=1e-11)[0]
    return float(area) * (slope - 1.0) * math.pow(edge, slope - 1.0)


def root(function: Callable[[float], float], low: float, high: float) -> float:
    return float(optimize.brentq(function, low, high, xtol=1e-14, rtol=1e-14))


def propeller_vane_moments(length: float, zeta: float, arm: float, mu2: float) -> float:
    """Bias over <v^2>/U^2 by K94 (107), the vertical term left out."""
    direction = share(shape_across, lambda k: 1.0 / resonance(k * length, zeta))
    turning = share(shape_across, lambda k: (k * length) ** 2 / resonance(k * length, zeta))
    lag = (1.0 - mu2) * (direction - turning - 0.5 * direction)
    return lag + 0.5 * mu2 + mu2 * (0.5 * arm**2 + 2.0 * zeta * arm) * turning


def vane_loss(length: float, zeta: float) -> float:
    return 1.0 - share(shape_across, lambda k: 1.0 / resonance(k * length, zeta))


CUP = cup.CupConstants(0.2, 2.0, second_length=0.1, mu1=0.0, mu2=1.0)
LEANING = cup.CupConstants(0.2, 2.0, second_length=0.06, mu1=0.05, mu2=0.7)
ELEVATION = math.radians(25.0)
NEUTRAL_SPEED = math.log(12.0 / 0.05) / KAPPA
RATIOS = surface_layer.VarianceRatios(u=4.0, v=3.0, w=1.5)
RUN = cup_vane.vector_wind_run([0.0, 0.5 * math.pi], 1.0, 0.1, 1.0)
MEANS = pulses.mean_speed([1.0, 2.0], 0.1, 1.0)


def steady_cup() -> float:
    """Where the torque of K94 (2) vanishes, for a wind of 1 m/s."""
    h, w, lag = math.cos(ELEVATION), math.sin(ELEVATION), 0.3
    forcing = h + 0.05 * w
    return root(
        lambda y: (forcing - y) * (forcing + lag * y) / (1.0 + lag) + 0.5 * 0.7 * w * w, 0.5, 2.0
    )


def neutral_total() -> float:
    filtered = inertial_u(2.0, 1.0 / (KAPPA * 12.0), 1.7)
    across = 4.0 / 3.0 * 0.1**2 * filtered
    return (0.8 * (filtered + across) + 0.5 * 3.0 + 0.5 * 0.6 * 1.5) / NEUTRAL_SPEED**2


def stratified_total() -> float:
    """Of u alone, z = 8, z/z0 = 200, z/L = -0.3; eps and U in units of u_*."""
    speed = profile(200.0, -0.3) / KAPPA
    return 0.9 * inertial_u(1.5, shorn(-0.3) / (KAPPA * 8.0), ALPHA) / speed**2


def chi() -> float:
    seen = math.pow(shorn(-0.3), 2.0 / 3.0) / profile(200.0, -0.3) ** 2
    return 2.0 / 3.0 * ALPHA_1_KAPPA * seen


CHECKED: dict[str, tuple[Callable[[], object], Callable[[], float]]] = {
    "area of von Karman's spectrum": (lambda: von_karman.BETA_HALF_THIRD, lambda: AREA),
    "longitudinal spectrum": (
        lambda: von_karman.longitudinal_spectrum(0.6, 2.0, 0.3),
        lambda: 2.0 / 0.3 * 5.0 ** (-5.0 / 6.0) / AREA,
    ),
    "transverse spectrum": (
        lambda: von_karman.transverse_spectrum(0.6, 2.0, 0.3),
        lambda: 2.0 / 0.3 * float(shape_across(np.float64(2.0))) / AREA,
    ),
    "integral length": (
        lambda: von_karman.integral_length_from_wavenumber(0.02), lambda: math.pi / AREA / 0.02
    ),
    "longitudinal structure function of the inertial range": (
        lambda: inertial_range.LONGITUDINAL_STRUCTURE_COEFFICIENT, structure_coefficient
    ),
    "variance from the dissipation": (
        lambda: von_karman.variance_from_dissipation(1e-3, 0.01, 1.5),
        lambda: 9.0 / 55.0 * 1.5 * (1e-3 / 0.01) ** (2.0 / 3.0) * AREA,
    ),
    "shear in the stable layer": (lambda: surface_layer.wind_shear_function(0.4), lambda: 3.0),
    "shear in the unstable layer": (
        lambda: surface_layer.wind_shear_function(-7.0 / 16.0), lambda: 0.5
    ),
    "shear, the usual exponent": (
        lambda: surface_layer.wind_shear_function(-15.0 / 16.0, surface_layer.QUARTER),
        lambda: 0.5,
    ),
    "dissipation": (
        lambda: surface_layer.dissipation(0.4, 10.0, -7.0 / 16.0), lambda: 0.016 * 0.9375
    ),
    "speed of the profile": (
        lambda: surface_layer.mean_speed(0.3, 200.0, -0.3),
        lambda: 0.3 / KAPPA * profile(200.0, -0.3),
    ),
    "bias of the surface layer": (
        lambda: surface_layer.surface_layer_bias_function(200.0, -0.3), chi
    ),
    "loss of u in a cup": (
        lambda: filtered_turbulence.longitudinal_loss(0.4),
        lambda: share(shape_along, taken(0.4)),
    ),
    "loss of w in a cup": (
        lambda: filtered_turbulence.transverse_loss(0.4),
        lambda: share(shape_across, taken(0.4)),
    ),
    "variance that a cup shows": (
        lambda: speed_bias.filtered_variance_ratio(0.4),
        lambda: share(shape_along, lambda k: 1.0 / (1.0 + (0.4 * k) ** 2)),
    ),
    "loss with exponential correlation": (
        lambda: filtered_turbulence.exponential_loss(0.4),
        lambda: over_wavenumbers(lambda r: -np.expm1(-0.4 * r) * np.exp(-r)),
    ),
    "overspeeding in a wind tunnel": (
        lambda: speed_bias.isotropic_bias(0.3, 0.1, 0.8, 0.1, 0.6).total,
        lambda: 0.01 * (
            0.8 * share(shape_along, taken(0.3)) + 0.5
            + 0.8 * 0.01 * share(shape_across, taken(0.3)) + 0.3
        ),
    ),
    "overspeeding of small cups": (
        lambda: speed_bias.INERTIAL_COEFFICIENT, lambda: inertial_u(1.0, 1.0, 1.0)
    ),
    "overspeeding near the ground": (
        lambda: speed_bias.neutral_bias(2.0, 12.0, 0.05, RATIOS, 0.8, 0.1, 0.6).total,
        neutral_total,
    ),
    "its longitudinal coefficient": (
        lambda: speed_bias.neutral_longitudinal_coefficient(1.7, 0.4, 2.0),
        lambda: inertial_u(1.0, 2.5, 1.7) / 4.0,
    ),
    "overspeeding in a stratified layer": (
        lambda: speed_bias.diabatic_longitudinal_bias(1.5, 8.0, 200.0, -0.3, 0.9),
        stratified_total,
    ),
    "torque of a cup": (
        lambda: cup.angular_acceleration(20.0, 6.0, 1.0, CUP), lambda: 16.0 / 0.6 + 1.25
    ),
    "distance constant from inertia": (
        lambda: cup.distance_constant_from_inertia(3e-5, 1.2, 1.0, 0.0025, 0.05, 0.2, 0.1),
        lambda: 4.0 / 3.0,
    ),
    "factor": (lambda: cup.calibration_factor(0.2, 0.08), lambda: 2.5),
    "angular response of 2014": (
        lambda: cup.angular_response(math.pi / 3.0, 0.1, 0.5),
        lambda: 0.75 + 0.05 * math.sqrt(3.0),
    ),
    "angular response of 1994": (lambda: cup.steady_response(ELEVATION, LEANING), steady_cup),
    "speed that a cup feels": (lambda: cup.equivalent_speed(4.0, 3.0, 0.1, 0.5), lambda: 4.8),
    "share of the torque": (lambda: rotor_family.torque_share(0.2, 0.05), lambda: 0.8),
    "mean over the time": (lambda: MEANS.count_mean, lambda: 0.4 * math.pi / 3.0),
    "mean over the turns": (lambda: MEANS.arithmetic_mean, lambda: 0.15 * math.pi),
    "variance over the time": (
        lambda: MEANS.time_variance,
        lambda: math.pi**2 * ((0.04 + 2.0 * 0.01) / 3.0 - (0.4 / 3.0) ** 2),
    ),
    "loss of a vane near the ground": (
        lambda: vane_variance.neutral_relative_loss(0.5, 0.8, 9.0),
        lambda: neutral_variance_lost(0.8, 9.0, 0.5) / 2.68,
    ),
    "what resonance gives back": (
        lambda: vane_variance.recovered_fraction(1.8),
        lambda: gained_over_lost(1.8, math.cos(math.pi / 2.8)),
    ),
    "loss of a vane in von Karman turbulence": (
        lambda: vane_variance.von_karman_moments(0.3, 0.5).loss, lambda: vane_loss(0.3, 0.5)
    ),
    "propeller in oblique flow": (
        lambda: propeller.steady_response(ELEVATION, -0.7),
        lambda: root(
            lambda y: (math.cos(ELEVATION) - y) * y - 0.35 * math.sin(ELEVATION) ** 2, 0.5, 1.0
        ),
    ),
    "angle at which a propeller stops": (
        lambda: propeller.critical_angle(-0.7),
        lambda: root(lambda a: math.cos(a) ** 2 - 1.4 * math.sin(a) ** 2, 0.1, 1.5),
    ),
    "propeller with friction": (lambda: friction_propeller.steady_axial(2.0, 0.5), lambda: 1.875),
    "stalling speed": (
        lambda: friction_propeller.stall_speed_from_excess(1.0, 1.25), lambda: math.sqrt(0.2)
    ),
    "propeller-vane in a wind tunnel": (
        lambda: propeller_vane.von_karman_bias(0.3, 0.5, 0.4, -0.6, 0.1, 0.2).total,
        lambda: 0.01 * propeller_vane_moments(0.3, 0.5, 0.4, -0.6) - 0.5 * 0.6 * 0.04,
    ),
    "propeller-vane near the ground": (
        lambda: propeller_vane.surface_layer_delta(0.5, 0.4, -0.6, 0.8, 8.0, 200.0, -0.3),
        lambda: -braces(0.5, 0.4, -0.6) * chi() * 0.1 ** (2.0 / 3.0),
    ),
    "propeller-vane, constant of the neutral layer": (
        lambda: propeller_vane.neutral_constant(-0.5, RATIOS), lambda: 0.75
    ),
    "propeller-vane, slope of the neutral layer": (
        lambda: propeller_vane.neutral_slope(0.5, 0.4, -0.6),
        lambda: braces(0.5, 0.4, -0.6) * 4.0 / 3.0 * ALPHA_1_KAPPA / (KAPPA**2 * 2.68),
    ),
    "vector wind run": (lambda: RUN.speed, lambda: 0.2 * math.pi * math.sqrt(2.0)),
    "its heading": (lambda: RUN.heading, lambda: 0.25 * math.pi),
    "bias of the vector wind run": (
        lambda: cup_vane.vector_run_bias(
            (0.3, 0.3, 0.3), 0.2, 0.5, (0.1, 0.1, 0.1), 0.8
        ).total,
        lambda: 0.01 * (0.8 * share(shape_along, taken(0.3)) + 0.5 * vane_loss(0.2, 0.5)),
    ),
    "variance of two directions": (
        lambda: cup_vane.direction_variance([0.0, 0.5 * math.pi]), lambda: 0.5
    ),
    "period of a bivane": (lambda: bivane.damped_period(12.0, 4.0, 0.6), lambda: 3.75),
    "length of a bivane": (lambda: bivane.distance_constant(math.pi), lambda: 0.5),
    "bivane between two readings": (lambda: bivane.nyquist_gain(1.0), lambda: 3.0),
}


@pytest.mark.parametrize("name", sorted(CHECKED))
def test_a_formula_gives_what_its_definition_gives(name: str) -> None:
    of_the_library, of_its_definition = CHECKED[name]
    assert of_the_library() == pytest.approx(of_its_definition(), rel=2e-9)
