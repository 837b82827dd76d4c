"""The shape of a concealed cause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from proving_ground.inflow import Array
from proving_ground.scene import Scene

Parameters = dict[str, object]
Plant = Callable[[Scene, float, Array], Parameters]


@dataclass(frozen=True)
class Cause:
    """How a cause is planted.

    instrument: the one it sits on ("rotor", "vane", "platform", "reference" or "station");
    plant(scene, amount, activity) changes the scene, with the amount in the unit of the table of
    minimum sizes and the activity (0 to 1) on the scene's grid, and returns its parameters.
    """

    instrument: str
    plant: Plant


def activity_between(time: Array, begin: float | None, end: float | None) -> Array:
    """Activity on a grid [s]: one between begin and end (None: always), with two-second edges."""
    activity = np.ones_like(time)
    if begin is not None:
        activity *= np.clip((time - begin) / 2.0, 0.0, 1.0)
    if end is not None:
        activity *= np.clip((end - time) / 2.0, 0.0, 1.0)
    return activity


def active_at(scene: Scene, activity: Array) -> Callable[[Array], Array]:
    """The activity as a function of time [s]."""
    return lambda time: np.interp(time, scene.time, activity)


def heading_deg(bearing: float) -> float:
    """A bearing [rad] as answers state it: degrees counter-clockwise from the sensor's x axis."""
    return round(float(np.degrees(bearing) % 360.0), 2)


def pick_visited_bearing(scene: Scene) -> float:
    """A direction [rad] in the sensor's frame from which the wind comes often enough."""
    bearing = scene.bearing_from(scene.rotor_flow)
    center = np.angle(np.mean(np.exp(1j * bearing)))
    spread = np.sort((bearing - center + np.pi) % (2.0 * np.pi) - np.pi)
    return float(center + spread[int(scene.rng.uniform(0.2, 0.8) * spread.size)])
