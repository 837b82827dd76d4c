"""The null: how large each whitened difference may be when nothing is wrong."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.comparison import LOW_END, Comparison, Trust
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import BANDS, Simulated
from wind_sensors.diagnosis.comparing.raw_statistics.changes import CHANGES
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import INTERVALS, chance_of_intervals
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import (
    ERRATIC,
    STILLNESS,
    chance_of_erratic,
    chance_of_steps,
    chance_of_stillness,
)
from wind_sensors.diagnosis.healthy.baseline import Baseline, ChannelBaseline
from wind_sensors.station.model import Rotor, Station

FloatArray = npt.NDArray[np.float64]

LONGEST_EDGE = 15
"""A slow turn at the edge of an outage makes no more than so many bins uncertain on either side."""

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


def residual_of(
    comparison: Comparison, simulated: Simulated, known: ChannelBaseline, channel: Channel
) -> tuple[spectra.Coherence, FloatArray, FloatArray]:
    """What a channel shows beyond the share of its simulation that it is expected to show.

    Args:
        comparison: The recording.
        simulated: Best simulation.
        known: Gives that share from the coherence.
        channel: Of the comparison.

    Returns:
        Coherence; the share of each cosine coefficient; the residual coefficients.
    """
    coherence = comparison.coherence(simulated, channel)
    slope = spectra.shrinkage(
        coherence, known.exponent_at(coherence.frequency), comparison.coefficients
    )
    return coherence, slope, comparison.residual(simulated, channel.name, slope)


def _trust(
    comparison: Comparison, simulated: Simulated, baseline: Baseline, channel: Channel
) -> Trust:
    known = baseline.channels[channel.name]
    coherence, slope, residual = residual_of(comparison, simulated, known, channel)
    low_end = int(2.0 * comparison.grid.n * comparison.grid.dt * LOW_END)
    variance = spectra.noise_variance(
        residual,
        known.low_ratio_at(coherence.frequency),
        low_end,
        simulated.chance.get(channel.name, 0.0),
    )
    mean_speed = float(np.mean(comparison.speed))
    by_chance = _chance(comparison, simulated, channel)
    # Of a record that counts in part the coefficients are as many as ever, but not independent:
    # their noise is that of a whole record, beside which they are smaller.
    share = comparison.counted_share
    usual = known.statistics_deviation_in(mean_speed) / np.sqrt(share)
    statistics = np.hypot(usual, by_chance)
    sampling = activity.sampling_variance(channel, mean_speed, comparison.grid)
    activities = known.activity_deviation(sampling)
    if channel.instrument in comparison.deaf:
        statistics[:BANDS] = statistics[-CHANGES:] = np.inf
        activities = np.full_like(activities, np.inf)
    return Trust(
        slope=slope,
        deviation=np.sqrt(variance / share + SMALLEST_DEVIATION**2),
        statistics_mean=known.statistics_mean,
        statistics_deviation=statistics,
        activity_deviation=activities,
    )


def _chance(comparison: Comparison, simulated: Simulated, channel: Channel) -> FloatArray:
    """Deviation of each statistic by which pulses chance has hit, by readings' last digits, and by
    where a vane pointed or came to rest."""
    drawn, seen = (s.statistics[channel.name] for s in (simulated, comparison.measured))
    chance = np.zeros(drawn.size)
    if channel.kind == "rotor_rate":
        intervals = slice(BANDS, BANDS + INTERVALS)
        edges = comparison.recording.pulses[channel.instrument].time.size
        chance[intervals] = chance_of_intervals(drawn[intervals], seen[intervals], edges)
    else:
        erratic = BANDS + STILLNESS
        stillness, steps = slice(BANDS, erratic), erratic + ERRATIC
        chance[erratic:steps] = chance_of_erratic(
            float(drawn[erratic]), float(seen[erratic]), comparison.counted_time
        )
        chance[stillness] = chance_of_stillness(float(drawn[steps]), float(seen[steps]))
        chance[steps] = chance_of_steps(comparison.standing_shares[channel.name], drawn[steps])
    return chance


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

    def of_changes(self, changes: FloatArray) -> FloatArray:
        """White signatures of changes of what is compared, one a row."""
        return self.through_standing(self.comparison.whitened_changes(changes, self.trust))

    def deviance(self, simulated: Simulated) -> float:
        """Minus twice the log-likelihood of a simulation, but for a constant."""
        vector = self.of(simulated)
        noise = sum(float(np.sum(np.log(t.deviation))) for t in self.trust.values())
        noise *= self.comparison.counted_share
        return float(vector @ vector) + 2.0 * (noise - float(np.sum(np.log(self.shrinks))))

    def of_station(self, station: Station) -> FloatArray:
        """White vector of a station."""
        return self.of(self.comparison.simulate(station))


FORM_ERROR = 0.1
"""Standard deviation, relative to a named effect's own signature, of what its true form adds to
the simulated one: in each part of the wind's range and each band."""

