"""Attitude and motion of the carrier from live messages, as `recordings.platform` reads bags."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wind_sensors.station.signals import FloatArray

_SMALLEST_NORM = 0.5
"""A quaternion shorter than this is not an attitude."""


class PlatformState(NamedTuple):
    """Arguments of `StreamingEstimator.add_platform`."""

    time: int
    attitude: FloatArray
    velocity: FloatArray
    angular_rate: FloatArray
    position: FloatArray


def odometry_state(message: Any, time: int) -> PlatformState | None:
    """State from a nav_msgs/Odometry; None where a number is missing or the attitude is none."""
    pose, twist = message.pose.pose, message.twist.twist
    return _state(
        time,
        _xyzw(pose.orientation),
        _xyz(twist.linear),
        _xyz(twist.angular),
        _xyz(pose.position),
    )


def imu_state(message: Any, time: int) -> PlatformState | None:
    """Attitude and rate from a sensor_msgs/Imu; None where a number or the attitude is missing.

    Velocity and position are unknown and zero.
    """
    nothing = np.zeros(3)
    return _state(
        time, _xyzw(message.orientation), nothing, _xyz(message.angular_velocity), nothing
    )


def twist_velocity(message: Any) -> FloatArray | None:
    """Velocity from a geometry_msgs/TwistStamped [m/s]; None where a number is missing."""
    velocity = _xyz(message.twist.linear)
    return velocity if np.isfinite(velocity).all() else None


def _state(
    time: int,
    attitude: FloatArray,
    velocity: FloatArray,
    angular_rate: FloatArray,
    position: FloatArray,
) -> PlatformState | None:
    norm = np.linalg.norm(attitude[None, :], axis=-1)
    numbers = np.concatenate((attitude, velocity, angular_rate, position))
    if not np.isfinite(numbers).all() or norm[0] <= _SMALLEST_NORM:
        return None
    return PlatformState(time, attitude / norm, velocity, angular_rate, position)


def _xyz(vector: Any) -> FloatArray:
    return np.array([vector.x, vector.y, vector.z])


def _xyzw(quaternion: Any) -> FloatArray:
    return np.array([quaternion.x, quaternion.y, quaternion.z, quaternion.w])
