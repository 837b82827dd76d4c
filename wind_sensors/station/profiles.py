"""Instrument profiles: constants from the literature under a name, with their source."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from wind_sensors.errors import UserError
from wind_sensors.station.document import parse
from wind_sensors.station.schema import KINDS


@dataclass(frozen=True)
class Profile:
    """Constants of one make of instrument.

    Attributes:
        name: As a station file names it.
        kind: `cup`, `propeller`, `vane` or `bivane`.
        description: One sentence.
        source: Where the constants come from.
        constants: Keys of the instrument with their values.
        missing: Required keys that the source does not give, with what is known about them.
    """

    name: str
    kind: str
    description: str
    source: str
    constants: dict[str, Any]
    missing: dict[str, str] = field(default_factory=dict)


def read_profile(text: str, name: str, file: str) -> Profile:
    """Read one profile.

    Args:
        text: YAML with `kind`, `description`, `source`, `constants` and optionally `missing`.
        name: The profile's name.
        file: File name for messages.

    Raises:
        UserError: A key is missing or is not one of the instrument's.
    """
    document = parse(text, file)
    data = document.data if isinstance(document.data, dict) else {}
    for key in ("kind", "description", "source", "constants"):
        if key not in data:
            raise UserError(f"the profile has no `{key}`.", file, "Add it.")
    kind = str(data["kind"])
    if kind not in KINDS:
        where = document.where(("kind",))
        raise UserError(f"no instrument of kind '{kind}'.", where, f"Kinds: {', '.join(KINDS)}.")
    for part in ("constants", "missing"):
        for key in data.get(part) or {}:
            if key not in KINDS[kind].model_fields:
                where = document.where((part, key))
                raise UserError(f"a {kind} has no key '{key}'.", where, "Check the spelling.")
    return Profile(
        name=name,
        kind=kind,
        description=str(data["description"]),
        source=str(data["source"]),
        constants=dict(data["constants"] or {}),
        missing={key: str(value) for key, value in (data.get("missing") or {}).items()},
    )
