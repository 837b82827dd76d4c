"""The monitor: raw messages and a wind to compare with in, mismatches on /diagnostics out."""

from __future__ import annotations

import argparse
import multiprocessing
import signal
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from wind_sensors.diagnosis.watch import Finding, Watch, WatchSettings
from wind_sensors.errors import UserError
from wind_sensors.estimation.recent import MEMORY, Tally
from wind_sensors.nodes.diagnostics import Level, Status, Updater
from wind_sensors.nodes.inputs import EstimatorInputs, message_class, nanoseconds
from wind_sensors.nodes.parameters import Parameter, Value, declare, describe, number
from wind_sensors.nodes.quality import INPUT_DEPTH, input_quality, subscribe
from wind_sensors.nodes.station_parameters import (
    STATION,
    base_document,
    station_table,
    station_with,
)
from wind_sensors.nodes.topic_health import TopicHealth, graph_reasons, reason_for_silence
from wind_sensors.nodes.watch_rehearsal import warm_up_watch, watch_must_compile
from wind_sensors.processes import one_thread_of_linear_algebra
from wind_sensors.recordings.baseline_file import read_baseline
from wind_sensors.station.inputs import field_path, field_value, resolved, scaled
from wind_sensors.station.model import Input, Station

NAME = "monitor_node"

PURPOSE = (
    "Compares a station's signals with their simulation while they arrive, and tells on "
    "/diagnostics where they part, since when, and which few causes would explain it. It is a "
    "first opinion: record the topics with `wind record` and let `wind diagnose` settle it."
)

_DEFAULTS = WatchSettings()

NODE_PARAMETERS: tuple[Parameter, ...] = (
    STATION,
    Parameter(
        "compare_with",
        str,
        "",
        "Whose wind drives the simulation: reference (a topic), instruments (others of the "
        "station, see `driving`), estimate (the station's own: then only pulse intervals, spectra "
        "and the readings themselves are compared). Empty: reference where the station or "
        "`reference.topic` names one, else estimate.",
        choices=("", "reference", "instruments", "estimate"),
    ),
    Parameter(
        "reference.topic",
        str,
        "",
        "Topic of the wind to compare with, where the air goes, east, north, up; empty: the "
        "station's reference.",
    ),
    Parameter(
        "reference.type", str, "", "Its message type; empty: geometry_msgs/msg/Vector3Stamped."
    ),
    Parameter(
        "reference.field",
        str,
        "",
        "Field with x, y, z, e.g. twist.twist.linear; empty: that of the type.",
    ),
    Parameter(
        "driving",
        str,
        "",
        "Instruments that drive the simulation of the others, separated by commas: a second cup "
        "and its vane, for example.",
    ),
    Parameter(
        "baseline",
        str,
        "",
        "File made by `wind baseline` from healthy recordings; empty: what the first blocks show "
        "is taken as normal, so that only later changes are found.",
    ),
    Parameter(
        "false_alarms_per_day",
        float,
        _DEFAULTS.false_alarms_per_day,
        "Accepted false alarms in a day of data, where sums over blocks decide: without a "
        "baseline, or without a reference.",
        minimum=1e-4,
        maximum=10.0,
    ),
    Parameter(
        "block",
        float,
        _DEFAULTS.block,
        "Length of the compared blocks [s].",
        minimum=60.0,
        maximum=600.0,
    ),
    Parameter(
        "learning_blocks",
        int,
        _DEFAULTS.learning,
        "Blocks from which normal is learnt before anything is judged.",
        minimum=2,
        maximum=1000,
    ),
    Parameter(
        "wait",
        float,
        _DEFAULTS.wait,
        "How long after a block the comparison waits for late messages [s].",
        minimum=0.0,
        maximum=30.0,
    ),
    Parameter(
        "reliable_inputs",
        bool,
        False,
        "Ask for lost raw messages again; needs publishers that are reliable too.",
    ),
    Parameter(
        "input_depth",
        int,
        INPUT_DEPTH,
        "Raw messages kept for a busy node.",
        minimum=1,
        maximum=1_000_000,
    ),
    Parameter(
        "diagnostics_period", float, 1.0, "Between diagnostics [s].", minimum=0.05, maximum=60.0
    ),
)

_SETTLE = "Run `wind record`, then `wind diagnose` on the recording."


def clock_text(time: int) -> str:
    """A stamp [ns] as UTC for people."""
    moment = datetime.fromtimestamp(time * 1e-9, tz=timezone.utc)
    return moment.strftime("%Y-%m-%d %H:%M:%S UTC")


