"""Causes in the wind at the sensor: wakes, bent flow, leaning axes."""

from __future__ import annotations

import numpy as np

from proving_ground.concealed.kinds import (
    Cause,
    Parameters,
    heading_deg,
    pick_visited_bearing,
)
from proving_ground.inflow import Array
from proving_ground.measure import wrap
from proving_ground.scene import Scene, tilted
from proving_ground.weather import wandering


def wake_shadow(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The wake of a mast or tower: flat bottom, raised-cosine flanks, its own turbulence."""
    bearing = pick_visited_bearing(scene)
    half = np.radians(scene.rng.uniform(9.0, 22.0))
    depth = min(amount, 0.75)
    bottom = 0.35 * half
    away = np.abs(wrap(scene.bearing_from(scene.rotor_flow) - bearing))
    flank = np.clip((half - away) / (half - bottom), 0.0, 1.0)
    shade = activity * 0.5 * (1.0 - np.cos(np.pi * flank))
    eddies = 0.25 * depth * wandering(scene.rng, scene.time, 0.3, 3.0)
    scene.rotor_flow *= (1.0 - shade * (depth + eddies))[:, None]
    swirl = 0.1 * depth * shade * wandering(scene.rng, scene.time, 0.4, 4.0)
    scene.vane_flow *= (1.0 - shade * depth)[:, None]
    _turn_flow(scene.vane_flow, swirl)
    return {
        "bearing_from_deg": heading_deg(bearing),
        "depth": round(depth, 4),
        "half_width_deg": round(float(np.degrees(half)), 2),
    }


def flow_distortion(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Flow past a mast and its boom: a doublet with the source of the wake it leaves.

    Where the wind comes from an angle a to the axis of either, it is faster by c cos(n a) and
    turned by -c sin(n a): a flow without vorticity cannot do one without the other.
    """
    toward = float(scene.rng.uniform(-np.pi, np.pi))
    doublet = float(scene.rng.uniform(0.6, 1.0))
    source = 1.0 - doublet
    angle = scene.bearing_from(scene.rotor_flow) - toward
    speed = amount * activity * (doublet * np.cos(2.0 * angle) + source * np.cos(angle))
    bend = -amount * activity * (doublet * np.sin(2.0 * angle) + source * np.sin(angle))
    scene.rotor_flow *= (1.0 + speed)[:, None]
    scene.vane_flow *= (1.0 + speed)[:, None]
    _turn_flow(scene.rotor_flow, bend)
    _turn_flow(scene.vane_flow, bend)
    return {"toward_deg": heading_deg(toward), "amplitude": round(amount, 4)}


def axis_tilt(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The sensor's stem leans: rotor and vane see the wind in a leaning frame."""
    bearing = float(scene.rng.uniform(-np.pi, np.pi))
    tilt = float(np.radians(amount))
    for flow in (scene.rotor_flow, scene.vane_flow):
        flow[:] += activity[:, None] * (tilted(flow, tilt, bearing) - flow)
    gravity = np.zeros((len(scene.time), 3))
    gravity[:, 0], gravity[:, 1] = scene.vane.gravity_x, scene.vane.gravity_y
    gravity[:, 2] = -9.81
    leaning = gravity + activity[:, None] * (tilted(gravity, tilt, bearing) - gravity)
    scene.vane.gravity_x[:], scene.vane.gravity_y[:] = leaning[:, 0], leaning[:, 1]
    return {"tilt_deg": round(amount, 3), "towards_deg": heading_deg(bearing)}


def rotor_downwash(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A jet from above that a side wind blows away from the sensor."""
    fade = float(scene.rng.uniform(6.0, 10.0))
    for flow in (scene.rotor_flow, scene.vane_flow):
        level = np.hypot(flow[:, 0], flow[:, 1])
        reach = activity / (1.0 + (level / fade) ** 3)
        flow[:, 2] -= amount * reach * (1.0 + 0.15 * wandering(scene.rng, scene.time, 0.3, 2.0))
        flow[:, 0] += 0.25 * amount * reach
    return {"speed": round(amount, 3), "fades_at": round(fade, 2)}


def _turn_flow(flow: Array, angle: Array) -> None:
    east = flow[:, 0] * np.cos(angle) - flow[:, 1] * np.sin(angle)
    flow[:, 1] = flow[:, 0] * np.sin(angle) + flow[:, 1] * np.cos(angle)
    flow[:, 0] = east


CAUSES: dict[str, Cause] = {
    "wake_shadow": Cause("rotor", wake_shadow),
    "flow_distortion": Cause("station", flow_distortion),
    "axis_tilt": Cause("station", axis_tilt),
    "rotor_downwash": Cause("station", rotor_downwash),
}
