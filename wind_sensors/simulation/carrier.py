"""The simulated carrier: where it is, what it does in gusts, and what it reports of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.motion import rotations
from wind_sensors.motion.platform_errors import reported_motion
from wind_sensors.motion.platform_track import Motion, PlatformTrack, TrackLimits
from wind_sensors.simulation import random_numbers
from wind_sensors.simulation.trajectories import Trajectory, motion_of
from wind_sensors.simulation.wind_field import WindSource
from wind_sensors.station.model import Platform
from wind_sensors.station.signals import PlatformStates

FloatArray = npt.NDArray[np.float64]

WANDER_SECONDS = 5.0
"""Time over which the errors of a platform's navigation wander [s]."""


class Carrier:
    """Moves through a wind, block by block; the blocks must follow each other.

    Args:
        trajectory: Movement by parameters, or states to follow.
        wind: What it moves through.
        start: Start of the recording [ns].
        dt: Interval of the grid [s].
    """

    def __init__(
        self, trajectory: Trajectory | PlatformStates, wind: WindSource, start: int, dt: float
    ) -> None:
        self._trajectory = trajectory
        self._track: PlatformTrack | None = None
        if isinstance(trajectory, PlatformStates):
            self._track = PlatformTrack(trajectory, TrackLimits(longest_gap=math.inf))
        self._wind = wind
        self._start = start
        self._dt = dt
        self._position = np.zeros(3)
        self._travelled = 0.0
        self._gust: FloatArray | None = None

    def move(self, time: FloatArray) -> tuple[Motion, FloatArray, FloatArray]:
        """Movement over a block whose first instant was the last one of the block before.

        Args:
            time: Instants since the start of the recording [s], regular, shape (n,).

        Returns:
            True motion, earth wind at the sensor and at the reference, ENU [m/s], shape (n, 3).
        """
        if self._track is not None:
            return self._follow(time, self._track)
        trajectory = self._trajectory
        assert isinstance(trajectory, Trajectory)
        velocity = trajectory.velocity_at(time)
        mean = self._wind.mean_at(time)
        travelled = self._path(velocity - mean, mean)
        wind, beside = self._wind.along(time, travelled)
        angles = trajectory.angles_at(time)
        rates = trajectory.angle_rates_at(time)
        if trajectory.lean_per_airspeed != 0.0 or trajectory.gust_share != 0.0:
            slow, slope = self._felt_gusts(wind - velocity, trajectory.response_time)
            gust = slow - (mean - velocity)
            velocity = velocity + trajectory.gust_share * gust
            angles, rates = _leaning(angles, rates, slow, slope, trajectory.lean_per_airspeed)
        position = self._moved(velocity)
        return motion_of(angles, rates, velocity, position), wind, beside

    def _follow(
        self, time: FloatArray, track: PlatformTrack
    ) -> tuple[Motion, FloatArray, FloatArray]:
        times = self._start + np.rint(time * 1e9).astype(np.int64)
        sample = track.at(times)
        if not np.all(sample.known):
            last = (track.stop - self._start) * 1e-9
            raise UserError(
                f"The trajectory to follow ends after {last:.1f} s.",
                "trajectory",
                "Simulate a shorter time.",
            )
        motion = sample.motion
        velocity = rotations.rotate(motion.attitude, motion.velocity)
        mean = self._wind.mean_at(time)
        wind, beside = self._wind.along(time, self._path(velocity - mean, mean))
        return motion, wind, beside

    def _path(self, against_air: FloatArray, mean: FloatArray) -> FloatArray:
        """Length of the path through the air over the mean speed [s]."""
        speed = np.linalg.norm(mean, axis=1)
        pace = np.linalg.norm(against_air, axis=1) / np.maximum(speed, 1e-9)
        steps = 0.5 * (pace[1:] + pace[:-1]) * self._dt
        travelled = self._travelled + np.concatenate(([0.0], np.cumsum(steps)))
        self._travelled = float(travelled[-1])
        return travelled

    def _moved(self, velocity: FloatArray) -> FloatArray:
        steps = 0.5 * (velocity[1:] + velocity[:-1]) * self._dt
        position: FloatArray = self._position + np.vstack((np.zeros(3), np.cumsum(steps, axis=0)))
        self._position = position[-1]
        return position

    def _felt_gusts(self, apparent: FloatArray, constant: float) -> tuple[FloatArray, FloatArray]:
        """The apparent wind through a first-order lag, and its rate of change."""
        decay = math.exp(-self._dt / constant)
        slow = np.empty_like(apparent)
        now = apparent[0] if self._gust is None else self._gust
        for i in range(apparent.shape[0]):
            slow[i] = now
            now = apparent[i] + (now - apparent[i]) * decay
        self._gust = slow[-1]
        return slow, (apparent - slow) / constant


def _leaning(
    angles: FloatArray, rates: FloatArray, slow: FloatArray, slope: FloatArray, lean: float
) -> tuple[FloatArray, FloatArray]:
    """Angles and their rates with a lean into the apparent wind added to roll and pitch."""
    cosine, sine = np.cos(angles[:, 2]), np.sin(angles[:, 2])
    ahead = slow[:, 0] * cosine + slow[:, 1] * sine
    left = -slow[:, 0] * sine + slow[:, 1] * cosine
    ahead_rate = slope[:, 0] * cosine + slope[:, 1] * sine + rates[:, 2] * left
    left_rate = -slope[:, 0] * sine + slope[:, 1] * cosine - rates[:, 2] * ahead
    nothing = np.zeros_like(ahead)
    # The nose goes down (positive pitch) when the air comes from ahead, blowing backwards.
    added = lean * np.stack((left, -ahead, nothing), axis=1)
    added_rate = lean * np.stack((left_rate, -ahead_rate, nothing), axis=1)
    return angles + added, rates + added_rate


def reported_with_noise(
    platform: Platform, motion: Motion, time: FloatArray, seed: int | None
) -> Motion:
    """What the platform reports of a motion, with wandering errors of attitude and velocity.

    Args:
        platform: The carrier with its errors.
        motion: True motion at those instants.
        time: Seconds since the start of the recording, shape (n,).
        seed: Of the errors; None: no noise.
    """
    if seed is not None:
        turn = np.stack([_wander(seed, f"attitude/{k}", time) for k in range(3)], axis=1)
        turn *= np.radians(platform.attitude_noise_deg)
        push = np.stack([_wander(seed, f"velocity/{k}", time) for k in range(3)], axis=1)
        motion = replace(
            motion,
            attitude=rotations.multiply(motion.attitude, rotations.from_rotation_vector(turn)),
            velocity=motion.velocity + platform.velocity_noise * push,
        )
    return reported_motion(platform, motion)


def _wander(seed: int, purpose: str, time: FloatArray) -> FloatArray:
    """A Gaussian course of unit variance that changes over `WANDER_SECONDS`."""
    knot = np.floor(time / WANDER_SECONDS)
    into = 0.5 * np.pi * (time / WANDER_SECONDS - knot)
    index = knot.astype(np.int64)
    here = random_numbers.normal(seed, f"platform/{purpose}", index)
    following = random_numbers.normal(seed, f"platform/{purpose}", index + 1)
    course: FloatArray = np.cos(into) * here + np.sin(into) * following
    return course
