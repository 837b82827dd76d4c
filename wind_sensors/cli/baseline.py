"""`wind baseline`: learn from healthy recordings what is normal for a station."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.progress import Progress

from wind_sensors.cli.screen import screen
from wind_sensors.diagnosis.comparing.reference_place import Place
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import complete, default_baseline, learn
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import check_writable, refused_in_words
from wind_sensors.recordings.reading import home_of, read_recording
from wind_sensors.station.model import Station
from wind_sensors.station.sameness import refuse_another
from wind_sensors.station.signals import Recording


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


def read_healthy(
    healthy: Sequence[str],
    station_file: str | None,
    diagnosed: str | None = None,
    station: Station | None = None,
    advance: Callable[[], None] = lambda: None,
) -> list[Recording]:
    """Healthy recordings of one station, each once.

    Args:
        healthy: Folders or bags.
        station_file: Station file that replaces their own.
        diagnosed: The recording that they are to judge, if there is one.
        station: Its station; None: that of the first of them.
        advance: Called after each.

    Raises:
        UserError: One cannot be read, is named twice, is the diagnosed one, or is of another
            station.
    """
    places: dict[Path, str] = {}
    if diagnosed is not None:
        places[home_of(Path(diagnosed)).resolve()] = "it is the recording that is to be judged"
    found: list[Recording] = []
    for path in healthy:
        place = home_of(Path(path)).resolve()
        if place in places:
            raise UserError(
                f"this cannot be a healthy recording: {places[place]}.",
                path,
                "Name recordings of the same station while nothing was wrong, each once.",
            )
        places[place] = "it is named twice"
        found.append(read_recording(path, station_file))
        if station is None:
            station = found[0].station
        refuse_another(station, found[-1].station, path)
        advance()
    return found


def learnt(
    healthy: Sequence[str],
    station_file: str | None,
    progress: Progress,
    diagnosed: str | None = None,
    station: Station | None = None,
) -> Baseline:
    """A baseline from healthy recordings, or from tolerances when there are none.

    Args:
        healthy, station_file, diagnosed, station: As in `read_healthy`.
        progress: Shows how far it is.

    Raises:
        UserError: As in `read_healthy`, or there is neither a recording nor a station.
    """
    task = progress.add_task("reading healthy recordings", total=max(len(healthy), 1))
    recordings = read_healthy(
        healthy, station_file, diagnosed, station, lambda: progress.advance(task)
    )
    if not recordings:
        if station is None:
            raise UserError("no healthy recording is named.", "", "Name at least one.")
        return default_baseline(station)
    kept = complete(recordings)
    for recording in recordings:
        if all(recording is not other for other in kept):
            progress.console.print(
                f"{recording.name} is left out: an instrument says nothing in it"
            )
    learning = progress.add_task("learning what is normal", total=1.0)
    return learn(
        kept,
        station,
        workers(),
        lambda share: progress.update(learning, completed=share),
    )


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
    with Progress(console=screen(stderr=True), transient=True) as progress:
        baseline = learnt(options.recordings, options.station, progress)
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
