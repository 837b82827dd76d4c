"""A wind vane from the normal force on its fin in the apparent wind at its tail."""

from __future__ import annotations

import math
from typing import NamedTuple

from proving_ground.inflow import Array
from wind_sensors.compiled import compiled


class FinGeometry(NamedTuple):
    """Shape of a vane: arm [m] from axis to fin, area [m^2], slope [1/rad] of the normal force,
    stall [rad], plate [1] normal-force coefficient when separated, nose_area [m^2] and nose_arm
    [m] of what sticks out in front, stribeck_rate [rad/s], propeller_distance [m] by which a
    propeller sits in front of the axis and propeller_drag [m^2]."""

    arm: float
    area: float
    slope: float
    stall: float
    plate: float
    nose_area: float
    nose_arm: float
    stribeck_rate: float
    propeller_distance: float
    propeller_drag: float


class FinTracks(NamedTuple):
    """What may change in a vane during a record, one value for each grid time.

    inertia [kg m^2]; static, coulomb [N m]; viscous [N m s]; density [kg/m^3]; imbalance [kg m]
    (mass moment, tail heavy); gravity_x, gravity_y [m/s^2] specific force in the sensor's plane;
    notch [N m] and notch_heading [rad] of a worn spot of the bearing; spring [N m/rad] and
    spring_heading [rad] of a cable; extra [N m]; lead [m] by which the propeller's true distance
    from the axis exceeds that of the drawing; mount_rate [rad/s] and mount_acceleration [rad/s^2]
    of the mount about the vane's axis.
    """

    inertia: Array
    static: Array
    coulomb: Array
    viscous: Array
    density: Array
    imbalance: Array
    gravity_x: Array
    gravity_y: Array
    notch: Array
    notch_heading: Array
    spring: Array
    spring_heading: Array
    extra: Array
    lead: Array
    mount_rate: Array
    mount_acceleration: Array


@compiled
def fin_coefficient(attack: float, slope: float, stall: float, plate: float) -> float:
    """Normal-force coefficient of a low fin: attached with vortex lift, then separated."""
    sine = math.sin(attack)
    attached = slope * sine * math.cos(attack) + 1.1 * sine * abs(sine)
    separated = 1.0 / (1.0 + math.exp(-(abs(attack) - stall) / 0.06))
    return (1.0 - separated) * attached + separated * plate * sine


@compiled
def fin_torque(
    east: float, north: float, nose: float, rate: float, geometry: FinGeometry, density: float
) -> float:
    """Aerodynamic torque [N m] on a vane whose nose points to `nose` [rad], turning at `rate`
    against the air."""
    cosine = math.cos(nose)
    sine = math.sin(nose)
    along = -(east * cosine + north * sine)
    across = north * cosine - east * sine
    tail = across + rate * geometry.arm
    attack = math.atan2(tail, along)
    force = 0.5 * density * (along * along + tail * tail) * geometry.area
    torque = -force * geometry.arm
    torque *= fin_coefficient(attack, geometry.slope, geometry.stall, geometry.plate)
    front = across - rate * geometry.nose_arm
    torque += 0.5 * density * geometry.nose_area * geometry.nose_arm * front * abs(front)
    return torque
