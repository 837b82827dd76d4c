"""The vane as a meter of the lateral variance: what its inertia removes and resonance adds.

Source: Kristensen (1994), (52) to (82) and (102) to (106). Spectra are two-sided,
s = k l_v, D(s) = (1 - s^2)^2 + 4 zeta^2 s^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import integrate

from wind_sensors.instruments.vane import inverse_gain_squared
from wind_sensors.turbulence import surface_layer, von_karman
from wind_sensors.turbulence.quadrature import integrate_over_wavenumbers

FloatArray = npt.NDArray[np.float64]

INERTIAL_SLOPE = 5.0 / 3.0
"""beta of the inertial subrange, F_v = A k^-beta."""


class VaneMoments(NamedTuple):
    """Second moments of a vane in turbulence, over the lateral variance <v^2> [1].

    direction: U^2 <phi^2>; lateral: U <v phi>; turning: l_v^2 <(dphi/dx)^2>; loss: 1 - direction.
    """

    direction: float
    lateral: float
    turning: float
    loss: float


def g_integral(damping_ratio: float, slope: float = INERTIAL_SLOPE) -> float:
    """g_beta = int_0^inf s^(2 - beta)/D ds [1]; K94 (55), (57), (77).

    Args:
        damping_ratio: zeta, positive.
        slope: beta, between 1 and 3.

    Raises:
        ValueError: If an argument is out of range.
    """
    return _front(slope, damping_ratio) * _sine_ratio(1.0 - slope, damping_ratio)


def h_integral(damping_ratio: float, slope: float = INERTIAL_SLOPE) -> float:
    """h_beta = int_0^inf s^(4 - beta)/D ds [1]; K94 (56), (58), (77). Arguments: `g_integral`."""
    return _front(slope, damping_ratio) * _sine_ratio(slope - 3.0, damping_ratio)


def loss_integral(damping_ratio: float, slope: float = INERTIAL_SLOPE) -> float:
    """Delta_beta = h - 2 (1 - 2 zeta^2) g [1]; K94 (59), (79). Arguments: `g_integral`.

    The variance lost is 2 A l_v^(beta - 1) Delta_beta for F_v = A |k|^-beta.
    """
    return -_front(slope, damping_ratio) * _sine_ratio(1.0 + slope, damping_ratio)


def damping_without_loss(slope: float = INERTIAL_SLOPE) -> float:
    """zeta_0 = cos(pi/(beta + 1)) [1]: no net loss of variance; K94 (80)."""
    return math.sin(0.5 * math.pi * (slope - 1.0) / (slope + 1.0))


def crossing(slope: float = INERTIAL_SLOPE) -> float:
    """s_c = sqrt(2 (1 - 2 zeta_0^2)): where |H| = 1 at zeta_0 [1]; K94 (81), corrected limit."""
    return math.sqrt(2.0 * math.sin(0.5 * math.pi * (3.0 - slope) / (slope + 1.0)))


def crossing_as_printed(slope: float = INERTIAL_SLOPE) -> float:
    """2 sin(pi/(2 (beta + 1))) [1]: the limit printed in K94 (81), right at beta = 2 only."""
    return 2.0 * math.sin(0.5 * math.pi / (slope + 1.0))


def recovered_fraction(slope: float = INERTIAL_SLOPE) -> float:
    """D(beta) [1]: variance regained by resonance over the true variance beyond s_c; K94 (81).

    Args:
        slope: beta, between 1 and 3.

    Raises:
        ValueError: If beta is out of range.
    """
    _check_slope(slope)
    zeta = damping_without_loss(slope)
    edge = crossing(slope)
    power = 1.0 / (3.0 - slope)

    # s = s_c t with t = x^(1/(3 - beta)) removes the end-point singularity of s^(2 - beta).
    def integrand(x: float) -> float:
        t = math.pow(x, power)
        return (1.0 - t * t) / float(inverse_gain_squared(edge * t, zeta))

    peak = math.sqrt(1.0 - 2.0 * zeta * zeta) / edge if zeta < math.sqrt(0.5) else 0.5
    points = [peak ** (3.0 - slope)] if 0.0 < peak < 1.0 else None
    integral, _ = integrate.quad(
        integrand, 0.0, 1.0, points=points, limit=800, epsabs=0.0, epsrel=1e-13
    )
    return (slope - 1.0) / (3.0 - slope) * edge**4 * float(integral)


def recovered_fraction_as_printed(slope: float = INERTIAL_SLOPE) -> float:
    """D(beta) [1] with the integration limit printed in K94 (81), to show what it does.

    Args:
        slope: beta, between 1 and 3.

    Raises:
        ValueError: If beta is out of range.
    """
    _check_slope(slope)
    zeta = damping_without_loss(slope)
    edge = crossing_as_printed(slope)

    # s = edge/t maps the infinite range to (0, 1).
    def integrand(t: float) -> float:
        return (1.0 - 1.0 / float(inverse_gain_squared(edge / t, zeta))) * math.pow(t, slope - 2.0)

    integral, _ = integrate.quad(integrand, 0.0, 1.0, limit=800, epsabs=1e-12, epsrel=1e-10)
    return (slope - 1.0) * float(integral)


def inertial_loss(
    distance_constant: float, damping_ratio: float, dissipation: float, alpha_1: float
) -> float:
    """<v^2> - U^2 <phi^2> [m^2/s^2] for l_v much smaller than the integral length; K94 (54).

    Args:
        distance_constant: l_v [m].
        damping_ratio: zeta.
        dissipation: eps [m^2/s^3].
        alpha_1: One-sided longitudinal constant [1].
    """
    scale = math.pow(dissipation * distance_constant, 2.0 / 3.0)
    return 4.0 / 3.0 * alpha_1 * scale * loss_integral(damping_ratio)


def neutral_loss_coefficient(
    alpha1_kappa43: float = surface_layer.ALPHA1_KAPPA43,
    kappa: float = surface_layer.VON_KARMAN_CONSTANT,
    lateral_ratio: float = surface_layer.KRISTENSEN_1994_RATIOS.v,
) -> float:
    """c of (relative loss) = c Delta(zeta) (l_v/z)^(2/3) [1]; K94 (73).

    Args:
        alpha1_kappa43: alpha_1 kappa^(4/3) [1].
        kappa: von Karman constant [1].
        lateral_ratio: <v^2>/u_*^2 [1].
    """
    return 4.0 / 3.0 * alpha1_kappa43 / (kappa * kappa * lateral_ratio)


def neutral_relative_loss(
    damping_ratio: float,
    distance_constant: float,
    height: float,
    coefficient: float | None = None,
) -> float:
    """1 - U^2 <phi^2>/<v^2> [1] in the neutral surface layer; K94 (73).

    Args:
        damping_ratio: zeta.
        distance_constant: l_v [m].
        height: z [m].
        coefficient: `neutral_loss_coefficient` of other constants than K94's [1].
    """
    scale = math.pow(distance_constant / height, 2.0 / 3.0)
    factor = neutral_loss_coefficient() if coefficient is None else coefficient
    return factor * loss_integral(damping_ratio) * scale


def moments(
    spectrum: Callable[[FloatArray], FloatArray],
    variance: float,
    distance_constant: float,
    damping_ratio: float,
    slowest: float,
) -> VaneMoments:
    """Second moments in turbulence of any lateral spectrum; K94 (52), (102) to (106).

    Args:
        spectrum: Two-sided F_v(k) [m^3/s^2], even in k.
        variance: <v^2> [m^2/s^2].
        distance_constant: l_v [m].
        damping_ratio: zeta, positive.
        slowest: Wavenumber below which F_v is flat [1/m].
    """
    corner = 1.0 / distance_constant
    zeta = damping_ratio
    width = math.asin(min(1.0, zeta)) if zeta <= 1.0 else 0.5 * math.pi
    # Overdamped: two real poles, at s = 1/(2 zeta) and 2 zeta roughly.
    spread = max(1.0, 2.0 * zeta)
    low = min(slowest, corner / spread)
    high = max(slowest, corner * spread)

    def total(weight: Callable[[FloatArray], FloatArray]) -> float:
        def integrand(k: FloatArray) -> FloatArray:
            s = k * distance_constant
            return 2.0 * weight(s) / inverse_gain_squared(s, zeta) * spectrum(k)

        return integrate_over_wavenumbers(integrand, low, high, resonance_width=width) / variance

    turning = total(lambda s: s * s)
    direction = total(np.ones_like)
    loss = total(lambda s: s**4 - 2.0 * (1.0 - 2.0 * zeta * zeta) * s * s)
    return VaneMoments(direction=direction, lateral=direction - turning, turning=turning, loss=loss)


def von_karman_moments(reduced_length: float, damping_ratio: float) -> VaneMoments:
    """`moments` for the transverse von Karman spectrum, K14 (51).

    Args:
        reduced_length: q l_v [1], q that of the longitudinal integral length.
        damping_ratio: zeta, positive.
    """
    return moments(
        lambda k: von_karman.transverse_spectrum(k, 1.0, 1.0),
        1.0,
        reduced_length,
        damping_ratio,
        1.0,
    )


def _front(slope: float, damping_ratio: float) -> float:
    """C_beta / zeta, with cos(beta pi/2) in the form that stays exact at both ends."""
    _check_slope(slope)
    if damping_ratio <= 0.0:
        raise ValueError("the variance integrals diverge for a vane without damping")
    if slope < 2.0:
        cosine = -math.sin(0.5 * math.pi * (slope - 1.0))
    else:
        cosine = -math.sin(0.5 * math.pi * (3.0 - slope))
    return 0.25 * math.pi / (cosine * damping_ratio)


def _sine_ratio(order: float, damping_ratio: float) -> float:
    """sin(n x)/sin(x), x = arccos zeta, continued through zeta = 1 to hyperbolic sines."""
    if damping_ratio == 1.0:
        return order
    if damping_ratio < 1.0:
        x = math.acos(damping_ratio)
        return math.sin(order * x) / math.sin(x)
    x = math.acosh(damping_ratio)
    return math.sinh(order * x) / math.sinh(x)


def _check_slope(slope: float) -> None:
    if not 1.0 < slope < 3.0:
        raise ValueError(f"the spectral slope must lie between 1 and 3, not {slope}")
