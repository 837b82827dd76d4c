"""From the text of a station file to a validated station."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from wind_sensors.errors import UserError
from wind_sensors.station.document import Document, Path, parse
from wind_sensors.station.model import Station
from wind_sensors.station.problems import Problem, implausible, problem_of
from wind_sensors.station.profiles import Profile
from wind_sensors.station.schema import entry_at, is_input


def read_station(text: str, name: str, profiles: Mapping[str, Profile]) -> Station:
    """Validate the text of a station file as a whole.

    Args:
        text: YAML.
        name: File name for messages.
        profiles: Instrument profiles that the file may name.

    Raises:
        UserError: The file is wrong; the message lists every fault with file, line, key and
            remedy.
    """
    return station_of(parse(text, name), profiles)


def station_of(document: Document, profiles: Mapping[str, Profile]) -> Station:
    """Validate a parsed station file as a whole.

    Raises:
        UserError: As in `read_station`.
    """
    if not isinstance(document.data, dict):
        raise UserError(
            "the station file holds no keys.",
            document.name,
            "It needs at least `instruments:` with one instrument.",
        )
    given, problems = _with_profiles(document, profiles)
    given = _with_inputs(given, (), given)
    problems += implausible(document, given)
    same = _same_names(document, given)
    problems += same
    station: Station | None = None
    try:
        station = Station.model_validate(given)
    except ValidationError as error:
        found = [
            _named(problem_of(detail, document, given), detail["loc"], given, profiles)
            for detail in error.errors(include_url=False)
            if not _follows(detail, given) and not (same and detail["loc"] == ())
        ]
        problems += found
    if station is not None:
        problems += _change_problems(document, given, station)
    if problems or station is None:
        raise _error(document, problems)
    return station


def _same_names(document: Document, given: dict[str, Any]) -> list[Problem]:
    """Instruments that have the name of an earlier one."""
    seen: set[str] = set()
    found = []
    instruments = given.get("instruments")
    for index, entry in enumerate(instruments if isinstance(instruments, list) else ()):
        name = entry.get("name") if isinstance(entry, dict) else None
        if isinstance(name, str) and name in seen:
            path: Path = ("instruments", index, "name")
            what = f"two instruments are called '{name}'."
            found.append(Problem(document.where(path), path, what, "Give each its own name."))
        elif isinstance(name, str):
            seen.add(name)
    return found


def _follows(detail: ErrorDetails, given: dict[str, Any]) -> bool:
    """Whether a fault is only the consequence of another one that is told already."""
    if detail["type"] == "union_tag_not_found":
        # Without its profile an instrument has no kind either.
        return bool(detail["input"].get("profile"))
    return detail["type"] == "too_short" and bool(given.get("instruments"))


def _error(document: Document, problems: list[Problem]) -> UserError:
    problems = sorted(problems, key=lambda problem: document.line(problem.path))
    if len(problems) == 1:
        only = problems[0]
        return UserError(only.what, f"{only.where}: {only.key}".rstrip(": "), only.remedy)
    listed = "".join(f"\n  {problem}" for problem in problems)
    return UserError(f"{len(problems)} problems:{listed}", document.name)


def _with_profiles(
    document: Document, profiles: Mapping[str, Profile]
) -> tuple[dict[str, Any], list[Problem]]:
    """The data with the constants of the named profiles under the instruments' own keys."""
    data = dict(document.data)
    instruments = data.get("instruments")
    problems: list[Problem] = []
    if not isinstance(instruments, list):
        return data, problems
    filled: list[Any] = []
    for index, entry in enumerate(instruments):
        if not isinstance(entry, dict) or not entry.get("profile"):
            filled.append(entry)
            continue
        name = str(entry["profile"])
        path: Path = ("instruments", index, "profile")
        profile = profiles.get(name)
        if profile is None:
            close = get_close_matches(name, profiles, n=1, cutoff=0.4)
            known = f"Profiles: {', '.join(sorted(profiles)) or 'none found'}."
            remedy = f"Did you mean '{close[0]}'?" if close else known
            problems.append(
                Problem(document.where(path), path, f"there is no '{name}'.", remedy)
            )
            filled.append(entry)
            continue
        kind = entry.get("kind", profile.kind)
        if kind != profile.kind:
            what = f"'{name}' is the profile of a {profile.kind}, not of a {kind}."
            problems.append(Problem(document.where(path), path, what, "Choose another one."))
        filled.append({"kind": profile.kind, **profile.constants, **entry})
    data["instruments"] = filled
    return data, problems


def _with_inputs(node: Any, path: Path, whole: Any) -> Any:
    """Bare topic names written out as `{topic: NAME}`."""
    if isinstance(node, list):
        return [_with_inputs(item, (*path, i), whole) for i, item in enumerate(node)]
    if not isinstance(node, dict):
        return node
    model = entry_at(path, whole)
    out: dict[str, Any] = {}
    for key, value in node.items():
        field = model.model_fields.get(key) if model is not None else None
        if isinstance(value, str) and field is not None and is_input(field):
            out[key] = {"topic": value}
        else:
            out[key] = _with_inputs(value, (*path, key), whole)
    return out


def _named(
    problem: Problem, location: tuple[int | str, ...], given: Any, profiles: Mapping[str, Profile]
) -> Problem:
    """Add what a profile says about a constant that its source does not give."""
    if len(location) < 3 or location[0] != "instruments" or not problem.what.startswith("missing"):
        return problem
    entry = given["instruments"][location[1]]
    profile = profiles.get(str(entry.get("profile", "")))
    key = str(location[-1])
    if profile is not None and profile.missing.get(key):
        remedy = f"{problem.remedy} Profile '{profile.name}' has none: {profile.missing[key]}"
        return problem._replace(remedy=remedy)
    if profile is None:
        offering = sorted(p.name for p in profiles.values() if key in p.constants)
        if offering:
            names = ", ".join(offering)
            return problem._replace(
                remedy=f"{problem.remedy} Or name a profile that has it: {names}."
            )
    return problem


def _change_problems(document: Document, given: Any, station: Station) -> list[Problem]:
    """Faults in `changes`: each `set` must leave a valid entry."""
    problems: list[Problem] = []
    for index, change in enumerate(station.changes):
        trial = {key: value for key, value in given.items() if key != "changes"}
        if change.instrument == "platform":
            trial["platform"] = {**(given.get("platform") or {}), **change.set}
        else:
            trial["instruments"] = [
                {**entry, **change.set} if entry.get("name") == change.instrument else entry
                for entry in given["instruments"]
            ]
        trial = _with_inputs(trial, (), trial)
        path: Path = ("changes", index, "set")
        try:
            Station.model_validate(trial)
        except ValidationError as error:
            for detail in error.errors(include_url=False):
                found = problem_of(detail, document, trial)
                place: Path = (*path, *found.path[-1:])
                problems.append(found._replace(where=document.where(place), path=place))
    return problems
