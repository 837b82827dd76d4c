"""Overspeeding: bias of a cup's mean speed in turbulence, to second order, term by term.

Source: Kristensen, Hansen & Hansen (2014), (92) to (106), generalised by a4 = l/(l + Lambda) and
by the cross term of u and w that only isotropy removes. Biases are relative to the mean speed U.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.filtered_turbulence import longitudinal_loss, transverse_loss
from wind_sensors.turbulence import surface_layer
from wind_sensors.turbulence.inertial_range import KOLMOGOROV_CONSTANT
from wind_sensors.turbulence.quadrature import integrate_over_wavenumbers

FloatArray = npt.NDArray[np.float64]

INERTIAL_COEFFICIENT = 6.0 * math.sqrt(3.0) * math.pi / 55.0
"""delta_u = a4 * this * alpha (eps l0)^(2/3) / U^2; K14 (94)."""
INERTIAL_VERTICAL_COEFFICIENT = 4.0 / 3.0 * INERTIAL_COEFFICIENT
"""The same for mu1^2 times the vertical component; K14 (95)."""
INERTIAL_COEFFICIENT_ALPHA1 = math.pi / math.sqrt(3.0)
"""The same as `INERTIAL_COEFFICIENT` in terms of the one-sided constant alpha_1."""


class SpeedBias(NamedTuple):
    """Relative biases of a mean speed [1], by the velocity component that causes them.

    u: overspeeding by the rotor's faster spin-up; v: horizontal speed instead of its along-wind
    part; w: angular response; uw: skewness mu1 with correlated u and w.
    """

    u: float
    v: float
    w: float
    uw: float = 0.0

    @property
    def total(self) -> float:
        """Sum of the terms [1]."""
        return self.u + self.v + self.w + self.uw


def isotropic_bias(
    reduced_length: float, intensity: float, a4: float, mu1: float = 0.0, mu2: float = 0.0
) -> SpeedBias:
    """Bias in isotropic von Karman turbulence, as in a wind tunnel; K14 (104).

    Args:
        reduced_length: q l0 [1].
        intensity: sigma/U [1].
        a4: Share of the torque's slope that follows the wind.
        mu1, mu2: Angular response.
    """
    intensities = (intensity, intensity, intensity)
    lengths = (reduced_length, reduced_length, reduced_length)
    return anisotropic_bias(lengths, intensities, a4, mu1, mu2)


def anisotropic_bias(
    reduced_lengths: tuple[float, float, float],
    intensities: tuple[float, float, float],
    a4: float,
    mu1: float = 0.0,
    mu2: float = 0.0,
    lateral_variance_seen: float = 1.0,
) -> SpeedBias:
    """Bias when each component has its own variance and von Karman length; K14 (92), no uw term.

    Args:
        reduced_lengths: q l0 of u, v, w [1].
        intensities: sigma/U of u, v, w [1].
        a4: Share of the torque's slope that follows the wind.
        mu1, mu2: Angular response.
        lateral_variance_seen: Factor on the v term: 1 for a scalar mean, see `cup_vane` for the
            vector mean.
    """
    i_u, i_v, i_w = intensities
    loss_u = float(longitudinal_loss(reduced_lengths[0]))
    loss_w = float(transverse_loss(reduced_lengths[2])) if mu1 != 0.0 else 0.0
    return SpeedBias(
        u=a4 * loss_u * i_u**2,
        v=0.5 * lateral_variance_seen * i_v**2,
        w=(a4 * mu1**2 * loss_w + 0.5 * mu2) * i_w**2,
    )


def inertial_bias(
    distance_constant: float,
    dissipation: float,
    mean_speed: float,
    lateral_variance: float,
    vertical_variance: float,
    a4: float,
    mu1: float = 0.0,
    mu2: float = 0.0,
    alpha: float = KOLMOGOROV_CONSTANT,
) -> SpeedBias:
    """Bias for l0 much smaller than the integral length; K14 (96).

    Args:
        distance_constant: l0 [m].
        dissipation: eps [m^2/s^3].
        mean_speed: U [m/s].
        lateral_variance, vertical_variance: <v^2>, <w^2> [m^2/s^2].
        a4, mu1, mu2: Rotor.
        alpha: Kolmogorov constant [1].
    """
    speed2 = mean_speed**2
    filtered = (
        a4 * INERTIAL_COEFFICIENT * alpha * math.pow(dissipation * distance_constant, 2.0 / 3.0)
    ) / speed2
    return SpeedBias(
        u=filtered,
        v=0.5 * lateral_variance / speed2,
        w=4.0 / 3.0 * mu1**2 * filtered + 0.5 * mu2 * vertical_variance / speed2,
    )


def neutral_bias(
    distance_constant: float,
    height: float,
    roughness_length: float,
    ratios: surface_layer.VarianceRatios,
    a4: float,
    mu1: float = 0.0,
    mu2: float = 0.0,
    alpha: float = KOLMOGOROV_CONSTANT,
    kappa: float = surface_layer.VON_KARMAN_CONSTANT,
) -> SpeedBias:
    """Bias in the neutral surface layer; K14 (100).

    Args:
        distance_constant: l0 [m].
        height: z [m].
        roughness_length: z0 [m].
        ratios: Variances over u_*^2.
        a4, mu1, mu2: Rotor.
        alpha, kappa: Kolmogorov and von Karman constants [1].
    """
    speed = math.log(height / roughness_length) / kappa
    return inertial_bias(
        distance_constant, 1.0 / (kappa * height), speed, ratios.v, ratios.w, a4, mu1, mu2, alpha
    )


def neutral_longitudinal_coefficient(
    alpha: float = KOLMOGOROV_CONSTANT,
    kappa: float = surface_layer.VON_KARMAN_CONSTANT,
    sigma_u_ratio: float = 2.39,
) -> float:
    """c of delta_u = a4 c (1 + 4/3 mu1^2) <u^2>/U^2 (l0/z)^(2/3) [1]; K14 (102).

    Args:
        alpha, kappa: Kolmogorov and von Karman constants [1].
        sigma_u_ratio: sigma_u/u_* [1].
    """
    return INERTIAL_COEFFICIENT * alpha * math.pow(kappa, -2.0 / 3.0) / sigma_u_ratio**2


def diabatic_longitudinal_bias(
    distance_constant: float,
    height: float,
    height_ratio: float,
    stability: float,
    a4: float,
    mu1: float = 0.0,
    alpha1_kappa43: float = surface_layer.ALPHA1_KAPPA43,
    exponent: str = surface_layer.THIRD,
) -> float:
    """delta_u (with its mu1^2 part) in a stratified surface layer [1]; K14 (96) with K94 (118).

    Args:
        distance_constant: l0 [m].
        height: z [m].
        height_ratio: z/z0 [1].
        stability: z/L_MO [1].
        a4, mu1: Rotor.
        alpha1_kappa43: alpha_1 kappa^(4/3) [1].
        exponent: See `surface_layer.wind_shear_function`.
    """
    chi = float(
        surface_layer.surface_layer_bias_function(height_ratio, stability, alpha1_kappa43, exponent)
    )
    scale = math.pow(distance_constant / height, 2.0 / 3.0)
    return a4 * 1.5 * INERTIAL_COEFFICIENT_ALPHA1 * (1.0 + 4.0 / 3.0 * mu1**2) * chi * scale


def filtered_variance_ratio(reduced_length: npt.ArrayLike) -> FloatArray:
    """l^2 <s^2>/sigma_u^2 = 1 - phi_L(q l0) [1] for mu1 = 0; K94 (8)."""
    return 1.0 - longitudinal_loss(reduced_length)


def longitudinal_bias_from_spectra(
    spectrum_u: Callable[[FloatArray], FloatArray],
    distance_constant: float,
    mean_speed: float,
    a4: float,
    slowest: float,
    mu1: float = 0.0,
    spectrum_w: Callable[[FloatArray], FloatArray] | None = None,
    cospectrum_uw: Callable[[FloatArray], FloatArray] | None = None,
) -> float:
    """Filter part of the bias [1] for any spectra, with the cross term of u and w; K14 (92).

    Args:
        spectrum_u, spectrum_w: Two-sided F(k) [m^3/s^2], even in k.
        cospectrum_uw: Real part of F_uw(k) [m^3/s^2].
        distance_constant: l0 [m].
        mean_speed: U [m/s].
        a4, mu1: Rotor.
        slowest: Wavenumber below which the spectra are flat [1/m].
    """

    def integrand(k: FloatArray) -> FloatArray:
        total = spectrum_u(k)
        if spectrum_w is not None:
            total = total + mu1**2 * spectrum_w(k)
        if cospectrum_uw is not None:
            total = total + 2.0 * mu1 * cospectrum_uw(k)
        x2 = (k * distance_constant) ** 2
        return 2.0 * x2 / (1.0 + x2) * total

    corner = 1.0 / distance_constant
    integral = integrate_over_wavenumbers(integrand, min(slowest, corner), max(slowest, corner))
    return a4 * integral / mean_speed**2


def longitudinal_bias_from_structure_function(
    structure_function: Callable[[FloatArray], FloatArray],
    distance_constant: float,
    mean_speed: float,
    a4: float,
) -> float:
    """a4/(2 U^2) int D(r) exp(-r/l0) dr/l0 [1]; K14 (81), (92).

    Args:
        structure_function: D(r) [m^2/s^2], for mu1 != 0 the sum D_L + mu1^2 D_T + 2 mu1 D_uw.
        distance_constant: l0 [m].
        mean_speed: U [m/s].
        a4: Share of the torque's slope that follows the wind.
    """

    def integrand(x: FloatArray) -> FloatArray:
        return np.exp(-x) * structure_function(x * distance_constant)

    integral = integrate_over_wavenumbers(
        integrand, 1.0, 1.0, resonance_width=0.8, decades_below=20.0, decades_above=2.0
    )
    return a4 * integral / (2.0 * mean_speed**2)
