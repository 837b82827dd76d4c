"""One record before its instruments run: wind, motion, air, and everything an effect may touch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from proving_ground.blades import BladeTracks
from proving_ground.boat import Motion, rotation, sail, standing
from proving_ground.cups import CupTracks
from proving_ground.drive import GRID_RATE
from proving_ground.fins import FinTracks
from proving_ground.inflow import Array, make_eddies
from proving_ground.stations import CupRotor, Station
from proving_ground.tunnel import blade_tracks, cup_tracks, fin_tracks
from proving_ground.weather import GRAVITY, Weather, air_density, slow_wind, wandering

GREASE_REFERENCE = 15.0
ANGLE_NOISE = np.radians(0.02)

TimesChange = Callable[[Array], Array]
AngleChange = Callable[[Array, Array], Array]


@dataclass
class Scene:
    """State of the world for one record; effects change it in place before it runs.

    rng is for what effects draw; noise is for the measurement, the same whatever is planted.

    time (n) [s] is the grid. reference (n, 3) [m/s] earth frame. rotor_flow, vane_flow (n, 3)
    [m/s] apparent wind in the sensor's frame. motion is what the platform does, reported what its
    odometry says. angle_changes act on the nose heading on the grid, reading_changes on the
    sampled and wrapped reading, slot_changes on the disc's edge times, pulse_changes on what the
    electronics make of those, reference_changes on the wind between the reference's heads,
    driver_changes on the numbers that it sends, stamp_changes by channel ("rotor", "vane",
    "odometry") on the stamps.
    """

    station: Station
    rng: np.random.Generator
    noise: np.random.Generator
    time: Array
    reference: Array
    rotor_flow: Array
    vane_flow: Array
    motion: Motion
    reported: Motion
    rotor: CupTracks | BladeTracks
    vane: FinTracks
    temperature: Array
    pressure: Array
    reported_pressure: Array
    slots: Array
    angle_changes: list[AngleChange] = field(default_factory=list)
    reading_changes: list[AngleChange] = field(default_factory=list)
    slot_changes: list[TimesChange] = field(default_factory=list)
    pulse_changes: list[TimesChange] = field(default_factory=list)
    odometry_changes: list[Callable[[Array, Motion], Motion]] = field(default_factory=list)
    reference_changes: list[Callable[[Array, Array], Array]] = field(default_factory=list)
    driver_changes: list[Callable[[Array, Array], Array]] = field(default_factory=list)
    stamp_changes: dict[str, list[TimesChange]] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """Length of the record [s]."""
        return float(self.time[-1])

    def bearing_from(self, flow: Array) -> Array:
        """Direction [rad] in the sensor's frame that a flow comes from."""
        return np.arctan2(-flow[:, 1], -flow[:, 0])

    def stamp(self, channel: str, change: TimesChange) -> None:
        """Add a change of the stamps of a channel."""
        self.stamp_changes.setdefault(channel, []).append(change)


