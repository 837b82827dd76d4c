"""The estimator that every node and every command uses: messages in, wind out.

Fed by stamps alone: the same messages give the same bits, live and offline.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import is_kept
from wind_sensors.errors import UserError
from wind_sensors.estimation.array_methods import InverseArrayCore, NaiveArrayCore
from wind_sensors.estimation.bivane_sampling import sampling_health
from wind_sensors.estimation.circumstances import as_calibrated
from wind_sensors.estimation.constants import axes_of, is_array, rotors_of
from wind_sensors.estimation.core import Core, Estimates, joined, part_of, trusted
from wind_sensors.estimation.health import (
    bias_health,
    clock_health,
    estimate_health,
    input_health,
    motion_health,
    window_health,
)
from wind_sensors.estimation.intake import (
    PLATFORM,
    PRESSURE,
    PULSES,
    READINGS,
    TEMPERATURE,
    VELOCITY,
    Block,
    Correction,
    Intake,
)
from wind_sensors.estimation.inverse import InverseCore
from wind_sensors.estimation.kalman import KalmanCore
from wind_sensors.estimation.kalman_kernel import run
from wind_sensors.estimation.naive import NaiveCore
from wind_sensors.estimation.outputs import HealthItem, WindEstimate, WindowStatistics
from wind_sensors.estimation.presence import Presence
from wind_sensors.estimation.recent import Tally
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.timeline import changing_correction
from wind_sensors.estimation.windows import WindowAccumulator
from wind_sensors.station.changes import segments
from wind_sensors.station.model import (
    Angle,
    AnyInstrument,
    Bivane,
    Clock,
    Cup,
    Platform,
    Propeller,
    Station,
)

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_PLATFORM, _TEMPERATURE, _PRESSURE = "platform", "temperature", "pressure"
_VELOCITY = "platform velocity"
_SPEED_MEMORY = 0.9
"""Share of the old value in the running apparent speed, per block."""
_LOOK_AHEAD_NS = (100_000_000, 2_000_000_000)
"""Of the platform's motion, so that it can be interpolated at the end of a block; at most this long
is a slow source waited for."""
_REACH_OF_FITS = 1.0
"""The local fits of `inverse` look ahead by less than this over their bandwidth [1]."""


def _clock(entry: AnyInstrument | Platform) -> Clock:
    """The clock of an entry, with the delay of a low-pass filter as part of its latency."""
    if isinstance(entry, Angle) and entry.filter_time_constant > 0.0:
        late = entry.clock.latency + entry.filter_time_constant
        return entry.clock.model_copy(update={"latency": late})
    return entry.clock


def _clocks(station: Station) -> dict[str, list[tuple[float, Clock]]]:
    """The clock of each entry in each stretch of the station, with the stretch's begin [s]."""
    clocks: dict[str, list[tuple[float, Clock]]] = {}
    for segment in segments(station):
        for instrument in segment.station.instruments:
            clocks.setdefault(instrument.name, []).append((segment.start, _clock(instrument)))
        platform = segment.station.platform
        if platform is not None:
            clocks.setdefault(_PLATFORM, []).append((segment.start, _clock(platform)))
    return clocks


def _inputs(station: Station) -> dict[str, tuple[int, int, Correction | None]]:
    inputs: dict[str, tuple[int, int, Correction | None]] = {}
    clocks = _clocks(station)
    for instrument in station.instruments:
        correction = changing_correction(clocks[instrument.name])
        if isinstance(instrument, (Cup, Propeller)):
            inputs[instrument.name] = (PULSES, 1, correction)
        elif isinstance(instrument, Angle):
            inputs[instrument.name] = (READINGS, 1, correction)
            if isinstance(instrument, Bivane):
                inputs[f"{instrument.name}/elevation"] = (READINGS, 1, correction)
    if station.platform is not None:
        correction = changing_correction(clocks[_PLATFORM])
        inputs[_PLATFORM] = (PLATFORM, 13, correction)
        if station.platform.moves_apart:
            inputs[_VELOCITY] = (VELOCITY, 3, correction)
    inputs[_TEMPERATURE] = (TEMPERATURE, 1, None)
    inputs[_PRESSURE] = (PRESSURE, 1, None)
    return inputs


