"""Random Fourier modes of a stationary Gaussian process with a given spectrum."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def draw_modes(generator: np.random.Generator, modal_variance: FloatArray) -> ComplexArray:
    """Complex amplitudes a_j of sum_j Re[a_j exp(i k_j x)], j = 0..J.

    Args:
        generator: Source of randomness.
        modal_variance: Variance carried by each mode [m^2/s^2], shape (..., J + 1).

    Returns:
        Amplitudes with <|a_j|^2>/2 = modal variance; mode zero is real with <a_0^2> = variance.
    """
    pairs = generator.standard_normal((*modal_variance.shape, 2))
    amplitudes = np.sqrt(modal_variance) * (pairs[..., 0] + 1j * pairs[..., 1])
    amplitudes[..., 0] = np.sqrt(modal_variance[..., 0]) * pairs[..., 0, 0]
    return np.asarray(amplitudes)


def sum_modes(amplitudes: ComplexArray, count: int) -> FloatArray:
    """The periodic record sum_j Re[a_j exp(2 pi i j m/count)], m = 0..count - 1, by FFT.

    Args:
        amplitudes: a_j, shape (..., J + 1), J not above count/2.
        count: Number of samples.
    """
    spectrum = np.zeros((*amplitudes.shape[:-1], count // 2 + 1), dtype=np.complex128)
    used = amplitudes.shape[-1]
    spectrum[..., :used] = 0.5 * amplitudes
    spectrum[..., 0] *= 2.0
    if count % 2 == 0 and used > count // 2:
        spectrum[..., count // 2] *= 2.0
    return np.asarray(np.fft.irfft(spectrum, count, axis=-1) * count)


def modal_variances(spectrum: FloatArray, spacing: float) -> FloatArray:
    """Variance of each mode from a two-sided spectrum at k_j = j spacing.

    Args:
        spectrum: F(k_j) [m^3/s^2], j = 0..J, along the last axis.
        spacing: Mode spacing [1/m].

    Returns:
        2 F spacing, and F spacing for mode zero [m^2/s^2].
    """
    variance = 2.0 * spacing * spectrum
    variance[..., 0] *= 0.5
    return variance


def taper(half_length: int) -> FloatArray:
    """Rising half of the sine taper whose squares add to one at 50 % overlap, shape (n,)."""
    return np.sin(0.5 * math.pi * (np.arange(half_length) + 0.5) / half_length)
