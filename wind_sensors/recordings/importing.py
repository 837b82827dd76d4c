"""Tables and NMEA logs become recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.motion.frames import velocity_from_direction, wrap, yaw_from_compass
from wind_sensors.recordings import nmea
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.columns import read_table, read_text
from wind_sensors.recordings.mapping import (
    UNITS,
    Mapping,
    MappingFile,
    PlatformSource,
    Signal,
    Source,
    Vector,
)
from wind_sensors.recordings.raw_topics import BODY_FRAME, running_time
from wind_sensors.recordings.reading import station_topics
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.recordings.writing import write_topics
from wind_sensors.station.inputs import DEFAULT_FIELDS, FieldPath, absolute, field_path, full_type
from wind_sensors.station.model import Station
from wind_sensors.station.signals import FloatArray, TimeArray

EARTH_RADIUS = 6_371_008.8
"""Mean radius [m]; positions of one recording lie close together."""

ALIKE = 0.8
"""A recording may hold what its station does not read; a name so much like one that it does read,
and that nothing is written to, is a slip."""
_WORST_FRACTION = 0.1
"""A pulse count this far from a whole number is none."""
_NEAREST_FIX = 3_000_000_000
"""A platform state needs a heading at most this far away [ns]."""


class Samples(NamedTuple):
    """Values of one source in the messages' unit; shape (n,) each."""

    time: TimeArray
    value: FloatArray


@dataclass(frozen=True)
class Imported:
    """What an import made.

    Attributes:
        topics: Messages by topic.
        faults: What was left out and why, with its number.
        notes: What else people should know.
    """

    topics: tuple[TopicMessages, ...]
    faults: Counter[str]
    notes: tuple[str, ...]


@dataclass
class _Topic:
    """Messages under construction."""

    message_type: str
    time: TimeArray
    columns: dict[FieldPath, npt.NDArray[Any]] = field(default_factory=dict)


def import_files(
    files: Sequence[Path],
    mapping_file: MappingFile,
    advance: Callable[[Path], None] = lambda path: None,
) -> Imported:
    """Turn files into messages.

    Args:
        files: Tables or logs of one format, in any order.
        mapping_file: How to read them.
        advance: Called after each file.

    Raises:
        UserError: A file has not the stated format, or nothing in it fits the mapping.
    """
    mapping = mapping_file.mapping
    faults: Counter[str] = Counter()
    notes: list[str] = []
    read: list[dict[int, Samples]] = []
    delay = 0
    if mapping.time.mark == "start":
        delay = round(mapping_file.station.recording.averaging_time * 1e9)
    for file in files:
        if mapping.format == "nmea0183":
            read.append(_nmea_samples(file, mapping, faults))
        else:
            read.append(_table_samples(file, mapping, delay, faults, notes))
        advance(file)
    sources = mapping.sources
    merged = {
        id(source): _joined([part[id(source)] for part in read], source, faults)
        for source in sources
    }
    if not any(len(samples.time) for samples in merged.values()):
        raise UserError(
            "nothing in the files fits the mapping.",
            ", ".join(str(file) for file in files),
            " ".join(
                (*([f"Left out: {describe(faults)}."] if faults else []), *(f"{n}." for n in notes))
            ),
        )
    builder = _Builder(mapping_file.station.recording.frame, faults)
    for signal in mapping.signals:
        builder.add_signal(signal, merged[id(signal)])
    for vector in mapping.vectors:
        builder.add_vector(vector, merged[id(vector.speed)], merged[id(vector.direction_from)])
    if mapping.platform is not None:
        builder.add_platform(mapping.platform, merged)
    topics = tuple(builder.messages())
    notes += [*builder.notes, *_misspelt(mapping, mapping_file.station)]
    return Imported(topics, faults, tuple(notes))


def _misspelt(mapping: Mapping, station: Station) -> Iterator[str]:
    """What is said about topics of a mapping that its station seems to know by another name."""
    written = {absolute(topic) for topic in mapping.topics}
    read = station_topics(station)
    for topic in sorted(written - read):
        for meant in get_close_matches(topic, read - written, n=1, cutoff=ALIKE):
            yield f"{topic}: nothing in `station` reads it (did you mean {meant}?)"


def write_imported(
    folder: Path, imported: Imported, mapping_file: MappingFile, *, force: bool = False
) -> Path:
    """Write what was imported as a recording.

    Its station file is the mapping's `station` with the first stamp as `recording.start`.
    """
    first = min(int(topic.time[0]) for topic in imported.topics)
    start = f"{np.datetime_as_string(np.datetime64(first, 'ns'), unit='ms')}Z"
    text = mapping_file.station_text_with_start(start)
    return write_topics(folder, text, imported.topics, force=force)


def describe(faults: Counter[str]) -> str:
    """The faults in words: `3 lines without a readable time, ...`."""
    return ", ".join(f"{count} {what}" for what, count in faults.most_common()) or "nothing"


