"""How well estimates agree with a reference that has errors of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt
from scipy.stats import norm

from wind_sensors.estimation.outputs import ProcessedRecording
from wind_sensors.station.model import Reference

FloatArray = npt.NDArray[np.float64]

SLOWEST_COMPARED = 0.15
"""Frequencies above this are compared sample by sample [Hz]; below it the means are."""
_INTERVAL = float(norm.ppf(0.95))
_TRANSVERSE = 4.0 / 3.0


@dataclass(frozen=True)
class Agreement:
    """Estimates against a reference.

    Attributes:
        vector_speed_error: Speed of the vector mean, relative to the reference's [1].
        scalar_speed_error: Mean speed, relative to the reference's [1].
        scalar_speed_error_allowed: The same after the reference's slow excess across the wind has
            been taken from its mean speed [1].
        direction_error: Of the vector mean [rad].
        rms: Of the horizontal components [m/s].
        rms_fast: Of the horizontal components above `SLOWEST_COMPARED` [m/s].
        reference_fast: What the reference's distance, path and noise alone make of it [m/s].
        coverage: Share of fast errors inside their 90 % interval [1].
    """

    vector_speed_error: float
    scalar_speed_error: float
    scalar_speed_error_allowed: float
    direction_error: float
    rms: float
    rms_fast: float
    reference_fast: float
    coverage: float


def reference_variance(
    reference: Reference, level: npt.ArrayLike, speed: npt.ArrayLike
) -> FloatArray:
    """Variance of a reference's difference from the wind at the sensor, per component [m^2/s^2].

    Separation and path by the structure function of the inertial range, D = level (r/U)^(2/3)
    along and 4/3 of it across the separation, whose direction is not known; plus noise.

    Args:
        reference: Where it stands, how long its path is, its noise.
        level: Longitudinal level [m^2 s^-2 s^-2/3].
        speed: Of the wind past the sensors [m/s].
    """
    u = np.maximum(np.asarray(speed, dtype=np.float64), 0.5)
    away = np.hypot(reference.separation, 0.5 * reference.path_length)
    structure = np.asarray(level, dtype=np.float64) * (away / u) ** (2.0 / 3.0)
    variance: FloatArray = 0.5 * (1.0 + _TRANSVERSE) * structure + reference.noise**2
    return variance


def _level_of(wind: FloatArray, dt: float) -> float:
    """Inertial-range level of both horizontal components, from steps of a fifth of a second."""
    lag = max(round(0.2 / dt), 1)
    steps = np.square(wind[lag:, :2] - wind[:-lag, :2]).mean()
    return float(steps / (0.5 * (1.0 + _TRANSVERSE)) / (lag * dt) ** (2.0 / 3.0))


def agreement(
    processed: ProcessedRecording, velocity: FloatArray | None = None, skip: float = 30.0
) -> Agreement:
    """Compare estimates with the reference of their recording.

    Args:
        processed: Estimates and recording.
        velocity: Compare these velocities at the estimates' times instead [m/s], shape (n, 3).
        skip: Leave out so many seconds at the start, while the turbulence is being learnt.

    Raises:
        ValueError: The recording has no reference.
    """
    recording = processed.recording
    reference, winds = recording.station.reference, recording.reference
    if reference is None or winds is None:
        raise ValueError(f"recording {recording.name} has no reference wind")
    time = processed.time
    inside = (
        (time >= winds.time[0]) & (time <= winds.time[-1]) & (time >= time[0] + round(skip * 1e9))
    )
    seconds = (winds.time - winds.time[0]) * 1e-9
    at = (time[inside] - winds.time[0]) * 1e-9
    measured = np.stack([np.interp(at, seconds, winds.velocity[:, i]) for i in range(3)], axis=1)
    found = (processed.velocity if velocity is None else velocity)[inside]
    covariance = processed.covariance[inside]
    error = found[:, :2] - measured[:, :2]
    dt = float(np.median(np.diff(at)))
    sos = butter(4, SLOWEST_COMPARED, fs=1.0 / dt, output="sos")
    slow = sosfiltfilt(sos, error, axis=0)
    fast = error - slow
    apparent = np.hypot(processed.apparent[inside, 0], processed.apparent[inside, 1])
    own = np.stack((covariance[:, 0, 0], covariance[:, 1, 1]), axis=1)
    level = _level_of(winds.velocity, float(np.median(np.diff(seconds))))
    theirs = reference_variance(reference, level, apparent)[:, np.newaxis]
    deviation = np.sqrt(own + theirs)
    speeds = np.hypot(found[:, 0], found[:, 1])
    across = (slow[:, 1] * found[:, 0] - slow[:, 0] * found[:, 1]) / np.maximum(speeds, 0.3)
    mean, true_mean = found.mean(axis=0), measured.mean(axis=0)
    scalar = float(np.mean(speeds + 0.5 * _across_variance(found, covariance)))
    true_scalar = float(np.hypot(measured[:, 0], measured[:, 1]).mean())
    excess = float(np.mean(np.square(across) / (2.0 * np.maximum(speeds, 0.3))))
    turn = np.arctan2(mean[1], mean[0]) - np.arctan2(true_mean[1], true_mean[0])
    return Agreement(
        vector_speed_error=float(np.hypot(*mean[:2]) / np.hypot(*true_mean[:2]) - 1.0),
        scalar_speed_error=scalar / true_scalar - 1.0,
        scalar_speed_error_allowed=scalar / (true_scalar - excess) - 1.0,
        direction_error=float((turn + np.pi) % (2.0 * np.pi) - np.pi),
        rms=float(np.sqrt(np.mean(np.square(error)))),
        rms_fast=float(np.sqrt(np.mean(np.square(fast)))),
        reference_fast=float(np.sqrt(np.mean(theirs))),
        coverage=float(np.mean(np.abs(fast) <= _INTERVAL * deviation)),
    )


def _across_variance(velocity: FloatArray, covariance: FloatArray) -> FloatArray:
    """Variance across the wind over the speed [m/s]: twice what it adds to the mean speed."""
    speed = np.maximum(np.hypot(velocity[:, 0], velocity[:, 1]), 0.2)
    e, n = velocity[:, 0] / speed, velocity[:, 1] / speed
    variance = n**2 * covariance[:, 0, 0] + e**2 * covariance[:, 1, 1]
    variance = variance - 2.0 * e * n * covariance[:, 0, 1]
    ratio: FloatArray = variance / speed
    return ratio
