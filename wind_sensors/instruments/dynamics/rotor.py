"""Equation of motion of any rotor of the family: cups and propellers, with what can go wrong.

With y = l s [m/s] (calibration distance times rotor rate) one first-order equation holds for all
members (Kristensen (1994), (1), (2), (30); Kristensen et al. (2014), (58), (83); Jackson, (5))::

    l0 I dy/dt = rho { (A - y) [a4 B + (1 - a4) y] + e A h cos(psi - alpha - psi_e) + E } - F sgn(y)

A is the effective axial forcing, B the wind that sets the torque's slope (B = |A| for cups,
B = U g(theta)/g(0) for a propeller), rho the air density relative to the calibration's, I the
inertia relative to the healthy rotor's, e the once-per-revolution torque of an unequal rotor in a
wind h across its shaft from alpha, E the second-order lift of the Kristensen (1994) forms, and
F = U_s^2 the bearing friction.

Across a cup's shaft blows the whole wind. Across a propeller's blows what its vane does not
follow: a blade at radius r, which the wind h meets or leaves in its turn, is as fast as one at
another rate for so long, (A - y - l h/r cos) in place of (A - y), and where all pull alike the sum
over a turn is nought. One of n that pulls less by a share k leaves k l/(n r) A h cos, so that e is
about k/n for blades that meet the wind at 45 degrees.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled, inlined

FloatArray = npt.NDArray[np.float64]

Forced: TypeAlias = tuple[float, float, float, float, float]
"""A, B [m/s] and E [m^2/s^2] of `rotor_forcing`, and the wind across the shaft in the plane of
rotation [m/s]."""

CUP_EQUIVALENT = 0
"""Cup with the equivalent forcing of Kristensen et al. (2014), (83)."""
CUP_KRISTENSEN_1994 = 1
"""Cup with the second-order lift of Kristensen (1994), (2)."""
PROPELLER_JACKSON = 2
"""Propeller with angular response f(theta) and g(theta), Jackson (5)."""
PROPELLER_KRISTENSEN_1994 = 3
"""Propeller of Kristensen (1994), (30)."""

RUNAWAY_SPEED = 500.0
"""No wind turns a rotor faster than this [m/s]; an equation that does has no steady state."""

RESPONSE_TABLE_SIZE = 181
"""Angular response tables hold f(theta) at 0, 1, ..., 180 degrees."""


class RotorParameters(NamedTuple):
    """Constants of one rotor, healthy values first, then what can go wrong.

    Lengths in m, speeds in m/s, angles in rad, temperatures in K or deg C (differences only).
    """

    form: int
    calibration_distance: float
    """Wind run per radian l [m/rad]."""
    starting_speed: float
    """Calibration offset U0 [m/s]: l S = U - U0."""
    distance_constant: float
    """Distance constant l0 [m] at the calibration's air density."""
    a4: float
    """Share of the torque slope that follows the wind instead of the rotor, l/(l + Lambda)."""
    mu1: float
    mu2: float
    angular_response: FloatArray
    """f(theta) of a propeller at 0..180 degrees; shape (181,); ignored by cups."""
    calibration_gain: float
    """Steady rate relative to the calibration (1 = healthy)."""
    calibration_offset: float
    """Added to the steady reading [m/s] (0 = healthy)."""
    friction: float
    """Bearing friction U_s^2 [m^2/s^2] at the reference temperature."""
    friction_temperature_coefficient: float
    """c: the friction goes with exp(c (T - T0)) [1/K]."""
    reference_temperature: float
    """Temperature at which `friction` holds [deg C]."""
    inertia_factor: float
    """Moment of inertia relative to the healthy rotor's."""
    torque_harmonic: float
    """Once-per-revolution torque e relative to the dynamic pressure, of a propeller to what the
    wind across its shaft has of it (0 = healthy)."""
    torque_harmonic_phase: float
    """Rotor angle of the strong side [rad]."""
    breakaway: float
    """Friction that starts to turn the rotor relative to that which brings it to rest, 1 or more
    (1 = healthy). A cup's bearing sticks; a propeller's blades stall, and drive it with so much
    less torque at rest."""


@compiled
def table_at(table: FloatArray, angle: float) -> float:
    """Angular response at an angle [rad, 0..pi] by linear interpolation of a 1-degree table."""
    position = angle * (180.0 / math.pi)
    index = int(position)
    if index < 0:
        return float(table[0])
    if index >= RESPONSE_TABLE_SIZE - 1:
        return float(table[RESPONSE_TABLE_SIZE - 1])
    fraction = position - index
    return float(table[index] * (1.0 - fraction) + table[index + 1] * fraction)


