"""von Karman's model of isotropic turbulence (Kristensen, Hansen & Hansen (2014), (46) to (54)).

All spectra are two-sided over a line along the mean wind. The model has two parameters, the
variance sigma^2 [m^2/s^2] and the wavenumber q [1/m]; R and D are correlation and structure
functions of the separation r [m].
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import special

FloatArray = npt.NDArray[np.float64]

BETA_HALF_THIRD = float(special.beta(0.5, 1.0 / 3.0))
"""B_0 = B(1/2, 1/3), K14 (49)."""

INTEGRAL_LENGTH_TIMES_WAVENUMBER = math.pi / BETA_HALF_THIRD
"""L_u q = pi / B_0; the printed K14 (52) lacks pi."""

PEAK_WAVENUMBER_RATIO = math.sqrt(1.5)
"""k/q at which k F_L is largest, K14 Fig. 2."""

_SERIES_LIMIT = 2.0
_SERIES_TERMS = 24
_STRUCTURE_COEFFICIENT = 2.0 ** (-2.0 / 3.0) * math.gamma(2.0 / 3.0) / math.gamma(4.0 / 3.0)


def wavenumber_from_integral_length(integral_length: float) -> float:
    """q [1/m] from the longitudinal integral length L_u [m]; K14 (52), corrected."""
    return INTEGRAL_LENGTH_TIMES_WAVENUMBER / integral_length


def integral_length_from_wavenumber(wavenumber_q: float) -> float:
    """Longitudinal integral length L_u [m] from q [1/m]; K14 (52), corrected."""
    return INTEGRAL_LENGTH_TIMES_WAVENUMBER / wavenumber_q


def variance_from_dissipation(dissipation: float, wavenumber_q: float, alpha: float) -> float:
    """sigma^2 [m^2/s^2] whose inertial subrange has dissipation eps [m^2/s^3]; K14 (49)."""
    return 9.0 / 55.0 * alpha * BETA_HALF_THIRD * math.pow(dissipation / wavenumber_q, 2.0 / 3.0)


def dissipation_from_variance(variance: float, wavenumber_q: float, alpha: float) -> float:
    """Dissipation eps [m^2/s^3] of the inertial subrange; K14 (49) solved for eps."""
    return wavenumber_q * float((variance * 55.0 / (9.0 * alpha * BETA_HALF_THIRD)) ** 1.5)


def longitudinal_spectrum(
    wavenumber: npt.ArrayLike, variance: float, wavenumber_q: float
) -> FloatArray:
    """F_L(k) [m^3/s^2]; K14 (50)."""
    x = np.asarray(wavenumber, dtype=np.float64) / wavenumber_q
    return variance / (BETA_HALF_THIRD * wavenumber_q) * (1.0 + x * x) ** (-5.0 / 6.0)


def transverse_spectrum(
    wavenumber: npt.ArrayLike, variance: float, wavenumber_q: float
) -> FloatArray:
    """F_T(k) [m^3/s^2]; K14 (51)."""
    x = np.asarray(wavenumber, dtype=np.float64) / wavenumber_q
    scale = 4.0 / 3.0 * variance / (BETA_HALF_THIRD * wavenumber_q)
    return scale * (x * x + 0.375) * (1.0 + x * x) ** (-11.0 / 6.0)


def energy_spectrum(wavenumber: npt.ArrayLike, variance: float, wavenumber_q: float) -> FloatArray:
    """Three-dimensional energy spectrum E(k) [m^3/s^2], k > 0; K14 (48)."""
    x = np.asarray(wavenumber, dtype=np.float64) / wavenumber_q
    scale = 55.0 / 9.0 * variance / (BETA_HALF_THIRD * wavenumber_q)
    return scale * x**4 * (1.0 + x * x) ** (-17.0 / 6.0)


def longitudinal_structure_function(
    separation: npt.ArrayLike, variance: float, wavenumber_q: float
) -> FloatArray:
    """D_L(r) = 2 [sigma^2 - R_L(r)] [m^2/s^2]; K14 (53)."""
    return 2.0 * variance * _decorrelation(separation, wavenumber_q, transverse=False)


def transverse_structure_function(
    separation: npt.ArrayLike, variance: float, wavenumber_q: float
) -> FloatArray:
    """D_T(r) = 2 [sigma^2 - R_T(r)] [m^2/s^2]; K14 (54). Slightly above 2 sigma^2 near qr = 5."""
    return 2.0 * variance * _decorrelation(separation, wavenumber_q, transverse=True)


def longitudinal_correlation(
    separation: npt.ArrayLike, variance: float, wavenumber_q: float
) -> FloatArray:
    """R_L(r) [m^2/s^2]; K14 (53)."""
    return variance * (1.0 - _decorrelation(separation, wavenumber_q, transverse=False))


def transverse_correlation(
    separation: npt.ArrayLike, variance: float, wavenumber_q: float
) -> FloatArray:
    """R_T(r) [m^2/s^2]; K14 (54)."""
    return variance * (1.0 - _decorrelation(separation, wavenumber_q, transverse=True))


def longitudinal_tail(cutoff: float, variance: float, wavenumber_q: float) -> float:
    """Variance [m^2/s^2] of the longitudinal component beyond |k| = cutoff [1/m], exact."""
    x2 = (cutoff / wavenumber_q) ** 2
    return variance * float(special.betainc(1.0 / 3.0, 0.5, 1.0 / (1.0 + x2)))


def transverse_tail(cutoff: float, variance: float, wavenumber_q: float) -> float:
    """Variance [m^2/s^2] of a transverse component beyond |k| = cutoff [1/m], exact.

    From F_T = (F_L - k F_L')/2 by parts: the tail is that of F_L plus cutoff F_L(cutoff).
    """
    edge = cutoff * float(longitudinal_spectrum(cutoff, variance, wavenumber_q))
    return longitudinal_tail(cutoff, variance, wavenumber_q) + edge


def _decorrelation(separation: npt.ArrayLike, wavenumber_q: float, transverse: bool) -> FloatArray:
    """1 - R/sigma^2: a power series where the Bessel form would cancel, the Bessel form beyond."""
    x = np.abs(np.asarray(separation, dtype=np.float64)) * wavenumber_q
    small = np.minimum(x, _SERIES_LIMIT)
    large = np.maximum(x, _SERIES_LIMIT)
    return np.where(
        x < _SERIES_LIMIT,
        _decorrelation_series(small, transverse),
        1.0 - _correlation_bessel(large, transverse),
    )


def _decorrelation_series(x: FloatArray, transverse: bool) -> FloatArray:
    """From K_nu = pi (I_-nu - I_nu) / (2 sin nu pi); R_T applies 1 + (r/2) d/dr term by term."""
    quarter = 0.25 * x * x
    total = np.zeros_like(x)
    rising = np.ones_like(x)
    falling = np.ones_like(x)
    front = _STRUCTURE_COEFFICIENT * x ** (2.0 / 3.0)
    for n in range(_SERIES_TERMS):
        odd = 2.0 / 3.0 + 2.0 * n
        weight_odd = 1.0 + 0.5 * odd if transverse else 1.0
        weight_even = 1.0 + n if transverse else 1.0
        total += weight_odd * front * rising
        if n > 0:
            total -= weight_even * falling
        rising = rising * quarter / ((n + 1) * (n + 4.0 / 3.0))
        falling = falling * quarter / ((n + 1) * (n + 2.0 / 3.0))
    return total


def _correlation_bessel(x: FloatArray, transverse: bool) -> FloatArray:
    gamma_third = math.gamma(1.0 / 3.0)
    correlation = (4.0 * x) ** (1.0 / 3.0) * special.kv(1.0 / 3.0, x) / gamma_third
    if transverse:
        correlation = correlation - (4.0 * x) ** (4.0 / 3.0) * special.kv(2.0 / 3.0, x) / (
            8.0 * gamma_third
        )
    return np.asarray(correlation, dtype=np.float64)
