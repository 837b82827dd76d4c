"""When a station's rotors and vanes spoke, and what their silence means.

A rotor at rest sends no edges. It is at rest where it may have stopped: its last rate was low
enough, and a vane still speaks. A rotor that was turning too fast to stop is lost: something holds
it, or its signal does not arrive. Where nothing speaks nothing is measured at all.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import axes_of, is_array, rotors_of
from wind_sensors.estimation.intake import Block, Series
from wind_sensors.estimation.outputs import HealthItem, HealthLevel
from wind_sensors.estimation.recent import Rhythm
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.station.model import Cup, Propeller, Station
from wind_sensors.station.parameters import rotor_parameters

BoolArray = npt.NDArray[np.bool_]
FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_LONGEST_GUESS_NS = 60_000_000_000
"""So long is the wind told after its speed was lost, with a growing uncertainty."""
_KEPT_LONGER = 120_000_000_000
"""Stretches are remembered for so long beyond a window and the smoother's lag [ns]."""

_RECENT_INTERVALS = 3
_STOPPABLE = 16.0
"""A rotor whose y^2 is less than this times its friction may stop at once."""
_SLOTS_OF_DOUBT = 2.2
"""An edge must have come when the rotor has turned by so many slots."""
_MOMENTS = 200
"""In a window, at which it is asked what was measured."""


class _Stretch(NamedTuple):
    """A pause that is longer than usual.

    Attributes:
        start, stop: Last message before and first after it [ns].
        limit: So long after `start` it was known to be silence [ns].
        is_lost: Of a rotor that cannot have stopped.
    """

    start: int
    stop: int
    limit: int
    is_lost: bool


