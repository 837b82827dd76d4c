"""What /diagnostics tells of an input topic: whether messages come, which are useless, why none do.

Levels tell the present state: what is wrong now or was within the last minute. The numbers in the
details count from the start. Ages are those of the node's clock, so that a simulation that pauses
makes nothing stale.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from rclpy.qos import QoSCompatibility, QoSReliabilityPolicy, qos_check_compatible

from wind_sensors.estimation.recent import MEMORY, Rhythm, Tally
from wind_sensors.nodes.diagnostics import Level, Status
from wind_sensors.nodes.inputs import EstimatorInputs, TopicCount

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.subscription import Subscription

_SECOND = 1_000_000_000
_LEAST_SILENCE = 5 * _SECOND

_COMPLAINTS = {
    "without_stamp": "without a stamp",
    "not_numbers": "not a number",
    "without_orientation": (
        "without an orientation (orientation_covariance[0] is -1; name the topic of a driver or "
        "filter that has one)"
    ),
    "implausible": "not plausible (check `modulus`, `scale` and `offset`)",
    "unusable": "unusable ({problem})",
}
"""Counts of a topic and what they say; `problem` is the last error."""


class Reason(NamedTuple):
    """Why nothing comes from a topic.

    Attributes:
        level: Of a topic from which nothing has ever come.
        text: The end of a sentence.
        remedy: A further sentence on what to do, if nothing has ever come.
    """

    level: Level
    text: str
    remedy: str = ""


Reasons = Callable[[str], Reason]
"""Why a topic is silent, by its name."""


def message_type_name(message_type: type[Any]) -> str:
    """A message class as ROS names it, e.g. `std_msgs/msg/Header`."""
    package, kind, *_ = message_type.__module__.split(".")
    return f"{package}/{kind}/{message_type.__name__}"


def reason_for_silence(node: Node, subscription: Subscription) -> Reason:
    """Why nothing comes from a subscription, as far as the graph knows.

    Args:
        node: That subscribed.
        subscription: To a topic from which nothing comes.
    """
    expected = message_type_name(subscription.msg_type)
    publishers = node.get_publishers_info_by_topic(subscription.topic_name)
    if not publishers:
        return Reason(Level.WARN, "nobody publishes it.", "Is the topic name right?")
    for publisher in publishers:
        name = f"{publisher.node_namespace.rstrip('/')}/{publisher.node_name}"
        if publisher.topic_type != expected:
            return Reason(
                Level.ERROR,
                f"{name} publishes {publisher.topic_type}, but {expected} is expected.",
                "State the topic's type in the station file.",
            )
        matches, why = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
        if matches == QoSCompatibility.ERROR:
            if publisher.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT:
                why = "it is best effort, the subscription is not."
            return Reason(
                Level.ERROR,
                f"{name} publishes with a quality that does not match: {why}",
                "Set `reliable_inputs` to false, or the `qos_overrides` of the topic.",
            )
    return Reason(Level.WARN, "it has a publisher, which sends nothing.")


class _Topic:
    """One topic as it was when it was last looked at.

    Args:
        count: What happened to its messages.
    """

    def __init__(self, count: TopicCount) -> None:
        self._count = count
        self._rhythm = Rhythm(_LEAST_SILENCE)
        self._heard = 0
        self._tallies = {name: Tally() for name in ("received", *_COMPLAINTS)}

    def look(self, now: int) -> None:
        """Notice what has happened since the last look."""
        # A clock that was set back has heard nothing in its future.
        self._heard = min(self._heard, now)
        for name, tally in self._tallies.items():
            total = int(getattr(self._count, name))
            if total > tally.total:
                tally.add(now, total - tally.total)
                if name == "received":
                    if self._heard:
                        self._rhythm.take(now, now - self._heard)
                    self._heard = now

    def silence(self, now: int) -> float:
        """How long nothing has come [s]; 0 while something does, or before the first message."""
        age = now - self._heard
        return age / _SECOND if self._heard and age > self._rhythm.limit else 0.0

    def complaints(self, now: int) -> list[str]:
        """What was wrong with messages of the last minute."""
        return [
            f"{self._tallies[name].recent(now)} {text.format(problem=self._count.problem)}"
            for name, text in _COMPLAINTS.items()
            if self._tallies[name].recent(now)
        ]

    def recent(self, name: str, now: int) -> int:
        """How often something happened within the last minute."""
        return self._tallies[name].recent(now)


class TopicHealth:
    """Statuses of a station's input topics.

    Args:
        inputs: Counts their messages.
        now: The node's clock [ns].
        reasons: Why a topic is silent.
        full_name: The name that a topic of the station has in the graph.
    """

    def __init__(
        self,
        inputs: EstimatorInputs,
        now: Callable[[], int],
        reasons: Reasons,
        full_name: Callable[[str], str],
    ) -> None:
        self._inputs = inputs
        self._now = now
        self._reasons = reasons
        self._full_name = full_name
        self._topics = {name: _Topic(count) for name, count in inputs.counts.items()}

    def silence(self) -> float:
        """How long nothing has come from any rotor or vane [s]; 0 while something does."""
        now = self._now()
        ages = [self._topics[name].silence(now) for name in self._inputs.instruments]
        return min(ages, default=0.0)

    def statuses(self) -> Iterable[Status]:
        """One for each topic."""
        now = self._now()
        for topic in self._topics.values():
            topic.look(now)
        for name, topic in self._topics.items():
            count = self._inputs.counts[name]
            level, message = self._judged(name, topic, count, now)
            yield Status(f"topic {self._full_name(name)}", level, message, _values(count))

    def _judged(
        self, name: str, topic: _Topic, count: TopicCount, now: int
    ) -> tuple[Level, str]:
        if not count.received:
            why = self._reasons(name)
            return why.level, f"No messages yet: {why.text} {why.remedy}".rstrip()
        age = topic.silence(now)
        if age and name in self._inputs.event_driven and self.silence() == 0.0:
            return Level.OK, f"No message for {age:.0f} s: a rotor at rest sends none."
        if age:
            return Level.STALE, f"Silent for {age:.0f} s: {self._reasons(name).text}"
        complaints = topic.complaints(now)
        if complaints:
            level = Level.ERROR if topic.recent("unusable", now) else Level.WARN
            return level, (
                f"{', '.join(complaints)} of {topic.recent('received', now)} messages within the "
                f"last {MEMORY} s were left out."
            )
        doubts = [doubt for doubt in count.doubts.values() if doubt]
        if doubts:
            return Level.WARN, " ".join(doubts)
        return Level.OK, "Messages are arriving."


def graph_reasons(node: Node, subscriptions: Mapping[str, Subscription]) -> Reasons:
    """Reasons as the graph tells them.

    Args:
        node: That subscribed.
        subscriptions: By topic, as the station names it.
    """
    return lambda topic: reason_for_silence(node, subscriptions[topic])


def _values(count: TopicCount) -> dict[str, str]:
    return {
        "purpose": ", ".join(count.purposes),
        "received": str(count.received),
        "without stamp": str(count.without_stamp),
        "not numbers": str(count.not_numbers),
        "without orientation": str(count.without_orientation),
        "not plausible": str(count.implausible),
        "unusable": str(count.unusable),
        "restarts of a counter": str(count.restarts),
    }
