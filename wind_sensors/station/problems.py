"""What is wrong with a station or mapping file, in words: place, key, fault, remedy."""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import Any, NamedTuple

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from wind_sensors.station.document import Document, Path
from wind_sensors.station.model import Station
from wind_sensors.station.schema import KINDS, entry_at, field_at, meaning


class Problem(NamedTuple):
    """One fault of a file."""

    where: str
    path: Path
    what: str
    remedy: str

    @property
    def key(self) -> str:
        """The path as people write it: `instruments[0].pulses.topic`."""
        text = ""
        for step in self.path:
            text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
        return text

    def __str__(self) -> str:
        key = f"{self.key}: " if self.path else ""
        return f"{self.where}: {key}{self.what} {self.remedy}".rstrip()


class Ceiling(NamedTuple):
    """The largest value that can be meant in SI, and what a larger one probably is."""

    value: float
    hint: str


_SPEED = "Speeds are in m/s."
_LENGTH = "Lengths are in metres; this looks like millimetres or centimetres."
CEILINGS: dict[str, Ceiling] = {
    "calibration_distance": Ceiling(5.0, f"Wind run per radian. {_LENGTH}"),
    "distance_constant": Ceiling(60.0, _LENGTH),
    "arm_radius": Ceiling(1.0, _LENGTH),
    "distance_to_vane_axis": Ceiling(5.0, _LENGTH),
    "measuring_height": Ceiling(500.0, _LENGTH),
    "roughness_length": Ceiling(10.0, _LENGTH),
    "path_length": Ceiling(2.0, _LENGTH),
    "reference_density": Ceiling(5.0, "Densities are in kg/m^3; this looks like g/m^3."),
    "reference_temperature": Ceiling(100.0, "Temperatures are in deg C; this looks like kelvin."),
    "damping_ratio": Ceiling(5.0, "The ratio is 1 at critical damping; this looks like percent."),
    "dead_time": Ceiling(1.0, "Times are in seconds; this looks like milliseconds."),
    "bounce_delay": Ceiling(1.0, "Times are in seconds; this looks like milliseconds."),
    "latency": Ceiling(60.0, "Times are in seconds; this looks like milliseconds."),
    "filter_time_constant": Ceiling(60.0, "Times are in seconds; this looks like milliseconds."),
    "pulses_per_revolution": Ceiling(10_000.0, "It counts the edges of one turn."),
    "calibration_gain": Ceiling(20.0, "The gain is 1 for the calibration's own rate."),
    "calibration_offset": Ceiling(50.0, _SPEED),
    "torque_harmonic": Ceiling(20.0, "It is a share of the dynamic pressure's torque."),
    "damping_factor": Ceiling(100.0, "The factor is 1 for the healthy vane."),
    "viscous_damping": Ceiling(100.0, "It is 1 for as much as the healthy vane's own at 8 m/s."),
}


class Floor(NamedTuple):
    """The smallest value that can be meant, and what it is about."""

    value: float
    hint: str


# The simulator's pulses and steps go with the inverse of these: what no instrument has would fill
# the memory or never end.
_TINY = "Lengths are in metres; no instrument follows the wind within so little of it."
FLOORS: dict[str, Floor] = {
    "calibration_distance": Floor(0.002, f"Wind run per radian. {_TINY}"),
    "distance_constant": Floor(0.01, _TINY),
    "arm_radius": Floor(0.002, "Lengths are in metres."),
    "measuring_height": Floor(0.01, "Lengths are in metres."),
    "inertia_factor": Floor(0.02, "The factor is 1 for the healthy instrument."),
    "damping_ratio": Floor(0.001, "The ratio is 1 at critical damping."),
    "reference_density": Floor(0.05, "Densities are in kg/m^3, about 1.2 near the ground."),
    "calibration_gain": Floor(0.01, "The gain is 1 for the calibration's own rate."),
}


def problem_of(
    error: ErrorDetails, document: Document, given: Any, root: type[BaseModel] = Station
) -> Problem:
    """One fault found by the schema, in words.

    Args:
        error: As pydantic tells it.
        document: The text, for the lines.
        given: The data that was validated (with the constants of profiles filled in).
        root: The model of the document.
    """
    path = plain_path(error["loc"], given)
    what, remedy = _words(error, path, given, root)
    return Problem(document.where(path), path, what, remedy)


