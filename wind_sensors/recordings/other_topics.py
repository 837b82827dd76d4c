"""Topics of a bag that are none of the station's, copied into another bag as they are."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from rosbags.interfaces import Connection, ConnectionExtRosbag2
from rosbags.rosbag2 import Reader, Writer

from wind_sensors.recordings.bag import BagContent, read_bag
from wind_sensors.recordings.reading import WIND_TOPIC, WIND_TYPE


class CopiedMessage(NamedTuple):
    """One message for the new bag.

    Attributes:
        time: Time of recording [ns].
        connection: Where it goes to.
        raw: The message in CDR.
    """

    time: int
    connection: Connection
    raw: bytes | memoryview


@dataclass
class OtherTopics:
    """What else a bag holds beside the signals of a station.

    Messages are handed on one at a time, so that images and point clouds need no memory.

    Attributes:
        bag: The bag.
        content: What was read from it.
        station: Topics of the station; they are written from the signals as far as those are
            usable.
        notes: What was not copied, and why; complete once every message was asked for.
    """

    bag: Path
    content: BagContent
    station: Set[str]
    notes: list[str] = field(default_factory=list)

    def into(self, writer: Writer, written: Collection[str]) -> Iterator[CopiedMessage]:
        """The messages in order of time, with connections of a writer.

        Args:
            writer: The new bag, open.
            written: Topics that it has already.
        """
        names = self._copied(written)
        if not names:
            return
        if self.content.salvaged:
            yield from self._salvaged(writer, names)
            return
        try:
            with Reader(self.bag) as reader:
                chosen = [c for c in reader.connections if c.topic in names]
                made = {c.id: self._connection(writer, c) for c in chosen}
                known = [c for c in chosen if made[c.id] is not None]
                for given, time, raw in reader.messages(connections=known) if known else ():
                    connection = made[given.id]
                    if connection is not None:
                        yield CopiedMessage(time, connection, raw)
        except Exception as problem:
            # A bag can be broken in any way; what its reader raises then is not specified. The
            # station's signals could be read, so that their wind is not lost for other messages.
            self.notes.append(f"{self.bag}: topics that are not the station's end early: {problem}")

    def _copied(self, written: Collection[str]) -> set[str]:
        """Topics to copy: neither written from signals, nor what an earlier estimate left."""
        topics = self.content.topics
        done = self.station & set(written)
        others = {name for name in topics if name not in done and topics[name].count}
        before = WIND_TOPIC in topics and topics[WIND_TOPIC].message_type == WIND_TYPE
        replaced = {
            name
            for name in others
            if name in written or (before and name.startswith(f"{WIND_TOPIC}/"))
        }
        if replaced:
            self.notes.append(
                f"not copied, this estimate's own topics take their place: "
                f"{', '.join(sorted(replaced))}"
            )
        return others - replaced

    def _connection(self, writer: Writer, given: Connection) -> Connection | None:
        """The writer's connection of a topic; publishers with the same offers share one."""
        assert isinstance(given.ext, ConnectionExtRosbag2)
        for made in writer.connections:
            if (made.topic, made.msgtype, made.ext) == (given.topic, given.msgtype, given.ext):
                return made
        if given.msgdef.data and given.digest:
            return writer.add_connection(
                given.topic,
                given.msgtype,
                msgdef=given.msgdef.data,
                rihs01=given.digest,
                serialization_format=given.ext.serialization_format,
                offered_qos_profiles=given.ext.offered_qos_profiles,
            )
        return self._defined(writer, given.topic, given.msgtype)

    def _defined(self, writer: Writer, topic: str, message_type: str) -> Connection | None:
        """A connection of a type that the bag itself does not define."""
        for made in writer.connections:
            if (made.topic, made.msgtype) == (topic, message_type):
                return made
        types = self.content.types
        if message_type not in types.fielddefs:
            self.notes.append(f"{topic}: not copied, nothing defines its type {message_type}")
            return None
        return writer.add_connection(topic, message_type, typestore=types)

    def _salvaged(self, writer: Writer, names: set[str]) -> Iterator[CopiedMessage]:
        content = read_bag(self.bag, lambda topic: topic in names)
        found: list[CopiedMessage] = []
        for name in sorted(names & content.topics.keys()):
            data = content.topics[name]
            connection = self._defined(writer, name, data.message_type)
            if connection is not None:
                found += [
                    CopiedMessage(time, connection, raw)
                    for time, raw in zip(data.log_time, data.raw, strict=True)
                ]
        yield from sorted(found, key=lambda message: message.time)
