"""The Kalman method: blocks of messages through the compiled filter and smoother."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation import forward
from wind_sensors.estimation.circumstances import CircumstanceSource, with_mount_covariance
from wind_sensors.estimation.constants import (
    NoseAxis,
    axes_of,
    instruments_of,
    measures_vertical,
    rotors_of,
)
from wind_sensors.estimation.core import Estimates, SmallScales, no_estimates, output_times
from wind_sensors.estimation.filter_state import (
    EDGE,
    LARGEST_SLOTS,
    OUTPUT,
    READING,
    TURNS,
    FilterState,
    Ring,
    empty_filter,
    empty_ring,
    larger_ring,
)
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.kalman_health import kalman_health
from wind_sensors.estimation.kalman_kernel import run
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.propeller_watch import PropellerWatch
from wind_sensors.estimation.readings import headings
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.smoother_kernel import smooth
from wind_sensors.estimation.start import start_filter
from wind_sensors.estimation.turbulence_process import (
    UNRESOLVED_VARIANCE,
    VERTICAL_LEVEL,
    WIND_STATES,
)
from wind_sensors.estimation.wind_state import wind_of
from wind_sensors.station.changes import Segment, segments
from wind_sensors.station.model import Cup, Propeller, Station

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_WARM_UP_NS = 2_000_000_000
_LONGEST_WARM_UP_NS = 10_000_000_000
_PATIENCE_NS = 2_000_000_000
_TAIL_WIND = -0.3
"""Share of the wind that blows onto the nose; below this it blows onto the tail."""
_CALM = 0.5
"""Below this speed any vane may point anywhere [m/s]."""
_FINEST_WIND_RUN = 0.125
"""Edges closer than this share of the distance constant carry nothing new and are not used."""


class Events(NamedTuple):
    """Events of a block in order, as `kalman_kernel.run` takes them."""

    time: IntArray
    kind: IntArray
    which: IntArray
    value: FloatArray
    extra: FloatArray


def useful_stride(rotor: Cup | Propeller) -> int:
    """Every how many edges one is used: a divisor of the slots, so that the same edges serve."""
    slots = rotor.pulses_per_revolution
    run_per_slot = 2.0 * np.pi * rotor.calibration_distance / slots
    finest = _FINEST_WIND_RUN * rotor.distance_constant
    fitting = [s for s in range(1, slots + 1) if slots % s == 0 and s * run_per_slot <= finest]
    return max(fitting, default=1)


class KalmanCore:
    """Extended Kalman filter with fixed-lag smoother.

    Args:
        station: The station; its changes happen at block boundaries.
        settings: Settings.
        block_ns: Length of a block.
        origin: Start of the recording [ns], where changes and outages count from.
    """

    def __init__(
        self, station: Station, settings: EstimatorSettings, block_ns: int, origin: int
    ) -> None:
        self._settings = settings
        self._block = block_ns
        self._lag = round(settings.smoother_lag * 1e9)
        self._weight = block_ns * 1e-9 / settings.adaptation_time
        self._origin = origin
        self._segments = list(segments(station))
        self._segment: Segment = self._segments.pop(0)
        self._source = CircumstanceSource(self._segment.station, settings.use_air)
        self._enter(self._segment.station)
        rotors, vanes = len(self._rotors), len(self._axes)
        self.filter: FilterState = empty_filter(rotors, vanes)
        self.filter.height[0] = station.recording.measuring_height
        self.filter.height[1] = float(measures_vertical(station))
        self.rotor_names = [r.name for r in self._rotors]
        self.vane_names = [v.name for v in self._axes]
        for i, rotor in enumerate(self._rotors):
            self.filter.slots[i] = rotor.pulses_per_revolution
            self.filter.stride[i] = useful_stride(rotor)
            if rotor.pulses_per_revolution > LARGEST_SLOTS:
                self.filter.slots[i] = 1
        self._ring: Ring = empty_ring(64, rotors, vanes)
        self.watch = PropellerWatch(self._segment.station, settings)
        self._waiting: list[Block] = []
        self._started = False
        self.restarts = 0
        self._tail_wind = 0

    def _enter(self, station: Station) -> None:
        """Use the constants of a stretch of time in which the station does not change."""
        self._rotors: tuple[Cup | Propeller, ...] = rotors_of(station)
        self._axes: tuple[NoseAxis, ...] = axes_of(station)
        self._instruments = instruments_of(station)
        self._source.station = station

    def _follow_changes(self, start: int) -> None:
        since = (start - self._origin) * 1e-9
        while since >= self._segment.stop and self._segments:
            self._segment = self._segments.pop(0)
            self._enter(self._segment.station)

    def process(self, block: Block) -> Estimates:
        """Take a block; estimates that became final by it."""
        self._follow_changes(block.start)
        self._source.take(block)
        if not self._started:
            self._waiting.append(block)
            if not self._ready():
                return no_estimates()
            waiting, self._waiting = self._waiting, []
            self._start(waiting)
            parts = [self._run(b) for b in waiting]
            return Estimates(*(np.concatenate(c) for c in zip(*parts, strict=True)))
        return self._run(block)

    def _ready(self) -> bool:
        since = self._waiting[-1].stop - self._waiting[0].start
        heard = self._source.known and all(
            any(n in b.readings and b.readings[n].time.size for b in self._waiting)
            for n in self.vane_names
        )
        return since >= (_WARM_UP_NS if heard else _LONGEST_WARM_UP_NS)

    def _start(self, blocks: list[Block]) -> None:
        first = blocks[0].start
        self._state_stated_slot_errors()
        row = self._source.at(np.array([first], dtype=np.int64), np.zeros(3))[0]
        start_filter(
            self.filter, self._instruments, self._rotors, self._axes, blocks, row,
            self._settings.turbulence_intensity, self._origin,
        )  # fmt: skip
        self._started = True

    def _state_stated_slot_errors(self) -> None:
        for i, rotor in enumerate(self._rotors):
            errors = rotor.electronics.slot_errors
            if errors and len(errors) == self.filter.slots[i]:
                self.filter.slot_error[i, : len(errors)] = np.array(errors) - np.mean(errors)

    def _events(self, block: Block) -> Events:
        """Everything that happens in a block, in the one order that all runs share."""
        outputs = output_times(block.start, block.stop, self._settings.output_rate)
        period = round(1e9 / self._settings.output_rate)
        times: list[IntArray] = [outputs]
        kinds = [np.full(outputs.size, OUTPUT, dtype=np.int64)]
        index = [outputs // period]
        value: list[FloatArray] = [np.full(outputs.size, np.nan)]
        extra: list[FloatArray] = [np.zeros(outputs.size)]
        for i, axis in enumerate(self._axes):
            part = block.readings[axis.name]
            usable = headings(axis.instrument, part.time, part.value[:, 0], self._origin)
            times.append(usable.time)
            kinds.append(np.full(usable.time.size, READING, dtype=np.int64))
            index.append(np.full(usable.time.size, i, dtype=np.int64))
            value.append(usable.heading)
            extra.append(usable.extra_variance)
        for i, rotor in enumerate(self._rotors):
            series = block.pulses[rotor.name]
            turns = series.value[:, 0]
            kind = np.where(np.isnan(turns), EDGE, TURNS).astype(np.int64)
            times.append(series.time)
            kinds.append(kind)
            index.append(np.full(series.time.size, i, dtype=np.int64))
            value.append(turns * 2.0 * np.pi)
            extra.append(np.zeros(series.time.size))
        time = np.concatenate(times)
        kind_of = np.concatenate(kinds)
        which = np.concatenate(index)
        order = np.lexsort((which, kind_of, time))
        return Events(
            time[order],
            kind_of[order],
            which[order],
            np.concatenate(value)[order],
            np.concatenate(extra)[order],
        )

    def _run(self, block: Block) -> Estimates:
        events = self._events(block)
        rows = self._source.at(events.time, self.wind)
        self._make_room(events.time.size)
        out = _Room(1 + int((self._lag + 3 * self._block) * 1e-9 * self._settings.output_rate)
                    + 1, self.filter.mean.size)  # fmt: skip
        filled = run(
            self.filter, self._instruments, self._ring, events.time, events.kind, events.which,
            events.value, events.extra, rows, block.stop, self._block, self._lag, self._weight,
            out.time, out.states, out.covariance, out.circumstances,
        )  # fmt: skip
        if not np.isfinite(self.filter.mean).all() or self._is_astray():
            self._start_again(block)
            return no_estimates()
        return self._delivered(out, filled)

    def _is_astray(self) -> bool:
        """Whether the wind has blown onto a vane's tail for some blocks.

        The equations hold there too, but no vane stays so: the filter has lost the wind.
        """
        f = self.filter
        rotation = f.circumstances[forward.MOUNT_ROTATION : forward.MOUNT_ROTATION + 9]
        felt = rotation.reshape(3, 3).T @ (self.wind - f.circumstances[:3])
        size = float(np.hypot(felt[0], felt[1]))
        for i, axis in enumerate(self._axes):
            if axis.azimuth >= 0:
                continue
            phi = f.mean[WIND_STATES + 2 * (len(self._rotors) + i)]
            onto_nose = -(felt[0] * np.cos(phi) + felt[1] * np.sin(phi))
            if onto_nose < _TAIL_WIND * size and size > _CALM:
                self._tail_wind += 1
                return self._tail_wind * self._block > _PATIENCE_NS
        self._tail_wind = 0
        return False

    def _start_again(self, block: Block) -> None:
        """A filter that broke down begins anew with the next blocks; it says so in its health."""
        self.restarts += 1
        self._tail_wind = 0
        rotors, vanes = len(self._rotors), len(self._axes)
        fresh = empty_filter(rotors, vanes)
        fresh.slots[:] = self.filter.slots
        fresh.height[:] = self.filter.height
        fresh.stride[:] = self.filter.stride
        self.filter = fresh
        self._ring = empty_ring(64, rotors, vanes)
        self._waiting = [block]
        self._started = False

    @property
    def wind(self) -> FloatArray:
        """Latest filtered wind, ENU [m/s]."""
        return _total(self.filter.mean)

    def _make_room(self, more: int) -> None:
        """Let the ring hold all steps that are not final yet, and this block's."""
        steps = int(self.filter.clock[2])
        capacity = self._ring.time.size
        oldest = max(0, steps - capacity)
        kept = self._ring.time[np.arange(oldest, steps) % capacity]
        needed = int(np.count_nonzero(kept > self.filter.clock[1])) + more + 8
        if needed > capacity:
            self._ring = larger_ring(self._ring, steps, 2 * needed)

    def _delivered(self, out: _Room, filled: int) -> Estimates:
        time = out.time[:filled].copy()
        rows = out.circumstances[:filled]
        velocity = out.states[:filled, :3].copy()
        unresolved = self.filter.levels[[0, 2, VERTICAL_LEVEL]]
        covariance = out.covariance[:filled, :3, :3] + UNRESOLVED_VARIANCE * np.diag(
            [unresolved[:2].mean(), unresolved[:2].mean(), unresolved[2]]
        )
        to_earth = rows[:, forward.MOUNT_ROTATION : forward.MOUNT_ROTATION + 9].reshape(-1, 3, 3)
        apparent = np.einsum("nji,nj->ni", to_earth, velocity - rows[:, :3])
        in_sensor = np.einsum("nji,njk,nkl->nil", to_earth, covariance, to_earth)
        estimates = Estimates(
            time, velocity, with_mount_covariance(covariance, velocity, rows), apparent, in_sensor,
            to_earth,
        )  # fmt: skip
        self.watch.take(estimates, out.states[:filled, 3 : 3 + 2 * len(self._rotors) : 2])
        return estimates

    def finish(self) -> Estimates:
        """No block will follow; the remaining estimates."""
        if not self._started:
            if not self._waiting:
                return no_estimates()
            waiting, self._waiting = self._waiting, []
            self._start(waiting)
            parts = [self._run(b) for b in waiting]
            parts.append(self.finish())
            return Estimates(*(np.concatenate(c) for c in zip(*parts, strict=True)))
        out = _Room(1 + int((self._lag + 3 * self._block) * 1e-9 * self._settings.output_rate)
                    + 1, self.filter.mean.size)  # fmt: skip
        filled = smooth(
            self.filter, self._instruments, self._ring, int(self.filter.clock[0]), self._weight,
            out.time, out.states, out.covariance, out.circumstances, 0,
        )  # fmt: skip
        return self._delivered(out, filled)

    def small_scales(self) -> SmallScales | None:
        """Levels of the small scales."""
        if not self._started:
            return None
        return SmallScales(float(self.filter.levels[0]), float(self.filter.levels[2]))

    def health(self) -> list[HealthItem]:
        """Rotors, vanes and the estimate."""
        return kalman_health(self)


def _total(mean: FloatArray) -> FloatArray:
    out = np.empty(3)
    wind_of(mean, out)
    return out


class _Room:
    """Arrays that receive estimates."""

    def __init__(self, count: int, states: int) -> None:
        size = 3 + states - WIND_STATES
        self.time = np.zeros(count, dtype=np.int64)
        self.states = np.zeros((count, size))
        self.covariance = np.zeros((count, size, size))
        self.circumstances = np.zeros((count, forward.CIRCUMSTANCES))
