"""`wind compose`: simulator, estimator and recorder of a station in one process."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, Progress, TextColumn

from wind_sensors.cli.durations import METAVAR, seconds
from wind_sensors.cli.ros_arguments import add_ros_arguments, ros_arguments
from wind_sensors.cli.screen import screen

if TYPE_CHECKING:
    from rclpy.node import Node

    from wind_sensors.nodes.composition import Composition


def register(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "compose",
        help="simulator, estimators and recorder of a station in one process",
        description="Run the simulated signals of a station, the estimator that fits its "
        "instruments and, with -o, a recorder in one process, until Ctrl-C or --duration; the "
        "averaging window that is under way then is published as far as it has come. Every "
        "further parameter of the nodes: --ros-args -p sim_node:NAME:=VALUE (or -p "
        "cup_vane_node:NAME:=VALUE).",
    )
    parser.add_argument(
        "station", metavar="STATION", help="station file, or the name of a shipped configuration"
    )
    parser.add_argument("-o", "--output", metavar="OUT", help="record everything to OUT")
    parser.add_argument("--force", action="store_true", help="replace OUT")
    parser.add_argument(
        "--duration", type=seconds, default=0.0, metavar=METAVAR,
        help="simulated time, like 90s, 15min, 1h (default: until Ctrl-C)",
    )
    parser.add_argument(
        "--rate",
        type=float,
        default=1.0,
        metavar="X",
        help="X times as fast as real time, with /clock",
    )
    parser.add_argument("--seed", type=int, help="of everything random")
    parser.add_argument("--mean-speed", type=float, metavar="M/S", help="mean wind speed")
    parser.add_argument(
        "--intensity", type=float, metavar="SHARE", help="turbulence intensity sigma/U"
    )
    parser.add_argument("--method", help="kalman, inverse or naive")
    parser.add_argument(
        "--window", type=seconds, metavar=METAVAR, help="averaging time (default: 10min)"
    )
    add_ros_arguments(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from wind_sensors.cli.record import show
    from wind_sensors.nodes import execution
    from wind_sensors.recordings.writing import keep_inputs

    _check(args)
    if args.output:
        keep_inputs(args.output, (args.station,))
    simulation: dict[str, object] = {
        "duration": args.duration,
        "speed": args.rate,
        "seed": args.seed,
        "mean_speed": args.mean_speed,
        "intensity": args.intensity,
        "publish_truth": True,
        "publish_clock": args.rate != 1.0,
    }
    estimation: dict[str, object] = {"method": args.method, "window": args.window}
    made: list[Composition] = []

    def build() -> list[Node]:
        from wind_sensors.nodes.composition import Composition

        made.append(
            Composition(args.station, simulation, estimation, args.output, force=args.force)
        )
        return made[0].nodes()

    console = screen()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.0f} s"),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting", total=args.duration or None)

        def until() -> bool:
            progress.update(
                task,
                completed=made[0].simulator.elapsed,
                description=made[0].estimator.last_wind or "no wind yet",
            )
            return made[0].has_ended()

        def wind_up() -> bool:
            return made[0].wind_up()

        execution.run(build, ros_arguments(args), until=until, wind_up=wind_up)
    if made and made[0].recorder is not None:
        show(made[0].recorder, args.output, console)
    return 0


def _check(args: argparse.Namespace) -> None:
    """Judge the options by the limits of the parameters behind them, under their own names.

    Raises:
        UserError: A value is not acceptable.
    """
    from wind_sensors.errors import UserError
    from wind_sensors.nodes import estimator_parameters, simulator

    simulation = {p.name: p for p in simulator.NODE_PARAMETERS}
    estimation = {p.name: p for p in estimator_parameters.NODE_PARAMETERS}
    for option, value, parameter in (
        ("--duration", args.duration, simulation["duration"]),
        ("--rate", args.rate, simulation["speed"]),
        ("--seed", args.seed, simulation["seed"]),
        ("--mean-speed", args.mean_speed, simulation["mean_speed"]),
        ("--intensity", args.intensity, simulation["intensity"]),
        ("--method", args.method, estimation["method"]),
        ("--window", args.window, estimation["window"]),
    ):
        if value is None:
            continue
        try:
            parameter.accept(value)
        except ValueError as problem:
            raise UserError(
                f"{problem}.".replace(f"'{parameter.name}'", "this"),
                option,
                f"It means: {parameter.description}",
            ) from None
