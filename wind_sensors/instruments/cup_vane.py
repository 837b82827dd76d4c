"""Cup and vane together: the vector wind run and the variance of direction.

Source: Kristensen (1994), (83) to (85). Angles are headings of the air, counter-clockwise from
east (x); a wind direction D is where the wind comes from, degrees clockwise from north.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.speed_bias import SpeedBias, anisotropic_bias
from wind_sensors.instruments.vane_variance import von_karman_moments

FloatArray = npt.NDArray[np.float64]


class VectorWindRun(NamedTuple):
    """Vector mean wind over an averaging time.

    Attributes:
        east, north: Components (where the air goes) [m/s].
        scalar_speed: Wind run over time without regard to direction [m/s].
        resultant: R, mean length of the unit vectors [1].
    """

    east: float
    north: float
    scalar_speed: float
    resultant: float

    @property
    def speed(self) -> float:
        """Speed of the vector mean [m/s]."""
        return math.hypot(self.east, self.north)

    @property
    def heading(self) -> float:
        """Where the air goes [rad], by atan2; K94 (84)."""
        return math.atan2(self.north, self.east)


def vector_wind_run(
    headings: npt.ArrayLike,
    duration: float,
    calibration_distance: float,
    pulses_per_revolution: float = 1.0,
) -> VectorWindRun:
    """Vector mean wind from the vane's heading at every pulse; K94 (83).

    Args:
        headings: Heading of the air at each pulse [rad], shape (n,).
        duration: Averaging time T [s].
        calibration_distance: l [m/rad].
        pulses_per_revolution: Pulses per full turn.
    """
    phi = np.asarray(headings, dtype=np.float64)
    scale = 2.0 * math.pi * calibration_distance / (pulses_per_revolution * duration)
    cosine = float(np.sum(np.cos(phi)))
    sine = float(np.sum(np.sin(phi)))
    resultant = math.hypot(cosine, sine) / phi.size if phi.size else 0.0
    return VectorWindRun(scale * cosine, scale * sine, scale * phi.size, resultant)


def direction_from(heading: npt.ArrayLike) -> FloatArray:
    """D = 270 - heading, modulo 360 [degrees clockwise from north]; K94 (34).

    Args:
        heading: Where the air goes, counter-clockwise from east [rad].
    """
    degrees = np.mod(270.0 - np.degrees(np.asarray(heading, dtype=np.float64)), 360.0)
    # The remainder of a tiny negative angle rounds to a whole turn.
    return np.mod(degrees, 360.0)


def heading_of(direction: npt.ArrayLike) -> FloatArray:
    """Heading of the air [rad, 0..2 pi) from D [degrees clockwise from north]; K94 (34)."""
    degrees = np.mod(270.0 - np.asarray(direction, dtype=np.float64), 360.0)
    return np.radians(np.mod(degrees, 360.0))


def direction_variance(headings: npt.ArrayLike) -> float:
    """1 - <cos>^2 - <sin>^2 [rad^2], weighted by wind run; NaN without headings; K94 (85)."""
    phi = np.asarray(headings, dtype=np.float64)
    if phi.size == 0:
        return math.nan
    deviation = phi - math.atan2(float(np.sum(np.sin(phi))), float(np.sum(np.cos(phi))))
    # 1 - R^2 without cancellation: R = 1 - 2 <sin^2(d/2)>.
    deficit = 2.0 * float(np.mean(np.sin(0.5 * deviation) ** 2))
    return deficit * (2.0 - deficit)


def direction_variance_logarithmic(variance_85: float) -> float:
    """-ln R^2 [rad^2] from 1 - R^2: exact for a wrapped normal distribution."""
    return -math.log1p(-variance_85)


def direction_variance_fourth_order(variance_85: float, kurtosis: float = 3.0) -> float:
    """Variance [rad^2] from 1 - R^2 = sigma^2 - (mu4 + 3 sigma^4)/12, solved for sigma^2.

    Args:
        variance_85: Result of `direction_variance`.
        kurtosis: mu4/sigma^4 [1]; 3 for a normal distribution.

    Raises:
        ValueError: If the expansion does not reach this value (spread beyond about 50 degrees).
    """
    factor = (kurtosis + 3.0) / 12.0
    root = 1.0 - 4.0 * factor * variance_85
    if root < 0.0:
        raise ValueError("the spread of directions is too large for the fourth-order expansion")
    return 2.0 * variance_85 / (1.0 + math.sqrt(root))


def variance_85_of_uniform(half_width: float) -> float:
    """1 - R^2 [rad^2] of headings spread evenly over +-half_width [rad]; exact variance w^2/3."""
    ratio = np.sinc(half_width / math.pi)
    if abs(half_width) < 0.05:
        w2 = half_width * half_width
        deficit = w2 / 6.0 * (1.0 - w2 / 20.0 * (1.0 - w2 / 42.0 * (1.0 - w2 / 72.0)))
    else:
        deficit = 1.0 - float(ratio)
    return deficit * (2.0 - deficit)


def variance_85_of_normal(standard_deviation: float) -> float:
    """1 - R^2 = 1 - exp(-sigma^2) [rad^2] of normally distributed headings."""
    return -math.expm1(-(standard_deviation**2))


def lateral_variance(
    direction_variance_value: float, mean_speed: float, reduced_length: float, damping_ratio: float
) -> float:
    """<v^2> [m^2/s^2] from a vane's direction variance, its response removed; K94 (52).

    Args:
        direction_variance_value: <phi^2> [rad^2].
        mean_speed: U [m/s].
        reduced_length: q l_v [1] of von Karman turbulence.
        damping_ratio: zeta.
    """
    seen = von_karman_moments(reduced_length, damping_ratio).direction
    return mean_speed**2 * direction_variance_value / seen


def vector_run_bias(
    rotor_lengths: tuple[float, float, float],
    vane_length: float,
    damping_ratio: float,
    intensities: tuple[float, float, float],
    a4: float,
    mu1: float = 0.0,
    mu2: float = 0.0,
) -> SpeedBias:
    """Bias of the speed of the vector mean (derived): the vane cancels the v term but for its loss.

    Args:
        rotor_lengths: q l0 of u, v, w [1].
        vane_length: q l_v of v [1].
        damping_ratio: zeta.
        intensities: sigma/U of u, v, w [1].
        a4, mu1, mu2: Cup.
    """
    loss = von_karman_moments(vane_length, damping_ratio).loss
    return anisotropic_bias(rotor_lengths, intensities, a4, mu1, mu2, lateral_variance_seen=loss)


def matched_damping(cup_distance_constant: float, vane_distance_constant: float) -> float:
    """zeta = l0/(2 l_v) [1] that makes a well damped vane lag as the cup does; K94, sec. 5.

    Args:
        cup_distance_constant: l0 [m].
        vane_distance_constant: l_v [m]; the match is good where the result is above one.
    """
    return 0.5 * cup_distance_constant / vane_distance_constant
