"""Biases of the raw mean speed, predicted term by term from the turbulence of a window."""

from __future__ import annotations

import math
from typing import NamedTuple

from wind_sensors.estimation.core import SmallScales
from wind_sensors.estimation.outputs import BiasTerm
from wind_sensors.instruments.dynamics.rotor import table_at
from wind_sensors.instruments.propeller_vane import inertial_delta
from wind_sensors.instruments.speed_bias import inertial_bias
from wind_sensors.instruments.vane_variance import inertial_loss
from wind_sensors.station.model import Angle, Cup, Propeller
from wind_sensors.station.parameters import rotor_parameters
from wind_sensors.turbulence.inertial_range import (
    KOLMOGOROV_CONSTANT,
    LONGITUDINAL_STRUCTURE_COEFFICIENT,
    one_sided_longitudinal_constant,
)

_MOMENTS_UNCERTAINTY = 0.15
"""Relative, of `u` from the moments of a smoothed state: 0.06 (largest 0.15) against a rotor in a
known wind, and 0.1 of a4."""
_LEVEL_UNCERTAINTY = 0.2
"""Relative, of an inertial-range level and of a4 together."""
_INFERRED_VERTICAL = 1.5
"""Relative, of a vertical variance inferred as that of a neutral surface layer: convection doubles
it, in isotropic turbulence it is four times as large."""
_MEASURED_VERTICAL = 0.2
"""Relative, of a measured one with mu2."""
_CURVATURE_ANGLE = math.radians(20.0)
"""Where an angular-response table is compared with a parabola."""


class WindowTurbulence(NamedTuple):
    """Turbulence of a window.

    Attributes:
        speed: Scalar mean [m/s].
        vector_speed: Speed of the vector mean [m/s].
        vertical_variance: [m^2/s^2].
        vertical_is_measured: Whether it was measured, not inferred.
        small_scales: Inertial range.
        unfollowed: What the rotor did not follow, (<A'^2> - <y' A'>)/<A> [m/s]; nan where the
            method does not know it.
    """

    speed: float
    vector_speed: float
    vertical_variance: float
    vertical_is_measured: bool
    small_scales: SmallScales
    unfollowed: float


def dissipation(level: float, speed: float) -> float:
    """eps [m^2/s^3] from D(t) = level t^(2/3), with r = U t (Taylor); K14 (44)."""
    coefficient = LONGITUDINAL_STRUCTURE_COEFFICIENT * KOLMOGOROV_CONSTANT
    return math.pow(max(level, 0.0) / coefficient, 1.5) / speed


def response_curvature(rotor: Cup | Propeller) -> float:
    """mu2 of a rotor: of the table's parabola where the propeller has a table."""
    if isinstance(rotor, Cup):
        return rotor.mu2
    if rotor.mu2 is not None:
        return rotor.mu2
    theta = _CURVATURE_ANGLE
    response = table_at(rotor_parameters(rotor).angular_response, theta)
    return 2.0 * (response - math.cos(theta)) / theta**2


def vane_loss(vane: Angle, turbulence: WindowTurbulence) -> float:
    """<v^2> - U^2 <phi^2> [m^2/s^2] that the vane does not show; K94 (54)."""
    speed = max(turbulence.speed, 0.1)
    across = dissipation(0.75 * turbulence.small_scales.across, speed)
    return inertial_loss(
        vane.distance_constant, vane.damping_ratio, across, one_sided_longitudinal_constant()
    )


def _translation(rotor: Propeller, vane: Angle, mu2: float, eps: float, speed: float) -> float:
    """Part of the propeller-vane's bias that its distance from the axis makes; K94 (110)."""
    arm = rotor.distance_to_vane_axis / vane.distance_constant
    alpha_1 = one_sided_longitudinal_constant()

    def delta(ratio: float) -> float:
        return inertial_delta(
            vane.damping_ratio, ratio, mu2, vane.distance_constant, eps, alpha_1, speed
        )

    return delta(arm) - delta(0.0)


