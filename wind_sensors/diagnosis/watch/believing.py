"""How much to believe in each of several explanations of the same minutes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wind_sensors.diagnosis.explaining.terms import Term

TEMPER = 3.0
"""Drop of the misfit that halves the belief or so: differences are not white, and the simulation
is not exact."""

TEMPER_SHARE = 0.04
"""The same as a share of the misfit that the leader removes."""

SOMETHING_ELSE = 0.15
"""Belief that is kept for causes that were not tried."""

LEAST = 0.05
MOST = 3


class Rival(NamedTuple):
    """An explanation, and how much less of the misfit it removes than the leader."""

    term: Term
    behind: float


def believed(rivals: Sequence[Rival], gain: float) -> list[tuple[Rival, float]]:
    """Rivals with their weights, best first, at most three.

    Args:
        rivals: One for each effect.
        gain: Misfit that the leader removes.
    """
    behind = np.array([r.behind for r in rivals])
    temper = TEMPER + TEMPER_SHARE * gain
    weights = np.exp(-behind / temper)
    weights *= (1.0 - SOMETHING_ELSE) / weights.sum()
    order = sorted(zip(rivals, weights.tolist(), strict=True), key=lambda pair: -pair[1])
    return [pair for pair in order if pair[1] >= LEAST][:MOST]