@compiled
def torque_slope_ratio(angle: float) -> float:
    """g(theta)/g(0) = sqrt(cos(0.98 theta)), mirrored behind the rotor plane (Jackson, sec. 3.3).

    Clipped at its value for 90 degrees, so that a rotor in cross wind still feels the air.
    """
    folded = min(angle, math.pi - angle)
    return math.sqrt(max(math.cos(0.98 * folded), 0.0))


@compiled
def rotor_forcing(
    p: RotorParameters, axial: float, transverse: float
) -> tuple[float, float, float]:
    """Effective forcing A, slope wind B [m/s] and lift E [m^2/s^2] of a wind in rotor axes.

    Args:
        p: Constants of the rotor.
        axial: For a cup the wind along its axis (w, upwards); for a propeller the axial wind that
            drives it forward [m/s].
        transverse: For a cup the speed in the plane of rotation h; for a propeller the speed
            across its axis [m/s].

    Returns:
        A, B [m/s] and E [m^2/s^2]. B is the amount of A where the torque's slope follows it: air
        from behind, of which those models say nothing, brakes a rotor and never drives it on.
    """
    if p.form == CUP_EQUIVALENT:
        h = transverse
        forcing = h + p.mu1 * axial + p.mu2 * (math.sqrt(h * h + axial * axial) - h)
        lift = 0.0
        slope_is_forcing = True
        slope = 0.0
    elif p.form == CUP_KRISTENSEN_1994:
        forcing = transverse + p.mu1 * axial
        lift = 0.5 * p.mu2 * axial * axial
        slope_is_forcing = True
        slope = 0.0
    elif p.form == PROPELLER_KRISTENSEN_1994:
        forcing = axial
        lift = 0.5 * p.mu2 * transverse * transverse
        slope_is_forcing = True
        slope = 0.0
    else:
        speed = math.sqrt(axial * axial + transverse * transverse)
        angle = math.atan2(transverse, axial)
        forcing = speed * table_at(p.angular_response, angle)
        lift = 0.0
        slope_is_forcing = False
        slope = speed * torque_slope_ratio(angle)
    forcing = p.calibration_gain * forcing
    if forcing >= 0.0:
        forcing = forcing - p.starting_speed + p.calibration_offset
        if p.form != PROPELLER_JACKSON and forcing < 0.0:
            forcing = 0.0
    else:
        forcing = forcing + p.starting_speed + p.calibration_offset
    return forcing, (abs(forcing) if slope_is_forcing else slope), lift


STRIBECK_SPEED = 1.0
"""Rate l S [m/s] at which the friction of a bearing that sticks has come down most of the way from
that at rest."""


@compiled
def bearing_friction(p: RotorParameters, y: float, temperature: float) -> float:
    """Magnitude of the bearing's friction F [m^2/s^2] at a rate y = l s [m/s].

    It stiffens with cold, and a cup's falls from `breakaway` times its size at rest (Stribeck's
    curve).
    """
    return _at_rate(p, y, _friction_of_fast(p, temperature))


@inlined
def _friction_of_fast(p: RotorParameters, temperature: float) -> float:
    """Friction of a rotor that turns fast [m^2/s^2]."""
    if p.friction == 0.0:
        return 0.0
    return p.friction * math.exp(
        p.friction_temperature_coefficient * (temperature - p.reference_temperature)
    )


@inlined
def _at_rate(p: RotorParameters, y: float, friction: float) -> float:
    """Friction at a rate y [m/s], given that of a rotor that turns fast."""
    if p.breakaway == 1.0 or _is_propeller(p):
        return friction
    slow = math.exp(-(y / STRIBECK_SPEED) * (y / STRIBECK_SPEED))
    return friction * (1.0 + (p.breakaway - 1.0) * slow)


STALL_SLIP = 0.36
STALL_WIDTH = 0.05
"""Share of its free rate [1] that a propeller has lost when the flow leaves its blades, and over
which that happens. Blades set at 45 degrees meet the wind 12 degrees steeper then."""


@inlined
def _is_propeller(p: RotorParameters) -> bool:
    return p.form in (PROPELLER_JACKSON, PROPELLER_KRISTENSEN_1994)