def _excess_of_scalar_mean(turbulence: WindowTurbulence) -> BiasTerm:
    excess = turbulence.speed / max(turbulence.vector_speed, 0.1) - 1.0
    return BiasTerm(excess, 0.05 * abs(excess), "vector mean")


def array_terms(turbulence: WindowTurbulence, indicated_speed: float) -> dict[str, BiasTerm]:
    """Terms of an array as `predicted_terms` names them; `u` and `v` relative to the vector mean.

    What lag, angular response and friction do to propellers at large angles has no closed form:
    `u` is all of it together, the indicated against the corrected vector mean.

    Args:
        turbulence: Of the window.
        indicated_speed: Of the vector mean by the calibration and the cosine [m/s].
    """
    total = indicated_speed / max(turbulence.vector_speed, 0.1) - 1.0
    none = BiasTerm(0.0, 0.0)
    return {
        "u": BiasTerm(total, _LEVEL_UNCERTAINTY * abs(total), "vector mean"),
        "v": _excess_of_scalar_mean(turbulence),
        "w": none,
        "vane_lag": none,
        "translation": none,
        "arithmetic_mean": none,
    }


def predicted_terms(
    rotor: Cup | Propeller,
    vane: Angle,
    turbulence: WindowTurbulence,
    arithmetic_mean: float,
) -> dict[str, BiasTerm]:
    """Terms relative to the mean speed, `v` to the vector mean.

    Args:
        rotor: The rotor.
        vane: What tells the direction.
        turbulence: Of the window.
        arithmetic_mean: Excess of the mean over whole turns over the mean over time [1], exact;
            K94 (21) to (28).

    Returns:
        u (overspeeding; K14 (75) where the method knows what the rotor did not follow, else the
        inertial range, K14 (96)), v (mean speed over vector mean, less 1), w (angular
        response), vane_lag (what the vane does not follow), translation (the propeller moves with
        the vane), arithmetic_mean.
    """
    speed = max(turbulence.speed, 0.1)
    p = rotor_parameters(rotor)
    mu2 = response_curvature(rotor)
    eps = dissipation(turbulence.small_scales.along, speed)
    local = inertial_bias(
        rotor.distance_constant * rotor.inertia_factor, eps, speed, 0.0,
        turbulence.vertical_variance, p.a4, p.mu1, mu2,
    )
    overspeeding = BiasTerm(local.u, _LEVEL_UNCERTAINTY * abs(local.u))
    if math.isfinite(turbulence.unfollowed):
        # A filter's level of the small scales is no measure of this: they share the frequencies
        # above a rotor's response with the errors that it allows its equations.
        found = p.a4 * turbulence.unfollowed / p.calibration_gain / speed
        overspeeding = BiasTerm(found, _MOMENTS_UNCERTAINTY * abs(found))
    vertical = _MEASURED_VERTICAL if turbulence.vertical_is_measured else _INFERRED_VERTICAL
    across = dissipation(0.75 * turbulence.small_scales.across, speed)
    translation = 0.0
    if isinstance(rotor, Propeller) and rotor.mounted_on:
        lag = inertial_delta(
            vane.damping_ratio, 0.0, mu2, vane.distance_constant, across,
            one_sided_longitudinal_constant(), speed,
        )
        translation = _translation(rotor, vane, mu2, across, speed)
    else:
        lag = 0.5 * vane_loss(vane, turbulence) / speed**2
    return {
        "u": overspeeding,
        "v": _excess_of_scalar_mean(turbulence),
        "w": BiasTerm(local.w, vertical * abs(local.w)),
        "vane_lag": BiasTerm(lag, _LEVEL_UNCERTAINTY * abs(lag)),
        "translation": BiasTerm(translation, _LEVEL_UNCERTAINTY * abs(translation)),
        "arithmetic_mean": BiasTerm(arithmetic_mean, 0.0),
    }
