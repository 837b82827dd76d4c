"""Simulated signals as the ROS messages that a station's inputs name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import TwistStamped, Vector3Stamped

from wind_sensors.errors import UserError
from wind_sensors.nodes.inputs import message_class
from wind_sensors.nodes.outputs import stamp
from wind_sensors.nodes.topics import TRUTH_TOPIC
from wind_sensors.simulation.transport import Event
from wind_sensors.station.inputs import (
    FieldPath,
    Signal,
    angle_inputs,
    field_path,
    field_value,
    raw_from_angles,
    raw_from_turns,
    resolved,
)
from wind_sensors.station.model import Cup, Input, Platform, Propeller, Station

BODY_FRAME = "base_link"

_BATCH = 1_000_000_000
"""Edges of one second travel in one batch [ns]."""


class Outgoing(NamedTuple):
    """A message and where it goes."""

    topic: str
    message: Any


Encoder = Callable[[Event], Iterator[Outgoing]]


class SignalEncoder:
    """Turns events of a simulation into messages.

    Args:
        station: Names topics, types and fields.
        frame_id: Of earth-fixed vectors.
        with_truth: Deliver the true wind at the sensor on `truth/wind` too.

    Attributes:
        topics: Message class by topic.

    Raises:
        UserError: A type is not installed or cannot hold the signal.
    """

    def __init__(self, station: Station, frame_id: str, *, with_truth: bool) -> None:
        self.topics: dict[str, type[Any]] = {}
        self._frame_id = frame_id
        self._encoders: dict[str, Encoder] = {}
        for instrument in station.instruments:
            if isinstance(instrument, (Cup, Propeller)):
                source = self._source(instrument.pulses, "pulses")
                self._encoders[f"pulses/{instrument.name}"] = self._rotor(source, instrument)
            else:
                for signal, source in angle_inputs(instrument).items():
                    self._register(source)
                    self._encoders[f"angles/{signal}"] = self._angle(source, signal)
        self._add_joint_elevations(station)
        if station.reference is not None:
            self._encoders["reference"] = self._wind(station.reference.topic)
        if station.air.temperature is not None:
            source = self._source(station.air.temperature, "temperature")
            self._encoders["temperature"] = self._scalar(source)
        if station.air.pressure is not None:
            source = self._source(station.air.pressure, "pressure")
            self._encoders["pressure"] = self._scalar(source)
        if station.platform is not None:
            self._encoders["platform"] = self._platform(station.platform)
        if with_truth:
            self.topics[TRUTH_TOPIC] = Vector3Stamped
            self._encoders["truth"] = self._wind(Input(topic=TRUTH_TOPIC))

    def encode(self, event: Event) -> Iterator[Outgoing]:
        """Messages of one event; none where nobody wants its signal.

        The message object is used again for the next event of the same source.
        """
        encoder = self._encoders.get(event.source)
        return encoder(event) if encoder is not None else iter(())

    def _source(self, stated: Input, signal: Signal) -> Input:
        source = resolved(stated, signal)
        self._register(source)
        return source

    def _register(self, source: Input) -> None:
        found = message_class(source.type)
        if self.topics.setdefault(source.topic, found) is not found:
            raise UserError(
                "two signals with different types share one topic.",
                source.topic,
                "Give each signal a topic of its own in the station file.",
            )

    def _rotor(self, source: Input, rotor: Cup | Propeller) -> Encoder:
        if source.meaning == "edge":
            return self._edge(source, rotor.name)
        if source.meaning == "edges":
            return self._edges(source)
        return self._turns(source, rotor)

    def _edge(self, source: Input, frame_id: str) -> Encoder:
        message = message_class(source.type)()
        path = field_path(source.field)
        _set_frame(message, frame_id)

        def edge(event: Event) -> Iterator[Outgoing]:
            time = stamp(event.stamp)
            _set_stamp(message, time)
            _set_field(message, path, time)
            yield Outgoing(source.topic, message)

        return edge

    def _edges(self, source: Input) -> Encoder:
        message = message_class(source.type)()
        path = field_path(source.field)
        batch: list[int] = []

        def edges(event: Event) -> Iterator[Outgoing]:
            if batch and event.stamp // _BATCH != batch[-1] // _BATCH:
                _set_field(message, path, batch)
                yield Outgoing(source.topic, message)
                batch.clear()
            batch.append(event.stamp)

        return edges

    def _turns(self, source: Input, rotor: Cup | Propeller) -> Encoder:
        message = message_class(source.type)()
        put = _number_setter(message, field_path(source.field))
        _set_frame(message, rotor.name)
        stamps: list[int] = []
        turns: list[float] = []

        def count(event: Event) -> Iterator[Outgoing]:
            _, _, time, told, number = event
            stamps.append(time)
            turns.append(told[0] if told else (number + 1) / rotor.pulses_per_revolution)
            del stamps[:-2], turns[:-2]
            raw = raw_from_turns(source, rotor, np.array(stamps), np.array(turns))
            _set_stamp(message, stamp(time))
            put(float(raw[-1]))
            yield Outgoing(source.topic, message)

        return count

    def _angle(self, source: Input, signal: str) -> Encoder:
        message = message_class(source.type)()
        path = field_path(source.field)
        put = _number_setter(message, path)
        _set_frame(message, signal)
        _name_joint(message, path, signal)

        def angle(event: Event) -> Iterator[Outgoing]:
            (raw,) = raw_from_angles(source, np.array(event.values))
            _set_stamp(message, stamp(event.stamp))
            put(float(raw))
            yield Outgoing(source.topic, message)

        return angle

    def _add_joint_elevations(self, station: Station) -> None:
        """Where azimuth and elevation share a topic, one message carries both."""
        for instrument in station.instruments:
            if isinstance(instrument, (Cup, Propeller)):
                continue
            (azimuth, *rest) = angle_inputs(instrument).items()
            for name, source in rest:
                if source.topic == azimuth[1].topic:
                    both = self._joined_angles(azimuth[1], source, azimuth[0], name)
                    self._encoders[f"angles/{azimuth[0]}"], self._encoders[f"angles/{name}"] = both

    def _joined_angles(
        self, first: Input, second: Input, first_name: str, second_name: str
    ) -> tuple[Encoder, Encoder]:
        message = message_class(first.type)()
        paths = field_path(first.field), field_path(second.field)
        put_first, put_second = (_number_setter(message, path) for path in paths)
        _set_frame(message, first_name)
        _name_joint(message, paths[0], first_name)
        _name_joint(message, paths[1], second_name)
        azimuths: dict[int, float] = {}
        elevations: dict[int, float] = {}

        def pair(event: Event, mine: dict[int, float], others: dict[int, float]) -> bool:
            mine[event.stamp] = event.values[0]
            return event.stamp in others

        def send(time: int) -> Outgoing:
            (raw_first,) = raw_from_angles(first, np.array([azimuths[time]]))
            (raw_second,) = raw_from_angles(second, np.array([elevations[time]]))
            _set_stamp(message, stamp(time))
            put_first(float(raw_first))
            put_second(float(raw_second))
            for waiting in (azimuths, elevations):
                for old in [known for known in waiting if known <= time]:
                    del waiting[old]
            return Outgoing(first.topic, message)

        def azimuth(event: Event) -> Iterator[Outgoing]:
            if pair(event, azimuths, elevations):
                yield send(event.stamp)

        def elevation(event: Event) -> Iterator[Outgoing]:
            if pair(event, elevations, azimuths):
                yield send(event.stamp)

        return azimuth, elevation

    def _wind(self, stated: Input) -> Encoder:
        source = self._source(stated, "wind")
        message = message_class(source.type)()
        _set_frame(message, self._frame_id)
        vector = field_value(message, field_path(source.field))

        def wind(event: Event) -> Iterator[Outgoing]:
            _set_stamp(message, stamp(event.stamp))
            raw = (np.array(event.values) - source.offset) / source.scale
            vector.x, vector.y, vector.z = (float(component) for component in raw)
            yield Outgoing(source.topic, message)

        return wind

    def _scalar(self, source: Input) -> Encoder:
        message = message_class(source.type)()
        put = _number_setter(message, field_path(source.field))
        _set_frame(message, "air")

        def scalar(event: Event) -> Iterator[Outgoing]:
            _set_stamp(message, stamp(event.stamp))
            put((event.values[0] - source.offset) / source.scale)
            yield Outgoing(source.topic, message)

        return scalar

    def _platform(self, platform: Platform) -> Encoder:
        if platform.odometry is not None:
            return self._odometry(self._source(platform.odometry, "odometry"))
        if platform.imu is None:
            return lambda event: iter(())
        twist = None if platform.twist is None else self._source(platform.twist, "twist")
        return self._imu(self._source(platform.imu, "imu"), twist)

    def _odometry(self, source: Input) -> Encoder:
        message = message_class(source.type)()
        _set_frame(message, self._frame_id)
        message.child_frame_id = BODY_FRAME

        def odometry(event: Event) -> Iterator[Outgoing]:
            _set_stamp(message, stamp(event.stamp))
            values = event.values
            _put_vector(message.pose.pose.orientation, "xyzw", values[0:4])
            _put_vector(message.twist.twist.linear, "xyz", values[4:7])
            _put_vector(message.twist.twist.angular, "xyz", values[7:10])
            _put_vector(message.pose.pose.position, "xyz", values[10:13])
            yield Outgoing(source.topic, message)

        return odometry

    def _imu(self, source: Input, twist: Input | None) -> Encoder:
        message = message_class(source.type)()
        velocity = TwistStamped()
        _set_frame(message, BODY_FRAME)
        _set_frame(velocity, BODY_FRAME)

        def imu(event: Event) -> Iterator[Outgoing]:
            values = event.values
            _set_stamp(message, stamp(event.stamp))
            _put_vector(message.orientation, "xyzw", values[0:4])
            _put_vector(message.angular_velocity, "xyz", values[7:10])
            yield Outgoing(source.topic, message)
            if twist is not None:
                _set_stamp(velocity, stamp(event.stamp))
                _put_vector(velocity.twist.linear, "xyz", values[4:7])
                yield Outgoing(twist.topic, velocity)

        return imu


def _set_stamp(message: Any, time: Any) -> None:
    header = getattr(message, "header", None)
    if header is not None:
        header.stamp = time


def _set_frame(message: Any, frame_id: str) -> None:
    holder = getattr(message, "header", message)
    if hasattr(holder, "frame_id"):
        holder.frame_id = frame_id


def _name_joint(message: Any, path: FieldPath, name: str) -> None:
    if path[:1] == ("position",) and hasattr(message, "name") and isinstance(path[-1], int):
        names = list(message.name)
        names += [""] * (path[-1] + 1 - len(names))
        names[path[-1]] = name
        message.name = names


def _set_field(message: Any, path: FieldPath, value: Any) -> None:
    setattr(field_value(message, path[:-1]), str(path[-1]), value)


def _number_setter(message: Any, path: FieldPath) -> Callable[[float], None]:
    """A function that writes a number into a field, rounded where the field is an integer.

    Raises:
        UserError: The field holds no number.
    """
    last = path[-1]
    if isinstance(last, int):
        holder = field_value(message, path[:-2])
        name = str(path[-2])
        array = getattr(holder, name)
        if len(array) <= last:
            array = type(array)(array.typecode, [*array, *[0] * (last + 1 - len(array))])
            setattr(holder, name, array)
        whole = isinstance(array[last], (int, np.integer))

        def put_item(value: float) -> None:
            getattr(holder, name)[last] = round(value) if whole else value

        return put_item
    holder = field_value(message, path[:-1])
    present = getattr(holder, last)
    if isinstance(present, bool) or not isinstance(present, (int, float)):
        raise UserError(f"the field '{'.'.join(map(str, path))}' holds no number.")
    whole = isinstance(present, int)

    def put(value: float) -> None:
        setattr(holder, last, round(value) if whole else value)

    return put


def _put_vector(vector: Any, names: str, values: tuple[float, ...]) -> None:
    for name, value in zip(names, values, strict=True):
        setattr(vector, name, value)
