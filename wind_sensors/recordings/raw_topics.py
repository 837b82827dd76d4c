"""The signals of a station as the messages that its inputs name."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.typesys.store import Typestore

from wind_sensors.errors import UserError
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.station.inputs import (
    FieldPath,
    absolute,
    angle_inputs,
    field_path,
    raw_from_angles,
    raw_from_turns,
    resolved,
)
from wind_sensors.station.model import Cup, Input, Propeller
from wind_sensors.station.signals import (
    FloatArray,
    PlatformStates,
    Pulses,
    Recording,
    TimeArray,
    Velocities,
    Winds,
)

TRUTH_TOPIC = "/truth/wind"
BODY_FRAME = "base_link"
_BATCH = 1_000_000_000
"""Edges of one second travel in one batch [ns]."""


@dataclass
class _Content:
    """What the messages of one topic hold."""

    message_type: str
    time: TimeArray
    columns: dict[FieldPath, npt.NDArray[Any]] = field(default_factory=dict)
    texts: dict[FieldPath, str] = field(default_factory=dict)


def raw_topics(recording: Recording, types: Typestore) -> list[TopicMessages]:
    """Messages of everything the station measured, and of the reference and the truth.

    Args:
        recording: Signals and the station that names their topics.
        types: Message definitions.

    Raises:
        UserError: A signal cannot be expressed by the type its input names.
    """
    contents: dict[str, _Content] = {}
    batches: list[TopicMessages] = []
    for instrument in recording.station.instruments:
        if isinstance(instrument, (Cup, Propeller)):
            source = resolved(instrument.pulses, "pulses")
            pulses = recording.pulses.get(instrument.name)
            if pulses is None:
                continue
            if source.meaning == "edges":
                batches.append(_edge_batches(source, pulses, types))
            else:
                _add_pulses(contents, types, source, instrument, pulses)
        else:
            for signal, source in angle_inputs(instrument).items():
                angles = recording.angles.get(signal)
                if angles is None:
                    continue
                raw = raw_from_angles(source, angles.angle)
                content = _content(contents, types, source, angles.time, instrument.name)
                path = field_path(source.field)
                content.columns[path] = raw
                if source.type == "sensor_msgs/msg/JointState":
                    joint: FieldPath = ("name", *path[1:])
                    content.texts[joint] = signal
    station = recording.station
    frame = station.recording.frame
    if station.reference is not None and recording.reference is not None:
        _add_winds(contents, types, station.reference.topic, recording.reference, frame)
    if recording.truth is not None:
        _add_winds(contents, types, Input(topic=TRUTH_TOPIC), recording.truth, frame)
    for series, stated, signal in (
        (recording.temperature, station.air.temperature, "temperature"),
        (recording.pressure, station.air.pressure, "pressure"),
    ):
        if series is not None and stated is not None:
            source = resolved(stated, "temperature" if signal == "temperature" else "pressure")
            content = _content(contents, types, source, series.time, "air")
            content.columns[field_path(source.field)] = _unscaled(source, series.value)
    if recording.platform is not None:
        _add_platform(contents, types, recording, recording.platform)
    found = [_messages(topic, content, types) for topic, content in contents.items()]
    return [*found, *batches]


def running_time(time: TimeArray) -> TimeArray:
    """Times of recording that keep the order of arrival: the largest stamp so far."""
    return np.maximum.accumulate(time) if len(time) else time


def _content(
    contents: dict[str, _Content], types: Typestore, source: Input, time: TimeArray, frame: str
) -> _Content:
    """The content of the source's topic, new or shared with another signal."""
    topic = absolute(source.topic)
    content = contents.get(topic)
    if content is None:
        content = _Content(source.type, time)
        template(types, source.type)
        if "header" in dict(types.fielddefs[source.type][1]):
            content.columns["header", "stamp"] = time
            content.texts["header", "frame_id"] = frame
        contents[topic] = content
    elif content.message_type != source.type or not np.array_equal(content.time, time):
        raise UserError(
            "two signals with different types or stamps share one topic.",
            source.topic,
            "Give each signal a topic of its own in the station file.",
        )
    return content


