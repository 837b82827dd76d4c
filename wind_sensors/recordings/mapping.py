"""The mapping file: which column or sentence of a foreign file becomes which topic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO
from typing import Any, Literal

from pydantic import ConfigDict, Field, ValidationError, field_validator, model_validator
from ruamel.yaml import YAML

from wind_sensors.errors import UserError
from wind_sensors.recordings.local_time import zone_fault
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.station.document import Document, parse
from wind_sensors.station.inputs import absolute
from wind_sensors.station.model import Entry, Input, Rotor, Station, Vane
from wind_sensors.station.problems import Problem, problem_of
from wind_sensors.station.reading import station_of
from wind_sensors.station.reference import entries_markdown

UNITS: dict[str, tuple[float, float]] = {
    "": (1.0, 0.0),
    "m/s": (1.0, 0.0),
    "kn": (1852.0 / 3600.0, 0.0),
    "km/h": (1.0 / 3.6, 0.0),
    "mph": (0.44704, 0.0),
    "rad": (1.0, 0.0),
    "deg": (0.017453292519943295, 0.0),
    "degC": (1.0, 0.0),
    "K": (1.0, -273.15),
    "degF": (5.0 / 9.0, -160.0 / 9.0),
    "Pa": (1.0, 0.0),
    "hPa": (100.0, 0.0),
    "mbar": (100.0, 0.0),
    "kPa": (1000.0, 0.0),
    "%": (0.01, 0.0),
    "m": (1.0, 0.0),
    "mm": (0.001, 0.0),
    "ft": (0.3048, 0.0),
    "Hz": (1.0, 0.0),
    "V": (1.0, 0.0),
    "mV": (0.001, 0.0),
}
"""Factor and offset to the unit of the messages: SI, with degrees Celsius for temperatures."""

_DIMENSIONS = {
    "m/s": "speed", "kn": "speed", "km/h": "speed", "mph": "speed",
    "rad": "angle", "deg": "angle",
    "degC": "temperature", "K": "temperature", "degF": "temperature",
    "Pa": "pressure", "hPa": "pressure", "mbar": "pressure", "kPa": "pressure",
    "%": "share", "m": "length", "mm": "length", "ft": "length",
    "Hz": "frequency", "V": "voltage", "mV": "voltage",
}
_RAW = frozenset({"", "voltage", "share"})
"""What any signal may come as: the station file's scale and offset make its unit of it."""


_INTRODUCTION = """# Mapping file

`wind import FILE... --mapping MAP.yaml -o RECORDING` turns tables (CSV, TOA5, NRG exports; gzip
too) and NMEA 0183 logs into a recording. The mapping says which column or sentence becomes which
topic, type and field, in which unit and time zone. Beside the keys of `Mapping` it has `station`,
a whole station file (see station_file.md), which becomes the recording's. Ready mappings lie in
`config/mappings`; lines that cannot be read are counted and told.

This page is written by `wind info --schema mapping`.
"""


class Source(Entry):
    """Where a number stands in the file."""

    column: str = ""
    """Name of a table's column."""
    sentence: str = ""
    """Three letters of an NMEA 0183 sentence."""
    value: int = Field(default=1, ge=1)
    """Position of the number in the sentence, counted from 1 after the sentence's name."""
    where: dict[int, str] = Field(default_factory=dict)
    """Fields that must have these texts, e.g. `{2: R, 5: A}` for relative, valid MWV."""
    unit: str = ""
    """Unit in the file; the messages get SI (temperatures: deg C)."""
    direction: Literal["", "from_north", "from_bow"] = ""
    """For angles in degrees: clockwise from north or from the bow, where the wind comes from; the
    message gets the nose's heading counter-clockwise from the sensor's x axis (east, or
    forward)."""

    @model_validator(mode="after")
    def _is_complete(self) -> Source:
        if bool(self.column) == bool(self.sentence):
            raise ValueError("name either a `column` of a table or a `sentence` of an NMEA log")
        if self.unit not in UNITS:
            known = ", ".join(unit for unit in UNITS if unit)
            raise ValueError(f"'{self.unit}' is not a known unit: write one of {known}")
        return self


class PulseScale(Entry):
    """The logger's calibration, which hides the number of pulses in an interval."""

    scale: float
    """Speed per pulse in one interval."""
    offset: float = 0.0
    """Speed at no pulse."""


