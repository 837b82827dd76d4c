"""The station as node parameters: a station file, parameters instead of it, or both.

Every scalar key of the station's schema is a parameter `<instrument>.<key>` (dotted where keys
nest, e.g. `cup.electronics.dead_time`). What is given as a parameter overrides the file.
"""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wind_sensors.errors import UserError
from wind_sensors.nodes.parameters import Parameter, Value
from wind_sensors.recordings import load_station
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.station.document import Document
from wind_sensors.station.model import Platform, Station
from wind_sensors.station.reading import station_of
from wind_sensors.station.schema import KINDS

STATION = Parameter(
    "station",
    str,
    "",
    "Station file, or the name of a configuration that ships with the package; empty: the "
    "instruments are described by parameters alone.",
)

FRAME_PATTERN = "[A-Za-z0-9_][A-Za-z0-9_./-]*"
"""Names of frames that tf2 takes: not empty, no leading slash, no spaces."""

FRAME_ID = Parameter(
    "frame_id",
    str,
    None,
    "Frame of earth-fixed vectors; its axes point east, north, up. Unset: the station file's "
    "recording.frame where it states one, else map.",
    pattern=FRAME_PATTERN,
)

_IDENTITY = frozenset({"name", "kind"})


class Role(NamedTuple):
    """An instrument that a node expects when no station file names the instruments.

    Attributes:
        name: Of the instrument.
        kind: As in the station file.
        keys: Keys with defaults that differ from the schema's.
    """

    name: str
    kind: str
    keys: Mapping[str, Any]


def base_document(file: str, roles: Sequence[Role]) -> dict[str, Any]:
    """The station before parameters: the file's, or one instrument for each role.

    Raises:
        UserError: The file is missing or wrong.
    """
    if file:
        return load_station(file).model_dump(mode="json", exclude_unset=True)
    return {"instruments": [{"name": r.name, "kind": r.kind, **r.keys} for r in roles]}


def station_table(document: Mapping[str, Any], *, changeable: bool) -> list[Parameter]:
    """Parameters for every scalar key of the document's instruments and platform.

    All are unset by default, which means the value of the station file, of the profile or of the
    schema.
    """
    table: list[Parameter] = []
    for entry in document["instruments"]:
        model = KINDS[str(entry["kind"])]
        table += _parameters(str(entry["name"]), model, changeable=changeable)
    if document.get("platform") is not None:
        table += _parameters("platform", Platform, changeable=changeable)
    return table


def station_with(document: Mapping[str, Any], values: Mapping[str, Value], where: str) -> Station:
    """The document's station with the given parameters.

    Args:
        document: From `base_document`.
        values: By parameter name; those that are None, and unknown names, change nothing.
        where: For messages.

    Raises:
        UserError: The station is incomplete or a value is wrong.
    """
    merged = {key: value for key, value in document.items() if key != "instruments"}
    merged["instruments"] = [
        _overridden(entry, str(entry["name"]), values) for entry in document["instruments"]
    ]
    if document.get("platform") is not None:
        merged["platform"] = _overridden(document["platform"], "platform", values)
    return station_of(Document(where, merged, {}), shipped_profiles())


def earth_frame(station: Station, given: Value) -> str:
    """The frame of earth-fixed vectors.

    Args:
        station: States it, or not.
        given: The value of `FRAME_ID`; wins.

    Raises:
        UserError: The station's name is none that tf2 takes.
    """
    if given is not None:
        return str(given)
    if "frame" not in station.recording.model_fields_set:
        return "map"
    try:
        return str(FRAME_ID.accept(station.recording.frame))
    except ValueError as problem:
        raise UserError(
            f"{problem}.", "recording.frame", "Mend it, or set the parameter frame_id."
        ) from None


