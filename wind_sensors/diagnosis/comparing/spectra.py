"""Residual series in the cosine domain: shrinking to what the reference can know, whitening.

The cosine transform (DCT-II) of a stationary residual has nearly independent coefficients whose
variance is its spectrum, and unlike the Fourier transform it does not wrap the end of the record
to its beginning. Everything linear that the diagnosis does to a series (shrinking, whitening) is a
multiplication in that domain.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.fft import dct, idct

FloatArray = npt.NDArray[np.float64]

_BAND_RATIO = 1.35
_FIRST_BAND = 6
_CHI_SQUARE_MEDIAN = 0.4549
_LEAST = 1e-12

CHANCE_EVIDENCE = 9.0
SHARP = 4.0
WIDE_BAND = 50
"""Twice the log-likelihood ratio that one band in 400 without coherence reaches, how sharply less
counts as none, and from how many coefficients on: the slope would follow from chance, and whatever
makes a simulated signal quieter there would seem to explain it better."""

LEAST_USUAL = 0.1
"""Share of the noise above the slow coefficients that chance is not taken to make."""

_CAP = 4.0
_CAPPED_MEAN = 0.9205
_TURNS = 4
"""A square counts up to so many times the variance, so that a line does not raise it; mean of what
then counts of a normal number; turns in which the variance settles, from the median on. A mean of
such squares needs two fifths of the numbers that a median needs to be as sure."""

_ENOUGH = 200.0
"""Bands with fewer coefficients are smoothed with their neighbours: what is unsure about the noise
there would come and go with what is simulated, and decide between explanations."""


_QUICK_FACTORS = (2, 3, 5, 7, 11, 13, 17, 19, 23)
"""A length with a large prime factor takes the cosine transform up to ten times as long."""


def quick_length(n: int) -> int:
    """Longest series up to n samples that is quickly transformed; beyond 1000 samples it is
    shorter by 2 % at most. Bins that much wider cover the same time.

    Args:
        n: At least 1.
    """
    while not _is_quick(n):
        n -= 1
    return n


def _is_quick(n: int) -> bool:
    for factor in _QUICK_FACTORS:
        while n % factor == 0:
            n //= factor
    return n == 1


def to_cosine(series: FloatArray) -> FloatArray:
    """Orthonormal DCT-II along the last axis."""
    return np.asarray(dct(series, type=2, norm="ortho", axis=-1), dtype=np.float64)


def from_cosine(coefficients: FloatArray) -> FloatArray:
    """Inverse of `to_cosine`."""
    return np.asarray(idct(coefficients, type=2, norm="ortho", axis=-1), dtype=np.float64)


def cosine_frequencies(n: int, dt: float) -> FloatArray:
    """Frequencies of the n coefficients [Hz]."""
    return np.arange(n) / (2.0 * n * dt)


@lru_cache(maxsize=64)
def coefficients_within(n: int, dt: float, low: float, high: float) -> slice:
    """Which of n coefficients have frequencies from `low` up to, but not at, `high` [Hz]."""
    first, last = np.searchsorted(cosine_frequencies(n, dt), (low, high))
    return slice(int(first), max(int(first), int(last)))


def band_edges(n: int) -> npt.NDArray[np.intp]:
    """First coefficient of each band, then n; bands grow geometrically with frequency."""
    edges = [0, _FIRST_BAND]
    while edges[-1] < n:
        edges.append(min(n, max(edges[-1] + _FIRST_BAND, int(edges[-1] * _BAND_RATIO))))
    if len(edges) > 2 and edges[-1] - edges[-2] < _FIRST_BAND:
        edges.pop(-2)
    return np.asarray(edges, dtype=np.intp)


def band_means(values: FloatArray, edges: npt.NDArray[np.intp]) -> FloatArray:
    """Mean of `values` within each band."""
    sums = np.add.reduceat(values, edges[:-1])
    return np.asarray(sums / np.diff(edges), dtype=np.float64)


def band_medians(values: FloatArray, edges: npt.NDArray[np.intp]) -> FloatArray:
    """Median of `values` within each band."""
    return np.array(
        [np.median(values[a:b]) for a, b in itertools.pairwise(edges)]
    )


def robust_band_variances(squares: FloatArray, edges: npt.NDArray[np.intp]) -> FloatArray:
    """Variance within each band, which a few large squares do not raise."""
    number = np.diff(edges)
    variance = band_medians(squares, edges) / _CHI_SQUARE_MEDIAN
    for _ in range(_TURNS):
        capped = np.minimum(squares, _CAP * np.repeat(variance, number))
        variance = band_means(capped, edges) / _CAPPED_MEAN
    return variance


def smoothed_bands(variance: FloatArray, edges: npt.NDArray[np.intp]) -> FloatArray:
    """Variances averaged, in their logarithms, with those beside them, where bands are narrow."""
    weight = np.minimum(np.diff(edges), _ENOUGH)
    beside = 1.0 - weight / _ENOUGH
    logarithm = weight * np.log(np.maximum(variance, _LEAST))

    def with_neighbours(values: FloatArray) -> FloatArray:
        padded = np.pad(values, 1)
        return values + beside * (padded[:-2] + padded[2:])

    return np.asarray(np.exp(with_neighbours(logarithm) / with_neighbours(weight)))


def spread_over(band_values: FloatArray, edges: npt.NDArray[np.intp], n: int) -> FloatArray:
    """Band values interpolated (linear in log frequency) to all n coefficients."""
    centres = np.log(0.5 * (edges[:-1] + edges[1:] - 1) + 0.5)
    return np.asarray(np.interp(np.log(np.arange(n) + 0.5), centres, band_values))


@dataclass(frozen=True)
class Coherence:
    """Banded second moments of a measured and a simulated series.

    Attributes:
        edges: Bands, as indices of coefficients.
        frequency: Centre of each band [Hz].
        measured, simulated: Spectra (mean squared coefficients).
        cross: Mean product.
        squared: Squared coherence, corrected for the number of coefficients.
    """

    edges: npt.NDArray[np.intp]
    frequency: FloatArray
    measured: FloatArray
    simulated: FloatArray
    cross: FloatArray
    squared: FloatArray


def coherence_of(measured: FloatArray, simulated: FloatArray, dt: float, n: int) -> Coherence:
    """Banded coherence of two cosine spectra of a series of n samples.

    Args:
        measured, simulated: Coefficients, the first of n.
        dt: Sampling interval [s].
        n: Length of the series.
    """
    edges = band_edges(len(measured))
    m = band_means(measured * measured, edges)
    s = band_means(simulated * simulated, edges)
    c = band_means(measured * simulated, edges)
    count = np.diff(edges)
    raw = c * c / np.maximum(m * s, 1e-300)
    squared = np.clip((raw - 1.0 / count) / (1.0 - 1.0 / count), 0.0, 1.0)
    frequency = np.asarray(
        0.5 * (edges[:-1] + edges[1:] - 1) / (2.0 * n * dt), dtype=np.float64
    )
    return Coherence(edges, frequency, m, s, c, squared)


def shrinkage(coherence: Coherence, exponent: FloatArray, n: int) -> FloatArray:
    """Share of each simulated coefficient that the instrument can be expected to show.

    An error of the reference alone gives the regression of the measured on the simulated series
    the slope (squared coherence)^1, an error shared alike by both (a distance between them) the
    slope (squared coherence)^(1/2). The exponent is learnt on healthy recordings; the coherence
    comes from the recording itself, because it does not notice gains or lags.

    Args:
        coherence: Banded coherence of the recording.
        exponent: At the bands of `coherence`.
        n: Number of coefficients.
    """
    squared = np.maximum(coherence.squared, 1e-3)
    slope = squared**exponent * _surely_coherent(coherence)
    # The slowest band decides about offsets and gains; there the wind's own changes are far
    # larger than any error of the reference.
    slope[0] = 1.0
    full = spread_over(slope, coherence.edges, n)
    full[0] = 1.0
    return full


def _surely_coherent(coherence: Coherence) -> FloatArray:
    """Between 0, where a wide band's coherence may be chance, and 1."""
    raw = coherence.cross**2 / np.maximum(coherence.measured * coherence.simulated, 1e-300)
    count = np.diff(coherence.edges)
    evidence = -count * np.log1p(-np.minimum(raw, 1.0 - 1e-9))
    sure = evidence**SHARP / (evidence**SHARP + CHANCE_EVIDENCE**SHARP)
    return np.where(count < WIDE_BAND, 1.0, sure)


