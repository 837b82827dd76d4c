"""Raw messages of a ROS 2 bag, grouped by topic."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from wind_sensors.errors import UserError


@dataclass
class TopicData:
    """Serialised messages of one topic in the order of the bag.

    Attributes:
        message_type: E.g. `std_msgs/msg/Header`.
        log_time: Time of recording of each message [ns].
        raw: The messages in CDR.
    """

    message_type: str
    log_time: list[int] = field(default_factory=list)
    raw: list[bytes] = field(default_factory=list)


@dataclass
class BagContent:
    """What was read from a bag.

    Attributes:
        topics: By name.
        types: Definitions of all the types in the bag.
        notes: What was wrong with the bag.
    """

    topics: dict[str, TopicData]
    types: Typestore
    notes: list[str] = field(default_factory=list)


def typestore() -> Typestore:
    """Message definitions of the current ROS 2 distribution."""
    return get_typestore(Stores.ROS2_JAZZY)


def read_bag(path: Path) -> BagContent:
    """All messages of a bag.

    Args:
        path: Bag folder or a single .mcap or .db3 file.

    Raises:
        UserError: Nothing can be read.
    """
    types = typestore()
    topics: dict[str, TopicData] = {}
    try:
        with Reader(path) as reader:
            for connection in reader.connections:
                topics[connection.topic] = TopicData(connection.msgtype)
                _register(types, connection.msgtype, connection.msgdef)
            appenders = {
                c.id: (topics[c.topic].log_time.append, topics[c.topic].raw.append)
                for c in reader.connections
            }
            for connection, time, data in reader.messages():
                add_time, add_raw = appenders[connection.id]
                add_time(time)
                add_raw(data)
    except Exception as problem:
        raise UserError(
            f"the bag cannot be read ({problem}).", str(path), "Give a ROS 2 bag (mcap or sqlite3)."
        ) from problem
    return BagContent(topics, types)


def _register(types: Typestore, name: str, definition: MessageDefinition) -> None:
    if name in types.fielddefs or not definition.data:
        return
    if definition.format == MessageDefinitionFormat.IDL:
        found = get_types_from_idl(definition.data)
    else:
        found = get_types_from_msg(definition.data, name)
    types.register({key: value for key, value in found.items() if key not in types.fielddefs})
