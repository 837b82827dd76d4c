"""From the station file's keys to the arguments of the compiled equations of motion."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from wind_sensors.instruments.dynamics.rotor import (
    CUP_EQUIVALENT,
    PROPELLER_JACKSON,
    PROPELLER_KRISTENSEN_1994,
    RESPONSE_TABLE_SIZE,
    RotorParameters,
)
from wind_sensors.instruments.dynamics.vane import VaneParameters
from wind_sensors.station.model import Angle, Cup, Propeller, Vane

VISCOUS_SPEED = 8.0
"""Wind [m/s] in which oil in a vane's bearing is compared with the damping of its fin."""

_NO_TABLE = np.ones(RESPONSE_TABLE_SIZE)


@lru_cache(maxsize=64)
def response_table(
    angles_deg: tuple[float, ...], values: tuple[float, ...], change: float
) -> npt.NDArray[np.float64]:
    """f(theta) of a propeller at 0, 1, ..., 180 degrees.

    Args:
        angles_deg: Angles of the known values, increasing; empty for the cosine.
        values: f at those angles.
        change: Added curvature, f + change (1 - cos) cos.

    Returns:
        Shape (181,), monotone between the known values, constant beyond them.
    """
    grid = np.arange(RESPONSE_TABLE_SIZE, dtype=np.float64)
    cosine = np.cos(np.radians(grid))
    if angles_deg:
        inside = np.clip(grid, angles_deg[0], angles_deg[-1])
        values_at = PchipInterpolator(angles_deg, values)
        table: npt.NDArray[np.float64] = np.asarray(values_at(inside), dtype=np.float64)
    else:
        table = cosine.copy()
    table += change * (1.0 - cosine) * cosine
    return table


def rotor_parameters(rotor: Cup | Propeller) -> RotorParameters:
    """Arguments of the rotor equation for a cup or propeller of the station."""
    if isinstance(rotor, Cup):
        form, starting_speed, mu1, mu2 = CUP_EQUIVALENT, rotor.starting_speed, rotor.mu1, rotor.mu2
        table, stall_speed = _NO_TABLE, 0.0
    else:
        form = PROPELLER_JACKSON if rotor.mu2 is None else PROPELLER_KRISTENSEN_1994
        starting_speed, mu1, mu2 = 0.0, 0.0, rotor.mu2 or 0.0
        stall_speed = rotor.stall_speed
        table = response_table(
            rotor.angular_response_deg, rotor.angular_response, rotor.angular_response_change
        )
    return RotorParameters(
        form=form,
        calibration_distance=rotor.calibration_distance,
        starting_speed=starting_speed,
        distance_constant=rotor.distance_constant,
        a4=rotor.a4,
        mu1=mu1,
        mu2=mu2,
        angular_response=table,
        calibration_gain=rotor.calibration_gain,
        calibration_offset=rotor.calibration_offset,
        friction=stall_speed**2 + rotor.friction_speed**2,
        friction_temperature_coefficient=rotor.friction_temperature_coefficient,
        reference_temperature=rotor.reference_temperature,
        inertia_factor=rotor.inertia_factor,
        torque_harmonic=rotor.torque_harmonic,
        torque_harmonic_phase=float(np.radians(rotor.torque_harmonic_phase_deg)),
        breakaway=rotor.friction_breakaway,
    )


def vane_parameters(vane: Angle) -> VaneParameters:
    """Arguments of the vane equation for a vane (or one axis of a bivane) of the station."""
    own_damping = 2.0 * vane.damping_ratio * VISCOUS_SPEED / vane.distance_constant
    parameters = VaneParameters(
        distance_constant=vane.distance_constant,
        damping_ratio=vane.damping_ratio,
        inertia_factor=vane.inertia_factor,
        damping_factor=vane.damping_factor,
        friction=vane.friction_speed**2,
        imbalance=vane.imbalance,
        aerodynamic_offset=0.0,
        viscosity=vane.viscous_damping * own_damping,
    )
    if not isinstance(vane, Vane):
        return parameters
    return parameters._replace(
        catch=vane.catch_speed**2,
        catch_heading=float(np.radians(vane.catch_heading_deg)),
        catch_width=float(np.radians(vane.catch_width_deg)),
        softness=vane.fin_yield_speed**-2 if vane.fin_yield_speed > 0.0 else 0.0,
        cable=vane.cable_speed**2,
        cable_rest=float(np.radians(vane.cable_rest_deg)),
    )
