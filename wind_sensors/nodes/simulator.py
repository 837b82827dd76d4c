"""The simulator's node: events of a simulated station, published when they arrive."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from wind_sensors.nodes.diagnostics import Level, Status, Updater
from wind_sensors.nodes.parameters import Parameter, declare, describe, number
from wind_sensors.nodes.quality import SETTLING, advertise, input_quality, output_quality, subscribe
from wind_sensors.nodes.receipts import RECEIPTS_DEPTH, RECEIPTS_TOPIC, ReceiptBook
from wind_sensors.nodes.scenario_parameters import SCENARIO_PARAMETERS, scenario_of
from wind_sensors.nodes.signal_messages import SignalEncoder
from wind_sensors.nodes.simulated_time import SimulatedTime
from wind_sensors.nodes.station_parameters import (
    FRAME_ID,
    STATION,
    base_document,
    earth_frame,
    station_table,
    station_with,
)
from wind_sensors.nodes.topics import TRUTH_TOPIC, instrument_topics
from wind_sensors.simulation.run import SignalStream, recording_start
from wind_sensors.simulation.transport import Event, live_events

if TYPE_CHECKING:
    from wind_sensors.station.model import Station

NAME = "sim_node"

NODE_PARAMETERS: tuple[Parameter, ...] = (
    replace(
        STATION,
        default="mast_cup_vane",
        description="Station file, or the name of a configuration that ships with the package.",
    ),
    Parameter(
        "duration",
        float,
        0.0,
        "Simulated seconds until the signals end [s]; 0: they go on.",
        minimum=0.0,
    ),
    Parameter(
        "speed",
        float,
        1.0,
        "Simulated seconds per second of wall time.",
        minimum=0.01,
        maximum=1000.0,
    ),
    Parameter(
        "publish_clock",
        bool,
        False,
        "Publish simulated time on /clock, starting at the station file's recording.start where "
        "it states one; without it the signals are stamped from now on.",
    ),
    Parameter("publish_truth", bool, False, f"Publish the true wind on {TRUTH_TOPIC}."),
    Parameter(
        "wait_for_subscribers",
        int,
        0,
        "Begin when the topic of each instrument has so many subscribers.",
        minimum=0,
        maximum=100,
    ),
    Parameter(
        "wait_for_receipts",
        int,
        0,
        f"So many listeners tell on {RECEIPTS_TOPIC} what they have had (nodes with "
        "send_receipts); simulated time stands still rather than go further than longest_lead "
        "ahead of the slowest. 0: it waits for nobody.",
        minimum=0,
        maximum=100,
    ),
    Parameter(
        "longest_lead",
        float,
        1.0,
        "How far simulated time may go ahead of a listener that is waited for [s]; not more than "
        "the listener's reordering_window, or a busy one may lose its messages' order.",
        minimum=0.01,
        maximum=60.0,
    ),
    FRAME_ID,
    Parameter(
        "output_depth",
        int,
        1000,
        "Messages kept for slow subscribers.",
        minimum=1,
        maximum=1_000_000,
    ),
    Parameter(
        "diagnostics_period", float, 1.0, "Between diagnostics [s].", minimum=0.05, maximum=60.0
    ),
    *SCENARIO_PARAMETERS,
)
"""Parameters of the simulator, besides those of its instruments."""

_TICK = 0.002
_LONGEST_LEAP = 0.05
_CLOCK_WALL_PERIOD = 10_000_000


class SimulatorNode(Node):
    """Publishes the raw signals of a simulated station.

    Same station, scenario and seed: the same signals to the bit as `wind simulate`.

    Args:
        options: Further arguments of rclpy's Node.

    Attributes:
        finished: `duration` has passed and everything has been published, or it was stopped.

    Raises:
        UserError: The station or a parameter is wrong.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NAME, **options)
        values = declare(self, NODE_PARAMETERS)
        document = base_document(str(values["station"]), ())
        instruments = declare(self, station_table(document, changeable=False))
        where = f"parameters of {self.get_fully_qualified_name()}"
        self.station: Station = station_with(document, instruments, where)
        self.finished = False
        self._speed = number(values["speed"])
        self._waits_for = int(number(values["wait_for_subscribers"]))
        self._book = ReceiptBook(int(number(values["wait_for_receipts"])))
        self._longest_lead = number(values["longest_lead"])
        self._with_clock = bool(values["publish_clock"])
        self._duration = number(values["duration"]) or math.inf
        self._scenario = scenario_of(values, self.station)
        self._begin = 0
        self._end: int | None = None
        encoder = SignalEncoder(
            self.station,
            earth_frame(self.station, values["frame_id"]),
            with_truth=bool(values["publish_truth"]),
        )
        self._encoder = encoder
        depth = int(number(values["output_depth"]))
        self._outlets = {
            topic: advertise(self, message_type, topic, output_quality(depth))
            for topic, message_type in encoder.topics.items()
        }
        self._counts = dict.fromkeys(encoder.topics, 0)
        self._resolved = {topic: self.resolve_topic_name(topic) for topic in encoder.topics}
        self._time: SimulatedTime | None = None
        if self._with_clock:
            self._time = SimulatedTime(self, max(round(_CLOCK_WALL_PERIOD * self._speed), 1))
        if values["wait_for_receipts"]:
            quality = input_quality(reliable=True, depth=RECEIPTS_DEPTH)
            subscribe(self, DiagnosticStatus, RECEIPTS_TOPIC, self._book.note_received, quality)
        # A first look compiles the kernels, which must not delay the stream once it runs.
        self._events: Iterator[Event] = live_events(SignalStream(self.station, self._scenario))
        self._next_event = next(self._events)
        self._running = False
        self._elapsed = 0.0
        self._ticked_at = 0.0
        self._ready_at = 0.0
        self._instrument_topics = instrument_topics(self.station)
        self._burst = 0.0
        self._timer = self.create_timer(
            _TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._updater = Updater(self, [self._status], period=number(values["diagnostics_period"]))

    def stop(self) -> None:
        """Publish nothing more, as at the end of `duration`."""
        self.finished = True

    @property
    def elapsed(self) -> float:
        """Simulated time since the start [s]."""
        return self._elapsed

    @property
    def published(self) -> int:
        """Messages so far."""
        return sum(self._counts.values())

    def published_by_topic(self) -> dict[str, int]:
        """Messages so far by resolved topic."""
        return {self._resolved[topic]: n for topic, n in self._counts.items()}

    def _tick(self) -> None:
        if self.finished or not self._has_started():
            return
        wall = self._move_time_on()
        now = self._begin + round(self._elapsed * 1e9)
        while self._next_event.arrival <= now:
            event = self._next_event
            if self._end is not None and event.arrival >= self._end:
                break
            self._tell_time(event.arrival)
            for topic, message in self._encoder.encode(event):
                self._outlets[topic].publish(message)
                self._counts[topic] += 1
            self._next_event = next(self._events)
        self._tell_time(now)
        self._book.note_sent(self._elapsed, self.published_by_topic())
        self._burst = time.monotonic() - wall
        if self._elapsed >= self._duration:
            self.finished = True
            self.get_logger().info(f"The simulation has ended: {self.published} messages.")

    def _move_time_on(self) -> float:
        wall = time.monotonic()
        passed = wall - self._ticked_at
        if self._with_clock:
            # Simulated time may go slowly on a busy machine, but it must not leap.
            passed = min(passed, _LONGEST_LEAP)
        furthest = min(self._duration, self._book.complete_until + self._longest_lead)
        self._elapsed = min(self._elapsed + passed * self._speed, furthest)
        self._ticked_at = wall
        return wall

    def _has_started(self) -> bool:
        if not self._running:
            if self._lonely_topics() or not self._book.is_open:
                self._ready_at = time.monotonic() + SETTLING
            elif time.monotonic() >= self._ready_at:
                self._start()
        return self._running

    def _lonely_topics(self) -> list[str]:
        return sorted(
            self._resolved[topic]
            for topic, outlet in self._outlets.items()
            if outlet.get_subscription_count() < self._least_subscribers(topic)
        )

    def _least_subscribers(self, topic: str) -> int:
        named = self._waits_for if topic in self._instrument_topics else 0
        # A listener that has not been matched yet would wait for the first messages without end.
        return max(named, self._book.listeners_of(self._resolved[topic]))

    def _start(self) -> None:
        stated = recording_start(self.station) if self._with_clock else 0
        # Zero means "no time" to ROS, so a station file that states no start begins now.
        self._begin = stated or time.time_ns()
        if math.isfinite(self._duration):
            self._end = self._begin + round(self._duration * 1e9)
        self._events = live_events(SignalStream(self.station, self._scenario, self._begin))
        self._next_event = next(self._events)
        if self._time is not None:
            self._time.start_at(self._begin)
        self._ticked_at = time.monotonic()
        self._running = True

    def _tell_time(self, now: int) -> None:
        if self._time is not None:
            self._time.tell(now)

    def _status(self) -> Iterable[Status]:
        details = {
            "simulated time": f"{self.elapsed:.1f} s",
            "messages": str(self.published),
            "speed": f"{self._speed:g}",
            "time spent in the last burst": f"{self._burst * 1e3:.1f} ms",
            "behind": ", ".join(self._book.late_listeners) or "nobody",
        }
        if not self._running:
            awaited = self._lonely_topics() or [RECEIPTS_TOPIC]
            text = f"Waiting for listeners of {', '.join(awaited)}."
            yield Status("simulation", Level.WARN, text, details)
        elif self.finished:
            yield Status("simulation", Level.OK, "The simulation has ended.", details)
        else:
            yield Status("simulation", Level.OK, "Signals are being published.", details)


def build(arguments: Sequence[str]) -> list[Node]:
    """The node of the executable; prints help and leaves with `--help`."""
    parser = argparse.ArgumentParser(
        prog=NAME,
        description="The signals of a simulated station as live topics: pulses one by one at "
        "their own times, angles, reference wind, air and platform, with the faults of the "
        "instruments (station file) and of the transport (faults.*).",
        epilog=_manual(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.parse_args(remove_ros_args([NAME, *arguments])[1:])
    return [SimulatorNode()]


def _manual() -> str:
    example = station_table(
        {"instruments": [{"name": "cup", "kind": "cup"}, {"name": "vane", "kind": "vane"}]},
        changeable=False,
    )
    return (
        "output topics: the inputs that the station file names (raw signals, reference, air, "
        f"platform), {TRUTH_TOPIC} and /clock where asked for, /diagnostics\n\n"
        f"parameters (--ros-args -p NAME:=VALUE):\n{describe(NODE_PARAMETERS)}\n\n"
        "parameters of the instruments, here for a cup and a vane (unset: the station file's "
        f"value):\n{describe(example)}"
    )