def _longest_delay(station: Station) -> float:
    latencies = [clock.latency for known in _clocks(station).values() for _, clock in known]
    return max(0.0, *latencies) - min(0.0, *latencies)


class StreamingEstimator:
    """Wind from messages, in constant memory.

    Messages may come in any order within the reordering window. Doubles are dropped, late messages
    counted; a clock that jumps back makes everything final and starts anew. Made by
    `make_estimator`.

    Args:
        station: What is mounted.
        settings: How to estimate.

    Raises:
        UserError: The station's instruments cannot tell a wind vector, or its messages are means.
    """

    def __init__(self, station: Station, settings: EstimatorSettings) -> None:
        averaged = station.recording.averaging_time
        if averaged > 0.0:
            raise UserError(
                f"the station's messages are means over {averaged:g} s; the filter needs pulses or "
                "samples.",
                "recording.averaging_time",
                "`wind diagnose` compares means.",
            )
        if not is_array(station) and not (rotors_of(station) and axes_of(station)):
            raise UserError(
                "An estimate of the wind needs a cup or propeller with a vane or bivane, or fixed "
                "propellers along different axes.",
                "instruments",
                "Add the missing instrument to the station file.",
            )
        self.station = station
        self.settings = settings
        self._block = max(round(settings.smoother_lag * 0.5e9), 50_000_000)
        self._inputs = _inputs(station)
        self._rotors = {r.name for r in rotors_of(station)}
        self._angles = {n for n, (kind, _, _) in self._inputs.items() if kind == READINGS}
        self._intake = self._new_intake()
        self._core: Core | None = None
        self._presence: Presence | None = None
        self._windows = WindowAccumulator(station, settings)
        self._estimates: list[Estimates] = []
        self._finished: list[WindowStatistics] = []
        self._unknown: dict[str, Tally] = {}
        self._last_health: list[HealthItem] = []
        self._latest: WindowStatistics | None = None
        self._delivered = False
        self._refused = Tally()
        self._refused_at_first = 0
        self._motion_is_known = False
        self._refusing = False
        self._refused_since = 0
        self._apparent_speed = 0.0

    def _new_intake(self) -> Intake:
        s = self.settings
        wait = s.reordering_window + _longest_delay(self.station)
        return Intake(
            self._inputs,
            self._block,
            round(wait * 1e9),
            _LOOK_AHEAD_NS if self.station.platform is not None else (0, 0),
            round(s.gap_time * 1e9),
            round(s.jump_time * 1e9),
        )

    def add_pulse(self, name: str, time_ns: int, turns: float | None = None) -> None:
        """An edge of a rotor.

        Args:
            name: The rotor.
            time_ns: Stamp [ns].
            turns: The rotor's total revolutions, where the source tells them.
        """
        if name not in self._rotors:
            self._unknown.setdefault(name, Tally()).add(self._intake.watermark)
            return
        self._take(name, time_ns, (math.nan if turns is None else turns,))

    def add_angle(self, name: str, time_ns: int, angle: float) -> None:
        """A reading of a vane: heading of its nose, counter-clockwise from x [rad]."""
        if name not in self._angles:
            self._unknown.setdefault(name, Tally()).add(self._intake.watermark)
            return
        if not math.isfinite(angle):
            self._intake.records[name].invalid.add(self._intake.watermark)
            return
        self._take(name, time_ns, (angle,))

    def add_platform(
        self,
        time_ns: int,
        attitude_xyzw: npt.ArrayLike,
        velocity: npt.ArrayLike | None,
        angular_rate: npt.ArrayLike,
        position: npt.ArrayLike,
    ) -> None:
        """State of the carrier, as in `PlatformStates`; ignored on a station without platform.

        Args:
            velocity: None: `add_platform_velocity` tells it, on a station where it comes apart.
        """
        if self.station.platform is None:
            return
        if velocity is None:
            velocity = np.zeros(3)
        elif self.station.platform.moves_apart:
            self.add_platform_velocity(time_ns, velocity)
        value = tuple(
            float(v)
            for part in (attitude_xyzw, velocity, angular_rate, position)
            for v in np.asarray(part, dtype=np.float64)
        )
        if not all(math.isfinite(v) for v in value[:10]):
            self._intake.records[_PLATFORM].invalid.add(self._intake.watermark)
            return
        self._take(_PLATFORM, time_ns, value)

    def add_platform_velocity(self, time_ns: int, velocity: npt.ArrayLike) -> None:
        """Velocity of the carrier [m/s], where the station has a topic of its own for it.

        The motion is known where both this and the attitude are, each within `TrackLimits`.
        """
        if _VELOCITY not in self._inputs:
            return
        value = tuple(float(v) for v in np.asarray(velocity, dtype=np.float64))
        if not all(math.isfinite(v) for v in value):
            self._intake.records[_VELOCITY].invalid.add(self._intake.watermark)
            return
        self._take(_VELOCITY, time_ns, value)

    def add_air(
        self, time_ns: int, temperature: float | None = None, pressure: float | None = None
    ) -> None:
        """Air temperature [deg C], pressure [Pa], or both."""
        for name, value in ((_TEMPERATURE, temperature), (_PRESSURE, pressure)):
            if value is None:
                continue
            if math.isfinite(value):
                self._take(name, time_ns, (value,))
            else:
                self._intake.records[name].invalid.add(self._intake.watermark)

    def measured(self, name: str, stamps: TimeArray, zero: int) -> TimeArray:
        """Times of measurement [ns] of an input's messages by what is known of its clock.

        Args:
            name: Instrument, `platform`, `platform velocity`, `temperature` or `pressure`.
            stamps: [ns], shape (n,).
            zero: Stamp from which a drift counts [ns].
        """
        correction = self._inputs[name][2] if name in self._inputs else None
        if correction is None:
            return stamps
        return np.array([correction(t, zero) for t in stamps.tolist()], dtype=np.int64)

    def advance(self, time_ns: int) -> None:
        """Time has passed although no message came."""
        self._intake.advance(time_ns)
        self._process(self._intake.blocks())

    def _take(self, name: str, time: int, value: tuple[float, ...]) -> None:
        if self._intake.add(name, time, value):
            self._finish()
            self._intake.restart()
        elif self._intake.is_due():
            self._process(self._intake.blocks())

    def _process(self, blocks: list[Block]) -> None:
        for block in blocks:
            core = self._core
            if core is None or self._presence is None:
                core = self._core = self._new_core()
                self._presence = Presence(self.station, self.settings, block.start)
            presence = self._presence
            presence.take(block)
            found = core.process(block)
            until = self._final(presence, found, block.stop)
            estimates = self._kept(found, presence)
            small = core.small_scales()
            self._close(self._windows.take(block, estimates, small, presence, until))

    def _final(self, presence: Presence, found: Estimates, stop: int) -> int:
        """Time [ns] before which no estimate will follow any more, as far as windows wait for it.

        Where nothing is told a window ends without an estimate after it.
        """
        latest = int(found.time[-1]) if found.time.size else 0
        delay = 2.0 * self.settings.smoother_lag + _REACH_OF_FITS / self.settings.bandwidth
        before = np.array([stop - round(delay * 1e9)], dtype=np.int64)
        return latest if presence.is_told(before)[0] else max(latest, int(before[0]))

    def _kept(self, estimates: Estimates, presence: Presence) -> Estimates:
        """Keep what is no guesswork, and count what the motion does not allow."""
        told = presence.is_told(estimates.time)
        if not told.all():
            estimates = part_of(estimates, told)
        known = trusted(estimates)
        if estimates.time.size:
            latest = int(estimates.time[-1])
            if known.time.size:
                self._refused_since = int(known.time[-1]) if known.time[-1] < latest else 0
            elif not self._refused_since:
                self._refused_since = int(estimates.time[0])
            silence = latest - self._refused_since if self._refused_since else 0
            self._refusing = silence > self.settings.gap_time * 1e9
            self._count_refused(estimates.time.size - known.time.size, known)
        if known.time.size:
            self._estimates.append(known)
            self._delivered = True
            speed = float(np.linalg.norm(known.apparent, axis=1).mean())
            keep = _SPEED_MEMORY if self._apparent_speed > 0.0 else 0.0
            self._apparent_speed = keep * self._apparent_speed + (1.0 - keep) * speed
        return known

    def _count_refused(self, refused: int, known: Estimates) -> None:
        """Count estimates that were left out, but not the moment until the carrier is first heard
        of: vane and rotor may well speak before it."""
        if not self._motion_is_known:
            self._refused_at_first += refused
            self._motion_is_known = known.time.size > 0
            refused = 0
            if self._refusing:
                refused, self._refused_at_first = self._refused_at_first, 0
        if refused:
            self._refused.add(self._intake.watermark, refused)

    def _close(self, windows: list[WindowStatistics]) -> None:
        if windows:
            self._finished += windows
            self._latest = windows[-1]

    def _new_core(self) -> Core:
        origin = self._intake.origin
        assert origin is not None
        station = self.station if self.settings.use_air else as_calibrated(self.station)
        if self.settings.method == "kalman":
            return KalmanCore(station, self.settings, self._block, origin)
        if is_array(station):
            if self.settings.method == "inverse":
                return InverseArrayCore(station, self.settings, origin)
            return NaiveArrayCore(station, self.settings, origin)
        if self.settings.method == "inverse":
            return InverseCore(station, self.settings, origin)
        return NaiveCore(station, self.settings, origin)

    def _finish(self) -> None:
        self._process(self._intake.blocks(finish=True))
        if self._core is not None and self._presence is not None:
            estimates = self._kept(self._core.finish(), self._presence)
            small = self._core.small_scales()
            self._close(self._windows.finish(estimates, small, self._presence))
        self._last_health = self._core.health() if self._core is not None else []
        self._core = None
        self._motion_is_known = False
        self._refused_at_first = 0

    def flush(self) -> None:
        """No more messages: make everything final, including the last, shorter window."""
        self._finish()
        self._intake.forget()

    def take_estimates(self) -> list[WindEstimate]:
        """Estimates that became final since the last call, in order of time."""
        block = self.take_estimate_arrays()
        return [
            WindEstimate(int(t), v, c, a, ac, r)
            for t, v, c, a, ac, r in zip(
                block.time,
                block.velocity,
                block.covariance,
                block.apparent,
                block.apparent_covariance,
                block.to_earth,
                strict=True,
            )
        ]

    def take_estimate_arrays(self) -> Estimates:
        """The same as `take_estimates`, as arrays."""
        parts, self._estimates = self._estimates, []
        return joined(parts)

    def take_windows(self) -> list[WindowStatistics]:
        """Windows that were completed since the last call."""
        windows, self._finished = self._finished, []
        return windows

    def health(self, whole: bool = False) -> list[HealthItem]:
        """State of every input, of the clock and of the estimate.

        Args:
            whole: Judge by everything since the start, as of a recording that is over, instead of
                the last minute; the numbers in `values` always count from the start.
        """
        intake = self._intake
        items = input_health(intake, self.station, self.settings, self._presence, whole)
        items.append(clock_health(intake, self._unknown, whole))
        if self.station.platform is not None:
            items.append(motion_health(intake, self._refused, self._refusing, whole))
        core = self._core
        told = core.health() if core is not None else self._last_health
        missing = estimate_health(intake, self._presence, self._delivered)
        if missing is not None:
            told = [*(item for item in told if item.name != missing.name), missing]
        items += told
        items += sampling_health(self.station, intake.records, self.settings, self._apparent_speed)
        if self._latest is not None:
            age = (intake.watermark - self._latest.stop) * 1e-9
            is_old = age > self.settings.window + self._longest_wait
            items += [window_health(self._latest, is_old), bias_health(self._latest, is_old)]
        return items

    @property
    def _longest_wait(self) -> float:
        """From the end of a window to its statistics [s]."""
        s = self.settings
        return 4.0 * s.smoother_lag + s.reordering_window + _REACH_OF_FITS / s.bandwidth


def must_compile(settings: EstimatorSettings) -> bool:
    """Whether the first estimate waits for about a minute, as once after an installation."""
    return settings.method == "kalman" and not is_kept(run)


def make_estimator(
    station: Station, settings: EstimatorSettings | None = None
) -> StreamingEstimator:
    """An estimator for a station.

    Args:
        station: What is mounted, with what is known to be wrong with it.
        settings: Method, rates, windows; None: the defaults.

    Raises:
        UserError: The station's instruments cannot tell a wind vector, or its messages are means.
    """
    return StreamingEstimator(station, settings if settings is not None else EstimatorSettings())
