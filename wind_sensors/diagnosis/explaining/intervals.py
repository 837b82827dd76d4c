"""What an effect gains if it holds in a part of the record only: all beginnings and ends at once.

The change that an effect makes in a series is cut into cells of time. Cells add up, so that their
inner products with each other and with the data give the linear gain of every interval without
another simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity
from wind_sensors.diagnosis.comparing.comparison import Comparison, Trust
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.explaining.terms import Interval

FloatArray = npt.NDArray[np.float64]

NEAR_AN_END = 20.0
"""What begins or ends this close to the record's own ends [s] holds all the time there."""

_WEAKEST = 1e-2
_RIDGE = 1e-3


@dataclass(frozen=True)
class IntervalGains:
    """Linear gains of an effect in every interval between two cuts.

    Attributes:
        cuts: Where it may begin and end [s since the first bin], shape (k,), ascending.
        gains: Drop of the cost if it holds from cut i to cut j, shape (k, k); zero for i >= j.
        amplitudes: Of its templates there, shape (k, k, templates).
    """

    cuts: FloatArray
    gains: FloatArray
    amplitudes: FloatArray


def interval_of(comparison: Comparison, begin: float, end: float) -> Interval:
    """A stretch [s since the first bin] as an interval of the recording.

    Args:
        comparison: The recording.
        begin, end: Of the stretch; no beginning, no end within `NEAR_AN_END` of the record's own.
    """
    since = comparison.drive.elapsed
    length = comparison.grid.n * comparison.grid.dt
    return (
        begin + since if begin > NEAR_AN_END else 0.0,
        None if end > length - NEAR_AN_END else end + since,
    )


def window_of(comparison: Comparison, interval: Interval) -> tuple[float, float]:
    """Beginning and end of an effect in the record [s since the first bin]."""
    since = comparison.drive.elapsed
    begins, ends = interval
    length = comparison.grid.n * comparison.grid.dt
    return max(begins - since, 0.0), length if ends is None else min(ends - since, length)


def cell_signatures(
    comparison: Comparison,
    without: Simulated,
    planted: Simulated,
    trust: Mapping[str, Trust],
    cuts: FloatArray,
) -> FloatArray:
    """Noise-whitened signatures of an effect that holds between neighbouring cuts only.

    Spectra and interval statistics take the share of the time, the activity its segments.

    Args:
        comparison: The recording.
        without, planted: Simulations without and with the effect.
        trust: Noise of each channel.
        cuts: Ascending times [s since the first bin], shape (k,).

    Returns:
        Shape (k - 1, m).
    """
    cell = np.searchsorted(cuts, comparison.grid.centres, side="right") - 1
    cells = cuts.size - 1
    inside = cell == np.arange(cells)[:, None]
    share = inside.mean(axis=1)
    parts = []
    for channel in comparison.channels:
        name = channel.name
        parts.append(comparison.whitened_while(channel, without, planted, trust, inside))
    for channel in comparison.channels:
        name = channel.name
        moved = planted.statistics[name] - without.statistics[name]
        white = np.nan_to_num(moved / trust[name].statistics_deviation)
        parts.append(share[:, None] * white)
    number = activity.segments_of(comparison.grid)
    size = np.bincount(number)
    there = np.array([np.bincount(number, within, size.size) / size for within in inside])
    for channel in comparison.channels:
        name = channel.name
        risen = planted.levels[name] - without.levels[name]
        each = activity.contrasts(there[:, None, :] * risen, planted.counted)
        parts.append(
            (each / trust[name].activity_deviation[:, None]).reshape(cells, -1)
        )
    return np.concatenate(parts, axis=1)


def interval_gains(
    cuts: FloatArray, templates: Sequence[FloatArray], vector: FloatArray, joint: bool
) -> IntervalGains:
    """Gains of an effect in every interval.

    Args:
        cuts: Ascending times [s since the first bin], shape (k,).
        templates: White cell signatures of each of the effect's templates, shape (k - 1, m) each.
        vector: White vector of what is to be explained, shape (m,).
        joint: Combine all templates; otherwise the best one counts in each interval.
    """
    number, cells = len(templates), cuts.size - 1
    rows = np.concatenate(templates)
    seen = (rows @ vector).reshape(number, cells)
    summed = np.zeros((number, cells + 1))
    np.cumsum(seen, axis=1, out=summed[:, 1:])
    begin, end = np.triu_indices(cells + 1, 1)
    gained = summed[:, end] - summed[:, begin]
    if joint and number > 1:
        gram = (rows @ rows.T).reshape(number, cells, number, cells).transpose(0, 2, 1, 3)
        products = _between(gram, begin, end)
        gain, amplitude = _combined(np.moveaxis(products, -1, 0), gained.T)
    else:
        power = np.array([_between(t @ t.T, begin, end) for t in templates])
        amplitudes = np.where(power > _WEAKEST, gained / np.maximum(power, _WEAKEST), 0.0)
        each = amplitudes * gained
        best = np.argmax(each, axis=0)
        gain = each[best, np.arange(best.size)]
        amplitude = np.where(np.arange(number)[:, None] == best, amplitudes, 0.0).T
    gains = np.zeros((cells + 1, cells + 1))
    gains[begin, end] = gain
    spread = np.zeros((cells + 1, cells + 1, number))
    spread[begin, end] = amplitude
    return IntervalGains(cuts, gains, spread)


def _between(
    gram: FloatArray, begin: npt.NDArray[np.intp], end: npt.NDArray[np.intp]
) -> FloatArray:
    """Products of the sums over intervals, from those of cells (the last two axes)."""
    shape = (*gram.shape[:-2], gram.shape[-2] + 1, gram.shape[-1] + 1)
    summed = np.zeros(shape)
    summed[..., 1:, 1:] = np.cumsum(np.cumsum(gram, axis=-2), axis=-1)
    return np.asarray(
        summed[..., end, end] - summed[..., begin, end]
        - summed[..., end, begin] + summed[..., begin, begin]
    )


def _combined(gram: FloatArray, seen: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gains and amplitudes of least-squares combinations.

    Args:
        gram: Shape (intervals, templates, templates).
        seen: Shape (intervals, templates).
    """
    power = np.diagonal(gram, axis1=1, axis2=2)
    scale = np.sqrt(np.maximum(power, _WEAKEST))
    normal = gram / (scale[:, :, None] * scale[:, None, :]) + _RIDGE * np.eye(seen.shape[1])
    scaled = np.linalg.solve(normal, (seen / scale)[:, :, None])[:, :, 0]
    gain = np.einsum("ij,ij->i", scaled, seen / scale)
    return np.maximum(gain, 0.0), scaled / scale
