"""What an `Input` means: the defaults of each signal and the way from raw numbers to SI units.

The functions here see plain numbers only, so that a node (one message at a time) and the reader of
a recording (whole arrays) turn the same messages into the same bits.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel

from wind_sensors.errors import UserError
from wind_sensors.station.model import Angle, Bivane, Cup, Input, Propeller, Station, Vane
from wind_sensors.station.signals import FloatArray, TimeArray

Signal = Literal[
    "pulses", "angle", "wind", "temperature", "pressure", "odometry", "imu", "twist"
]
FieldPath = tuple[str | int, ...]
Meaning = Literal["", "edge", "edges", "count", "angle", "frequency", "value"]

DEFAULT_TYPES: dict[Signal, str] = {
    "pulses": "std_msgs/msg/Header",
    "angle": "sensor_msgs/msg/JointState",
    "wind": "geometry_msgs/msg/Vector3Stamped",
    "temperature": "sensor_msgs/msg/Temperature",
    "pressure": "sensor_msgs/msg/FluidPressure",
    "odometry": "nav_msgs/msg/Odometry",
    "imu": "sensor_msgs/msg/Imu",
    "twist": "geometry_msgs/msg/TwistStamped",
}

DEFAULT_FIELDS: dict[str, str] = {
    "std_msgs/msg/Header": "stamp",
    "sensor_msgs/msg/TimeReference": "time_ref",
    "sensor_msgs/msg/JointState": "position[0]",
    "sensor_msgs/msg/Temperature": "temperature",
    "sensor_msgs/msg/FluidPressure": "fluid_pressure",
    "sensor_msgs/msg/RelativeHumidity": "relative_humidity",
    "geometry_msgs/msg/Vector3": "",
    "geometry_msgs/msg/Vector3Stamped": "vector",
    "geometry_msgs/msg/Twist": "linear",
    "geometry_msgs/msg/TwistStamped": "twist.linear",
    "geometry_msgs/msg/TwistWithCovarianceStamped": "twist.twist.linear",
    "nav_msgs/msg/Odometry": "",
    "sensor_msgs/msg/Imu": "",
}

_ROTOR_MEANINGS: dict[str, Meaning] = {
    "std_msgs/msg/Header": "edge",
    "sensor_msgs/msg/TimeReference": "edge",
    "std_msgs/msg/Int64MultiArray": "edges",
    "sensor_msgs/msg/JointState": "angle",
    "std_msgs/msg/Float32": "frequency",
    "std_msgs/msg/Float64": "frequency",
}


def full_type(name: str) -> str:
    """`std_msgs/Header` as `std_msgs/msg/Header`; full names stay."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name


def absolute(topic: str) -> str:
    """The name under which a bag has a topic of the root namespace."""
    return topic if topic.startswith("/") else f"/{topic}"


def renamed(station: Station, name: Callable[[str], str]) -> Station:
    """The station with other names of its topics.

    Args:
        station: The station.
        name: The new name of a topic.
    """
    found: Station = _renamed(station, name)
    return found


def _renamed(node: Any, name: Callable[[str], str]) -> Any:
    """A part of a station with its topics renamed; the part itself where nothing changes."""
    if isinstance(node, Input):
        topic = name(node.topic)
        return node if topic == node.topic else node.model_copy(update={"topic": topic})
    if isinstance(node, BaseModel):
        parts = {key: getattr(node, key) for key in node.model_fields_set}
        changed = {key: _renamed(part, name) for key, part in parts.items()}
        if all(changed[key] is part for key, part in parts.items()):
            return node
        return node.model_copy(update=changed)
    if isinstance(node, tuple):
        items = tuple(_renamed(item, name) for item in node)
        return node if all(a is b for a, b in zip(items, node, strict=True)) else items
    return node


def resolved(source: Input, signal: Signal) -> Input:
    """The input with type, field and meaning filled in.

    Args:
        source: As the station file states it; empty keys mean the default.
        signal: What the input delivers.

    Returns:
        The same input without empty type and meaning. A rotor's meaning follows from the type:
        edges for Header, TimeReference and Int64MultiArray, an angle for JointState, a frequency
        for floats, a count for the rest. Every other signal is a value.
    """
    message_type = full_type(source.type) if source.type else DEFAULT_TYPES[signal]
    meaning: Meaning = source.meaning
    if not meaning:
        by_type = _ROTOR_MEANINGS.get(message_type, "count")
        meaning = by_type if signal == "pulses" else "value"
    return source.model_copy(
        update={
            "type": message_type,
            "field": source.field or DEFAULT_FIELDS.get(message_type, "data"),
            "meaning": meaning,
        }
    )