def implausible(document: Document, data: Any, path: Path = ()) -> list[Problem]:
    """Values that the schema allows but that no instrument has: in the wrong unit, or mistyped."""
    found: list[Problem] = []
    items = enumerate(data) if isinstance(data, list) else data.items()
    for step, value in items:
        here: Path = (*path, step)
        if isinstance(value, (dict, list)):
            found += implausible(document, value, here)
        elif isinstance(value, (int, float)):
            ceiling, floor = CEILINGS.get(str(step)), FLOORS.get(str(step))
            if ceiling is not None and abs(value) > ceiling.value:
                what = f"{value:g} is larger than any instrument's ({ceiling.value:g})."
                found.append(Problem(document.where(here), here, what, ceiling.hint))
            elif floor is not None and 0.0 < value < floor.value:
                # Zero and less are the schema's to refuse.
                what = f"{value:g} is smaller than any instrument's ({floor.value:g})."
                found.append(Problem(document.where(here), here, what, floor.hint))
    return found


def plain_path(location: tuple[int | str, ...], data: Any) -> Path:
    """Pydantic's location without the names of the alternatives it went through."""
    path: list[str | int] = []
    for position, step in enumerate(location):
        last = position == len(location) - 1
        if isinstance(data, dict):
            if step in data or (last and step not in KINDS):
                path.append(step)
                data = data.get(step)
        elif isinstance(data, list) and isinstance(step, int):
            path.append(step)
            data = data[step] if step < len(data) else None
    return tuple(path)


def _words(
    error: ErrorDetails, path: Path, data: Any, root: type[BaseModel]
) -> tuple[str, str]:
    kind = error["type"]
    context = error.get("ctx", {})
    told = meaning(field_at(path, data, root))
    about = f"It is: {told}" if told else ""
    given = error["input"]
    if kind == "extra_forbidden":
        return _unknown_key(path, data, root)
    if kind == "missing":
        what = "missing"
        if path and path[-1] == "kind":
            return f"{what}.", f"Add one of: {', '.join(KINDS)}."
        return f"{what}.", f"Add `{path[-1]}: ...`. {about}".strip()
    if kind == "union_tag_not_found":
        return "the instrument has no kind.", f"Add `kind:` with one of: {', '.join(KINDS)}."
    if kind == "union_tag_invalid":
        tag = str(context.get("tag"))
        close = get_close_matches(tag, KINDS, n=1)
        guess = f" Did you mean '{close[0]}'?" if close else ""
        return f"there is no instrument of kind '{tag}'.", f"Kinds: {', '.join(KINDS)}.{guess}"
    if kind == "literal_error":
        # An empty choice is what stands where the key is left out.
        expected = str(context.get("expected")).removeprefix("'', ").removeprefix("'' or ")
        close = get_close_matches(str(given), re.findall("'([^']+)'", expected), n=1)
        guess = f" Did you mean '{close[0]}'?" if close else ""
        return f"'{given}' is not one of the choices.", f"Choose {expected}.{guess}"
    if kind in {"greater_than", "greater_than_equal", "less_than", "less_than_equal"}:
        relation = {
            "greater_than": ("above", "gt"),
            "greater_than_equal": ("at least", "ge"),
            "less_than": ("below", "lt"),
            "less_than_equal": ("at most", "le"),
        }[kind]
        limit = f"It must be {relation[0]} {context[relation[1]]:g}."
        return f"{given} is outside the range.", f"{limit} {about}".rstrip()
    if kind.startswith(("float", "int", "decimal", "finite")):
        number = "a whole number" if kind.startswith("int") else "a number"
        return f"'{given}' is not {number}.", about
    if kind in {"model_type", "model_attributes_type", "dict_type"}:
        return f"'{given}' stands where a group of keys belongs.", about
    if kind in {"tuple_type", "list_type"}:
        return f"'{given}' stands where a list belongs.", about
    if kind == "too_short":
        return "the list is empty.", f"Add at least one entry. {about}".rstrip()
    if kind == "told":
        return f"{context['what']}.", str(context["remedy"])
    if kind == "value_error":
        return f"{error['msg'].removeprefix('Value error, ')}.", ""
    return f"{error['msg']}.", about


def _unknown_key(path: Path, data: Any, root: type[BaseModel]) -> tuple[str, str]:
    model = entry_at(path[:-1], data, root)
    known = list(model.model_fields) if model is not None else []
    close = get_close_matches(str(path[-1]), known, n=1, cutoff=0.5)
    if close:
        return "unknown key.", f"Did you mean `{close[0]}`?"
    return "unknown key.", f"Keys here: {', '.join(known)}."
