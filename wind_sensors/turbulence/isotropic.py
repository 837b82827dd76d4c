"""Relations between the statistics of any isotropic, incompressible turbulence.

Source: Kristensen, Hansen & Hansen (2014), (22) to (36). Functions of one variable are passed as
callables or as values with their derivatives; spectra are two-sided over a line along the wind.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy import integrate

FloatArray = npt.NDArray[np.float64]


def transverse_spectrum(
    wavenumber: npt.ArrayLike, longitudinal: npt.ArrayLike, slope: npt.ArrayLike
) -> FloatArray:
    """F_T = (F_L - k F_L')/2 [m^3/s^2]; K14 (36).

    Args:
        wavenumber: k [1/m].
        longitudinal: F_L(k) [m^3/s^2].
        slope: dF_L/dk [m^4/s^2].
    """
    k = np.asarray(wavenumber, dtype=np.float64)
    return 0.5 * (
        np.asarray(longitudinal, dtype=np.float64) - k * np.asarray(slope, dtype=np.float64)
    )


def energy_spectrum(
    wavenumber: npt.ArrayLike, slope: npt.ArrayLike, curvature: npt.ArrayLike
) -> FloatArray:
    """E = k^3 d/dk [(1/k) dF_L/dk] = k^2 F_L'' - k F_L' [m^3/s^2], k > 0; K14 (35).

    Args:
        wavenumber: k [1/m].
        slope: dF_L/dk [m^4/s^2].
        curvature: d^2F_L/dk^2 [m^5/s^2].
    """
    k = np.asarray(wavenumber, dtype=np.float64)
    return k * k * np.asarray(curvature, dtype=np.float64) - k * np.asarray(slope, dtype=np.float64)


def transverse_from_longitudinal(
    separation: npt.ArrayLike, longitudinal: npt.ArrayLike, slope: npt.ArrayLike
) -> FloatArray:
    """R_T = R_L + (r/2) R_L', and likewise D_T from D_L; K14 (23), (28).

    Args:
        separation: r [m].
        longitudinal: R_L or D_L [m^2/s^2].
        slope: Its derivative by r [m/s^2].
    """
    r = np.asarray(separation, dtype=np.float64)
    return np.asarray(longitudinal, dtype=np.float64) + 0.5 * r * np.asarray(
        slope, dtype=np.float64
    )


def structure_tensor(
    separation: npt.ArrayLike, longitudinal: float, transverse: float
) -> FloatArray:
    """D_ij(r) = (D_L - D_T) r_i r_j / r^2 + D_T delta_ij [m^2/s^2], shape (3, 3).

    Args:
        separation: Vector r [m], shape (3,), not zero.
        longitudinal: D_L(|r|) [m^2/s^2].
        transverse: D_T(|r|) [m^2/s^2].
    """
    r = np.asarray(separation, dtype=np.float64)
    return (longitudinal - transverse) * np.outer(r, r) / float(r @ r) + transverse * np.eye(3)


def spectral_tensor(wavevector: npt.ArrayLike, energy: float) -> FloatArray:
    """Phi_ij(k) = E/(4 pi k^2) (delta_ij - k_i k_j/k^2) [m^5/s^2], shape (3, 3).

    Args:
        wavevector: k [1/m], shape (3,), not zero.
        energy: E(|k|) [m^3/s^2].
    """
    k = np.asarray(wavevector, dtype=np.float64)
    k2 = float(k @ k)
    return energy / (4.0 * math.pi * k2) * (np.eye(3) - np.outer(k, k) / k2)


def correlation_from_spectrum(
    spectrum: Callable[[FloatArray], FloatArray], separation: float
) -> float:
    """R(r) = 2 int_0^inf F cos(kr) dk [m^2/s^2] by quadrature; K14 (33).

    Args:
        spectrum: Two-sided F(k) [m^3/s^2].
        separation: r [m], positive.
    """
    value, _ = integrate.quad(
        lambda k: float(spectrum(np.asarray(k))),
        0.0,
        math.inf,
        weight="cos",
        wvar=separation,
        limlst=200,
        limit=400,
        epsabs=1e-12,
    )
    return 2.0 * float(value)


def integral_length(longitudinal_at_zero: float, variance: float) -> float:
    """L_u = pi F_L(0) / sigma^2 [m]; K14 (34)."""
    return math.pi * longitudinal_at_zero / variance
