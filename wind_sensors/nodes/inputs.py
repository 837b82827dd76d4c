"""Messages of a station's inputs become calls of its estimator.

What a message means is decided in `station.inputs`, for single messages here and for whole bags in
`recordings`, so that live and offline the estimator sees the same numbers.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.nodes.platform import imu_state, odometry_state, twist_velocity
from wind_sensors.station.inputs import (
    LATEST,
    AirSignal,
    FieldPath,
    TurnCounter,
    angle_inputs,
    angles_from_raw,
    field_path,
    field_value,
    is_plausible,
    joint_doubt,
    resolved,
    scaled,
    tells_orientation,
)
from wind_sensors.station.model import Cup, Input, Propeller, Station

Handler = Callable[[Any, int], None]

_SECOND = 1_000_000_000


class Source(NamedTuple):
    """One topic to subscribe to.

    Attributes:
        topic: As the station file names it.
        message_type: The message class.
        receive: To be called with each message.
    """

    topic: str
    message_type: type[Any]
    receive: Callable[[Any], None]


@dataclass
class TopicCount:
    """What happened to the messages of one topic.

    Attributes:
        received: All of them.
        without_stamp, not_numbers, without_orientation, implausible, unusable: What was left out,
            and why.
        problem: Of the last unusable one.
        doubts: Of which joint a signal is read, by signal.
        restarts: How often a counter began anew from zero; its turns go on.
        purposes: What the messages are for.
    """

    received: int = 0
    without_stamp: int = 0
    not_numbers: int = 0
    without_orientation: int = 0
    implausible: int = 0
    unusable: int = 0
    problem: str = ""
    doubts: dict[str, str] = field(default_factory=dict)
    restarts: int = 0
    purposes: list[str] = field(default_factory=list)


def message_class(name: str) -> type[Any]:
    """The class of a ROS message type such as `std_msgs/msg/Header`.

    Raises:
        UserError: The package or the message is not installed.
    """
    package, _, short = name.replace("/msg/", "/").partition("/")
    try:
        found: type[Any] = getattr(import_module(f"{package}.msg"), short)
    except (ImportError, AttributeError):
        raise UserError(
            f"the message type {name} is not installed.",
            remedy=f"Install the ROS package {package}, or name another type in the station file.",
        ) from None
    return found


def nanoseconds(stamp: Any) -> int:
    """A builtin_interfaces/Time as nanoseconds."""
    return int(stamp.sec) * _SECOND + int(stamp.nanosec)


class SignalTaker(Protocol):
    """What takes a station's signals: an estimator, or a watch."""

    def add_pulse(self, name: str, time_ns: int, turns: float | None = None) -> None:
        """An edge of a rotor."""

    def add_angle(self, name: str, time_ns: int, angle: float) -> None:
        """A reading of a vane."""

    def add_platform(
        self,
        time_ns: int,
        attitude_xyzw: npt.ArrayLike,
        velocity: npt.ArrayLike | None,
        angular_rate: npt.ArrayLike,
        position: npt.ArrayLike,
    ) -> None:
        """State of the carrier; the velocity is None where it comes apart."""

    def add_platform_velocity(self, time_ns: int, velocity: npt.ArrayLike) -> None:
        """Velocity of the carrier."""

    def add_air(
        self, time_ns: int, temperature: float | None = None, pressure: float | None = None
    ) -> None:
        """Air temperature, pressure, or both."""


