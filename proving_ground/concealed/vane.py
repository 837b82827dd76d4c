"""Causes in the vane: bearing, mass, dampers, balance, place of the propeller."""

from __future__ import annotations

import numpy as np

from proving_ground.concealed.kinds import Cause, Parameters
from proving_ground.inflow import Array
from proving_ground.scene import Scene, tilted
from proving_ground.stations import STANDARD_DENSITY
from proving_ground.tunnel import vane_sheet

FRICTION_SPEED = 5.0
LEAN = np.radians(4.0)
TYPICAL_ROLL = np.radians(12.0)


def stiffness(scene: Scene, speed: float) -> float:
    """Aerodynamic torque for a radian of error [N m/rad] at a wind speed [m/s]."""
    fin = scene.station.vane.geometry
    return 0.5 * STANDARD_DENSITY * speed**2 * fin.area * fin.slope * fin.arm


def vane_friction(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A mount that sticks: static and dry friction."""
    torque = stiffness(scene, FRICTION_SPEED) * float(np.radians(amount))
    scene.vane.static[:] += activity * torque
    scene.vane.coulomb[:] += activity * 0.75 * torque
    static = scene.station.vane.shaft.static
    return {
        "sticks_at_5_m_s_deg": round(amount, 3),
        "factor": round((static + torque) / static, 3),
    }


def vane_inertia(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A heavier vane."""
    scene.vane.inertia[:] *= 1.0 + amount * activity
    return {"factor": round(1.0 + amount, 4)}


def vane_damping(scene: Scene, amount: float, activity: Array) -> Parameters:
    """An oil damper: torque in proportion to the rate, whatever the wind."""
    sheet = vane_sheet(scene.station.vane)
    natural = 8.0 / sheet.distance_constant
    torque = 2.0 * amount * sheet.damping_ratio * natural * scene.station.vane.shaft.inertia
    scene.vane.viscous[:] += activity * torque
    return {"damping_factor_at_8_m_s": round(1.0 + amount, 4)}


def vane_imbalance(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A counterweight lost; a mast also leans, for on an upright axis nothing would show."""
    lean = LEAN if scene.station.boat is None else TYPICAL_ROLL
    moment = stiffness(scene, FRICTION_SPEED) * float(np.radians(amount)) / (9.81 * np.sin(lean))
    scene.vane.imbalance[:] += activity * moment
    if scene.station.boat is None:
        bearing = float(scene.rng.uniform(-np.pi, np.pi))
        down = np.zeros((len(scene.time), 3))
        down[:, 2] = -9.81
        leaning = tilted(down, lean, bearing)
        scene.vane.gravity_x[:] = leaning[:, 0]
        scene.vane.gravity_y[:] = leaning[:, 1]
    return {"mass_moment_kg_m": float(f"{moment:.4g}")}


def propeller_translation(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The propeller sits farther in front of the vane's axis than the drawing says."""
    scene.vane.lead[:] += activity * amount
    return {"sheet_error": round(amount, 3)}


CAUSES: dict[str, Cause] = {
    "vane_friction": Cause("vane", vane_friction),
    "vane_inertia": Cause("vane", vane_inertia),
    "vane_damping": Cause("vane", vane_damping),
    "vane_imbalance": Cause("vane", vane_imbalance),
    "propeller_translation": Cause("rotor", propeller_translation),
}
