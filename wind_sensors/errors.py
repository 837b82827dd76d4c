"""The one exception that becomes a message for people instead of a traceback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
        advice = f" {remedy}" if remedy else ""
        super().__init__(f"{place}{what}{advice}")


@contextmanager
def writing(target: Path) -> Iterator[None]:
    """While results are written: what the file system refuses is told like every other mistake.

    Args:
        target: File or folder that was asked for.

    Raises:
        UserError: It cannot be written.
    """
    try:
        yield
    except OSError as problem:
        raise UserError(
            f"this cannot be written ({problem.strerror or problem}).",
            str(target),
            "Choose another place with -o.",
        ) from None