def _table_samples(
    file: Path, mapping: Mapping, delay: int, faults: Counter[str], notes: list[str]
) -> dict[int, Samples]:
    table = read_table(file, mapping)
    faults.update(table.faults)
    notes += table.notes
    time = table.time + delay
    out: dict[int, Samples] = {}
    for source in mapping.sources:
        raw = table.values[source.column]
        good = np.isfinite(raw)
        good &= ~_impossible(source, raw, mapping, faults)
        out[id(source)] = Samples(time[good], in_message_units(source, raw[good]))
    return out


def _nmea_samples(file: Path, mapping: Mapping, faults: Counter[str]) -> dict[int, Samples]:
    log = nmea.read_log(read_text(file).splitlines(), mapping.talkers)
    faults.update(log.faults)
    out: dict[int, Samples] = {}
    for source in mapping.sources:
        time, raw, empty = nmea.samples(log, source)
        if empty:
            faults[f"{source.sentence} without field {source.value}"] += empty
        good = ~_impossible(source, raw, mapping, faults)
        out[id(source)] = Samples(time[good], in_message_units(source, raw[good]))
    return out


def _impossible(
    source: Source, raw: FloatArray, mapping: Mapping, faults: Counter[str]
) -> npt.NDArray[np.bool_]:
    """Directions beyond a turn and speeds of winds and platforms below nought, shape (n,).

    A rotor's speed may be below nought by the error of an analogue output's zero.
    """
    if source.direction or any(source is vector.direction_from for vector in mapping.vectors):
        wrong = np.abs(raw) > (2.0 * np.pi if source.unit == "rad" else 360.0)
        what = "directions of more than a turn in"
    elif any(source is speed for speed in mapping.speeds):
        wrong = raw < 0.0
        what = "speeds below nought in"
    else:
        return np.zeros(raw.size, dtype=np.bool_)
    if wrong.any():
        faults[f"{what} {_name_of(source)}"] += int(np.count_nonzero(wrong))
    return np.asarray(wrong)


def _name_of(source: Source) -> str:
    return source.column or f"{source.sentence} field {source.value}"


def in_message_units(source: Source, raw: FloatArray) -> FloatArray:
    """SI values (temperatures in deg C) of the numbers in a file.

    Directions that the wind comes from become the heading of a vane's nose, counter-clockwise from
    the sensor's x axis [rad]: east for `from_north`, forward for `from_bow`.
    """
    if source.direction == "from_north":
        return yaw_from_compass(raw)
    if source.direction == "from_bow":
        return np.asarray(wrap(np.radians(-raw)), dtype=np.float64)
    factor, offset = UNITS[source.unit]
    return np.asarray(raw * factor + offset, dtype=np.float64)


def _joined(parts: Sequence[Samples], source: Source, faults: Counter[str]) -> Samples:
    """The samples of all the files in order of time; of the same instant the first counts."""
    time = np.concatenate([part.time for part in parts])
    value = np.concatenate([part.value for part in parts])
    _, first = np.unique(time, return_index=True)
    repeated = len(time) - len(first)
    if repeated:
        faults[f"values of {_name_of(source)} at an instant that has one already"] += repeated
    return Samples(time[first], value[first])


