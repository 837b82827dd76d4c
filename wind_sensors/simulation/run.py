"""Wind to signals: a scenario and a station become a recording, at once or as an endless stream.

The stream computes in blocks of a fixed length whatever length is asked for, and every random
number belongs to an event, so that the same seed gives the same signals to the bit, live and
offline.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.motion.platform_track import Motion, sampled
from wind_sensors.simulation import random_numbers
from wind_sensors.simulation.blocks import SignalBlock, joined, split
from wind_sensors.simulation.carrier import Carrier, reported_with_noise
from wind_sensors.simulation.clocks import stamps
from wind_sensors.simulation.drive import Drive, air_density
from wind_sensors.simulation.encoder import AngleEncoder
from wind_sensors.simulation.pulses import PulseCircuit, passed_slots
from wind_sensors.simulation.response import Response, ResponseState, respond
from wind_sensors.simulation.scenario import Scenario
from wind_sensors.simulation.trajectories import Trajectory
from wind_sensors.simulation.wind_field import MeasuredWind, TurbulentWind, WindSource
from wind_sensors.station.model import Angle, Bivane, Rotor, Station
from wind_sensors.station.moments import nanoseconds
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Recording,
    Series,
    TimeArray,
    Winds,
)

FloatArray = npt.NDArray[np.float64]

BLOCK_SECONDS = 10.0
"""Length of the blocks in which everything is computed [s]."""
FINER_RECORD = 4.0
"""How much finer than the grid the turbulence is that a moving carrier passes through: one that
goes with the wind passes slowly and must still meet gusts of every size that its grid can carry."""


def recording_start(station: Station) -> int:
    """Start of the recording that the station file states [ns since 1970].

    The station's validation lets nothing else through than a moment.
    """
    return nanoseconds(station.recording.start)


class SignalStream:
    """The signals of a station in a scenario, without end.

    Args:
        station: The station with its effects.
        scenario: Wind, movement and rates; its duration does not matter here.
        start: Time of the first sample [ns]; None: the station file's.

    Raises:
        UserError: The scenario does not fit the station.
    """

    def __init__(self, station: Station, scenario: Scenario, start: int | None = None) -> None:
        self.station = station
        self.scenario = scenario
        self.start = recording_start(station) if start is None else start
        self._wind = _source(station, scenario)
        self._dt = 1.0 / scenario.sample_rate
        self._steps = max(round(BLOCK_SECONDS * scenario.sample_rate), 1)
        self._block = 0
        self._state: ResponseState | None = None
        self._carrier = _carrier(station, scenario, self._wind, self.start, self._dt)
        seed = scenario.seed
        self._circuits = {
            i.name: PulseCircuit(i.name, self.start, seed)
            for i in station.instruments
            if isinstance(i, Rotor)
        }
        self._encoders = {
            name: AngleEncoder(name, self.start, seed) for name in _angle_names(station)
        }
        self._ready: SignalBlock | None = None

    def next_block(self) -> SignalBlock:
        """The signals of the next `BLOCK_SECONDS`."""
        first = self._block * self._steps
        time = (first + np.arange(self._steps + 1, dtype=np.float64)) * self._dt
        motion: Motion | None = None
        if self._carrier is None:
            wind, beside = self._wind.along(time, time)
        else:
            motion, wind, beside = self._carrier.move(time)
        temperature = self._temperature(time)
        drive = Drive(
            start_ns=self._at(float(time[0])),
            dt=self._dt,
            wind=wind,
            motion=motion,
            temperature=temperature,
            density=air_density(temperature, self.scenario.pressure),
            elapsed=float(time[0]),
            motion_is_true=True,
        )
        response = respond(self.station, drive, self._state)
        self._state = response.final
        self._block += 1
        return self._sampled(response, motion, beside)

    def read(self, until: int) -> SignalBlock:
        """All signals not read yet that are stamped before a time [ns]."""
        needed = until + self._stamped_ahead(until)
        while self._ready is None or self._ready.stop < needed:
            block = self.next_block()
            self._ready = block if self._ready is None else joined([self._ready, block])
        wanted, self._ready = split(self._ready, until)
        return wanted

    def _stamped_ahead(self, until: int) -> int:
        """How long before its measurement a signal may be stamped [ns]: clocks that run late."""
        elapsed = (until - self.start) * 1e-9
        clocks = [i.clock for i in self.station.instruments]
        if self.station.platform is not None:
            clocks.append(self.station.platform.clock)
        return round(1e9 * max(0.0, *(-c.latency - c.drift * elapsed for c in clocks)))

    def _at(self, seconds: float) -> int:
        return self.start + round(seconds * 1e9)

    def _temperature(self, time: FloatArray) -> FloatArray:
        s = self.scenario
        slow = np.sin(2.0 * np.pi * time / s.temperature_period)
        return np.asarray(s.temperature + s.temperature_amplitude * slow)

    def _instants(self, begin: float, end: float, rate: float) -> npt.NDArray[np.int64]:
        """Numbers of the samples at a rate in [begin, end)."""
        first = int(np.ceil(begin * rate - 1e-6))
        stop = int(np.ceil(end * rate - 1e-6))
        return np.arange(first, stop, dtype=np.int64)

    def _times(self, begin: float, end: float, rate: float) -> tuple[FloatArray, TimeArray]:
        seconds = self._instants(begin, end, rate).astype(np.float64) / rate
        return seconds, self.start + np.rint(seconds * 1e9).astype(np.int64)

    def _sampled(
        self, response: Response, motion: Motion | None, beside: FloatArray
    ) -> SignalBlock:
        drive, scenario, station = response.drive, self.scenario, self.station
        begin = drive.elapsed
        end = begin + self._steps * self._dt
        grid = begin + self._dt * np.arange(len(drive), dtype=np.float64)
        reference = None
        if station.reference is not None:
            reference = self._reference(grid, beside, begin, end)
        air_seconds, air_times = self._times(begin, end, scenario.air_rate)
        temperature = pressure = None
        if station.air.temperature is not None:
            temperature = Series(air_times, self._temperature(air_seconds))
        if station.air.pressure is not None:
            pressure = Series(air_times, np.full(air_seconds.shape, scenario.pressure))
        return SignalBlock(
            start=drive.start_ns,
            stop=self._at(end),
            pulses={
                n: c.signals(passed_slots(response, n)) for n, c in self._circuits.items()
            },
            angles={n: self._angles(n, response, begin, end) for n in self._encoders},
            reference=reference,
            platform=None if motion is None else self._platform(response, motion, begin, end),
            temperature=temperature,
            pressure=pressure,
            truth=Winds(drive.times_ns[:-1], drive.wind[:-1]),
        )

    def _angles(self, name: str, response: Response, begin: float, end: float) -> Angles:
        drive = response.drive
        parts = []
        for stretch in response.stretches:
            vane = stretch.segment.station.instrument(name.split("/", maxsplit=1)[0])
            low = max(begin, drive.elapsed + stretch.first * self._dt)
            high = min(end, drive.elapsed + stretch.last * self._dt)
            _, measured = self._times(low, high, self.scenario.vane_rate)
            parts.append(stamps(vane.clock, measured, self.start))
        stamped = np.concatenate(parts)
        return Angles(stamped, self._encoders[name].readings(response, stamped))

    def _reference(self, grid: FloatArray, beside: FloatArray, begin: float, end: float) -> Winds:
        assert self.station.reference is not None
        rate = self.scenario.reference_rate
        numbers = self._instants(begin, end, rate)
        seconds, times = self._times(begin, end, rate)
        velocity = np.stack([np.interp(seconds, grid, beside[:, k]) for k in range(3)], axis=1)
        noise = self.station.reference.noise
        if noise > 0.0 and self.station.reference.kind != "truth":
            for k in range(3):
                draw = random_numbers.normal(self.scenario.seed, f"reference/{k}", numbers)
                velocity[:, k] += noise * draw
        return Winds(times, velocity)

    def _platform(
        self, response: Response, motion: Motion, begin: float, end: float
    ) -> PlatformStates:
        """Reported states, each stretch with the platform's errors of that time."""
        seed = self.scenario.seed if self.scenario.platform_noise else None
        parts = []
        for stretch in response.stretches:
            platform = stretch.segment.station.platform
            assert platform is not None
            low = max(begin, response.drive.elapsed + stretch.first * self._dt)
            high = min(end, response.drive.elapsed + stretch.last * self._dt)
            seconds, times = self._times(low, high, self.scenario.platform_rate)
            here = sampled(motion, self._dt, seconds - begin)
            shown = reported_with_noise(platform, here, seconds, seed)
            parts.append((stamps(platform.clock, times, self.start), shown))
        return PlatformStates(
            time=np.concatenate([t for t, _ in parts]),
            attitude=np.concatenate([m.attitude for _, m in parts]),
            velocity=np.concatenate([m.velocity for _, m in parts]),
            angular_rate=np.concatenate([m.angular_rate for _, m in parts]),
            position=np.concatenate([m.position for _, m in parts]),
        )


