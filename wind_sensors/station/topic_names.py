"""Which texts name a ROS 2 topic."""

from __future__ import annotations

import re
from collections.abc import Iterable

from wind_sensors.errors import UserError

LONGEST_NAME = 247
"""Characters that the middleware has room for."""

REMEDY = (
    "Write letters, digits and underscores joined by single slashes: `cup/pulses` (below the "
    "node's namespace), `/cup/pulses` or `~/pulses` (below the node's name)."
)

_SUBSTITUTION = re.compile(r"\{(node|ns|namespace)\}")


def topic_name_fault(name: str) -> str:
    """What keeps a text from naming a topic, as the end of a sentence; empty where it is a name.

    The rules are those by which a node takes a name before it expands it: absolute (`/a/b`),
    relative (`a/b`) and private (`~/a`) names, with `{node}`, `{ns}` and `{namespace}` in them.

    Args:
        name: As a file or a command line states it.
    """
    if not name:
        return "is empty"
    if len(name) > LONGEST_NAME:
        return f"has {len(name)} characters, more than {LONGEST_NAME}"
    if name == "~" or name.startswith("~/"):
        # What stands behind the node's own name counts as an absolute name does.
        name = f"/node{name[1:]}"
    # A node's name stands within a part, a namespace begins with a slash.
    plain = _SUBSTITUTION.sub(lambda found: "n" if found[1] == "node" else "/n", name)
    wrong = re.search(r"[^A-Za-z0-9_/]", plain)
    if wrong is not None:
        shown = "a space" if wrong[0] == " " else f"'{wrong[0]}'"
        return f"has {shown} in it"
    if plain.endswith("/"):
        return "ends with a slash"
    if "//" in plain:
        return "has two slashes in a row"
    digit = re.search(r"(?:^|/)([0-9][^/]*)", plain)
    if digit is not None:
        return f"has a part that begins with a digit ('{digit[1]}')"
    return ""


def refuse_other_texts(names: Iterable[str], where: str) -> None:
    """Check that texts name topics.

    Args:
        names: Absolute, relative or private names.
        where: For the message.

    Raises:
        UserError: One does not; tells why.
    """
    for name in names:
        fault = topic_name_fault(name)
        if fault:
            raise UserError(f"'{name}' is not a ROS 2 topic name: it {fault}.", where, REMEDY)
