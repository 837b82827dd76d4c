"""Learning a baseline from healthy recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.comparison import LOW_END, Comparison
from wind_sensors.diagnosis.comparing.observation import channels_of
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.explaining.signatures import (
    in_parallel,
)
from wind_sensors.diagnosis.healthy.baseline import (
    FREQUENCIES,
    Baseline,
    ChannelBaseline,
    calm_deviation,
    daily_deviation,
    default_channel,
)
from wind_sensors.diagnosis.healthy.calibrated_range import is_calm
from wind_sensors.diagnosis.healthy.commissioning import commissioned
from wind_sensors.diagnosis.healthy.noise_level import learnt_levels, levels
from wind_sensors.diagnosis.healthy.reference_search import located
from wind_sensors.diagnosis.healthy.standing import (
    evidence_of,
    loudest_gains,
    standing_means,
    standing_sizes,
)
from wind_sensors.diagnosis.healthy.whitening import trust_of
from wind_sensors.errors import UserError
from wind_sensors.station.model import Propeller, Station
from wind_sensors.station.signals import Recording
from wind_sensors.station.silence import silent_instruments

FloatArray = npt.NDArray[np.float64]

_PRIOR_STRENGTH = 3.0
"""Weight of the prior in healthy variances, in recordings."""

USUAL_ACTIVITY_EXCESS = 1.5
ACTIVITY_PRIOR_STRENGTH = 8.0
FEW_SEGMENTS = 4
"""Excess of the scatter of levels, its weight in groups of segments, and so many in a group."""

LIVELINESS_PRIOR_DAYS = 1.0
LIVELINESS_STEPS = 10
"""So many days' worth is what is usual of slow changes that all channels share, and steps to what
the healthy days say of them."""

SELDOM = 0.1
"""Winds below this quantile are too rare in healthy recordings to say what is normal."""


def default_baseline(station: Station) -> Baseline:
    """A baseline from certificate tolerances alone: no healthy recording was given."""
    channels = {c.name: default_channel(c) for c in channels_of(station)}
    return Baseline((), station, station, channels)


def _exponents(comparisons: Sequence[Comparison], name: str, station: Station) -> FloatArray:
    """Slope as a power of the squared coherence, pooled over recordings and nearby bands."""
    prior = np.where(FREQUENCIES < 0.1, 1.0, 0.5)
    numerator, denominator = 4.0 * prior, np.full(FREQUENCIES.size, 4.0)
    log_frequency = np.log(FREQUENCIES)
    for comparison in comparisons:
        channel = next(c for c in comparison.channels if c.name == name)
        coherence = comparison.coherence(comparison.simulate(station), channel)
        slope = coherence.cross / coherence.simulated
        count = np.diff(coherence.edges)
        usable = (coherence.squared > 0.05) & (coherence.squared < 0.985) & (slope > 0.0)
        for k in np.flatnonzero(usable):
            x = float(np.log(coherence.squared[k]))
            y = float(np.log(slope[k]))
            near = np.exp(-0.5 * ((np.log(coherence.frequency[k]) - log_frequency) / 0.35) ** 2)
            # The slope's scatter is that of a correlation with `count` degrees of freedom.
            weight = near * count[k] * coherence.squared[k] / (1.0 - coherence.squared[k])
            numerator += weight * x * y
            denominator += weight * x * x
    return np.asarray(np.clip(numerator / denominator, 0.3, 1.3))


def _low_ratios(
    comparisons: Sequence[Comparison], station: Station, baseline: Baseline, name: str
) -> FloatArray:
    """Noise at low frequencies relative to the level just above the low end."""
    total, weight = np.full(FREQUENCIES.size, 2.0), np.full(FREQUENCIES.size, 2.0)
    for comparison in comparisons:
        simulated = comparison.simulate(station)
        trust = trust_of(comparison, simulated, baseline)[name]
        residual = comparison.residual(simulated, name, trust.slope)
        edges = spectra.band_edges(residual.size)
        power = spectra.band_means(residual * residual, edges)
        length = comparison.grid.n * comparison.grid.dt
        frequency = 0.5 * (edges[:-1] + edges[1:] - 1) / (2.0 * length)
        first = int(np.searchsorted(frequency, LOW_END))
        level = float(np.exp(np.mean(np.log(power[first : first + 3]))))
        for k, f in enumerate(frequency):
            near = np.exp(-0.5 * ((np.log(f + 5e-4) - np.log(FREQUENCIES)) / 0.4) ** 2)
            total += near * min(power[k] / level, 6.0)
            weight += near
    return np.asarray(np.clip(total / weight, 0.2, 6.0))


def _statistics(
    comparisons: Sequence[Comparison], station: Station, name: str
) -> tuple[FloatArray, FloatArray]:
    """Mean and deviation of measured minus simulated statistics, shrunk towards the prior."""
    channel = next(c for c in channels_of(station) if c.name == name)
    prior = daily_deviation(channel)
    rows = np.array(
        [
            c.measured.statistics[name] - c.simulate(station).statistics[name]
            for c in comparisons
        ]
    )
    calm = np.array([calm_deviation(prior.size, float(np.mean(c.speed))) for c in comparisons])
    weight = np.where(np.isfinite(rows), prior**2 / (prior**2 + calm**2), 0.0)
    count = weight.sum(axis=0)
    filled = np.nan_to_num(rows)
    # A mean of few recordings is itself uncertain, which the deviation has to carry.
    mean = (weight * filled).sum(axis=0) / (count + 0.25)
    squares = (weight * (filled - mean) ** 2).sum(axis=0)
    variance = (squares + _PRIOR_STRENGTH * prior**2) / (count + _PRIOR_STRENGTH - 1.0)
    variance = variance * (1.0 + 1.0 / (count + 0.25))
    return mean, np.sqrt(variance)


@dataclass(frozen=True)
class _Changes:
    """Levels of a recording's channels over the simulated ones.

    Attributes:
        of: By channel name, beyond their means, shape (bands, segments).
        variances: Of each band, infinite where unseen, by channel name.
        counted: Segments that count.
    """

    of: Mapping[str, FloatArray]
    variances: Mapping[str, FloatArray]
    counted: npt.NDArray[np.bool_]

    def shared(self, liveliness: float) -> tuple[FloatArray, FloatArray]:
        """Waves that all channels share, see `activity.shared_waves`."""
        return activity.shared_waves(
            np.concatenate(list(self.of.values())),
            np.concatenate(list(self.variances.values())),
            self.counted,
            liveliness,
        )

    def own(self, name: str) -> FloatArray:
        """A channel's in the segments that count, without what all share."""
        sizes, _ = self.shared(activity.USUAL_LIVELINESS)
        shared = sizes @ activity.waves(self.counted, activity.USUAL_LIVELINESS)
        return np.asarray((self.of[name] - shared)[:, self.counted])


