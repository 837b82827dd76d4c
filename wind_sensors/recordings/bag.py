"""Raw messages of a ROS 2 bag, grouped by topic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from rosbags.interfaces import (
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
    QosDurability,
)
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from wind_sensors.errors import UserError
from wind_sensors.recordings.file_order import set_back, written_times
from wind_sensors.recordings.salvage import salvage

_SUFFIXES = (".mcap", ".db3")


@dataclass
class TopicData:
    """Serialised messages of one topic: by time of recording, or where the recorder's clock was set
    back, in the order of the file.

    Attributes:
        message_type: E.g. `std_msgs/msg/Header`.
        log_time: Time of recording of each message [ns].
        raw: The messages in CDR.
        count: Messages in the bag, whether they were read or not.
        latched: A publisher kept its messages for subscribers that came late (transient local).
    """

    message_type: str
    log_time: list[int] = field(default_factory=list)
    raw: list[bytes] = field(default_factory=list)
    count: int = 0
    latched: bool = False


@dataclass
class BagContent:
    """What was read from a bag.

    Attributes:
        topics: By name.
        types: Definitions of all the types in the bag.
        notes: What was wrong with the bag.
        salvaged: The bag is damaged, and this is what is left of it.
    """

    topics: dict[str, TopicData]
    types: Typestore
    notes: list[str] = field(default_factory=list)
    salvaged: bool = False

    def topic(self, name: str, message_type: str, definition: MessageDefinition) -> TopicData:
        """The data of a topic, new where there is none; its type becomes known."""
        data = self.topics.get(name)
        if data is None:
            data = self.topics[name] = TopicData(message_type)
            _register(self.types, message_type, definition)
        return data


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """Message definitions of the current ROS 2 distribution; not to be added to."""
    return get_typestore(Stores.ROS2_JAZZY)


def read_bag(path: Path, wanted: Callable[[str], bool] = lambda topic: True) -> BagContent:
    """The messages of a bag, or those that are left of a damaged one.

    Args:
        path: Bag folder or a single .mcap or .db3 file.
        wanted: Whether a topic's messages are to be read; the other topics stay empty.

    Raises:
        UserError: Nothing can be read.
    """
    try:
        return _read(path, wanted)
    except Exception as problem:
        # A bag can be broken in any way; what its reader raises then is not specified.
        content = _salvaged(path, wanted, problem)
    if not any(data.count for data in content.topics.values()):
        reason = content.notes[0] if content.notes else "it holds no messages"
        raise UserError(
            f"the bag cannot be read: {reason}.",
            str(path),
            "Give a ROS 2 bag: a folder with metadata.yaml, or a .mcap or .db3 file.",
        )
    return content


def _read(path: Path, wanted: Callable[[str], bool]) -> BagContent:
    content = BagContent({}, get_typestore(Stores.ROS2_JAZZY))
    with Reader(path) as reader:
        appenders = {}
        for connection in reader.connections:
            data = content.topic(connection.topic, connection.msgtype, connection.msgdef)
            data.count += connection.msgcount
            assert isinstance(connection.ext, ConnectionExtRosbag2)
            data.latched |= _is_latched(connection.ext.offered_qos_profiles)
            appenders[connection.id] = (data.log_time.append, data.raw.append)
        chosen = [c for c in reader.connections if wanted(c.topic)]
        if not chosen:
            return content
        for connection, time, raw in reader.messages(connections=chosen):
            add_time, add_raw = appenders[connection.id]
            add_time(time)
            add_raw(raw)
    _restore_order(path, content)
    return content


def _restore_order(path: Path, content: BagContent) -> None:
    """Put messages in the order of the file where the recorder's clock was set back."""
    try:
        written = written_times(path)
    except Exception:
        # The bag could be read; its order alone is not worth giving it up.
        return
    told: tuple[int, str] = (0, "")
    for name, data in content.topics.items():
        time = written.get(name)
        if time is None or len(time) != len(data.raw):
            continue
        back = set_back(time)
        if not back.size:
            continue
        place = np.argsort(time, kind="stable")
        raw = dict(zip(place.tolist(), data.raw, strict=True))
        data.raw = [raw[index] for index in range(len(time))]
        data.log_time = time.tolist()
        first = int(back[0])
        by, at = int(time[first - 1] - time[first]), int(time[first - 1] - time[0])
        times = "" if back.size == 1 else f", {back.size} times in all"
        note = (
            f"the recorder's clock went back by {by * 1e-9:.1f} s at {at * 1e-9:.1f} s{times}: the "
            "messages stand in the order of the file"
        )
        told = max(told, (len(time), note))
    if told[1]:
        content.notes.append(told[1])


def _salvaged(path: Path, wanted: Callable[[str], bool], problem: Exception) -> BagContent:
    """What is left of a bag that its reader refuses."""
    files = [path] if path.is_file() else sorted(p for s in _SUFFIXES for p in path.glob(f"*{s}"))
    content = BagContent({}, get_typestore(Stores.ROS2_JAZZY), salvaged=True)
    if not files:
        reason = problem.strerror if isinstance(problem, OSError) else None
        content.notes.append(f"{reason or problem}".rstrip("."))
    for file in files:
        found = salvage(file)
        for message in sorted(found.messages, key=lambda message: message.time):
            channel = message.channel
            data = content.topic(channel.topic, channel.message_type, channel.definition)
            data.count += 1
            data.latched |= _is_latched(channel.offered)
            if wanted(channel.topic):
                data.log_time.append(message.time)
                data.raw.append(message.raw)
        count = len(found.messages)
        faults = "; ".join(dict.fromkeys(found.faults)) or "the bag has no usable metadata.yaml"
        if count:
            times = [message.time for message in found.messages]
            span = (max(times) - min(times)) * 1e-9
            content.notes.append(f"{file.name}: {faults}; {count} messages over {span:.1f} s read")
        else:
            content.notes.append(f"{file.name}: {faults}")
    return content


def _is_latched(offered: Sequence[Qos]) -> bool:
    return any(one.durability == QosDurability.TRANSIENT_LOCAL for one in offered)


def _register(types: Typestore, name: str, definition: MessageDefinition) -> None:
    if name in types.fielddefs or not definition.data:
        return
    if definition.format == MessageDefinitionFormat.IDL:
        found = get_types_from_idl(definition.data)
    else:
        found = get_types_from_msg(definition.data, name)
    types.register({key: value for key, value in found.items() if key not in types.fielddefs})
