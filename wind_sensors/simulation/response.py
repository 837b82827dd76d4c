"""The forward model: a wind, a motion and an air in; rotor and vane movements out.

`respond` is the only place where a station meets a wind. Simulator, diagnosis and live simulation
all call it, so that a difference between two of its results is a difference of the station and
never of the integration.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.instruments.dynamics.rotor import RotorParameters
from wind_sensors.instruments.dynamics.rotor_record import integrate_rotor
from wind_sensors.instruments.dynamics.vane import integrate_vane
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.memory import DriveMemory
from wind_sensors.simulation.rotor_axes import wind_in_rotor_axes
from wind_sensors.simulation.wind_at_sensor import WindAtSensors
from wind_sensors.station.changes import Segment, segments
from wind_sensors.station.model import (
    STANDARD_DENSITY,
    Angle,
    Bivane,
    Cup,
    Propeller,
    Rotor,
    Station,
    Vane,
)
from wind_sensors.station.parameters import rotor_parameters, vane_parameters

FloatArray = npt.NDArray[np.float64]

_Movement = TypeVar("_Movement")

LARGEST_TURN_PER_NODE = 1.0
"""Turn of a rotor with a once-per-revolution torque between two of its results [rad]."""


@dataclass(frozen=True)
class RotorResponse:
    """Movement of one rotor.

    Attributes:
        dt: Interval of the arrays [s]; the drive's interval divided by `nodes`.
        nodes: Results per interval of the drive, more than one where the rotor's speed varies
            within a turn.
        y: Calibration distance times rotor rate, l s [m/s], shape (m,).
        psi: Rotor angle, continuous [rad], shape (m,).
        rate: Rotor rate s [rad/s], shape (m,).
    """

    dt: float
    nodes: int
    y: FloatArray
    psi: FloatArray
    rate: FloatArray


@dataclass(frozen=True)
class AngleResponse:
    """Movement of one vane, or of one axis of a bivane.

    Attributes:
        angle: Heading of the nose in instrument axes, counter-clockwise, continuous [rad], (n,).
            For the elevation of a bivane: positive when the wind blows upwards (nose down).
        rate: Its rate [rad/s], shape (n,).
    """

    angle: FloatArray
    rate: FloatArray


@dataclass(frozen=True)
class ResponseState:
    """Where the instruments are at one instant; start of the next response.

    Attributes:
        rotors: s [rad/s] and psi [rad] by rotor name.
        angles: phi [rad] and its rate [rad/s] by vane name (`<name>/elevation` for bivanes).
    """

    rotors: dict[str, tuple[float, float]] = field(default_factory=dict)
    angles: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Stretch:
    """A part of a response in which the station does not change: instants first to last."""

    first: int
    last: int
    segment: Segment


@dataclass(frozen=True)
class Response:
    """Movements of the instruments of a station in one drive.

    Attributes:
        station: The station, with its changes.
        drive: What drove it.
        stretches: The parts without changes; each begins at the instant where the last one ends.
        rotors: By rotor name.
        angles: By vane name; a bivane has `<name>` (azimuth) and `<name>/elevation`.
        final: State at the last instant.
    """

    station: Station
    drive: Drive
    stretches: tuple[Stretch, ...]
    rotors: dict[str, RotorResponse]
    angles: dict[str, AngleResponse]
    final: ResponseState


def respond(
    station: Station,
    drive: Drive,
    state: ResponseState | None = None,
    only: Collection[str] = (),
    memory: DriveMemory | None = None,
) -> Response:
    """Movements of the instruments in a wind.

    Args:
        station: The station; its changes happen at the nearest instants of the drive.
        drive: Wind, motion and air.
        state: Where the instruments are at the first instant; None or a missing name: in
            equilibrium with the wind.
        only: Names of the instruments wanted; empty: all. What carries a wanted instrument is
            computed too.
        memory: What is known of other stations in this drive.

    Returns:
        Movements at the drive's instants.

    Raises:
        UserError: An instrument cannot be simulated as the station describes it.
    """
    stretches = _stretches(station, drive)
    wanted = _wanted(station, only)
    nodes = _nodes(stretches, drive, wanted)
    now = state if state is not None else ResponseState()
    rotor_parts: dict[str, list[tuple[FloatArray, FloatArray, float]]] = {}
    angle_parts: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for stretch in stretches:
        part = _part(drive, stretch)
        worker = _Worker(stretch, part, now, nodes, memory)
        for name in wanted:
            worker.run(name)
        for name, movement in worker.rotors.items():
            rotor_parts.setdefault(name, []).append(movement)
        for name, turning in worker.angles.items():
            angle_parts.setdefault(name, []).append(turning)
        now = worker.state()
    rotors = {
        name: _joined_rotor(parts, drive.dt, nodes[name]) for name, parts in rotor_parts.items()
    }
    angles = {
        name: AngleResponse(_joined([a for a, _ in parts]), _joined([r for _, r in parts]))
        for name, parts in angle_parts.items()
    }
    return Response(station, drive, stretches, rotors, angles, now)


def _joined(parts: list[FloatArray]) -> FloatArray:
    """Parts that share their ends, as one record."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([parts[0], *(p[1:] for p in parts[1:])])


