"""Attitude and motion of the carrier from Odometry, or from Imu with TwistStamped."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.motion import velocity_at
from wind_sensors.recordings.bag import BagContent, TopicData
from wind_sensors.recordings.fields import columns, stamps
from wind_sensors.recordings.plausible import stray_note, strays
from wind_sensors.station.inputs import FieldPath, absolute, resolved, tells_orientation
from wind_sensors.station.model import Input, Station
from wind_sensors.station.signals import FloatArray, PlatformStates, TimeArray, Velocities

Mask = npt.NDArray[np.bool_]

_XYZ = ("x", "y", "z")
_XYZW = ("x", "y", "z", "w")


def platform_states(
    station: Station, content: BagContent, notes: list[str]
) -> tuple[PlatformStates | None, Velocities | None]:
    """States of the station's platform, and its velocities where they come apart.

    Args:
        station: A station with a platform.
        content: The bag.
        notes: Gets what was wrong.

    Returns:
        States in the order of the bag; None where the bag has no such topics. With Imu and
        TwistStamped the states stand at the stamps of the Imu, and their velocity is what
        `velocity_at` makes of the twist; the position is then unknown and zero.
    """
    platform = station.platform
    if platform is None:
        return None, None
    if platform.odometry is not None:
        return _from_odometry(resolved(platform.odometry, "odometry"), content, notes), None
    if platform.imu is None:
        return None, None
    moved = None
    if platform.twist is not None:
        moved = _from_twist(resolved(platform.twist, "twist"), content, notes)
    return _from_imu(resolved(platform.imu, "imu"), moved, content, notes), moved


def _from_odometry(
    source: Input, content: BagContent, notes: list[str]
) -> PlatformStates | None:
    data = _topic(source, content, notes)
    if data is None:
        return None
    attitude = _fields(data, content, ("pose", "pose", "orientation"), _XYZW)
    velocity = _fields(data, content, ("twist", "twist", "linear"), _XYZ)
    rate = _fields(data, content, ("twist", "twist", "angular"), _XYZ)
    position = _fields(data, content, ("pose", "pose", "position"), _XYZ)
    time = _times(data, content)
    good = _usable(source.topic, time, attitude, (velocity, rate, position), notes)
    return PlatformStates(
        time[good], _unit(attitude[good]), velocity[good], rate[good], position[good]
    )


def _from_imu(
    source: Input, moved: Velocities | None, content: BagContent, notes: list[str]
) -> PlatformStates | None:
    data = _topic(source, content, notes)
    if data is None:
        return None
    time = _times(data, content)
    attitude = _fields(data, content, ("orientation",), _XYZW)
    rate = _fields(data, content, ("angular_velocity",), _XYZ)
    (variance,) = columns(
        data.raw, content.types, data.message_type, [("orientation_covariance", 0)]
    )
    told = tells_orientation(variance)
    if not told.all():
        lacking = int(np.count_nonzero(~told))
        notes.append(
            f"{source.topic}: {lacking} of {len(time)} messages say that they have no orientation "
            "(orientation_covariance[0] is -1) and were left out; name the topic of a driver or "
            "filter that has one"
        )
    time, attitude, rate = time[told], attitude[told], rate[told]
    good = _usable(source.topic, time, attitude, (rate,), notes)
    time, attitude, rate = time[good], attitude[good], rate[good]
    still = np.zeros_like(rate)
    velocity = still if moved is None else _velocity(moved, time)
    return PlatformStates(time, _unit(attitude), velocity, rate, still)


def _velocity(moved: Velocities, time: TimeArray) -> FloatArray:
    known, first = np.unique(moved.time, return_index=True)
    return velocity_at(Velocities(known, moved.velocity[first]), time)


def _from_twist(source: Input, content: BagContent, notes: list[str]) -> Velocities:
    data = _topic(source, content, notes)
    if data is None:
        return Velocities(np.empty(0, dtype=np.int64), np.empty((0, 3)))
    time = _times(data, content)
    velocity = _fields(data, content, ("twist", "linear"), _XYZ)
    good = _usable(source.topic, time, None, (velocity,), notes)
    return Velocities(time[good], velocity[good])


def _topic(source: Input, content: BagContent, notes: list[str]) -> TopicData | None:
    data = content.topics.get(absolute(source.topic))
    if data is None or not data.raw:
        notes.append(f"{source.topic}: no messages (the platform)")
        return None
    if data.message_type != source.type:
        raise UserError(
            f"{source.topic} carries {data.message_type}, but the platform needs {source.type}.",
            remedy="Name the right topic under `platform` in the station file.",
        )
    return data


def _times(data: TopicData, content: BagContent) -> TimeArray:
    stamped = stamps(data.raw, content.types, data.message_type, ("header", "stamp"))
    return np.where(stamped == 0, np.asarray(data.log_time, dtype=np.int64), stamped)


def _fields(
    data: TopicData, content: BagContent, base: FieldPath, names: tuple[str, ...]
) -> FloatArray:
    paths = [(*base, name) for name in names]
    return np.stack(columns(data.raw, content.types, data.message_type, paths), axis=-1)


def _usable(
    topic: str,
    time: TimeArray,
    attitude: FloatArray | None,
    vectors: tuple[FloatArray, ...],
    notes: list[str],
) -> Mask:
    """Without what is not a number, attitudes that are not rotations and stray stamps."""
    good = np.ones(len(time), dtype=np.bool_)
    if attitude is not None:
        good &= np.linalg.norm(attitude, axis=-1) > 0.5
    for vector in vectors:
        good &= np.isfinite(vector).all(axis=-1)
    bad = int(np.count_nonzero(~good))
    if bad:
        notes.append(f"{topic}: {bad} of {len(time)} states are not usable and were left out")
    stray = strays(time)
    if stray.any():
        notes.append(stray_note(topic, time, stray))
    return good & ~stray


def _unit(attitude: FloatArray) -> FloatArray:
    unit: FloatArray = attitude / np.linalg.norm(attitude, axis=-1)[:, None]
    return unit
