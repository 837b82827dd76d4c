"""Earth wind to the wind a moving sensor feels, and back with its uncertainty.

A sensor at r in platform axes (x forward, y left, z up) moves with v + omega x r. With R the
platform's attitude and S the rotation of the sensor frame in the platform's::

    apparent = S^T [ R^T wind - (v + omega x r) ]
    wind     = R [ S apparent + v + omega x r ]
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.motion import rotations
from wind_sensors.motion.platform_track import Motion
from wind_sensors.station.model import Platform

FloatArray = npt.NDArray[np.float64]

STANDARD_GRAVITY = 9.80665
"""[m/s^2]"""


def sensor_rotation(platform: Platform) -> FloatArray:
    """S, the matrix that turns sensor axes into platform axes, shape (3, 3)."""
    roll, pitch, yaw = np.radians(platform.sensor_rotation_deg)
    return rotations.matrix(rotations.from_roll_pitch_yaw(roll, pitch, yaw))


def axis_rotation(tilt_deg: tuple[float, float]) -> FloatArray:
    """Matrix that turns instrument axes into sensor axes when the axis leans; shape (3, 3).

    Args:
        tilt_deg: Lean of the axis towards the sensor's x and y [deg]; one rotation about the
            horizontal axis across the lean.
    """
    towards_x, towards_y = np.radians(tilt_deg)
    return rotations.matrix(rotations.from_rotation_vector((-towards_y, towards_x, 0.0)))


def sensor_velocity(motion: Motion, lever_arm: npt.ArrayLike) -> FloatArray:
    """v + omega x r of a point of the platform, in platform axes [m/s], shape (n, 3)."""
    r = np.asarray(lever_arm, dtype=np.float64)
    velocity: FloatArray = motion.velocity + np.cross(motion.angular_rate, r)
    return velocity


def apparent_wind(
    wind: npt.ArrayLike, motion: Motion, lever_arm: npt.ArrayLike, rotation: FloatArray
) -> FloatArray:
    """Wind that a sensor on the platform feels, in sensor axes.

    Args:
        wind: Earth wind at the sensor, ENU [m/s], shape (n, 3).
        motion: The platform's motion at those instants.
        lever_arm: The sensor in platform axes [m], shape (3,).
        rotation: S, from `sensor_rotation`.

    Returns:
        [m/s], shape (n, 3).
    """
    in_platform = np.einsum("nji,nj->ni", motion.to_earth, np.asarray(wind, dtype=np.float64))
    felt: FloatArray = (in_platform - sensor_velocity(motion, lever_arm)) @ rotation
    return felt


def earth_wind(
    apparent: npt.ArrayLike, motion: Motion, lever_arm: npt.ArrayLike, rotation: FloatArray
) -> FloatArray:
    """Earth wind, ENU [m/s], from the apparent wind in sensor axes; inverse of `apparent_wind`."""
    in_platform = np.asarray(apparent, dtype=np.float64) @ rotation.T
    in_platform = in_platform + sensor_velocity(motion, lever_arm)
    wind: FloatArray = np.einsum("nij,nj->ni", motion.to_earth, in_platform)
    return wind


def wind_in_platform(
    wind: npt.ArrayLike, covariance: npt.ArrayLike, to_earth: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The earth wind seen along the platform's axes: x forward, y left, z up.

    Args:
        wind: ENU [m/s], shape (..., 3).
        covariance: Its covariance [m^2/s^2], shape (..., 3, 3).
        to_earth: Matrices that turn sensor axes into ENU, shape (..., 3, 3).
        rotation: S, from `sensor_rotation`.

    Returns:
        Wind [m/s], shape (..., 3), and covariance [m^2/s^2], shape (..., 3, 3). Errors of the
        attitude stay in the covariance, although some of them cancel in these axes.
    """
    platform_to_earth = to_earth @ rotation.T
    turned = np.einsum("...ji,...j->...i", platform_to_earth, np.asarray(wind, dtype=np.float64))
    spread = np.einsum(
        "...ji,...jk,...kl->...il",
        platform_to_earth,
        np.asarray(covariance, dtype=np.float64),
        platform_to_earth,
    )
    return turned, spread


