"""The last few minutes of a station's signals, in bounded memory."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.motion import velocity_at
from wind_sensors.station.model import Rotor, Station
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    TimeArray,
    Velocities,
    Winds,
)

FloatArray = npt.NDArray[np.float64]

MOST_SAMPLES = 300_000
"""Of each signal; the oldest give way."""

GRID_STEP = 50_000_000
"""Interval of the wind that drives the simulation [ns]."""

LONGEST_GAP = 1.0
"""Between two readings of the reference it is not interpolated [s]."""

_PLATFORM = ("platform", "")
_VELOCITY = ("platform", "velocity")
_TEMPERATURE = ("air", "temperature")
_PRESSURE = ("air", "pressure")
_WIND = ("reference", "")


class _Samples(NamedTuple):
    time: TimeArray
    values: FloatArray


class SignalStore:
    """Signals as they arrive, cut into recordings."""

    def __init__(self) -> None:
        self._samples: dict[tuple[str, str], deque[tuple[Any, ...]]] = defaultdict(
            lambda: deque(maxlen=MOST_SAMPLES)
        )

    def add_pulse(self, name: str, time: int, turns: float | None = None) -> None:
        """An edge [ns], with the turns so far where the source tells."""
        self._samples["pulses", name].append((time, np.nan if turns is None else turns))

    def add_angle(self, name: str, time: int, angle: float) -> None:
        """A reading of a vane [rad]."""
        self._samples["angles", name].append((time, angle))

    def add_platform(self, time: int, state: Sequence[float]) -> None:
        """Attitude, velocity, angular rate and position, 13 numbers."""
        self._samples[_PLATFORM].append((time, *state))

    def add_platform_velocity(self, time: int, velocity: Sequence[float]) -> None:
        """Velocity that comes apart from the attitude [m/s], instead of the states'."""
        self._samples[_VELOCITY].append((time, *velocity))

    def add_temperature(self, time: int, value: float) -> None:
        """[deg C]"""
        self._samples[_TEMPERATURE].append((time, value))

    def add_pressure(self, time: int, value: float) -> None:
        """[Pa]"""
        self._samples[_PRESSURE].append((time, value))

    def add_wind(self, time: int, velocity: Sequence[float]) -> None:
        """Wind that drives the simulation: east, north, up [m/s]."""
        self._samples[_WIND].append((time, *velocity))

    def forget_before(self, time: int) -> None:
        """Drop what is older, but keep one sample before for interpolation."""
        for samples in self._samples.values():
            while len(samples) > 1 and samples[1][0] < time:
                samples.popleft()

    @property
    def complete_since(self) -> int:
        """Time before which samples had to give way [ns]; 0 if none had to."""
        full = (s for s in self._samples.values() if len(s) == MOST_SAMPLES)
        return max((int(samples[0][0]) for samples in full), default=0)

    def clear(self) -> None:
        """Drop everything."""
        self._samples.clear()

    def _array(self, key: tuple[str, str], start: int, stop: int) -> _Samples | None:
        """Samples of a signal within [start, stop], in order of time, each time once."""
        found = [s for s in self._samples.get(key, ()) if start <= s[0] <= stop]
        if not found:
            return None
        time = np.array([s[0] for s in found], dtype=np.int64)
        values = np.array([s[1:] for s in found], dtype=np.float64)
        time, first = np.unique(time, return_index=True)
        return _Samples(time, values[first])

    def wind_on_grid(self, start: int, stop: int) -> Winds | None:
        """The driving wind at start, start + step, ... without the instants inside gaps."""
        found = self._array(_WIND, start - GRID_STEP * 20, stop + GRID_STEP * 20)
        if found is None:
            return None
        usable = np.isfinite(found.values).all(axis=1)
        if np.count_nonzero(usable) < 2:
            return None
        time, velocity = found.time[usable], found.values[usable]
        grid = np.arange(start, stop + 1, GRID_STEP, dtype=np.int64)
        after = np.searchsorted(time, grid)
        inside = (grid >= time[0]) & (grid <= time[-1])
        before = np.clip(after - 1, 0, time.size - 1)
        after = np.clip(after, 0, time.size - 1)
        inside &= (time[after] - time[before]) * 1e-9 <= LONGEST_GAP
        since = (time - start) * 1e-9
        at = (grid[inside] - start) * 1e-9
        columns = [np.interp(at, since, velocity[:, k]) for k in range(3)]
        return Winds(grid[inside], np.stack(columns, axis=1))

    def wind(self, start: int, stop: int) -> Winds | None:
        """The driving wind as it came."""
        found = self._array(_WIND, start, stop)
        return None if found is None else Winds(found.time, found.values)

    def recording(
        self,
        station: Station,
        session: int,
        start: int,
        stop: int,
        without: Sequence[str] = (),
        *,
        gridded: bool = True,
    ) -> Recording | None:
        """What arrived between two times as a recording.

        Args:
            station: The station.
            session: Time that counts as the recording's start (for changes of the station) [ns].
            start, stop: [ns]
            without: Instruments to leave out.
            gridded: Whether the wind is interpolated, which takes some of its fastest changes.

        Returns:
            The recording, or None without a wind.
        """
        wind = self.wind_on_grid(start, stop) if gridded else self.wind(start, stop)
        if wind is None:
            return None
        # A rotor that stands still sends nothing, which is a measurement too.
        pulses = {
            rotor.name: Pulses(np.empty(0, dtype=np.int64))
            for rotor in station.instruments
            if isinstance(rotor, Rotor) and rotor.name not in without
        }
        angles: dict[str, Angles] = {}
        for kind, name in list(self._samples):
            found = self._array((kind, name), start, stop)
            if found is None or name.partition("/")[0] in without:
                continue
            if kind == "pulses":
                turns = found.values[:, 0]
                counted = np.isfinite(turns).all()
                pulses[name] = Pulses(found.time, turns if counted else None)
            elif kind == "angles":
                angles[name] = Angles(found.time, found.values[:, 0])
        platform, platform_velocity = self._motion(station, start, stop)
        return Recording(
            name="watch",
            station=station,
            start=session,
            stop=stop,
            pulses=pulses,
            angles=angles,
            reference=wind,
            platform=platform,
            platform_velocity=platform_velocity,
            temperature=self._series(_TEMPERATURE, start, stop),
            pressure=self._series(_PRESSURE, start, stop),
        )

    def _motion(
        self, station: Station, start: int, stop: int
    ) -> tuple[PlatformStates | None, Velocities | None]:
        """States around an interval, and the velocities where they come apart."""
        early, late = start - 20 * GRID_STEP, stop + 20 * GRID_STEP
        states = self._array(_PLATFORM, early, late)
        if states is None or station.platform is None:
            return None, None
        v, told = states.values, None
        velocity = v[:, 4:7]
        if station.platform.moves_apart:
            found = self._array(_VELOCITY, early, late)
            told = (
                Velocities(np.empty(0, dtype=np.int64), np.empty((0, 3)))
                if found is None
                else Velocities(found.time, found.values)
            )
            velocity = velocity_at(told, states.time)
        return PlatformStates(states.time, v[:, :4], velocity, v[:, 7:10], v[:, 10:13]), told

    def _series(self, key: tuple[str, str], start: int, stop: int) -> Series | None:
        found = self._array(key, start - 60_000_000_000, stop)
        return None if found is None else Series(found.time, found.values[:, 0])
