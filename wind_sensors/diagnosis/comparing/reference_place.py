"""Where the reference stands: what the wind passes first shows it first.

Eddies travel with the wind. A reference that stands upwind of the instruments shows each of them
`d / U` earlier, one that stands downwind as much later; on a platform the apparent wind decides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d

from wind_sensors.simulation.drive import Drive

FloatArray = npt.NDArray[np.float64]

CARRYING_TIME = 10.0
"""Eddies are carried by the wind of so many seconds."""

SLOWEST_CARRIER = 0.5
"""Slower winds [m/s] carry nothing anywhere."""


@dataclass(frozen=True)
class Place:
    """Where a reference stands, seen from the instruments.

    Attributes:
        x, y: In the sensors' axes [m].
        error: Standard deviation of each [m].
    """

    x: float
    y: float
    error: float


def delayed(drive: Drive, flow: FloatArray, place: Place) -> Drive:
    """The drive with the wind that reaches the instruments, not the reference, at each instant.

    Args:
        drive: With the wind at the reference.
        flow: That wind in the sensors' axes, shape (n, 3) [m/s].
        place: Of the reference.
    """
    wide = min(round(CARRYING_TIME / drive.dt), len(drive) - 1) | 1
    x, y = (uniform_filter1d(flow[:, k], wide, mode="nearest") for k in (0, 1))
    speed = np.maximum(np.hypot(x, y), SLOWEST_CARRIER)
    later = -(place.x * x + place.y * y) / speed**2
    at = np.arange(len(drive)) * drive.dt
    shown = np.clip(at - later, at[0], at[-1])
    return drive.with_wind(np.asarray(CubicSpline(at, drive.wind)(shown)))
