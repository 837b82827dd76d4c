"""`wind process`: the corrected wind of a recording, with its uncertainty."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from wind_sensors.cli.durations import METAVAR, seconds
from wind_sensors.cli.screen import screen
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
from wind_sensors.estimation.constants import measures_vertical, told_by
from wind_sensors.recordings import write_recording
from wind_sensors.recordings.bag import TopicData
from wind_sensors.recordings.other_topics import OtherTopics
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.reading import (
    bag_of,
    name_of,
    open_recording,
    signals_of,
    station_topics,
)
from wind_sensors.recordings.writing import clear_target, keep_inputs
from wind_sensors.report.window_table import (
    Quantity,
    bias_quantities,
    told_terms,
    wind_quantities,
    windows_csv,
)
from wind_sensors.station.signals import Recording

TABLE_FILE = "windows.csv"
"""In the new recording: its averaging windows, for a spreadsheet."""
_PLAIN_WIDTH = 120
"""Of the tables where no terminal says its own."""
_MOST_ROWS = 40
"""So many windows are shown; the file has all of them."""
_UNCERTAINTY = "±: standard uncertainty, one sigma (68 %)."
_SPEED_ABOVE_VECTOR = (
    "v: what veering wind makes the mean speed exceed the vector mean by; no error of the mean "
    "speed, which is told with it."
)
_ARITHMETIC_MEAN = (
    "arithmetic mean: by how much a mean over revolutions exceeds the mean over time; counted, so "
    "without uncertainty."
)


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command's parser."""
    defaults = EstimatorSettings()
    parser = subparsers.add_parser(
        "process",
        help="signals to wind: corrected wind of a recording, with its uncertainty",
        description="Estimate the wind from a RECORDING's pulses and vane readings, and write a "
        "RECORDING whose bag carries the output topics (wind, wind/apparent, wind/mean, "
        "wind/bias, ...) beside the raw ones; topics that are not the station's are copied as "
        f"they are. {TABLE_FILE} beside the bag has the averaging windows, for a spreadsheet. "
        "Behind ± stands the standard uncertainty (one sigma). The same estimator runs in the live "
        "nodes and gives the same numbers for the same messages.",
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
        help="kalman: turbulence and all rotors and vanes as one stochastic model; inverse: the "
        "equations solved for the wind, of the first rotor and its vane or of an array; naive: "
        "their calibration alone, for comparison (default: %(default)s)",
    )
    for name, kind, unit, meaning in (
        ("window", seconds, "s", "averaging time of means, biases and direction variance"),
        ("output-rate", float, "Hz", "estimates per second"),
        ("smoother-lag", seconds, "s", "how much later data still improves an estimate"),
        ("bandwidth", float, "Hz", "half-power frequency, only with --method inverse"),
        ("adaptation-time", seconds, "s", "memory of the turbulence estimate"),
    ):
        default = getattr(defaults, name.replace("-", "_"))
        parser.add_argument(
            f"--{name}",
            type=kind,
            default=None if name == "bandwidth" else default,
            metavar=METAVAR if kind is seconds else "HZ",
            help=f"{meaning} (default: {default:g} {unit})",
        )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the command; returns the exit status."""
    settings = _settings(args)
    keep_inputs(args.output, (args.recording, args.station))
    if Path(args.output).exists() and not args.force:
        clear_target(Path(args.output), force=False)
    console = screen(stderr=True)
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
        if must_compile(settings):
            console.print("Compiling the estimator, once after an installation: about a minute.")
        result = process(
            recording, settings, progress=lambda done: progress.update(task, completed=done)
        )
    folder = write_recording(
        args.output, recording, outputs=result, others=others, force=args.force
    )
    if result.windows:
        with refused_in_words(folder):
            (folder / TABLE_FILE).write_text(windows_csv(result), encoding="utf-8")
    _report(screen(plain_width=_PLAIN_WIDTH), result, others.notes)
    print(f"wrote {folder}")
    if result.windows:
        print(f"wrote {folder / TABLE_FILE}")
    return 0


def _settings(args: argparse.Namespace) -> EstimatorSettings:
    bandwidth = args.bandwidth
    if bandwidth is None:
        bandwidth = EstimatorSettings().bandwidth
    elif args.method != "inverse":
        raise UserError(
            "this has no effect without --method inverse.",
            "--bandwidth",
            "Add it, or leave this out.",
        )
    try:
        return EstimatorSettings(
            method=args.method,
            window=args.window,
            output_rate=args.output_rate,
            smoother_lag=args.smoother_lag,
            bandwidth=bandwidth,
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
        console.print(f"note: {note}")
    for item in result.health:
        if item.level != HealthLevel.OK:
            console.print(f"{item.level.name.lower()}: {item.name}: {item.message}")
    if not result.windows:
        troubled = any(item.level >= HealthLevel.ERROR for item in result.health)
        reason = "for the reasons above" if troubled else "the recording is too short"
        console.print(f"No estimate: {reason}.")
        return
    start = result.recording.start
    station = result.recording.station
    with_vertical, on_board = measures_vertical(station), station.platform is not None
    components = "uvw" if with_vertical else "uv"
    table = Table(title=_title(result), title_justify="left")
    table.add_column("window\n[s]")
    turbulence = f"turbulence {', '.join(components)}\n[m/s]"
    for heading in ("mean speed\n[m/s]", "vector mean\n[m/s]", "from\n[deg]", turbulence,
                    "direction spread\n[deg]"):
        table.add_column(heading, justify="right")
    if with_vertical:
        table.add_column("upwards\n[m/s]", justify="right")
    shown = result.windows[:_MOST_ROWS]
    for window in shown:
        quantities = wind_quantities(window, with_vertical=with_vertical, on_board=on_board)
        found = {q.name: q for q in quantities}
        table.add_row(
            _span(window, start),
            _told(found["mean speed"], ".3f"),
            _told(found["vector mean"], ".3f"),
            _told(found["from"], ".1f"),
            ", ".join(_told(found[f"turbulence {name}"], ".2f") for name in components),
            _told(found["direction spread"], ".1f"),
            *([_told(found["upwards"], "+.3f")] if with_vertical else []),
        )
    console.print(table)
    terms = told_terms(result)
    title = f"bias of the raw mean speed{', which is felt on board' if on_board else ''}"
    biases = Table(title=title, title_justify="left")
    biases.add_column("window\n[s]")
    for quantity in bias_quantities(result.windows[0], terms):
        biases.add_column(f"{quantity.name}\n[{quantity.unit}]", justify="right")
    for window in shown:
        told = (_told(bias, "+.2f") for bias in bias_quantities(window, terms))
        biases.add_row(_span(window, start), *told)
    console.print(biases)
    if len(shown) < len(result.windows):
        console.print(
            f"the first {len(shown)} of {len(result.windows)} windows; {TABLE_FILE} has all of them"
        )
    console.print(_UNCERTAINTY)
    if "v" in terms:
        console.print(_SPEED_ABOVE_VECTOR)
    if "arithmetic_mean" in terms:
        console.print(_ARITHMETIC_MEAN)


def _title(result: ProcessedRecording) -> str:
    """Whose signals the wind is told by, and whose count the raw speed."""
    station = result.recording.station
    used = told_by(station, result.method)
    unused = [i.name for i in station.instruments if i.name not in used]
    text = f"{result.recording.name}, {result.method}: wind of {', '.join(used)}"
    if unused:
        text += f"; not used: {', '.join(unused)}"
    return f"{text}; raw speed of {result.windows[0].instrument}"


def _span(window: WindowStatistics, start: int) -> str:
    return f"{round((window.start - start) * 1e-9)} - {round((window.stop - start) * 1e-9)}"


def _told(quantity: Quantity, form: str) -> str:
    """A number with its uncertainty, where it has one, or a dash where it was not measured.

    The columns' headings tell the units.
    """
    if not math.isfinite(quantity.value):
        return "-"
    text = format(quantity.value, form)
    if quantity.uncertainty is None:
        return text
    return f"{text} ± {format(quantity.uncertainty, form.lstrip('+'))}"
