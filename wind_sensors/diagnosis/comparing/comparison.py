"""A recording beside the simulation of its station: what the diagnosis works on.

`Comparison` holds everything about one recording that does not depend on the station tried:
the drive, the measured series and statistics, how far the reference can be trusted at each
frequency, how large the residual's noise is. `Comparison.vector` turns a station into one vector of
whitened differences, measured minus simulated, in which a healthy station gives white noise.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.moving import Moving
from wind_sensors.diagnosis.comparing.observation import Channel, where_untold
from wind_sensors.diagnosis.comparing.observing import BANDS, Simulated, View
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import standing_share
from wind_sensors.diagnosis.comparing.reference_place import Place, delayed
from wind_sensors.diagnosis.comparing.turning import where_vanes_follow
from wind_sensors.diagnosis.comparing.untold import as_known_elsewhere
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.errors import UserError
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.encoder import angle_readings
from wind_sensors.simulation.memory import DriveMemory, Memory
from wind_sensors.simulation.pulses import rotor_signals, signals_and_expected
from wind_sensors.simulation.response import Response, respond
from wind_sensors.simulation.wind_at_sensor import WindAtSensors
from wind_sensors.station.changes import segments
from wind_sensors.station.inputs import resolved
from wind_sensors.station.model import Propeller, Rotor, Station
from wind_sensors.station.signals import Angles, Pulses, Recording

FloatArray = npt.NDArray[np.float64]

COURSE, POWER, STATISTICS, ACTIVITY = range(4)
"""Kinds of what is compared: series, power of eddies, statistics of raw signals, and power from
half-minute to half-minute."""

OF_EDDIES = (POWER, ACTIVITY)

LOW_END = 0.02
"""Below this frequency [Hz] effects shape the residual's spectrum more than noise does."""

FASTEST = 1500.0
"""A rotor that turns faster all the time [rad/s] is not a rotor any more."""

SIMULATIONS = 64
"""So many simulated channels are kept: a station that is tried again is not simulated again."""


@dataclass(frozen=True)
class Trust:
    """What a residual of one channel is worth at each coefficient.

    Attributes:
        slope: Share of the simulated coefficient that the instrument is expected to show.
        deviation: Standard deviation of the residual's noise.
        statistics_mean: Healthy mean of measured minus simulated statistics.
        statistics_deviation: Its standard deviation; inf where the statistic is not used.
        activity_deviation: Of measured minus simulated levels, shape (bands,); inf where unseen.
    """

    slope: FloatArray
    deviation: FloatArray
    statistics_mean: FloatArray
    statistics_deviation: FloatArray
    activity_deviation: FloatArray


