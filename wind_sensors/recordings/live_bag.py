"""A bag that grows while its messages come, and that outlives a killed process."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter

from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.places import refused_in_words

if TYPE_CHECKING:
    from rosbags.interfaces import Connection, Qos

_DISK_PERIOD = 5.0
"""From one order to the disk to the next [s]: each costs a flash card a write of its own."""


class LiveBag:
    """A compressed mcap bag of which a kill or a power cut takes the last seconds at most.

    rosbags keeps a mebibyte of messages, hours of a slow station, before it writes any. Here
    `put_down` hands over what has come as a chunk of its own: from then on a killed process loses
    none of it. The disk is told to keep it every five seconds, from a thread, because a card may
    take longer for that than messages should wait for their times of recording.

    Without `close` there is no index and no metadata.yaml; `read_bag` reads such a bag.

    Args:
        folder: Where to; must not exist.

    Raises:
        UserError: It cannot be written, here and in every method.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._types = typestore()
        with refused_in_words(folder, "recording"):
            self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
            assert isinstance(self._writer.storage, McapWriter)
            self._storage = self._writer.storage
            self._storage.bio.flush()
            for path in (folder, folder.parent):
                keep_on_disk(path)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="disk")
        self._order: Future[None] | None = None
        self._ordered_at = time.monotonic()
        self._on_disk = 0
        self._closed = False

    @property
    def is_open(self) -> bool:
        """Whether messages are still taken."""
        return not self._closed

    def add_topic(self, topic: str, message_type: str, offered: Sequence[Qos] = ()) -> Connection:
        """The connection that messages of a topic go to.

        Args:
            topic: Full name.
            message_type: E.g. `std_msgs/msg/Header`.
            offered: Quality of service of its publishers.

        Raises:
            KeyError: The type is not known.
        """
        return self._writer.add_connection(
            topic, message_type, typestore=self._types, offered_qos_profiles=offered
        )

    def write(self, connection: Connection, time_ns: int, message: bytes) -> None:
        """Take one serialised message, recorded at a time [ns]; ignored after `close`."""
        if not self._closed:
            with self._ends_at_a_fault():
                self._writer.write(connection, time_ns, message)

    def put_down(self) -> None:
        """Hand what has come to the operating system, and from time to time to the disk."""
        if self._closed:
            return
        with self._ends_at_a_fault():
            if self._storage.chunk.msgs:
                self._storage.close_chunk()
            self._storage.bio.flush()
            now = time.monotonic()
            waiting = self._order is not None and not self._order.done()
            size = self._storage.bio.tell()
            if waiting or size == self._on_disk or now - self._ordered_at < _DISK_PERIOD:
                return
            if self._order is not None:
                self._order.result()
            self._order = self._thread.submit(_fsync, self._storage.bio.fileno())
            self._ordered_at, self._on_disk = now, size

    def close(self) -> None:
        """Write the index and metadata.yaml; later messages are ignored."""
        if self._closed:
            return
        with self._ends_at_a_fault():
            self._thread.shutdown()
            self._writer.close()
            for path in (*self._folder.iterdir(), self._folder):
                keep_on_disk(path)
            self._closed = True

    @contextmanager
    def _ends_at_a_fault(self) -> Iterator[None]:
        """Write nothing more after a fault: it would stand behind half a chunk, out of reach."""
        try:
            yield
        except OSError as problem:
            self._closed = True
            with suppress(OSError):
                self._writer.abort()
            raise UserError(
                f"the recording has ended, it cannot be written ({problem.strerror or problem}).",
                str(self._folder.parent),
                "What came until then can be read. Make room, or choose another place with -o.",
            ) from None


def keep_on_disk(path: Path) -> None:
    """Have a file or folder outlast a power cut, where the system lets one ask for it."""
    if os.name != "posix":
        return
    file = os.open(path, os.O_RDONLY)
    try:
        _fsync(file)
    finally:
        os.close(file)


def _fsync(file: int) -> None:
    try:
        os.fsync(file)
    except OSError as problem:
        # Some network and memory file systems do not know the order.
        if problem.errno not in {errno.EINVAL, errno.ENOTSUP}:
            raise
