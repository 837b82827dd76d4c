"""Numbers on the command line that are refused before anything begins."""

from __future__ import annotations

import argparse
import math


def positive(text: str) -> float:
    """A type of argument: a finite number above nought.

    Raises:
        argparse.ArgumentTypeError: It is something else.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"give a positive number, not '{text}'")
    return value


def count(text: str) -> int:
    """A type of argument: a whole number from nought.

    Raises:
        argparse.ArgumentTypeError: It is something else.
    """
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"give a whole number from 0, not '{text}'")
    return int(text)
