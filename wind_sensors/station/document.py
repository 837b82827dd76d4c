"""A YAML text as plain data that remembers its lines."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from wind_sensors.errors import UserError

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Document:
    """Plain data with the line of every key.

    Attributes:
        name: File name for messages.
        data: Mappings, lists and scalars.
        lines: Line (from 1) by path of keys and indices.
    """

    name: str
    data: Any
    lines: dict[Path, int]

    def line(self, path: Path) -> int:
        """Line of a path, or of the innermost parent that is in the text."""
        known = (path[:length] for length in range(len(path), 0, -1))
        return next((self.lines[part] for part in known if part in self.lines), 1)

    def where(self, path: Path) -> str:
        """`file:line` of a path."""
        return f"{self.name}:{self.line(path)}"


def parse(text: str, name: str) -> Document:
    """Read a YAML text.

    Args:
        text: The text.
        name: File name for messages.

    Raises:
        UserError: The text is not YAML; names the line.
    """
    try:
        loaded = YAML(typ="rt").load(text)
    except MarkedYAMLError as problem:
        mark = problem.problem_mark or problem.context_mark
        where = f"{name}:{mark.line + 1}" if mark is not None else name
        what = str(problem.problem or problem.context or "unreadable").splitlines()[0]
        remedy = "Check indentation and quotes."
        raise UserError(f"not valid YAML: {what}.", where, remedy) from None
    except YAMLError as problem:
        raise UserError(f"not valid YAML: {problem}.", name) from None
    lines: dict[Path, int] = {(): 1}
    return Document(name, _plain(loaded, (), lines), lines)


def _plain(node: Any, path: Path, lines: dict[Path, int]) -> Any:
    if isinstance(node, CommentedMap):
        for key in node:
            below = (*path, str(key))
            lines[below] = node.lc.key(key)[0] + 1
        return {str(key): _plain(value, (*path, str(key)), lines) for key, value in node.items()}
    if isinstance(node, CommentedSeq):
        for index in range(len(node)):
            below = (*path, index)
            lines[below] = node.lc.item(index)[0] + 1
        return [_plain(value, (*path, index), lines) for index, value in enumerate(node)]
    if isinstance(node, bool) or node is None:
        return node
    if isinstance(node, int):
        return int(node)
    if isinstance(node, float):
        return float(node)
    if isinstance(node, datetime.datetime):
        ahead = node.utcoffset() or datetime.timedelta()
        moment = datetime.datetime(
            node.year, node.month, node.day, node.hour, node.minute, node.second, node.microsecond
        )
        return f"{(moment - ahead).isoformat()}Z"
    if isinstance(node, datetime.date):
        return node.isoformat()
    return str(node)
