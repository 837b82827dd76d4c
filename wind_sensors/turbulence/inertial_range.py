"""Spectra and structure functions of the inertial subrange.

Spectra are two-sided over a line along the mean wind: <u^2> is the integral of F over all k,
positive and negative. Source: Kristensen, Hansen & Hansen (2014), (37) to (45).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

KOLMOGOROV_CONSTANT = 1.7
"""alpha of the three-dimensional energy spectrum, E = alpha eps^(2/3) k^(-5/3) [1]."""

LONGITUDINAL_STRUCTURE_COEFFICIENT = 27.0 / 55.0 * math.gamma(1.0 / 3.0)
"""D_L / (alpha (eps r)^(2/3)) [1], K14 (44)."""

TRANSVERSE_STRUCTURE_COEFFICIENT = 4.0 / 3.0 * LONGITUDINAL_STRUCTURE_COEFFICIENT
"""D_T / (alpha (eps r)^(2/3)) [1], K14 (45)."""


def one_sided_longitudinal_constant(alpha: float = KOLMOGOROV_CONSTANT) -> float:
    """alpha_1 = (18/55) alpha [1]: the one-sided longitudinal constant of K94 (53)."""
    return 18.0 / 55.0 * alpha


def kolmogorov_constant_from_one_sided(alpha_1: float) -> float:
    """alpha [1] from the one-sided longitudinal constant alpha_1 [1]."""
    return 55.0 / 18.0 * alpha_1


def longitudinal_spectrum(
    wavenumber: npt.ArrayLike, dissipation: float, alpha: float = KOLMOGOROV_CONSTANT
) -> FloatArray:
    """F_L(k) [m^3/s^2] for k > 0 [1/m], dissipation eps [m^2/s^3]; K14 (37)."""
    return 9.0 / 55.0 * energy_spectrum(wavenumber, dissipation, alpha)


def transverse_spectrum(
    wavenumber: npt.ArrayLike, dissipation: float, alpha: float = KOLMOGOROV_CONSTANT
) -> FloatArray:
    """F_T(k) [m^3/s^2] for k > 0 [1/m], dissipation eps [m^2/s^3]; K14 (38), K94 (53)."""
    return 12.0 / 55.0 * energy_spectrum(wavenumber, dissipation, alpha)


def energy_spectrum(
    wavenumber: npt.ArrayLike, dissipation: float, alpha: float = KOLMOGOROV_CONSTANT
) -> FloatArray:
    """E(k) [m^3/s^2] for k > 0 [1/m], dissipation eps [m^2/s^3]; K14 (39)."""
    k = np.asarray(wavenumber, dtype=np.float64)
    return np.asarray(alpha * math.pow(dissipation, 2.0 / 3.0) * k ** (-5.0 / 3.0))


def longitudinal_structure_function(
    separation: npt.ArrayLike, dissipation: float, alpha: float = KOLMOGOROV_CONSTANT
) -> FloatArray:
    """D_L(r) [m^2/s^2], r [m], dissipation eps [m^2/s^3]; K14 (44)."""
    r = np.asarray(separation, dtype=np.float64)
    return LONGITUDINAL_STRUCTURE_COEFFICIENT * alpha * (dissipation * r) ** (2.0 / 3.0)


def transverse_structure_function(
    separation: npt.ArrayLike, dissipation: float, alpha: float = KOLMOGOROV_CONSTANT
) -> FloatArray:
    """D_T(r) [m^2/s^2], r [m], dissipation eps [m^2/s^3]; K14 (45)."""
    return 4.0 / 3.0 * longitudinal_structure_function(separation, dissipation, alpha)
