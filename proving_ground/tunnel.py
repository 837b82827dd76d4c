"""The world's own calibration laboratory: what a datasheet says about a healthy instrument.

Steady rates in a uniform flow give the calibration line, a rotor released from rest the distance
constant (30 to 74 % of the final rate, ASTM D5096), tilts the angular response, and a vane let go
from ten degrees its distance constant and damping ratio (ASTM D5366).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from proving_ground.blades import BladeTracks
from proving_ground.cups import CupTracks
from proving_ground.drive import GRID_RATE, SUBSTEPS, turn_cups, turn_propeller_on_vane, turn_vane
from proving_ground.fins import FinGeometry, FinTracks
from proving_ground.inflow import Array
from proving_ground.stations import STANDARD_DENSITY, CupRotor, Propeller, Shaft, Vane

STEP = 1.0 / (GRID_RATE * SUBSTEPS)
CALIBRATION_SPEEDS = (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0)
RESPONSE_SPEED = 8.0
TILTS_DEG = (-20.0, -15.0, -10.0, -5.0, 0.0, 5.0, 10.0, 15.0, 20.0)
TABLE_DEG = tuple(float(a) for a in range(0, 181, 10))


@dataclass(frozen=True)
class RotorSheet:
    """Calibration line: distance [m/rad] and intercept [m/s]; distance_constant [m]."""

    calibration_distance: float
    starting_speed: float
    distance_constant: float


@dataclass(frozen=True)
class VaneSheet:
    """distance_constant [m] and damping_ratio [1] of a vane."""

    distance_constant: float
    damping_ratio: float


def cup_tracks(rotor: CupRotor, count: int, density: float = STANDARD_DENSITY) -> CupTracks:
    """Tracks of a healthy cup rotor, constant over `count` grid times."""

    def level(value: float) -> Array:
        return np.full(count, value)

    shaft = rotor.shaft
    return CupTracks(
        inertia=level(shaft.inertia),
        static=level(shaft.static),
        coulomb=level(shaft.coulomb),
        viscous=level(shaft.viscous),
        concave=level(rotor.concave),
        convex=level(rotor.convex),
        pitch=level(rotor.pitch),
        opening=level(0.0),
        first_cup=level(1.0 + rotor.unevenness),
        density=level(density),
        extra=level(0.0),
        resonance_rate=level(1.0),
        resonance_loss=level(0.0),
    )


def blade_tracks(
    propeller: Propeller, count: int, density: float = STANDARD_DENSITY
) -> BladeTracks:
    """Tracks of a healthy propeller, constant over `count` grid times."""

    def level(value: float) -> Array:
        return np.full(count, value)

    shaft = propeller.shaft
    return BladeTracks(
        inertia=level(shaft.inertia),
        static=level(shaft.static),
        coulomb=level(shaft.coulomb),
        viscous=level(shaft.viscous),
        pitch_gain=level(1.0),
        washout=level(0.0),
        shroud=level(0.0),
        opening=level(0.0),
        first_blade=level(1.0),
        roughness=level(1.0),
        density=level(density),
        extra=level(0.0),
        resonance_rate=level(1.0),
        resonance_loss=level(0.0),
    )


def fin_tracks(shaft: Shaft, count: int, density: float = STANDARD_DENSITY) -> FinTracks:
    """Tracks of a healthy vane, constant over `count` grid times."""

    def level(value: float) -> Array:
        return np.full(count, value)

    return FinTracks(
        inertia=level(shaft.inertia),
        static=level(shaft.static),
        coulomb=level(shaft.coulomb),
        viscous=level(shaft.viscous),
        density=level(density),
        imbalance=level(0.0),
        gravity_x=level(0.0),
        gravity_y=level(0.0),
        notch=level(0.0),
        notch_heading=level(0.0),
        spring=level(0.0),
        spring_heading=level(0.0),
        extra=level(0.0),
        lead=level(0.0),
        mount_rate=level(0.0),
        mount_acceleration=level(0.0),
    )


def uniform_flow(speed: float, tilt: float, seconds: float) -> Array:
    """A flow towards the east that rises by `tilt` [rad]; shape (n, 3)."""
    count = int(seconds * GRID_RATE) + 1
    flow = np.zeros((count, 3))
    flow[:, 0] = speed * np.cos(tilt)
    flow[:, 2] = speed * np.sin(tilt)
    return flow


def cup_path(rotor: CupRotor, flow: Array, rate: float, tracks: CupTracks | None = None) -> Array:
    """Azimuth [rad] of a cup rotor in a flow."""
    tracks = tracks or cup_tracks(rotor, len(flow))
    return turn_cups(flow, rotor.geometry, tracks, 0.0, rate, STEP, SUBSTEPS)


def propeller_path(
    propeller: Propeller, flow: Array, rate: float, tracks: BladeTracks | None = None
) -> Array:
    """Azimuth [rad] of a propeller held with its nose to the west in a flow."""
    held = FinGeometry(0.2, 0.01, 3.0, 0.4, 1.2, 0.0, 0.1, 0.05, 0.0, 0.0)
    clamp = fin_tracks(Shaft(1.0, 1e6, 1e6, 0.0, 0.0), len(flow))
    tracks = tracks or blade_tracks(propeller, len(flow))
    path, _ = turn_propeller_on_vane(
        flow, flow, propeller.geometry, tracks, held, clamp, np.pi, rate, STEP, SUBSTEPS
    )
    return path


def settled_rate(path: Array) -> float:
    """Mean rate [rad/s] over the second half of a path."""
    half = len(path) // 2
    return float((path[-1] - path[half]) / ((len(path) - 1 - half) * STEP))


def path_of(rotor: CupRotor | Propeller, flow: Array, rate: float) -> Array:
    """Azimuth [rad] of either rotor in a flow."""
    if isinstance(rotor, CupRotor):
        return cup_path(rotor, flow, rate)
    return propeller_path(rotor, flow, rate)


def steady_rate(rotor: CupRotor | Propeller, speed: float, tilt: float = 0.0) -> float:
    """Steady rate [rad/s] in a uniform flow of `speed` [m/s], tilted by `tilt` [rad]."""
    start = speed * np.cos(tilt) / rotor.geometry.cruise
    return settled_rate(path_of(rotor, uniform_flow(speed, tilt, 8.0 + 30.0 / speed), start))


def released_distance(rotor: CupRotor | Propeller, speed: float) -> float:
    """Distance constant [m] from a release at rest: 30 to 74 % of the final rate."""
    final = steady_rate(rotor, speed)
    path = path_of(rotor, uniform_flow(speed, 0.0, 5.0 + 60.0 / speed), 0.0)
    parts = rotor.geometry.cups if isinstance(rotor, CupRotor) else rotor.geometry.blades
    window = max(1, int(2.0 * np.pi / parts / final / STEP))
    rate = (path[window:] - path[:-window]) / (window * STEP)
    first = int(np.argmax(rate >= 0.30 * final))
    second = int(np.argmax(rate >= 0.74 * final))
    return float((second - first) * STEP * speed / np.log(0.70 / 0.26))


def _tune(rotor: CupRotor | Propeller, distance: float) -> tuple[float, float]:
    speed = RESPONSE_SPEED
    flow = uniform_flow(speed, 0.0, 20.0)
    cruise = speed / settled_rate(path_of(rotor, flow, speed / rotor.geometry.cruise))
    inertia = rotor.shaft.inertia
    for _ in range(4):
        trial = replace(rotor, shaft=replace(rotor.shaft, inertia=inertia))
        inertia *= distance / released_distance(trial, speed)
    return cruise, inertia


def tune_cup(rotor: CupRotor, distance_constant: float) -> CupRotor:
    """The rotor with the inertia that gives it the distance constant [m]."""
    cruise, inertia = _tune(rotor, distance_constant)
    return replace(
        rotor,
        geometry=rotor.geometry._replace(cruise=cruise),
        shaft=replace(rotor.shaft, inertia=inertia),
    )


def tune_propeller(propeller: Propeller, distance_constant: float) -> Propeller:
    """The propeller with the inertia that gives it the distance constant [m]."""
    cruise, inertia = _tune(propeller, distance_constant)
    return replace(
        propeller,
        geometry=propeller.geometry._replace(cruise=cruise),
        shaft=replace(propeller.shaft, inertia=inertia),
    )


@lru_cache(maxsize=64)
def rotor_sheet(rotor: CupRotor | Propeller) -> RotorSheet:
    """Calibration line over 4 to 16 m/s and the distance constant."""
    speeds = np.array(CALIBRATION_SPEEDS)
    rates = np.array([steady_rate(rotor, float(s)) for s in speeds])
    slope, intercept = np.polyfit(rates, speeds, 1)
    return RotorSheet(float(slope), float(intercept), released_distance(rotor, RESPONSE_SPEED))


@lru_cache(maxsize=64)
def cup_angular_response(rotor: CupRotor) -> tuple[float, float]:
    """mu1 and mu2 of cos t + mu1 sin t + mu2 (1 - cos t), fitted within 20 degrees."""
    angle = np.radians(TILTS_DEG)
    level = steady_rate(rotor, RESPONSE_SPEED)
    ratio = np.array([steady_rate(rotor, RESPONSE_SPEED, float(a)) for a in angle]) / level
    terms = np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    mu1, mu2 = np.linalg.lstsq(terms, ratio - np.cos(angle), rcond=None)[0]
    return float(mu1), float(mu2)


@lru_cache(maxsize=64)
def stall_speed(propeller: Propeller) -> float:
    """Speed [m/s] whose square is the shortfall of speed x (wind run of a turn) at low wind."""
    speeds = np.array([0.7, 0.9, 1.2, 1.6, 2.2, 3.0])
    fine = RotorSheet(*_line(propeller))
    rates = np.array([steady_rate(propeller, float(s)) for s in speeds])
    shortfall = speeds**2 - speeds * fine.calibration_distance * rates
    return float(np.sqrt(max(float(np.median(shortfall)), 0.0)))


def _line(propeller: Propeller) -> tuple[float, float, float]:
    speeds = np.array(CALIBRATION_SPEEDS)
    rates = np.array([steady_rate(propeller, float(s)) for s in speeds])
    return float((speeds @ rates) / (rates @ rates)), 0.0, 0.0


@lru_cache(maxsize=64)
def propeller_sheet(propeller: Propeller) -> RotorSheet:
    """Wind run of a radian through the origin, stall speed and distance constant."""
    distance = released_distance(propeller, RESPONSE_SPEED)
    return RotorSheet(_line(propeller)[0], stall_speed(propeller), distance)


@lru_cache(maxsize=64)
def oblique_table(propeller: Propeller) -> tuple[float, ...]:
    """Rate at each angle of TABLE_DEG over the axial rate."""
    level = steady_rate(propeller, RESPONSE_SPEED)
    rates = [
        steady_rate(propeller, RESPONSE_SPEED, float(np.radians(a))) / level for a in TABLE_DEG
    ]
    return tuple(round(float(r), 4) for r in rates)


@lru_cache(maxsize=64)
def vane_sheet(vane: Vane) -> VaneSheet:
    """Distance constant and damping ratio from the swing after a release at ten degrees."""
    speed = RESPONSE_SPEED
    flow = uniform_flow(speed, 0.0, 4.0)
    start = np.radians(10.0)
    path = turn_vane(
        flow,
        vane.geometry,
        fin_tracks(vane.shaft, len(flow)),
        np.pi + start,
        0.0,
        STEP,
        SUBSTEPS,
    )
    swing = (path - np.pi) / start
    time = np.arange(len(flow)) / GRID_RATE

    def misfit(parameters: Array) -> Array:
        distance, damping = parameters
        natural = speed / distance
        damped = natural * np.sqrt(max(1.0 - damping**2, 1e-6))
        decay = np.exp(-damping * natural * time)
        model = decay * (np.cos(damped * time) + damping * natural / damped * np.sin(damped * time))
        return np.asarray(model - swing)

    found = least_squares(misfit, [0.7, 0.3], bounds=([0.05, 0.01], [10.0, 0.99]))
    return VaneSheet(float(found.x[0]), float(found.x[1]))
