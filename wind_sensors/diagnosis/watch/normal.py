"""What is normal in a block: how far its simulation may differ while nothing is wrong."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison, Trust
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.healthy.baseline import Baseline, ChannelBaseline, station_deviation
from wind_sensors.diagnosis.healthy.whitening import SMALLEST_DEVIATION

FloatArray = npt.NDArray[np.float64]

_PRIOR_BLOCKS = 3.0
"""Weight of what is expected before any block was seen, in blocks."""

_SCATTER_BLOCKS = 5.0
"""The same for the scatter of statistics."""

_BLOCK_WIDENING = 1.5
"""Scatter of a block's statistics relative to that of a quarter of an hour."""

_LEAST_SCATTER = 0.25
"""Nor is it taken to be less than this share of what stations differ by."""

_MEMORY = 240.0
"""Blocks after which what was learnt fades."""

_DECORRELATION = 1.0
"""Frequency at which a reference half a metre away has lost half of the coherence [Hz]."""


@dataclass
class _ChannelNormal:
    """Running means of one channel over healthy blocks."""

    weight: float
    measured: FloatArray
    cross: FloatArray
    noise: FloatArray
    statistics: FloatArray
    squares: FloatArray
    blocks: float = 0.0


def _bands(n: int, comparison: Comparison) -> tuple[npt.NDArray[np.intp], FloatArray]:
    edges = spectra.band_edges(n)
    frequency = 0.5 * (edges[:-1] + edges[1:] - 1) / (2.0 * comparison.grid.n * comparison.grid.dt)
    return edges, np.asarray(frequency, dtype=np.float64)


def _levels(simulated: FloatArray, edges: npt.NDArray[np.intp]) -> FloatArray:
    """Simulated power in each band; the first, which holds the mean, takes its neighbour's."""
    power = spectra.band_means(simulated * simulated, edges)
    power[0] = power[1]
    return power + SMALLEST_DEVIATION**2


@dataclass
class Normal:
    """Noise of every channel relative to the wind's own fluctuations, learnt as blocks pass.

    Attributes:
        baseline: Exponents and statistics of healthy recordings, or of tolerances.
        series: Whether the series themselves are compared; when the driving wind comes from the
            same instruments, only spectra and intervals mean anything.
        channels: What was learnt.
    """

    baseline: Baseline
    series: bool = True
    channels: dict[str, _ChannelNormal] = field(default_factory=dict)

    def trust(self, comparison: Comparison, simulated: Simulated) -> dict[str, Trust]:
        """What the residual of a block is worth."""
        return {c.name: self._trust(comparison, simulated, c) for c in comparison.channels}

    def _of(self, comparison: Comparison, simulated: Simulated, channel: Channel) -> _ChannelNormal:
        name = channel.name
        if name not in self.channels:
            _, frequency = _bands(simulated.cosine[name].size, comparison)
            coherence = 1.0 / (1.0 + frequency / _DECORRELATION)
            known = self.baseline.channels[name]
            w = _PRIOR_BLOCKS
            self.channels[name] = _ChannelNormal(
                weight=w,
                measured=w * np.ones(frequency.size),
                cross=w * np.sqrt(coherence),
                noise=w * (1.0 - coherence + 0.03),
                statistics=w * known.statistics_mean,
                squares=_SCATTER_BLOCKS * self._prior_scatter(known, channel) ** 2,
            )
        return self.channels[name]

    @staticmethod
    def _prior_scatter(known: ChannelBaseline, channel: Channel) -> FloatArray:
        """A block's few pulses and readings scatter by more than those of a whole record."""
        least = _LEAST_SCATTER * station_deviation(channel)
        return np.maximum(_BLOCK_WIDENING * known.statistics_deviation, least)

    def _trust(self, comparison: Comparison, simulated: Simulated, channel: Channel) -> Trust:
        state = self._of(comparison, simulated, channel)
        known = self.baseline.channels[channel.name]
        _, expected = comparison.beyond_motion(simulated, channel.name)
        edges, frequency = _bands(expected.size, comparison)
        m, c = state.measured / state.weight, state.cross / state.weight
        squared = np.clip(c * c / np.maximum(m, 1e-9), 0.0, 1.0)
        coherence = spectra.Coherence(edges, frequency, m, np.ones_like(m), c, squared)
        slope = spectra.shrinkage(coherence, known.exponent_at(frequency), expected.size)
        noise = np.log(state.noise / state.weight * _levels(expected, edges))
        # What is wrong from the start would otherwise become normal: the slowest band holds most
        # of it, and follows its neighbours as healthy recordings do.
        if self.baseline.calibrated:
            noise[0] = np.mean(noise[1:4]) + np.log(known.low_ratio_at(frequency)[0])
        variance = np.exp(spectra.spread_over(noise, edges, expected.size))
        deviation = np.sqrt(variance + SMALLEST_DEVIATION**2)
        if not self.series:
            deviation = np.full(expected.size, np.inf)
        usual = state.statistics / (state.blocks + _PRIOR_BLOCKS)
        return Trust(
            slope=slope,
            deviation=deviation,
            statistics_mean=known.statistics_mean if self.baseline.calibrated else usual,
            statistics_deviation=np.sqrt(state.squares / (state.blocks + _SCATTER_BLOCKS)),
            activity_deviation=np.full(activity.BANDS, np.inf),
        )

    def learn(self, comparison: Comparison, simulated: Simulated, residual: FloatArray) -> None:
        """Let a block that shows nothing wrong enter the normal.

        Args:
            comparison: The block.
            simulated: The station in its wind.
            residual: Whitened differences beyond the standing ones, as `Comparison.vector` gives
                them under the present trust.
        """
        trusts = self.trust(comparison, simulated)
        at = 0
        for channel in comparison.channels:
            state = self._of(comparison, simulated, channel)
            trust = trusts[channel.name]
            seen, expected = comparison.beyond_motion(simulated, channel.name)
            edges, _ = _bands(expected.size, comparison)
            levels = _levels(expected, edges)
            fade = 1.0 - 1.0 / _MEMORY
            scale = np.where(np.isfinite(trust.deviation), trust.deviation, 0.0)
            part = residual[at : at + expected.size] * scale
            at += expected.size
            for total, addition in (
                (state.measured, spectra.band_means(seen * seen, edges) / levels),
                (state.cross, spectra.band_means(seen * expected, edges) / levels),
                (state.noise, spectra.band_means(part * part, edges) / levels),
            ):
                np.multiply(total, fade, out=total)
                np.add(total, np.clip(addition, -20.0, 20.0), out=total)
            state.weight = state.weight * fade + 1.0
            difference = (
                comparison.measured.statistics[channel.name] - simulated.statistics[channel.name]
            )
            usual = trust.statistics_mean
            difference = np.where(np.isfinite(difference), difference, usual)
            largest = 4.0 * trust.statistics_deviation**2
            state.squares += np.minimum((difference - usual) ** 2, largest)
            state.statistics = state.statistics + difference
            state.blocks += 1.0
            if state.blocks > _MEMORY:
                shrink = _MEMORY / state.blocks
                state.statistics = state.statistics * (
                    (_MEMORY + _PRIOR_BLOCKS) / (state.blocks + _PRIOR_BLOCKS)
                )
                state.squares = state.squares * shrink
                state.blocks = _MEMORY
