"""`wind baseline`: learn from healthy recordings what is normal for a station."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from wind_sensors.diagnosis.comparing.reference_place import Place
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import complete, default_baseline, learn
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import check_writable, refused_in_words
from wind_sensors.recordings.reading import read_recording
from wind_sensors.station.model import Station


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "baseline",
        help="learn from healthy recordings what is normal for a station",
        description="Learn the standing difference between a station and its simulation from "
        "RECORDINGs made while nothing was wrong. `wind diagnose --baseline FILE` reuses it.",
    )
    parser.add_argument("recordings", metavar="RECORDING", nargs="+", help="healthy recordings")
    parser.add_argument("--station", metavar="FILE", help="station file of bags")
    parser.add_argument("-o", "--output", type=Path, required=True, help="file, e.g. baseline.json")
    parser.add_argument("--force", action="store_true", help="replace a file that is there")
    parser.set_defaults(run=run)


def workers() -> int:
    """Processes worth starting on this machine."""
    return min(2, os.cpu_count() or 1)


def learnt(
    healthy: Sequence[str], station_file: str | None, station: Station | None, progress: Progress
) -> Baseline:
    """A baseline from healthy recordings, or from tolerances when there are none.

    Raises:
        UserError: A recording cannot be read, or there is neither a recording nor a station.
    """
    recordings = []
    task = progress.add_task("reading healthy recordings", total=max(len(healthy), 1))
    for path in healthy:
        recordings.append(read_recording(path, station_file))
        progress.advance(task)
    if not recordings:
        if station is None:
            raise UserError("no healthy recording is named.", "", "Name at least one.")
        return default_baseline(station)
    kept = complete(recordings)
    for recording in recordings:
        if all(recording is not other for other in kept):
            progress.console.print(
                f"{recording.name} is left out: an instrument says nothing in it", highlight=False
            )
    learning = progress.add_task("learning what is normal", total=1.0)
    return learn(
        kept,
        station,
        workers(),
        lambda share: progress.update(learning, completed=share),
    )


def read_baseline(path: Path) -> Baseline:
    """A baseline from its file.

    Raises:
        UserError: The file is absent or something else.
    """
    try:
        return Baseline.from_json(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise UserError(
            f"the baseline cannot be read ({problem.strerror}).",
            str(path),
            "Make one with `wind baseline HEALTHY... -o FILE`.",
        ) from None
    except ValueError:
        raise UserError(
            "this is not a baseline of this version.",
            str(path),
            "Make one with `wind baseline HEALTHY... -o FILE`.",
        ) from None


def run(options: argparse.Namespace) -> int:
    """Learn and write; 0 on success."""
    if options.output.exists() and not options.force:
        raise UserError(
            "this exists already.",
            str(options.output),
            "Choose another place with -o, or add --force.",
        )
    if options.output.is_dir():
        raise UserError("this is a folder.", str(options.output), "Name a file with -o.")
    check_writable(options.output.parent)
    with Progress(console=Console(stderr=True), transient=True) as progress:
        baseline = learnt(options.recordings, options.station, None, progress)
    with refused_in_words(options.output, "baseline"):
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(baseline.to_json() + "\n", encoding="utf-8")
    print(f"wrote {options.output} from {len(baseline.recordings)} healthy recordings")
    if baseline.place is not None:
        print(told_place(baseline.place))
    return 0


def told_place(place: Place) -> str:
    """Where healthy delays say that the reference stands, for people."""
    return (
        "delays tell that the reference stands "
        f"{place.x:.2f} m along the sensors' x and {place.y:.2f} m along their y "
        f"(± {place.error:.2f} m) from the instruments"
    )
