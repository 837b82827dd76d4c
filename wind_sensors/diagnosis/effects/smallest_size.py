"""The smallest size of an effect that a recording could have shown, with what it is a size of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SmallestSize:
    """How far from health a parameter has to be to be told from it, all else being known.

    Attributes:
        value: Departure from the healthy value.
        unit: Its unit, `1` for a share.
        parameter: Its name; of an effect with equal components all of them, with `or`.
    """

    value: float
    unit: str
    parameter: str
