"""What the platform reports against what it does: compass, log, frames, clock.

`true_motion` undoes the errors that the station file states; `reported_motion` plants them. They
are inverse to each other, so that a simulated recording processed with its own station file gives
the motion that was simulated.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled
from wind_sensors.motion import frames, rotations
from wind_sensors.motion.platform_track import Motion, shifted
from wind_sensors.station.model import HeadingDeviation, Platform

FloatArray = npt.NDArray[np.float64]

MOST_STEPS = 7
CLOSE = 1e-7
"""A step of Newton's method this small [rad] leaves an error of the order of its square."""


def heading_error(deviation: HeadingDeviation, heading: npt.ArrayLike) -> FloatArray:
    """Compass error A + B sin h + C cos h + D sin 2h + E cos 2h [rad], clockwise positive.

    Args:
        deviation: Its coefficients.
        heading: Compass heading, clockwise from north [rad].
    """
    h = np.asarray(heading, dtype=np.float64)
    error: FloatArray = np.radians(
        deviation.constant_deg
        + deviation.sine_deg * np.sin(h)
        + deviation.cosine_deg * np.cos(h)
        + deviation.sine_2_deg * np.sin(2.0 * h)
        + deviation.cosine_2_deg * np.cos(2.0 * h)
    )
    return error


def heading_without_error(deviation: HeadingDeviation, reported: npt.ArrayLike) -> FloatArray:
    """The heading [rad] that a compass with that deviation reports as `reported` [rad].

    Newton's method; the deviation's slope stays far below one for any compass worth the name.
    """
    target = np.asarray(reported, dtype=np.float64)
    terms = np.radians(
        (deviation.constant_deg, deviation.sine_deg, deviation.cosine_deg,
         deviation.sine_2_deg, deviation.cosine_2_deg)
    )
    result: FloatArray = _undeviated(target.ravel(), *terms).reshape(target.shape)
    return result


@compiled
def _undeviated(
    target: FloatArray, a: float, b: float, c: float, d: float, e: float
) -> FloatArray:
    """Headings h with h + a + b sin h + c cos h + d sin 2h + e cos 2h = target, shape (n,)."""
    out = np.empty_like(target)
    for i in range(target.size):
        heading = target[i]
        for step in range(MOST_STEPS):
            sine, cosine = math.sin(heading), math.cos(heading)
            sine_2, cosine_2 = 2.0 * sine * cosine, cosine * cosine - sine * sine
            excess = heading - target[i] + a + b * sine + c * cosine + d * sine_2 + e * cosine_2
            # As good a start as one of Newton's steps where the slope is large.
            slope = b * cosine - c * sine + 2.0 * (d * cosine_2 - e * sine_2)
            change = excess / (1.0 + slope) if step > 0 else excess
            heading -= change
            if abs(change) < CLOSE:
                break
        out[i] = heading
    return out


def _compass(attitude: FloatArray) -> FloatArray:
    heading: FloatArray = 0.5 * np.pi - frames.heading_of(attitude)
    return heading


def _declination(platform: Platform) -> float:
    if platform.heading_reference == "magnetic":
        return float(np.radians(platform.magnetic_declination_deg or 0.0))
    return 0.0


def true_motion(platform: Platform, reported: Motion, dt: float, elapsed: float = 0.0) -> Motion:
    """The motion behind what the platform reports.

    Args:
        platform: The carrier with its errors.
        reported: Reported states read at regular instants of the recording's clock.
        dt: Their interval [s].
        elapsed: Seconds from the start of the recording to the first of them; a drifting clock
            counts from there.

    Returns:
        The motion at those instants, ENU and platform axes. Declination, compass deviation, speed
        scale, axis conventions and the clock's latency and drift are undone.
    """
    motion = reported
    clock = platform.clock
    if clock.latency != 0.0 or clock.drift != 0.0:
        seconds = elapsed + dt * np.arange(len(motion))
        motion = shifted(motion, dt, clock.latency + clock.drift * seconds)
    if platform.frame == "ned":
        motion = Motion(
            attitude=frames.attitude_enu_from_ned(motion.attitude),
            velocity=(
                frames.swap_enu_ned(motion.velocity)
                if platform.velocity_axes == "earth"
                else frames.swap_flu_frd(motion.velocity)
            ),
            angular_rate=frames.swap_flu_frd(motion.angular_rate),
            position=frames.swap_enu_ned(motion.position),
            travel=None if motion.travel is None else frames.swap_enu_ned(motion.travel),
        )
    declination = _declination(platform)
    if declination != 0.0 or platform.heading_deviation != HeadingDeviation():
        shown = _compass(motion.attitude)
        heading = heading_without_error(platform.heading_deviation, shown) + declination
        motion = replace(
            motion, attitude=rotations.turned_about_up(motion.attitude, shown - heading)
        )
    if platform.velocity_axes == "earth":
        motion = replace(motion, velocity=rotations.rotate_back(motion.attitude, motion.velocity))
    if platform.velocity_turn_deg != 0.0:
        motion = replace(
            motion, velocity=_turned_velocity(motion.velocity, -platform.velocity_turn_deg)
        )
    if platform.velocity_scale != 1.0:
        motion = replace(motion, velocity=motion.velocity / platform.velocity_scale)
    if platform.position_share != 0.0 and motion.travel is not None:
        travel = rotations.rotate_back(motion.attitude, motion.travel)
        share = platform.position_share
        motion = replace(motion, velocity=(1.0 - share) * motion.velocity + share * travel)
    return motion


def _turned_velocity(velocity: FloatArray, degrees: float) -> FloatArray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x, y, z = velocity.T
    turned: FloatArray = np.stack((c * x - s * y, s * x + c * y, z), axis=1)
    return turned


def reported_motion(platform: Platform, motion: Motion) -> Motion:
    """What the platform reports of a motion; the clock is left to the stamps.

    The inverse of `true_motion` without its clock.
    """
    out = motion
    if platform.velocity_scale != 1.0:
        out = replace(out, velocity=out.velocity * platform.velocity_scale)
    if platform.velocity_turn_deg != 0.0:
        out = replace(out, velocity=_turned_velocity(out.velocity, platform.velocity_turn_deg))
    if platform.velocity_axes == "earth":
        out = replace(out, velocity=rotations.rotate(out.attitude, out.velocity))
    declination = _declination(platform)
    if declination != 0.0 or platform.heading_deviation != HeadingDeviation():
        magnetic = _compass(out.attitude) - declination
        turn = declination - heading_error(platform.heading_deviation, magnetic)
        out = replace(out, attitude=rotations.turned_about_up(out.attitude, turn))
    if platform.frame == "ned":
        out = Motion(
            attitude=frames.attitude_ned_from_enu(out.attitude),
            velocity=(
                frames.swap_enu_ned(out.velocity)
                if platform.velocity_axes == "earth"
                else frames.swap_flu_frd(out.velocity)
            ),
            angular_rate=frames.swap_flu_frd(out.angular_rate),
            position=frames.swap_enu_ned(out.position),
        )
    return out
