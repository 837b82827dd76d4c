"""The one-parameter family of rotors that contains every cup and propeller of the four papers.

With y = l s [m/s], A the effective forcing and U the mean wind [m/s]::

    l0 dy/dx = (A/U - y/U) [a4 A + (1 - a4) y] + mu2 w^2 / (2 U),   x = U t

a4 = l/(l + Lambda) is the share of the torque's slope that follows the wind; 1 - a4 follows the
rotor. Members: Kristensen (1994) cup (0..1), Kristensen et al. (2014), (76) and Jackson's
frictionless propeller (1), Kristensen (1994), (30) propeller (0), Schrenk's rotor (above 1).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class SecondOrderCoefficients(NamedTuple):
    """Coefficients of the expansion to second order, K94 (16); all dimensionless.

    l0 dsigma/dx + a1' sigma = a1 u/U + a2 w/U + a3 sigma^2 + a4 u^2/U^2 + a_vv v^2/U^2
    + a5 w^2/U^2 + a6 sigma u/U + a7 u w/U^2 + a8 sigma w/U, with sigma = s/S and a1' = 1.
    """

    a1: float
    a2: float
    a3: float
    a4: float
    a5: float
    a6: float
    a7: float
    a8: float
    a_vv: float


def torque_share(calibration_distance: float, second_length: float) -> float:
    """a4 = l/(l + Lambda) [1].

    Args:
        calibration_distance: l [m/rad].
        second_length: Lambda [m]; infinite for the K94 propeller, negative for Schrenk's rotor.
    """
    if math.isinf(second_length):
        return 0.0
    return calibration_distance / (calibration_distance + second_length)


def second_length_ratio(a4: float) -> float:
    """Lambda/l [1] from a4; infinite for a4 = 0."""
    return math.inf if a4 == 0.0 else (1.0 - a4) / a4


def second_order_coefficients(
    a4: float, mu1: float = 0.0, mu2: float = 0.0
) -> SecondOrderCoefficients:
    """All coefficients of K94 (14), (16) from a4 and the angular response mu1, mu2.

    They satisfy the constraints K94 (17) to (20) identically.
    """
    a3 = a4 - 1.0
    a6 = 1.0 - 2.0 * a4
    return SecondOrderCoefficients(
        a1=1.0,
        a2=mu1,
        a3=a3,
        a4=a4,
        a5=mu1 * mu1 * a4 + 0.5 * mu2,
        a6=a6,
        a7=2.0 * mu1 * a4,
        a8=mu1 * a6,
        a_vv=0.5,
    )


def constraint_residuals(coefficients: SecondOrderCoefficients) -> tuple[float, ...]:
    """Left minus right side of K94 (17) to (20); all zero for a consistent rotor.

    Returns:
        a1 - 1, a3 + a4 + a6, a7 + a8 - a2, 2 a3 + a6 + 1.
    """
    c = coefficients
    return (c.a1 - 1.0, c.a3 + c.a4 + c.a6, c.a7 + c.a8 - c.a2, 2.0 * c.a3 + c.a6 + 1.0)


def response_to_constant_wind(
    wind_run: npt.ArrayLike, initial: npt.ArrayLike, a4: float
) -> FloatArray:
    """Exact y/h = l s/h after a wind run x = h t in a constant wind h, from y(0)/h.

    Args:
        wind_run: x/l0 = h t/l0 [1].
        initial: l s(0)/h [1].
        a4: Share of the torque's slope that follows the wind.

    Returns:
        l s/h [1]; NaN where the model has run away to minus infinity (an initial rate below
        -l/Lambda, or a negative one for a4 = 0).
    """
    x = np.asarray(wind_run, dtype=np.float64)
    y0 = np.asarray(initial, dtype=np.float64)
    decay = np.exp(-x)
    rotor_share = 1.0 - a4
    numerator = a4 * -np.expm1(-x) + y0 * (rotor_share + a4 * decay)
    denominator = a4 + rotor_share * (y0 + (1.0 - y0) * decay)
    with np.errstate(divide="ignore", invalid="ignore"):
        response = numerator / denominator
    return np.where(denominator > 0.0, response, np.nan)


def wind_run_to_fraction(fraction: float, initial: float, a4: float) -> float:
    """x/l0 [1] at which l s/h reaches `fraction`, starting from l s(0)/h = `initial`.

    From rest, `fraction` = 1 - 1/e and Lambda = 0 this is 1: only then does a spin-up test return
    the distance constant. Infinite for a4 = 0 from rest, which never starts.
    """
    numerator = (1.0 - initial) * (a4 + (1.0 - a4) * fraction)
    denominator = (1.0 - fraction) * (a4 + (1.0 - a4) * initial)
    return math.inf if denominator == 0.0 else math.log(numerator / denominator)


def longitudinal_bias(a4: float, variance: float, covariance: float, mean_speed: float) -> float:
    """Relative overspeeding a4 (<u^2> - l <s u>)/U^2 [1] of any member; K14 (75).

    Args:
        a4: Share of the torque's slope that follows the wind.
        variance: <u^2> [m^2/s^2].
        covariance: l <s u> [m^2/s^2].
        mean_speed: U [m/s].
    """
    return a4 * (variance - covariance) / mean_speed**2


def blade_element_torque_share(radius: float, calibration_distance: float) -> float:
    """a4 = 1/(1 + (r/P)^2) [1]: a propeller whose blades act at one radius (derived).

    Args:
        radius: Effective radius r [m].
        calibration_distance: P [m/rad].
    """
    return 1.0 / (1.0 + (radius / calibration_distance) ** 2)


def steady_rate(forcing: npt.ArrayLike, lift: npt.ArrayLike, a4: float) -> FloatArray:
    """Stable root y = l s [m/s] of (A - y)[a4 A + (1 - a4) y] + E = 0.

    Args:
        forcing: A [m/s], not negative.
        lift: E [m^2/s^2]: mu2 w^2/2 of the K94 rotors, -U_s^2 for bearing friction.
        a4: Share of the torque's slope that follows the wind.

    Returns:
        y [m/s]; NaN where no steady state exists.
    """
    a = np.asarray(forcing, dtype=np.float64)
    e = np.asarray(lift, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(a * a + 4.0 * (1.0 - a4) * e)
        middle = (1.0 - 2.0 * a4) * a
        # Two forms of the same root; each cancels where the other does not.
        if a4 <= 0.5:
            return (middle + root) / (2.0 * (1.0 - a4))
        return 2.0 * (a4 * a * a + e) / (root - middle)


class ForcingInversion(NamedTuple):
    """Forcing A recovered from a rotor's rate and acceleration.

    Attributes:
        value: A [m/s], the root that a rotor near equilibrium has.
        possible: Whether the equation has a root at all; where it has not (noise, or a loss of
            rate faster than any wind explains) `value` is the nearest one.
    """

    value: FloatArray
    possible: npt.NDArray[np.bool_]


def forcing_from_rate(
    indicated: npt.ArrayLike,
    indicated_rate: npt.ArrayLike,
    a4: float,
    distance_constant: float,
    lift: npt.ArrayLike = 0.0,
) -> ForcingInversion:
    """A [m/s] from l0 dy/dt = (A - y)[a4 A + (1 - a4) y] + E, the rotor equation solved for A.

    Args:
        indicated: y = l s [m/s], positive.
        indicated_rate: dy/dt [m/s^2].
        a4: Share of the torque's slope that follows the wind.
        distance_constant: l0 [m].
        lift: E [m^2/s^2].
    """
    y = np.asarray(indicated, dtype=np.float64)
    excess = distance_constant * np.asarray(indicated_rate, dtype=np.float64) - np.asarray(lift)
    bracket = y * y + 4.0 * a4 * excess
    root = np.sqrt(np.maximum(bracket, 0.0))
    # The form with the root in the denominator holds for a4 = 0 as well.
    value = y + 2.0 * excess / (y + root)
    return ForcingInversion(value, bracket >= 0.0)
