"""`wind info`: what is in a recording or a station file."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table
from rich.text import Text

from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import BagContent, TopicData
from wind_sensors.recordings.mapping import mapping_markdown
from wind_sensors.recordings.reading import YAML_SUFFIXES, name_of, open_recording, signals_of
from wind_sensors.recordings.station_files import (
    configuration_folder,
    load_station,
    shipped_profiles,
)
from wind_sensors.station.inputs import absolute
from wind_sensors.station.model import Angle, Bivane, Cup, Input, Propeller, Station, Vane
from wind_sensors.station.reference import schema_markdown
from wind_sensors.station.signals import Recording, TimeArray

_PLAIN_WIDTH = 120
"""Of the tables where no terminal says its own."""
_SLOW = 10.0
"""Messages further apart than this [s] are told by their interval instead of their rate."""
_IN_WORDS = {
    "name", "kind", "profile", "distance_constant", "damping_ratio", "calibration_distance",
    "pulses_per_revolution", "mounted_on",
}
"""Keys of an instrument that have their own place or words."""


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "info",
        help="what is in a recording or a station file",
        description="Show what is in a RECORDING (topics, rates, gaps, what reading it had to "
        "say, the station) or in a station file.",
    )
    parser.add_argument("path", metavar="RECORDING", nargs="?", help="recording or station file")
    parser.add_argument("--station", metavar="FILE", help="station file of a bag")
    parser.add_argument("--profiles", action="store_true", help="list the instrument profiles")
    parser.add_argument(
        "--schema",
        choices=("station", "mapping"),
        help="print the reference of station or mapping files (Markdown)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print what is there; 0 on success."""
    console = screen(plain_width=_PLAIN_WIDTH)
    if options.schema:
        print(schema_markdown() if options.schema == "station" else mapping_markdown(), end="")
        return 0
    if options.profiles:
        _print_profiles(console)
        return 0
    if options.path is None:
        raise UserError(
            "no recording is named.", "", "Give a recording, a station file, or --profiles."
        )
    path = Path(options.path)
    shipped = {file.stem for file in configuration_folder().glob("*.yaml")}
    if not path.exists() and options.path not in shipped:
        raise UserError(
            "there is no such recording or station file.",
            options.path,
            f"Configurations that ship: {', '.join(sorted(shipped))}.",
        )
    if path.suffix in YAML_SUFFIXES or not path.exists():
        _print_station(console, load_station(path))
        return 0
    content, station = open_recording(path, options.station)
    recording = signals_of(content, station, name_of(path), str(path))
    seconds = (recording.stop - recording.start) * 1e-9
    start = np.datetime_as_string(np.datetime64(recording.start, "ns"), unit="ms")
    when = f"  {start}Z, {duration(seconds)}"
    console.print(Text.assemble((recording.name, "bold"), when))
    _print_topics(console, content, recording)
    _print_station(console, station)
    for note in recording.notes:
        console.print(Text.assemble(("note", "yellow"), f" {note}"))
    if not recording.notes:
        console.print(
            "reading had nothing to note; whether the signals make sense, `wind plot` and "
            "`wind diagnose` show"
        )
    return 0


def duration(seconds: float) -> str:
    """A span for people, in two units at most: `15 min`, `3 h 53 min`."""
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    parts = [(days, "d"), (hours, "h"), (minutes, "min"), (rest, "s")]
    first = next(k for k, (count, _) in enumerate(parts) if count)
    return " ".join(f"{count} {unit}" for count, unit in parts[first : first + 2] if count)


def _print_topics(console: Console, content: BagContent, recording: Recording) -> None:
    stamps = _stamps(recording)
    table = Table(box=None, pad_edge=False, title="topics", title_justify="left")
    table.add_column("topic", overflow="fold")
    table.add_column("type", no_wrap=True)
    for name in ("messages", "rate", "longest gap"):
        table.add_column(name, justify="right", no_wrap=True)
    for topic, data in sorted(content.topics.items()):
        rate, gap = _rate_and_gap(stamps.get(topic, _logged(data)))
        table.add_row(topic, data.message_type.replace("/msg/", "/"), f"{data.count}", rate, gap)
    console.print(table)


