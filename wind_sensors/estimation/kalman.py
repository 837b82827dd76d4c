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
from wind_sensors.estimation.core import (
    Estimates,
    SmallScales,
    joined,
    no_estimates,
    output_times,
    part_of,
)
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
from wind_sensors.estimation.history import RotorTrack
from wind_sensors.estimation.intake import Block, Series
from wind_sensors.estimation.kalman_health import kalman_health
from wind_sensors.estimation.kalman_kernel import run
from wind_sensors.estimation.lull_watch import LullWatch
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.propeller_watch import PropellerWatch
from wind_sensors.estimation.readings import NoseReader
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.site import with_site_covariance
from wind_sensors.estimation.slot_places import slots_in_place
from wind_sensors.estimation.smoother_kernel import smooth
from wind_sensors.estimation.start import start_filter
from wind_sensors.estimation.timeline import Timeline
from wind_sensors.estimation.turbulence_process import (
    UNRESOLVED_VARIANCE,
    VERTICAL_LEVEL,
    WIND_STATES,
)
from wind_sensors.estimation.turn_counting import loses_edges
from wind_sensors.estimation.unfollowed import unfollowed_of
from wind_sensors.estimation.wind_state import wind_of
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
    """Every how many edges one is used: a divisor of the slots, so that the same edges serve.

    Where edges are known to get lost, each one is used.
    """
    if loses_edges(rotor):
        return 1
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
        self._timeline = Timeline(station, origin)
        self._number = 0
        first = self._timeline.stations[0]
        self._source = CircumstanceSource(first, settings.use_air)
        self._enter(first)
        rotors, vanes = len(self._rotors), len(self._axes)
        self.filter: FilterState = empty_filter(rotors, vanes)
        self.filter.height[0] = station.recording.measuring_height
        self.filter.height[1] = float(measures_vertical(station))
        self.rotor_names = [r.name for r in self._rotors]
        self.vane_names = [v.name for v in self._axes]
        for i, rotor in enumerate(self._rotors):
            self.filter.slots[i] = rotor.pulses_per_revolution
            self.filter.stride[i] = min(
                useful_stride(r)
                for later in self._timeline.stations
                for r in rotors_of(later)
                if r.name == rotor.name
            )
            if rotor.pulses_per_revolution > LARGEST_SLOTS:
                self.filter.slots[i] = 1
        self._tracks = [
            RotorTrack(r.name, station, origin) if self._has_faults(r.name) else None
            for r in self._rotors
        ]
        self._readers = [NoseReader(a.name, station, origin) for a in self._axes]
        self._ring: Ring = empty_ring(64, rotors, vanes)
        self.watch = PropellerWatch(first, settings)
        self.lulls = LullWatch(first, settings)
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

    def _has_faults(self, rotor: str) -> bool:
        """Whether a rotor loses or doubles edges at any time."""
        every = (r for s in self._timeline.stations for r in rotors_of(s))
        return any(r.name == rotor and loses_edges(r) for r in every)

    def _follow_changes(self, start: int) -> None:
        number = self._timeline.number(start)
        if number != self._number:
            self._number = number
            self._enter(self._timeline.stations[number])

    def process(self, block: Block) -> Estimates:
        """Take a block; estimates that became final by it."""
        self._follow_changes(block.start)
        self._source.take(block)
        if not self._started:
            self._waiting.append(block)
            self._forget_early()
            if not self._ready():
                return no_estimates()
            waiting, self._waiting = self._waiting, []
            self._start(waiting)
            parts = [self._run(b) for b in waiting]
            return Estimates(*(np.concatenate(c) for c in zip(*parts, strict=True)))
        return self._run(block)

    def _ready(self) -> bool:
        if not self._tells_a_vector():
            return False
        since = self._waiting[-1].stop - self._waiting[0].start
        heard = self._source.known and all(
            any(n in b.readings and b.readings[n].time.size for b in self._waiting)
            for n in self.vane_names
        )
        return since >= (_WARM_UP_NS if heard else _LONGEST_WARM_UP_NS)

    def _is_pointed(self, block: Block) -> bool:
        """Whether a block tells a direction: a vane was read, or fixed propellers tell it."""
        azimuths = [axis.name for axis in self._axes if axis.azimuth < 0]
        return not azimuths or any(block.readings[name].time.size for name in azimuths)

    def _tells_a_vector(self) -> bool:
        """Whether speed and direction were heard of; before that any wind would be invented."""
        turned = any(b.pulses[name].time.size for b in self._waiting for name in self.rotor_names)
        return turned and any(map(self._is_pointed, self._waiting))

    def _forget_early(self) -> None:
        """Leave out what came before the first direction, and more than the start looks at."""
        while self._waiting and not self._is_pointed(self._waiting[0]):
            del self._waiting[0]
        while self._waiting and (
            self._waiting[-1].stop - self._waiting[0].start > _LONGEST_WARM_UP_NS + self._block
        ):
            del self._waiting[0]

    def _start(self, blocks: list[Block]) -> None:
        first = blocks[0].start
        self._state_stated_slot_errors(blocks)
        row = self._source.at(np.array([first], dtype=np.int64), np.zeros(3))[0]
        start_filter(
            self.filter, self._instruments, self._rotors, self._axes, blocks, row,
            self._settings.turbulence_intensity, self._origin,
        )
        self._started = True

    def _state_stated_slot_errors(self, blocks: list[Block]) -> None:
        for i, rotor in enumerate(self._rotors):
            errors = rotor.electronics.slot_errors
            if errors and len(errors) == self.filter.slots[i]:
                times = np.concatenate([b.pulses[rotor.name].time for b in blocks])
                self.filter.slot_error[i, : len(errors)] = slots_in_place(errors, times)

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
            usable = self._readers[i].read(block.readings[axis.name], block.stop)
            times.append(usable.time)
            kinds.append(np.full(usable.time.size, READING, dtype=np.int64))
            index.append(np.full(usable.time.size, i, dtype=np.int64))
            value.append(usable.heading)
            extra.append(usable.half_width)
        for i, rotor in enumerate(self._rotors):
            passed, kind, told = self._turned(i, block.pulses[rotor.name])
            times.append(passed)
            kinds.append(kind)
            index.append(np.full(passed.size, i, dtype=np.int64))
            value.append(told)
            extra.append(np.zeros(passed.size))
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

    def _turned(self, i: int, part: Series) -> tuple[IntArray, IntArray, FloatArray]:
        """Times, kinds and values of a rotor's events in a block, as `kalman_kernel.run` has them.

        Where the station file says how edges get lost or doubled, they are counted here.
        """
        turns = part.value[:, 0]
        track = self._tracks[i]
        if track is None or not np.isnan(turns).all():
            kinds = np.where(np.isnan(turns), EDGE, TURNS).astype(np.int64)
            return part.time, kinds, turns * 2.0 * np.pi
        before = float(track.angle[-1]) if track.angle.size else 0.0
        new = track.take(part)
        time, angle = track.time[track.time.size - new :], track.angle[track.angle.size - new :]
        slot = 2.0 * np.pi / track.rotor.pulses_per_revolution
        self.filter.tally[i, 2] += max(part.time.size - new, 0)
        track.forget_before(part.time[-1] if part.time.size else 0)
        passed = np.rint(np.diff(angle, prepend=before) / slot)
        return time, np.full(new, EDGE, dtype=np.int64), passed

    def _run(self, block: Block) -> Estimates:
        events = self._events(block)
        rows = self._source.at(events.time, self.wind)
        self._make_room(events.time.size)
        out = _Room(1 + int((self._lag + 3 * self._block) * 1e-9 * self._settings.output_rate)
                    + 1, self.filter.mean.size)
        filled = run(
            self.filter, self._instruments, self._ring, events.time, events.kind, events.which,
            events.value, events.extra, rows, block.stop, self._block, self._lag, self._weight,
            out.time, out.states, out.covariance, out.circumstances,
        )
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
        level = float(self.filter.levels[[0, 2]].mean())
        unresolved = UNRESOLVED_VARIANCE * np.array(
            [level, level, self.filter.levels[VERTICAL_LEVEL]]
        )
        covariance = out.covariance[:filled, :3, :3] + np.diag(unresolved)
        unfollowed = np.empty((filled, 3))
        unfollowed_of(
            self._instruments, out.states[:filled], out.covariance[:filled], rows,
            float(unresolved[0]), unfollowed,
        )
        to_earth = rows[:, forward.MOUNT_ROTATION : forward.MOUNT_ROTATION + 9].reshape(-1, 3, 3)
        apparent = np.einsum("nji,nj->ni", to_earth, velocity - rows[:, :3])
        in_sensor = np.einsum("nji,njk,nkl->nil", to_earth, covariance, to_earth)
        estimates = Estimates(
            time, velocity, with_mount_covariance(covariance, velocity, rows), apparent, in_sensor,
            to_earth, unfollowed,
        )
        self.watch.take(estimates, out.states[:filled, 3 : 3 + 2 * len(self._rotors) : 2])
        parts = [
            with_site_covariance(self._timeline.stations[number], part_of(estimates, here))
            for number, here in self._timeline.parts(time)
        ]
        return self.lulls.widened(joined(parts), out.states[:filled, 3])

    def finish(self) -> Estimates:
        """No block will follow; the remaining estimates."""
        if not self._started:
            if not self._waiting:
                return no_estimates()
            told = self._tells_a_vector()
            waiting, self._waiting = self._waiting, []
            if not told:
                return no_estimates()
            self._start(waiting)
            parts = [self._run(b) for b in waiting]
            parts.append(self.finish())
            return Estimates(*(np.concatenate(c) for c in zip(*parts, strict=True)))
        out = _Room(1 + int((self._lag + 3 * self._block) * 1e-9 * self._settings.output_rate)
                    + 1, self.filter.mean.size)
        filled = smooth(
            self.filter, self._instruments, self._ring, int(self.filter.clock[0]), self._weight,
            out.time, out.states, out.covariance, out.circumstances, 0,
        )
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
