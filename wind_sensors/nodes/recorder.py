"""Live topics into a bag, message by message as they were sent, without rosbag2."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSReliabilityPolicy
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from wind_sensors.errors import UserError
from wind_sensors.nodes.inputs import message_class
from wind_sensors.nodes.quality import input_quality, subscribe
from wind_sensors.nodes.receipts import ReceiptSender
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.reading import BAG_FOLDER, STATION_FILE
from wind_sensors.recordings.writing import clear_target
from wind_sensors.station.writing import station_to_yaml

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

    from wind_sensors.station.model import Station

_DEPTH = 10_000
_DISCOVERY_PERIOD = 0.05
_NOT_SIGNALS = frozenset({"/clock", "/rosout", "/parameter_events"})


class RecorderNode(Node):
    """Writes the messages of some topics, or of all, to a recording.

    A topic is subscribed to when its first publisher is seen, reliably if all its publishers are
    reliable. The time of recording is the node's clock.

    Args:
        folder: The recording to write; must not exist unless `force`.
        topics: Topics to record; None records every topic of the graph but /clock and ROS's own.
        station: Written as the recording's station file; None: the folder holds a bag alone.
        force: Replace a recording that is there.
        depth: Messages kept by topic while the recorder is busy.
        receipts_for: Topics of which it tells how many it has had, so that a simulator can wait.
        options: Further arguments of rclpy's Node.

    Attributes:
        counts: Messages by topic.
        refused: Topics that could not be recorded, with the reason.

    Raises:
        UserError: The folder exists, or cannot be written.
    """

    def __init__(
        self,
        folder: str | Path,
        topics: Collection[str] | None,
        station: Station | None = None,
        *,
        force: bool = False,
        depth: int = _DEPTH,
        receipts_for: Collection[str] = (),
        **options: Any,
    ) -> None:
        super().__init__("recorder", **options)
        self.counts: dict[str, int] = {}
        self.refused: dict[str, str] = {}
        self._depth = depth
        self._types = typestore()
        self._wanted = (
            None if topics is None else {self.resolve_topic_name(topic): topic for topic in topics}
        )
        self._folder = Path(folder)
        self._writer = _open_bag(self._folder, station, force=force)
        self._closed = False
        acknowledged = [self.resolve_topic_name(topic) for topic in receipts_for]
        self._receipts = (
            ReceiptSender(self, lambda: {t: self.counts.get(t, 0) for t in acknowledged})
            if acknowledged
            else None
        )
        self._discovery = self.create_timer(
            _DISCOVERY_PERIOD, self.discover, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def discover(self) -> None:
        """Subscribe to the wanted topics that have a publisher by now."""
        for topic, types in self.get_topic_names_and_types():
            if topic in self.counts or topic in self.refused:
                continue
            wanted = topic not in _NOT_SIGNALS if self._wanted is None else topic in self._wanted
            if wanted and self.count_publishers(topic):
                self._subscribe(topic, types)

    @property
    def missing(self) -> list[str]:
        """Topics, as they were given, that nobody publishes yet."""
        seen = set(self.counts) | set(self.refused)
        return [name for topic, name in (self._wanted or {}).items() if topic not in seen]

    def _subscribe(self, topic: str, types: Sequence[str]) -> None:
        (message_type, *others) = types
        if others:
            self.refused[topic] = f"it carries several types: {', '.join(types)}"
            return
        try:
            loaded = message_class(message_type)
            connection = self._writer.add_connection(topic, message_type, typestore=self._types)
        except (UserError, KeyError) as problem:
            self.refused[topic] = f"its type {message_type} is not known here ({problem})"
            self.get_logger().warning(f"{topic} is not recorded: {self.refused[topic]}")
            return
        self.counts[topic] = 0
        offers = [info.qos_profile for info in self.get_publishers_info_by_topic(topic)]
        reliable = all(offer.reliability == QoSReliabilityPolicy.RELIABLE for offer in offers)
        subscribe(
            self,
            loaded,
            topic,
            self._keeper(topic, connection),
            input_quality(reliable=reliable, depth=self._depth),
            raw=True,
        )

    def _keeper(self, topic: str, connection: Connection) -> Any:
        clock = self.get_clock()

        def keep(message: bytes) -> None:
            if not self._closed:
                self.counts[topic] += 1
                self._writer.write(connection, clock.now().nanoseconds, message)

        return keep

    def close(self) -> None:
        """Finish the bag; later messages are ignored."""
        if not self._closed:
            self._closed = True
            self._writer.close()

    def destroy_node(self) -> None:
        """Finish the bag and destroy the node."""
        self.close()
        super().destroy_node()


def _open_bag(folder: Path, station: Station | None, *, force: bool) -> Writer:
    clear_target(folder, force=force)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if station is not None:
            text = station_to_yaml(station)
            (folder / STATION_FILE).write_text(text, encoding="utf-8")
        writer = Writer(folder / BAG_FOLDER, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        writer.open()
    except OSError as problem:
        raise UserError(
            f"the recording cannot be written ({problem.strerror}).",
            str(folder),
            "Choose another place with -o.",
        ) from None
    return writer
