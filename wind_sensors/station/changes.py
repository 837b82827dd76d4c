"""The station as it is at each moment, when the station file states changes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from pydantic import ValidationError

from wind_sensors.errors import UserError
from wind_sensors.station.model import Change, Entry, Platform, Station


@dataclass(frozen=True)
class Segment:
    """An interval in which nothing changes.

    Attributes:
        start, stop: Seconds since the start of the recording; `stop` is infinite in the last one.
        station: The station in it, with the changes applied and none left to apply.
    """

    start: float
    stop: float
    station: Station


def _merged(original: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Keys of `change` over those of `original`, group by group."""
    out = dict(original)
    for key, value in change.items():
        if isinstance(value, dict) and isinstance(out.get(key), dict):
            out[key] = _merged(out[key], value)
        else:
            out[key] = value
    return out


def _changed(entry: Entry, change: Change) -> Entry:
    """The entry with the keys that the change sets.

    Raises:
        UserError: A key does not exist or a value is out of its range.
    """
    try:
        return type(entry).model_validate(_merged(entry.model_dump(), change.set))
    except ValidationError as problem:
        first = problem.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise UserError(
            f"The change of '{change.instrument}' sets '{key}': {first['msg']}.",
            "changes",
            "Use a key of that entry with a value in its range.",
        ) from problem


def _with_change(station: Station, change: Change) -> Station:
    if change.instrument == "platform":
        platform = _changed(station.platform or Platform(), change)
        return station.model_copy(update={"platform": platform})
    instruments = tuple(
        _changed(i, change) if i.name == change.instrument else i for i in station.instruments
    )
    return station.model_copy(update={"instruments": instruments})


def segments(station: Station) -> tuple[Segment, ...]:
    """The intervals between changes, in order, from 0 to infinity.

    Where changes overlap, the one that stands later in the file wins.

    Raises:
        UserError: A change cannot be applied.
    """
    infinity = float("inf")
    healthy = station.model_copy(update={"changes": ()})
    if not station.changes:
        return (Segment(0.0, infinity, healthy),)
    edges = {0.0, infinity}
    for change in station.changes:
        edges.add(max(change.start, 0.0))
        edges.add(infinity if change.stop is None else max(change.stop, 0.0))
    cuts = sorted(edges)
    out = []
    for start, stop in pairwise(cuts):
        here = healthy
        for change in station.changes:
            if change.start <= start and (change.stop is None or start < change.stop):
                here = _with_change(here, change)
        out.append(Segment(start, stop, here))
    return tuple(out)