class _Input:
    """Pauses of one input.

    Args:
        least_ns: No shorter pause counts [ns].
        begin: From when on it is listened to [ns].

    Attributes:
        last: Its latest message, or `begin` [ns].
        heard: Whether there was one.
    """

    def __init__(self, least_ns: int, begin: int) -> None:
        self.last = begin
        self.heard = False
        self._least = least_ns
        self._rhythm = Rhythm(least_ns)
        self._past: list[_Stretch] = []

    def take(self, part: Series) -> None:
        """Messages of a block, in order."""
        if not part.time.size:
            return
        pauses = np.diff(part.time, prepend=self.last)
        done = 0
        for k in np.nonzero(pauses > self._least // 2)[0].tolist():
            self._note(part.time[done:k], part.value[done:k, 0])
            done = k
            stop, pause = int(part.time[k]), int(pauses[k])
            if pause > self.limit:
                self._past.append(_Stretch(stop - pause, stop, self.limit, self.is_lost()))
            self._rhythm.take(stop, pause)
        self._note(part.time[done:], part.value[done:, 0])
        self.last = int(part.time[-1])
        self.heard = True

    def _note(self, times: TimeArray, values: FloatArray) -> None:
        """Messages that follow one another without a pause."""

    @property
    def limit(self) -> int:
        """A longer pause is silence [ns]."""
        return self._rhythm.limit

    def is_lost(self) -> bool:
        """Whether a pause from here on cannot be that of a rotor at rest."""
        return False

    def stretches(self, now: int) -> list[_Stretch]:
        """Silent stretches, the present one included."""
        if now - self.last <= self.limit:
            return self._past
        return [*self._past, _Stretch(self.last, now + 1, self.limit, self.is_lost())]

    def forget_before(self, time: int) -> None:
        """Drop stretches that were over at a time [ns]."""
        if self._past and self._past[0].stop <= time:
            self._past = [stretch for stretch in self._past if stretch.stop > time]


class _Rotor(_Input):
    """Pauses of a rotor, and how fast it was turning before them.

    Args:
        rotor: The rotor.
        least_ns, begin: As of every input.
    """

    def __init__(self, rotor: Cup | Propeller, least_ns: int, begin: int) -> None:
        super().__init__(least_ns, begin)
        p = rotor_parameters(rotor)
        self._width = 2.0 * math.pi / rotor.pulses_per_revolution
        self._distance = p.calibration_distance
        self._length = p.distance_constant * p.inertia_factor
        self._friction = p.friction + p.starting_speed**2
        self._latest = begin
        self._turns = math.nan
        self._rates: list[float] = []
        self._repeats = False

    def _note(self, times: TimeArray, values: FloatArray) -> None:
        if not times.size:
            return
        turned = 2.0 * math.pi * np.abs(np.diff(values, prepend=self._turns))
        self._repeats = self._repeats or bool(np.any(turned == 0.0))
        seconds = np.diff(times, prepend=self._latest) * 1e-9
        angle = np.where(np.isnan(turned), self._width, turned)
        known = seconds > 0.0
        rates = (angle[known] / seconds[known]).tolist()
        self._rates = [*self._rates, *rates][-_RECENT_INTERVALS:]
        self._latest, self._turns = int(times[-1]), float(values[-1])

    def is_lost(self) -> bool:
        """Whether friction and the air together cannot stop it before it is called silent.

        The air brakes at most by y^2/(4 l0), with half the rotor's own speed. A counter that
        repeats its count while the rotor is at rest is never silent.
        """
        if len(self._rates) < _RECENT_INTERVALS:
            return False
        if self._repeats:
            return True
        y = self._distance * min(self._rates)
        if y * y < _STOPPABLE * self._friction:
            return False
        run = 0.25 * y * self.limit * 1e-9 / self._length
        turned = 4.0 * self._length / self._distance * math.log(1.0 + run)
        return turned > _SLOTS_OF_DOUBT * self._width


class Presence:
    """Which of a station's rotors and vanes spoke when.

    Args:
        station: The station; its constants at the beginning are used.
        settings: `stop_time` and `gap_time`: no shorter pause of a rotor or a vane is silence.
        begin: Start of the first block [ns].
    """

    def __init__(self, station: Station, settings: EstimatorSettings, begin: int) -> None:
        self._stop_time = round(settings.stop_time * 1e9)
        gap = round(settings.gap_time * 1e9)
        self._is_array = is_array(station)
        self._rotors = {r.name: _Rotor(r, self._stop_time, begin) for r in rotors_of(station)}
        axes = axes_of(station)
        self._vanes = {axis.name: _Input(gap, begin) for axis in axes}
        self._azimuths = [axis.name for axis in axes if axis.azimuth < 0]
        self._inputs: dict[str, _Input] = {**self._rotors, **self._vanes}
        self._keep = round((settings.window + 2.0 * settings.smoother_lag) * 1e9) + _KEPT_LONGER
        self.now = begin

    def take(self, block: Block) -> None:
        """Listen to a block."""
        for name, rotor in self._rotors.items():
            rotor.take(block.pulses[name])
        for name, vane in self._vanes.items():
            vane.take(block.readings[name])
        self.now = block.stop
        for each in self._inputs.values():
            each.forget_before(block.stop - self._keep)

    def _silent(self, name: str, times: TimeArray) -> BoolArray:
        out = np.zeros(times.size, dtype=np.bool_)
        for stretch in self._inputs[name].stretches(self.now):
            out |= (times > stretch.start) & (times < stretch.stop)
        return out

    def _speaks(self, times: TimeArray) -> BoolArray:
        """Whether anything does."""
        silent = [self._silent(name, times) for name in self._inputs]
        return np.asarray(~np.logical_and.reduce(silent))

    def _tells_speed(self, name: str, times: TimeArray) -> BoolArray:
        """Whether a rotor turned, or was at rest."""
        lost = np.zeros(times.size, dtype=np.bool_)
        for stretch in self._rotors[name].stretches(self.now):
            if stretch.is_lost:
                lost |= (times > stretch.start) & (times < stretch.stop)
        return ~lost & self._speaks(times)

    def _measured(
        self, rotors: Iterable[str], vanes: Sequence[str], times: TimeArray
    ) -> tuple[BoolArray, BoolArray]:
        """Whether speed and direction were, by some of the rotors and vanes."""
        told = [self._tells_speed(name, times) for name in rotors]
        if self._is_array:
            every = np.logical_and.reduce(told)
            return every, every
        heard = [~self._silent(name, times) for name in vanes]
        return np.logical_or.reduce(told), np.logical_or.reduce(heard)

    def share(self, start: int, stop: int, rotor: str = "", vane: str = "") -> float:
        """Share of an interval [ns] in which speed and direction were measured.

        Args:
            start, stop: The interval [ns].
            rotor, vane: Count only these; empty: any that can tell.
        """
        if not any(each.stretches(self.now) for each in self._inputs.values()):
            return 1.0
        places = (np.arange(_MOMENTS) + 0.5) / _MOMENTS
        times = start + np.asarray(places * (stop - start), dtype=np.int64)
        rotors = [rotor] if rotor and not self._is_array else list(self._rotors)
        speed, direction = self._measured(rotors, [vane] if vane else self._azimuths, times)
        return float(np.mean(speed & direction))

    def is_told(self, times: TimeArray) -> BoolArray:
        """Whether the wind is told at some times: not long after its last measurement.

        Where nothing speaks it is told for as long as a rotor may take to its next edge, and for
        a minute where the speed is lost.
        """
        everything = np.ones(times.size, dtype=np.bool_)
        lost = []
        for name, each in self._inputs.items():
            silent, gone = (np.zeros(times.size, dtype=np.bool_) for _ in range(2))
            for start, stop, limit, is_lost in each.stretches(self.now):
                silent |= (times > start + max(limit, self._stop_time)) & (times < stop)
                if is_lost:
                    gone |= (times > start + max(limit, _LONGEST_GUESS_NS)) & (times < stop)
            everything &= silent
            if name in self._rotors:
                lost.append(gone)
        combined = np.logical_or if self._is_array else np.logical_and
        return np.asarray(~everything & ~combined.reduce(lost))

    def silence(self, name: str) -> float:
        """How long a rotor or a vane has been silent [s]; 0 while it is not."""
        each = self._inputs[name]
        pause = self.now - each.last
        return pause * 1e-9 if pause > each.limit else 0.0

    def limit(self, name: str) -> float:
        """How long a rotor or a vane may pause before it is called silent [s]."""
        return self._inputs[name].limit * 1e-9

    def is_lost(self, name: str) -> bool:
        """Whether a rotor has been silent for longer than it takes to stop."""
        return name in self._rotors and self.silence(name) > 0.0 and self._rotors[name].is_lost()

    @property
    def is_silent(self) -> bool:
        """Whether nothing speaks."""
        return all(self.silence(name) > 0.0 for name in self._inputs)

    def health(self) -> HealthItem | None:
        """Item `estimate` where speed or direction is not measured now, else None."""
        silence = {name: self.silence(name) for name in self._inputs}
        values = {f"silence of {name}": f"{age:.1f} s" for name, age in silence.items()}
        now = np.array([self.now], dtype=np.int64)
        told = bool(self.is_told(now)[0])
        rest = "" if told else " No wind is told until it is heard of again."

        def item(level: HealthLevel, message: str) -> HealthItem:
            return HealthItem("estimate", level, message + rest, values)

        bad = HealthLevel.WARN if told else HealthLevel.ERROR
        if self.is_silent:
            age = min(silence.values())
            return item(HealthLevel.ERROR, f"Nothing has been measured for {age:.0f} s.")
        speed, direction = self._measured(self._rotors, self._azimuths, now - 1)
        if not speed[0]:
            lost = [name for name in self._rotors if self.is_lost(name)]
            age = max(silence[name] for name in lost)
            return item(
                bad, f"The wind's speed has not been measured for {age:.0f} s: nothing comes "
                f"from {' and '.join(lost)}."
            )
        if not direction[0]:
            age = min(silence[name] for name in self._azimuths)
            return item(
                bad, f"The wind's direction has not been measured for {age:.0f} s: nothing comes "
                f"from {' and '.join(self._azimuths)}."
            )
        return None