def _changes(comparison: Comparison, station: Station) -> _Changes:
    simulated = comparison.simulate(station)
    counted = comparison.measured.counted
    speed = float(np.mean(comparison.speed))
    changes, variances = {}, {}
    for channel in comparison.channels:
        change = comparison.measured.levels[channel.name] - simulated.levels[channel.name]
        changes[channel.name] = activity.contrasts(change, counted)
        variances[channel.name] = activity.sampling_variance(channel, speed, comparison.grid)
    return _Changes(changes, variances, counted)


def _liveliness(comparisons: Sequence[Comparison], station: Station) -> float:
    """Standard deviation of the slowest change of the eddies' power that all channels share.

    By expectation and maximisation; the usual one counts as much as a few healthy days.
    """
    found = [_changes(comparison, station) for comparison in comparisons]
    own = activity.USUAL_LIVELINESS
    for _ in range(LIVELINESS_STEPS):
        total = LIVELINESS_PRIOR_DAYS * activity.USUAL_LIVELINESS**2
        for changes in found:
            sizes, unknown = changes.shared(own)
            total += own**2 * float(np.mean(sizes**2 + np.diag(unknown)))
        own = float(np.sqrt(total / (LIVELINESS_PRIOR_DAYS + len(found))))
    return own


def _activity_excess(
    comparisons: Sequence[Comparison], station: Station, name: str
) -> FloatArray:
    """Variance of the levels of quick eddies over that of as many independent coefficients.

    Of single segments or of means of a few, whichever scatter more: what lasts for minutes on
    healthy days looks like what begins inside a record.
    """
    totals = np.full((2, activity.BANDS), ACTIVITY_PRIOR_STRENGTH * USUAL_ACTIVITY_EXCESS)
    weights = np.full((2, activity.BANDS), ACTIVITY_PRIOR_STRENGTH)
    for comparison in comparisons:
        changes = _changes(comparison, station)
        change, sampling = changes.own(name), changes.variances[name]
        seen = np.isfinite(sampling)
        for k, together in enumerate((1, FEW_SEGMENTS)):
            groups = change.shape[1] // together
            if groups < 2:
                continue
            means = change[:, : groups * together].reshape(-1, groups, together).mean(axis=2)
            squares = together * np.sum(means**2, axis=1) / np.where(seen, sampling, 1.0)
            totals[k] += np.where(seen, squares, 0.0)
            weights[k] += np.where(seen, groups - 1.0, 0.0)
    return np.asarray(np.max(totals / weights, axis=0))


