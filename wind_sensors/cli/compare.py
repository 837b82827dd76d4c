"""`wind compare`: recorded minus simulated."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.progress import Progress
from rich.table import Table

from wind_sensors.cli.baseline import learnt
from wind_sensors.cli.diagnose import print_notes
from wind_sensors.cli.screen import screen
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.regions import region_bank, strongest
from wind_sensors.errors import UserError
from wind_sensors.recordings.baseline_file import read_baseline
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.reading import read_recording
from wind_sensors.report.comparison_files import NAMES, NO_READINGS, unread, write
from wind_sensors.report.diagnosis_files import make_way


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "compare",
        help="recorded minus simulated: where a recording differs from its station",
        description="Drive the simulation of a station with the reference wind of a RECORDING and "
        "show what differs: over time, wind direction, speed and frequency. Names nothing; "
        "`wind diagnose` does. Writes comparison.json, comparison.html and residuals/.",
    )
    parser.add_argument("recording", metavar="RECORDING", help="recording folder or bag")
    parser.add_argument("--station", metavar="FILE", help="station file of a bag")
    parser.add_argument(
        "--healthy", metavar="RECORDING", nargs="+", action="extend", default=[],
        help="recordings of the same station while nothing was wrong",
    )
    parser.add_argument(
        "--baseline", metavar="FILE", type=Path, help="what `wind baseline` wrote, instead"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder")
    parser.add_argument("--force", action="store_true", help="replace an earlier comparison")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Compare and write; 0 on success."""
    inputs = (options.recording, options.station, *options.healthy, options.baseline)
    make_way(options.output, NAMES, inputs=inputs, force=options.force)
    if options.baseline is not None and options.healthy:
        raise UserError("both a baseline and healthy recordings are given.", "", "Give one.")
    with Progress(console=screen(stderr=True), transient=True) as progress:
        recording = read_recording(options.recording, options.station)
        if options.baseline is not None:
            baseline = read_baseline(options.baseline, recording.station)
        else:
            baseline = learnt(
                options.healthy, options.station, progress, options.recording, recording.station
            )
        task = progress.add_task("comparing", total=1.0)
        baseline = baseline.for_station(recording.station)
        comparison = prepare(recording, baseline.station, baseline.place)
        searcher = searcher_of(
            comparison, baseline, catalogue(), {},
            progress=lambda share: progress.update(task, completed=0.8 * share),
        )
        simulated = searcher.bank.without
        whitener = searcher.whitener(simulated)
        bank = region_bank(whitener, simulated)
        found = strongest(whitener, bank, whitener.of(simulated), simulated, 12)
        p = bank.p_value(found[0].score)
        with refused_in_words(options.output):
            written = write(options.output, comparison, simulated, found, p)
    console = screen()
    table = Table(box=None)
    for column in ("channel", "mean residual", "rms residual"):
        table.add_column(column)
    for channel in comparison.channels:
        residual = comparison.measured.series[channel.name] - simulated.series[channel.name]
        unit = "m/s"
        if channel.kind == "vane_angle":
            residual, unit = np.degrees(residual / comparison.speed), "deg"
        table.add_row(
            channel.name,
            f"{np.mean(residual):+.3f} {unit}",
            f"{np.sqrt(np.mean(residual**2)):.3f} {unit}",
        )
    for name in unread(comparison):
        table.add_row(name, NO_READINGS, NO_READINGS)
    console.print(table)
    print_notes(console, recording.notes)
    top = found[0]
    console.print(
        f"stands out most: {top.region.channel}, {top.region.label} "
        f"({top.excess:+.3g} {top.unit}, p = {p:.3g})"
    )
    for path in written:
        print(f"wrote {path}")
    return 0
