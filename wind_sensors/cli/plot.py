"""`wind plot`: figures of a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.progress import Progress

from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import check_writable, refused_in_words
from wind_sensors.recordings.reading import read_estimates, read_recording
from wind_sensors.report import style
from wind_sensors.report.plots import FIGURES, Estimates, draw
from wind_sensors.station.doubles import without_doubles


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    names = ", ".join(FIGURES)
    parser = subparsers.add_parser(
        "plot",
        help="figures of a recording",
        description=f"Draw a RECORDING: {names}. What `wind process` wrote shows the corrected "
        "wind with its uncertainty as well.",
    )
    parser.add_argument("recording", metavar="RECORDING", help="recording folder or bag")
    parser.add_argument("--station", metavar="FILE", help="station file of a bag")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the figures")
    parser.add_argument("--format", choices=("png", "svg"), default="png", help="default: png")
    parser.add_argument("--only", nargs="+", choices=tuple(FIGURES), help="draw only these")
    parser.add_argument("--force", action="store_true", help="replace figures that are there")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Draw the figures; 0 on success."""
    chosen = options.only or list(FIGURES)
    paths = {name: options.output / f"{name}.{options.format}" for name in chosen}
    taken = [str(path) for path in paths.values() if path.exists()]
    if taken and not options.force:
        raise UserError(
            "this exists already.", taken[0], "Choose another place with -o, or add --force."
        )
    if options.output.exists() and not options.output.is_dir():
        raise UserError("this is no folder.", str(options.output), "Choose another place with -o.")
    check_writable(options.output)
    with Progress(console=screen(stderr=True), transient=True) as progress:
        task = progress.add_task("drawing", total=len(chosen) + 1)
        recording = without_doubles(read_recording(options.recording, options.station))
        found = read_estimates(options.recording)
        estimates = Estimates(*found) if found is not None else None
        progress.advance(task)
        written = []
        for name in chosen:
            figure = draw(name, recording, estimates)
            if figure is not None:
                with refused_in_words(paths[name], "figure"):
                    options.output.mkdir(parents=True, exist_ok=True)
                    style.save(figure, str(paths[name]))
                written.append(paths[name])
            progress.advance(task)
    for path in written:
        print(f"wrote {path}")
    for name in chosen:
        if paths[name] not in written:
            print(f"{name}: the recording has nothing for it")
    return 0