def _joined_rotor(
    parts: list[tuple[FloatArray, FloatArray, float]], dt: float, nodes: int
) -> RotorResponse:
    y = _joined([p[0] for p in parts])
    psi = _joined([p[1] for p in parts])
    rate = _joined([p[0] / p[2] for p in parts])
    return RotorResponse(dt / nodes, nodes, y, psi, rate)


def _stretches(station: Station, drive: Drive) -> tuple[Stretch, ...]:
    if not station.changes:
        return (Stretch(0, len(drive) - 1, segments(station)[0]),)
    out: list[Stretch] = []
    last = len(drive) - 1
    for segment in segments(station):
        first_at = max(round((segment.start - drive.elapsed) / drive.dt), 0)
        last_at = last
        if np.isfinite(segment.stop):
            last_at = min(round((segment.stop - drive.elapsed) / drive.dt), last)
        if last_at > first_at:
            out.append(Stretch(first_at, last_at, segment))
    return tuple(out)


def _part(drive: Drive, stretch: Stretch) -> Drive:
    first, stop = stretch.first, stretch.last + 1
    if first == 0 and stop == len(drive):
        return drive
    return replace(
        drive,
        start_ns=int(drive.times_ns[first]),
        wind=drive.wind[first:stop],
        motion=None if drive.motion is None else drive.motion.part(first, stop),
        temperature=None if drive.temperature is None else drive.temperature[first:stop],
        density=None if drive.density is None else drive.density[first:stop],
        elapsed=drive.elapsed + first * drive.dt,
    )


def _wanted(station: Station, only: Collection[str]) -> tuple[str, ...]:
    """Names of what is to be computed, carriers before what they carry."""
    names = [i.name for i in station.instruments if not only or i.name in only]
    carriers = [
        i.mounted_on
        for i in station.instruments
        if isinstance(i, Propeller) and i.mounted_on and i.name in names
    ]
    rotors = [n for n in names if isinstance(station.instrument(n), Rotor)]
    rest = [n for n in names if n not in rotors]
    return tuple(dict.fromkeys([*rest, *carriers, *rotors]))


def _nodes(stretches: tuple[Stretch, ...], drive: Drive, wanted: tuple[str, ...]) -> dict[str, int]:
    """Results per interval for each rotor: enough to resolve a turn where it matters."""
    nodes = dict.fromkeys(wanted, 1)
    for stretch in stretches:
        for name in wanted:
            rotor = stretch.segment.station.instrument(name)
            if isinstance(rotor, Rotor) and rotor.torque_harmonic > 0.0:
                speed = float(np.linalg.norm(drive.wind, axis=1).max()) * rotor.calibration_gain
                if drive.motion is not None:
                    speed += float(np.linalg.norm(drive.motion.velocity, axis=1).max())
                turn = drive.dt * speed / rotor.calibration_distance
                nodes[name] = max(nodes[name], int(np.ceil(turn / LARGEST_TURN_PER_NODE)))
    return nodes