def _messages(topic: str, content: _Content, types: Typestore) -> TopicMessages:
    blank = template(types, content.message_type, list(content.columns), content.texts)
    raw = serialised(types, blank, content.columns)
    return TopicMessages(topic, content.message_type, running_time(content.time), raw)


def _add_pulses(
    contents: dict[str, _Content],
    types: Typestore,
    source: Input,
    rotor: Cup | Propeller,
    pulses: Pulses,
) -> None:
    content = _content(contents, types, source, pulses.time, rotor.name)
    if source.meaning == "edge":
        if pulses.turns is not None:
            raise UserError(
                f"'{rotor.name}' has counts, but its topic carries single edges.",
                source.topic,
                "Name a counter type for it in the station file, e.g. std_msgs/msg/Int64.",
            )
        content.columns[field_path(source.field)] = pulses.time
        if source.type == "std_msgs/msg/Header":
            content.texts["frame_id",] = rotor.name
        return
    turns = pulses.turns
    if turns is None:
        turns = np.arange(1, len(pulses.time) + 1) / rotor.pulses_per_revolution
    content.columns[field_path(source.field)] = raw_from_turns(source, rotor, pulses.time, turns)


def _edge_batches(source: Input, pulses: Pulses, types: Typestore) -> TopicMessages:
    """Edges second by second, each batch recorded at its last edge."""
    second = running_time(pulses.time) // _BATCH
    cuts = np.flatnonzero(np.diff(second)) + 1
    parts = [part for part in np.split(pulses.time, cuts) if len(part)]
    blank = template(types, source.type)
    path = field_path(source.field)
    raw: list[bytes] = []
    for part in parts:
        holder = blank
        for step in path[:-1]:
            holder = getattr(holder, str(step))
        setattr(holder, str(path[-1]), part.astype(np.int64))
        raw.append(bytes(types.serialize_cdr(blank, source.type)))
    last = np.asarray([int(part.max()) for part in parts], dtype=np.int64)
    return TopicMessages(absolute(source.topic), source.type, running_time(last), raw)


def _add_winds(
    contents: dict[str, _Content], types: Typestore, stated: Input, winds: Winds, frame: str
) -> None:
    source = resolved(stated, "wind")
    content = _content(contents, types, source, winds.time, frame)
    base = field_path(source.field)
    _add_vector(content, base, _unscaled(source, winds.velocity))


def _add_platform(
    contents: dict[str, _Content], types: Typestore, recording: Recording, states: PlatformStates
) -> None:
    platform = recording.station.platform
    frame = recording.station.recording.frame
    if platform is None:
        return
    if platform.odometry is not None:
        source = resolved(platform.odometry, "odometry")
        content = _content(contents, types, source, states.time, frame)
        content.texts["child_frame_id",] = BODY_FRAME
        _add_vector(content, ("pose", "pose", "position"), states.position)
        _add_vector(content, ("pose", "pose", "orientation"), states.attitude)
        _add_vector(content, ("twist", "twist", "linear"), states.velocity)
        _add_vector(content, ("twist", "twist", "angular"), states.angular_rate)
        return
    if platform.imu is not None:
        source = resolved(platform.imu, "imu")
        content = _content(contents, types, source, states.time, BODY_FRAME)
        _add_vector(content, ("orientation",), states.attitude)
        _add_vector(content, ("angular_velocity",), states.angular_rate)
    if platform.twist is not None:
        source = resolved(platform.twist, "twist")
        moved = recording.platform_velocity
        if moved is None:
            moved = Velocities(states.time, states.velocity)
        content = _content(contents, types, source, moved.time, BODY_FRAME)
        _add_vector(content, ("twist", "linear"), moved.velocity)


def _add_vector(content: _Content, base: FieldPath, values: FloatArray) -> None:
    for index, axis in enumerate("xyzw"[: values.shape[1]]):
        path: FieldPath = (*base, axis)
        content.columns[path] = values[:, index]


def _unscaled(source: Input, values: FloatArray) -> FloatArray:
    return (values - source.offset) / source.scale