class EstimatorInputs:
    """Subscriptions of one station and the way from their messages to an estimator.

    Args:
        station: The station.
        now: The node's clock [ns]; stands in where a message has no stamp.

    Attributes:
        estimator: Gets the measurements; may be replaced at any time.
        counts: By topic.
        odometry: The latest message of the platform's odometry; None before it.
        instruments: Topics of rotors and vanes.
        event_driven: Topics with edges, of which a rotor at rest sends none.

    Raises:
        UserError: A message type is not installed, or has no such field.
    """

    def __init__(
        self, station: Station, estimator: SignalTaker, now: Callable[[], int]
    ) -> None:
        self.estimator = estimator
        self.counts: dict[str, TopicCount] = defaultdict(TopicCount)
        self.odometry: Any = None
        self.instruments: set[str] = set()
        self.event_driven: set[str] = set()
        self._now = now
        self._handlers: dict[str, list[Handler]] = defaultdict(list)
        self._types: dict[str, str] = {}
        self._add_instruments(station)
        self._add_air(station)
        self._add_platform(station)

    def sources(self) -> list[Source]:
        """The topics to subscribe to."""
        return [
            Source(topic, message_class(self._types[topic]), self._receiver(topic))
            for topic in self._handlers
        ]

    def _add(self, source: Input, purpose: str, handler: Handler) -> None:
        known = self._types.setdefault(source.topic, source.type)
        if known != source.type:
            raise UserError(
                f"two inputs name {source.topic}, one as {known}, one as {source.type}.",
                remedy="Give both the same type, or each its own topic.",
            )
        self.counts[source.topic].purposes.append(purpose)
        self._handlers[source.topic].append(handler)

    def _receiver(self, topic: str) -> Callable[[Any], None]:
        handlers = self._handlers[topic]
        count = self.counts[topic]
        is_header = self._types[topic] == "std_msgs/msg/Header"

        def receive(message: Any) -> None:
            count.received += 1
            header = message if is_header else getattr(message, "header", None)
            stamp = 0 if header is None else nanoseconds(header.stamp)
            try:
                for handler in handlers:
                    handler(message, stamp)
            except (AttributeError, IndexError, OverflowError, TypeError, ValueError) as problem:
                count.unusable += 1
                count.problem = str(problem)

        return receive

    def _add_instruments(self, station: Station) -> None:
        for instrument in station.instruments:
            if isinstance(instrument, (Cup, Propeller)):
                source = resolved(instrument.pulses, "pulses")
                self._add(source, f"pulses of {instrument.name}", self._rotor(source, instrument))
                self._watch_joints(source, instrument.name, instrument.kind)
                self.instruments.add(source.topic)
                if source.meaning in ("edge", "edges"):
                    self.event_driven.add(source.topic)
            else:
                for signal, source in angle_inputs(instrument).items():
                    self.instruments.add(source.topic)
                    self._add(source, f"angle of {signal}", self._angle(source, signal))
                    self._watch_joints(source, signal, instrument.kind)

    def _watch_joints(self, source: Input, signal: str, kind: str) -> None:
        """Doubt a place among several joints; looked at again only where their names change."""
        if source.type != "sensor_msgs/msg/JointState":
            return
        doubts = self.counts[source.topic].doubts
        known: list[list[str]] = [[]]

        def joints(message: Any, stamp: int) -> None:
            if message.name != known[0]:
                known[0] = list(message.name)
                doubts[signal] = joint_doubt(source, signal, kind, known[0])

        self._handlers[source.topic].append(joints)

    def _rotor(self, source: Input, rotor: Cup | Propeller) -> Handler:
        path = _checked_path(source)
        count = self.counts[source.topic]
        name = rotor.name

        def edge(message: Any, stamp: int) -> None:
            time = nanoseconds(field_value(message, path))
            if time == 0:
                count.without_stamp += 1
            else:
                self.estimator.add_pulse(name, time)

        def edges(message: Any, stamp: int) -> None:
            for time in field_value(message, path):
                if abs(time) < LATEST:
                    self.estimator.add_pulse(name, int(time))
                else:
                    count.not_numbers += 1

        counter = TurnCounter(source, rotor)

        def turns(message: Any, stamp: int) -> None:
            time = stamp or self._now()
            reading = counter.add(time, float(field_value(message, path)))
            if reading is None:
                count.not_numbers += 1
            else:
                count.implausible += reading.jumped
                count.restarts += reading.restarted
                self.estimator.add_pulse(name, time, reading.turns)

        return {"edge": edge, "edges": edges}.get(source.meaning, turns)

    def _angle(self, source: Input, signal: str) -> Handler:
        number = self._number(source)

        def angle(message: Any, stamp: int) -> None:
            raw = number(message)
            if raw is not None:
                reading = float(angles_from_raw(source, raw)[0])
                self.estimator.add_angle(signal, stamp or self._now(), reading)

        return angle

    def _add_air(self, station: Station) -> None:
        if station.air.temperature is not None:
            source = resolved(station.air.temperature, "temperature")
            self._add(source, "air temperature", self._temperature(source))
        if station.air.pressure is not None:
            source = resolved(station.air.pressure, "pressure")
            self._add(source, "air pressure", self._pressure(source))

    def _temperature(self, source: Input) -> Handler:
        number = self._air(source, "temperature")

        def temperature(message: Any, stamp: int) -> None:
            value = number(message)
            if value is not None:
                self.estimator.add_air(stamp or self._now(), temperature=value)

        return temperature

    def _pressure(self, source: Input) -> Handler:
        number = self._air(source, "pressure")

        def pressure(message: Any, stamp: int) -> None:
            value = number(message)
            if value is not None:
                self.estimator.add_air(stamp or self._now(), pressure=value)

        return pressure

    def _air(self, source: Input, signal: AirSignal) -> Callable[[Any], float | None]:
        """Value in deg C or Pa; None, and counted, where the air cannot have it."""
        number = self._number(source)
        count = self.counts[source.topic]

        def air(message: Any) -> float | None:
            raw = number(message)
            if raw is None:
                return None
            value = scaled(source, raw)
            if not is_plausible(signal, value)[0]:
                count.implausible += 1
                return None
            return float(value[0])

        return air

    def _number(self, source: Input) -> Callable[[Any], np.ndarray[Any, Any] | None]:
        path = _checked_path(source)
        count = self.counts[source.topic]

        def number(message: Any) -> np.ndarray[Any, Any] | None:
            value = float(field_value(message, path))
            if not np.isfinite(value):
                count.not_numbers += 1
                return None
            return np.array([value])

        return number

    def _add_platform(self, station: Station) -> None:
        platform = station.platform
        if platform is None:
            return
        if platform.odometry is not None:
            source = resolved(platform.odometry, "odometry")
            self._add(source, "platform", self._odometry(source))
        elif platform.imu is not None:
            imu = resolved(platform.imu, "imu")
            self._add(imu, "platform attitude", self._imu(imu, apart=platform.moves_apart))
            if platform.twist is not None:
                twist = resolved(platform.twist, "twist")
                self._add(twist, "platform velocity", self._twist(twist))

    def _odometry(self, source: Input) -> Handler:
        count = self.counts[source.topic]

        def odometry(message: Any, stamp: int) -> None:
            self.odometry = message
            state = odometry_state(message, stamp or self._now())
            if state is None:
                count.not_numbers += 1
            else:
                self.estimator.add_platform(*state)

        return odometry

    def _imu(self, source: Input, *, apart: bool) -> Handler:
        """Attitudes; their velocity comes apart, or the platform only turns."""
        count = self.counts[source.topic]

        def imu(message: Any, stamp: int) -> None:
            if not tells_orientation(message.orientation_covariance[0]):
                count.without_orientation += 1
                return
            state = imu_state(message, stamp or self._now())
            if state is None:
                count.not_numbers += 1
            else:
                self.estimator.add_platform(
                    state.time, state.attitude, None if apart else state.velocity,
                    state.angular_rate, state.position,
                )

        return imu

    def _twist(self, source: Input) -> Handler:
        count = self.counts[source.topic]

        def twist(message: Any, stamp: int) -> None:
            velocity = twist_velocity(message)
            if velocity is None:
                count.not_numbers += 1
            else:
                self.estimator.add_platform_velocity(stamp or self._now(), velocity)

        return twist


def _checked_path(source: Input) -> FieldPath:
    """The field's path, tried on an empty message as far as its arrays allow."""
    path = field_path(source.field)
    try:
        field_value(message_class(source.type)(), path)
    except IndexError:
        # The arrays of an empty message have no elements yet.
        pass
    except (AttributeError, TypeError):
        raise UserError(
            f"{source.type} has no field '{source.field}'.",
            where=source.topic,
            remedy="Name a numeric field of it, e.g. `position[0]` or `data`.",
        ) from None
    return path
