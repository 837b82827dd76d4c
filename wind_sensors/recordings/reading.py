"""From a bag to the signals of a station."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel

from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import BagContent, TopicData, read_bag
from wind_sensors.recordings.fields import batches, columns, leaf, stamps, texts
from wind_sensors.recordings.file_order import SET_BACK
from wind_sensors.recordings.platform import platform_states
from wind_sensors.recordings.plausible import (
    dropout_note,
    dropouts,
    impossible,
    impossible_note,
    restart_note,
    stray_note,
    strays,
)
from wind_sensors.recordings.raw_topics import TRUTH_TOPIC
from wind_sensors.recordings.station_files import load_station
from wind_sensors.station.inputs import (
    AIR_RANGES,
    AirSignal,
    FieldPath,
    Signal,
    absolute,
    angle_inputs,
    angles_from_raw,
    field_path,
    is_plausible,
    joint_doubt,
    resolved,
    scaled,
    turns_from_raw,
)
from wind_sensors.station.model import Cup, Input, Propeller, Station
from wind_sensors.station.signals import (
    Angles,
    FloatArray,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    TimeArray,
    Winds,
)

STATION_FILE = "recording.yaml"
BAG_FOLDER = "bag"
YAML_SUFFIXES = (".yaml", ".yml")
WIND_TOPIC = "/wind"
WIND_TYPE = "geometry_msgs/msg/TwistWithCovarianceStamped"
Mask = npt.NDArray[np.bool_]


def read_recording(path: str | Path, station_file: str | Path | None = None) -> Recording:
    """Read a recording.

    Args:
        path: Folder with `recording.yaml` and `bag/`, or a bag (then `station_file` is needed,
            unless the bag is that of such a folder).
        station_file: Station file that replaces the recording's own.

    Returns:
        The station and its signals; what was wrong with them is in `notes`.

    Raises:
        UserError: There is no such recording, its bag or its station file cannot be read, or the
            bag has none of the station's topics.
    """
    content, station = open_recording(path, station_file)
    return signals_of(content, station, name_of(path), str(path))


def open_recording(
    path: str | Path, station_file: str | Path | None = None
) -> tuple[BagContent, Station]:
    """The messages of a recording's station topics, and the station.

    Raises:
        UserError: As in `read_recording`.
    """
    folder = Path(path)
    if not folder.exists():
        raise UserError("there is no such recording.", str(path), "Check the path.")
    if folder.is_file() and folder.suffix in YAML_SUFFIXES:
        raise UserError(
            "this is a YAML file and no recording.",
            str(path),
            f"Give a folder with {STATION_FILE} and {BAG_FOLDER}/, or a bag with --station FILE.",
        )
    bag = bag_of(folder)
    if bag.is_dir() and not any(bag.iterdir()):
        raise UserError(
            "this folder is empty.",
            str(bag),
            f"Give a folder with {STATION_FILE} and {BAG_FOLDER}/, or a ROS 2 bag.",
        )
    own_file = home_of(folder) / STATION_FILE
    if station_file is None and not own_file.exists():
        raise UserError(
            f"there is no {STATION_FILE} beside the bag.",
            str(path),
            "Name the station file with --station FILE.",
        )
    station = load_station(own_file if station_file is None else station_file)
    topics = station_topics(station)
    content = read_bag(bag, lambda topic: topic in topics or topic.endswith(TRUTH_TOPIC))
    return content, station


def home_of(path: Path) -> Path:
    """The recording folder that a path stands for: itself, or the one around its bag."""
    path = path.absolute()
    for bag in (path, path.parent):
        if bag.name == BAG_FOLDER and (bag.parent / STATION_FILE).exists():
            return bag.parent
    return path


def name_of(path: str | Path) -> str:
    """The name of a recording, as text that can be written whatever the locale's encoding."""
    name = home_of(Path(path)).name or Path(path).resolve().name
    return os.fsencode(name).decode("utf-8", "replace")


def bag_of(folder: Path) -> Path:
    """The bag of a recording folder, or the path itself."""
    return folder / BAG_FOLDER if (folder / BAG_FOLDER).exists() else folder


def read_series(path: str | Path, topic: str, field_name: str = "data") -> Series:
    """Any number in a recording's bag, e.g. the deviation of a mean that was imported.

    Args:
        path: Recording folder or bag.
        topic: Topic; a relative name counts from the root.
        field_name: Numeric field.

    Raises:
        UserError: The bag has no such topic or field.
    """
    topic = absolute(topic)
    content = read_bag(bag_of(Path(path)), lambda name: name == topic)
    data = content.topics.get(topic)
    if data is None:
        known = ", ".join(sorted(content.topics))
        raise UserError(f"there is no topic {topic}.", str(path), f"Topics: {known}.")
    source = Input(topic=topic, type=data.message_type, field=field_name)
    found = _SignalReader(content, str(path)).series(source, "temperature")
    nothing = Series(np.empty(0, dtype=np.int64), np.empty(0))
    return nothing if found is None else found


