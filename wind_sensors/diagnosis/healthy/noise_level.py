"""How large a residual may be: noise relative to signal, as healthy recordings show it.

What reference and instrument do not share depends on the size of the eddies: the ratio of the
residual's spectrum to the signal's is much the same function of the wavenumber on all healthy days
of a station, whatever the wind. The null takes its noise from the recording itself, so that physics
which nothing in the catalogue describes passes for noise; here it shows.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.healthy.baseline import WAVENUMBERS, Baseline, ChannelBaseline
from wind_sensors.diagnosis.healthy.whitening import residual_of

FloatArray = npt.NDArray[np.float64]

_WIDTH = 0.4
"""Of the windows around each wavenumber, in its logarithm."""

_FEWEST = 8.0
"""Coefficients that a window needs."""

_PRIOR_STRENGTH = 3.0
EXPECTED_SCATTER = np.array([0.4, 0.2, 0.15, 0.12, 0.12, 0.15])
"""Standard deviation of the logarithms between healthy days before any is seen."""


@dataclass(frozen=True)
class Excess:
    """The channel and eddy size at which a residual exceeds the healthy ones most.

    Attributes:
        score: In standard deviations between healthy days; minus infinity: nothing is known.
        channel: Name.
        wavelength: Of the eddies [m].
        ratio: Power of the residual relative to a healthy day's.
    """

    score: float = -np.inf
    channel: str = ""
    wavelength: float = 0.0
    ratio: float = 1.0


def levels(
    comparison: Comparison, simulated: Simulated, known: ChannelBaseline, channel: Channel
) -> tuple[FloatArray, FloatArray]:
    """Logarithm of the residual's spectrum relative to the signal's.

    Args:
        comparison: The recording.
        simulated: Best simulation.
        known: Gives the share of the simulation that the instrument is expected to show.
        channel: Of the comparison.

    Returns:
        At `WAVENUMBERS`: the logarithms (nan: not seen) and the number of coefficients behind.
    """
    coherence, _, residual = residual_of(comparison, simulated, known, channel)
    power = spectra.band_means(residual * residual, coherence.edges)
    ratio = np.log((power[1:] + 1e-12) / (coherence.simulated[1:] + 1e-12))
    count = np.diff(coherence.edges)[1:]
    place = np.log(coherence.frequency[1:] / float(np.mean(comparison.speed)))
    near = np.exp(-0.5 * ((place - np.log(WAVENUMBERS)[:, None]) / _WIDTH) ** 2) * count
    total = near.sum(axis=1)
    seen = total > _FEWEST
    mean = np.full(WAVENUMBERS.size, np.nan)
    mean[seen] = (near @ ratio)[seen] / total[seen]
    return mean, total


def learnt_levels(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and deviation of the levels of another day, from those of healthy recordings.

    Args:
        rows: Levels, shape (recordings, wavenumbers).
    """
    seen = np.isfinite(rows)
    count = seen.sum(axis=0)
    filled = np.where(seen, rows, 0.0)
    mean = filled.sum(axis=0) / np.maximum(count, 1)
    squares = np.where(seen, (rows - mean) ** 2, 0.0).sum(axis=0)
    variance = (squares + _PRIOR_STRENGTH * EXPECTED_SCATTER**2) / (
        np.maximum(count, 1) - 1.0 + _PRIOR_STRENGTH
    )
    deviation = np.sqrt(variance * (1.0 + 1.0 / np.maximum(count, 1)))
    return mean, np.where(count > 1, deviation, np.inf)


def excess_of(
    comparison: Comparison,
    simulated: Simulated,
    baseline: Baseline,
    exempt: Collection[str] = (),
) -> Excess:
    """How far a residual exceeds those of healthy days.

    Args:
        comparison: The recording.
        simulated: With everything that is named.
        baseline: What is normal.
        exempt: Instruments that are not judged.
    """
    worst = Excess()
    for channel in comparison.channels:
        if channel.instrument in exempt:
            continue
        known = baseline.channels[channel.name]
        seen, count = levels(comparison, simulated, known, channel)
        count = count * (1.0 if comparison.mask is None else float(np.mean(comparison.mask)))
        above = seen - known.noise_mean
        scores = above / np.sqrt(known.noise_deviation**2 + 2.0 / np.maximum(count, 1.0))
        usable = np.isfinite(scores) & np.isfinite(known.noise_deviation)
        if not usable.any():
            continue
        place = int(np.argmax(np.where(usable, scores, -np.inf)))
        if scores[place] > worst.score:
            worst = Excess(
                float(scores[place]), channel.name,
                float(1.0 / WAVENUMBERS[place]), float(np.exp(above[place])),
            )
    return worst


def described(excess: Excess) -> str:
    """For people."""
    return (
        f"{excess.channel}: what is left at eddies of {excess.wavelength:.0f} m has "
        f"{excess.ratio:.1f} times the power of a healthy day's, and no known effect takes it away"
    )
