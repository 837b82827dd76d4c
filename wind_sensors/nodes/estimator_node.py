"""The node that all instruments share: raw messages in, corrected wind out."""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.utilities import remove_ros_args

from wind_sensors.errors import UserError
from wind_sensors.estimation import (
    EstimatorSettings,
    HealthItem,
    HealthLevel,
    make_estimator,
    must_compile,
)
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.nodes.diagnostics import Level, Status, Updater
from wind_sensors.nodes.estimator_parameters import NODE_PARAMETERS
from wind_sensors.nodes.inputs import EstimatorInputs
from wind_sensors.nodes.mounting import MountingFromTf, SensorPose, tf2_is_installed
from wind_sensors.nodes.odometry_claims import claims_of, odometry_status
from wind_sensors.nodes.outputs import TOPICS, WindPublishers
from wind_sensors.nodes.parameters import (
    Parameter,
    Value,
    changed,
    declare,
    describe,
    number,
    unknown_parameters,
    unknown_text,
)
from wind_sensors.nodes.quality import input_quality, subscribe
from wind_sensors.nodes.receipts import ReceiptSender
from wind_sensors.nodes.rehearsal import warm_up
from wind_sensors.nodes.station_parameters import (
    Role,
    base_document,
    earth_frame,
    effective_value,
    require,
    station_table,
    station_with,
)
from wind_sensors.nodes.topic_health import TopicHealth, graph_reasons

if TYPE_CHECKING:
    from wind_sensors.estimation.outputs import WindEstimate
    from wind_sensors.station.model import Station

_SECOND = 1_000_000_000
_IDLE_CHECK = 0.25


class NodeKind(NamedTuple):
    """What distinguishes one estimator node from the others.

    Attributes:
        name: Of the node and its executable.
        purpose: One paragraph for `--help`.
        needs: Kinds of instruments the station must have.
        roles: Instruments expected where no station file is given.
    """

    name: str
    purpose: str
    needs: tuple[str, ...]
    roles: tuple[Role, ...]