class Signal(Source):
    """One number becomes one field of one topic."""

    topic: str
    """Topic that gets it; several numbers of one instant may share a topic."""
    type: str = "std_msgs/msg/Float64"
    """ROS message type."""
    field: str = ""
    """Field of the message; empty: the type's default."""
    pulses: PulseScale | None = None
    """The number is a speed; its pulses are counted up and the message gets the count."""


class Vector(Entry):
    """A speed and a direction become a wind vector, where the air goes (ENU)."""

    topic: str
    """Topic that gets it."""
    type: str = "geometry_msgs/msg/Vector3Stamped"
    """ROS message type with a vector."""
    speed: Source
    """Horizontal speed."""
    direction_from: Source
    """Clockwise from north, where the wind comes from."""

    @model_validator(mode="after")
    def _is_an_angle(self) -> Vector:
        if self.direction_from.unit not in {"deg", "rad"} or self.direction_from.direction:
            raise ValueError("`direction_from` needs `unit: deg` (or rad) and nothing else")
        return self


class PlatformSource(Entry):
    """Compass, course and position become nav_msgs/Odometry.

    The attitude has the compass heading as its yaw, uncorrected (the station file says what it
    refers to), and no roll and pitch. The twist holds the velocity over ground east, north: the
    station file says `velocity_axes: earth`. The position counts from the first fix, east, north.
    """

    topic: str = "/platform/odom"
    """Topic that gets it."""
    heading: Source
    """Compass heading, clockwise from north [unit: deg]."""
    speed: Source
    """Speed over ground."""
    course: Source
    """Course over ground, clockwise from true north [unit: deg]."""
    latitude: Source | None = None
    """Latitude, with its hemisphere in the next field (NMEA)."""
    longitude: Source | None = None
    """Longitude, with its hemisphere in the next field (NMEA)."""


class TimeColumn(Entry):
    """How a table tells the time."""

    column: str = "TIMESTAMP"
    """Name of the column."""
    format: str = ""
    """As for strptime; empty: ISO 8601."""
    zone: str = "UTC"
    """UTC, an offset as +01:00, or a name as Europe/Berlin: then the logger follows its summer
    time, and the hour that comes twice is told by the order of the rows."""
    mark: Literal["end", "start"] = "end"
    """Whether the stamp is the end or the start of the station's `recording.averaging_time`; the
    messages get its end."""

    @field_validator("zone", mode="before")
    @classmethod
    def _is_a_zone(cls, zone: object) -> object:
        fault = zone_fault(str(zone))
        if fault:
            raise ValueError(fault)
        return zone


class Mapping(Entry):
    """A whole mapping file."""

    model_config = ConfigDict(arbitrary_types_allowed=True)

    format: Literal["csv", "toa5", "nrg", "nmea0183"]
    """csv: names in the first line; toa5: Campbell Scientific; nrg: NRG logger exports."""
    delimiter: str = ""
    """Between a table's columns; empty: comma, and a tab for nrg."""
    decimal: Literal[".", ","] = "."
    """Sign before the decimals of a table's numbers."""
    missing: tuple[str, ...] = ("", "NAN", "NaN", "nan", "INF", "-INF", "NULL", "-9999")
    """Texts that stand for no value."""
    time: TimeColumn = TimeColumn()
    """How a table tells the time."""
    talkers: tuple[str, ...] = ()
    """First letters of the NMEA sentences to take; empty: all."""
    signals: tuple[Signal, ...] = ()
    """Numbers that become fields of topics."""
    vectors: tuple[Vector, ...] = ()
    """Speeds with directions that become wind vectors."""
    platform: PlatformSource | None = None
    """Compass and course of a moving platform (NMEA)."""

    @property
    def sources(self) -> list[Source]:
        """Every number the mapping asks for."""
        found: list[Source] = list(self.signals)
        for vector in self.vectors:
            found += [vector.speed, vector.direction_from]
        if self.platform is not None:
            parts = self.platform
            found += [parts.heading, parts.speed, parts.course]
            found += [part for part in (parts.latitude, parts.longitude) if part is not None]
        return found

    @property
    def speeds(self) -> list[Source]:
        """The numbers that are speeds of a wind or a platform."""
        found = [vector.speed for vector in self.vectors]
        return found if self.platform is None else [*found, self.platform.speed]

    @property
    def topics(self) -> list[str]:
        """Every topic that the mapping writes."""
        found = [signal.topic for signal in self.signals]
        found += [vector.topic for vector in self.vectors]
        return found if self.platform is None else [*found, self.platform.topic]


