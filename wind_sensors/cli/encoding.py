"""Text for screens and pipes that cannot show all of it: replaced, and never a traceback."""

from __future__ import annotations

import codecs
import io
import sys

_HANDLER = "wind_sensors.shown"
_PLAIN = {"±": "+-", "°": " deg", "²": "^2", "³": "^3", "·": "*", "−": "-", "–": "-", "…": "..."}


def _shown(problem: UnicodeError) -> tuple[str | bytes, int]:
    """What stands in the place of characters that an encoding lacks.

    Bytes of file names that were no text go out as they came in.
    """
    if not isinstance(problem, UnicodeEncodeError):
        raise problem
    character = problem.object[problem.start]
    if "\udc80" <= character <= "\udcff":
        return bytes([ord(character) - 0xDC00]), problem.start + 1
    plain = _PLAIN.get(character)
    if plain is None:
        plain = character.encode("ascii", "backslashreplace").decode("ascii")
    return plain, problem.start + 1


def show_any_text() -> None:
    """Let standard output and error take any text, whatever the locale's encoding."""
    codecs.register_error(_HANDLER, _shown)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)
