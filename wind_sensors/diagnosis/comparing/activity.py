"""How lively a signal is from half-minute to half-minute, in bands of eddies.

What begins inside a record and changes the quick part of a signal alone (a heavier rotor, a damped
vane) is hardly seen in series that are compared with a reference some eddies away. But the power of
the quick eddies, half-minute by half-minute, follows that of the simulation all day; a level that
changes inside the record has changed in the instrument.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.observation import LOWEST_BAND_FREQUENCY, Channel, Grid

FloatArray = npt.NDArray[np.float64]

EDGES = np.array([0.25, 0.8, 2.0, 5.0])
"""Of the bands in k times the instrument's length."""

BANDS = len(EDGES) - 1

SEGMENT = 30.0
"""Length of a part of the record [s]."""

HIGHEST = 0.45
"""Frequencies up to this share of the sampling rate count."""

FEWEST = 12
"""Coefficients in a band of a segment, below which its power says nothing."""

WAVES = 8
USUAL_LIVELINESS = 0.2
"""Slow changes of the eddies' power that all instruments share, as waves over the record, and the
standard deviation of the slowest (of the logarithm): the reference stands elsewhere, now and then
in another thing's wake. Waves half as long have half the variance. On healthy days of masts on land
the instruments agree on them to some percent."""

OUTLYING = 2.0
"""Differences of more standard deviations than this count less than in proportion."""

RESOLUTION = 0.02
"""Fluctuations below this [m/s] are as good as none."""


def segments_of(grid: Grid) -> npt.NDArray[np.intp]:
    """Number of the segment of each bin, shape (n,); what remains belongs to the last."""
    size = max(1, round(SEGMENT / grid.dt))
    number = max(1, grid.n // size)
    return np.asarray(np.minimum(np.arange(grid.n) // size, number - 1))


def counted_segments(grid: Grid, mask: FloatArray | None) -> npt.NDArray[np.bool_]:
    """Segments all of whose bins count, shape (segments,)."""
    number = segments_of(grid)
    if mask is None:
        return np.ones(int(number[-1]) + 1, dtype=np.bool_)
    return np.asarray(np.bincount(number, mask < 1.0) == 0)


def band_frequencies(channel: Channel, mean_speed: float, grid: Grid) -> FloatArray:
    """Bounds of each band [Hz], shape (BANDS, 2)."""
    edges = EDGES * mean_speed / (2.0 * np.pi * channel.length)
    low = np.maximum(edges[:-1], LOWEST_BAND_FREQUENCY)
    return np.stack((low, np.minimum(edges[1:], HIGHEST / grid.dt)), axis=1)


def sampling_variance(channel: Channel, mean_speed: float, grid: Grid) -> FloatArray:
    """Variance of the difference of two logarithms of power, each of as many independent
    coefficients as a band has in a segment, shape (BANDS,); infinite where there are too few."""
    bounds = band_frequencies(channel, mean_speed, grid)
    count = 2.0 * SEGMENT * (bounds[:, 1] - bounds[:, 0])
    return np.where(count < FEWEST, np.inf, 4.0 / np.maximum(count, 1.0))


def levels(
    series: FloatArray, channel: Channel, mean_speed: float, grid: Grid
) -> FloatArray:
    """Logarithm of the power in each band of each segment.

    Args:
        series: Of the bins [m/s], shape (n,).
        channel: Gives the bands.
        mean_speed: Of the record [m/s].
        grid: Bins.

    Returns:
        Shape (BANDS, segments).
    """
    coefficients = spectra.to_cosine(series)
    bands = np.zeros((BANDS, grid.n))
    for k, (low, high) in enumerate(band_frequencies(channel, mean_speed, grid)):
        inside = spectra.coefficients_within(grid.n, grid.dt, float(low), float(high))
        bands[k, inside] = coefficients[inside]
    power = np.square(spectra.from_cosine(bands))
    number = segments_of(grid)
    sums = np.array([np.bincount(number, of_band) for of_band in power])
    return np.asarray(np.log(sums / np.bincount(number) + RESOLUTION**2))


def compressed(deviations: FloatArray) -> FloatArray:
    """Differences in standard deviations, large ones pulled in: the power of quick eddies has rare
    large outliers on healthy days (a vane in a lull), which a few segments must not decide by."""
    return np.asarray(OUTLYING * np.arcsinh(deviations / OUTLYING))


def contrasts(level: FloatArray, counted: npt.NDArray[np.bool_]) -> FloatArray:
    """Levels (or changes of them) beyond their mean over the segments that count; zero in others.

    Args:
        level: Shape (..., segments).
        counted: Segments that count, shape (segments,).
    """
    if not counted.any():
        return np.zeros_like(level)
    mean = level[..., counted].mean(axis=-1, keepdims=True)
    return np.asarray(np.where(counted, level - mean, 0.0))


def waves(counted: npt.NDArray[np.bool_], liveliness: float) -> FloatArray:
    """Slow changes beyond their mean over the segments that count, each of one standard deviation.

    Args:
        counted: Segments that count, shape (segments,).
        liveliness: Standard deviation of the slowest.

    Returns:
        Shape (WAVES, segments).
    """
    at = (np.arange(counted.size) + 0.5) / counted.size
    number = np.arange(1, WAVES + 1)[:, None]
    return contrasts(liveliness / np.sqrt(number) * np.cos(np.pi * number * at), counted)


def shared_waves(
    changes: FloatArray,
    variances: FloatArray,
    counted: npt.NDArray[np.bool_],
    liveliness: float = USUAL_LIVELINESS,
) -> tuple[FloatArray, FloatArray]:
    """What all instruments' levels share of their changes over a record.

    Args:
        changes: Of every band of every instrument, beyond their means, shape (k, segments).
        variances: Of each, infinite where unseen, shape (k,).
        counted: Segments that count, shape (segments,).
        liveliness: Standard deviation of the slowest wave.

    Returns:
        Sizes of the waves in standard deviations, and the covariance of what is not known of
        them, shapes (WAVES,) and (WAVES, WAVES).
    """
    slow = waves(counted, liveliness)
    precision = 1.0 / variances
    unknown = np.linalg.inv(precision.sum() * slow @ slow.T + np.eye(WAVES))
    return unknown @ slow @ (precision @ changes), unknown
