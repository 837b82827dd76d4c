"""A propeller from blade elements in an oblique wind, resolved in azimuth."""

from __future__ import annotations

import math
from typing import NamedTuple

from proving_ground.inflow import Array
from wind_sensors.compiled import compiled


class BladeGeometry(NamedTuple):
    """Shape of a propeller: how many blades, hub and tip radius [m], chord [m], pitch_run [m/rad],
    elements along a blade, stall [rad], hub_shadow [1] (loss of wind through the body behind),
    stribeck_rate [rad/s], cruise [m/rad] the wind run of a radian in a steady wind."""

    blades: int
    hub: float
    tip: float
    chord: float
    pitch_run: float
    elements: int
    stall: float
    hub_shadow: float
    stribeck_rate: float
    cruise: float


class BladeTracks(NamedTuple):
    """What may change in a propeller during a record, one value for each grid time.

    inertia [kg m^2]; static, coulomb [N m]; viscous [N m s]; pitch_gain [1] scales the pitch run;
    washout [s/m] its growth with the wind; shroud [1] dims an oblique wind; opening [1] as for a
    cup; first_blade [1] the strength of the first blade, which takes a
    coarser pitch as it weakens; roughness [1] scales drag and stall;
    density [kg/m^3]; extra [N m]; resonance_rate [rad/s], resonance_loss [N m].
    """

    inertia: Array
    static: Array
    coulomb: Array
    viscous: Array
    pitch_gain: Array
    washout: Array
    shroud: Array
    opening: Array
    first_blade: Array
    roughness: Array
    density: Array
    extra: Array
    resonance_rate: Array
    resonance_loss: Array


@compiled
def element_torque_coefficient(
    attack: float, inflow: float, stall: float, roughness: float
) -> float:
    """Coefficient of the force that turns a blade element, from a polar with stall."""
    sine = math.sin(attack)
    cosine = math.cos(attack)
    separated = 1.0 / (1.0 + math.exp(-(abs(attack) - stall / roughness) / 0.05))
    separated = max(separated, 1.0 if cosine < 0.0 else 0.0)
    lift = (1.0 - separated) * 5.0 * sine * cosine + separated * 2.1 * sine * cosine
    drag = 0.025 * roughness + (0.4 + 1.5 * separated) * sine * sine
    return lift * math.sin(inflow) - drag * math.cos(inflow)


@compiled
def blade_torque(
    axial: float,
    across: float,
    up: float,
    azimuth: float,
    rate: float,
    geometry: BladeGeometry,
    pitch_gain: float,
    shroud: float,
    first_blade: float,
    roughness: float,
    density: float,
) -> float:
    """Torque [N m] about the shaft; axial wind runs from the front, across and up transverse."""
    transverse = across * across + up * up
    square = axial * axial + transverse + 1e-12
    through = axial * (1.0 - shroud * transverse / square)
    if through < 0.0:
        through *= 1.0 - geometry.hub_shadow
    width = (geometry.tip - geometry.hub) / geometry.elements
    total = 0.0
    for blade in range(geometry.blades):
        angle = azimuth + 2.0 * math.pi * blade / geometry.blades
        sweep = across * math.sin(angle) - up * math.cos(angle)
        strength = first_blade if blade == 0 else 1.0
        for element in range(geometry.elements):
            radius = geometry.hub + (element + 0.5) * width
            edgewise = rate * radius + sweep
            speed = through * through + edgewise * edgewise
            inflow = math.atan2(through, edgewise)
            setting = math.atan(geometry.pitch_run * pitch_gain / strength / radius)
            coefficient = element_torque_coefficient(
                inflow - setting, inflow, geometry.stall, roughness
            )
            area = geometry.chord * width
            total += strength * 0.5 * density * speed * area * radius * coefficient
    return total
