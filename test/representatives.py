"""Cases of which a few stand for all in every test run; `pytest -m slow` runs the others."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def represented(cases: Iterable[Any], by: Collection[Any]) -> list[Any]:
    """Parameters of a test: those not chosen to stand for the rest are slow.

    Args:
        cases: One value each.
        by: Values that every test run takes.

    Raises:
        ValueError: A chosen value is not among the cases.
    """
    all_cases = list(cases)
    missing = [value for value in by if value not in all_cases]
    if missing:
        raise ValueError(f"no such cases: {missing}")
    return [c if c in by else pytest.param(c, marks=pytest.mark.slow) for c in all_cases]