def noise_variance(
    residual: FloatArray, low_ratio: FloatArray | None, low_end: int, by_chance: float = 0.0
) -> FloatArray:
    """Smooth, robust variance of the coefficients of a residual.

    Large squares are capped in each band, so that a few large coefficients (a line, a slow trend
    that an effect causes) do not raise the variance they should be judged against. Below
    `low_end` the residual holds what the effects do; there the variance follows the band above
    it with the ratio that healthy recordings show.

    Args:
        residual: Cosine coefficients.
        low_ratio: Healthy variance of each band relative to the first band above `low_end`; None
            keeps the recording's own.
        low_end: First coefficient whose own residual is trusted.
        by_chance: White part of the variance of which healthy recordings know nothing.
    """
    n = len(residual)
    edges = band_edges(n)
    variance = robust_band_variances(residual * residual, edges)
    first = 0
    if low_ratio is not None:
        first = min(int(np.searchsorted(edges, low_end)), len(variance) - 3)
    variance[first:] = smoothed_bands(variance[first:], edges[first:])
    if low_ratio is not None:
        level = float(np.exp(np.mean(np.log(variance[first : first + 3]))))
        usual = max(level - by_chance, LEAST_USUAL * level)
        variance[:first] = usual * low_ratio[:first] + by_chance
    full = np.exp(spread_over(np.log(np.maximum(variance, _LEAST)), edges, n))
    return np.asarray(full)
