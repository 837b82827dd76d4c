"""From a station to the text of a station file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from io import StringIO
from typing import Any

from pydantic import BaseModel
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedSeq

from wind_sensors.station.model import Input, Instrument, Station
from wind_sensors.station.profiles import Profile

_COARSEST = 0.1
"""No rounding is coarser, so that moments late in a recording stay apart."""


def station_to_yaml(
    station: Station,
    profiles: Mapping[str, Profile] | None = None,
    *,
    digits: int | None = None,
) -> str:
    """The station file that reads back as this station.

    Only keys that differ from their default are written, and the constants of a profile that an
    instrument names, because leaving one out would bring the profile's value back.

    Args:
        station: The station.
        profiles: Profiles that the instruments name; without them every key that an instrument
            was given is written.
        digits: Significant ones of the numbers, for constants that were fitted; None: all.
    """
    stream = StringIO()
    writer = YAML()
    writer.width = 100
    document = _entry(station, profiles)
    writer.dump(document if digits is None else _rounded(document, digits), stream)
    return stream.getvalue()


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(item, digits) for key, item in value.items()}
    if isinstance(value, CommentedSeq):
        for place, item in enumerate(value):
            value[place] = _rounded(item, digits)
        return value
    if isinstance(value, float) and math.isfinite(value):
        short = float(f"{value:.{digits}g}")
        return short if abs(short - value) <= 0.5 * _COARSEST else round(value, 1)
    return value


def _entry(entry: BaseModel, profiles: Mapping[str, Profile] | None) -> Any:
    keys = _given(entry, profiles)
    if isinstance(entry, Input) and keys == {"topic"}:
        return entry.topic
    names = list(type(entry).model_fields)
    names.sort(key=lambda name: {"name": 0, "kind": 1, "profile": 2}.get(name, 3))
    return {name: _plain(getattr(entry, name), profiles) for name in names if name in keys}


def _given(entry: BaseModel, profiles: Mapping[str, Profile] | None) -> set[str]:
    """Keys that must be written."""
    fields = type(entry).model_fields
    given = {
        name
        for name, field in fields.items()
        if field.is_required() or getattr(entry, name) != field.get_default()
    }
    if isinstance(entry, Instrument):
        given.add("kind")
        profile = (profiles or {}).get(entry.profile)
        if profile is not None:
            given |= set(profile.constants)
        elif entry.profile:
            given |= entry.model_fields_set
    return given


def _plain(value: Any, profiles: Mapping[str, Profile] | None) -> Any:
    if isinstance(value, BaseModel):
        return _entry(value, profiles)
    if isinstance(value, dict):
        return {key: _plain(item, profiles) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        items = CommentedSeq(_plain(item, profiles) for item in value)
        if not any(isinstance(item, dict) for item in items):
            items.fa.set_flow_style()
        return items
    return value
