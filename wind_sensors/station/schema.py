"""The station schema as data: which keys an entry has, and what each one means."""

from __future__ import annotations

from typing import Any, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wind_sensors.station.document import Path
from wind_sensors.station.model import Bivane, Cup, Input, Instrument, Propeller, Station, Vane

KINDS: dict[str, type[BaseModel]] = {
    "cup": Cup,
    "propeller": Propeller,
    "vane": Vane,
    "bivane": Bivane,
}


def models_in(annotation: Any) -> list[type[BaseModel]]:
    """Every model named anywhere in a type annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in models_in(part)]


def entry_at(
    path: Path, data: Any, root: type[BaseModel] = Station
) -> type[BaseModel] | None:
    """The model of the entry at a path of the document.

    Args:
        path: Keys and indices without the tags that pydantic adds.
        data: The document, for the `kind` of instruments.
        root: The model of the document.

    Returns:
        The model; None where the path does not lead to an entry.
    """
    model = root
    for step in path:
        data = _child(data, step)
        if isinstance(step, int):
            if issubclass(model, Instrument):
                model = KINDS.get(str(_child(data, "kind")), model)
            continue
        field = model.model_fields.get(step)
        candidates = models_in(field.annotation) if field is not None else []
        if not candidates:
            return None
        model = candidates[0]
    return model


def _child(data: Any, step: str | int) -> Any:
    if isinstance(data, dict):
        return data.get(step)
    if isinstance(data, list) and isinstance(step, int) and step < len(data):
        return data[step]
    return None


def field_at(path: Path, data: Any, root: type[BaseModel] = Station) -> FieldInfo | None:
    """The declaration of the key at a path; None where there is none. Arguments as `entry_at`."""
    names = [step for step in path if isinstance(step, str)]
    if not names:
        return None
    last = max(index for index, step in enumerate(path) if isinstance(step, str))
    model = entry_at(path[:last], data, root)
    return model.model_fields.get(names[-1]) if model is not None else None


def is_input(field: FieldInfo) -> bool:
    """Whether a key takes an `Input`, so that a bare topic name may stand there."""
    return models_in(field.annotation) == [Input]


def meaning(field: FieldInfo | None) -> str:
    """The description of a key as one line, empty where there is none."""
    return " ".join(field.description.split()) if field and field.description else ""
