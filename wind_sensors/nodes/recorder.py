"""Live topics into a bag, message by message as they were sent, without rosbag2."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from wind_sensors.errors import UserError
from wind_sensors.nodes.inputs import message_class
from wind_sensors.nodes.offers import Request, most_offered, offers
from wind_sensors.nodes.quality import OVERRIDABLE, input_quality, subscribe
from wind_sensors.nodes.receipts import ReceiptSender
from wind_sensors.recordings.live_bag import LiveBag, keep_on_disk
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.reading import BAG_FOLDER, STATION_FILE
from wind_sensors.recordings.writing import clear_target
from wind_sensors.station.inputs import absolute, renamed
from wind_sensors.station.writing import station_to_yaml

if TYPE_CHECKING:
    from rclpy.duration import Duration
    from rclpy.qos import QoSProfile
    from rclpy.subscription import Subscription
    from rosbags.interfaces import Connection

    from wind_sensors.station.model import Station

_DEPTH = 10_000
_SECOND = 1_000_000_000
_DISCOVERY_PERIOD = 0.05
_OFFERS_PERIOD = 0.25
"""Between looks at what the publishers of recorded topics offer [s]."""

_PUT_DOWN_PERIOD = 1.0
"""A killed recorder loses what came in so many seconds."""

_MOST_HELD = 64 * 1024 * 1024
"""Room for what comes before simulated time runs [bytes]."""

_OVERRIDABLE = tuple(kind for kind in OVERRIDABLE if kind != QoSPolicyKind.DURABILITY)
"""Whether a topic is latched, its publishers say."""

_NOT_SIGNALS = frozenset({"/clock", "/rosout", "/parameter_events"})


@dataclass
class _Heard:
    """One topic that is recorded.

    Attributes:
        listen: Subscribes with what is asked for; which policies parameters may override.
        request: What the newest subscription asks for.
        is_fixed: A parameter states the reliability.
        subscriptions: The newest one, and before it one that it takes the place of.
    """

    listen: Callable[[Request, Collection[QoSPolicyKind]], Subscription]
    request: Request
    is_fixed: bool = False
    subscriptions: list[Subscription] = field(default_factory=list)


class _Held(NamedTuple):
    """A message that came before simulated time ran.

    Attributes:
        connection: Its topic.
        wall_time: When it came [ns since 1970].
        message: Serialised.
    """

    connection: Connection
    wall_time: int
    message: bytes


class RecorderNode(Node):
    """Writes the messages of some topics, or of all, to a recording.

    A topic is subscribed to when its first publisher is seen, with as much reliability and
    durability as all its publishers offer, so that latched messages come too. Where a publisher
    comes later that offers less, the topic is subscribed to again. The time of recording is the
    node's clock. A recorder that is killed loses the last second. What comes on simulated time
    before the first /clock is held back until then, since it has no time to be recorded at.

    Args:
        folder: The recording to write; must not exist unless `force`.
        topics: Topics to record; None records every topic of the graph but /clock and ROS's own.
        station: Written as the recording's station file, with the names that its topics have in
            the bag; None: the folder holds a bag alone.
        force: Replace a recording that is there.
        depth: Messages kept by topic while the recorder is busy.
        receipts_for: Topics of which it tells how many it has had, so that a simulator can wait.
        options: Further arguments of rclpy's Node.

    Attributes:
        counts: Messages by topic.
        refused: Topics that could not be recorded, with the reason.
        notes: Of topics that may lack messages, and why.
        without_room: Messages that were lost because simulated time did not run for so long.

    Raises:
        UserError: The folder exists, or cannot be written; the callbacks raise it too, when the
            disk is full.
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
        self.notes: dict[str, str] = {}
        self._heard: dict[str, _Heard] = {}
        self._held: list[_Held] = []
        self._room = _MOST_HELD
        self.without_room = 0
        self._depth = depth
        self._wanted = (
            None if topics is None else {self.resolve_topic_name(topic): topic for topic in topics}
        )
        kept = None if station is None else renamed(station, self._name_in_bag)
        self._bag = _open_bag(Path(folder), kept, force=force)
        acknowledged = [self.resolve_topic_name(topic) for topic in receipts_for]
        self._receipts = (
            ReceiptSender(self, lambda: {t: self.counts.get(t, 0) for t in acknowledged})
            if acknowledged
            else None
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._repeated = [
            self.create_timer(period, task, clock=steady)
            for period, task in (
                (_DISCOVERY_PERIOD, self.discover),
                (_OFFERS_PERIOD, self._adapt),
                (_PUT_DOWN_PERIOD, self._put_down),
            )
        ]

    def _name_in_bag(self, topic: str) -> str:
        """A topic of the station as its file in the recording must name it."""
        recorded: str = self.resolve_topic_name(topic)
        return topic if absolute(topic) == recorded else recorded

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

    @property
    def waits_for_clock(self) -> bool:
        """Whether messages are held back because simulated time does not run yet."""
        return bool(self._held)

    def _subscribe(self, topic: str, types: Sequence[str]) -> None:
        (message_type, *others) = types
        if others:
            self.refused[topic] = f"it carries several types: {', '.join(types)}"
            return
        offered = offers(self, topic)
        if not offered:
            # The publisher that was counted has just gone.
            return
        try:
            loaded = message_class(message_type)
            connection = self._bag.add_topic(topic, message_type, list(map(_as_recorded, offered)))
        except (UserError, KeyError) as problem:
            self.refused[topic] = f"its type {message_type} is not known here ({problem})"
            self.get_logger().warning(f"{topic} is not recorded: {self.refused[topic]}")
            return
        self.counts[topic] = 0
        keep = self._keeper(topic, connection)

        def listen(request: Request, overridable: Collection[QoSPolicyKind]) -> Subscription:
            quality = input_quality(**request._asdict(), depth=self._depth)
            return subscribe(
                self, loaded, topic, keep, quality, raw=True, overridable=overridable
            )

        request = most_offered(offered)
        if not request.latched and any(most_offered([one]).latched for one in offered):
            self.notes[topic] = (
                "some of its publishers are transient local and some volatile; what was latched "
                "earlier may be missing"
            )
            self.get_logger().warning(f"{topic}: {self.notes[topic]}.")
        heard = self._heard[topic] = _Heard(listen, request)
        heard.subscriptions.append(listen(request, _OVERRIDABLE))
        stated = self.get_parameter(f"qos_overrides.{topic}.subscription.reliability").value
        heard.is_fixed = (stated == "reliable") != request.reliable
        heard.request = request._replace(reliable=stated == "reliable")

    def _adapt(self) -> None:
        """Ask for less where a publisher has come that offers less, and otherwise sends nothing."""
        for topic, heard in self._heard.items():
            for replaced in heard.subscriptions[:-1]:
                # It has had a round to hand over what it held, and its successor to be found.
                self.destroy_subscription(replaced)
            del heard.subscriptions[:-1]
            offered = offers(self, topic)
            if not offered:
                continue
            most = most_offered(offered)
            reliable = heard.request.reliable and (most.reliable or heard.is_fixed)
            request = Request(reliable, heard.request.latched and most.latched)
            if request == heard.request:
                continue
            kept = [kind for kind in _OVERRIDABLE if kind != QoSPolicyKind.RELIABILITY]
            heard.subscriptions.append(heard.listen(request, kept))
            self.notes[topic] = (
                f"a publisher came after {self.counts[topic]} messages that offers less than "
                f"{heard.request}; what it sent in its first half second may be missing"
            )
            self.get_logger().warning(f"{topic}: {self.notes[topic]}.")
            heard.request = request

    def _keeper(self, topic: str, connection: Connection) -> Callable[[bytes], None]:
        def keep(message: bytes) -> None:
            if not self._bag.is_open:
                return
            now = self._now()
            if now == 0:
                self._hold(topic, connection, message)
                return
            self._release(now)
            self.counts[topic] += 1
            self._bag.write(connection, now, message)

        return keep

    def _now(self) -> int:
        """The node's clock [ns]; 0 on simulated time that does not run yet."""
        return int(self.get_clock().now().nanoseconds)

    def _hold(self, topic: str, connection: Connection, message: bytes) -> None:
        """Keep a message for the first /clock, the first ones where there is no room for all."""
        if len(message) > self._room:
            self.without_room += 1
            return
        self._room -= len(message)
        self.counts[topic] += 1
        self._held.append(_Held(connection, time.time_ns(), message))

    def _release(self, now: int | None) -> None:
        """Record what was held back.

        Args:
            now: The first simulated time [ns]; None: there was none, so wall time has to do.
        """
        if "/clock" in self.notes or not (self._held or self.without_room):
            return
        at = "at the first simulated time" if now is not None else "at wall time: no /clock came"
        note = f"{len(self._held)} messages came before it and were recorded {at}"
        if self.without_room:
            note += f"; there was no room for {self.without_room} more, which are lost"
        self.notes["/clock"] = note
        self.get_logger().warning(f"/clock: {note}.")
        held, self._held = self._held, []
        for connection, wall_time, message in held:
            self._bag.write(connection, wall_time if now is None else now, message)

    def _put_down(self) -> None:
        now = self._now()
        if now:
            self._release(now)
        self._bag.put_down()

    def close(self) -> None:
        """Finish the bag; later messages are ignored."""
        if self._bag.is_open:
            self._release(self._now() or None)
        self._bag.close()

    def destroy_node(self) -> None:
        """Finish the bag and destroy the node."""
        self.close()
        super().destroy_node()


def _open_bag(folder: Path, station: Station | None, *, force: bool) -> LiveBag:
    clear_target(folder, force=force)
    with refused_in_words(folder, "recording"):
        folder.mkdir(parents=True, exist_ok=True)
        keep_on_disk(folder.parent)
        if station is not None:
            file = folder / STATION_FILE
            file.write_text(station_to_yaml(station), encoding="utf-8")
            keep_on_disk(file)
    return LiveBag(folder / BAG_FOLDER)


def _as_recorded(profile: QoSProfile) -> Qos:
    """A publisher's quality of service as bags keep it."""
    return Qos(
        QosHistory(int(profile.history)),
        profile.depth,
        QosReliability(int(profile.reliability)),
        QosDurability(int(profile.durability)),
        _time(profile.deadline),
        _time(profile.lifespan),
        QosLiveliness(int(profile.liveliness)),
        _time(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def _time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, _SECOND))