def read_estimates(path: str | Path) -> tuple[TimeArray, FloatArray, FloatArray] | None:
    """The corrected wind in a processed recording.

    Args:
        path: Recording folder or bag.

    Returns:
        Time [ns], velocity east, north, up [m/s] of shape (n, 3) and the variance of each
        component [m^2/s^2]; None where the recording has no topic `wind`.
    """
    content = read_bag(bag_of(Path(path)), lambda name: name == WIND_TOPIC)
    data = content.topics.get(WIND_TOPIC)
    if data is None or data.message_type != WIND_TYPE or not data.raw:
        return None
    paths: list[FieldPath] = [("twist", "twist", "linear", axis) for axis in ("x", "y", "z")]
    paths += [("twist", "covariance", index) for index in (0, 7, 14)]
    found = np.stack(columns(data.raw, content.types, WIND_TYPE, paths), axis=-1)
    time = stamps(data.raw, content.types, WIND_TYPE, ("header", "stamp"))
    return time, found[:, :3], found[:, 3:]


def station_topics(station: Station) -> set[str]:
    """Every topic that the station's inputs name."""
    found: set[str] = set()

    def visit(node: object) -> None:
        if isinstance(node, Input):
            found.add(absolute(node.topic))
        elif isinstance(node, BaseModel):
            for name in type(node).model_fields:
                visit(getattr(node, name))
        elif isinstance(node, tuple):
            for item in node:
                visit(item)

    visit(station)
    return found


def signals_of(content: BagContent, station: Station, name: str, where: str) -> Recording:
    """Signals of a station from the messages of a bag.

    Args:
        content: The bag.
        station: The station.
        name: Name of the recording.
        where: For messages.

    Raises:
        UserError: No topic of any instrument is in the bag, or a field does not exist.
    """
    reader = _SignalReader(content, where, list(content.notes))
    pulses: dict[str, Pulses] = {}
    angles: dict[str, Angles] = {}
    for instrument in station.instruments:
        if isinstance(instrument, (Cup, Propeller)):
            rotor_pulses = reader.pulses(instrument)
            if rotor_pulses is not None:
                pulses[instrument.name] = rotor_pulses
        else:
            for signal, source in angle_inputs(instrument).items():
                readings = reader.angles(signal, source, instrument.kind)
                if readings is not None:
                    angles[signal] = readings
    reference = reader.winds(station.reference.topic) if station.reference else None
    if not pulses and not angles and reference is None:
        raise UserError(
            "the bag has none of the station's topics.",
            where,
            f"Topics in the bag: {', '.join(sorted(content.topics)) or 'none'}.",
        )
    truth_topic = next((t for t in content.topics if t.endswith(TRUTH_TOPIC)), None)
    truth = reader.winds(Input(topic=truth_topic)) if truth_topic else None
    platform, platform_velocity = platform_states(station, content, reader.notes)
    temperature = reader.air(station.air.temperature, "temperature")
    pressure = reader.air(station.air.pressure, "pressure")
    start, stop = _span(content, pulses, angles, reference, platform)
    return Recording(
        name=name,
        station=station,
        start=start,
        stop=stop,
        pulses=pulses,
        angles=angles,
        reference=reference,
        platform=platform,
        platform_velocity=platform_velocity,
        temperature=temperature,
        pressure=pressure,
        truth=truth,
        truth_topic=truth_topic or "",
        notes=tuple(reader.notes),
    )


