"""The sensor's pose on its platform, asked of tf2 where that is installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rclpy.time import Time

from wind_sensors.motion import rotations

if TYPE_CHECKING:
    from rclpy.node import Node

_CLOSE = 1e-6
"""Poses that differ by less [m, deg] are the same."""


class SensorPose(NamedTuple):
    """Position [m] and roll, pitch, yaw [deg] of the sensor in the platform's frame."""

    position: tuple[float, float, float]
    rotation_deg: tuple[float, float, float]

    def is_close(self, other: SensorPose) -> bool:
        """Whether both are the same but for rounding."""
        apart = np.abs(np.subtract((*self.position, *self.rotation_deg),
                                   (*other.position, *other.rotation_deg)))
        return bool(apart.max() < _CLOSE)


def pose_of(transform: Any) -> SensorPose:
    """A geometry_msgs/Transform from the sensor's frame to the platform's."""
    t, q = transform.translation, transform.rotation
    angles = np.degrees(rotations.to_roll_pitch_yaw((q.x, q.y, q.z, q.w)))
    return SensorPose(
        (float(t.x), float(t.y), float(t.z)),
        (float(angles[0]), float(angles[1]), float(angles[2])),
    )


def tf2_is_installed() -> bool:
    """Whether `tf2_ros` can be imported."""
    return find_spec("tf2_ros") is not None


class MountingFromTf:
    """Waits for tf2 to know the sensor's pose, then stops listening: a mount does not move.

    Args:
        node: Whose subscriptions are used.

    Raises:
        ImportError: tf2 is not installed.
    """

    def __init__(self, node: Node) -> None:
        tf2_ros = import_module("tf2_ros")
        self._unknown: type[Exception] = tf2_ros.TransformException
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, node, spin_thread=False)
        self.pose: SensorPose | None = None

    def ask(self, platform_frame: str, sensor_frame: str) -> SensorPose | None:
        """The pose, the first time it is known; None before and after."""
        if self.pose is not None:
            return None
        try:
            found = self._buffer.lookup_transform(platform_frame, sensor_frame, Time())
        except self._unknown:
            return None
        self.pose = pose_of(found.transform)
        self._listener.unregister()
        return self.pose
