"""Durations on the command line: the one way in which every command takes them."""

from __future__ import annotations

import argparse
import math

LONGEST = 7.0 * 86_400.0
"""That a command takes [s]."""

METAVAR = "DURATION"
_UNITS = {"ms": 1e-3, "min": 60.0, "h": 3600.0, "s": 1.0}


def seconds(text: str) -> float:
    """A type of argument: a duration like `90`, `90s`, `50ms`, `15min`, `1h` in seconds.

    Raises:
        argparse.ArgumentTypeError: It is something else, not positive, or longer than a week.
    """
    number, factor = text, 1.0
    for unit, length in _UNITS.items():
        if text.endswith(unit):
            number, factor = text[: -len(unit)], length
            break
    try:
        value = float(number) * factor
    except ValueError as problem:
        raise argparse.ArgumentTypeError(
            f"'{text}' is not a duration: write it like 50ms, 90s, 15min or 1h"
        ) from problem
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"a duration must be positive, not '{text}'")
    if value > LONGEST:
        raise argparse.ArgumentTypeError(f"must be at most {LONGEST / 3600.0:g}h, not '{text}'")
    return value


def seconds_by_unit(text: str) -> float:
    """`seconds` of what is usually told in milliseconds, so that a bare number is a slip.

    Raises:
        argparse.ArgumentTypeError: As in `seconds`, or there is no unit.
    """
    value = seconds(text)
    if text[-1].isdigit() or text.endswith("."):
        raise argparse.ArgumentTypeError(f"'{text}' has no unit: write {text}ms or {text}s")
    return value
