"""The one exception that becomes a message for people instead of a traceback."""

from __future__ import annotations


class UserError(Exception):
    """Something the user can mend.

    Args:
        what: What was wrong, one sentence.
        where: File, line, topic, key or time at which it was found; may be empty.
        remedy: What to do about it; may be empty.
    """

    def __init__(self, what: str, where: str = "", remedy: str = "") -> None:
        self.what = what
        self.where = where
        self.remedy = remedy
        place = f"{where}: " if where else ""
        stop = "" if what.endswith((".", "!", "?")) else "."
        advice = f"{stop} {remedy}" if remedy else ""
        super().__init__(f"{place}{what}{advice}")
