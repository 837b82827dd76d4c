"""`wind diagnose`: find the physics that a station file leaves out."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.text import Text

from wind_sensors.cli.baseline import learnt, workers
from wind_sensors.cli.findings import print_finding
from wind_sensors.cli.other_references import diagnose_otherwise, other_reference
from wind_sensors.cli.screen import screen
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.errors import UserError
from wind_sensors.recordings.baseline_file import read_baseline
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.reading import read_recording
from wind_sensors.report.diagnosis_files import make_way, write
from wind_sensors.report.diagnosis_page import when_text
from wind_sensors.report.names import names_of
from wind_sensors.report.sizes import sizes_of


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "diagnose",
        help="find the physics that a station file leaves out",
        description="Compare a RECORDING with the simulation of its station, name the physics "
        "that was left out, and prove it on data that were not fitted. Writes diagnosis.json, "
        "report.html, station_corrected.yaml and residuals/.",
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
    parser.add_argument(
        "--without", metavar="EFFECT", nargs="+", action="extend", default=[],
        help="effects to take out of the catalogue",
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder")
    parser.add_argument("--force", action="store_true", help="replace an earlier diagnosis")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Diagnose and write; 0 whatever the verdict."""
    effects = catalogue_without(options.without)
    inputs = (options.recording, options.station, *options.healthy, options.baseline)
    make_way(options.output, inputs=inputs, force=options.force)
    if options.baseline is not None and options.healthy:
        raise UserError("both a baseline and healthy recordings are given.", "", "Give one.")
    with Progress(console=screen(stderr=True), transient=True) as progress:
        recording = read_recording(options.recording, options.station)
        if other_reference(recording):
            return diagnose_otherwise(options, recording, progress)
        if options.baseline is not None:
            baseline = read_baseline(options.baseline, recording.station)
        else:
            baseline = learnt(
                options.healthy, options.station, progress, options.recording, recording.station
            )
        tasks: dict[str, TaskID] = {}

        def report(phase: str, share: float) -> None:
            if phase not in tasks:
                tasks[phase] = progress.add_task(phase, total=1.0)
            progress.update(tasks[phase], completed=share)

        diagnosis = diagnose(recording, baseline, effects, workers(), report)
        with refused_in_words(options.output):
            written = write(options.output, diagnosis, without=sorted(set(options.without)))
    _print(screen(), diagnosis)
    if options.without:
        print(f"taken out of the catalogue: {', '.join(sorted(set(options.without)))}")
    for path in written:
        print(f"wrote {path}")
    return 0


def catalogue_without(names: Sequence[str]) -> dict[str, Effect]:
    """The catalogue less some effects.

    Raises:
        UserError: There is no effect of a name.
    """
    known = catalogue()
    unknown = sorted(set(names) - set(known))
    if unknown:
        close = [get_close_matches(name, known, n=1) for name in unknown]
        guess = f"Did you mean {' and '.join(c[0] for c in close)}?" if all(close) else (
            f"The effects are {', '.join(sorted(known))}."
        )
        raise UserError(
            f"no effect is called {', '.join(map(repr, unknown))}.", "--without", guess
        )
    return {name: effect for name, effect in known.items() if name not in names}


def print_notes(console: Console, notes: Sequence[str]) -> None:
    """What reading a recording had to say."""
    for note in notes:
        console.print(f"note: {note}")


def _print(console: Console, diagnosis: Diagnosis) -> None:
    names = names_of(diagnosis.findings)
    verdict = f": {diagnosis.verdict}" + (f": {names}" if names else "")
    console.print(Text.assemble((diagnosis.recording, "bold"), verdict))
    for silent in diagnosis.silent:
        console.print(Text.assemble(("silent", "bold red"), f" {silent.words}"))
    if not diagnosis.calibrated:
        console.print(
            "null not calibrated: nobody told what is normal for this station, so that only what "
            "is plain gets a name; give --healthy recordings of it"
        )
    print_notes(console, diagnosis.comparison.recording.notes)
    if diagnosis.findings:
        for f in diagnosis.findings:
            removed = ""
            if f.proof is not None:
                removed = f"{100.0 * f.proof.excess_removed:.0f} % "
                removed += f"({100.0 * f.proof.low:.0f} to {100.0 * f.proof.high:.0f} %)"
            sizes = sizes_of(f, diagnosis.station)
            print_finding(console, f, sizes, when_text(f.term), removed)
        console.print(
            "in brackets: 95 % intervals; held out: share of the excess misfit, on data that were "
            "not fitted"
        )
    if diagnosis.unexplained.description:
        console.print(f"left over: {diagnosis.unexplained.description}")
