"""Attitude and motion of the carrier from live messages, as `recordings.platform` reads bags."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from wind_sensors.station.signals import FloatArray

_SMALLEST_NORM = 0.5
"""A quaternion shorter than this is not an attitude."""

_LONGEST_WAIT = 500_000_000
"""How long an attitude waits for the velocity that brackets it [ns]."""

_TWISTS_KEPT = 1000


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


class ImuWithTwist:
    """Joins attitudes and rates (sensor_msgs/Imu) with velocities (geometry_msgs/TwistStamped).

    An attitude is delivered once a velocity at or after its stamp has come, with the velocity
    interpolated between its neighbours; or, when that takes too long, with the last velocity.

    Args:
        waits: False where the station has no velocity; it is zero then.
    """

    def __init__(self, *, waits: bool) -> None:
        self._waits = waits
        self._attitudes: deque[PlatformState] = deque()
        self._twist_time: deque[int] = deque(maxlen=_TWISTS_KEPT)
        self._twist_velocity: deque[FloatArray] = deque(maxlen=_TWISTS_KEPT)

    def add_imu(self, message: Any, time: int) -> bool:
        """One Imu; False where it is not usable."""
        state = _state(
            time,
            _xyzw(message.orientation),
            np.zeros(3),
            _xyz(message.angular_velocity),
            np.zeros(3),
        )
        if state is None:
            return False
        self._attitudes.append(state)
        return True

    def add_twist(self, message: Any, time: int) -> None:
        """One TwistStamped, in the platform's axes."""
        velocity = _xyz(message.twist.linear)
        if not np.isfinite(velocity).all():
            return
        if self._twist_time and time < self._twist_time[-1]:
            self._twist_time.clear()
            self._twist_velocity.clear()
        self._twist_time.append(time)
        self._twist_velocity.append(velocity)

    def ready(self) -> Iterator[PlatformState]:
        """States that need wait no longer, in order of arrival."""
        while self._attitudes:
            state = self._attitudes[0]
            newest = max(self._attitudes[-1].time, state.time)
            bracketed = bool(self._twist_time) and self._twist_time[-1] >= state.time
            patient = newest - state.time < _LONGEST_WAIT
            if self._waits and not bracketed and patient:
                return
            self._attitudes.popleft()
            yield state._replace(velocity=self._velocity(state.time))

    def _velocity(self, time: int) -> FloatArray:
        if not self._twist_time:
            return np.zeros(3)
        seconds = (np.array(self._twist_time, dtype=np.int64) - time) * 1e-9
        known = np.array(self._twist_velocity)
        return np.array([np.interp(0.0, seconds, known[:, axis]) for axis in range(3)])


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
