"""What can still be read from a bag that was cut off or damaged.

A recorder that loses power leaves an mcap file without its index and with half a chunk at the end,
or an sqlite3 file whose last pages are missing. Both are read from the front until nothing makes
sense any more.
"""

from __future__ import annotations

import sqlite3
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from lz4.frame import LZ4FrameDecompressor
from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat, Qos
from rosbags.rosbag2.metadata import parse_qos

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F
_FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}


class SalvagedChannel(NamedTuple):
    """What a bag tells of one topic, with the quality of service of its publishers."""

    topic: str
    message_type: str
    definition: MessageDefinition
    offered: tuple[Qos, ...]


class SalvagedMessage(NamedTuple):
    """One message that could be read."""

    channel: SalvagedChannel
    time: int
    raw: bytes


@dataclass
class Salvage:
    """Messages of one damaged file, in order, and what was wrong with it."""

    messages: list[SalvagedMessage] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def salvage(path: Path) -> Salvage:
    """Read a .mcap or .db3 file as far as possible."""
    return _salvage_sqlite(path) if path.suffix == ".db3" else _salvage_mcap(path.read_bytes())


class _Cursor:
    """Reads little-endian values and raises EOFError at the end of the data."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def take(self, size: int) -> bytes:
        part = self.data[self.position : self.position + size]
        if len(part) < size:
            raise EOFError
        self.position += size
        return part

    def number(self, code: str) -> int:
        (value,) = struct.unpack(f"<{code}", self.take(struct.calcsize(f"<{code}")))
        return int(value)

    def text(self) -> str:
        return self.take(self.number("I")).decode(errors="replace")


def _salvage_mcap(data: bytes) -> Salvage:
    found = Salvage()
    if not data.startswith(_MAGIC):
        found.faults.append("the file does not begin like an mcap file")
        return found
    schemas: dict[int, tuple[str, MessageDefinition]] = {}
    channels: dict[int, SalvagedChannel] = {}
    complete = False
    for opcode, body in _records(data, len(_MAGIC), found.faults):
        if opcode == _CHUNK:
            for inner, record in _records(_chunk(body, found.faults), 0, []):
                _take_record(inner, record, schemas, channels, found)
        elif opcode == _DATA_END:
            complete = True
        else:
            _take_record(opcode, body, schemas, channels, found)
    if not complete and not found.faults:
        found.faults.append("the file was not closed")
    return found


def _records(data: bytes, start: int, faults: list[str]) -> Iterator[tuple[int, bytes]]:
    """Records until the data end; the last one may be cut off when it is a chunk."""
    position = start
    while position + 9 <= len(data):
        opcode = data[position]
        (size,) = struct.unpack_from("<Q", data, position + 1)
        body = data[position + 9 : position + 9 + size]
        position += 9 + size
        if len(body) < size:
            faults.append("the file ends in the middle of a record")
            if opcode != _CHUNK:
                return
        yield opcode, body


def _chunk(body: bytes, faults: list[str]) -> bytes:
    """The records of a chunk, as many as can be decompressed."""
    cursor = _Cursor(body)
    try:
        cursor.take(28)
        compression = cursor.text()
        cursor.number("Q")
    except EOFError:
        return b""
    packed = body[cursor.position :]
    if not compression:
        return packed
    try:
        if compression == "zstd":
            return bytes(zstd.ZstdDecompressor().decompress(packed))
        return bytes(LZ4FrameDecompressor().decompress(packed))
    except (zstd.ZstdError, RuntimeError) as problem:
        faults.append(f"a chunk cannot be decompressed ({problem})")
        return b""


def _take_record(
    opcode: int,
    body: bytes,
    schemas: dict[int, tuple[str, MessageDefinition]],
    channels: dict[int, SalvagedChannel],
    found: Salvage,
) -> None:
    cursor = _Cursor(body)
    try:
        if opcode == _SCHEMA:
            key, name, encoding = cursor.number("H"), cursor.text(), cursor.text()
            kind = _FORMATS.get(encoding, MessageDefinitionFormat.NONE)
            schemas[key] = (name, MessageDefinition(kind, cursor.text()))
        elif opcode == _CHANNEL:
            key, schema = cursor.number("H"), cursor.number("H")
            if schema in schemas:
                channel = SalvagedChannel(cursor.text(), *schemas[schema], _offers(cursor))
                channels[key] = channel
        elif opcode == _MESSAGE:
            sender = channels.get(cursor.number("H"))
            cursor.number("I")
            time = cursor.number("Q")
            cursor.number("Q")
            if sender is not None:
                raw = body[cursor.position :]
                found.messages.append(SalvagedMessage(sender, time, raw))
    except EOFError:
        found.faults.append("a record is shorter than it says")


def _offers(cursor: _Cursor) -> tuple[Qos, ...]:
    """Quality of service in a channel's record, after its topic."""
    cursor.text()
    end = cursor.number("I") + cursor.position
    metadata: dict[str, str] = {}
    while cursor.position < end:
        key = cursor.text()
        metadata[key] = cursor.text()
    return _qualities(metadata.get("offered_qos_profiles", ""))


def _qualities(text: str) -> tuple[Qos, ...]:
    try:
        return tuple(parse_qos(text))
    except Exception:
        # Recorders have written them in several ways; the messages are worth more than they.
        return ()


def _salvage_sqlite(path: Path) -> Salvage:
    found = Salvage()
    nothing = MessageDefinition(MessageDefinitionFormat.NONE, "")
    try:
        with sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True) as database:
            # Without this a file shorter than its header says is refused before it is read.
            database.execute("PRAGMA writable_schema = ON")
            definitions = _definitions(database)
            offers = _offers_in(database)
            topics = {
                key: SalvagedChannel(
                    name, kind, definitions.get(kind, nothing), offers.get(key, ())
                )
                for key, name, kind in database.execute("SELECT id, name, type FROM topics")
            }
            rows = database.execute(
                "SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY rowid"
            )
            for key, time, raw in rows:
                found.messages.append(SalvagedMessage(topics[key], int(time), bytes(raw)))
    except (sqlite3.Error, KeyError) as problem:
        found.faults.append(f"the file is damaged ({_in_words(problem)})")
    return found


def _in_words(problem: sqlite3.Error | KeyError) -> str:
    if isinstance(problem, KeyError):
        return "a message belongs to no topic"
    return str(problem)


def _definitions(database: sqlite3.Connection) -> dict[str, MessageDefinition]:
    try:
        rows = database.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        return {
            name: MessageDefinition(_FORMATS.get(kind, MessageDefinitionFormat.NONE), text)
            for name, kind, text in rows
        }
    except sqlite3.Error:
        return {}


def _offers_in(database: sqlite3.Connection) -> dict[int, tuple[Qos, ...]]:
    try:
        rows = database.execute("SELECT id, offered_qos_profiles FROM topics")
        return {key: _qualities(text) for key, text in rows}
    except sqlite3.Error:
        return {}
