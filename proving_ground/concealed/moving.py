"""Causes on a moving platform: what its odometry gets wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from proving_ground.boat import Motion
from proving_ground.concealed.kinds import Cause, Parameters, active_at
from proving_ground.inflow import Array
from proving_ground.scene import Scene


def platform_velocity(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The log is dead: the odometry reports no velocity."""
    active = active_at(scene, activity)

    def still(time: Array, motion: Motion) -> Motion:
        return replace(motion, velocity=motion.velocity * (1.0 - active(time))[:, None])

    scene.odometry_changes.append(still)
    return {"reported_share": 0.0}


def platform_velocity_scale(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A fouled or wrongly calibrated log."""
    active = active_at(scene, activity)
    scale = 1.0 + amount * float(scene.rng.choice([-1.0, 1.0]))

    def scaled(time: Array, motion: Motion) -> Motion:
        factor = 1.0 + (scale - 1.0) * active(time)
        return replace(motion, velocity=motion.velocity * factor[:, None])

    scene.odometry_changes.append(scaled)
    return {"reported_over_true": round(scale, 4)}


def lever_arm(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The sensor sits elsewhere on the platform than the drawing says."""
    assert scene.station.boat is not None
    sheet = np.array(scene.station.boat.sensor_position)
    level = float(scene.rng.normal(0.0, 0.3))
    error = np.array([level, float(scene.rng.normal(0.0, 0.2)), 1.0])
    error *= amount / float(np.linalg.norm(error))
    if sheet[2] - error[2] > 0.3 and scene.rng.random() < 0.3:
        error = -error
    extra = np.cross(scene.motion.turning, error) * activity[:, None]
    scene.rotor_flow -= extra
    scene.vane_flow -= extra
    return {
        "sheet_m": [round(float(p), 3) for p in sheet],
        "true_m": [round(float(p), 3) for p in sheet + error],
    }


def heading_deviation(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Iron near the compass: a deviation once, and a little twice, a turn."""
    size = float(np.radians(amount))
    phase = float(scene.rng.uniform(-np.pi, np.pi))
    active = active_at(scene, activity)

    def deviate(time: Array, motion: Motion) -> Motion:
        once = np.sin(motion.yaw - phase) + 0.2 * np.sin(2.0 * motion.yaw)
        return replace(motion, yaw=motion.yaw + size * once * active(time))

    scene.odometry_changes.append(deviate)
    return {"amplitude_deg": round(amount, 3), "phase_deg": round(float(np.degrees(phase)), 1)}


def frame_error(scene: Scene, amount: float, activity: Array) -> Parameters:
    """The velocity is reported in a frame turned against the platform's."""
    turn = float(np.radians(min(amount, 90.0))) * float(scene.rng.choice([-1.0, 1.0]))
    active = active_at(scene, activity)

    def turned(time: Array, motion: Motion) -> Motion:
        angle = turn * active(time)
        velocity = motion.velocity.copy()
        velocity[:, 0] = (
            np.cos(angle) * motion.velocity[:, 0] - np.sin(angle) * motion.velocity[:, 1]
        )
        velocity[:, 1] = (
            np.sin(angle) * motion.velocity[:, 0] + np.cos(angle) * motion.velocity[:, 1]
        )
        return replace(motion, velocity=velocity)

    scene.odometry_changes.append(turned)
    return {"velocity_frame_turn_deg": round(float(np.degrees(turn)), 2)}


CAUSES: dict[str, Cause] = {
    "platform_velocity": Cause("platform", platform_velocity),
    "platform_velocity_scale": Cause("platform", platform_velocity_scale),
    "lever_arm": Cause("platform", lever_arm),
    "heading_deviation": Cause("platform", heading_deviation),
    "frame_error": Cause("platform", frame_error),
}