class _Worker:
    """Runs the kernels of one stretch and keeps where they end."""

    def __init__(
        self,
        stretch: Stretch,
        drive: Drive,
        start: ResponseState,
        nodes: dict[str, int],
        memory: DriveMemory | None,
    ) -> None:
        self._station = stretch.segment.station
        self._part = (stretch.first, stretch.last)
        self._drive = drive
        self._start = start
        self._nodes = nodes
        self._memory = memory
        self._winds = WindAtSensors(self._station, drive, memory, self._part)
        self._keys: dict[str, Hashable] = {}
        self.rotors: dict[str, tuple[FloatArray, FloatArray, float]] = {}
        self.angles: dict[str, tuple[FloatArray, FloatArray]] = {}

    def run(self, name: str) -> None:
        instrument = self._station.instrument(name)
        if isinstance(instrument, Vane):
            self._run_vane(instrument)
        elif isinstance(instrument, Bivane):
            self._run_bivane(instrument)
        else:
            self._run_rotor(instrument)

    def state(self) -> ResponseState:
        """Where everything is at the end of the stretch."""
        return ResponseState(
            {n: (float(y[-1]) / length, float(psi[-1])) for n, (y, psi, length) in
             self.rotors.items()},
            {n: (float(a[-1]), float(r[-1])) for n, (a, r) in self.angles.items()},
        )

    def _known(self, key: Hashable, compute: Callable[[], _Movement]) -> _Movement:
        """What follows from a key in this part of the drive."""
        if self._memory is None:
            return compute()
        return self._memory.movements.of((self._part, key), compute)

    def _density_ratio(self, reference: float) -> FloatArray:
        if self._drive.density is None:
            return np.full(len(self._drive), STANDARD_DENSITY / reference)
        return self._drive.density / reference

    def _run_vane(self, vane: Vane) -> None:
        name = vane.name
        parameters = vane_parameters(vane)
        key = (
            parameters, vane.reference_density, self._winds.key(vane),
            self._start.angles.get(name),
        )

        def turned() -> tuple[FloatArray, FloatArray]:
            flow = self._winds.flow(vane)
            return self._turned(name, vane, flow.wind, flow.turning[:, 2], flow.gravity[:, :2])

        self._keys[name] = key
        self.angles[name] = self._known(key, turned)

    def _turned(
        self, name: str, vane: Angle, wind: FloatArray, turning: FloatArray, gravity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        angle, rate = self._start.angles.get(name, (np.nan, 0.0))
        return integrate_vane(
            vane_parameters(vane),
            np.ascontiguousarray(wind),
            np.ascontiguousarray(turning),
            np.ascontiguousarray(gravity),
            self._density_ratio(vane.reference_density),
            self._drive.dt,
            angle,
            rate,
        )

    def _run_bivane(self, bivane: Bivane) -> None:
        """Azimuth as a vane; elevation as a vane in the vertical plane through the nose.

        The elevation's axis is horizontal and to the left of the nose, so that a wind that blows
        upwards turns it positively (Mitsuta (1966): W = V beta).
        """
        name = bivane.name
        flow = self._winds.flow(bivane)
        self.angles[name] = self._turned(
            name, bivane, flow.wind, flow.turning[:, 2], flow.gravity[:, :2]
        )
        azimuth = self.angles[name][0]
        c, s = np.cos(azimuth), np.sin(azimuth)
        towards = -(flow.wind[:, 0] * c + flow.wind[:, 1] * s)
        in_plane = np.stack((-towards, -flow.wind[:, 2], np.zeros_like(c)), axis=1)
        pitching = -flow.turning[:, 0] * s + flow.turning[:, 1] * c
        pull = np.stack(
            (flow.gravity[:, 0] * c + flow.gravity[:, 1] * s, -flow.gravity[:, 2]), axis=1
        )
        elevation = f"{name}/elevation"
        self.angles[elevation] = self._turned(elevation, bivane, in_plane, pitching, pull)

    def _run_rotor(self, rotor: Cup | Propeller) -> None:
        parameters = rotor_parameters(rotor)
        start = self._start.rotors.get(rotor.name, (np.nan, 0.0))
        numbers = tuple(v for v in parameters if not isinstance(v, np.ndarray))
        axes_key = self._axes_key(rotor)
        key = (
            numbers, parameters.angular_response.tobytes(), rotor.reference_density,
            self._nodes[rotor.name], self._start.rotors.get(rotor.name), axes_key,
        )

        def rotated() -> tuple[FloatArray, FloatArray]:
            carrier = self.angles.get(rotor.mounted_on) if isinstance(rotor, Propeller) else None
            axes = self._known(
                ("axes", axes_key),
                lambda: wind_in_rotor_axes(self._station, rotor, self._winds, carrier),
            )
            return self._rotated(rotor, parameters, start, axes)

        y, turned = self._known(key, rotated)
        if not np.isfinite(y[-1]):
            raise UserError(
                f"'{rotor.name}' runs away: its torque grows with its rate.",
                f"instruments.{rotor.name}.a4",
                "Give a coefficient a4 of at most one.",
            )
        self.rotors[rotor.name] = (y, turned, rotor.calibration_distance)

    def _axes_key(self, rotor: Cup | Propeller) -> Hashable:
        """What the wind in a rotor's axes depends on."""
        if isinstance(rotor, Cup):
            return self._winds.key(rotor)
        if rotor.mounted_on:
            lean = self._station.instrument(rotor.mounted_on).tilt_deg
            carried = (self._keys[rotor.mounted_on], rotor.distance_to_vane_axis)
            return self._winds.key(rotor, lean), carried
        return self._winds.key(rotor), repr(rotor.axis)

    def _rotated(
        self,
        rotor: Cup | Propeller,
        parameters: RotorParameters,
        start: tuple[float, float],
        axes: tuple[FloatArray, FloatArray, FloatArray],
    ) -> tuple[FloatArray, FloatArray]:
        axial, transverse, lateral = axes
        temperature = self._drive.temperature
        if temperature is None:
            temperature = np.full(axial.shape, rotor.reference_temperature)
        rate, psi = start
        return integrate_rotor(
            parameters, axial, transverse, lateral, self._density_ratio(rotor.reference_density),
            temperature, self._drive.dt, self._nodes[rotor.name],
            rate * rotor.calibration_distance, psi,
        )
