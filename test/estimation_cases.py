"""Stations, recordings and message streams that the estimation tests share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wind_sensors.recordings import read_recording
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording
from wind_sensors.turbulence.synthesis import isotropic_spec

SHARED = Path(__file__).resolve().parents[2] / "shared"


def shared_recording(name: str) -> Recording:
    """A recording of the shared material; the test is skipped where there is none."""
    folder = SHARED / "recordings" / name
    if not folder.exists():
        pytest.skip("shared material absent")
    return read_recording(folder)


def mast(cup: dict[str, Any] | None = None, vane: dict[str, Any] | None = None) -> Station:
    """A mast with cup and vane; the arguments override or add keys."""
    return Station.model_validate(
        {
            "instruments": [
                {
                    "kind": "cup",
                    "name": "cup",
                    "pulses": {"topic": "cup/pulses"},
                    "pulses_per_revolution": 4,
                    "calibration_distance": 0.14,
                    "starting_speed": 0.1,
                    "distance_constant": 1.7,
                    "mu2": 0.4,
                    **(cup or {}),
                },
                {
                    "kind": "vane",
                    "name": "vane",
                    "joint_states": {"topic": "vane/joint_states"},
                    "distance_constant": 0.5,
                    "damping_ratio": 0.3,
                    "noise_deg": 0.2,
                    **(vane or {}),
                },
            ]
        }
    )


def blown(
    station: Station,
    speed: float = 8.0,
    duration: float = 60.0,
    intensity: float = 0.12,
    seed: int = 3,
    **more: Any,
) -> Recording:
    """A simulated recording with its truth."""
    scenario = Scenario(
        wind=isotropic_spec(speed, intensity, 60.0, 0.4, seed), duration=duration, seed=seed, **more
    )
    return simulate(station, scenario)


Message = tuple[str, str, int, float]


def messages(recording: Recording) -> list[Message]:
    """Pulses and readings of a recording in order of time: kind, name, stamp, value."""
    out: list[Message] = []
    for name, pulses in recording.pulses.items():
        out += [("pulse", name, int(t), float("nan")) for t in pulses.time]
    for name, angles in recording.angles.items():
        pairs = zip(angles.time, angles.angle, strict=True)
        out += [("angle", name, int(t), float(a)) for t, a in pairs]
    return sorted(out, key=lambda m: m[2])


def feed(estimator: Any, stream: list[Message]) -> None:
    """Messages into an estimator, in the order given."""
    for kind, name, time, value in stream:
        if kind == "pulse":
            estimator.add_pulse(name, time)
        else:
            estimator.add_angle(name, time, value)


def truth_at(recording: Recording, time: np.ndarray) -> np.ndarray:
    """True wind at instants [ns], shape (n, 3)."""
    truth = recording.truth
    assert truth is not None
    seconds = (truth.time - truth.time[0]) * 1e-9
    at = (time - truth.time[0]) * 1e-9
    return np.stack([np.interp(at, seconds, truth.velocity[:, i]) for i in range(3)], axis=1)
