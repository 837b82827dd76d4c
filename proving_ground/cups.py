"""A cup rotor from the forces on its cups, resolved in azimuth."""

from __future__ import annotations

import math
from typing import NamedTuple

from proving_ground.inflow import Array
from wind_sensors.compiled import compiled


class CupGeometry(NamedTuple):
    """Shape of a cup rotor.

    cups counts them [1]; arm [m]; area of one cup [m^2]; edge [1] is the width in the cosine of
    incidence over which the normal force turns from the outside to the inside of a cup; turn [1]
    where it does; spill [1] is the part of an up- or downdraught that presses on the cups;
    shelter [1] is the loss of dynamic pressure of a cup in the lee of the others; stribeck_rate
    [rad/s]; cruise [m/rad] is the wind run of a radian in a steady wind.
    """

    cups: int
    arm: float
    area: float
    edge: float
    turn: float
    spill: float
    shelter: float
    stribeck_rate: float
    cruise: float


class CupTracks(NamedTuple):
    """What may change in a cup rotor during a record, one value for each grid time.

    inertia [kg m^2]; static, coulomb [N m]; viscous [N m s]; concave, convex normal-force
    coefficients [1]; pitch [rad] by which the openings look upward; opening [1] by which the
    force grows while the rotor is being sped up and shrinks while it is slowed; first_cup [1]
    the strength of the inside of the first cup; density [kg/m^3]; extra [N m] any other torque;
    resonance_rate [rad/s] and resonance_loss [N m] of the shaft.
    """

    inertia: Array
    static: Array
    coulomb: Array
    viscous: Array
    concave: Array
    convex: Array
    pitch: Array
    opening: Array
    first_cup: Array
    density: Array
    extra: Array
    resonance_rate: Array
    resonance_loss: Array


@compiled
def normal_force_coefficient(
    cosine: float, concave: float, convex: float, edge: float, turn: float
) -> float:
    """Normal-force coefficient of a cup against the cosine of the angle of incidence."""
    return -convex + (concave + convex) / (1.0 + math.exp(-(cosine - turn) / edge))


@compiled
def cup_torque(
    east: float,
    north: float,
    up: float,
    azimuth: float,
    rate: float,
    geometry: CupGeometry,
    concave: float,
    convex: float,
    pitch: float,
    first_cup: float,
    density: float,
) -> float:
    """Aerodynamic torque [N m] about the shaft in a wind given in the rotor's frame [m/s]."""
    speed = math.sqrt(east * east + north * north) + 1e-9
    total = 0.0
    lift = math.sin(pitch)
    level = math.cos(pitch)
    for cup in range(geometry.cups):
        angle = azimuth + 2.0 * math.pi * cup / geometry.cups
        radial_x = math.cos(angle)
        radial_y = math.sin(angle)
        x = east + rate * geometry.arm * radial_y
        y = north - rate * geometry.arm * radial_x
        square = x * x + y * y + geometry.spill * up * up + 1e-9
        into = ((y * radial_x - x * radial_y) * level + up * lift) / math.sqrt(square)
        lee = (east * radial_x + north * radial_y) / speed
        pressure = 0.5 * density * square
        if lee > 0.0:
            pressure *= 1.0 - geometry.shelter * lee**4
        inside = concave * first_cup if cup == 0 else concave
        force = pressure * geometry.area
        force *= normal_force_coefficient(into, inside, convex, geometry.edge, geometry.turn)
        total += force * level * geometry.arm
    return total
