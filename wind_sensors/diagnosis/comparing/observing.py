"""What a comparison sees of signals: series, spectra and statistics of every channel.

`View` looks at a recording and at its simulations in the same way. What it sees is a `Simulated`,
which `comparison` compares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.observation import (
    LOWEST_BAND_FREQUENCY,
    NORMALISED_BANDS,
    Channel,
    Grid,
    angle_series,
    rate_series,
)
from wind_sensors.diagnosis.comparing.raw_statistics.changes import (
    change_statistics,
    windy_changes,
)
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import interval_statistics
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import (
    erratic_statistics,
    step_statistics,
    stillness_statistics,
)
from wind_sensors.motion.frames import wrap
from wind_sensors.station.model import Rotor, Station
from wind_sensors.station.signals import Angles, Pulses

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

HIGHEST_FREQUENCY = 1.25
"""Series are compared below this frequency [Hz]; above, only spectra are."""

HIGHEST_OF_RATES = 2.2
"""Spectra of rotors' rates end here [Hz]: bins of a rate see no more."""

HIGHEST_OF_READINGS = 0.4
"""Spectra of vanes end at this share of the rate at which they are read."""

BANDS = len(NORMALISED_BANDS) - 1

LEAST_COUNTED = 0.01
"""A record is never taken to count for less than this share of its time."""


@dataclass(frozen=True)
class Simulated:
    """Series and statistics of the signals of one station, simulated or measured.

    Attributes:
        cosine: Cosine coefficients of each channel's series up to `HIGHEST_FREQUENCY`, by name.
        series: The series, by channel name: m/s for a rotor, lateral m/s for a vane.
        statistics: By channel name: log spectra in the normalised bands (nan: band not seen),
            followed by what `STATISTICS` lists for its kind.
        levels: By channel name: logarithm of the power of quick eddies in each segment, shape
            (bands, segments).
        counted: Segments that count, shape (segments,).
        chance: By channel name: variance that pulses lost or bouncing by chance add to each slow
            coefficient; a channel that has none is left out.
        by_motion: By channel name: what the known motion of the mount makes of the series in a wind
            without eddies; empty on a mast.
        by_motion_cosine: Its coefficients.
    """

    cosine: dict[str, FloatArray]
    series: dict[str, FloatArray]
    statistics: dict[str, FloatArray]
    levels: dict[str, FloatArray]
    counted: npt.NDArray[np.bool_]
    chance: dict[str, float] = field(default_factory=dict)
    by_motion: dict[str, FloatArray] = field(default_factory=dict)
    by_motion_cosine: dict[str, FloatArray] = field(default_factory=dict)

    def with_others(self, others: Simulated) -> Simulated:
        """The same with channels taken from another."""
        return Simulated(
            {**self.cosine, **others.cosine},
            {**self.series, **others.series},
            {**self.statistics, **others.statistics},
            {**self.levels, **others.levels},
            self.counted,
            {**{k: v for k, v in self.chance.items() if k not in others.series}, **others.chance},
            {**self.by_motion, **others.by_motion},
            {**self.by_motion_cosine, **others.by_motion_cosine},
        )

    def activity(self, channel: str) -> FloatArray:
        """Levels of a channel beyond their mean over the segments that count, flat."""
        return activity.contrasts(self.levels[channel], self.counted).ravel()

    def flat(self, channels: Sequence[Channel], with_motion: bool = True) -> FloatArray:
        """What is compared: coefficients of all channels, all statistics, all activities, (l,).

        On a mount that moves, the coefficients that its motion makes follow.

        Args:
            channels: Of the comparison.
            with_motion: Let them follow.
        """
        return np.concatenate(
            [self.cosine[c.name] for c in channels]
            + [self.statistics[c.name] for c in channels]
            + [self.activity(c.name) for c in channels]
            + [
                self.by_motion_cosine[c.name]
                for c in channels
                if with_motion and self.by_motion_cosine
            ]
        )