class MonitorNode(Node):
    """Feeds a watch with a station's messages and publishes what it finds.

    Args:
        options: Further arguments of rclpy's Node.

    Attributes:
        station: The station.
        watch: What compares.
        reference: Topic of the wind to compare with; None where instruments drive.

    Raises:
        UserError: The station, the baseline or a parameter is wrong.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(NAME, **options)
        values = declare(self, NODE_PARAMETERS)
        if not values["station"]:
            raise UserError(
                "the monitor needs to know the station.",
                "station",
                "Give its file: --ros-args -p station:=FILE.",
            )
        document = base_document(str(values["station"]), ())
        constants = declare(self, station_table(document, changeable=False))
        where = f"parameters of {self.get_fully_qualified_name()}"
        self.station: Station = station_with(document, constants, where)
        self.reference = self._reference(values)
        settings = self._settings(values)
        if settings.drive != "reference":
            self.reference = None
        learnt = str(values["baseline"])
        baseline = read_baseline(Path(learnt), self.station) if learnt else None
        # A look at the last minutes takes seconds, in which messages must not be lost.
        looks = baseline is not None and settings.drive == "reference"
        self._beside = _process_beside() if looks else None
        self.watch = Watch(self.station, settings, baseline, self._beside)
        if watch_must_compile():
            self.get_logger().info(
                "Compiling the comparison; this happens once after an installation and takes "
                "about a minute."
            )
        warm_up_watch(self.station, settings)
        self._inputs = EstimatorInputs(self.station, self.watch, self._now)
        self._winds = 0
        self._winds_unusable = Tally()
        self._told: Finding | None = None
        quality = input_quality(
            reliable=bool(values["reliable_inputs"]), depth=int(number(values["input_depth"]))
        )
        subscriptions = {}
        for source in self._inputs.sources():
            subscriptions[source.topic] = subscribe(
                self, source.message_type, source.topic, source.receive, quality
            )
        reasons = graph_reasons(self, subscriptions)
        self._topics = TopicHealth(self._inputs, self._now, reasons, self.resolve_topic_name)
        self._wind_subscription = None
        if self.reference is not None:
            self._wind_subscription = subscribe(
                self,
                message_class(self.reference.type),
                self.reference.topic,
                self._wind_receiver(self.reference),
                quality,
            )
        self._updater = Updater(
            self,
            [self._topics.statuses, self._comparison, self._mismatch, self._past, self._estimate],
            period=number(values["diagnostics_period"]),
        )

    def destroy_node(self) -> None:
        """Leave the graph, and end the process beside."""
        if self._beside is not None:
            self._beside.shutdown(wait=False, cancel_futures=True)
        super().destroy_node()

    @property
    def received(self) -> int:
        """Raw messages so far, the reference's included."""
        return self._winds + sum(count.received for count in self._inputs.counts.values())

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _reference(self, values: dict[str, Value]) -> Input | None:
        stated = self.station.reference.topic if self.station.reference else None
        if values["reference.topic"]:
            stated = Input(
                topic=str(values["reference.topic"]),
                type=str(values["reference.type"]),
                field=str(values["reference.field"]),
            )
        return None if stated is None else resolved(stated, "wind")

    def _settings(self, values: dict[str, Value]) -> WatchSettings:
        driving = tuple(n.strip() for n in str(values["driving"]).split(",") if n.strip())
        drive = str(values["compare_with"])
        if not drive:
            drive = "reference" if self.reference is not None else "estimate"
            drive = "instruments" if driving else drive
        if drive == "reference" and self.reference is None:
            raise UserError(
                "no topic of a reference wind is known.",
                "reference.topic",
                "Name one, or compare with instruments or the estimate.",
            )
        return WatchSettings(
            drive=drive,
            driving=driving,
            block=number(values["block"]),
            learning=int(number(values["learning_blocks"])),
            false_alarms_per_day=number(values["false_alarms_per_day"]),
            wait=number(values["wait"]),
        )

    def _wind_receiver(self, source: Input) -> Any:
        base = field_path(source.field)
        paths = [(*base, axis) for axis in ("x", "y", "z")]

        def receive(message: Any) -> None:
            self._winds += 1
            try:
                raw = np.array([float(field_value(message, path)) for path in paths])
                if not np.isfinite(raw).all():
                    raise ValueError("not a number")
                header = getattr(message, "header", None)
                stamp = 0 if header is None else nanoseconds(header.stamp)
                self.watch.add_wind(stamp or self._now(), scaled(source, raw))
            except (AttributeError, IndexError, OverflowError, TypeError, ValueError):
                self._winds_unusable.add(self._now())
            self._log()

        return receive

    def _log(self) -> None:
        finding = self.watch.finding
        if finding is not None and (self._told is None or finding.detected != self._told.detected):
            self.get_logger().warning(finding.message())
        elif finding is None and self._told is not None:
            self.get_logger().info(f"{self._told.channel} agrees with its simulation again.")
        self._told = finding

    def _comparison(self) -> Iterable[Status]:
        watch = self.watch
        values = {
            "compared with": self._compared_with(),
            "blocks compared": str(watch.blocks),
            "blocks left out": str(watch.skipped),
            "left out because": watch.skipped_for,
            "nearness of an alarm": f"{watch.alarm_level:.2f}",
            "unusable winds": str(self._winds_unusable.total),
            "judged by": self._judged_by(),
            "baseline": "healthy recordings" if watch.calibrated else "the first blocks",
        }
        missing = self._missing()
        unusable = self._winds_unusable.recent(self._now())
        if missing:
            yield Status("comparison", Level.STALE, f"{missing} Nothing is compared.", values)
        elif unusable:
            text = (
                f"{unusable} messages of {self._compared_with()} were unusable within the last "
                f"{MEMORY} s."
            )
            yield Status("comparison", Level.WARN, text, values)
        elif not watch.learnt:
            text = "Learning what is normal here."
            if not watch.calibrated:
                text += " Without a baseline only what changes later is found."
            yield Status("comparison", Level.OK, text, values)
        else:
            agreed = watch.finding is None
            text = "Signals agree with their simulation." if agreed else "Signals are compared."
            yield Status("comparison", Level.OK, text, values)

    def _missing(self) -> str:
        """What the comparison lacks now, as a sentence; empty if nothing."""
        watch = self.watch
        if watch.latest_wind == 0:
            why = "nothing usable has come."
            if self._wind_subscription is not None and self._winds == 0:
                reason = reason_for_silence(self, self._wind_subscription)
                why = f"{reason.text} {reason.remedy}".rstrip()
            return f"No wind to compare with yet: {self._compared_with()}: {why}"
        if watch.lag > watch.settings.block:
            return f"No wind from {self._compared_with()} for {watch.lag:.0f} s."
        silence = self._topics.silence()
        if silence > watch.settings.block:
            return f"No message of a rotor or a vane for {silence:.0f} s."
        return ""

    def _judged_by(self) -> str:
        watch = self.watch
        if watch.looks:
            return "diagnoses of the last ten minutes"
        return f"sums over blocks, {watch.settings.false_alarms_per_day:g} false alarms a day"

    def _compared_with(self) -> str:
        if self.reference is not None:
            return f"reference {self.reference.topic}"
        driving = self.watch.settings.driving
        return f"instruments {', '.join(driving)}" if driving else "the station's own estimate"

    def _mismatch(self) -> Iterable[Status]:
        finding = self.watch.finding
        if finding is None:
            yield Status("mismatch", Level.OK, "None.")
            return
        level = Level.ERROR if finding.certain or finding.likely else Level.WARN
        yield Status("mismatch", level, finding.message(), finding_values(finding))

    def _past(self) -> Iterable[Status]:
        for k, finding in enumerate(reversed(self.watch.past)):
            text = f"Over: {finding.message()}"
            yield Status(f"past mismatch {k + 1}", Level.OK, text, finding_values(finding))

    def _estimate(self) -> Iterable[Status]:
        for item in self.watch.estimate_health():
            yield Status(item.name, Level(item.level), item.message, item.values)


