"""`wind import`: tables, logger exports and NMEA 0183 logs to a recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.progress import Progress

from wind_sensors.cli.info import duration
from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.recordings.importing import import_files, write_imported
from wind_sensors.recordings.mapping import MappingFile, read_mapping
from wind_sensors.recordings.station_files import configuration_folder
from wind_sensors.recordings.writing import keep_inputs

EPILOG = """\
The mapping file says which column or sentence becomes which topic, type and field, in which unit
and time zone, and carries the station file of the recording. Ready ones: {names}
(copy one of config/mappings and change it). Bad lines are counted and told, never fatal.
"""


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    names = ", ".join(sorted(path.stem for path in _shipped()))
    parser = subparsers.add_parser(
        "import",
        help="tables, logger exports and NMEA 0183 logs to a recording",
        description="Turn tables (CSV, TOA5, NRG exports; gzip too) or NMEA 0183 logs into a "
        "recording.",
        epilog=EPILOG.format(names=names),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help="files of one kind")
    parser.add_argument(
        "--mapping", required=True, help="mapping file, or the name of one that ships"
    )
    parser.add_argument("-o", "--output", required=True, type=Path, help="recording to write")
    parser.add_argument("--force", action="store_true", help="replace a recording that is there")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Import the files; 0 on success."""
    console = screen(stderr=True)
    keep_inputs(options.output, (*options.files, options.mapping))
    mapping_file = load_mapping(options.mapping)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("reading", total=len(options.files) + 1)
        imported = import_files(
            options.files, mapping_file, lambda path: progress.advance(task)
        )
        target = write_imported(options.output, imported, mapping_file, force=options.force)
        progress.advance(task)
    for topic in imported.topics:
        span = duration((int(topic.time[-1]) - int(topic.time[0])) * 1e-9)
        messages = "1 message" if len(topic.raw) == 1 else f"{len(topic.raw)} messages"
        print(f"  {topic.topic}: {messages} over {span}")
    for what, count in imported.faults.most_common():
        print(f"  left out: {count} {what}")
    for note in imported.notes:
        print(f"  note: {note}")
    averaging = mapping_file.station.recording.averaging_time
    if averaging:
        print(f"  every message is a mean over {averaging:g} s, stamped at its end")
    print(f"wrote {target}")
    return 0


def load_mapping(name: str) -> MappingFile:
    """A mapping file by its path or by the name it ships under.

    Raises:
        UserError: There is none, or it is wrong.
    """
    path = Path(name)
    if not path.exists() and not path.suffix and path.parent == Path():
        path = configuration_folder() / "mappings" / f"{name}.yaml"
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        names = ", ".join(sorted(p.stem for p in _shipped()))
        raise UserError(
            "there is no such mapping file.", name, f"Mappings that ship: {names}."
        ) from None
    return read_mapping(text, str(path))


def _shipped() -> list[Path]:
    return list((configuration_folder() / "mappings").glob("*.yaml"))