def build_scene(
    station: Station,
    weather: Weather,
    minutes: float,
    seed: int,
    measured: Array | None = None,
) -> Scene:
    """Draw the wind, motion and air of a record of a healthy station.

    measured: wind (n, 3) [m/s] on the grid of the record that really blew at the instrument of a
    mast; then only its difference from the reference's place is drawn.
    """
    rng = np.random.default_rng([seed, station.seed, ord(station.kind), 5])
    time = np.arange(round(60.0 * minutes * GRID_RATE) + 1) / GRID_RATE
    slow = slow_wind(rng, time, weather)
    motion = sail(rng, time, station.boat) if station.boat else standing(len(time))
    matrix = motion.rotation()
    ground = np.einsum("nij,nj->ni", matrix, motion.velocity)
    along = np.stack([np.cos(slow.heading), np.sin(slow.heading)], axis=-1)
    passing = np.maximum(slow.speed - (ground[:, :2] * along).sum(axis=1), 0.3)
    run = np.concatenate([[0.0], np.cumsum(passing[:-1] / GRID_RATE)])
    sonic = station.sonic
    eddies = make_eddies(
        rng,
        float(run[-1]) + 50.0,
        station.height,
        sonic.separation,
        station.decay,
        float(np.clip(60.0 * weather.mean_speed, 200.0, 900.0)),
    )
    bearing = sonic.bearing + motion.yaw
    ahead = sonic.separation * np.cos(bearing - slow.heading)
    spread = slow.speed * slow.turbulence
    sizes = np.stack([spread, weather.cross_ratio * spread, weather.vertical_ratio * spread])

    def wind_at(place: Array, where: Array) -> Array:
        unit = eddies.sample(place, where) * sizes.T
        level = slow.speed + unit[:, 0]
        east = level * along[:, 0] - unit[:, 1] * along[:, 1]
        north = level * along[:, 1] + unit[:, 1] * along[:, 0]
        return np.stack([east, north, unit[:, 2]], axis=-1)

    path = max(1, round(sonic.path_length / eddies.spacing))
    smooth = np.ones(path) / path
    averaged = np.stack(
        [np.convolve(eddies.reference[:, i], smooth, mode="same") for i in range(3)], axis=-1
    )
    reference = wind_at(averaged, run - ahead + 20.0)
    instrument = wind_at(eddies.instrument, run + 20.0)
    if measured is not None:
        reference = measured + reference - instrument
        instrument = measured
    apparent = _apparent(station, motion, matrix, instrument)
    temperature = weather.temperature + weather.temperature_swing * np.sin(
        2.0 * np.pi * time / rng.uniform(600.0, 1500.0) + rng.uniform(0.0, 2.0 * np.pi)
    )
    pressure = weather.pressure + 8.0 * wandering(rng, time, 200.0, 2000.0)
    scene = Scene(
        station=station,
        rng=rng,
        noise=np.random.default_rng([seed, station.seed, ord(station.kind), 6]),
        time=time,
        reference=reference,
        rotor_flow=apparent,
        vane_flow=apparent.copy(),
        motion=motion,
        reported=motion,
        rotor=_rotor_tracks(station, len(time)),
        vane=fin_tracks(station.vane.shaft, len(time)),
        temperature=temperature,
        pressure=pressure,
        reported_pressure=pressure.copy(),
        slots=np.array(station.slots),
    )
    density = air_density(temperature, pressure)
    scene.rotor.density[:] = density
    scene.vane.density[:] = density
    shaft = station.rotor.shaft
    scene.rotor.viscous[:] *= np.exp(-shaft.grease * (temperature - GREASE_REFERENCE))
    _mount_vane(scene, matrix)
    return scene


def _apparent(station: Station, motion: Motion, matrix: Array, wind: Array) -> Array:
    body = np.einsum("nji,nj->ni", matrix, wind)
    if station.boat:
        arm = np.array(station.boat.sensor_position)
        body = body - motion.velocity - np.cross(motion.turning, arm)
    return tilted(body, station.lean, station.lean_bearing)


def tilted(flow: Array, tilt: float, bearing: float) -> Array:
    """Flow (n, 3) seen in a frame whose up axis leans by `tilt` towards `bearing` [rad]."""
    one = np.array([bearing])
    to_lean = (
        rotation(one, np.array([tilt]), np.zeros(1))[0]
        @ (rotation(-one, np.zeros(1), np.zeros(1))[0])
    )
    return np.asarray(flow @ to_lean)


def _rotor_tracks(station: Station, count: int) -> CupTracks | BladeTracks:
    rotor = station.rotor
    if isinstance(rotor, CupRotor):
        return cup_tracks(rotor, count)
    return blade_tracks(rotor, count)


def _mount_vane(scene: Scene, matrix: Array) -> None:
    station = scene.station
    force = np.zeros((len(scene.time), 3))
    force[:, 2] = -GRAVITY
    force = np.einsum("nji,nj->ni", matrix, force)
    if station.boat:
        arm = np.array(station.boat.sensor_position)
        speed = scene.motion.velocity + np.cross(scene.motion.turning, arm)
        acceleration = np.gradient(speed, scene.time, axis=0)
        acceleration += np.cross(scene.motion.turning, speed)
        force -= acceleration
    force = tilted(force, station.lean, station.lean_bearing)
    scene.vane.gravity_x[:] = force[:, 0]
    scene.vane.gravity_y[:] = force[:, 1]
    scene.vane.mount_rate[:] = scene.motion.turning[:, 2]
    scene.vane.mount_acceleration[:] = np.gradient(scene.motion.turning[:, 2], scene.time)
