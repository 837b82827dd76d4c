"""Three propellers with pulses in turbulence against the information that their signals carry.

The bound is the error of the best linear non-causal estimate of the linearised problem: it knows
the record's own spectra, the mean wind, every propeller's response length L g(0)/g(theta) and the
scatter of the shaft angle's readings. Besides that scatter the noise is what the readings fold back
from above their own Nyquist frequency. An estimator that must learn turbulence and scatter, and
that allows for an instrument that is not known exactly, stays above it.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation import EstimatorSettings, process
from wind_sensors.instruments.friction_propeller import torque_slope_ratio
from wind_sensors.instruments.propeller_array import orthogonal_axes, tripod_axes, wind_angles
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Propeller, Station
from wind_sensors.station.signals import Pulses, Recording
from wind_sensors.turbulence.synthesis import isotropic_spec

FloatArray = npt.NDArray[np.float64]

SPEED, INTENSITY, INTEGRAL_LENGTH, DIRECTION = 8.0, 0.12, 60.0, 0.6
RATE = 200.0
SLOTS = 6
CALIBRATION_DISTANCE = 0.049
_SKIP = 40.0
_FINER = 2
_PER_OCTAVE = 12


class Comparison(NamedTuple):
    """Rms errors along, across and up [m/s], shape (3,) each."""

    found: FloatArray
    stated: FloatArray
    inverse: FloatArray
    naive: FloatArray
    bound: FloatArray


def station(axes: FloatArray) -> Station:
    """Gill propellers along the axes, shape (m, 3), with shaft angles six times a turn."""
    return Station(
        instruments=tuple(
            Propeller.model_validate(
                {
                    "name": f"propeller_{k}",
                    "pulses": {"topic": f"p{k}", "type": "sensor_msgs/msg/JointState"},
                    "pulses_per_revolution": SLOTS,
                    "calibration_distance": CALIBRATION_DISTANCE,
                    "distance_constant": 1.0,
                    "stall_speed": 0.2,
                    "axis": tuple(float(c) for c in axis),
                }
            )
            for k, axis in enumerate(axes)
        )
    )


def with_scatter(recording: Recording, scatter: float, seed: int) -> Recording:
    """The recording with shaft angles that scatter by so many slots."""
    generator = np.random.default_rng(seed)
    pulses = {}
    for name, told in recording.pulses.items():
        assert told.turns is not None
        noise = generator.normal(0.0, scatter / SLOTS, told.turns.size)
        pulses[name] = Pulses(told.time, told.turns + noise)
    return replace(recording, pulses=pulses)


def _smoothed(power: FloatArray) -> FloatArray:
    band = np.floor(_PER_OCTAVE * np.log2(np.maximum(np.arange(power.size), 1))).astype(int)
    count = np.maximum(np.bincount(band), 1)
    smooth: FloatArray = (np.bincount(band, power) / count)[band]
    return smooth


def bound(wind: FloatArray, axes: FloatArray, edges: list[int], scatter: float) -> FloatArray:
    """Rms error of the best linear estimate [m/s], shape (3,).

    Args:
        wind: Along, across, up every 1/RATE s [m/s], shape (n, 3).
        axes: Of the propellers in the same frame, shape (m, 3).
        edges: Of each propeller in the record.
        scatter: Of a reading [slots].
    """
    n = wind.shape[0]
    mean = wind.mean(axis=0)
    fine = np.stack(
        [
            np.interp(np.arange(n * _FINER) / _FINER, np.arange(n), wind[:, k] - mean[k])
            for k in range(3)
        ]
    )
    spectra = np.stack([_smoothed(np.abs(np.fft.rfft(f)) ** 2 / f.size) for f in fine])
    size = n * _FINER
    omega = 2j * np.pi * np.arange(spectra.shape[1]) * RATE / n
    speed = float(np.linalg.norm(mean))
    lengths = 1.0 / torque_slope_ratio(wind_angles(axes, mean))
    with np.errstate(divide="ignore", invalid="ignore"):
        turning = 1.0 / (1.0 + omega * lengths[:, np.newaxis] / speed) / omega
    turning[:, 0] = turning[:, 1]
    seen = turning[:, :, np.newaxis] * axes[:, np.newaxis, :]
    noise = np.empty(turning.shape)
    for i, samples in enumerate(edges):
        power = np.sum(np.abs(seen[i]) ** 2 * spectra.T, axis=1)
        full = np.concatenate((power, power[-2:0:-1]))
        place = np.arange(size)
        place = np.where(place > size // 2, place - size, place)
        folded = np.bincount(place % samples, full, minlength=samples)[place % samples]
        reading = (2.0 * np.pi * CALIBRATION_DISTANCE * scatter / SLOTS) ** 2
        noise[i] = np.maximum(folded[: power.size] - power, 0.0) + reading * size / samples
    gain = seen.transpose(1, 0, 2)
    prior = spectra.T[:, :, np.newaxis] * np.eye(3)
    crossed = prior @ np.conj(gain.transpose(0, 2, 1))
    information = gain @ crossed + noise.T[:, :, np.newaxis] * np.eye(len(edges))
    left = prior - crossed @ np.linalg.solve(information, np.conj(crossed.transpose(0, 2, 1)))
    errors = np.real(np.diagonal(left, axis1=1, axis2=2))
    total = errors[0] + 2.0 * errors[1:].sum(axis=0)
    return np.asarray(np.sqrt(total / size), dtype=np.float64)


def compare(
    axes: FloatArray, scatter: float = 0.01, duration: float = 300.0, seed: int = 5
) -> Comparison:
    """Errors of all methods in one simulated record, and the bound.

    Args:
        axes: East, north, up, shape (m, 3).
        scatter: Of the shaft angles' readings [slots].
        duration: [s].
        seed: Of the wind.
    """
    wind = isotropic_spec(SPEED, INTENSITY, INTEGRAL_LENGTH, DIRECTION, seed)
    recording = simulate(
        station(axes), Scenario(wind=wind, duration=duration, seed=seed, sample_rate=RATE)
    )
    recording = with_scatter(recording, scatter, seed)
    truth = recording.truth
    assert truth is not None
    c, s = np.cos(DIRECTION), np.sin(DIRECTION)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    errors = []
    stated = np.zeros(3)
    for method in ("kalman", "inverse", "naive"):
        found = process(recording, EstimatorSettings(method=method, smoother_lag=4.0))
        at = (found.time - truth.time[0]) * 1e-9
        true = np.stack(
            [
                np.interp(at, (truth.time - truth.time[0]) * 1e-9, truth.velocity[:, k])
                for k in range(3)
            ],
            axis=1,
        )
        used = (at > _SKIP) & (at < duration - 5.0)
        error = (found.velocity - true)[used] @ turn.T
        errors.append(np.sqrt(np.mean(np.square(error), axis=0)))
        if method == "kalman":
            covariance = turn @ found.covariance[used].mean(axis=0) @ turn.T
            stated = np.sqrt(np.diag(covariance))
    inside = truth.velocity[round(_SKIP * RATE) :] @ turn.T
    share = inside.shape[0] / truth.velocity.shape[0]
    edges = [round(p.time.size * share) for p in recording.pulses.values()]
    limit = bound(inside, np.asarray(axes) @ turn.T, edges, scatter)
    return Comparison(errors[0], stated, errors[1], errors[2], limit)


def main() -> None:
    """Print the table."""
    arrays = {
        "tripod, 54.7 deg to the mean wind": tripod_axes(DIRECTION),
        "orthogonal, east north up": orthogonal_axes(),
    }
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 300.0
    for name, axes, scatter in [(n, a, s) for n, a in arrays.items() for s in (0.01, 0.0)]:
        result = compare(axes, scatter, duration)
        print(f"{name}, readings scatter by {scatter:g} slots: rms error [m/s]")
        for k, component in enumerate(("along", "across", "up")):
            print(
                f"  {component:6s} kalman {result.found[k]:.3f} (states {result.stated[k]:.3f})  "
                f"bound {result.bound[k]:.3f}  ratio {result.found[k] / result.bound[k]:.2f}  "
                f"inverse {result.inverse[k]:.3f}  naive {result.naive[k]:.3f}"
            )


if __name__ == "__main__":
    main()