class EstimatorNode(Node):
    """Feeds an estimator with a station's messages and publishes what it finds.

    Args:
        kind: Which node.
        options: Further arguments of rclpy's Node (context, parameter_overrides, namespace, ...).

    Attributes:
        station: The station as it is after parameters.
        received_at: Wall time of the last message [s, monotonic].
        peers: Nodes of the same process, whose parameters are given together with its own.

    Raises:
        UserError: The station or a parameter is wrong.
    """

    def __init__(self, kind: NodeKind, **options: Any) -> None:
        super().__init__(kind.name, **options)
        self._kind = kind
        self._table: list[Parameter] = list(NODE_PARAMETERS)
        self._values = declare(self, self._table)
        self._document = base_document(str(self._values["station"]), kind.roles)
        instruments = station_table(self._document, changeable=True)
        self._values |= declare(self, instruments)
        self._table += instruments
        self._restarts = 0
        self.station = self._station(self._values)
        require(self.station, kind.needs, kind.name)
        self._values["frame_id"] = earth_frame(self.station, self._values["frame_id"])
        self._show_effective_values(instruments)
        settings = self._settings(self._values)
        self._estimator = make_estimator(self.station, settings)
        if must_compile(settings):
            self.get_logger().info(
                "Compiling the estimator; this happens once after an installation and takes about "
                "a minute."
            )
        warm_up(self.station, settings)
        self._inputs = EstimatorInputs(self.station, self._estimator, self._now)
        self._outputs = WindPublishers(self, self.station.platform)
        self._apply_publishing()
        self.received_at = time.monotonic()
        self.peers: tuple[Node, ...] = ()
        self._idle_checks = 0
        self._last_estimate: WindEstimate | None = None
        subscriptions = {}
        for source in self._inputs.sources():
            subscriptions[source.topic] = subscribe(
                self,
                source.message_type,
                source.topic,
                self._receiver(source.receive),
                input_quality(
                    reliable=bool(self._values["reliable_inputs"]),
                    depth=int(number(self._values["input_depth"])),
                ),
            )
        reasons = graph_reasons(self, subscriptions)
        self._topics = TopicHealth(self._inputs, self._now, reasons, self.resolve_topic_name)
        listeners = int(number(self._values["wait_for_subscribers"]))
        self._receipts = (
            ReceiptSender(
                self,
                self._received_by_topic,
                lambda: self._outputs.fewest_subscribers >= listeners,
            )
            if self._values["send_receipts"]
            else None
        )
        wanted = bool(self._values["use_tf"]) and self.station.platform is not None
        self._mounting = MountingFromTf(self) if wanted and tf2_is_installed() else None
        self._updater = Updater(
            self,
            [self._topics.statuses, self._health],
            period=number(self._values["diagnostics_period"]),
        )
        self._idle_timer = self.create_timer(
            _IDLE_CHECK, self._while_silent, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self.add_on_set_parameters_callback(self._on_set_parameters)

    @property
    def topics(self) -> set[str]:
        """Resolved names of the topics it listens to."""
        return {self.resolve_topic_name(topic) for topic in self._inputs.counts}

    @property
    def received(self) -> int:
        """Raw messages so far."""
        return sum(count.received for count in self._inputs.counts.values())

    def _received_by_topic(self) -> dict[str, int]:
        counts = self._inputs.counts.items()
        return {self.resolve_topic_name(topic): count.received for topic, count in counts}

    @property
    def last_wind(self) -> str:
        """The last estimate as text for people; empty before the first."""
        if self._last_estimate is None:
            return ""
        east, north, _ = self._last_estimate.velocity
        deviation = float(np.sqrt(0.5 * np.trace(self._last_estimate.covariance[:2, :2])))
        bearing = float(direction_from_deg(self._last_estimate.velocity))
        return f"{np.hypot(east, north):5.1f} m/s ± {deviation:.1f} from {bearing:03.0f}°"

    def _station(self, values: dict[str, Value]) -> Station:
        return station_with(
            self._document, values, f"parameters of {self.get_fully_qualified_name()}"
        )

    @staticmethod
    def _settings(values: dict[str, Value]) -> EstimatorSettings:
        names = {field.name for field in dataclasses.fields(EstimatorSettings)}
        chosen: dict[str, Any] = {name: values[name] for name in names if name in values}
        return EstimatorSettings(**chosen)

    def _show_effective_values(self, instruments: Sequence[Parameter]) -> None:
        """Let `ros2 param get` show the constants and the frame that a file or a profile stated."""
        shown = [RosParameter("frame_id", value=self._values["frame_id"])]
        shown += [
            RosParameter(p.name, value=value)
            for p in instruments
            if self._values[p.name] is None
            and p.changeable
            and (value := effective_value(self.station, p.name)) not in (None, [])
        ]
        self.set_parameters(shown)

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _receiver(self, receive: Any) -> Any:
        def received(message: Any) -> None:
            receive(message)
            self._publish()
            self.received_at = time.monotonic()
            self._idle_checks = 0

        return received

    def _publish(self) -> None:
        estimates = self._estimator.take_estimates()
        if estimates:
            self._last_estimate = estimates[-1]
            self._outputs.publish_estimates(estimates)
        for window in self._estimator.take_windows():
            self._outputs.publish_window(window)

    def _ask_for_mounting(self) -> None:
        """Use the sensor's pose as soon as tf2 tells it."""
        platform = self.station.platform
        if self._mounting is None or platform is None:
            return
        values = self._values
        pose = self._mounting.ask(str(values["body_frame_id"]), str(values["sensor_frame_id"]))
        stated = SensorPose(platform.sensor_position, platform.sensor_rotation_deg)
        if pose is None or pose.is_close(stated):
            return
        self._document["platform"] |= {
            "sensor_position": pose.position,
            "sensor_rotation_deg": pose.rotation_deg,
        }
        self._replace_estimator(self._station(values), self._settings(values))

    def _replace_estimator(self, station: Station, settings: EstimatorSettings) -> None:
        """Start afresh: what was learnt belongs to the old constants."""
        self._estimator = make_estimator(station, settings)
        self._inputs.estimator = self._estimator
        self._outputs.platform = station.platform
        self.station = station
        self._restarts += 1

    def _while_silent(self) -> None:
        """Only when every input is silent may the clock speak: stamps alone rule otherwise."""
        self._ask_for_mounting()
        self._idle_checks += 1
        silence = number(self._values["silence"])
        # Checks are counted instead of seconds: after a long callback the messages that queued up
        # behind it must come first.
        if self._idle_checks * _IDLE_CHECK < silence:
            return
        until = self._now() - round(silence * _SECOND)
        if until > 0:
            self._estimator.advance(until)
            self._publish()

    def _health(self) -> Iterable[Status]:
        items = self._estimator.health()
        silence = self._topics.silence()
        knows = any(i.name == "estimate" and i.level >= HealthLevel.ERROR for i in items)
        if silence > number(self._values["stop_time"]) and not knows:
            # The estimator knows stamps alone, and those stand still.
            text = f"No message of a rotor or a vane has come for {silence:.0f} s."
            items = [item for item in items if item.name != "estimate"]
            items.append(HealthItem("estimate", HealthLevel.ERROR, text))
        for item in items:
            yield Status(item.name, Level(item.level), item.message, item.values)
        unknown = [unknown_text(*u) for u in unknown_parameters(self, self.peers).items()]
        yield Status(
            "settings",
            Level.WARN if unknown else Level.OK,
            " ".join([f"Method {self._values['method']}.", *unknown]),
            {"restarts by parameter changes": str(self._restarts)},
        )
        if self.station.platform is not None:
            yield self._mounting_status()
        if self._inputs.odometry is not None:
            yield odometry_status(
                claims_of(self._inputs.odometry),
                self.station,
                self._outputs.frame_id,
                self._outputs.body_frame_id,
            )

    def _mounting_status(self) -> Status:
        platform = self.station.platform
        assert platform is not None
        if self._mounting is None:
            source = "the station file"
        elif self._mounting.pose is None:
            source = "the station file, until tf2 knows the frames"
        else:
            source = "tf2"
        values = {
            "position": " ".join(f"{v:g}" for v in platform.sensor_position) + " m",
            "roll, pitch, yaw": " ".join(f"{v:g}" for v in platform.sensor_rotation_deg) + " deg",
        }
        return Status("mounting", Level.OK, f"The sensor's pose comes from {source}.", values)

    def _apply_publishing(self) -> None:
        publishers, values = self._outputs, self._values
        publishers.frame_id = str(values["frame_id"])
        publishers.sensor_frame_id = str(values["sensor_frame_id"])
        publishers.body_frame_id = str(values["body_frame_id"])
        publishers.nmea_talker = str(values["nmea_talker"]) if values["nmea"] else ""
        publishers.nmea_period = round(_SECOND / number(values["nmea_rate"]))

    def _on_set_parameters(self, parameters: Sequence[RosParameter]) -> SetParametersResult:
        requested = {parameter.name: parameter.value for parameter in parameters}
        try:
            values = changed(self._table, self._values, requested)
            station, settings = self._station(values), self._settings(values)
            if settings.method != self._estimator.settings.method:
                # Now, before messages wait for it.
                warm_up(station, settings)
            if station != self.station or settings != self._settings(self._values):
                self._replace_estimator(station, settings)
        except (ValueError, UserError) as problem:
            return SetParametersResult(successful=False, reason=str(problem))
        self._values = values
        self._apply_publishing()
        return SetParametersResult(successful=True)

    def finish(self) -> None:
        """Publish what the estimator still holds; call it when no more messages will come."""
        self._estimator.flush()
        self._publish()


def build(kind: NodeKind, arguments: Sequence[str]) -> list[Node]:
    """The node of an executable; prints help and leaves with `--help`.

    Args:
        kind: Which node.
        arguments: Command line without the program's name.
    """
    parser = argparse.ArgumentParser(
        prog=kind.name,
        description=kind.purpose,
        epilog=_manual(kind),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.parse_args(remove_ros_args([kind.name, *arguments])[1:])
    return [EstimatorNode(kind)]


def _manual(kind: NodeKind) -> str:
    instruments = station_table(base_document("", kind.roles), changeable=True)
    outputs = "\n".join(f"  {topic}\n      {text}" for topic, text in TOPICS.items())
    inputs = "\n".join(
        f"  {parameter.name}\n      {kind_of.keys[key]['topic']}"
        for kind_of in kind.roles
        for key in kind_of.keys
        if isinstance(kind_of.keys[key], dict) and "topic" in kind_of.keys[key]
        for parameter in instruments
        if parameter.name == f"{kind_of.name}.{key}.topic"
    )
    return (
        f"input topics (parameter, default without a station file):\n{inputs}\n\n"
        f"output topics:\n{outputs}\n\n"
        f"parameters (--ros-args -p NAME:=VALUE):\n{describe(NODE_PARAMETERS)}\n\n"
        "parameters of the instruments (unset: the station file's, the profile's or the "
        f"schema's value; named after the station file's instruments):\n{describe(instruments)}"
    )
