"""Raw sums of one averaging window: wind run by direction, as a logger would keep them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.circumstances import CircumstanceSource
from wind_sensors.estimation.constants import rotors_of
from wind_sensors.estimation.forward import MOUNT_ROTATION
from wind_sensors.estimation.history import History
from wind_sensors.estimation.intake import Block, merged
from wind_sensors.estimation.timeline import Timeline
from wind_sensors.station.model import Cup, Station

_TOGETHER = 20
"""So many blocks are summed at once."""

_TURN = 2.0 * np.pi - 1e-6
"""A whole turn, of angles that are sums of slots [rad]."""

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


@dataclass
class RunSums:
    """Sums over one window.

    Attributes:
        turned: Angle that a rotor true to its calibration would have turned [rad].
        edges: Edges or counter readings.
        directions: Sum of the air's unit vector, weighted by angle turned [rad], shape (2,).
        readings: Number of vane readings.
        offsets: Sum over the readings of the speed at which the rotor would stand still [m/s].
        time_directions: Sum over the readings of that speed along the air's direction, shape (2,).
        rates, turns: Sum of the rotor's rates over the whole turns that end at an edge [rad/s], and
            their number, for the arithmetic mean. Slots are not equally wide, turns are.
        interval_time, interval_turned: Duration [s] and angle [rad] of all intervals between edges.
        carried: Sum of the mount's velocity over the readings [m/s], shape (2,).
    """

    turned: float = 0.0
    edges: int = 0
    directions: FloatArray = field(default_factory=lambda: np.zeros(2))
    readings: int = 0
    offsets: float = 0.0
    time_directions: FloatArray = field(default_factory=lambda: np.zeros(2))
    rates: float = 0.0
    turns: int = 0
    interval_time: float = 0.0
    interval_turned: float = 0.0
    carried: FloatArray = field(default_factory=lambda: np.zeros(2))


class Windows:
    """Sums of windows that follow one another.

    Args:
        start: Of the first window [ns].
        length: Of a window [ns].
    """

    def __init__(self, start: int, length: int) -> None:
        self._start = start
        self._length = length
        self._sums: dict[int, RunSums] = {}

    def at(self, times: TimeArray) -> list[tuple[RunSums, npt.NDArray[np.bool_]]]:
        """The sums of each window that the times [ns] fall into, and which of them do."""
        number = (times - self._start) // self._length
        return [
            (self._sums.setdefault(int(k), RunSums()), number == k) for k in np.unique(number)
        ]

    def taken(self, number: int) -> RunSums:
        """Sums of a window, which is forgotten."""
        return self._sums.pop(number, RunSums())


class RunCounter:
    """Sorts messages into windows that follow one another and keeps their sums.

    What is known of the count and of the steady calibration is undone: lost edges, gain, offset.

    Args:
        station: The station; the first rotor and the vane that belongs to it are used.
        start: Of the first block [ns].
        windows: Into which the messages are sorted.
        use_air: As in the settings.

    Attributes:
        rotor: The rotor whose run is counted.
        vane: The vane or bivane that tells the direction.
    """

    def __init__(self, station: Station, start: int, windows: Windows, use_air: bool) -> None:
        self.history = History(station, start, 1.0)
        self.rotor = self.history.rotor
        self.vane = self.history.vane
        self._timeline = Timeline(station, start)
        self._rotors = [
            next(r for r in rotors_of(s) if r.name == self.rotor.name)
            for s in self._timeline.stations
        ]
        self._source = CircumstanceSource(self._timeline.stations[0], use_air)
        self._last_time = 0
        self._last_angle = 0.0
        self._turn_times: TimeArray = np.empty(0, dtype=np.int64)
        self._turn_angles: FloatArray = np.empty(0)
        self._windows = windows
        self._pending: list[Block] = []

    def take(self, block: Block) -> None:
        """Add a block; some are kept and summed together."""
        self._pending.append(block)
        if len(self._pending) >= _TOGETHER:
            self._sum_up()

    def window(self, number: int) -> RunSums:
        """Sums of a window, which is forgotten."""
        self._sum_up()
        return self._windows.taken(number)

    def _calibration(self, times: TimeArray) -> tuple[FloatArray, FloatArray]:
        """Gain, and the speed at which the rotor would stand still [m/s], shape (n,) each."""
        gain, offset = np.ones(times.size), np.zeros(times.size)
        for number, here in self._timeline.parts(times):
            rotor = self._rotors[number]
            gain[here] = rotor.calibration_gain
            lost = rotor.starting_speed if isinstance(rotor, Cup) else 0.0
            offset[here] = (lost - rotor.calibration_offset) / rotor.calibration_gain
        return gain, offset

    def _directions(self, times: TimeArray, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Unit vector of the air in ENU (horizontal part) and the mount's velocity, (n, 2) each."""
        rows = self._source.at(times, np.zeros(3))
        to_earth = rows[:, MOUNT_ROTATION : MOUNT_ROTATION + 9].reshape(-1, 3, 3)
        local = np.stack((-np.cos(heading), -np.sin(heading), np.zeros_like(heading)), axis=1)
        return np.einsum("nij,nj->ni", to_earth, local)[:, :2], rows[:, :2]

    def _sum_up(self) -> None:
        if not self._pending:
            return
        block = merged(self._pending)
        self._pending = []
        h = self.history
        self._source.station = self._timeline.stations[self._timeline.number(block.start)]
        self._source.take(block)
        readings, edges = h.take(block)
        if readings:
            times, heading = h.nose.time[-readings:], h.nose.angle[-readings:]
            unit, carried = self._directions(times, heading)
            _, offset = self._calibration(times)
            for sums, part in self._windows.at(times):
                sums.readings += int(np.count_nonzero(part))
                sums.offsets += float(offset[part].sum())
                sums.time_directions += (offset[part, np.newaxis] * unit[part]).sum(axis=0)
                sums.carried += carried[part].sum(axis=0)
        if edges and h.nose.time.size:
            self._sum_edges(h.edges.time[-edges:], h.edges.angle[-edges:])
        h.forget_before(block.stop)

    def _sum_edges(self, times: TimeArray, angle: FloatArray) -> None:
        h = self.history
        if self._last_time == 0:
            self._last_time, self._last_angle = int(times[0]), float(angle[0])
        turned = np.diff(angle, prepend=self._last_angle)
        dt = np.diff(times, prepend=self._last_time) * 1e-9
        self._last_time, self._last_angle = int(times[-1]), float(angle[-1])
        gain = self._calibration(times)[0]
        rates = self._rates_of_turns(times, angle) / gain
        turned = turned / gain
        unit, _ = self._directions(times, np.interp(times, h.nose.time, h.nose.angle))
        for sums, part in self._windows.at(times):
            sums.edges += int(np.count_nonzero(part))
            sums.turned += float(turned[part].sum())
            sums.directions += (unit[part] * turned[part, np.newaxis]).sum(axis=0)
            moving = part & (dt > 0.0) & (turned > 0.0)
            whole = moving & (rates > 0.0)
            sums.rates += float(rates[whole].sum())
            sums.turns += int(np.count_nonzero(whole))
            sums.interval_time += float(dt[moving].sum())
            sums.interval_turned += float(turned[moving].sum())

    def _rates_of_turns(self, times: TimeArray, angle: FloatArray) -> FloatArray:
        """Mean rate over the turn that ends at each edge [rad/s], zero until there was one.

        A counter that is read less often than once a turn gives it over its own interval.
        """
        time = np.concatenate((self._turn_times, times))
        turned = np.concatenate((self._turn_angles, angle))
        own = np.arange(time.size - times.size, time.size)
        first = np.searchsorted(turned, turned[own] - _TURN, side="right") - 1
        begun = first >= 0
        first = np.maximum(first, 0)
        span = (time[own] - time[first]) * 1e-9
        kept = int(max(first[-1] - 1, 0))
        self._turn_times, self._turn_angles = time[kept:], turned[kept:]
        known = begun & (span > 0.0)
        return np.where(known, (turned[own] - turned[first]) / np.where(known, span, 1.0), 0.0)
