"""The wake of an obstacle that stands upwind of an instrument, by bearing."""

from __future__ import annotations

import math

from wind_sensors.compiled import compiled

FLANK_PLACE = 2.8
"""Middle of the speed-up beside a wake, in its widths: what does not pass through the obstacle
passes beside it."""


@compiled
def wake_factor(away: float, depth: float, width: float, flank: float) -> float:
    """Speed behind an obstacle relative to the free wind.

    Args:
        away: Bearing the wind comes from against the wake's middle [rad], any turn.
        depth: Loss in the middle.
        width: Standard deviation of the Gaussian profile [rad].
        flank: Gain in the middle of the flanks, Gaussians of the same width.
    """
    away -= 2.0 * math.pi * math.floor((away + math.pi) / (2.0 * math.pi))
    x = away / width
    factor = 1.0 - depth * math.exp(-0.5 * x * x)
    if flank != 0.0:
        y = abs(x) - FLANK_PLACE
        factor += flank * math.exp(-0.5 * y * y)
    return factor