@dataclass(frozen=True)
class View:
    """How signals of a recording's time are looked at.

    Attributes:
        station: Gives the rotors' constants.
        grid: Bins of the series.
        channels: What is looked at.
        direction: Slow direction the apparent wind comes from, at the bins, continuous [rad].
        speed: Slow apparent wind speed at the bins [m/s].
        wind_from: Direction the apparent wind comes from at the bins, continuous [rad].
        mask: Weight of each bin, 1 inside the blocks that count, 0 outside; None: all count.
        expected: Deviation of each vane from `direction` that is expected [rad], by channel name.
            Deviations are counted on the turn that lies nearest to it.
        departure: Slow departure of a vane that stays far from there [rad], by channel name.
        across: Of each propeller the wind in its plane of rotation at the bins, as a complex
            number, relative to the slow wind.
        mended: Pulses of the rotors that lose some of them by chance, with those put back. All but
            the statistics of intervals, recorded and simulated, is seen with them.
    """

    station: Station
    grid: Grid
    channels: tuple[Channel, ...]
    direction: FloatArray
    speed: FloatArray
    wind_from: FloatArray
    mask: FloatArray | None = None
    expected: Mapping[str, FloatArray] = field(default_factory=dict)
    departure: Mapping[str, FloatArray] = field(default_factory=dict)
    across: Mapping[str, ComplexArray] = field(default_factory=dict, repr=False)
    mended: Mapping[str, Pulses] = field(default_factory=dict, repr=False)

    @property
    def coefficients(self) -> int:
        """Number of cosine coefficients compared in each channel."""
        return min(self.grid.n, int(2.0 * self.grid.n * self.grid.dt * HIGHEST_FREQUENCY))

    @property
    def counted_share(self) -> float:
        """Share of the record that counts, no less than `LEAST_COUNTED`.

        As much less is known than of a whole one.
        """
        return 1.0 if self.mask is None else max(float(np.mean(self.mask**2)), LEAST_COUNTED)

    @property
    def counted_time(self) -> float:
        """So much of the record counts [s]."""
        return self.counted_share * self.grid.n * self.grid.dt

    @cached_property
    def mean_speed(self) -> float:
        """Of the slow wind [m/s]."""
        return float(np.mean(self.speed))

    @cached_property
    def counted_segments(self) -> npt.NDArray[np.bool_]:
        """Segments all of whose bins count, shape (segments,)."""
        return activity.counted_segments(self.grid, self.mask)

    @cached_property
    def _windy_changes(self) -> npt.NDArray[np.bool_]:
        return windy_changes(self.speed, self.mask)

    def masked(self, values: FloatArray) -> FloatArray:
        """Values of the bins with those outside the mask set to zero."""
        return values if self.mask is None else values * self.mask

    def observe(
        self,
        pulses: Mapping[str, Pulses],
        angles: Mapping[str, Angles],
        expected_pulses: Mapping[str, Pulses] | None = None,
    ) -> Simulated:
        """Series and statistics of pulses and readings; of those channels that have any.

        Args:
            pulses: Of rotors.
            angles: Of vanes.
            expected_pulses: For the series alone, where chance took part in `pulses`: which of
                them it hit says nothing, and would hide what moves the series by as little.
        """
        seen = Simulated({}, {}, {}, {}, self.counted_segments)
        for channel in self.channels:
            name = channel.instrument
            if channel.kind == "vane_angle":
                if name in angles:
                    seen = seen.with_others(self._vane(channel, angles[name]))
            elif name in pulses:
                on_average = (expected_pulses or {}).get(name)
                seen = seen.with_others(self._rotor(channel, pulses[name], on_average))
        return seen

    def course_of(
        self, channel: Channel, signals: Pulses | Angles
    ) -> tuple[FloatArray, FloatArray]:
        """The series of one channel alone, shape (n,), and its coefficients that are compared.

        Args:
            channel: What is looked at.
            signals: Of its instrument.
        """
        if isinstance(signals, Pulses):
            rotor = self.station.instrument(channel.instrument)
            assert isinstance(rotor, Rotor)
            series = rate_series(signals, rotor, self.grid)
            return series, self._cosine(series)[: self.coefficients]
        series = self._deviation(channel, signals) * self.speed
        return series, spectra.to_cosine(self.masked(series))[: self.coefficients]

    def _rotor(self, channel: Channel, pulses: Pulses, on_average: Pulses | None) -> Simulated:
        rotor = self.station.instrument(channel.instrument)
        assert isinstance(rotor, Rotor)
        whole = pulses if on_average is None or rotor.name not in self.mended else on_average
        drawn = rate_series(whole, rotor, self.grid)
        series, cosine = drawn, self._cosine(drawn)
        statistics = (
            self._log_spectrum(cosine, self.grid.dt, channel, HIGHEST_OF_RATES),
            interval_statistics(
                pulses, rotor, self._across(rotor), self.speed, self.grid, self.mask
            ),
            change_statistics(drawn, self._windy_changes),
        )
        if on_average is None or whole is on_average:
            return self._of_one(channel, series, cosine, statistics, drawn)
        series = rate_series(on_average, rotor, self.grid)
        cosine = self._cosine(series)
        seen = self._of_one(channel, series, cosine, statistics, drawn)
        return replace(seen, chance={channel.name: self._variance_by_chance(on_average, rotor)})

    def _across(self, rotor: Rotor) -> ComplexArray:
        """Wind across a rotor's shaft, as a complex number; across a cup's blows all of it."""
        return self.across.get(rotor.name, self._directed)

    @cached_property
    def _directed(self) -> ComplexArray:
        return np.asarray(np.exp(1j * self.wind_from))

    def _variance_by_chance(self, on_average: Pulses, rotor: Rotor) -> float:
        """Variance that edges drawn one by one add to each slow coefficient of a rate.

        Args:
            on_average: Edges, with as many turns each as chance makes of it; without turns chance
                takes no part.
            rotor: Whose they are.
        """
        if on_average.turns is None:
            return 0.0
        slots = rotor.pulses_per_revolution
        way = 2.0 * np.pi * rotor.calibration_distance / slots
        at = self.grid.seconds(on_average.time)
        weight = self.masked(np.ones(self.grid.n))
        drawn = _drawn(at, on_average.turns, slots, weight, self.grid.dt)
        return drawn * way**2 / (self.grid.n * self.grid.dt**2)

    def _vane(self, channel: Channel, readings: Angles) -> Simulated:
        expected = self.expected.get(channel.name)
        deviation = self._deviation(channel, readings)
        angle = deviation + self.direction
        followed = (deviation if expected is None else expected) + self.direction
        statistics = (
            self._vane_spectrum(readings, channel),
            stillness_statistics(angle, followed, self.speed, self.mask),
            erratic_statistics(readings, self.direction, self.grid, self.mask),
            step_statistics(readings, self.grid, self.mask),
            change_statistics(angle, self._windy_changes),
        )
        series = deviation * self.speed
        cosine = spectra.to_cosine(self.masked(series))
        return self._of_one(channel, series, cosine, statistics, series)

    def _deviation(self, channel: Channel, readings: Angles) -> FloatArray:
        """Deviation of a vane from the slow direction [rad], shape (n,)."""
        expected = self.expected.get(channel.name)
        turned = angle_series(readings, self.direction, self.grid, expected)
        return self._nearest_turn(channel, turned)

    def _of_one(
        self,
        channel: Channel,
        series: FloatArray,
        cosine: FloatArray,
        statistics: Sequence[FloatArray],
        drawn: FloatArray,
    ) -> Simulated:
        """What is seen of one channel."""
        return Simulated(
            {channel.name: cosine[: self.coefficients]},
            {channel.name: series},
            {channel.name: np.concatenate(statistics)},
            {channel.name: activity.levels(drawn, channel, self.mean_speed, self.grid)},
            self.counted_segments,
        )

    def _cosine(self, values: FloatArray) -> FloatArray:
        """Cosine coefficients of a rate, the slowest from its mean."""
        full = spectra.to_cosine(self.masked(values - np.mean(values)))
        full[0] = np.sqrt(values.size) * np.mean(self.masked(values))
        return full

    def _nearest_turn(self, channel: Channel, deviation: FloatArray) -> FloatArray:
        """Deviations of a vane at the bins, by whole turns where they are expected."""
        expected = self.expected.get(channel.name)
        if expected is None:
            return deviation
        expected = expected + self.departure.get(channel.name, 0.0)
        turns = np.rint((deviation - expected) / (2.0 * np.pi))
        return np.asarray(deviation - 2.0 * np.pi * turns, dtype=np.float64)

    def _without_jumps(
        self, channel: Channel, deviation: FloatArray, time: FloatArray
    ) -> FloatArray:
        """Deviations of a vane's readings, continued where it turns round: to count it on another
        turn would be a jump that it did not make, with more power than all its eddies.

        Args:
            channel: The vane's.
            deviation: Of each good reading [rad], shape (k,).
            time: Of those [s], shape (k,).
        """
        followed = np.unwrap(deviation)
        expected = self.expected.get(channel.name, np.zeros(self.grid.n))
        expected = expected + self.departure.get(channel.name, 0.0)
        apart = np.median(followed - np.interp(time, self.grid.centres, expected))
        return np.asarray(followed - 2.0 * np.pi * np.rint(apart / (2.0 * np.pi)))

    def _vane_spectrum(self, readings: Angles, channel: Channel) -> FloatArray:
        time = self.grid.seconds(readings.time)
        if time.size < 16:
            return np.full(BANDS, np.nan)
        dt = float(np.median(np.diff(time)))
        around = np.interp(time, self.grid.centres, self.direction)
        deviation = wrap(readings.angle - around)
        good = np.isfinite(deviation) & ~readings.erratic
        if not good.any():
            return np.full(BANDS, np.nan)
        followed = self._without_jumps(channel, deviation[good], time[good])
        followed = np.interp(time, time[good], followed)
        weighted = followed * np.interp(time, self.grid.centres, self.masked(self.speed))
        return self._log_spectrum(
            spectra.to_cosine(np.asarray(weighted)), dt, channel, HIGHEST_OF_READINGS / dt
        )

    def _log_spectrum(
        self, coefficients: FloatArray, dt: float, channel: Channel, highest: float
    ) -> FloatArray:
        """Log mean square of the coefficients in the normalised bands."""
        edges = NORMALISED_BANDS * self.mean_speed / (2.0 * np.pi * channel.length)
        out = np.full(BANDS, np.nan)
        for k in range(BANDS):
            low, high = max(edges[k], LOWEST_BAND_FREQUENCY), min(edges[k + 1], highest)
            inside = coefficients[
                spectra.coefficients_within(coefficients.size, dt, float(low), float(high))
            ]
            if high > 1.1 * low and inside.size >= 20:
                out[k] = np.log(np.mean(inside * inside) + 1e-12)
        return out


@compiled
def _drawn(
    time: FloatArray, turns: FloatArray, slots: int, weight: FloatArray, dt: float
) -> float:
    """Sum of the variances of how often each edge is counted, where bins count.

    Args:
        time: Of the edges [s], shape (n,).
        turns: That there are with each, shape (n,); times `slots` grows by the share with which an
            edge is counted, and by one more if it is counted for certain.
        slots: Per turn.
        weight: Of the bins, shape (bins,).
        dt: Width of a bin [s].
    """
    total, before = 0.0, 0.0
    for i in range(time.size):
        counted = (turns[i] - before) * slots
        before = turns[i]
        bin_of = math.floor(time[i] / dt)
        if 0 <= bin_of < weight.size:
            share = counted - math.floor(counted)
            total += weight[bin_of] ** 2 * share * (1.0 - share)
    return total
