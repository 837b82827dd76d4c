"""Rotors and vanes on a tilted or moving axis: what they see of a three-dimensional wind.

Vectors are in the frame of the mount unless said otherwise; a rotation matrix R maps vectors of
the mount to the earth, v_earth = R v_mount.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments import propeller
from wind_sensors.instruments.cup import CupConstants, steady_response

FloatArray = npt.NDArray[np.float64]


class RotorWind(NamedTuple):
    """Wind in the axes of a rotor [m/s].

    axial: along the axis; transverse: speed in the plane of rotation.
    """

    axial: FloatArray
    transverse: FloatArray


def relative_wind(
    wind: npt.ArrayLike,
    velocity: npt.ArrayLike,
    angular_velocity: npt.ArrayLike,
    lever_arm: npt.ArrayLike,
    rotation: npt.ArrayLike,
) -> FloatArray:
    """Wind relative to a moving sensor, in the frame of its mount [m/s], shape (..., 3).

    Args:
        wind: Wind velocity over the earth [m/s], earth frame.
        velocity: Velocity of the platform's reference point [m/s], earth frame.
        angular_velocity: Of the platform [rad/s], earth frame.
        lever_arm: From the reference point to the sensor [m], earth frame.
        rotation: Mount to earth, shape (..., 3, 3).
    """
    turn = np.cross(
        np.asarray(angular_velocity, dtype=np.float64), np.asarray(lever_arm, dtype=np.float64)
    )
    apparent = np.asarray(wind, dtype=np.float64) - np.asarray(velocity) - turn
    matrix = np.asarray(rotation, dtype=np.float64)
    return np.asarray(np.einsum("...ji,...j->...i", matrix, apparent))


def rotor_wind(wind: npt.ArrayLike, axis: npt.ArrayLike) -> RotorWind:
    """Axial and transverse wind of a rotor whose axis points along `axis` (any length).

    Args:
        wind: Wind velocity [m/s], shape (..., 3).
        axis: Direction of the axis, shape (3,).
    """
    u = np.asarray(wind, dtype=np.float64)
    unit = np.asarray(axis, dtype=np.float64)
    unit = unit / np.linalg.norm(unit)
    return RotorWind(u @ unit, np.linalg.norm(np.cross(u, unit), axis=-1))


def cup_steady_speed(
    wind: npt.ArrayLike, cup: CupConstants, axis: npt.ArrayLike = (0.0, 0.0, 1.0)
) -> FloatArray:
    """l S [m/s] of a cup on a tilted axis in a steady wind; K94 (2).

    Args:
        wind: Wind velocity [m/s], shape (..., 3).
        cup: Constants; the starting speed is not subtracted.
        axis: Upward direction of the cup's axis.
    """
    seen = rotor_wind(wind, axis)
    elevation = np.arctan2(seen.axial, seen.transverse)
    return np.hypot(seen.axial, seen.transverse) * steady_response(elevation, cup)


def propeller_steady_speed(wind: npt.ArrayLike, axis: npt.ArrayLike, mu2: float) -> FloatArray:
    """l S [m/s] of a K94 propeller on any axis in a steady wind; K94 (30), (31).

    Args:
        wind: Wind velocity [m/s], shape (..., 3).
        axis: Where the wind goes that meets the propeller head-on.
        mu2: Curvature of the angular response.
    """
    seen = rotor_wind(wind, axis)
    angle = np.arctan2(seen.transverse, seen.axial)
    return np.hypot(seen.axial, seen.transverse) * propeller.steady_response(angle, mu2)


def tilt_matrix(tilt: float, azimuth: float) -> FloatArray:
    """Rotation of a mount whose axis leans by `tilt` towards `azimuth` [rad], shape (3, 3).

    The mount does not turn about its own axis: it is tipped about the horizontal line across the
    azimuth, counter-clockwise from x.
    """
    c, s = math.cos(azimuth), math.sin(azimuth)
    line = np.array([-s, c, 0.0])
    cross = np.array([[0.0, -line[2], line[1]], [line[2], 0.0, -line[0]], [-line[1], line[0], 0.0]])
    return np.asarray(
        np.eye(3) + math.sin(tilt) * cross + 2.0 * math.sin(0.5 * tilt) ** 2 * (cross @ cross),
        dtype=np.float64,
    )


def tilted_vane_heading(wind: npt.ArrayLike, rotation: npt.ArrayLike) -> FloatArray:
    """Heading of a vane's nose in the frame of its mount [rad], in a steady wind.

    The vane turns about the mount's z axis and points against the wind's part across that axis.

    Args:
        wind: Wind velocity over the mount [m/s], earth frame, shape (..., 3).
        rotation: Mount to earth, shape (3, 3).
    """
    matrix = np.asarray(rotation, dtype=np.float64)
    seen = np.asarray(wind, dtype=np.float64) @ matrix
    return np.asarray(np.arctan2(-seen[..., 1], -seen[..., 0]))


def tilted_vane_error(tilt: float, relative_azimuth: float, elevation: float) -> float:
    """Error of a vane's heading by tilt [rad], exact.

    Args:
        tilt: Lean of the axis [rad].
        relative_azimuth: Azimuth of the lean minus heading of the wind [rad].
        elevation: Angle of the wind above the horizontal [rad]. To first order the error is
            -elevation * tilt * sin(relative_azimuth); in level wind it is of second order.
    """
    wind = np.array([math.cos(elevation), 0.0, math.sin(elevation)])
    heading = tilted_vane_heading(wind, tilt_matrix(tilt, relative_azimuth))
    return math.remainder(float(heading) - math.pi, 2.0 * math.pi)


def vane_stiffness_ratio(wind: npt.ArrayLike, axis: npt.ArrayLike) -> FloatArray:
    """Natural frequency of a vane on a tilted axis relative to U/l_v [1]: its transverse share.

    Args:
        wind: Wind velocity [m/s], shape (..., 3).
        axis: Direction of the vane's axis.
    """
    seen = rotor_wind(wind, axis)
    return seen.transverse / np.hypot(seen.axial, seen.transverse)


def tilt_bias(tilt: float, relative_azimuth: float, mu1: float, mu2: float) -> float:
    """Relative error of a cup's mean speed by tilt in a level wind [1], to second order.

    Args:
        tilt: Lean of the axis [rad].
        relative_azimuth: Azimuth of the lean minus heading of the wind [rad].
        mu1, mu2: Angular response, K14 (84).
    """
    # Leaning with the wind lets it meet the rotor plane from above the axis: a positive axial part.
    theta = tilt * math.cos(relative_azimuth)
    return mu1 * theta - 0.5 * (1.0 - mu2) * theta * theta
