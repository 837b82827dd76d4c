"""The share of a rotor's pulses that its electronics lose."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.station.model import Electronics

FloatArray = npt.NDArray[np.float64]

LOSS_SPEED = 5.0
"""Indicated speed at which `loss_probability` holds where losses grow with the rate [m/s]."""

MOST_LOST = 0.95
"""However fast the rotor turns, this share of the edges is not exceeded by what grows."""


def lost_share(electronics: Electronics, speed: npt.ArrayLike) -> FloatArray:
    """Share of the edges that are lost at random.

    Args:
        electronics: Of the rotor.
        speed: That the rotor indicates, its rate times its calibration distance [m/s], any shape.

    Returns:
        In [0, 1), shape of `speed`.
    """
    indicated = np.asarray(speed, dtype=np.float64)
    if electronics.loss_growth == 0.0:
        return np.full(indicated.shape, electronics.loss_probability)
    grown = electronics.loss_probability * (indicated / LOSS_SPEED) ** electronics.loss_growth
    return np.asarray(np.minimum(grown, max(MOST_LOST, electronics.loss_probability)))
