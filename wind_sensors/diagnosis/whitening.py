"""The null: how large each whitened difference may be when nothing is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis import spectra
from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.comparison import (
    LOW_END,
    Comparison,
    Simulated,
    Trust,
)
from wind_sensors.diagnosis.observation import Channel
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

SMALLEST_DEVIATION = 0.02
"""Noise of a compared series is never taken below this [m/s], per coefficient."""


def trust_of(
    comparison: Comparison, simulated: Simulated, baseline: Baseline
) -> dict[str, Trust]:
    """Slope and noise of each channel, from the recording itself with the baseline's exponents.

    Args:
        comparison: The recording.
        simulated: Best simulation so far; its residual gives coherence and noise.
        baseline: What healthy recordings of the station show.
    """
    return {c.name: _trust(comparison, simulated, baseline, c) for c in comparison.channels}


def _trust(
    comparison: Comparison, simulated: Simulated, baseline: Baseline, channel: Channel
) -> Trust:
    name = channel.name
    known = baseline.channels[name]
    coherence = comparison.coherence(simulated, channel)
    slope = spectra.shrinkage(
        coherence, known.exponent_at(coherence.frequency), comparison.coefficients
    )
    residual = comparison.measured.cosine[name] - slope * simulated.cosine[name]
    low_end = int(2.0 * comparison.grid.n * comparison.grid.dt * LOW_END)
    variance = spectra.noise_variance(
        residual, known.low_ratio_at(coherence.frequency), low_end
    )
    return Trust(
        slope=slope,
        deviation=np.sqrt(variance + SMALLEST_DEVIATION**2),
        statistics_mean=known.statistics_mean,
        statistics_deviation=known.statistics_deviation,
    )


@dataclass(frozen=True)
class Whitener:
    """Turns stations into vectors that are white, with unit variance, under the null.

    Beyond the noise of each coefficient, the null contains every effect of the catalogue at its
    standing size, Sigma = noise + G T G^T.

    Attributes:
        comparison: The recording.
        trust: By channel name.
        directions: Orthonormal directions of the standing effects in noise-whitened space,
            shape (k, m).
        shrinks: What is left of a component along each direction, shape (k,).
        shared: Noise-whitened difference that all healthy recordings share, shape (m,).
    """

    comparison: Comparison
    trust: Mapping[str, Trust]
    directions: FloatArray
    shrinks: FloatArray
    shared: FloatArray

    def noise_whitened(self, simulated: Simulated) -> FloatArray:
        """Differences beyond the shared ones, divided by the noise alone."""
        return self.comparison.vector(simulated, self.trust) - self.shared

    def through_standing(self, vector: FloatArray) -> FloatArray:
        """A noise-whitened vector (or rows of them) with the standing effects weighed in."""
        if self.directions.size == 0:
            return vector
        along = vector @ self.directions.T
        return np.asarray(vector - (along * (1.0 - self.shrinks)) @ self.directions)

    def of(self, simulated: Simulated) -> FloatArray:
        """White vector of a simulation."""
        return self.through_standing(self.noise_whitened(simulated))

    def of_station(self, station: Station) -> FloatArray:
        """White vector of a station."""
        return self.of(self.comparison.simulate(station))


def unstanding(comparison: Comparison, trust: Mapping[str, Trust]) -> Whitener:
    """A whitener that knows the noise only."""
    return Whitener(comparison, trust, np.zeros((0, 0)), np.zeros(0), np.zeros(1))


def whitener_of(
    comparison: Comparison,
    trust: Mapping[str, Trust],
    signatures: FloatArray,
    standing: FloatArray,
    means: FloatArray | None = None,
) -> Whitener:
    """The whitener for given signatures and their standing sizes.

    Args:
        comparison: The recording.
        trust: Noise of each channel.
        signatures: Noise-whitened signatures, one a row, shape (templates, m).
        standing: Standard deviation of each signature's amplitude on healthy days,
            shape (templates,).
        means: Its mean, shape (templates,).
    """
    shared: FloatArray = (
        np.zeros(signatures.shape[1]) if means is None else np.asarray(means @ signatures)
    )
    used = standing > 0.0
    if not np.any(used):
        return Whitener(comparison, trust, np.zeros((0, 0)), np.zeros(0), shared)
    scaled = signatures[used] * standing[used, None]
    gram = scaled @ scaled.T
    values, vectors = np.linalg.eigh(gram)
    keep = values > 1e-4
    directions = (vectors[:, keep].T @ scaled) / np.sqrt(values[keep])[:, None]
    return Whitener(comparison, trust, directions, 1.0 / np.sqrt(1.0 + values[keep]), shared)
