"""Step rotors and vanes through a record: the only loops over time of the world."""

from __future__ import annotations

import math

import numpy as np

from proving_ground.bearings import advance, stribeck_torque
from proving_ground.blades import BladeGeometry, BladeTracks, blade_torque
from proving_ground.cups import CupGeometry, CupTracks, cup_torque
from proving_ground.fins import FinGeometry, FinTracks, fin_torque
from proving_ground.inflow import Array
from wind_sensors.compiled import compiled

GRID_RATE = 100.0
SUBSTEPS = 10


@compiled
def shaft_friction(
    rate: float,
    static: float,
    coulomb: float,
    viscous: float,
    stribeck_rate: float,
    resonance_rate: float,
    resonance_loss: float,
) -> float:
    """Friction torque [N m] of a rotor's shaft, with the loss of a shaft that resonates."""
    friction = stribeck_torque(rate, static, coulomb, viscous, stribeck_rate)
    if resonance_loss > 0.0:
        detuning = (abs(rate) - resonance_rate) / (0.12 * resonance_rate)
        friction += resonance_loss / (1.0 + detuning**4)
    return friction


@compiled
def unfolding(wind: float, turning: float, opening: float) -> float:
    """Factor on the torque of flexible cups or blades that open while the wind [m/s] is ahead
    of the rotor [m/s] and fold while it is behind."""
    total = abs(wind) + abs(turning) + 0.2
    return 1.0 + opening * math.tanh(6.0 * (wind - turning) / total)


@compiled
def turn_cups(
    wind: Array,
    geometry: CupGeometry,
    tracks: CupTracks,
    azimuth: float,
    rate: float,
    step: float,
    substeps: int,
) -> Array:
    """Azimuth [rad] of a cup rotor at every substep.

    wind: shape (n, 3) in the rotor's frame on the grid [m/s]; step [s] between substeps.
    """
    count = len(wind) - 1
    path = np.empty(count * substeps + 1)
    path[0] = azimuth
    place = 0
    for i in range(count):
        for k in range(substeps):
            weight = k / substeps
            east = wind[i, 0] + weight * (wind[i + 1, 0] - wind[i, 0])
            north = wind[i, 1] + weight * (wind[i + 1, 1] - wind[i, 1])
            up = wind[i, 2] + weight * (wind[i + 1, 2] - wind[i, 2])
            drive = cup_torque(
                east,
                north,
                up,
                azimuth,
                rate,
                geometry,
                tracks.concave[i],
                tracks.convex[i],
                tracks.pitch[i],
                tracks.first_cup[i],
                tracks.density[i],
            )
            level = math.sqrt(east * east + north * north)
            drive *= unfolding(level, geometry.cruise * rate, tracks.opening[i])
            drive += tracks.extra[i]
            friction = shaft_friction(
                rate,
                tracks.static[i],
                tracks.coulomb[i],
                tracks.viscous[i],
                geometry.stribeck_rate,
                tracks.resonance_rate[i],
                tracks.resonance_loss[i],
            )
            rate = advance(rate, drive, friction, tracks.static[i], tracks.inertia[i], step)
            azimuth += rate * step
            place += 1
            path[place] = azimuth
    return path


@compiled
def swing(
    east: float,
    north: float,
    nose: float,
    rate: float,
    geometry: FinGeometry,
    tracks: FinTracks,
    i: int,
    step: float,
) -> float:
    """Rate [rad/s] of a vane against its mount one step later in a wind given in the sensor's
    plane [m/s]. The air turns it against the earth, whatever the mount does."""
    density = tracks.density[i]
    turning = rate + tracks.mount_rate[i]
    torque = fin_torque(east, north, nose, turning, geometry, density) + tracks.extra[i]
    torque -= tracks.inertia[i] * tracks.mount_acceleration[i]
    cosine = math.cos(nose)
    sine = math.sin(nose)
    torque -= tracks.imbalance[i] * (cosine * tracks.gravity_y[i] - sine * tracks.gravity_x[i])
    torque -= tracks.spring[i] * (nose - tracks.spring_heading[i])
    if geometry.propeller_drag > 0.0:
        # The tunnel measured the vane with its propeller where it is: a drawing that errs does not
        # change how the vane swings.
        distance = geometry.propeller_distance
        side = north * cosine - east * sine - turning * distance
        speed = math.sqrt(east * east + north * north)
        torque += 0.5 * density * geometry.propeller_drag * speed * side * distance
    worn = tracks.notch[i] * max(0.0, math.cos(nose - tracks.notch_heading[i])) ** 12
    friction = stribeck_torque(
        rate, tracks.static[i], tracks.coulomb[i], tracks.viscous[i], geometry.stribeck_rate
    )
    return advance(
        rate, torque, friction + worn, tracks.static[i] + 1.3 * worn, tracks.inertia[i], step
    )