@inlined
def _share_of_torque(p: RotorParameters, forcing: float, y: float) -> float:
    """Torque of a propeller whose blades stall [1], relative to one whose blades do not.

    A braked propeller slows down a little until they do, stops at once then, and starts again in a
    far stronger wind: stalled, it is driven as at rest, `breakaway` times less than the slope of
    the torque at full speed promises there.
    """
    slip = 1.0 - y / forcing if forcing != 0.0 else 0.0
    if slip <= 0.0:
        return 1.0
    stalled = 1.0 / (1.0 + math.exp((STALL_SLIP - slip) / STALL_WIDTH))
    return 1.0 + stalled * (1.0 / (p.breakaway * slip) - 1.0)


@compiled
def rotor_acceleration(
    p: RotorParameters,
    y: float,
    psi: float,
    forcing: float,
    slope: float,
    lift: float,
    across: tuple[float, float],
    density_ratio: float,
    temperature: float,
) -> float:
    """dy/dt [m/s^2] of the rotor equation; see the module's text for the terms.

    `across` is the transverse wind in the plane of rotation [m/s].

    A rotor at rest stays at rest while the aerodynamic torque does not exceed the friction.
    """
    friction = _friction_of_fast(p, temperature) / density_ratio
    pace = density_ratio / (p.distance_constant * p.inertia_factor)
    return _acceleration(p, y, psi, forcing, slope, lift, across[0], across[1], friction, pace)


@inlined
def _acceleration(
    p: RotorParameters,
    y: float,
    psi: float,
    forcing: float,
    slope: float,
    lift: float,
    across_x: float,
    across_y: float,
    friction: float,
    pace: float,
) -> float:
    """dy/dt [m/s^2].

    Args:
        p: Constants of the rotor.
        y: l s [m/s].
        psi: Rotor angle [rad].
        forcing, slope, lift: A, B [m/s] and E [m^2/s^2].
        across_x, across_y: Transverse wind in the plane of rotation [m/s].
        friction: Of a rotor that turns fast, over the density ratio [m^2/s^2].
        pace: Density ratio over the length in which the rotor answers [1/m].
    """
    torque = (forcing - y) * (p.a4 * slope + (1.0 - p.a4) * y) + lift
    if p.torque_harmonic != 0.0:
        strong = psi - p.torque_harmonic_phase
        pull = across_x * math.cos(strong) + across_y * math.sin(strong)
        torque += p.torque_harmonic * forcing * pull
    if p.breakaway != 1.0 and _is_propeller(p):
        torque *= _share_of_torque(p, forcing, y)
    held = _at_rate(p, y, friction)
    if y > 0.0:
        return pace * (torque - held)
    if y < 0.0:
        return pace * (torque + held)
    if abs(torque) <= held:
        return 0.0
    return pace * (torque - math.copysign(held, torque))


@inlined
def _not_beyond_rest(reached: float, y: float, friction: float) -> float:
    """A stage of a step that friction ends at rest: there its torque would turn round."""
    return 0.0 if friction > 0.0 and y != 0.0 and reached * y < 0.0 else reached


