"""`wind replay`: a recording as live topics."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, TextColumn

from wind_sensors.cli.numbers import count, positive
from wind_sensors.cli.ros_arguments import add_ros_arguments, ros_arguments
from wind_sensors.cli.screen import screen

if TYPE_CHECKING:
    from wind_sensors.nodes.player import PlayerNode
    from wind_sensors.recordings.bag import BagContent


def register(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "replay",
        help="publish a recording as live topics",
        description="Publish the messages of a recording at their times of recording, with "
        "/clock, so that nodes with use_sim_time see the time of the recording.",
    )
    parser.add_argument("recording", metavar="RECORDING", help="recording folder, or a bag")
    parser.add_argument("--rate", type=positive, default=1.0, metavar="X", help="X times as fast")
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--topics",
        nargs="+",
        metavar="TOPIC",
        help="these topics (default: all whose message types are installed)",
    )
    which.add_argument(
        "--inputs-only",
        action="store_true",
        help="the inputs of the recording's station, /tf and /tf_static; of a bag without a "
        "station file all but what an estimator had published",
    )
    parser.add_argument(
        "--no-clock", dest="clock", action="store_false", help="do not publish /clock"
    )
    parser.add_argument(
        "--wait-for",
        type=count,
        default=0,
        metavar="N",
        help="begin when each topic has N subscribers",
    )
    add_ros_arguments(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from wind_sensors.errors import UserError
    from wind_sensors.nodes import execution
    from wind_sensors.recordings.bag import read_bag
    from wind_sensors.recordings.reading import BAG_FOLDER
    from wind_sensors.station.topic_names import refuse_other_texts

    refuse_other_texts(args.topics or (), "--topics")
    folder = Path(args.recording)
    if not folder.exists():
        raise UserError("there is no such recording.", str(folder), "Check the path.")
    content = read_bag(folder / BAG_FOLDER if (folder / BAG_FOLDER).exists() else folder)
    console = screen()
    for note in content.notes:
        console.print(f"note: {note}")
    made: list[PlayerNode] = []

    def build() -> list[PlayerNode]:
        from wind_sensors.nodes.player import PlayerNode

        if args.inputs_only:
            _leave_inputs(content, folder)
        made.append(
            PlayerNode(
                content,
                args.topics,
                rate=args.rate,
                loop=args.loop,
                with_clock=args.clock,
                wait_for_subscribers=args.wait_for,
            )
        )
        for note in made[0].notes:
            console.print(f"note: {note}")
        return made

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s"),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("replaying", total=1.0)

        def until() -> bool:
            player = made[0]
            progress.update(task, completed=player.position, total=player.duration)
            return player.finished

        execution.run(build, ros_arguments(args), until=until)
    if made:
        console.print(f"Published {made[0].published} messages from {args.recording}.")
    return 0


def _leave_inputs(content: BagContent, folder: Path) -> None:
    """Take from a bag's content what is no input of its station, or what an estimator published.

    Raises:
        UserError: Nothing is left, or the station file is wrong.
    """
    from wind_sensors.errors import UserError
    from wind_sensors.nodes.topics import TRANSFORM_TOPICS, is_output
    from wind_sensors.recordings import load_station
    from wind_sensors.recordings.reading import STATION_FILE, home_of, station_topics

    file = home_of(folder) / STATION_FILE
    inputs = station_topics(load_station(file)) | TRANSFORM_TOPICS if file.exists() else None
    names = sorted(content.topics)
    for name in names:
        message_type = content.topics[name].message_type
        if is_output(name, message_type) if inputs is None else name not in inputs:
            del content.topics[name]
    if not content.topics:
        raise UserError(
            "the bag has no topic of the station's inputs.",
            str(folder),
            f"Topics in the bag: {', '.join(names)}.",
        )
