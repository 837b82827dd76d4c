"""Run a scene's instruments and sample what a logger would have recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from proving_ground.blades import BladeTracks
from proving_ground.boat import Motion
from proving_ground.cups import CupTracks
from proving_ground.drive import GRID_RATE, SUBSTEPS, turn_cups, turn_propeller_on_vane, turn_vane
from proving_ground.inflow import Array
from proving_ground.scene import ANGLE_NOISE, Scene
from proving_ground.stations import CupRotor, Propeller
from proving_ground.tunnel import STEP

SONIC_RESOLUTION = 0.01


@dataclass(frozen=True)
class Signals:
    """What was recorded; every time is a stamp in seconds from the start of the record.

    reference (n, 3) [m/s] east, north, up; vane [rad] wrapped; pulses: edge stamps; odometry: the
    reported motion, or None on a mast; temperature [deg C]; pressure [Pa].
    """

    reference_time: Array
    reference: Array
    vane_time: Array
    vane: Array
    pulses: Array
    odometry_time: Array
    odometry: Motion | None
    air_time: Array
    temperature: Array
    pressure: Array


def wrap(angle: Array) -> Array:
    """Angle [rad] in [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def run_scene(scene: Scene) -> Signals:
    """Step the instruments through the scene and sample every channel."""
    azimuth, nose = _turn(scene)
    reference_time, reference = _sonic(scene)
    vane_time, vane = _vane(scene, nose)
    odometry_time, odometry = _odometry(scene)
    air_time = np.arange(int(scene.duration)).astype(float)
    rng = scene.noise
    temperature = np.interp(air_time, scene.time, scene.temperature)
    pressure = np.interp(air_time, scene.time, scene.reported_pressure)
    return Signals(
        reference_time=reference_time,
        reference=reference,
        vane_time=vane_time,
        vane=vane,
        pulses=_pulses(scene, azimuth),
        odometry_time=odometry_time,
        odometry=odometry,
        air_time=air_time,
        temperature=np.round(temperature + 0.02 * rng.standard_normal(air_time.size), 2),
        pressure=np.round(pressure + 2.0 * rng.standard_normal(air_time.size), 0),
    )


def _turn(scene: Scene) -> tuple[Array, Array]:
    station = scene.station
    rotor = station.rotor
    start = float(scene.bearing_from(scene.vane_flow[:1])[0])
    speed = float(np.hypot(scene.rotor_flow[0, 0], scene.rotor_flow[0, 1]))
    rate = speed / rotor.geometry.cruise
    fin = station.vane.geometry
    if isinstance(rotor, CupRotor) and isinstance(scene.rotor, CupTracks):
        first = float(scene.noise.uniform(0.0, 2.0 * np.pi))
        azimuth = turn_cups(
            scene.rotor_flow, rotor.geometry, scene.rotor, first, rate, STEP, SUBSTEPS
        )
        nose = turn_vane(scene.vane_flow, fin, scene.vane, start, 0.0, STEP, SUBSTEPS)
        return azimuth, nose
    if isinstance(rotor, Propeller) and isinstance(scene.rotor, BladeTracks):
        return turn_propeller_on_vane(
            scene.rotor_flow,
            scene.vane_flow,
            rotor.geometry,
            scene.rotor,
            fin,
            scene.vane,
            start,
            rate,
            STEP,
            SUBSTEPS,
        )
    raise TypeError("the rotor and its tracks are of different kinds")


def _stamp(scene: Scene, channel: str, time: Array) -> Array:
    for change in scene.stamp_changes.get(channel, []):
        time = change(time)
    return time


def _sonic(scene: Scene) -> tuple[Array, Array]:
    sonic = scene.station.sonic
    time = np.arange(int(scene.duration * sonic.rate)) / sonic.rate
    wind = np.stack([np.interp(time, scene.time, scene.reference[:, i]) for i in range(3)], axis=-1)
    for change in scene.reference_changes:
        wind = change(time, wind)
    cosine, sine = np.cos(sonic.yaw), np.sin(sonic.yaw)
    turned = wind.copy()
    turned[:, 0] = cosine * wind[:, 0] - sine * wind[:, 1]
    turned[:, 1] = sine * wind[:, 0] + cosine * wind[:, 1]
    turned = sonic.gain * turned + sonic.noise * scene.noise.standard_normal(turned.shape)
    turned = np.round(turned / SONIC_RESOLUTION) * SONIC_RESOLUTION
    for change in scene.driver_changes:
        turned = change(time, turned)
    keep = np.ones(time.size, dtype=bool)
    for _ in range(scene.noise.poisson(sonic.dropouts * scene.duration / 600.0)):
        begin = scene.noise.uniform(1.0, scene.duration)
        keep &= (time < begin) | (time > begin + scene.noise.exponential(0.6))
    return time[keep], turned[keep]


def _vane(scene: Scene, nose: Array) -> tuple[Array, Array]:
    for change in scene.angle_changes:
        nose = change(scene.time, nose)
    rate = scene.station.vane_rate
    time = np.arange(int(scene.duration * rate)) / rate
    angle = np.interp(time, scene.time, nose)
    angle = wrap(angle + ANGLE_NOISE * scene.noise.standard_normal(time.size))
    for change in scene.reading_changes:
        angle = change(time, angle)
    return _stamp(scene, "vane", time), wrap(angle)


def _pulses(scene: Scene, azimuth: Array) -> Array:
    turns = np.maximum.accumulate(
        np.concatenate([[0.0], np.cumsum(np.abs(np.diff(azimuth)))]) / (2.0 * np.pi)
        + (azimuth[0] / (2.0 * np.pi)) % 1.0
    )
    time = np.arange(turns.size) / (GRID_RATE * SUBSTEPS)
    first, last = int(turns[0]), int(turns[-1]) + 1
    places = (np.arange(first, last + 1)[:, None] + scene.slots[None, :]).ravel()
    places = places[(places > turns[0]) & (places < turns[-1])]
    edges = np.interp(places, turns, time)
    for change in (*scene.slot_changes, *scene.pulse_changes):
        edges = change(edges)
    edges = np.sort(_stamp(scene, "rotor", edges))
    return edges[edges >= 0.0]


def _odometry(scene: Scene) -> tuple[Array, Motion | None]:
    if scene.station.boat is None:
        return np.zeros(0), None
    rate = scene.station.vane_rate
    time = np.arange(int(scene.duration * rate)) / rate
    full = scene.reported
    index = np.round(time * GRID_RATE).astype(np.int64)
    rng = scene.noise
    motion = Motion(
        full.position[index],
        full.yaw[index] + np.radians(0.1) * rng.standard_normal(time.size),
        full.pitch[index] + np.radians(0.05) * rng.standard_normal(time.size),
        full.roll[index] + np.radians(0.05) * rng.standard_normal(time.size),
        full.velocity[index] + 0.01 * rng.standard_normal((time.size, 3)),
        full.turning[index] + 0.001 * rng.standard_normal((time.size, 3)),
    )
    for change in scene.odometry_changes:
        motion = change(time, motion)
    return _stamp(scene, "odometry", time), motion
