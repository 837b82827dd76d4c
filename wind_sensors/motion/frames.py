"""Earth frames, headings and the two senses of a wind direction.

Inside the project a wind is a velocity: where the air goes, east, north, up (ENU). The
meteorological direction (where it comes from, clockwise from north, degrees) and compass headings
appear only at the edges; the conversions are here and nowhere else.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.motion import rotations

FloatArray = npt.NDArray[np.float64]

_NED_TO_ENU = rotations.normalise((1.0, 1.0, 0.0, 0.0))
_FRD_TO_FLU: FloatArray = np.array([1.0, 0.0, 0.0, 0.0])


def swap_enu_ned(vector: npt.ArrayLike) -> FloatArray:
    """East, north, up from north, east, down, and the other way round; shape (..., 3)."""
    v = np.asarray(vector, dtype=np.float64)
    return np.stack((v[..., 1], v[..., 0], -v[..., 2]), axis=-1)


def swap_flu_frd(vector: npt.ArrayLike) -> FloatArray:
    """Forward, left, up from forward, right, down, and the other way round; shape (..., 3)."""
    swapped: FloatArray = np.asarray(vector, dtype=np.float64) * (1.0, -1.0, -1.0)
    return swapped


def attitude_enu_from_ned(attitude: npt.ArrayLike) -> FloatArray:
    """Attitude of FLU axes in ENU from that of FRD axes in NED; (x, y, z, w), shape (..., 4)."""
    return rotations.multiply(_NED_TO_ENU, rotations.multiply(attitude, _FRD_TO_FLU))


def attitude_ned_from_enu(attitude: npt.ArrayLike) -> FloatArray:
    """Attitude of FRD axes in NED from that of FLU axes in ENU; (x, y, z, w), shape (..., 4)."""
    return rotations.multiply(
        rotations.conjugate(_NED_TO_ENU),
        rotations.multiply(attitude, rotations.conjugate(_FRD_TO_FLU)),
    )


def wrap(angle: npt.ArrayLike) -> FloatArray:
    """Angle in [-pi, pi) [rad]."""
    a = np.asarray(angle, dtype=np.float64)
    wrapped = a - 2.0 * np.pi * np.floor((a + np.pi) / (2.0 * np.pi))
    # Rounding may leave an angle at the seam on its far side.
    within: FloatArray = np.where((wrapped < -np.pi) | (wrapped >= np.pi), -np.pi, wrapped)[()]
    return within


def within_turn(degrees: npt.ArrayLike) -> FloatArray:
    """Angle in [0, 360) [deg]: of a tiny negative one the first remainder rounds to 360."""
    turned: FloatArray = np.mod(np.mod(np.asarray(degrees, dtype=np.float64), 360.0), 360.0)
    return turned


def direction_from_deg(velocity: npt.ArrayLike) -> FloatArray:
    """Direction the wind comes from, clockwise from north [deg, 0 to 360).

    Args:
        velocity: Wind east, north (and up, ignored) [m/s], shape (..., 2) or (..., 3).

    Source: Kristensen (1994), (34), modulo 360.
    """
    v = np.asarray(velocity, dtype=np.float64)
    return within_turn(np.degrees(np.arctan2(-v[..., 0], -v[..., 1])))


def velocity_from_direction(speed: npt.ArrayLike, direction_from_deg: npt.ArrayLike) -> FloatArray:
    """Horizontal wind velocity east, north, up (zero) [m/s] from speed and direction [deg]."""
    d = np.radians(np.asarray(direction_from_deg, dtype=np.float64))
    s = np.asarray(speed, dtype=np.float64)
    d, s = np.broadcast_arrays(d, s)
    return np.stack((-s * np.sin(d), -s * np.cos(d), np.zeros_like(s)), axis=-1)


def yaw_from_compass(heading_deg: npt.ArrayLike, declination_deg: float = 0.0) -> FloatArray:
    """Yaw, counter-clockwise from east [rad], from a compass heading clockwise from north [deg].

    Args:
        heading_deg: Heading against true north, or against magnetic north with a declination.
        declination_deg: Magnetic north minus true north, positive to the east [deg].
    """
    true_heading = np.asarray(heading_deg, dtype=np.float64) + declination_deg
    return wrap(np.radians(90.0 - true_heading))


def compass_from_yaw(yaw: npt.ArrayLike, declination_deg: float = 0.0) -> FloatArray:
    """Compass heading clockwise from north [deg, 0 to 360) from a yaw [rad]; see above."""
    yaw_deg = np.degrees(np.asarray(yaw, dtype=np.float64))
    return within_turn(90.0 - yaw_deg - declination_deg)


def heading_of(attitude: npt.ArrayLike) -> FloatArray:
    """Yaw of the forward axis in the horizontal plane, counter-clockwise from east [rad]."""
    q = np.asarray(attitude, dtype=np.float64)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    yaw: FloatArray = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    return yaw
