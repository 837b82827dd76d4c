"""`wind process`: the corrected wind of a recording, with its uncertainty."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from wind_sensors.errors import UserError
from wind_sensors.estimation import (
    METHODS,
    EstimatorSettings,
    HealthLevel,
    ProcessedRecording,
    WindowStatistics,
    must_compile,
    process,
)
from wind_sensors.estimation.constants import measures_vertical
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.recordings import write_recording
from wind_sensors.recordings.bag import TopicData
from wind_sensors.recordings.other_topics import OtherTopics
from wind_sensors.recordings.reading import (
    bag_of,
    name_of,
    open_recording,
    signals_of,
    station_topics,
)
from wind_sensors.recordings.writing import clear_target, keep_inputs
from wind_sensors.station.signals import Recording

_TERMS = {
    "u": "overspeeding (u)",
    "v": "speed against vector mean (v)",
    "w": "angular response (w)",
    "vane_lag": "vane lag",
    "translation": "propeller translation",
    "arithmetic_mean": "arithmetic mean",
}


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command's parser."""
    defaults = EstimatorSettings()
    parser = subparsers.add_parser(
        "process",
        help="signals to wind: corrected wind of a recording, with its uncertainty",
        description="Estimate the wind from a RECORDING's pulses and vane readings, and write a "
        "RECORDING whose bag carries the output topics (wind, wind/apparent, wind/mean, "
        "wind/bias, ...) beside the raw ones; topics that are not the station's are copied as "
        "they are. The same estimator runs in the live nodes and gives the same numbers for the "
        "same messages.",
    )
    parser.add_argument(
        "recording", metavar="RECORDING", help="folder with recording.yaml and bag/, or a bag"
    )
    parser.add_argument("--station", metavar="FILE", help="station file instead of the recording's")
    parser.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="folder of the new recording"
    )
    parser.add_argument("--force", action="store_true", help="replace OUT if it is there")
    parser.add_argument(
        "--method",
        choices=METHODS,
        default=defaults.method,
        help="kalman: turbulence and instruments as one stochastic model; inverse: the equations "
        "solved for the wind; naive: the calibration alone, for comparison (default: %(default)s)",
    )
    for name, unit, meaning in (
        ("window", "s", "averaging time of means, biases and direction variance"),
        ("output-rate", "Hz", "estimates per second"),
        ("smoother-lag", "s", "how much later data still improves an estimate; large: full"),
        ("bandwidth", "Hz", "half-power frequency of --method inverse"),
        ("adaptation-time", "s", "memory of the turbulence estimate"),
    ):
        parser.add_argument(
            f"--{name}",
            type=float,
            default=getattr(defaults, name.replace("-", "_")),
            metavar=unit,
            help=f"{meaning} (default: %(default)g {unit})",
        )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    settings = _settings(args)
    keep_inputs(args.output, (args.recording, args.station))
    if Path(args.output).exists() and not args.force:
        clear_target(Path(args.output), force=False)
    console = Console(stderr=True)
    if must_compile(settings):
        console.print("Compiling the estimator, once after an installation: about a minute.")
    with Progress(
        TextColumn("estimating the wind"),
        BarColumn(),
        TextColumn("{task.percentage:.0f} %"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    ) as progress:
        task = progress.add_task("process", total=1.0)
        recording, others = _read(args.recording, args.station)
        result = process(
            recording, settings, progress=lambda done: progress.update(task, completed=done)
        )
    folder = write_recording(
        args.output, recording, outputs=result, others=others, force=args.force
    )
    out = Console(file=sys.stdout, width=None if sys.stdout.isatty() else 110)
    _report(out, result, others.notes)
    print(f"wrote {folder}")
    return 0


def _settings(args: argparse.Namespace) -> EstimatorSettings:
    try:
        return EstimatorSettings(
            method=args.method,
            window=args.window,
            output_rate=args.output_rate,
            smoother_lag=args.smoother_lag,
            bandwidth=args.bandwidth,
            adaptation_time=args.adaptation_time,
        )
    except UserError as problem:
        option = f"--{problem.where.replace('_', '-')}"
        raise UserError(problem.what, option, problem.remedy) from None


def _read(path: str, station_file: str | None) -> tuple[Recording, OtherTopics]:
    """The recording, and what else is in its bag."""
    content, station = open_recording(path, station_file)
    recording = signals_of(content, station, name_of(path), path)
    read = {topic for topic, data in content.topics.items() if data.raw}
    named = {
        topic: TopicData(data.message_type, count=data.count)
        for topic, data in content.topics.items()
    }
    without_messages = replace(content, topics=named)
    others = OtherTopics(bag_of(Path(path)), without_messages, read | station_topics(station))
    return recording, others


def _report(console: Console, result: ProcessedRecording, further: Sequence[str]) -> None:
    for note in (*result.recording.notes, *further):
        console.print(f"note: {note}", highlight=False)
    for item in result.health:
        if item.level != HealthLevel.OK:
            console.print(f"{item.level.name.lower()}: {item.name}: {item.message}")
    if not result.windows:
        troubled = any(item.level >= HealthLevel.ERROR for item in result.health)
        reason = "for the reasons above" if troubled else "the recording is too short"
        console.print(f"No estimate: {reason}.")
        return
    start = result.recording.start
    table = Table(title=f"{result.recording.name}, {result.method}", title_justify="left")
    table.add_column("window [s]")
    with_vertical = measures_vertical(result.recording.station)
    components = 3 if with_vertical else 2
    turbulence = f"turbulence {', '.join('uvw'[:components])} [m/s]"
    for heading in ("mean speed [m/s]", "vector mean [m/s]", "from [deg]", turbulence,
                    "direction spread [deg]"):  # fmt: skip
        table.add_column(heading, justify="right")
    if with_vertical:
        table.add_column("upwards [m/s]", justify="right")
    for window in result.windows:
        lift = [_lift(window)] if with_vertical else []
        table.add_row(*_cells(window, start, components), *lift)
    console.print(table)
    biases = Table(title="bias of the raw mean speed [% of the mean speed]", title_justify="left")
    biases.add_column("window [s]")
    for text in _TERMS.values():
        biases.add_column(text, justify="right")
    for window in result.windows:
        biases.add_row(
            _span(window, start),
            *(
                f"{100.0 * term.value:+.2f} ± {100.0 * term.uncertainty:.2f}"
                for term in (window.bias_terms[name] for name in _TERMS)
            ),
        )
    console.print(biases)


def _span(window: WindowStatistics, start: int) -> str:
    return f"{round((window.start - start) * 1e-9)} - {round((window.stop - start) * 1e-9)}"


def _lift(window: WindowStatistics) -> str:
    """Mean vertical wind with its uncertainty."""
    deviation = math.sqrt(max(float(window.vector_mean_covariance[2, 2]), 0.0))
    return f"{window.vector_mean[2]:+.3f} ± {deviation:.3f}"


def _spread(window: WindowStatistics) -> str:
    """Standard deviation of the wind's direction with its uncertainty [deg]."""
    variance, by = window.corrected_direction_variance, window.direction_variance_uncertainty
    least, spread, most = (math.sqrt(max(v, 0.0)) for v in (variance - by, variance, variance + by))
    return f"{math.degrees(spread):.1f} ± {math.degrees(0.5 * (most - least)):.1f}"


def _cells(window: WindowStatistics, start: int, components: int) -> list[str]:
    """Mean, direction, turbulence of one window as text with uncertainties."""
    east, north = float(window.vector_mean[0]), float(window.vector_mean[1])
    along = math.sqrt(max(float(window.vector_mean_covariance[0, 0]), 0.0))
    comes_from = float(direction_from_deg(window.vector_mean))
    return [
        _span(window, start),
        f"{window.scalar_mean:.3f} ± {window.scalar_mean_uncertainty:.3f}",
        f"{math.hypot(east, north):.3f} ± {along:.3f}",
        f"{comes_from:.1f} ± {math.degrees(window.direction_uncertainty):.1f}",
        ", ".join(f"{deviation:.2f}" for deviation in window.turbulence[:components]),
        _spread(window),
    ]