def _noise(
    comparisons: Sequence[Comparison], station: Station, baseline: Baseline, name: str
) -> tuple[FloatArray, FloatArray]:
    """Mean and deviation of the residual's level."""
    channel = next(c for c in channels_of(station) if c.name == name)
    known = baseline.channels[name]
    return learnt_levels(
        np.array([levels(c, c.simulate(station), known, channel)[0] for c in comparisons])
    )


def complete(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings in which every instrument says something; the others are not healthy.

    Raises:
        UserError: There is none of which that is true.
    """
    silent = {
        k: silent_instruments(recording, recording.station)
        for k, recording in enumerate(recordings)
    }
    kept = [recording for k, recording in enumerate(recordings) if not silent[k]]
    if recordings and not kept:
        what = " and ".join(f"'{s.instrument}' has no {s.signal} on {s.topic}" for s in silent[0])
        raise UserError(
            f"{what}: a recording in which an instrument says nothing is not healthy.",
            recordings[0].name,
            "Look at its cable, its driver and the topic, or take it out of the station file.",
        )
    return kept


def learn(
    recordings: Sequence[Recording],
    station: Station | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Baseline:
    """Learn what healthy recordings of one station show.

    Args:
        recordings: Healthy recordings; none gives a baseline from certificate tolerances.
        station: The station; None: that of the first recording.
        workers: Processes.
        progress: Called with the share done.

    Recordings in which an instrument says nothing are left out.

    Raises:
        UserError: A recording cannot be compared, or an instrument says nothing in any.
    """
    recordings = complete(recordings)
    if station is None:
        station = recordings[0].station
    baseline = default_baseline(station)
    if not recordings:
        return baseline
    comparisons = [prepare(r, station) for r in recordings]
    names = [c.name for c in channels_of(station)]

    def of(name: str) -> list[Comparison]:
        return [c for c in comparisons if any(ch.name == name for ch in c.channels)]

    def updated(known: Baseline, current: Station) -> Baseline:
        channels: dict[str, ChannelBaseline] = dict(known.channels)
        for name in names:
            if not of(name):
                continue
            exponent = _exponents(of(name), name, current)
            channels[name] = replace(channels[name], exponent=exponent)
        known = replace(known, station=current, channels=channels)
        for name in names:
            if not of(name):
                continue
            low = _low_ratios(of(name), current, known, name)
            mean, deviation = _statistics(of(name), current, name)
            noise_mean, noise_deviation = _noise(of(name), current, known, name)
            channels[name] = replace(
                channels[name],
                low_ratio=low,
                statistics_mean=mean,
                statistics_deviation=deviation,
                noise_mean=noise_mean,
                noise_deviation=noise_deviation,
                activity_excess=_activity_excess(of(name), current, name),
            )
        liveliness = _liveliness(comparisons, current)
        return replace(known, channels=channels, liveliness=liveliness)

    baseline = updated(baseline, station)
    place = located(recordings, baseline)
    if progress:
        progress(0.1)
    if place is not None:
        comparisons = [prepare(r, station, place) for r in recordings]
        baseline = updated(replace(default_baseline(station), place=place), station)
    # How much a channel shares with the reference was learnt with the certificate's response.
    rounds = 2 if any(isinstance(e, Propeller) for e in station.instruments) else 1
    for _ in range(rounds):
        baseline = updated(baseline, commissioned(comparisons, baseline.station, baseline))
    if progress:
        progress(0.2)
    rows = in_parallel(
        lambda c: evidence_of(c, baseline),
        comparisons,
        workers,
        (lambda share: progress(0.2 + 0.8 * share)) if progress else None,
    )
    means = standing_means(rows)
    speeds = np.concatenate([c.speed for c in comparisons])
    return replace(
        baseline,
        usual_wind=float(np.quantile(speeds, SELDOM)),
        loudest=loudest_gains(rows, [is_calm(c) for c in comparisons]),
        loudest_in_calm=loudest_gains(rows),
        recordings=tuple(r.name for r in recordings),
        means=means,
        standing=standing_sizes(rows, means),
    )
