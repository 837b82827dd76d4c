"""Attitude and motion of the carrier from Odometry, or from Imu with TwistStamped."""

from __future__ import annotations

import numpy as np

from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import BagContent, TopicData
from wind_sensors.recordings.fields import columns, stamps
from wind_sensors.recordings.plausible import stray_note, strays
from wind_sensors.station.inputs import FieldPath, absolute, resolved
from wind_sensors.station.model import Input, Station
from wind_sensors.station.signals import FloatArray, PlatformStates, TimeArray

_XYZ = ("x", "y", "z")
_XYZW = ("x", "y", "z", "w")


def platform_states(
    station: Station, content: BagContent, notes: list[str]
) -> PlatformStates | None:
    """States of the station's platform.

    Args:
        station: A station with a platform.
        content: The bag.
        notes: Gets what was wrong.

    Returns:
        States in the order of the bag; None where the bag has no such topics. With Imu and
        TwistStamped the states stand at the stamps of the Imu and the twist (in the platform's
        axes) is interpolated to them; the position is then unknown and zero.
    """
    platform = station.platform
    if platform is None:
        return None
    if platform.odometry is not None:
        return _from_odometry(resolved(platform.odometry, "odometry"), content, notes)
    if platform.imu is not None:
        twist = resolved(platform.twist, "twist") if platform.twist else None
        return _from_imu(resolved(platform.imu, "imu"), twist, content, notes)
    return None


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
    return _complete(source.topic, _times(data, content), attitude, velocity, rate, position, notes)


def _from_imu(
    source: Input, twist: Input | None, content: BagContent, notes: list[str]
) -> PlatformStates | None:
    data = _topic(source, content, notes)
    if data is None:
        return None
    time = _times(data, content)
    attitude = _fields(data, content, ("orientation",), _XYZW)
    rate = _fields(data, content, ("angular_velocity",), _XYZ)
    velocity = np.zeros((len(time), 3))
    moved = _topic(twist, content, notes) if twist else None
    if moved is not None:
        at = _times(moved, content)
        measured = _fields(moved, content, ("twist", "linear"), _XYZ)
        good = np.isfinite(measured).all(axis=-1)
        order = np.argsort(at[good], kind="stable")
        origin = int(time[0])
        known = (at[good][order] - origin) * 1e-9
        for axis in range(3):
            velocity[:, axis] = np.interp(
                (time - origin) * 1e-9, known, measured[good][order, axis]
            )
    return _complete(source.topic, time, attitude, velocity, rate, np.zeros_like(velocity), notes)


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


def _complete(
    topic: str,
    time: TimeArray,
    attitude: FloatArray,
    velocity: FloatArray,
    rate: FloatArray,
    position: FloatArray,
    notes: list[str],
) -> PlatformStates:
    """Drop states that are not numbers, attitudes that are not rotations and stray stamps.

    What is left has unit quaternions.
    """
    norm = np.linalg.norm(attitude, axis=-1)
    good = np.isfinite(velocity).all(axis=-1) & np.isfinite(rate).all(axis=-1)
    good &= np.isfinite(position).all(axis=-1) & (norm > 0.5)
    bad = int(np.count_nonzero(~good))
    if bad:
        notes.append(f"{topic}: {bad} of {len(time)} states are not usable and were left out")
    stray = strays(time)
    if stray.any():
        notes.append(stray_note(topic, time, stray))
        good &= ~stray
    unit = attitude[good] / norm[good, None]
    return PlatformStates(time[good], unit, velocity[good], rate[good], position[good])