@compiled
def turn_vane(
    wind: Array,
    geometry: FinGeometry,
    tracks: FinTracks,
    nose: float,
    rate: float,
    step: float,
    substeps: int,
) -> Array:
    """Nose heading [rad, unwrapped] of a vane at every grid time. wind: (n, 3) [m/s]."""
    count = len(wind)
    path = np.empty(count)
    path[0] = nose
    for i in range(count - 1):
        for k in range(substeps):
            weight = k / substeps
            east = wind[i, 0] + weight * (wind[i + 1, 0] - wind[i, 0])
            north = wind[i, 1] + weight * (wind[i + 1, 1] - wind[i, 1])
            rate = swing(east, north, nose, rate, geometry, tracks, i, step)
            nose += rate * step
        path[i + 1] = nose
    return path


@compiled
def turn_propeller_on_vane(
    rotor_wind: Array,
    vane_wind: Array,
    blades: BladeGeometry,
    rotor: BladeTracks,
    fin: FinGeometry,
    vane: FinTracks,
    nose: float,
    rate: float,
    step: float,
    substeps: int,
) -> tuple[Array, Array]:
    """Azimuth [rad] of the propeller at every substep and nose heading [rad] at every grid time.

    rotor_wind, vane_wind: shape (n, 3) in the sensor's frame [m/s]; rate [rad/s] starts the
    propeller.
    """
    count = len(rotor_wind) - 1
    path = np.empty(count * substeps + 1)
    path[0] = 0.0
    noses = np.empty(count + 1)
    noses[0] = nose
    azimuth = 0.0
    yaw_rate = 0.0
    place = 0
    for i in range(count):
        distance = fin.propeller_distance + vane.lead[i]
        for k in range(substeps):
            weight = k / substeps
            east = vane_wind[i, 0] + weight * (vane_wind[i + 1, 0] - vane_wind[i, 0])
            north = vane_wind[i, 1] + weight * (vane_wind[i + 1, 1] - vane_wind[i, 1])
            yaw_rate = swing(east, north, nose, yaw_rate, fin, vane, i, step)
            nose += yaw_rate * step
            east = rotor_wind[i, 0] + weight * (rotor_wind[i + 1, 0] - rotor_wind[i, 0])
            north = rotor_wind[i, 1] + weight * (rotor_wind[i + 1, 1] - rotor_wind[i, 1])
            up = rotor_wind[i, 2] + weight * (rotor_wind[i + 1, 2] - rotor_wind[i, 2])
            cosine = math.cos(nose)
            sine = math.sin(nose)
            axial = -(east * cosine + north * sine)
            across = north * cosine - east * sine - yaw_rate * distance
            gain = rotor.pitch_gain[i] * (1.0 + rotor.washout[i] * abs(axial))
            drive = blade_torque(
                axial,
                across,
                up,
                azimuth,
                rate,
                blades,
                gain,
                rotor.shroud[i],
                rotor.first_blade[i],
                rotor.roughness[i],
                rotor.density[i],
            )
            drive *= unfolding(axial, blades.cruise * rate, rotor.opening[i])
            drive += rotor.extra[i]
            friction = shaft_friction(
                rate,
                rotor.static[i],
                rotor.coulomb[i],
                rotor.viscous[i],
                blades.stribeck_rate,
                rotor.resonance_rate[i],
                rotor.resonance_loss[i],
            )
            rate = advance(rate, drive, friction, rotor.static[i], rotor.inertia[i], step)
            azimuth += rate * step
            place += 1
            path[place] = azimuth
        noses[i + 1] = nose
    return path, noses
