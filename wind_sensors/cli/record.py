"""`wind record`: live topics into a recording."""

from __future__ import annotations

import argparse
import time
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from wind_sensors.cli.durations import METAVAR, seconds
from wind_sensors.cli.ros_arguments import add_ros_arguments, ros_arguments
from wind_sensors.cli.screen import screen

if TYPE_CHECKING:
    from collections.abc import Collection

    from wind_sensors.nodes.recorder import RecorderNode
    from wind_sensors.station.model import Station


def register(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "record",
        help="record live topics into a recording",
        description="Record live topics until Ctrl-C or --duration. With --station the folder "
        "becomes a RECORDING that every other command reads; its inputs and the corrected wind "
        "are recorded. Messages are stored as they were sent, latched (transient local) ones too. "
        "What has come is written every second and kept on the disk every five, so that a recorder "
        "that is killed leaves a recording that every command reads.",
    )
    parser.add_argument("-o", "--output", metavar="OUT", required=True, help="folder to write")
    parser.add_argument("--station", metavar="FILE", help="station file of the instruments")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--topics", nargs="+", metavar="TOPIC", help="record these topics")
    which.add_argument("--all", action="store_true", help="record every topic but /clock")
    parser.add_argument(
        "--duration", type=seconds, metavar=METAVAR, help="stop after this, like 90s, 15min, 1h"
    )
    parser.add_argument(
        "--use-sim-time", action="store_true", help="times of recording from /clock"
    )
    parser.add_argument("--force", action="store_true", help="replace OUT")
    add_ros_arguments(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from wind_sensors.errors import UserError
    from wind_sensors.nodes import execution
    from wind_sensors.recordings import load_station
    from wind_sensors.recordings.writing import keep_inputs
    from wind_sensors.station.topic_names import refuse_other_texts

    if not (args.station or args.topics or args.all):
        raise UserError(
            "it is not said what to record.", remedy="Give --station FILE, --topics or --all."
        )
    refuse_other_texts(args.topics or (), "--topics")
    keep_inputs(args.output, (args.station,))
    station = load_station(args.station) if args.station else None
    made: list[RecorderNode] = []

    def build() -> list[RecorderNode]:
        from rclpy.parameter import Parameter

        from wind_sensors.nodes.recorder import RecorderNode
        from wind_sensors.nodes.topics import station_topics

        topics: Collection[str] | None = args.topics
        if station is not None and not args.topics:
            topics = station_topics(station)
        made.append(
            RecorderNode(
                args.output,
                None if args.all else topics,
                station,
                force=args.force,
                parameter_overrides=[Parameter("use_sim_time", value=args.use_sim_time)],
            )
        )
        return made

    console = screen()
    begin = time.monotonic()
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("waiting for topics")

        def until() -> bool:
            counts = made[0].counts
            messages = sum(counts.values())
            waiting = ", waiting for /clock" if made[0].waits_for_clock else ""
            text = f"{messages} messages of {len(counts)} topics{waiting}"
            progress.update(task, description=text)
            return args.duration is not None and time.monotonic() - begin >= args.duration

        execution.run(build, ros_arguments(args), until=until)
    if not made:
        return 0
    show(made[0], args.output, console, args.topics or _expected(station))
    return 0


def _expected(station: Station | None) -> list[str]:
    from wind_sensors.nodes.topics import raw_topics

    return [] if station is None else raw_topics(station)


def show(
    recorder: RecorderNode, output: str, console: Console, expected: Collection[str] = ()
) -> None:
    """Say what was recorded, and which of the expected topics nobody published."""
    table = Table("topic", "messages", title=f"Recorded to {output}", title_justify="left")
    for topic, count in sorted(recorder.counts.items()):
        table.add_row(topic, str(count))
    console.print(table)
    for topic, reason in recorder.refused.items():
        console.print(f"not recorded: {topic}: {reason}")
    for topic, note in recorder.notes.items():
        console.print(f"note: {topic}: {note}")
    missing = [topic for topic in recorder.missing if topic in expected]
    if missing:
        console.print(f"nobody published: {', '.join(missing)}")
