"""How simulated carriers move: as functions of time, so that any block of time can be computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from wind_sensors.motion import rotations
from wind_sensors.motion.platform_track import Motion
from wind_sensors.motion.relative_wind import STANDARD_GRAVITY
from wind_sensors.simulation import random_numbers

FloatArray = npt.NDArray[np.float64]

SWAY_LINES = 7
"""Sinusoids that make up one swaying motion."""
_DERIVATIVE_STEP = 1e-3
"""Half-width of the central difference for angular rates [s]."""


@dataclass(frozen=True)
class Trajectory:
    """Course, turns and sway of a carrier.

    Attributes:
        pattern: `hold` keeps the course, `legs` turns it by 90 degrees after every leg, `circle`
            turns it steadily.
        speed: Over ground [m/s].
        course: Heading of the velocity at t = 0, counter-clockwise from east [rad].
        turn_seconds: Duration of a full circle, or of one leg [s].
        corner_seconds: Duration of the turn between two legs [s].
        keeps_heading: The nose keeps pointing along `course` while the course turns.
        banked: Leans into turns as a coordinated aircraft does.
        roll, pitch, yaw: Rms of the swaying angles [rad].
        drift: Rms of each horizontal component of the swaying velocity [m/s].
        heave: Rms of the vertical velocity [m/s].
        sway_period: Period around which the swaying lies [s].
        lean_per_airspeed: Lean into the apparent wind per airspeed [rad s/m].
        gust_share: Share of the gusts' velocity that carries the platform along.
        response_time: Time constant of lean and gust drift [s].
        seed: Of the sway.
    """

    pattern: Literal["hold", "legs", "circle"] = "hold"
    speed: float = 0.0
    course: float = 0.0
    turn_seconds: float = 120.0
    corner_seconds: float = 8.0
    keeps_heading: bool = False
    banked: bool = False
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    drift: float = 0.0
    heave: float = 0.0
    sway_period: float = 4.0
    lean_per_airspeed: float = 0.0
    gust_share: float = 0.0
    response_time: float = 1.0
    seed: int = 0

    def course_at(self, time: FloatArray) -> FloatArray:
        """Heading of the steady velocity, counter-clockwise from east, continuous [rad]."""
        if self.pattern == "circle":
            return self.course + 2.0 * np.pi * time / self.turn_seconds
        if self.pattern == "legs":
            leg = np.floor(time / self.turn_seconds)
            into = time - leg * self.turn_seconds
            u = np.clip((into - self.turn_seconds) / self.corner_seconds + 1.0, 0.0, 1.0)
            smooth = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
            return self.course + 0.5 * np.pi * (leg + smooth)
        return np.full(time.shape, self.course)

    def angles_at(self, time: FloatArray) -> FloatArray:
        """Roll, pitch, yaw [rad] without the answer to gusts, shape (n, 3)."""
        course = self.course_at(time)
        yaw = np.full(time.shape, self.course) if self.keeps_heading else course
        roll = np.zeros(time.shape)
        if self.banked:
            turn_rate = (self.course_at(time + 0.05) - self.course_at(time - 0.05)) / 0.1
            roll = -np.arctan(self.speed * turn_rate / STANDARD_GRAVITY)
        return np.stack(
            (
                roll + self._sway(time, "roll", self.roll),
                self._sway(time, "pitch", self.pitch),
                yaw + self._sway(time, "yaw", self.yaw),
            ),
            axis=-1,
        )

    def velocity_at(self, time: FloatArray) -> FloatArray:
        """Velocity ENU [m/s] without the answer to gusts, shape (n, 3)."""
        course = self.course_at(time)
        return np.stack(
            (
                self.speed * np.cos(course) + self._sway(time, "east", self.drift),
                self.speed * np.sin(course) + self._sway(time, "north", self.drift),
                self._sway(time, "heave", self.heave),
            ),
            axis=-1,
        )

    def angle_rates_at(self, time: FloatArray) -> FloatArray:
        """Derivatives of `angles_at` [rad/s], shape (n, 3)."""
        ahead = self.angles_at(time + _DERIVATIVE_STEP)
        behind = self.angles_at(time - _DERIVATIVE_STEP)
        rates: FloatArray = (ahead - behind) / (2.0 * _DERIVATIVE_STEP)
        return rates

    def _sway(self, time: FloatArray, purpose: str, rms: float) -> FloatArray:
        if rms == 0.0:
            return np.zeros(time.shape)
        lines = np.arange(SWAY_LINES)
        phase = 2.0 * np.pi * random_numbers.uniform(self.seed, f"sway/{purpose}/phase", lines)
        shift = random_numbers.uniform(self.seed, f"sway/{purpose}/period", lines) - 0.5
        place = (lines - 0.5 * (SWAY_LINES - 1) + shift) / SWAY_LINES
        frequency = 2.0 * np.pi / self.sway_period * np.exp(0.8 * place)
        weight = np.exp(-2.0 * np.square(place))
        amplitude = rms * weight * np.sqrt(2.0 / np.sum(np.square(weight)))
        swaying: FloatArray = np.sin(np.outer(time, frequency) + phase) @ amplitude
        return swaying


def motion_of(
    angles: FloatArray, angle_rates: FloatArray, velocity: FloatArray, position: FloatArray
) -> Motion:
    """Motion from roll, pitch, yaw, their rates, and velocity and position in ENU.

    Args:
        angles: Roll, pitch, yaw [rad], shape (n, 3).
        angle_rates: Their derivatives [rad/s], shape (n, 3).
        velocity: ENU [m/s], shape (n, 3).
        position: ENU [m], shape (n, 3).
    """
    roll, pitch = angles[:, 0], angles[:, 1]
    attitude = rotations.from_roll_pitch_yaw(roll, pitch, angles[:, 2])
    roll_rate, pitch_rate, yaw_rate = angle_rates[:, 0], angle_rates[:, 1], angle_rates[:, 2]
    level = yaw_rate * np.cos(pitch)
    rates = np.stack(
        (
            roll_rate - yaw_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + level * np.sin(roll),
            level * np.cos(roll) - pitch_rate * np.sin(roll),
        ),
        axis=-1,
    )
    return Motion(attitude, rotations.rotate_back(attitude, velocity), rates, position)


def rover(speed: float = 1.5, course: float = 0.0, seed: int = 0) -> Trajectory:
    """A ground robot that drives a square over uneven ground."""
    return Trajectory(
        pattern="legs", speed=speed, course=course, turn_seconds=60.0, corner_seconds=4.0,
        roll=0.02, pitch=0.02, yaw=0.01, sway_period=1.5, seed=seed,
    )


def boat(speed: float = 2.5, course: float = 0.0, seed: int = 0) -> Trajectory:
    """A small boat that circles in waves."""
    return Trajectory(
        pattern="circle", speed=speed, course=course, turn_seconds=180.0,
        roll=0.06, pitch=0.03, yaw=0.03, heave=0.2, sway_period=4.0, seed=seed,
    )


def multirotor(speed: float = 0.0, course: float = 0.0, seed: int = 0) -> Trajectory:
    """A multirotor that hovers, or flies legs when it has a speed, and leans into the wind."""
    return Trajectory(
        pattern="legs" if speed > 0.0 else "hold", speed=speed, course=course, turn_seconds=40.0,
        corner_seconds=4.0, keeps_heading=True, roll=0.02, pitch=0.02, yaw=0.02, drift=0.15,
        heave=0.1, sway_period=2.5, lean_per_airspeed=0.02, gust_share=0.15, seed=seed,
    )


def fixed_wing(speed: float = 16.0, course: float = 0.0, seed: int = 0) -> Trajectory:
    """An aircraft that loiters in banked circles."""
    return Trajectory(
        pattern="circle", speed=speed, course=course, turn_seconds=60.0, banked=True,
        roll=0.03, pitch=0.02, yaw=0.01, heave=0.3, sway_period=3.0, gust_share=0.3, seed=seed,
    )


CARRIERS = {"rover": rover, "boat": boat, "multirotor": multirotor, "fixed-wing": fixed_wing}
"""Ready trajectories by name, for commands and parameters."""
