"""Quaternions and rotations, vectorised.

A quaternion (x, y, z, w) with unit norm turns vectors of a body into vectors of the frame the body
is in: `rotate(attitude, v_body) = v_earth`. Every function takes leading dimensions of any shape.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def normalise(quaternion: npt.ArrayLike) -> FloatArray:
    """Unit quaternions of the same direction; shape (..., 4)."""
    q = np.asarray(quaternion, dtype=np.float64)
    unit: FloatArray = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


def conjugate(quaternion: npt.ArrayLike) -> FloatArray:
    """The opposite rotation; shape (..., 4)."""
    opposite: FloatArray = np.asarray(quaternion, dtype=np.float64) * (-1.0, -1.0, -1.0, 1.0)
    return opposite


def multiply(first: npt.ArrayLike, second: npt.ArrayLike) -> FloatArray:
    """The rotation that does `second`, then `first`; shapes (..., 4) broadcast."""
    a = np.asarray(first, dtype=np.float64)
    b = np.asarray(second, dtype=np.float64)
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    return np.stack(
        (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ),
        axis=-1,
    )


def rotate(quaternion: npt.ArrayLike, vector: npt.ArrayLike) -> FloatArray:
    """Vectors turned by unit quaternions; shapes (..., 4) and (..., 3) broadcast."""
    q = np.asarray(quaternion, dtype=np.float64)
    v = np.asarray(vector, dtype=np.float64)
    axis, w = q[..., :3], q[..., 3:]
    twice = 2.0 * np.cross(axis, v)
    turned: FloatArray = v + w * twice + np.cross(axis, twice)
    return turned


def rotate_back(quaternion: npt.ArrayLike, vector: npt.ArrayLike) -> FloatArray:
    """Vectors turned by the opposite of unit quaternions, e.g. from earth to body axes."""
    return rotate(conjugate(quaternion), vector)


def matrix(quaternion: npt.ArrayLike) -> FloatArray:
    """Rotation matrices R with R v = rotate(q, v); shape (..., 3, 3)."""
    q = np.asarray(quaternion, dtype=np.float64)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    out = np.empty((*q.shape[:-1], 3, 3))
    out[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[..., 0, 1] = 2.0 * (x * y - w * z)
    out[..., 0, 2] = 2.0 * (x * z + w * y)
    out[..., 1, 0] = 2.0 * (x * y + w * z)
    out[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[..., 1, 2] = 2.0 * (y * z - w * x)
    out[..., 2, 0] = 2.0 * (x * z - w * y)
    out[..., 2, 1] = 2.0 * (y * z + w * x)
    out[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return out


def from_rotation_vector(vector: npt.ArrayLike) -> FloatArray:
    """Quaternions of rotations given as axis times angle [rad]; shape (..., 3) to (..., 4)."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    # sin(angle/2)/angle through sinc, which is exact at zero.
    scale = 0.5 * np.sinc(angle / (2.0 * np.pi))
    return np.concatenate((v * scale, np.cos(0.5 * angle)), axis=-1)


def to_rotation_vector(quaternion: npt.ArrayLike) -> FloatArray:
    """Axis times angle [rad] of the shorter way round; shape (..., 4) to (..., 3)."""
    q = np.asarray(quaternion, dtype=np.float64)
    q = np.where(q[..., 3:] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    safe = np.where(sine > 0.0, sine, 1.0)
    vector: FloatArray = q[..., :3] * np.where(sine > 1e-12, angle / safe, 2.0)
    return vector


def from_roll_pitch_yaw(
    roll: npt.ArrayLike, pitch: npt.ArrayLike, yaw: npt.ArrayLike
) -> FloatArray:
    """Quaternions of yaw about z, then pitch about the new y, then roll about the new x [rad]."""
    r, p, y = np.broadcast_arrays(
        0.5 * np.asarray(roll, dtype=np.float64),
        0.5 * np.asarray(pitch, dtype=np.float64),
        0.5 * np.asarray(yaw, dtype=np.float64),
    )
    cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
    return np.stack(
        (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ),
        axis=-1,
    )


def to_roll_pitch_yaw(quaternion: npt.ArrayLike) -> FloatArray:
    """Roll, pitch, yaw [rad] of quaternions; shape (..., 4) to (..., 3)."""
    q = np.asarray(quaternion, dtype=np.float64)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack((roll, pitch, yaw), axis=-1)


def turned_about_up(quaternion: npt.ArrayLike, angle: npt.ArrayLike) -> FloatArray:
    """Attitudes turned about the earth's vertical by an angle [rad], counter-clockwise."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    zero = np.zeros_like(half)
    return multiply(np.stack((zero, zero, np.sin(half), np.cos(half)), axis=-1), quaternion)


def slerp(start: npt.ArrayLike, stop: npt.ArrayLike, fraction: npt.ArrayLike) -> FloatArray:
    """Attitude between two attitudes along the shorter great circle, at constant rate.

    Args:
        start, stop: Unit quaternions, shape (..., 4).
        fraction: 0 at `start`, 1 at `stop`, beyond for extrapolation; shape (...).

    Returns:
        Unit quaternions, shape (..., 4).
    """
    a = np.asarray(start, dtype=np.float64)
    turn = to_rotation_vector(multiply(conjugate(a), stop))
    part = from_rotation_vector(turn * np.asarray(fraction, dtype=np.float64)[..., np.newaxis])
    return normalise(multiply(a, part))
