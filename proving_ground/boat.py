"""How a small boat turns, speeds up, rolls, pitches and sways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from proving_ground.inflow import Array
from proving_ground.stations import Boat
from proving_ground.weather import wandering


@dataclass
class Motion:
    """Motion of a platform on a time grid.

    position (n, 3) [m] and yaw, pitch, roll (n) [rad] in the earth frame (east, north, up);
    velocity (n, 3) [m/s] and turning (n, 3) [rad/s] in the platform's frame (forward, left, up).
    """

    position: Array
    yaw: Array
    pitch: Array
    roll: Array
    velocity: Array
    turning: Array

    def rotation(self) -> Array:
        """Rotation from the platform's frame to the earth's, shape (n, 3, 3)."""
        return rotation(self.yaw, self.pitch, self.roll)


def rotation(yaw: Array, pitch: Array, roll: Array) -> Array:
    """Rotation matrices (n, 3, 3) for yaw, then pitch, then roll [rad]."""
    cy, sy = np.cos(yaw), np.sin(yaw)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cr, sr = np.cos(roll), np.sin(roll)
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion(yaw: Array, pitch: Array, roll: Array) -> Array:
    """Unit quaternions (n, 4) as w, x, y, z."""
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def standing(count: int) -> Motion:
    """A platform that does not move."""
    zero = np.zeros(count)
    three = np.zeros((count, 3))
    return Motion(three, zero, zero.copy(), zero.copy(), three.copy(), three.copy())


def sail(rng: np.random.Generator, time: Array, boat: Boat) -> Motion:
    """A random course of the boat on the grid `time` [s]."""
    turn = boat.turn_rate * wandering(rng, time, 25.0, 240.0)
    step = np.gradient(time)
    yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(turn * step)
    speed = np.clip(boat.speed * (1.0 + 0.45 * wandering(rng, time, 60.0, 400.0)), 0.0, None)
    swell = boat.wave_period
    roll = boat.roll * wandering(rng, time, 0.75 * swell, 1.5 * swell)
    roll = roll + 0.6 * speed * turn / 9.81
    pitch = boat.pitch * wandering(rng, time, 0.65 * swell, 1.3 * swell)
    sway = 0.08 * wandering(rng, time, 0.8 * swell, 3.0 * swell) - 0.3 * turn
    roll_rate = np.gradient(roll, time)
    pitch_rate = np.gradient(pitch, time)
    yaw_rate = np.gradient(yaw, time)
    turning = np.stack(
        [
            roll_rate - yaw_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + yaw_rate * np.sin(roll) * np.cos(pitch),
            -pitch_rate * np.sin(roll) + yaw_rate * np.cos(roll) * np.cos(pitch),
        ],
        axis=-1,
    )
    velocity = np.stack([speed, sway, np.zeros_like(speed)], axis=-1)
    matrix = rotation(yaw, pitch, roll)
    track = np.cumsum(np.einsum("nij,nj->ni", matrix, velocity) * step[:, None], axis=0)
    return Motion(track, yaw, pitch, roll, velocity, turning)