@dataclass
class _SignalReader:
    """Reads one signal after the other and collects the notes."""

    content: BagContent
    where: str
    notes: list[str] = field(default_factory=list)

    def pulses(self, rotor: Cup | Propeller) -> Pulses | None:
        source = resolved(rotor.pulses, "pulses")
        data = self._topic(source, f"the pulses of '{rotor.name}'")
        if data is None:
            return None
        path = field_path(source.field)
        if source.meaning == "edges":
            found, lost = batches(data.raw, self.content.types, data.message_type, path)
            if lost:
                self.notes.append(f"{source.topic}: {lost} times are not numbers and were left out")
            time = np.concatenate([np.empty(0, dtype=np.int64), *found])
            time = time[self._near(source.topic, time)]
            self._note_order(source.topic, time)
            return Pulses(time)
        if source.meaning == "edge":
            time = stamps(data.raw, self.content.types, data.message_type, path)
            time = time[self._stamped(source.topic, time)]
            time = time[self._near(source.topic, time)]
            self._note_order(source.topic, time)
            return Pulses(time)
        self._doubt_joint(source, data, rotor.name, rotor.kind)
        time, raw = self._numbers(source, data, path)
        counted = turns_from_raw(source, rotor, time.tolist(), raw.tolist())
        if counted.restarts:
            self.notes.append(restart_note(source.topic, raw, counted.restarts))
        if counted.jumps:
            first = counted.jumps[0]
            at = (int(time[first]) - int(time[0])) * 1e-9
            self.notes.append(
                f"{source.topic}: {len(counted.jumps)} steps that no wind turns '{rotor.name}' to "
                f"were left out (the first at {at:.3f} s, from {raw[first - 1]:g} to "
                f"{raw[first]:g}); check `modulus`, or the source has restarted"
            )
        if source.meaning == "value":
            dropped = dropouts(time, scaled(source, raw))
            if dropped.any():
                self.notes.append(dropout_note(source.topic, dropped))
        return Pulses(time, counted.turns)

    def angles(self, signal: str, source: Input, kind: str) -> Angles | None:
        data = self._topic(source, f"the angle of '{signal}'")
        if data is None:
            return None
        self._doubt_joint(source, data, signal, kind)
        time, raw = self._numbers(source, data, field_path(source.field))
        return Angles(time, angles_from_raw(source, raw))

    def _doubt_joint(self, source: Input, data: TopicData, signal: str, kind: str) -> None:
        """Note where the first message's joints have other names than what is read of them."""
        if source.type == "sensor_msgs/msg/JointState":
            names = texts(data.raw[0], self.content.types, source.type, "name")
            doubt = joint_doubt(source, signal, kind, names)
            if doubt:
                self.notes.append(doubt)

    def series(self, stated: Input | None, signal: Signal) -> Series | None:
        if stated is None:
            return None
        source = resolved(stated, signal)
        data = self._topic(source, f"the air's {signal}")
        if data is None:
            return None
        time, raw = self._numbers(source, data, field_path(source.field))
        return Series(time, scaled(source, raw))

    def air(self, stated: Input | None, signal: AirSignal) -> Series | None:
        """Temperature or pressure; what the air cannot have is left out, as if not measured."""
        found = self.series(stated, signal)
        if found is None or stated is None:
            return None
        plausible = is_plausible(signal, found.value)
        bad = int(np.count_nonzero(~plausible))
        if bad:
            limits = AIR_RANGES[signal]
            self.notes.append(
                f"{stated.topic}: {bad} of {len(found.value)} values are no {signal} of the air in "
                f"{limits.unit} and were left out (the first: {found.value[~plausible][0]:g}); "
                f"{limits.remedy} in the station file"
            )
        return Series(found.time[plausible], found.value[plausible]) if plausible.any() else None

    def winds(self, stated: Input) -> Winds | None:
        source = resolved(stated, "wind")
        data = self._topic(source, "the wind")
        if data is None:
            return None
        base = field_path(source.field)
        paths: list[FieldPath] = [(*base, axis) for axis in ("x", "y", "z")]
        for path in paths:
            self._check(source, data, path)
        raw = np.stack(columns(data.raw, self.content.types, data.message_type, paths), axis=-1)
        time = self._time(data)
        keep = self._finite(source.topic, np.all(np.isfinite(raw), axis=-1), time)
        keep &= self._near(source.topic, time)
        velocity = scaled(source, raw)
        wrong = keep & impossible(velocity)
        if wrong.any():
            self.notes.append(impossible_note(source.topic, wrong))
        keep &= ~wrong
        self._note_order(source.topic, time[keep])
        return Winds(time[keep], velocity[keep])

    def _topic(self, source: Input, purpose: str) -> TopicData | None:
        data = self.content.topics.get(absolute(source.topic))
        if data is None or not data.raw:
            hint = "" if data is not None else self._instead_of(absolute(source.topic))
            self.notes.append(f"{source.topic}: no messages ({purpose}){hint}")
            return None
        if data.message_type != source.type:
            raise UserError(
                f"{source.topic} carries {data.message_type}, but the station file expects "
                f"{source.type} there.",
                self.where,
                f"Write `{{topic: {source.topic}, type: {data.message_type}, field: ...}}`.",
            )
        return data

    def _instead_of(self, topic: str) -> str:
        """What the bag has where a topic is misspelt, as the end of a sentence."""
        known = sorted(self.content.topics)
        close = get_close_matches(topic, known, n=1, cutoff=0.8)
        if close:
            return f"; no such topic is in the bag: did you mean {close[0]}?"
        return f"; topics in the bag: {', '.join(known)}" if known else ""

    def _numbers(
        self, source: Input, data: TopicData, path: FieldPath
    ) -> tuple[TimeArray, FloatArray]:
        self._check(source, data, path)
        (raw,) = columns(data.raw, self.content.types, data.message_type, [path])
        time = self._time(data)
        keep = self._finite(source.topic, np.isfinite(raw), time)
        keep &= self._near(source.topic, time)
        self._note_order(source.topic, time[keep])
        return time[keep], raw[keep]

    def _check(self, source: Input, data: TopicData, path: FieldPath) -> None:
        try:
            kind = leaf(self.content.types, data.message_type, path)
        except UserError as problem:
            raise UserError(problem.what, f"{self.where}: {source.topic}", problem.remedy) from None
        if kind.endswith("[]") or "/" in kind or "string" in kind:
            raise UserError(
                f"the field '{source.field}' of {data.message_type} is not a number ({kind}).",
                f"{self.where}: {source.topic}",
                "Name a numeric field, e.g. `position[0]`.",
            )

    def _time(self, data: TopicData) -> TimeArray:
        """Header stamps where the type has a header and fills it, times of recording elsewhere."""
        logged = np.asarray(data.log_time, dtype=np.int64)
        fields = dict(self.content.types.fielddefs[data.message_type][1])
        if "header" not in fields:
            return logged
        stamped = stamps(data.raw, self.content.types, data.message_type, ("header", "stamp"))
        return np.where(stamped == 0, logged, stamped)

    def _stamped(self, topic: str, time: TimeArray) -> Mask:
        present: Mask = time != 0
        missing = int(np.count_nonzero(~present))
        if missing:
            self.notes.append(f"{topic}: {missing} messages without a stamp were left out")
        return present

    def _finite(self, topic: str, finite: Mask, time: TimeArray) -> Mask:
        bad = int(np.count_nonzero(~finite))
        if bad:
            first = (int(time[~finite][0]) - int(time[0])) * 1e-9
            self.notes.append(
                f"{topic}: {bad} of {len(time)} values are not numbers and were left out "
                f"(the first at {first:.3f} s)"
            )
        return finite

    def _near(self, topic: str, time: TimeArray) -> Mask:
        stray = strays(time)
        if stray.any():
            self.notes.append(stray_note(topic, time, stray))
        return ~stray

    def _note_order(self, topic: str, time: TimeArray) -> None:
        self.notes.extend(order_notes(topic, time))