STATISTIC_FORM_ERROR = 0.3
"""The same in each statistic: how a rotor that hardly turns, or a worn cup, spreads its pulses is
simulated less exactly than how fast it turns."""

NEGLIGIBLE = 1e-4
"""Squared length of a noise-whitened difference that changes nothing."""
_FORM_BANDS = (0.0, 0.01, 0.05, 0.2, 1.25)


def form_signatures(
    comparison: Comparison,
    trust: Mapping[str, Trust],
    without: Simulated,
    corrected: Simulated,
) -> FloatArray:
    """How a named effect may differ in form from its simulation, one possibility a row.

    The change that the effect makes in the simulated signals may be larger or smaller than it
    should be in parts of the wind's range (speed, direction) and of the frequencies, and in each
    statistic; its eddies also in parts of the record, for it may grow. In the series time is left
    out: an effect that comes and goes is another finding.

    Args:
        comparison: The recording.
        trust: Noise of each channel.
        without: Simulation without the named effects.
        corrected: Simulation with them.

    Returns:
        Noise-whitened differences, each of one standard deviation, shape (k, m).
    """
    n = comparison.coefficients
    starts = np.concatenate(([0], np.cumsum(_lengths(comparison))))
    frequency = spectra.cosine_frequencies(comparison.grid.n, comparison.grid.dt)[:n]
    rows: list[FloatArray] = []
    channels = comparison.channels
    change = np.nan_to_num(corrected.flat(channels) - without.flat(channels))
    whole_change = comparison.whitened_changes(change, trust)

    def add(place: int, values: FloatArray) -> None:
        if float(values @ values) < NEGLIGIBLE:
            return
        row = np.zeros(starts[-1])
        row[starts[place] : starts[place + 1]] = values
        rows.append(row)

    for k, channel in enumerate(comparison.channels):
        name = channel.name
        t = trust[name]
        if np.any(corrected.series[name] != without.series[name]):
            for weight in _wind_parts(comparison):
                part = comparison.whitened_while(channel, without, corrected, trust, weight)
                add(k, FORM_ERROR * part)
            whole = whole_change[k * n : (k + 1) * n]
            for low, high in itertools.pairwise(_FORM_BANDS):
                add(k, np.where((frequency >= low) & (frequency < high), FORM_ERROR * whole, 0.0))
        shift = np.nan_to_num(
            (corrected.statistics[name] - without.statistics[name]) / t.statistics_deviation
        )
        for j in np.flatnonzero(shift):
            add(
                len(comparison.channels) + k,
                np.where(np.arange(shift.size) == j, STATISTIC_FORM_ERROR * shift, 0.0),
            )
        place = 2 * len(comparison.channels) + k
        risen = corrected.levels[name] - without.levels[name]
        for weight in _thirds(np.linspace(0.0, 1.0, without.counted.size)):
            grown = activity.contrasts(weight * risen, without.counted)
            whitened = grown / t.activity_deviation[:, None]
            for band in range(activity.BANDS):
                only = np.where(np.arange(activity.BANDS)[:, None] == band, whitened, 0.0)
                add(place, STATISTIC_FORM_ERROR * only.ravel())
    return np.array(rows) if rows else np.zeros((0, int(starts[-1])))