@dataclass(frozen=True, kw_only=True)
class Comparison(View):
    """One recording, viewed beside simulations of it.

    The station of the view is the one the recording is compared with at first (its own, or as
    commissioned); `expected` deviations of vanes are those it simulates, so that a vane which
    swings through the opposite direction does not jump by a turn in one series only.

    Attributes:
        recording: The recording.
        drive: Wind, motion, air.
        measured: Of the recording.
        place: Where the reference stands; None: unknown.
        memory: What instruments did in `drive`; None: nothing is kept.
        repeated: Share of the reference's samples that only repeated those before them, and were
            left out.
        debounced: Pulses without bounces of the rotors whose contacts bounce. Bounces show one by
            one, so that the series, recorded and simulated, do without them; in the spectra and
            statistics they stay.
        deaf: Rotors whose counter is deaf for a while after each pulse. Which pulse it takes of
            those that come sooner hangs on hundredths of a millisecond, and makes its rate jump:
            its quick eddies tell nothing.
        moving: The mount that moves, in a wind without eddies; None on a mast.
    """

    recording: Recording
    drive: Drive
    measured: Simulated
    place: Place | None = None
    memory: DriveMemory | None = field(default=None, repr=False, compare=False)
    repeated: float = 0.0
    debounced: Mapping[str, Pulses] = field(default_factory=dict, repr=False)
    deaf: frozenset[str] = frozenset()
    moving: Moving | None = field(default=None, repr=False)
    _simulated: Memory = field(
        default_factory=lambda: Memory(SIMULATIONS), init=False, repr=False, compare=False
    )
    _in_slow_wind: Memory = field(
        default_factory=lambda: Memory(SIMULATIONS), init=False, repr=False, compare=False
    )

    def within(self, mask: FloatArray) -> Comparison:
        """The same comparison in the blocks of a mask only, shape (n,)."""
        masked = replace(self, mask=self.masked(mask))
        return masked.measuring()

    def measuring(self) -> Comparison:
        """The same comparison with what is seen of the recording."""
        pulses, angles = self.recording.pulses, self.recording.angles
        measured = self.observe(pulses, angles, {**self.debounced, **self.mended})
        for channel in self.channels:
            if channel.kind == "vane_angle":
                measured = self._completed(measured, channel)
        return replace(self, measured=measured)

    def _completed(self, measured: Simulated, channel: Channel) -> Simulated:
        """What is seen of a recording, with a vane's series where its readings tell nothing."""
        name, instrument = channel.name, channel.instrument
        untold = where_untold(self.recording.angles[instrument], self.grid)
        if not untold.any():
            return measured
        motion = self._expected_by_motion(instrument)
        eddies = self.expected[name] * self.speed - motion
        seen = measured.series[name] - motion
        series = as_known_elsewhere(seen, eddies, untold, self.grid.dt) + motion
        cosine = spectra.to_cosine(self.masked(series))[: self.coefficients]
        return replace(
            measured,
            series={**measured.series, name: series},
            cosine={**measured.cosine, name: cosine},
        )

    @cached_property
    def standing_shares(self) -> Mapping[str, float]:
        """How far few stands make up the readings of each vane, by channel name."""
        return {
            c.name: standing_share(self.recording.angles[c.instrument], self.grid, self.mask)
            for c in self.channels
            if c.kind == "vane_angle"
        }

    def where_vanes_follow(self, explanations: Iterable[Simulated]) -> FloatArray:
        """Weights that are zero while a vane and one of its simulations turn round apart, (n,)."""
        vanes = [c.name for c in self.channels if c.kind == "vane_angle"]
        apart = (
            self.masked(self.measured.series[v] - simulated.series[v]) / self.speed
            for simulated in explanations
            for v in vanes
        )
        return where_vanes_follow(apart, self.speed, self.grid)

    def misfit_outside(self, weights: FloatArray, simulated: Simulated) -> float:
        """Largest share of a vane's squared misfit that lies where weights are small."""
        shares = [0.0]
        for channel in self.channels:
            if channel.kind == "vane_angle":
                name = channel.name
                misfit = self.masked(self.measured.series[name] - simulated.series[name]) ** 2
                shares.append(float(np.sum(misfit * (1.0 - weights)) / max(misfit.sum(), 1e-12)))
        return max(shares)

    def with_reference_at(self, place: Place) -> Comparison:
        """The same, with the wind that comes by if the reference stands so far from where it is
        taken to stand."""
        first = self.station.instrument(self.channels[0].instrument)
        flow = WindAtSensors(self.station, self.drive).flow(first).wind
        drive = delayed(self.drive, flow, place)
        return replace(self, drive=drive, memory=DriveMemory(drive))

    def residual(self, simulated: Simulated, channel: str, slope: FloatArray) -> FloatArray:
        """Cosine coefficients of a channel beyond what is expected of it.

        Args:
            simulated: Best simulation.
            channel: Its name.
            slope: Share of what the wind does in the simulation that is expected, of each.
        """
        seen, expected = self.beyond_motion(simulated, channel)
        return seen - slope * expected

    def beyond_motion(self, simulated: Simulated, channel: str) -> tuple[FloatArray, FloatArray]:
        """Measured and simulated cosine coefficients without what the mount's motion makes.

        Args:
            simulated: The station that moves.
            channel: Its name.
        """
        seen, expected = self.measured.cosine[channel], simulated.cosine[channel]
        if channel not in simulated.by_motion_cosine:
            return seen, expected
        known = simulated.by_motion_cosine[channel]
        return seen - known, expected - known

    @property
    def unseen(self) -> Simulated:
        """Nothing of any channel."""
        counted = self.measured.counted & activity.counted_segments(self.grid, self.mask)
        return Simulated({}, {}, {}, {}, counted)

    def respond(self, station: Station, only: Collection[str] = ()) -> Response:
        """The station's instruments in this recording's wind."""
        known = self.memory is not None and self.memory.drive is self.drive
        return respond(station, self.drive, only=only, memory=self.memory if known else None)

    def affected(self, station: Station, instrument: str) -> tuple[str, ...]:
        """Instruments whose signals depend on a change of one entry of the station."""
        if instrument in (PLATFORM, STATION):
            return tuple(c.instrument for c in self.channels)
        carried = tuple(
            i.name
            for i in station.instruments
            if isinstance(i, Propeller) and i.mounted_on == instrument
        )
        return (instrument, *carried)

    def signals(
        self, station: Station, only: Collection[str] = ()
    ) -> tuple[dict[str, Pulses], dict[str, Angles]]:
        """Simulated pulses and readings; readings carry the stamps of the recorded ones."""
        response = self.respond(station, only)
        pulses = {}
        angles = {}
        for c in self.channels:
            name = c.instrument
            if only and name not in only:
                continue
            if c.kind == "rotor_rate":
                pulses[name] = rotor_signals(self._at_speed(response, name), name)
            else:
                time = self.recording.angles[name].time
                angles[name] = Angles(time, angle_readings(response, name, time))
        return pulses, angles

    def _at_speed(self, response: Response, rotor: str) -> Response:
        """The response, if the rotor keeps to what rotors can.

        Raises:
            UserError: It runs away.
        """
        turned = response.rotors[rotor].psi[-1]
        if not np.isfinite(turned) or abs(turned) > FASTEST * len(self.drive) * self.drive.dt:
            raise UserError(
                f"'{rotor}' runs away in this wind.",
                self.recording.name,
                "Is the reference in m/s, and are the rotor's constants those of its certificate?",
            )
        return response

    def simulate(
        self,
        station: Station,
        only: Collection[str] = (),
        rest: Simulated | None = None,
        with_motion: bool = True,
    ) -> Simulated:
        """Series and statistics of a station in this recording's wind.

        Args:
            station: The station.
            only: Instruments to simulate; empty: all.
            rest: Simulation to take the other instruments from.
            with_motion: Tell apart what the known motion of the mount does.
        """
        simulated = self._with_motion if with_motion else self._simulated_alone
        seen = self.unseen if rest is None else rest
        for channel in self.channels:
            if not only or channel.instrument in only:
                seen = seen.with_others(simulated(station, channel.instrument))
        return seen

    def possible(
        self,
        station: Station,
        only: Collection[str] = (),
        rest: Simulated | None = None,
        with_motion: bool = True,
    ) -> Simulated | None:
        """The same; None for a station that cannot be (its rotor runs away, its log is absurd)."""
        try:
            return self.simulate(station, only, rest, with_motion)
        except (UserError, ValueError):
            return None

    def _with_motion(self, station: Station, instrument: str) -> Simulated:
        """Series and statistics of one instrument, and what the mount's motion makes of it."""
        seen = self._simulated_alone(station, instrument)
        if self.moving is None:
            return seen
        # The instruments are those believed in: a second simulation of each is not worth its time.
        believed = self.moving.station
        others = tuple(c for c in believed.changes if c.instrument != PLATFORM)
        changes = (*others, *(c for c in station.changes if c.instrument == PLATFORM))
        moved = {"platform": station.platform, "changes": changes}
        series, cosine = self._by_motion(
            believed.model_copy(update=moved), instrument, self.moving
        )
        (name,) = seen.series
        return replace(seen, by_motion={name: series}, by_motion_cosine={name: cosine})

    def _expected_by_motion(self, instrument: str) -> FloatArray:
        """What the mount's motion is expected to make of an instrument's series, shape (n,)."""
        if self.moving is None:
            return np.zeros(self.grid.n)
        return self._by_motion(self.moving.station, instrument, self.moving)[0]

    def _by_motion(
        self, station: Station, instrument: str, moving: Moving
    ) -> tuple[FloatArray, FloatArray]:
        """Series and coefficients of one instrument in a wind without eddies."""
        (channel,) = (c for c in self.channels if c.instrument == instrument)

        def course() -> tuple[FloatArray, FloatArray]:
            slow = replace(self, drive=moving.drive, memory=moving.memory)
            pulses, angles = slow.signals(station, (instrument,))
            rotor = channel.kind == "rotor_rate"
            return self.course_of(channel, pulses[instrument] if rotor else angles[instrument])

        return self._in_slow_wind.of(
            (instrument, station.platform, repr(station.changes)), course
        )

    def _simulated_alone(self, station: Station, instrument: str) -> Simulated:
        """Series and statistics of one instrument."""
        reaching = self._reaching(station, instrument)
        changes = tuple(c for c in station.changes if c.instrument in {*reaching, PLATFORM})
        parts = tuple(station.instrument(name) for name in reaching)
        heading = station.sensor_heading_deg
        key = (instrument, parts, station.platform, heading, repr(changes))
        alone = station.model_copy(update={"changes": changes})
        if not self._by_chance(alone, instrument):
            return self._simulated.of(
                key, lambda: self.observe(*self.signals(alone, (instrument,)))
            )
        return self._simulated.of(key, lambda: self._drawn_and_expected(alone, instrument))

    def _drawn_and_expected(self, station: Station, rotor: str) -> Simulated:
        """What is seen of a rotor of whose edges chance takes or doubles some."""
        response = self._at_speed(self.respond(station, (rotor,)), rotor)
        drawn, expected = signals_and_expected(
            response, rotor, rotor not in self.debounced, rotor not in self.mended
        )
        return self.observe({rotor: drawn}, {}, {rotor: expected})

    def _by_chance(self, station: Station, instrument: str) -> bool:
        """Whether chance takes or doubles edges of an instrument."""
        rotors = [
            entry
            for part in segments(station)
            if isinstance(entry := part.station.instrument(instrument), Rotor)
            and resolved(entry.pulses, "pulses").meaning != "angle"
        ]
        electronics = [rotor.electronics for rotor in rotors]
        return any(
            e.bounce_probability > 0.0 or e.loss_probability > 0.0 or e.dead_time > 0.0
            for e in electronics
        )

    def _reaching(self, station: Station, instrument: str) -> tuple[str, ...]:
        """Instruments on which the signals of one depend: itself and what carries it."""
        own = station.instrument(instrument)
        if isinstance(own, Propeller) and own.mounted_on:
            return instrument, own.mounted_on
        return (instrument,)

    def observe(
        self,
        pulses: Mapping[str, Pulses],
        angles: Mapping[str, Angles],
        expected_pulses: Mapping[str, Pulses] | None = None,
    ) -> Simulated:
        """As `View.observe`, with the segments that are counted in the recording."""
        return self.unseen.with_others(super().observe(pulses, angles, expected_pulses))

    def coherence(self, simulated: Simulated, channel: Channel) -> spectra.Coherence:
        """Coherence of measured and simulated series, a vane's with its slow turning included."""
        name = channel.name
        measured, expected = self.measured.series[name], simulated.series[name]
        if channel.kind == "vane_angle":
            slow = (self.direction - np.mean(self.direction)) * self.speed
            measured, expected = measured + slow, expected + slow
        n = self.coefficients
        measured, expected = (
            spectra.to_cosine(self.masked(series))[:n] - simulated.by_motion_cosine.get(name, 0.0)
            for series in (measured, expected)
        )
        return spectra.coherence_of(measured, expected, self.grid.dt, self.grid.n)

    def vector(self, simulated: Simulated, trust: Mapping[str, Trust]) -> FloatArray:
        """Whitened differences of all channels, of all statistics, of all activities."""
        parts = []
        for channel in self.channels:
            t = trust[channel.name]
            parts.append(self.residual(simulated, channel.name, t.slope) / t.deviation)
        for channel in self.channels:
            t = trust[channel.name]
            difference = (
                self.measured.statistics[channel.name]
                - simulated.statistics[channel.name]
                - t.statistics_mean
            )
            parts.append(np.nan_to_num(difference / t.statistics_deviation))
        for channel in self.channels:
            name = channel.name
            change = self.measured.activity(name) - simulated.activity(name)
            parts.append(activity.compressed(change / self._activity_deviation(trust[name])))
        return np.concatenate(parts)

    def _activity_deviation(self, trust: Trust) -> FloatArray:
        """Deviation of each activity, flat."""
        return np.repeat(trust.activity_deviation, self.measured.counted.size)

    @property
    def channel_of_each(self) -> npt.NDArray[np.int_]:
        """Number of the channel to which each of what is compared belongs, shape (l,)."""
        numbers = np.arange(len(self.channels))
        sizes = [self.measured.statistics[c.name].size for c in self.channels]
        activities = [self.measured.levels[c.name].size for c in self.channels]
        return np.concatenate(
            (
                np.repeat(numbers, self.coefficients),
                np.repeat(numbers, sizes),
                np.repeat(numbers, activities),
            )
        )

    @property
    def kind_of_each(self) -> npt.NDArray[np.int_]:
        """Kind of each of what is compared, shape (l,)."""
        statistics = [
            np.where(np.arange(self.measured.statistics[c.name].size) < BANDS, POWER, STATISTICS)
            for c in self.channels
        ]
        activities = sum(self.measured.levels[c.name].size for c in self.channels)
        series = np.full(self.coefficients * len(self.channels), COURSE)
        return np.concatenate((series, *statistics, np.full(activities, ACTIVITY)))

    @property
    def part_of_each(self) -> npt.NDArray[np.int_]:
        """Number of the part to which each of what is compared belongs, shape (l,).

        Parts are kinds of each channel: those of the first kind come first.
        """
        return np.asarray(self.channel_of_each + len(self.channels) * self.kind_of_each)

    def whitened_changes(self, changes: FloatArray, trust: Mapping[str, Trust]) -> FloatArray:
        """How far `vector` falls when what is compared changes.

        Args:
            changes: Of `Simulated.flat`, one change or one a row, shape (..., l) and on a mount
                that moves (..., l + coefficients of all channels).
            trust: Noise of each channel.

        Returns:
            Shape (..., l).
        """
        weights = self.weights(trust)
        whitened = changes[..., : weights.size] * weights
        by_motion = changes[..., weights.size :]
        if by_motion.shape[-1] > 0:
            rest = [(1.0 - t.slope) / t.deviation for t in (trust[c.name] for c in self.channels)]
            whitened[..., : by_motion.shape[-1]] += by_motion * np.concatenate(rest)
        return np.asarray(whitened)

    def whitened_while(
        self,
        channel: Channel,
        without: Simulated,
        corrected: Simulated,
        trust: Mapping[str, Trust],
        weights: FloatArray,
    ) -> FloatArray:
        """Whitened coefficients of what changes in one channel, weighted in time.

        Args:
            channel: Of the comparison.
            without, corrected: Simulations before and after.
            trust: Noise of each channel.
            weights: Weights of the bins, shape (..., n).

        Returns:
            Shape (..., coefficients).
        """
        name = channel.name
        t = trust[name]
        changed = self.masked(corrected.series[name] - without.series[name])
        if not np.any(changed):
            return np.zeros((*weights.shape[:-1], self.coefficients))
        whitened = t.slope * spectra.to_cosine(weights * changed)[..., : self.coefficients]
        if name in without.by_motion:
            moved = self.masked(corrected.by_motion[name] - without.by_motion[name])
            share = (1.0 - t.slope) * spectra.to_cosine(weights * moved)[..., : self.coefficients]
            whitened = whitened + share
        return np.asarray(whitened / t.deviation)

    def weights(self, trust: Mapping[str, Trust]) -> FloatArray:
        """How far `vector` falls when what is compared rises by one, shape (l,)."""
        parts = [trust[c.name].slope / trust[c.name].deviation for c in self.channels]
        for channel in self.channels:
            seen = np.isfinite(self.measured.statistics[channel.name])
            deviation = trust[channel.name].statistics_deviation
            parts.append(np.where(seen, 1.0 / deviation, 0.0))
        parts.extend(1.0 / self._activity_deviation(trust[c.name]) for c in self.channels)
        return np.concatenate(parts)

    def residual_series(
        self, simulated: Simulated, trust: Mapping[str, Trust]
    ) -> dict[str, FloatArray]:
        """Measured minus expected series of each channel, below the highest frequency."""
        out = {}
        for channel in self.channels:
            name = channel.name
            full = np.zeros(self.grid.n)
            difference = self.residual(simulated, name, trust[name].slope)
            full[: difference.size] = difference
            out[name] = spectra.from_cosine(full)
        return out
