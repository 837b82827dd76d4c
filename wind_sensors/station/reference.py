"""The station file's reference for people, written from the schema itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from wind_sensors.station.model import Station
from wind_sensors.station.schema import KINDS, meaning, models_in

_INTRODUCTION = """# Station file

One YAML file says what is mounted, where, with which constants, and what is known to be wrong. It
serves recordings (`recording.yaml`), simulations and node parameters alike. Values are SI with
angles in radians, except keys that end in `_deg`; temperatures are in degrees Celsius. Every key
that describes a fault is healthy by default. A bare topic name may stand wherever an `Input` is
expected. `profile: NAME` fills the constants of an instrument from `config/instruments/NAME.yaml`;
keys that stand beside it win.

This page is written by `wind info --schema station`.
"""


def schema_markdown() -> str:
    """Every entry and key of the station file, as Markdown."""
    return entries_markdown(Station, _INTRODUCTION)


def entries_markdown(root: type[BaseModel], introduction: str) -> str:
    """An entry and everything below it, as Markdown tables under an introduction."""
    parts = [introduction]
    for model in _entries(root):
        kinds = [kind for kind, of in KINDS.items() if of is model]
        title = f"`kind: {kinds[0]}`" if kinds else model.__name__
        parts.append(f"\n## {title}\n\n{' '.join((model.__doc__ or '').split())}\n")
        parts.append("| key | value | default | meaning |\n|---|---|---|---|")
        for name, field in model.model_fields.items():
            cells = (f"`{name}`", _type(field), _default(field), meaning(field))
            parts.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(parts) + "\n"


def _entries(model: type[BaseModel], seen: set[str] | None = None) -> Iterator[type[BaseModel]]:
    """The entry and everything below it, each once."""
    seen = set() if seen is None else seen
    if model.__name__ in seen:
        return
    seen.add(model.__name__)
    yield model
    for field in model.model_fields.values():
        for child in models_in(field.annotation):
            yield from _entries(child, seen)


def _type(field: FieldInfo) -> str:
    text = re.sub(r"\b\w+\.(?=[A-Z])|wind_sensors\.[\w.]+\.", "", _annotation(field.annotation))
    limits = []
    for limit in field.metadata:
        for name, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
            bound = getattr(limit, name, None)
            if bound is not None:
                limits.append(f"{sign} {bound:g}")
    return f"{text} {', '.join(limits)}".strip()


def _annotation(annotation: Any) -> str:
    models = models_in(annotation)
    if models:
        names = " or ".join(model.__name__ for model in models)
        return f"list of {names}" if "tuple" in str(annotation) else names
    if annotation is type(None):
        return "nothing"
    if isinstance(annotation, type) and not get_args(annotation):
        names_of_types = {"str": "text", "float": "number", "int": "whole number", "bool": "yes/no"}
        return names_of_types.get(annotation.__name__, annotation.__name__)
    arguments = [a for a in get_args(annotation) if a is not Ellipsis and a is not type(None)]
    if get_origin(annotation) is Literal:
        return ", ".join(f"`{a}`" if a else "empty" for a in arguments)
    if "dict" in str(annotation):
        return "keys with values"
    if getattr(annotation, "__origin__", None) is tuple:
        many = Ellipsis in get_args(annotation)
        inner = _annotation(arguments[0])
        return f"list of {inner}" if many else f"{len(arguments)} x {inner}"
    shown = [_annotation(a) for a in arguments if not isinstance(a, FieldInfo)]
    return " or ".join(dict.fromkeys(shown)) or str(annotation)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.get_default(call_default_factory=True, validated_data={})
    if value is PydanticUndefined or value is None:
        return "none"
    if isinstance(value, BaseModel):
        return "its defaults"
    if value in ("", ()):
        return "empty"
    if isinstance(value, tuple):
        shown = (f"{item:g}" if isinstance(item, float) else f"'{item}'" for item in value)
        return f"`[{', '.join(shown)}]`"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"