def _stamps(recording: Recording) -> dict[str, TimeArray]:
    """Stamps of the station's signals by topic, as the bag names it."""
    found: dict[str, TimeArray] = {}
    for instrument in recording.station.instruments:
        if isinstance(instrument, (Cup, Propeller)) and instrument.name in recording.pulses:
            found[absolute(instrument.pulses.topic)] = recording.pulses[instrument.name].time
        elif isinstance(instrument, Vane) and instrument.name in recording.angles:
            topic = absolute(instrument.joint_states.topic)
            found[topic] = recording.angles[instrument.name].time
    return found


def _logged(data: TopicData) -> TimeArray:
    return np.asarray(data.log_time, dtype=np.int64)


def _rate_and_gap(time: TimeArray) -> tuple[str, str]:
    if len(time) < 2:
        return "", ""
    ordered = np.sort(time)
    span = (int(ordered[-1]) - int(ordered[0])) * 1e-9
    between = np.diff(ordered) * 1e-9
    usual = float(np.median(between))
    rate = f"{(len(time) - 1) / span:.4g} Hz" if span > 0.0 else ""
    if usual > _SLOW:
        rate = f"every {duration(usual)}"
    return rate, duration(float(between.max()))


def _print_station(console: Console, station: Station) -> None:
    table = Table(box=None, pad_edge=False, title="station", title_justify="left")
    for name in ("instrument", "kind", "constants"):
        table.add_column(name, overflow="fold")
    for instrument in station.instruments:
        profile = f" ({instrument.profile})" if instrument.profile else ""
        table.add_row(instrument.name, instrument.kind + profile, _constants(instrument))
    if station.reference is not None:
        reference = station.reference
        text = f"{reference.separation:g} m away, path {reference.path_length:g} m"
        table.add_row("reference", reference.kind, text)
    if station.platform is not None:
        position = ", ".join(f"{x:g}" for x in station.platform.sensor_position)
        table.add_row("platform", "moving", f"sensor at ({position}) m")
    console.print(table)
    for change in station.changes:
        stop = "the end" if change.stop is None else f"{change.stop:g} s"
        keys = ", ".join(f"{key} = {value}" for key, value in change.set.items())
        console.print(f"from {change.start:g} s to {stop}: {change.instrument} {keys}")


def _constants(instrument: Cup | Propeller | Vane | Bivane) -> str:
    """All that differs from a perfect instrument, the usual constants in words."""
    if isinstance(instrument, Angle):
        text = f"distance constant {instrument.distance_constant:g} m, "
        return text + f"damping ratio {instrument.damping_ratio:g}" + _others(instrument)
    text = f"{instrument.calibration_distance:g} m/rad, {instrument.pulses_per_revolution} pulses"
    text += f" a turn, distance constant {instrument.distance_constant:g} m"
    if isinstance(instrument, Propeller) and instrument.mounted_on:
        text += f", on '{instrument.mounted_on}'"
    return text + _others(instrument)


def _others(entry: BaseModel) -> str:
    """Further keys that are not at their defaults, topics left out, as a sentence's end."""
    found = [f"{key} {value}" for key, value in _stated(entry).items() if key not in _IN_WORDS]
    return "".join(f", {text}" for text in found)


def _stated(entry: BaseModel) -> dict[str, str]:
    stated = {}
    for key, field in type(entry).model_fields.items():
        value = getattr(entry, key)
        if isinstance(value, Input) or (not field.is_required() and value == field.get_default()):
            continue
        stated[key] = _text(value)
    return stated


def _text(value: object) -> str:
    if isinstance(value, BaseModel):
        return f"({', '.join(f'{key} {text}' for key, text in _stated(value).items())})"
    if isinstance(value, tuple):
        return f"({', '.join(_text(item) for item in value)})"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _print_profiles(console: Console) -> None:
    table = Table(box=None, pad_edge=False)
    for name in ("profile", "kind", "what", "source"):
        table.add_column(name, overflow="fold")
    for profile in shipped_profiles().values():
        table.add_row(profile.name, profile.kind, profile.description, profile.source)
    console.print(table)
