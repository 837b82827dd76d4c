"""Propeller-vane: a propeller on the nose of a vane, at a distance a upwind of its axis.

Source: Kristensen (1994), (90) to (128). The translation of the propeller by the turning vane,
the vane's lag and the propeller's angular response bias the mean speed. An axial rotor with
a4 = 0 (K94) adds no u-bias; a Jackson rotor adds a4 phi_L(q l0) I_u^2, which `a4` selects.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.filtered_turbulence import longitudinal_loss
from wind_sensors.instruments.periodic import PeriodicRate, periodic_rate
from wind_sensors.instruments.vane import transfer_function
from wind_sensors.instruments.vane_variance import (
    VaneMoments,
    g_integral,
    h_integral,
    neutral_loss_coefficient,
    von_karman_moments,
)
from wind_sensors.turbulence import surface_layer

FloatArray = npt.NDArray[np.float64]


class PropellerVaneBias(NamedTuple):
    """Relative biases of the mean speed [1] by cause; `total` is their sum.

    u: overspeeding of the rotor; lag: the vane trailing the wind; v, w: angular response to the
    lateral and vertical wind; translation: the propeller's own motion.
    """

    u: float
    lag: float
    v: float
    w: float
    translation: float

    @property
    def total(self) -> float:
        """Sum of the terms [1]."""
        return self.u + self.lag + self.v + self.w + self.translation


def relative_wind(
    along: npt.ArrayLike,
    lateral: npt.ArrayLike,
    vane_angle: npt.ArrayLike,
    vane_rate: npt.ArrayLike,
    arm: float,
) -> tuple[FloatArray, FloatArray]:
    """Axial and lateral wind at the propeller [m/s]; K94 (93).

    Args:
        along: U + u [m/s].
        lateral: v [m/s].
        vane_angle: phi, from the mean wind [rad].
        vane_rate: dphi/dt [rad/s].
        arm: a [m], propeller upwind of the vane's axis.
    """
    u = np.asarray(along, dtype=np.float64)
    v = np.asarray(lateral, dtype=np.float64)
    phi = np.asarray(vane_angle, dtype=np.float64)
    cosine, sine = np.cos(phi), np.sin(phi)
    axial = u * cosine + v * sine
    return axial, -u * sine + v * cosine + arm * np.asarray(vane_rate, dtype=np.float64)


def bias_from_moments(
    moments: VaneMoments,
    lateral_intensity: float,
    vertical_intensity: float,
    mu2: float,
    arm_ratio: float,
    damping_ratio: float,
    overspeeding: float = 0.0,
) -> PropellerVaneBias:
    """Bias from the vane's second moments; K94 (107).

    Args:
        moments: Moments over <v^2>.
        lateral_intensity, vertical_intensity: sigma_v/U, sigma_w/U [1].
        mu2: Curvature of the propeller's angular response.
        arm_ratio: a/l_v [1].
        damping_ratio: zeta.
        overspeeding: u-bias of the rotor [1], see `rotor_overspeeding`.
    """
    v2 = lateral_intensity**2
    arms = 0.5 * arm_ratio**2 + 2.0 * damping_ratio * arm_ratio
    return PropellerVaneBias(
        u=overspeeding,
        lag=(1.0 - mu2) * (moments.lateral - 0.5 * moments.direction) * v2,
        v=0.5 * mu2 * v2,
        w=0.5 * mu2 * vertical_intensity**2,
        translation=mu2 * arms * moments.turning * v2,
    )


def von_karman_bias(
    reduced_length: float,
    damping_ratio: float,
    arm_ratio: float,
    mu2: float,
    lateral_intensity: float,
    vertical_intensity: float,
    overspeeding: float = 0.0,
) -> PropellerVaneBias:
    """`bias_from_moments` in von Karman turbulence; K94 (107), (109) with K14 (51).

    Args:
        reduced_length: q l_v [1].
        damping_ratio, arm_ratio, mu2, lateral_intensity, vertical_intensity, overspeeding:
            As in `bias_from_moments`.
    """
    moments = von_karman_moments(reduced_length, damping_ratio)
    return bias_from_moments(
        moments,
        lateral_intensity,
        vertical_intensity,
        mu2,
        arm_ratio,
        damping_ratio,
        overspeeding,
    )


def rotor_overspeeding(a4: float, reduced_length: float, intensity: float) -> float:
    """a4 phi_L(q l0) I_u^2 [1]: 0 for the K94 rotor (a4 = 0), Jackson's for a4 = 1 (derived).

    Args:
        a4: Share of the torque's slope that follows the wind.
        reduced_length: q l0 [1].
        intensity: sigma_u/U [1].
    """
    return a4 * float(longitudinal_loss(reduced_length)) * intensity**2


def bias_weight(
    frequency: npt.ArrayLike, damping_ratio: float, arm_ratio: float, mu2: float
) -> FloatArray:
    """Weight [1] of F_v(k)/U^2, s = k l_v, in the bias integral over all k; K94 (108), (109)."""
    s2 = np.asarray(frequency, dtype=np.float64) ** 2
    denominator = (1.0 - s2) ** 2 + 4.0 * damping_ratio**2 * s2
    lag = 0.5 * (1.0 - mu2) * s2 * (s2 + 4.0 * damping_ratio**2)
    moving = 0.5 * mu2 * (arm_ratio**2 + 4.0 * damping_ratio * arm_ratio) * s2
    return 0.5 + (moving - lag) / denominator


def inertial_braces(damping_ratio: float, arm_ratio: float, mu2: float) -> float:
    """(1 - mu2)(4 zeta^2 g + h) - mu2 (abar^2 + 4 zeta abar) g [1]; K94 (110), (114).

    Args:
        damping_ratio: zeta.
        arm_ratio: abar = a/l_v [1].
        mu2: Curvature of the angular response.
    """
    g = g_integral(damping_ratio)
    h = h_integral(damping_ratio)
    moving = mu2 * (arm_ratio**2 + 4.0 * damping_ratio * arm_ratio) * g
    return (1.0 - mu2) * (4.0 * damping_ratio**2 * g + h) - moving


def inertial_delta(
    damping_ratio: float,
    arm_ratio: float,
    mu2: float,
    distance_constant: float,
    dissipation: float,
    alpha_1: float,
    mean_speed: float,
) -> float:
    """delta_pv = -{..} (2/3) alpha_1 (eps l_v)^(2/3)/U^2 [1]; K94 (110), (117).

    Args:
        damping_ratio, arm_ratio, mu2: As in `inertial_braces`.
        distance_constant: l_v [m].
        dissipation: eps [m^2/s^3].
        alpha_1: One-sided longitudinal constant.
        mean_speed: U [m/s].
    """
    scale = math.pow(dissipation * distance_constant, 2.0 / 3.0) / mean_speed**2
    return -inertial_braces(damping_ratio, arm_ratio, mu2) * 2.0 / 3.0 * alpha_1 * scale


def surface_layer_delta(
    damping_ratio: float,
    arm_ratio: float,
    mu2: float,
    distance_constant: float,
    height: float,
    height_ratio: float,
    stability: float,
    alpha1_kappa43: float = surface_layer.ALPHA1_KAPPA43,
    exponent: str = surface_layer.THIRD,
) -> float:
    """delta_pv = -{..} chi_pv(z/z0, z/L) (l_v/z)^(2/3) [1]; K94 (126), (128).

    Args:
        damping_ratio, arm_ratio, mu2: As in `inertial_braces`.
        distance_constant: l_v [m].
        height: z [m].
        height_ratio: z/z0 [1].
        stability: z/L_MO [1].
        alpha1_kappa43: alpha_1 kappa^(4/3) [1].
        exponent: See `surface_layer.wind_shear_function`.
    """
    chi = float(
        surface_layer.surface_layer_bias_function(height_ratio, stability, alpha1_kappa43, exponent)
    )
    scale = math.pow(distance_constant / height, 2.0 / 3.0)
    return -inertial_braces(damping_ratio, arm_ratio, mu2) * chi * scale


def neutral_constant(
    mu2: float, ratios: surface_layer.VarianceRatios = surface_layer.KRISTENSEN_1994_RATIOS
) -> float:
    """1 + mu2 <w^2>/<v^2> [1], the first constant of K94 (114)."""
    return 1.0 + ratios.w / ratios.v * mu2


def neutral_slope(
    damping_ratio: float, arm_ratio: float, mu2: float, coefficient: float | None = None
) -> float:
    """Factor of -(l_v/z)^(2/3) in K94 (114), (116) [1].

    Args:
        damping_ratio, arm_ratio, mu2: As in `inertial_braces`.
        coefficient: `vane_variance.neutral_loss_coefficient` of other constants than K94's [1].
    """
    factor = neutral_loss_coefficient() if coefficient is None else coefficient
    return factor * inertial_braces(damping_ratio, arm_ratio, mu2)


def neutral_relative_bias(
    damping_ratio: float,
    arm_ratio: float,
    mu2: float,
    distance_constant: float,
    height: float,
    ratios: surface_layer.VarianceRatios = surface_layer.KRISTENSEN_1994_RATIOS,
    coefficient: float | None = None,
) -> float:
    """delta/(<v^2>/(2 U^2)) [1] in the neutral surface layer; K94 (114), (116).

    Args:
        damping_ratio, arm_ratio, mu2: As in `inertial_braces`.
        distance_constant: l_v [m].
        height: z [m].
        ratios: Variances over u_*^2.
        coefficient: As in `neutral_slope`.
    """
    scale = math.pow(distance_constant / height, 2.0 / 3.0)
    slope = neutral_slope(damping_ratio, arm_ratio, mu2, coefficient)
    return neutral_constant(mu2, ratios) - slope * scale


def rate_in_lateral_gusts(
    amplitude: float,
    reduced_frequency: float,
    damping_ratio: float,
    arm_ratio: float,
    mu2: float,
    response_length_ratio: float,
    a4: float = 0.0,
) -> PeriodicRate:
    """l s/U in v = A U sin(theta): linear vane, exact kinematics, nonlinear rotor.

    Args:
        amplitude: A [1].
        reduced_frequency: k l_v [1], theta = k U t.
        damping_ratio: zeta.
        arm_ratio: a/l_v [1].
        mu2: Curvature of the angular response.
        response_length_ratio: l0/l_v [1].
        a4: Share of the torque's slope that follows the wind (0: K94).

    Raises:
        ValueError: If no positive periodic rate exists.
    """
    response = complex(transfer_function(reduced_frequency, damping_ratio))

    def wind(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        wave = amplitude * response * np.exp(1j * theta)
        # (a/U) dphi/dt = (a/l_v) (k l_v) dphi/dtheta.
        rate = arm_ratio * reduced_frequency * np.real(wave)
        return relative_wind(1.0, amplitude * np.sin(theta), np.imag(wave), rate, 1.0)

    return periodic_rate(
        lambda theta: wind(theta)[0],
        a4,
        reduced_frequency * response_length_ratio,
        lambda theta: 0.5 * mu2 * wind(theta)[1] ** 2,
    )


def bias_from_spectrum(
    spectrum: Callable[[FloatArray], FloatArray],
    wavenumbers: FloatArray,
    distance_constant: float,
    damping_ratio: float,
    arm_ratio: float,
    mu2: float,
    mean_speed: float,
) -> float:
    """v part of the bias [1] from a spectrum known between two wavenumbers; K94 (108).

    Args:
        spectrum: Two-sided F_v(k) [m^3/s^2].
        wavenumbers: Increasing k > 0 [1/m], shape (n,); integrated by the trapezoidal rule.
        distance_constant: l_v [m].
        damping_ratio, arm_ratio, mu2: As in `inertial_braces`.
        mean_speed: U [m/s].
    """
    weight = bias_weight(wavenumbers * distance_constant, damping_ratio, arm_ratio, mu2)
    density = 2.0 * weight * spectrum(wavenumbers) / mean_speed**2
    steps = np.diff(wavenumbers)
    return math.fsum(0.5 * (density[1:] + density[:-1]) * steps)