def finding_values(finding: Finding) -> dict[str, str]:
    """Details of a finding, key by key."""
    values = {
        "channel": finding.channel,
        "since": clock_text(finding.onset),
        "detected": clock_text(finding.detected),
        "latest": clock_text(finding.latest),
    }
    if finding.ended is not None:
        values["ended"] = clock_text(finding.ended)
    at = finding.located
    if at is not None:
        values |= {
            "mean": f"{at.mean:+.3f} +- {at.deviation:.3f} {at.unit}",
            "rms": f"{at.excess:.3f} {at.unit}",
            "share of the excess": f"{100.0 * at.share:.0f} %",
            "wind speed": f"{at.speed[0]:.1f} to {at.speed[1]:.1f} m/s",
            "wind from": f"{at.direction_from[0]:.0f} to {at.direction_from[1]:.0f} deg",
        }
    for k, candidate in enumerate(finding.candidates):
        values[f"candidate {k + 1}"] = str(candidate)
        values[f"candidate {k + 1} explains"] = f"{100.0 * candidate.explained:.0f} %"
    values["how sure"] = finding.opinion
    values["to settle it"] = _SETTLE
    return values


def _process_beside() -> ProcessPoolExecutor:
    """One process that works while this one listens; interrupts are this one's business."""
    one_thread_of_linear_algebra()
    return ProcessPoolExecutor(
        1,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )


def build(arguments: Sequence[str]) -> list[Node]:
    """The node of the executable; prints help and leaves with `--help`.

    Args:
        arguments: Command line without the program's name.
    """
    parser = argparse.ArgumentParser(
        prog=NAME,
        description=PURPOSE,
        epilog=(
            "input topics: those of the station file, and the reference\n\n"
            "output topics:\n  /diagnostics\n      DiagnosticArray: statuses comparison, "
            "mismatch, past mismatch, and one for each topic\n\n"
            f"parameters (--ros-args -p NAME:=VALUE):\n{describe(NODE_PARAMETERS)}"
        ),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.parse_args(remove_ros_args([NAME, *arguments])[1:])
    return [MonitorNode()]
