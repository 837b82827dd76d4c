"""Causes in the rotor: aerodynamics, bearing, mass."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from proving_ground.blades import BladeTracks
from proving_ground.concealed.kinds import Cause, Parameters
from proving_ground.cups import CupTracks
from proving_ground.inflow import Array
from proving_ground.scene import Scene
from proving_ground.stations import CupRotor, Propeller
from proving_ground.tunnel import (
    blade_tracks,
    cup_path,
    cup_tracks,
    propeller_path,
    settled_rate,
    uniform_flow,
)
from proving_ground.weather import air_density

FRICTION_SPEED = 5.0


def _rate_with(rotor: CupRotor | Propeller, speed: float, **levels: float) -> float:
    """Steady rate [rad/s] with some tracks at other levels."""
    flow = uniform_flow(speed, 0.0, 8.0 + 40.0 / speed)
    start = speed / rotor.geometry.cruise
    if isinstance(rotor, CupRotor):
        cups = cup_tracks(rotor, len(flow))
        for name, level in levels.items():
            getattr(cups, name)[:] = level
        return settled_rate(cup_path(rotor, flow, start, cups))
    blades = blade_tracks(rotor, len(flow))
    for name, level in levels.items():
        getattr(blades, name)[:] = level
    return settled_rate(propeller_path(rotor, flow, start, blades))


@lru_cache(maxsize=64)
def drag_for_loss(rotor: CupRotor | Propeller, speed: float, loss: float) -> float:
    """Torque [N m] that lowers the indicated speed by `loss` [m/s] at a wind `speed` [m/s]."""
    free = _rate_with(rotor, speed)
    torque = rotor.shaft.coulomb * 5.0
    for _ in range(4):
        found = (free - _rate_with(rotor, speed, extra=-torque)) * rotor.geometry.cruise
        torque *= float(np.clip(loss / max(found, 1e-6), 0.2, 5.0))
    return torque


@lru_cache(maxsize=64)
def track_for_ratio(
    rotor: CupRotor | Propeller, track: str, level: float, ratio: float, pitch: float = np.nan
) -> float:
    """Level of a track near `level` at which the steady rate at 8 m/s is `ratio` of healthy.

    pitch [rad], where given, is that of a cup rotor with bent arms.
    """
    speed = 8.0
    healthy = _rate_with(rotor, speed)
    bent = {} if np.isnan(pitch) else {"pitch": pitch}
    low, high = level, level * (1.03 if ratio >= 1.0 else 0.97)
    low_rate = _rate_with(rotor, speed, **bent) / healthy
    high_rate = _rate_with(rotor, speed, **bent, **{track: high}) / healthy
    for _ in range(6):
        if abs(high_rate - ratio) < 1e-5:
            break
        slope = (high_rate - low_rate) / (high - low)
        low, low_rate = high, high_rate
        high = high + (ratio - high_rate) / slope
        high_rate = _rate_with(rotor, speed, **bent, **{track: high}) / healthy
    return high


def calibration_drift(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Worn cups push with another force; a propeller's blades take another pitch."""
    ratio = 1.0 + amount * float(scene.rng.choice([-1.0, 1.0]))
    rotor = scene.station.rotor
    if isinstance(scene.rotor, CupTracks) and isinstance(rotor, CupRotor):
        level = track_for_ratio(rotor, "concave", rotor.concave, ratio)
        scene.rotor.concave[:] += activity * (level - rotor.concave)
    elif isinstance(scene.rotor, BladeTracks):
        level = track_for_ratio(rotor, "pitch_gain", 1.0, ratio)
        scene.rotor.pitch_gain[:] += activity * (level - 1.0)
    return {"indicated_over_true": round(ratio, 5)}


def calibration_offset(scene: Scene, amount: float, activity: Array) -> Parameters:
    """An eddy-current brake: torque in proportion to the rate, the same loss at every wind."""
    drag = drag_for_loss(scene.station.rotor, 8.0, amount)
    scene.rotor.viscous[:] += activity * drag * scene.station.rotor.geometry.cruise / 8.0
    return {"offset": round(-amount, 4)}