def elevation_input(azimuth: Input, elevation: Input) -> Input:
    """The elevation of a bivane; on the azimuth's topic it is the second joint by default."""
    same_topic = elevation.topic == azimuth.topic and not elevation.field
    message_type = full_type(elevation.type) or DEFAULT_TYPES["angle"]
    if same_topic and message_type == DEFAULT_TYPES["angle"]:
        elevation = elevation.model_copy(update={"field": "position[1]"})
    return resolved(elevation, "angle")


def tells_orientation(first_covariance: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Whether a sensor_msgs/Imu has an orientation at all.

    Args:
        first_covariance: `orientation_covariance[0]`; the message's definition reserves -1 for
            devices without an orientation.
    """
    return np.asarray(np.asarray(first_covariance, dtype=np.float64) >= 0.0, dtype=np.bool_)


def joint_doubt(source: Input, signal: str, kind: str, names: Sequence[str]) -> str:
    """Why a sensor_msgs/JointState may be read at another joint than the instrument's.

    A joint is the instrument's if its name contains the instrument's name, its kind, or for a
    bivane `azimuth` or `elevation`. A place that the station file states is believed unless
    another joint is the instrument's.

    Args:
        source: The input, resolved; its place is the index of its field.
        signal: Name of the signal, `<instrument>` or `<bivane>/elevation`.
        kind: Of the instrument.
        names: Of the message's joints.

    Returns:
        A sentence with what to do; empty where there is no doubt.
    """
    place = field_path(source.field)[-1]
    if not isinstance(place, int) or len(names) < 2 or place >= len(names) or not any(names):
        return ""
    instrument, _, part = signal.partition("/")
    words = [part] if part else [instrument, kind, *(["azimuth"] if kind == "bivane" else [])]
    own = [any(word.lower() in name.lower() for word in words) for name in names]
    if own[place] or (place > 0 and not any(own)):
        return ""
    read = f"{source.field} of {source.topic} is the joint {names[place]}"
    if any(own):
        right = own.index(True)
        return (
            f"{read}, but {names[right]} looks like '{signal}': state `field: position[{right}]`."
        )
    return (
        f"{read}, one of {', '.join(names)}, and none looks like '{signal}': state `field`, or "
        "give the instrument its joint's name."
    )


def field_path(field: str) -> FieldPath:
    """`wind.data[3]` as ("wind", "data", 3).

    Raises:
        UserError: The text is not a path of names and indices.
    """
    path: list[str | int] = []
    for part in field.split(".") if field else []:
        match = re.fullmatch(r"([A-Za-z_]\w*)((?:\[\d+\])*)", part)
        if match is None:
            raise UserError(
                f"'{field}' is not a field of a message.",
                remedy="Write names joined by dots, indices in brackets: `position[0]`.",
            )
        path.append(match[1])
        path.extend(int(index) for index in re.findall(r"\d+", match[2]))
    return tuple(path)


def field_value(message: Any, path: FieldPath) -> Any:
    """The field of a message object at a path from `field_path`.

    Raises:
        AttributeError, IndexError: The message has no such field.
    """
    for step in path:
        message = message[step] if isinstance(step, int) else getattr(message, step)
    return message


def scaled(source: Input, raw: FloatArray) -> FloatArray:
    """scale * raw + offset."""
    return np.asarray(source.scale * raw + source.offset, dtype=np.float64)


AirSignal = Literal["temperature", "pressure"]


class AirRange(NamedTuple):
    """Where a quantity of the air lies anywhere a wind sensor works.

    Attributes:
        least, most: In `unit`.
        unit: E.g. `Pa`.
        remedy: What to write in the station file for the units that are usual otherwise.
    """

    least: float
    most: float
    unit: str
    remedy: str


AIR_RANGES: dict[AirSignal, AirRange] = {
    "temperature": AirRange(-95.0, 65.0, "deg C", "for kelvin write `offset: -273.15`"),
    "pressure": AirRange(10_000.0, 120_000.0, "Pa", "for hPa write `scale: 100`"),
}
"""From the coldest to the hottest place on earth, and from 16 km up to below the sea's level."""


def is_plausible(signal: AirSignal, value: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether the air can have these values [deg C or Pa]; same shape."""
    limits = AIR_RANGES[signal]
    return np.asarray((value >= limits.least) & (value <= limits.most), dtype=np.bool_)


def angles_from_raw(source: Input, raw: FloatArray) -> FloatArray:
    """Angle of a vane from the raw field.

    Args:
        source: With `steps`, the raw value nearest in the table decides; without, scale and
            offset turn the raw value into radians.
        raw: Values of the field, shape (n,).

    Returns:
        Angle counter-clockwise from the sensor's x axis [rad], shape (n,); NaN stays NaN.
    """
    if not source.steps:
        return scaled(source, raw)
    table = np.asarray(sorted(source.steps), dtype=np.float64)
    borders = 0.5 * (table[1:, 0] + table[:-1, 0])
    angle = np.radians(table[np.searchsorted(borders, raw), 1])
    return np.where(np.isfinite(raw), angle, np.nan)


def raw_from_angles(source: Input, angle: FloatArray) -> FloatArray:
    """The field that `angles_from_raw` turns into these angles (the nearest step of a table)."""
    if not source.steps:
        return np.asarray((angle - source.offset) / source.scale, dtype=np.float64)
    table = np.asarray(source.steps, dtype=np.float64)
    apart = np.angle(np.exp(1j * (angle[:, None] - np.radians(table[:, 1]))))
    nearest = np.argmin(np.abs(apart), axis=1)
    return np.asarray(table[nearest, 0], dtype=np.float64)


LATEST = 2.0**63
"""No time of an edge reaches this [ns]; what is not a number does not lie below it either."""

FASTEST_WIND = 120.0
"""No wind turns a rotor faster [m/s]; the strongest gust that was measured had 113 m/s."""
_BURST = 1.0
"""Messages without a stamp of their own may come this much closer than they were sent [s]."""
_BACKWARDS_BURST = 0.2
"""The same for a propeller that turns backwards [s]."""
_BACKWARDS_NOISE = 0.2
"""So far below nought may a speed be that a converter reports of a cup at rest [m/s]."""
_TREMBLE = 1.0
"""A cup that stands may swing back by as much [turns]."""


class TurnReading(NamedTuple):
    """What one rotor message told.

    Attributes:
        turns: Revolutions since the first message.
        restarted: The source went back and was taken to have restarted from zero.
        jumped: The source stepped or turns as no wind turns the rotor; the turns since the message
            before were left out.
    """

    turns: float
    restarted: bool
    jumped: bool = False


class TurnCounter:
    """Turns counts, angles, frequencies or indicated speeds into revolutions.

    Args:
        source: Resolved input of the rotor; `meaning` is count, angle, frequency or value.
        rotor: The rotor, for its pulses per revolution and its calibration.
    """

    def __init__(self, source: Input, rotor: Cup | Propeller) -> None:
        self._source = source
        self._rotor = rotor
        self._previous: float | None = None
        self._previous_ns = 0
        self._turns = 0.0

    def add(self, time_ns: int, raw: float) -> TurnReading | None:
        """One message in order of arrival.

        Args:
            time_ns: Stamp [ns].
            raw: Value of the field.

        Returns:
            The reading, or None where the value is not a number.
        """
        if not np.isfinite(raw):
            return None
        value = self._source.scale * raw + self._source.offset
        restarted = False
        if self._source.meaning in {"count", "angle"}:
            step = 0.0 if self._previous is None else value - self._previous
            if self._source.modulus is not None:
                wrap = self._source.modulus * abs(self._source.scale)
                step -= wrap * np.floor(step / wrap + 0.5)
            elif step < 0.0 and time_ns > self._previous_ns:
                # A counter only counts up: going back with the time going on is a restart.
                restarted = self._source.meaning == "count"
                step = value if restarted else step
            per_turn = (
                float(self._rotor.pulses_per_revolution)
                if self._source.meaning == "count"
                else 2.0 * np.pi
            )
            turns = step / per_turn
        elif self._previous is not None:
            turns = self._turn_rate(value) * max(time_ns - self._previous_ns, 0) * 1e-9
        else:
            turns = 0.0
        jumped = not self._is_possible(turns, time_ns, value)
        if not jumped:
            self._turns += turns
        self._previous, self._previous_ns = value, time_ns
        return TurnReading(float(self._turns), restarted and not jumped, jumped)

    def _is_possible(self, turns: float, time_ns: int, value: float) -> bool:
        """Whether some wind turns the rotor so far between the message before and this one."""
        seconds = (time_ns - self._previous_ns) * 1e-9
        if self._previous is None or seconds < 0.0:
            # What came late takes back what the messages after it have counted.
            return True
        fastest = FASTEST_WIND / (2.0 * np.pi * self._rotor.calibration_distance)
        if self._source.meaning not in {"count", "angle"}:
            return bool(abs(turns) <= fastest * seconds) and not self._turns_backwards(value)
        if turns >= 0.0:
            return bool(turns <= fastest * (seconds + _BURST) + _TREMBLE)
        if isinstance(self._rotor, Cup) and self._source.meaning == "count":
            return seconds == 0.0 or bool(-turns <= _TREMBLE)
        return bool(-turns <= fastest * (seconds + _BACKWARDS_BURST) + _TREMBLE)

    def _turns_backwards(self, value: float) -> bool:
        """Whether a frequency or an indicated speed is one of a cup that runs in reverse."""
        if isinstance(self._rotor, Propeller):
            return False
        speed = value
        if self._source.meaning == "frequency":
            speed = 2.0 * np.pi * self._rotor.calibration_distance * self._turn_rate(value)
        return bool(speed < -_BACKWARDS_NOISE)

    def _turn_rate(self, value: float) -> float:
        if self._source.meaning == "frequency":
            return value / self._rotor.pulses_per_revolution
        if isinstance(self._rotor, Cup):
            spinning = max(value - self._rotor.starting_speed, 0.0)
        else:
            stall = self._rotor.stall_speed
            spinning = value - stall**2 / value if value > stall else 0.0
        return spinning / (2.0 * np.pi * self._rotor.calibration_distance)


class CountedTurns(NamedTuple):
    """What all messages of a rotor told.

    Attributes:
        turns: Revolutions at each stamp, NaN where the value was not a number.
        restarts: How often the source restarted from zero.
        jumps: Indices of the messages whose step was left out.
    """

    turns: FloatArray
    restarts: int
    jumps: tuple[int, ...]


def turns_from_raw(
    source: Input, rotor: Cup | Propeller, time: Iterable[int], raw: Iterable[float]
) -> CountedTurns:
    """`TurnCounter` over whole arrays.

    Args:
        source: Resolved input of the rotor.
        rotor: The rotor.
        time: Stamps [ns].
        raw: Values of the field.
    """
    counter = TurnCounter(source, rotor)
    turns: list[float] = []
    restarts = 0
    jumps: list[int] = []
    for index, (stamp, value) in enumerate(zip(time, raw, strict=True)):
        reading = counter.add(int(stamp), float(value))
        turns.append(float("nan") if reading is None else reading.turns)
        if reading is not None:
            restarts += reading.restarted
            jumps += [index] if reading.jumped else []
    return CountedTurns(np.asarray(turns, dtype=np.float64), restarts, tuple(jumps))


def raw_from_turns(
    source: Input, rotor: Cup | Propeller, time: TimeArray, turns: FloatArray
) -> FloatArray:
    """The field that `TurnCounter` turns into these revolutions.

    Args:
        source: Resolved input of the rotor; `meaning` is count, angle, frequency or value.
        rotor: The rotor.
        time: Stamps [ns], shape (n,).
        turns: Revolutions at the stamps, shape (n,).

    Returns:
        Shape (n,); counts and angles wrapped at the input's modulus, rates as the mean since the
        stamp before (zero at the first one).
    """
    if source.meaning == "count":
        value = np.rint(turns * rotor.pulses_per_revolution)
    elif source.meaning == "angle":
        value = turns * 2.0 * np.pi
    else:
        seconds = np.diff(time, prepend=time[:1]) * 1e-9
        steps = np.diff(turns, prepend=turns[:1])
        rate = np.divide(steps, seconds, out=np.zeros(len(turns)), where=seconds > 0.0)
        if source.meaning == "frequency":
            value = rate * rotor.pulses_per_revolution
        else:
            value = _indicated_speed(rotor, 2.0 * np.pi * rate)
    raw = (value - source.offset) / source.scale
    return np.asarray(raw if source.modulus is None else np.mod(raw, source.modulus))


def _indicated_speed(rotor: Cup | Propeller, spin: FloatArray) -> FloatArray:
    """Speed by the calibration at a rotation rate [rad/s]; zero for a rotor that stands."""
    run = rotor.calibration_distance * spin
    if isinstance(rotor, Cup):
        speed = run + rotor.starting_speed
    else:
        speed = 0.5 * (run + np.sqrt(run**2 + 4.0 * rotor.stall_speed**2))
    return np.where(spin > 0.0, speed, 0.0)


def angle_inputs(vane: Angle) -> dict[str, Input]:
    """Resolved inputs of a vane or bivane by the name of their signal.

    A vane delivers `<name>`; a bivane `<name>` (azimuth) and `<name>/elevation`.
    """
    if isinstance(vane, Vane):
        return {vane.name: resolved(vane.joint_states, "angle")}
    if isinstance(vane, Bivane):
        return {
            vane.name: resolved(vane.azimuth, "angle"),
            f"{vane.name}/elevation": elevation_input(vane.azimuth, vane.elevation),
        }
    return {}