def order_notes(topic: str, time: TimeArray) -> list[str]:
    """What is unusual in the order of stamps: repeated ones, and ones or a clock that go back."""
    step = np.diff(time)
    found = []
    strayed = np.concatenate(([False], step[:-1] > -step[1:] // 2)) if step.size else step < 0
    back = (step < -SET_BACK) & ~strayed
    if back.any():
        first = int(np.flatnonzero(back)[0])
        at = (int(time[first]) - int(time[0])) * 1e-9
        times = int(np.count_nonzero(back))
        found.append(
            f"{topic}: the clock went back by {-step[first] * 1e-9:.1f} s at {at:.3f} s"
            f"{'' if times == 1 else f', {times} times in all'}"
        )
    late = (step < 0) & ~back
    for bad, what in ((step == 0, "repeated"), (late, "earlier than the one before")):
        count = int(np.count_nonzero(bad))
        if count:
            at = (int(time[1:][bad][0]) - int(time[0])) * 1e-9
            found.append(f"{topic}: {count} stamps {what} (the first at {at:.3f} s)")
    return found


def _span(
    content: BagContent,
    pulses: dict[str, Pulses],
    angles: dict[str, Angles],
    reference: Winds | None,
    platform: PlatformStates | None,
) -> tuple[int, int]:
    """First and last stamp of the instruments, or times of recording where there is none."""
    parts: list[TimeArray] = [p.time for p in pulses.values()]
    parts += [a.time for a in angles.values()]
    parts += [part.time for part in (reference, platform) if part is not None]
    parts = [part for part in parts if len(part)]
    if not parts:
        logged = [np.asarray(t.log_time, dtype=np.int64) for t in content.topics.values()]
        parts = [part for part in logged if len(part)]
    if not parts:
        return 0, 0
    return min(int(part.min()) for part in parts), max(int(part.max()) for part in parts)