def bearing_friction(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A dirty bearing: more static and dry friction, sometimes grease that stiffens with cold."""
    drag = drag_for_loss(scene.station.rotor, FRICTION_SPEED, amount)
    stiffens = bool(scene.rng.random() < 0.3)
    cold = np.exp(-0.05 * (scene.temperature - scene.temperature.mean())) if stiffens else 1.0
    scene.rotor.coulomb[:] += activity * drag * cold
    scene.rotor.static[:] += activity * 1.5 * drag * cold
    coulomb = scene.station.rotor.shaft.coulomb
    return {
        "loss_at_5_m_s": round(amount, 4),
        "factor": round((coulomb + drag) / coulomb, 3),
        "falls_with_temperature": stiffens,
    }


def thin_air(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A high site whose barometer reports pressure reduced to sea level."""
    factor = float(np.exp(-amount))
    level = 1.0 + activity * (factor - 1.0)
    density = air_density(scene.temperature, scene.pressure * level)
    scene.rotor.density[:] = density
    scene.vane.density[:] = density
    return {"density_factor": round(factor, 4)}


def rotor_inertia(scene: Scene, amount: float, activity: Array) -> Parameters:
    """A heavier rotor."""
    scene.rotor.inertia[:] *= 1.0 + amount * activity
    return {"factor": round(1.0 + amount, 4)}


def torque_asymmetry(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Flexible cups or blades that open while speeding up and fold while slowing down."""
    opening = min(amount, 0.9)
    scene.rotor.opening[:] += activity * opening
    return {"asymmetry": round(opening, 4)}


def damaged_cup(scene: Scene, amount: float, activity: Array) -> Parameters:
    """One cup is dented, or one blade bent, and pushes less than the others."""
    strength = (
        scene.rotor.first_cup if isinstance(scene.rotor, CupTracks) else scene.rotor.first_blade
    )
    loss = min(amount, 0.9)
    strength[:] *= 1.0 - loss * activity
    return {"loss": round(loss, 4)}


def angular_response(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Bent arms turn the cups' openings upward; a ring dims an oblique wind at a propeller."""
    rotor = scene.station.rotor
    if isinstance(scene.rotor, CupTracks) and isinstance(rotor, CupRotor):
        sign = float(scene.rng.choice([-1.0, 1.0]))
        bend = float(np.arctan(amount))
        pitch = rotor.pitch + sign * bend
        level = track_for_ratio(rotor, "concave", rotor.concave, 1.0, pitch)
        scene.rotor.pitch[:] += activity * sign * bend
        scene.rotor.concave[:] += activity * (level - rotor.concave)
        return {"pitch_deg": round(float(np.degrees(sign * bend)), 3)}
    shade = min(2.5 * amount, 0.9)
    if isinstance(scene.rotor, BladeTracks):
        scene.rotor.shroud[:] += activity * shade
    return {"shroud": round(shade, 4)}


def icing(scene: Scene, amount: float, activity: Array) -> Parameters:
    """Rime that grows over some minutes: mass, blunter cups or rough blades, a stiff bearing."""
    growth = float(scene.rng.uniform(60.0, 240.0))
    begun = float(scene.time[int(np.argmax(activity > 0.0))])
    ice = activity * (1.0 - np.exp(-np.maximum(scene.time - begun, 0.0) / growth))
    scene.rotor.inertia[:] *= 1.0 + 25.0 * amount * ice
    rotor = scene.station.rotor
    ratio = max(1.0 - amount, 0.6)
    if isinstance(scene.rotor, CupTracks) and isinstance(rotor, CupRotor):
        level = track_for_ratio(rotor, "concave", rotor.concave, ratio)
        scene.rotor.concave[:] += ice * (level - rotor.concave)
    elif isinstance(scene.rotor, BladeTracks):
        level = track_for_ratio(rotor, "pitch_gain", 1.0, ratio)
        scene.rotor.pitch_gain[:] += ice * (level - 1.0)
        scene.rotor.roughness[:] *= 1.0 + 8.0 * amount * ice
    drag = drag_for_loss(rotor, FRICTION_SPEED, 0.5 * amount * FRICTION_SPEED)
    scene.rotor.coulomb[:] += ice * drag
    scene.rotor.static[:] += ice * drag
    return {
        "inertia_factor": round(1.0 + 25.0 * amount, 4),
        "indicated_over_true": round(ratio, 4),
        "growth_time": round(growth, 1),
    }


CAUSES: dict[str, Cause] = {
    "calibration_drift": Cause("rotor", calibration_drift),
    "calibration_offset": Cause("rotor", calibration_offset),
    "bearing_friction": Cause("rotor", bearing_friction),
    "air_density": Cause("station", thin_air),
    "rotor_inertia": Cause("rotor", rotor_inertia),
    "torque_asymmetry": Cause("rotor", torque_asymmetry),
    "damaged_cup": Cause("rotor", damaged_cup),
    "angular_response": Cause("rotor", angular_response),
    "icing": Cause("rotor", icing),
}