def effective_value(station: Station, name: str) -> Any:
    """The station's value of a parameter from `station_table`.

    Returns:
        A value that a ROS parameter can hold, or None.
    """
    owner, *keys = name.split(".")
    node: Any = station.platform if owner == "platform" else station.instrument(owner)
    for key in keys:
        node = getattr(node, key, None)
    return list(node) if isinstance(node, tuple) else node


def _overridden(
    entry: Mapping[str, Any], owner: str, values: Mapping[str, Value]
) -> dict[str, Any]:
    result = dict(entry)
    for name, value in values.items():
        if value is None or not name.startswith(f"{owner}."):
            continue
        *parents, key = name[len(owner) + 1 :].split(".")
        level = result
        for parent in parents:
            below = level.get(parent)
            level[parent] = {"topic": below} if isinstance(below, str) else dict(below or {})
            level = level[parent]
        level[key] = list(value) if isinstance(value, tuple) else value
    return result


def _parameters(owner: str, model: type[BaseModel], *, changeable: bool) -> Iterator[Parameter]:
    for key, field in model.model_fields.items():
        name = f"{owner}.{key}"
        if key in _IDENTITY:
            continue
        nested = _nested_model(field)
        if nested is not None:
            # Topics cannot be exchanged while subscriptions exist.
            is_input = "topic" in nested.model_fields
            yield from _parameters(name, nested, changeable=changeable and not is_input)
            continue
        parameter = _scalar(name, field, changeable=changeable)
        if parameter is not None:
            yield parameter


def _alternatives(annotation: Any) -> list[Any]:
    if get_origin(annotation) in {Union, types.UnionType}:
        return [part for part in get_args(annotation) if part is not type(None)]
    return [annotation]


def _nested_model(field: FieldInfo) -> type[BaseModel] | None:
    (first, *_) = _alternatives(field.annotation)
    if isinstance(first, type) and issubclass(first, BaseModel):
        return first
    return None


def _scalar(name: str, field: FieldInfo, *, changeable: bool) -> Parameter | None:
    (annotation, *_) = _alternatives(field.annotation)
    constraints = [*field.metadata]
    if hasattr(annotation, "__metadata__"):
        for extra in annotation.__metadata__:
            constraints += extra.metadata if isinstance(extra, FieldInfo) else [extra]
        annotation = annotation.__origin__
    choices: tuple[str, ...] = ()
    kind: Any = annotation
    if get_origin(annotation) is Literal:
        kind, choices = str, tuple(str(choice) for choice in get_args(annotation))
    elif get_origin(annotation) is tuple:
        if any(part not in {float, Ellipsis} for part in get_args(annotation)):
            return None
        kind = tuple
    if kind not in {bool, int, float, str, tuple}:
        return None
    description = " ".join((field.description or "").split())
    unstated = field.is_required() or field.default in {None, ""}
    default = "" if unstated else f" Default {field.default}."
    return Parameter(
        name,
        kind,
        None,
        f"{description or 'As in the station file.'}{default}",
        minimum=_limit(constraints, (Gt, Ge)),
        maximum=_limit(constraints, (Lt, Le)),
        choices=choices,
        changeable=changeable,
    )


def _limit(constraints: Sequence[Any], kinds: tuple[type[Any], ...]) -> float | None:
    for constraint in constraints:
        if isinstance(constraint, kinds):
            for attribute in ("gt", "ge", "lt", "le"):
                value = getattr(constraint, attribute, None)
                if value is not None:
                    return float(value)
    return None


def require(station: Station, kinds: Sequence[str], node: str) -> None:
    """Check that a station has the instruments a node is for.

    Args:
        station: The station.
        kinds: Kinds of which there must be at least one each.
        node: Name of the node, for the message.

    Raises:
        UserError: One is missing; says which node fits.
    """
    present = [instrument.kind for instrument in station.instruments]
    missing = [kind for kind in kinds if kind not in present]
    if missing:
        raise UserError(
            f"{node} needs a {' and a '.join(missing)}, but the station has {', '.join(present)}.",
            remedy="Start the node that fits the instruments, or add the missing one.",
        )
