"""Wind profile, dissipation and variances in the atmospheric surface layer.

Source: Kristensen (1994), (114) to (128). The pair (123)/(124) uses the exponent -1/3; the more
usual -1/4 with its own integral is selected by `exponent`. Heights in m; stability is z/L_MO.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

VON_KARMAN_CONSTANT = 0.4
"""kappa [1]."""
ALPHA1_KAPPA43 = 0.165
"""alpha_1 kappa^(4/3) [1], the value of K94."""

THIRD = "third"
"""Exponent -1/3 of K94 (123) with (124)."""
QUARTER = "quarter"
"""Exponent -1/4 with Paulson's integral."""


@dataclass(frozen=True)
class VarianceRatios:
    """Variances of the three components over u_*^2 [1]."""

    u: float
    v: float
    w: float


KRISTENSEN_1994_RATIOS = VarianceRatios(u=4.773, v=2.68, w=1.46)
"""Neutral; v and w as in K94, u the integral of the companion Kaimal form."""
PANOFSKY_DUTTON_RATIOS = VarianceRatios(u=2.39**2, v=1.92**2, w=1.25**2)
"""Neutral; K14 (101) and the same source."""


def wind_shear_function(stability: npt.ArrayLike, exponent: str = THIRD) -> FloatArray:
    """phi_m(z/L) [1]; K94 (123).

    Args:
        stability: z/L_MO [1].
        exponent: `THIRD` (K94) or `QUARTER` (the usual one), for unstable stratification.

    Raises:
        ValueError: If the exponent is unknown.
    """
    t = np.asarray(stability, dtype=np.float64)
    power = _exponent(exponent)
    return np.where(t > 0.0, 1.0 + 5.0 * t, (1.0 + 16.0 * np.maximum(-t, 0.0)) ** (-power))


def profile_correction(stability: npt.ArrayLike, exponent: str = THIRD) -> FloatArray:
    """psi_m(z/L) [1]: integral of (1 - phi_m)/t from 0; K94 (121), (124), (125).

    Args:
        stability: z/L_MO [1].
        exponent: As in `wind_shear_function`; each has its own exact integral.

    Raises:
        ValueError: If the exponent is unknown.
    """
    t = np.asarray(stability, dtype=np.float64)
    unstable = 16.0 * np.maximum(-t, 0.0)
    power = _exponent(exponent)
    xi = (1.0 + unstable) ** power
    # (1+x)^p - 1 without the cancellation at small |z/L|.
    excess = np.expm1(power * np.log1p(unstable))
    if exponent == THIRD:
        psi = 1.5 * np.log1p(excess * (xi + 2.0) / 3.0) - math.sqrt(3.0) * np.arctan(
            excess / (math.sqrt(3.0) * (xi + 1.0))
        )
    else:
        psi = (
            2.0 * np.log1p(0.5 * excess)
            + np.log1p(0.5 * excess * (xi + 1.0))
            - 2.0 * np.arctan(excess / (1.0 + xi))
        )
    return np.where(t > 0.0, -5.0 * t, psi)


def dissipation_function(stability: npt.ArrayLike, exponent: str = THIRD) -> FloatArray:
    """phi_eps = phi_m - z/L [1]; K94 (120)."""
    return wind_shear_function(stability, exponent) - np.asarray(stability, dtype=np.float64)


def dissipation(
    friction_velocity: npt.ArrayLike,
    height: npt.ArrayLike,
    stability: npt.ArrayLike = 0.0,
    kappa: float = VON_KARMAN_CONSTANT,
    exponent: str = THIRD,
) -> FloatArray:
    """eps = u_*^3 phi_eps / (kappa z) [m^2/s^3]; K94 (118)."""
    u_star = np.asarray(friction_velocity, dtype=np.float64)
    return u_star**3 / (kappa * np.asarray(height)) * dissipation_function(stability, exponent)


def profile_factor(
    height_ratio: npt.ArrayLike, stability: npt.ArrayLike = 0.0, exponent: str = THIRD
) -> FloatArray:
    """kappa U / u_* = ln(z/z0) - psi_m [1]; K94 (119).

    Args:
        height_ratio: z/z0 [1].
        stability: z/L_MO [1].
        exponent: As in `wind_shear_function`.
    """
    ratio = np.asarray(height_ratio, dtype=np.float64)
    return np.log(ratio) - profile_correction(stability, exponent)


def mean_speed(
    friction_velocity: npt.ArrayLike,
    height_ratio: npt.ArrayLike,
    stability: npt.ArrayLike = 0.0,
    kappa: float = VON_KARMAN_CONSTANT,
    exponent: str = THIRD,
) -> FloatArray:
    """U(z) [m/s] from u_* [m/s], z/z0 [1] and z/L_MO [1]; K94 (119)."""
    factor = profile_factor(height_ratio, stability, exponent)
    return np.asarray(friction_velocity, dtype=np.float64) / kappa * factor


def friction_velocity(
    speed: npt.ArrayLike,
    height_ratio: npt.ArrayLike,
    stability: npt.ArrayLike = 0.0,
    kappa: float = VON_KARMAN_CONSTANT,
    exponent: str = THIRD,
) -> FloatArray:
    """u_* [m/s] from U(z) [m/s]; K94 (119) solved for u_*."""
    factor = profile_factor(height_ratio, stability, exponent)
    return kappa * np.asarray(speed, dtype=np.float64) / factor


def friction_velocity_from_flux(uw_covariance: npt.ArrayLike) -> FloatArray:
    """u_* = sqrt(-<uw>) [m/s]; K14 (98). NaN for an upward flux."""
    flux = np.asarray(uw_covariance, dtype=np.float64)
    return np.sqrt(np.where(flux <= 0.0, -flux, np.nan))


def surface_layer_bias_function(
    height_ratio: npt.ArrayLike,
    stability: npt.ArrayLike = 0.0,
    alpha1_kappa43: float = ALPHA1_KAPPA43,
    exponent: str = THIRD,
) -> FloatArray:
    """chi_pv(z/z0, z/L) [1]; K94 (127) with alpha_1 where phi_1 is printed.

    The bias of an instrument of length l at height z is chi_pv (l/z)^(2/3) times a constant.
    """
    factor = profile_factor(height_ratio, stability, exponent)
    return (
        2.0
        / 3.0
        * alpha1_kappa43
        * dissipation_function(stability, exponent) ** (2.0 / 3.0)
        / factor**2
    )


def _exponent(exponent: str) -> float:
    if exponent == THIRD:
        return 1.0 / 3.0
    if exponent == QUARTER:
        return 0.25
    raise ValueError(f"exponent must be {THIRD!r} or {QUARTER!r}, not {exponent!r}")