def outage_signatures(
    comparison: Comparison, trust: Mapping[str, Trust], station: Station
) -> FloatArray:
    """How a rotor's rate may be wrong where an outage begins and ends, one possibility a row.

    The last pulse before it and the first after it come when they come: the simulated ones by up
    to a turn sooner or later, and for as long one rate is that of the wind, the other nought.

    Args:
        comparison: The recording.
        trust: Noise of each channel.
        station: Knows the outages.

    Returns:
        Noise-whitened differences, each of one standard deviation, shape (k, m).
    """
    n, dt = comparison.coefficients, comparison.grid.dt
    length = int(_lengths(comparison).sum())
    rows: list[FloatArray] = []
    for k, channel in enumerate(comparison.channels):
        rotor = station.instrument(channel.instrument)
        if not isinstance(rotor, Rotor):
            continue
        t = trust[channel.name]
        for edge in (edge for outage in rotor.outages for edge in (outage.start, outage.stop)):
            at = int((edge - comparison.drive.elapsed) / dt)
            if not 0 <= at < comparison.grid.n:
                continue
            turn = 2.0 * np.pi * rotor.calibration_distance / comparison.speed[at]
            reach = min(int(turn / dt) + 1, LONGEST_EDGE)
            for place in range(max(at - reach, 0), min(at + reach + 1, comparison.grid.n)):
                wrong = np.zeros(comparison.grid.n)
                wrong[place] = comparison.speed[place]
                row = np.zeros(length)
                part = spectra.to_cosine(comparison.masked(wrong))[:n]
                row[k * n : (k + 1) * n] = t.slope / t.deviation * part
                rows.append(row)
    return np.array(rows) if rows else np.zeros((0, length))


def _lengths(comparison: Comparison) -> npt.NDArray[np.intp]:
    """Numbers of coefficients, statistics and levels of each channel, in the order of a vector."""
    seen = comparison.measured
    names = [c.name for c in comparison.channels]
    return np.array(
        [comparison.coefficients] * len(names)
        + [seen.statistics[name].size for name in names]
        + [seen.levels[name].size for name in names],
        dtype=np.intp,
    )


def _thirds(rank: FloatArray) -> list[FloatArray]:
    """Smooth weights over the low, the middle and the high of ranks from 0 to 1."""
    return [np.clip(1.0 - np.abs(3.0 * rank - middle), 0.0, 1.0) for middle in (0.0, 1.5, 3.0)]


def _wind_parts(comparison: Comparison) -> list[FloatArray]:
    """Smooth weights over the wind's speed and direction, shape (n,) each."""
    rank = np.argsort(np.argsort(comparison.speed)) / max(comparison.grid.n - 1, 1)
    heading = comparison.wind_from
    return [*_thirds(rank), np.cos(heading), np.sin(heading), np.cos(2.0 * heading),
            np.sin(2.0 * heading)]


def in_series(comparison: Comparison, whitened: FloatArray) -> FloatArray:
    """Noise-whitened differences (or rows of them) with those of the statistics left out."""
    series = comparison.coefficients * len(comparison.channels)
    return np.asarray(np.where(np.arange(whitened.shape[-1]) < series, whitened, 0.0))


def shared_liveliness(
    comparison: Comparison, trust: Mapping[str, Trust], liveliness: float
) -> FloatArray:
    """How all instruments' eddies may be livelier or calmer than the reference's for a while.

    Args:
        comparison: The recording.
        trust: Noise of each channel.
        liveliness: Standard deviation of the slowest such change.

    Returns:
        Noise-whitened, each of one standard deviation, shape (k, m).
    """
    deviations = np.concatenate([trust[c.name].activity_deviation for c in comparison.channels])
    rows = [
        (wave / deviations[:, None]).ravel()
        for wave in activity.waves(comparison.measured.counted, liveliness)
    ]
    series_and_statistics = comparison.channel_of_each.size - rows[0].size
    return np.pad(np.array(rows), ((0, 0), (series_and_statistics, 0)))


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
        means: Its mean, shape (templates,); statistics have their own.
    """
    shared: FloatArray = np.zeros(signatures.shape[1])
    if means is not None:
        shared = in_series(comparison, np.asarray(means @ signatures))
    used = standing > 0.0
    if not np.any(used):
        return Whitener(comparison, trust, np.zeros((0, 0)), np.zeros(0), shared)
    scaled = signatures[used] * standing[used, None]
    gram = scaled @ scaled.T
    values, vectors = np.linalg.eigh(gram)
    keep = values > 1e-4
    directions = (vectors[:, keep].T @ scaled) / np.sqrt(values[keep])[:, None]
    return Whitener(comparison, trust, directions, 1.0 / np.sqrt(1.0 + values[keep]), shared)