def simulate(
    station: Station,
    scenario: Scenario,
    name: str = "simulation",
    start: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """The recording that a station would have made in a scenario.

    Args:
        station: The station with its effects.
        scenario: Wind, movement, rates, duration.
        name: Name of the recording.
        start: Time of the first sample [ns]; None: the station file's.
        progress: Called with the simulated seconds after each block.

    Returns:
        All signals with the true wind at the sensor; transport faults are not applied.

    Raises:
        UserError: The scenario does not fit the station.
    """
    stream = SignalStream(station, scenario, start)
    stop = stream.start + round(scenario.duration * 1e9)
    blocks: list[SignalBlock] = []
    while not blocks or blocks[-1].stop < stop:
        blocks.append(stream.next_block())
        if progress is not None:
            progress(min((blocks[-1].stop - stream.start) * 1e-9, scenario.duration))
    signals, _ = split(joined(blocks), stop)
    return Recording(
        name=name,
        station=station,
        start=stream.start,
        stop=stop,
        pulses=signals.pulses,
        angles=signals.angles,
        reference=signals.reference,
        platform=signals.platform,
        temperature=signals.temperature,
        pressure=signals.pressure,
        truth=signals.truth,
    )


def _angle_names(station: Station) -> list[str]:
    names = []
    for instrument in station.instruments:
        if isinstance(instrument, Angle):
            names.append(instrument.name)
        if isinstance(instrument, Bivane):
            names.append(f"{instrument.name}/elevation")
    return names


def _source(station: Station, scenario: Scenario) -> WindSource:
    if isinstance(scenario.wind, Winds):
        wind = MeasuredWind(scenario.wind)
        if wind.duration + 1.0 / scenario.sample_rate < scenario.duration:
            raise UserError(
                f"The wind lasts {wind.duration:.1f} s, the simulation {scenario.duration:.1f} s.",
                "wind",
                "Simulate a shorter time, or give a longer wind.",
            )
        return wind
    try:
        finer = 1.0 if station.platform is None else FINER_RECORD
        return TurbulentWind(scenario.wind, finer * scenario.sample_rate, station.reference)
    except ValueError as problem:
        raise UserError(
            f"The wind cannot be made: {problem}.", "wind", "Change its parameters."
        ) from problem


def _carrier(
    station: Station, scenario: Scenario, wind: WindSource, start: int, dt: float
) -> Carrier | None:
    if station.platform is None:
        if scenario.trajectory is not None:
            raise UserError(
                "The scenario moves a platform, but the station stands on a mast.",
                "trajectory",
                "Give the station a `platform`, or leave the trajectory out.",
            )
        return None
    trajectory = scenario.trajectory if scenario.trajectory is not None else Trajectory()
    return Carrier(trajectory, wind, start, dt)
