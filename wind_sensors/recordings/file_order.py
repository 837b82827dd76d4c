"""The order in which a bag's messages were written, which a clock that is set back does not spoil.

Readers sort messages by their time of recording. Where the recorder's clock went back, what came
before and after is mixed by that; the order in the file keeps them apart.
"""

from __future__ import annotations

import re
import sqlite3
import struct
from collections import defaultdict
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from wind_sensors.station.signals import TimeArray

IntArray = npt.NDArray[np.int64]

SET_BACK = 2_000_000_000
"""A step back of more than this is no delay of a message, but a clock that was set [ns]."""
_MOST = 20
"""A topic with more steps back was not written in the order of recording at all."""

_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _CHANNEL, _MESSAGE, _INDEX = 0x02, 0x04, 0x05, 0x07


def written_times(bag: Path) -> dict[str, TimeArray]:
    """Times of recording [ns] of each topic in the order of the file.

    Args:
        bag: Bag folder or a single .mcap or .db3 file.

    Returns:
        By topic; empty for files that are compressed as a whole.

    Raises:
        Exception: The bag is damaged; which exception is not specified.
    """
    files = [bag] if bag.is_file() else sorted(bag.iterdir(), key=_number)
    parts: dict[str, list[TimeArray]] = defaultdict(list)
    for file in files:
        found: dict[str, TimeArray] = {}
        if file.suffix == ".mcap":
            with file.open("rb") as stream:
                found = _of_mcap(stream)
        elif file.suffix == ".db3":
            found = _of_sqlite(file)
        for topic, time in found.items():
            parts[topic].append(time)
    return {topic: np.concatenate(times) for topic, times in parts.items()}


def set_back(time: TimeArray) -> IntArray:
    """Indices of the messages before which the clock was set back; none where it was not.

    Args:
        time: Times of recording in the order of the file [ns], shape (n,).
    """
    back = np.flatnonzero(np.diff(time) < -SET_BACK) + 1
    return back if back.size <= _MOST else back[:0]


def _number(file: Path) -> tuple[int, str]:
    """Bags that were split number their files, and 10 comes after 9."""
    match = re.search(r"_(\d+)$", file.stem)
    return (int(match[1]) if match else 0, file.name)


def _of_mcap(stream: BinaryIO) -> dict[str, TimeArray]:
    if stream.read(len(_MAGIC)) != _MAGIC:
        return {}
    topics: dict[int, str] = {}
    rows: dict[int, list[IntArray]] = defaultdict(list)
    while len(head := stream.read(9)) == 9 and head[0] != _FOOTER:
        kind, size = head[0], struct.unpack("<Q", head[1:])[0]
        here = stream.tell()
        if kind == _CHANNEL:
            body = stream.read(size)
            channel, _, length = struct.unpack_from("<HHI", body)
            topics[channel] = body[8 : 8 + length].decode()
        elif kind == _MESSAGE:
            channel, _, time = struct.unpack("<HIQ", stream.read(14))
            rows[channel].append(np.array([[time, here, 0]], dtype=np.int64))
        elif kind == _INDEX:
            body = stream.read(size)
            (channel,) = struct.unpack_from("<H", body)
            pairs = np.frombuffer(body, dtype="<i8", offset=6).reshape(-1, 2)
            # The index stands behind its chunk, so that its place orders the chunks.
            place = np.full(len(pairs), here)
            rows[channel].append(np.column_stack((pairs[:, 0], place, pairs[:, 1])))
        stream.seek(here + size)
    by_topic: dict[str, list[IntArray]] = defaultdict(list)
    for channel, found in rows.items():
        by_topic[topics[channel]] += found
    out: dict[str, TimeArray] = {}
    for topic, found in by_topic.items():
        table = np.concatenate(found)
        out[topic] = table[np.lexsort((table[:, 2], table[:, 1])), 0]
    return out


def _of_sqlite(file: Path) -> dict[str, TimeArray]:
    with sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True) as database:
        topics = dict(database.execute("SELECT id, name FROM topics"))
        found: dict[str, list[int]] = defaultdict(list)
        for topic, time in database.execute("SELECT topic_id, timestamp FROM messages ORDER BY id"):
            found[topics[topic]].append(time)
    database.close()
    return {topic: np.asarray(time, dtype=np.int64) for topic, time in found.items()}