@compiled
def advance_rotor(
    p: RotorParameters,
    y: float,
    psi: float,
    axial: tuple[float, float],
    transverse: tuple[float, float],
    lateral: tuple[float, float],
    density_ratio: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """One interval of the rotor equation, the wind varying linearly over it.

    Fourth-order Runge-Kutta with as many substeps as the response length asks for. The rotor
    stops when friction brings it to rest inside a substep.

    Args:
        p: Constants of the rotor.
        y: l s at the start [m/s].
        psi: Rotor angle at the start [rad].
        axial, transverse: Wind in rotor axes (see `rotor_forcing`) at start and end.
        lateral: Direction of the transverse wind in the plane of rotation [rad] then.
        density_ratio: Air density relative to the calibration's.
        temperature: Air temperature [deg C].
        dt: Interval [s].

    Returns:
        y [m/s] and psi [rad] at the end.
    """
    return advance_forced(
        p, y, psi, forced_by(p, axial[0], transverse[0], lateral[0]),
        forced_by(p, axial[1], transverse[1], lateral[1]), density_ratio, temperature, dt,
    )


@compiled
def forced_by(p: RotorParameters, axial: float, transverse: float, lateral: float) -> Forced:
    """What drives a rotor in a wind given in its axes, for `advance_forced`.

    Args:
        p: Constants of the rotor.
        axial, transverse: Wind in rotor axes (see `rotor_forcing`) [m/s].
        lateral: Direction of the transverse wind in the plane of rotation [rad].
    """
    a, b, e = rotor_forcing(p, axial, transverse)
    if p.torque_harmonic == 0.0:
        return a, b, e, 0.0, 0.0
    # In the calibration's units, as A is: a gain or an offset makes no blade weaker.
    across = transverse * p.calibration_gain if _is_propeller(p) else a
    return a, b, e, across * math.cos(lateral), across * math.sin(lateral)


@compiled
def advance_forced(
    p: RotorParameters,
    y: float,
    psi: float,
    start: Forced,
    stop: Forced,
    density_ratio: float,
    temperature: float,
    dt: float,
) -> tuple[float, float]:
    """One interval of the rotor equation under a forcing that varies linearly over it.

    Args:
        p, y, psi, density_ratio, temperature, dt: As in `advance_rotor`.
        start, stop: A, B [m/s], E [m^2/s^2] of `rotor_forcing` and the transverse wind in the plane
            of rotation [m/s] at start and end; see `forced_by`.

    Returns:
        y [m/s] and psi [rad] at the end; NaN if the rotor runs away, which the quadratic torque
        allows for a4 above one once a rotor turns too fast.
    """
    if not abs(y) < RUNAWAY_SPEED:
        return math.nan, math.nan
    a_0, b_0, e_0, x_0, y_0 = start
    a_1, b_1, e_1, x_1, y_1 = stop
    fastest = density_ratio * max(abs(b_0), abs(b_1), abs(a_0), abs(a_1), abs(y))
    substeps = 1 + int(6.0 * dt * fastest / (p.distance_constant * p.inertia_factor))
    if p.torque_harmonic != 0.0:
        substeps = max(substeps, 1 + int(1.5 * dt * abs(y) / p.calibration_distance))
    step = dt / substeps
    inverse_length = 1.0 / p.calibration_distance
    friction = _friction_of_fast(p, temperature) / density_ratio
    pace = density_ratio / (p.distance_constant * p.inertia_factor)
    for k in range(substeps):
        f_0 = k / substeps
        f_h = (k + 0.5) / substeps
        f_1 = (k + 1.0) / substeps
        a_h = a_0 + f_h * (a_1 - a_0)
        b_h = b_0 + f_h * (b_1 - b_0)
        e_h = e_0 + f_h * (e_1 - e_0)
        x_h = x_0 + f_h * (x_1 - x_0)
        y_h = y_0 + f_h * (y_1 - y_0)
        k_1 = _acceleration(
            p, y, psi, a_0 + f_0 * (a_1 - a_0), b_0 + f_0 * (b_1 - b_0), e_0 + f_0 * (e_1 - e_0),
            x_0 + f_0 * (x_1 - x_0), y_0 + f_0 * (y_1 - y_0), friction, pace,
        )
        y_2 = _not_beyond_rest(y + 0.5 * step * k_1, y, p.friction)
        psi_2 = psi + 0.5 * step * y * inverse_length
        k_2 = _acceleration(p, y_2, psi_2, a_h, b_h, e_h, x_h, y_h, friction, pace)
        y_3 = _not_beyond_rest(y + 0.5 * step * k_2, y, p.friction)
        psi_3 = psi + 0.5 * step * y_2 * inverse_length
        k_3 = _acceleration(p, y_3, psi_3, a_h, b_h, e_h, x_h, y_h, friction, pace)
        y_4 = _not_beyond_rest(y + step * k_3, y, p.friction)
        psi_4 = psi + step * y_3 * inverse_length
        k_4 = _acceleration(
            p, y_4, psi_4, a_0 + f_1 * (a_1 - a_0), b_0 + f_1 * (b_1 - b_0),
            e_0 + f_1 * (e_1 - e_0), x_0 + f_1 * (x_1 - x_0), y_0 + f_1 * (y_1 - y_0),
            friction, pace,
        )
        y_next = y + step / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
        psi += step / 6.0 * (y + 2.0 * y_2 + 2.0 * y_3 + y_4) * inverse_length
        if p.friction > 0.0 and y != 0.0 and y_next * y < 0.0:
            y_next = 0.0
        if p.form != PROPELLER_JACKSON and y_next < 0.0:
            y_next = 0.0
        y = y_next
        if not abs(y) < RUNAWAY_SPEED:
            return math.nan, math.nan
    return y, psi
