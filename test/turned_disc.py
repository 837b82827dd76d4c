"""The edges of a disc that turns, as a pick-up would see them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

SLOTS = 10
TURNS = 900
TURN = 0.4


def edges(displaced: FloatArray, since: float = 0.0) -> FloatArray:
    """Edges [s] of a disc that turns every 0.4 s, a little faster and slower, slots displaced [1]
    from some time on."""
    place = np.arange(SLOTS * TURNS)
    even = place / SLOTS * TURN
    time = even + 0.05 * np.sin(even / 7.0)
    moved = displaced[place % SLOTS] * TURN / SLOTS
    return np.asarray(time + np.where(time > since, moved, 0.0))
