"""Turbulence as a sum of Ornstein-Uhlenbeck processes with a -5/3 spectrum.

Each horizontal component is a slowly wandering mean plus processes whose time constants stand in
geometric progression and whose variances grow as tau^(2/3). Their structure function then follows
the inertial range, D(t) = level t^(2/3) (Kristensen et al. (2014), (44)); the sum over a
continuum of such processes is exact because
int (1 - exp(-t/tau)) tau^(2/3) d(ln tau) = (3/2) Gamma(1/3) t^(2/3).
Two levels for each horizontal component, one for the small scales and one for the large, follow
the data: together they carry intensity and length scale. The vertical wind has a level of its own
where the station measures it; elsewhere it takes that of the small scales across.
"""

from __future__ import annotations

import math

import numpy as np

from wind_sensors.compiled import compiled

PROGRESSION = 5.0
TIME_CONSTANTS = np.array([0.08, 0.4, 2.0, 10.0])
"""[s]; a slower part is the wandering mean."""
SMALL_SCALES = 2
"""How many of them obey the small-scale level."""
VERTICAL_CONSTANTS = np.array([0.08, 0.4, 2.0])
"""[s]; the ground blocks slower vertical motion, the slowest is as strong as height allows."""

SHARE = math.log(PROGRESSION) / (3.0 * math.gamma(1.0 / 3.0))
"""Variance of the process with time constant tau = this times level tau^(2/3)."""

VARIANCES = SHARE * TIME_CONSTANTS ** (2.0 / 3.0)
"""For level 1 m^2/s^2 s^(-2/3)."""
VERTICAL_VARIANCES = SHARE * VERTICAL_CONSTANTS ** (2.0 / 3.0)

_RATIO = PROGRESSION ** (2.0 / 3.0)
UNRESOLVED_VARIANCE = float(VARIANCES[0]) / (_RATIO - 1.0)
"""Variance of everything faster than the fastest process, for level 1."""

_SLOWER = TIME_CONSTANTS[-1] * PROGRESSION
WANDERING = (2.0 * SHARE * _SLOWER ** (-1.0 / 3.0)) / (1.0 - PROGRESSION ** (-1.0 / 3.0))
"""Growth of the mean's variance per second for level 1: that of all slower processes together."""

PAIRS = len(TIME_CONSTANTS) + 1
WIND_STATES = 2 * PAIRS + len(VERTICAL_CONSTANTS)
LEVELS = 5
"""Along-wind small and large scales, cross-wind small and large scales, vertical."""
VERTICAL_LEVEL = 4


_FAST_VERTICAL = float(np.sum(VERTICAL_VARIANCES[:-1])) + UNRESOLVED_VARIANCE
_NEUTRAL_VERTICAL = 0.49
"""<w^2> = this level (kappa z/U)^(2/3) with the cross-wind level: neutral surface layer,
<w^2> = 1.46 u_*^2 and eps = u_*^3/(kappa z)."""
_VON_KARMAN = 0.4


@compiled
def neutral_vertical_variance(height: float, speed: float) -> float:
    """<w^2> of a neutral surface layer whose cross-wind level is 1 [m^2/s^2].

    Args:
        height: Above the ground [m].
        speed: Mean wind there [m/s].
    """
    return float(_NEUTRAL_VERTICAL * (_VON_KARMAN * height / max(speed, 1.0)) ** (2.0 / 3.0))


@compiled
def slow_vertical_variance(height: float, speed: float) -> float:
    """Variance of the slowest vertical process for level 1, at a height [m] and speed [m/s]."""
    total = neutral_vertical_variance(height, speed)
    return float(min(max(total - _FAST_VERTICAL, 0.0), VERTICAL_VARIANCES[-1]))


def initial_levels(speed: float, intensity: float) -> tuple[float, ...]:
    """Levels of a surface-layer wind of a given speed [m/s] and turbulence intensity [1].

    The variance is spread over eddies up to a minute: level = 2 sigma^2 / (60 s)^(2/3); across
    the wind the isotropic ratio 4/3 holds.
    """
    sigma2 = (max(speed, 1.0) * intensity) ** 2
    level = 2.0 * sigma2 / 60.0 ** (2.0 / 3.0)
    across = 4.0 / 3.0 * level
    return level, level, across, across, across