@dataclass(frozen=True)
class MappingFile:
    """A validated mapping and the station file it carries.

    Attributes:
        mapping: How to read the files.
        station: The station that the recording will name.
        station_text: Its text, with the comments of the mapping file.
    """

    mapping: Mapping
    station: Station
    station_text: str

    def station_text_with_start(self, start: str) -> str:
        """The station's text with `recording.start` set."""
        loaded = YAML(typ="rt").load(self.station_text)
        loaded.setdefault("recording", {})["start"] = start
        return _dumped(loaded)


def mapping_markdown() -> str:
    """Every entry and key of the mapping file, as Markdown."""
    return entries_markdown(Mapping, _INTRODUCTION)


def read_mapping(text: str, name: str) -> MappingFile:
    """Validate the text of a mapping file.

    Args:
        text: YAML; beside the keys of `Mapping` it has `station`, a whole station file.
        name: File name for messages.

    Raises:
        UserError: The file is wrong; every fault is listed with its line.
    """
    document = parse(text, name)
    if not isinstance(document.data, dict) or "station" not in document.data:
        raise UserError("the mapping has no `station`.", name, "Add the station file's keys there.")
    inner = {path[1:]: line for path, line in document.lines.items() if path[:1] == ("station",)}
    station = station_of(Document(name, document.data["station"], inner), shipped_profiles())
    given = {key: value for key, value in document.data.items() if key != "station"}
    try:
        mapping = Mapping.model_validate(given)
    except ValidationError as error:
        details = error.errors(include_url=False)
        raise _refused(
            document.name, [problem_of(detail, document, given, Mapping) for detail in details]
        ) from None
    wrong = [
        Problem(document.where(path), path, f"{fault}.", "")
        for path, fault in _wrong_units(mapping, station)
    ]
    if wrong:
        raise _refused(document.name, wrong)
    return MappingFile(mapping, station, _dumped(YAML(typ="rt").load(text)["station"]))


def _refused(name: str, problems: list[Problem]) -> UserError:
    told = "".join(f"\n  {problem}" for problem in problems)
    count = "one problem" if len(problems) == 1 else f"{len(problems)} problems"
    return UserError(f"{count}:{told}", name)


def _wrong_units(
    mapping: Mapping, station: Station
) -> Iterator[tuple[tuple[int | str, ...], str]]:
    """Units that cannot be those of what a number is taken for, with their keys."""
    read = _dimensions_read(station)
    for k, signal in enumerate(mapping.signals):
        topic = absolute(signal.topic)
        allowed = read.get(topic)
        if allowed and _DIMENSIONS.get(signal.unit, "") not in allowed | _RAW:
            fault = f"'{signal.unit}' is no unit of the {' or '.join(sorted(allowed))} of {topic}"
            yield ("signals", k, "unit"), fault
    speeds: list[tuple[tuple[int | str, ...], Source]] = [
        (("vectors", k, "speed", "unit"), vector.speed) for k, vector in enumerate(mapping.vectors)
    ]
    if mapping.platform is not None:
        speeds.append((("platform", "speed", "unit"), mapping.platform.speed))
    for path, source in speeds:
        if _DIMENSIONS.get(source.unit, "speed") != "speed":
            yield path, f"'{source.unit}' is no unit of a speed"


def _dimensions_read(station: Station) -> dict[str, set[str]]:
    """What the station takes from each topic: dimensions by its absolute name."""
    found: dict[str, set[str]] = {}

    def add(source: Input | None, *dimensions: str) -> None:
        if source is not None:
            found.setdefault(absolute(source.topic), set()).update(dimensions)

    for entry in station.instruments:
        if isinstance(entry, Rotor):
            add(entry.pulses, "speed", "frequency", "angle")
        elif isinstance(entry, Vane):
            add(entry.joint_states, "angle")
        else:
            add(entry.azimuth, "angle")
            add(entry.elevation, "angle")
    add(station.air.temperature, "temperature")
    add(station.air.pressure, "pressure")
    return found


def _dumped(node: Any) -> str:
    stream = StringIO()
    yaml = YAML(typ="rt")
    yaml.width = 100
    yaml.dump(node, stream)
    return stream.getvalue()
