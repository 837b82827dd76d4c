"""Inflow of a multirotor's own rotors at its wind sensor, by momentum theory."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.station.model import Downwash

FloatArray = npt.NDArray[np.float64]

_AIR_DENSITY = 1.225
"""[kg/m^3]; the induced velocity follows its square root at most."""


def hover_induced_velocity(downwash: Downwash) -> float:
    """Induced velocity at the sensor when the platform hovers in a calm [m/s], downwards.

    Momentum theory of the actuator disc: thrust T = 2 rho A v_h^2, ideal power T v_h.

    Args:
        downwash: With the velocity itself, the thrust or the power of the rotors.
    """
    in_disc = 0.0
    if downwash.thrust > 0.0:
        in_disc = math.sqrt(downwash.thrust / (2.0 * _AIR_DENSITY * downwash.disc_area))
    elif downwash.hover_power > 0.0:
        ideal = downwash.figure_of_merit * downwash.hover_power
        in_disc = (ideal / (2.0 * _AIR_DENSITY * downwash.disc_area)) ** (1.0 / 3.0)
    return downwash.induced_velocity + downwash.sensor_share * in_disc


def share_on_axis(height: float, radius: float) -> float:
    """Induced velocity on the axis of a hovering rotor over that in its disc [1].

    A cylinder of ring vortices below the disc: 1 - z / sqrt(z^2 + R^2), which is 1 in the disc, 2
    far below and 0 far above.

    Args:
        height: Of the sensor above the disc [m], negative below.
        radius: Of the rotor [m].
    """
    return 1.0 - height / math.hypot(height, radius)


def rotor_downwash(downwash: Downwash, apparent: FloatArray) -> FloatArray:
    """Flow that a multirotor's rotors add at the sensor, in platform axes [m/s].

    Glauert's momentum theory in forward flight: the induced velocity v solves
    v sqrt(V^2 + v^2) = v_h^2 with V the airspeed across the rotor axis and v_h the value at hover.
    It points down; a skewed wake leans with the flow by `wake_skew` times V/v_h. Off the rotors'
    axes the jet also blows outwards, along the platform's x and y by the shares in `spread`.

    Args:
        downwash: Its parameters.
        apparent: Wind that the platform feels without its rotors, in platform axes, shape (n, 3).

    Returns:
        Shape (n, 3).
    """
    hover = hover_induced_velocity(downwash)
    added = np.zeros_like(apparent)
    if hover == 0.0:
        return added
    squared = np.square(apparent[:, 0]) + np.square(apparent[:, 1])
    half = 0.5 * squared / hover**2
    induced = hover * np.sqrt(np.sqrt(np.square(half) + 1.0) - half)
    lean = downwash.wake_skew * induced / abs(hover)
    forward, leftward = downwash.spread
    added[:, 0] = lean * apparent[:, 0] + forward * induced
    added[:, 1] = lean * apparent[:, 1] + leftward * induced
    added[:, 2] = -induced
    return added
