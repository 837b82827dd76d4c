"""From a station to the text of a station file."""

from __future__ import annotations

from io import StringIO
from typing import Any

from pydantic import BaseModel
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedSeq

from wind_sensors.station.model import Input, Instrument, Station


def station_to_yaml(station: Station) -> str:
    """The station file that reads back as this station.

    Only keys that differ from their default are written. An instrument with a profile keeps every
    key that was given, because leaving one out would bring the profile's value back.
    """
    stream = StringIO()
    writer = YAML()
    writer.width = 100
    writer.dump(_entry(station), stream)
    return stream.getvalue()


def _entry(entry: BaseModel) -> Any:
    if isinstance(entry, Input) and _given(entry) == {"topic"}:
        return entry.topic
    keys = _given(entry)
    names = list(type(entry).model_fields)
    names.sort(key=lambda name: {"name": 0, "kind": 1, "profile": 2}.get(name, 3))
    return {name: _plain(getattr(entry, name)) for name in names if name in keys}


def _given(entry: BaseModel) -> set[str]:
    """Keys that must be written."""
    if isinstance(entry, Instrument) and entry.profile:
        return set(entry.model_fields_set) | {"kind", "name", "profile"}
    fields = type(entry).model_fields
    given = {
        name
        for name, field in fields.items()
        if field.is_required() or getattr(entry, name) != field.get_default()
    }
    return given | ({"kind"} if isinstance(entry, Instrument) else set())


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return _entry(value)
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        items = CommentedSeq(_plain(item) for item in value)
        if not any(isinstance(item, dict) for item in items):
            items.fa.set_flow_style()
        return items
    return value