def _cross_matrix(vector: FloatArray) -> FloatArray:
    """Matrices [v] with [v] a = v x a; shape (n, 3) to (n, 3, 3)."""
    out = np.zeros((*vector.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2] = -vector[..., 2], vector[..., 1]
    out[..., 1, 0], out[..., 1, 2] = vector[..., 2], -vector[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -vector[..., 1], vector[..., 0]
    return out


def earth_wind_covariance(
    apparent: npt.ArrayLike,
    apparent_covariance: npt.ArrayLike,
    motion: Motion,
    lever_arm: npt.ArrayLike,
    rotation: FloatArray,
    attitude_variance: npt.ArrayLike,
    velocity_variance: npt.ArrayLike,
    mounting_variance: npt.ArrayLike = 0.0,
    rate_variance: npt.ArrayLike = 0.0,
    velocity_in_earth: bool = False,
) -> FloatArray:
    """Covariance of the earth wind from those of everything it is made of, to first order.

    Args:
        apparent: Apparent wind in sensor axes [m/s], shape (n, 3).
        apparent_covariance: Its covariance [m^2/s^2], shape (n, 3, 3) or (3, 3).
        motion, lever_arm, rotation: As in `earth_wind`.
        attitude_variance: Variances of small rotations about the platform's axes [rad^2], scalar,
            (n,) or (n, 3).
        velocity_variance: Of each component of the platform's velocity [m^2/s^2], same shapes.
        mounting_variance: Of small rotations of the sensor frame about its axes [rad^2].
        rate_variance: Of each angular rate [rad^2/s^2].
        velocity_in_earth: The velocity was measured in the earth frame (GNSS), so that an error
            of the attitude does not turn it.

    Returns:
        ENU [m^2/s^2], shape (n, 3, 3).
    """
    a = np.asarray(apparent, dtype=np.float64)
    count = a.shape[0]

    def diagonal(variance: npt.ArrayLike) -> FloatArray:
        v = np.asarray(variance, dtype=np.float64)
        return np.broadcast_to(v[:, np.newaxis] if v.ndim == 1 else v, (count, 3))

    def spread(jacobian: FloatArray, variance: npt.ArrayLike) -> FloatArray:
        every = np.broadcast_to(jacobian, (count, 3, 3))
        part: FloatArray = np.einsum("nij,nj,nkj->nik", every, diagonal(variance), every)
        return part

    flow = a @ rotation.T
    turned_with_attitude = flow + np.cross(motion.angular_rate, np.asarray(lever_arm))
    if not velocity_in_earth:
        turned_with_attitude = turned_with_attitude + motion.velocity
    total = np.einsum(
        "ij,njk,lk->nil",
        rotation,
        np.broadcast_to(np.asarray(apparent_covariance, dtype=np.float64), (count, 3, 3)),
        rotation,
    )
    total = total + spread(_cross_matrix(turned_with_attitude), attitude_variance)
    total = total + spread(np.eye(3), velocity_variance)
    total = total + spread(rotation @ _cross_matrix(a), mounting_variance)
    arm = _cross_matrix(np.asarray(lever_arm, dtype=np.float64)[np.newaxis, :])[0]
    total = total + spread(arm, rate_variance)
    in_earth: FloatArray = np.einsum("nij,njk,nlk->nil", motion.to_earth, total, motion.to_earth)
    return in_earth


def felt_gravity(motion: Motion, lever_arm: npt.ArrayLike, dt: float) -> FloatArray:
    """Gravity minus the acceleration of a point of the platform, in platform axes [m/s^2].

    Args:
        motion: At regular instants.
        lever_arm: The point in platform axes [m].
        dt: Interval [s].

    Returns:
        Shape (n, 3); central differences of the velocity, one-sided at the ends.
    """
    in_earth = np.einsum("nij,nj->ni", motion.to_earth, sensor_velocity(motion, lever_arm))
    force = np.zeros_like(in_earth)
    if len(motion) > 1:
        force -= np.gradient(in_earth, dt, axis=0)
    force[:, 2] -= STANDARD_GRAVITY
    felt: FloatArray = np.einsum("nji,nj->ni", motion.to_earth, force)
    return felt