class _Builder:
    """Collects the fields of the messages."""

    def __init__(self, frame: str, faults: Counter[str]) -> None:
        self.faults = faults
        self._frame = frame
        self.notes: list[str] = []
        self._topics: dict[str, _Topic] = {}
        self._types = typestore()

    def add_signal(self, signal: Signal, samples: Samples) -> None:
        message_type = full_type(signal.type)
        path = field_path(signal.field or DEFAULT_FIELDS.get(message_type, "data"))
        if signal.pulses is not None:
            samples = self._counts(signal, samples)
        self._put(signal.topic, message_type, samples.time, {path: samples.value})

    def add_vector(self, vector: Vector, speed: Samples, direction: Samples) -> None:
        time, ours, theirs = np.intersect1d(speed.time, direction.time, return_indices=True)
        degrees = np.degrees(direction.value[theirs])
        velocity = velocity_from_direction(speed.value[ours], degrees)
        message_type = full_type(vector.type)
        base = field_path(DEFAULT_FIELDS.get(message_type, "vector"))
        columns: dict[FieldPath, npt.NDArray[Any]] = {
            (*base, axis): velocity[:, index] for index, axis in enumerate("xyz")
        }
        self._put(vector.topic, message_type, time, columns)

    def add_platform(self, platform: PlatformSource, found: dict[int, Samples]) -> None:
        speed, course = found[id(platform.speed)], found[id(platform.course)]
        heading = found[id(platform.heading)]
        time, ours, theirs = np.intersect1d(speed.time, course.time, return_indices=True)
        if not len(time) or not len(heading.time):
            self.notes.append(f"{platform.topic}: no heading with a course and a speed")
            return
        yaw, near = _nearest(yaw_from_compass(np.degrees(heading.value)), heading.time, time)
        if not near.all():
            self.faults["fixes without a heading near them"] += int(np.count_nonzero(~near))
        over_ground = course.value[theirs]
        magnitude = speed.value[ours]
        columns: dict[FieldPath, npt.NDArray[Any]] = {
            ("pose", "pose", "orientation", "z"): np.sin(0.5 * yaw),
            ("pose", "pose", "orientation", "w"): np.cos(0.5 * yaw),
            ("twist", "twist", "linear", "x"): magnitude * np.sin(over_ground),
            ("twist", "twist", "linear", "y"): magnitude * np.cos(over_ground),
            ("twist", "twist", "angular", "z"): _rate(time, yaw),
        }
        if platform.latitude is not None and platform.longitude is not None:
            latitude, longitude = found[id(platform.latitude)], found[id(platform.longitude)]
            if len(latitude.time) and len(longitude.time):
                north = np.interp(time, latitude.time, np.radians(latitude.value))
                east = np.interp(time, longitude.time, np.radians(longitude.value))
                columns["pose", "pose", "position", "x"] = (
                    EARTH_RADIUS * np.cos(north[0]) * (east - east[0])
                )
                columns["pose", "pose", "position", "y"] = EARTH_RADIUS * (north - north[0])
        kept = {path: values[near] for path, values in columns.items()}
        self._put(platform.topic, "nav_msgs/msg/Odometry", time[near], kept)

    def messages(self) -> list[TopicMessages]:
        """The messages of all topics."""
        found = []
        for topic, content in self._topics.items():
            fields = dict(self._types.fielddefs[content.message_type][1])
            texts: dict[FieldPath, str] = {}
            columns = dict(content.columns)
            if "header" in fields:
                columns["header", "stamp"] = content.time
                earth = {"vector", "twist"} & set(fields)
                texts["header", "frame_id"] = self._frame if earth else topic.strip("/")
            if "child_frame_id" in fields:
                texts["child_frame_id",] = BODY_FRAME
            if content.message_type == "sensor_msgs/msg/JointState":
                texts.update({("name", *path[1:]): topic for path in content.columns})
            if not len(content.time):
                self.notes.append(f"{topic}: no messages")
                continue
            blank = template(self._types, content.message_type, list(columns), texts)
            raw = serialised(self._types, blank, columns)
            time = running_time(content.time)
            found.append(TopicMessages(topic, content.message_type, time, raw))
        return found

    def _put(
        self,
        topic: str,
        message_type: str,
        time: TimeArray,
        columns: dict[FieldPath, npt.NDArray[Any]],
    ) -> None:
        """Add fields to a topic; instants that lack one of its fields are left out."""
        topic = absolute(topic)
        content = self._topics.get(topic)
        if content is None:
            template(self._types, message_type, list(columns))
            self._topics[topic] = _Topic(message_type, time, dict(columns))
            return
        if content.message_type != message_type:
            raise UserError(
                f"{topic} is given two types ({content.message_type} and {message_type}).",
                remedy="Give each type a topic of its own in the mapping.",
            )
        common, ours, theirs = np.intersect1d(content.time, time, return_indices=True)
        content.columns = {path: values[ours] for path, values in content.columns.items()}
        content.columns.update({path: values[theirs] for path, values in columns.items()})
        content.time = common

    def _counts(self, signal: Signal, samples: Samples) -> Samples:
        """Running count of the pulses that the logger's speeds stand for."""
        assert signal.pulses is not None
        exact = (samples.value - signal.pulses.offset) / signal.pulses.scale
        whole = np.maximum(np.rint(exact), 0.0)
        odd = (np.abs(exact - whole) > _WORST_FRACTION) & (samples.value != 0.0)
        if odd.any():
            what = f"values of {signal.column} that are no whole number of pulses"
            self.faults[what] += int(np.count_nonzero(odd))
        return Samples(samples.time, np.cumsum(whole))


def _nearest(
    value: FloatArray, known: TimeArray, time: TimeArray
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Angle at the known instant nearest to each time, and whether that is near enough."""
    right = np.clip(np.searchsorted(known, time), 0, len(known) - 1)
    left = np.maximum(right - 1, 0)
    before = np.abs(time - known[left]) <= np.abs(known[right] - time)
    pick = np.where(before, left, right)
    near: npt.NDArray[np.bool_] = np.abs(known[pick] - time) <= _NEAREST_FIX
    return value[pick], near


def _rate(time: TimeArray, yaw: FloatArray) -> FloatArray:
    """Turning rate [rad/s] by central differences; zero across gaps."""
    if len(time) < 3:
        return np.zeros(len(time))
    seconds = (time - time[0]) * 1e-9
    rate = np.gradient(np.unwrap(yaw), seconds)
    gap = np.gradient(seconds) > _NEAREST_FIX * 1e-9
    return np.where(gap, 0.0, rate)
