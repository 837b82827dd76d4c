"""What a station file states is undone: the estimator knows the same physics as the simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from estimation_cases import blown, feed, mast, messages, truth_at

from wind_sensors.estimation import (
    EstimatorSettings,
    ProcessedRecording,
    make_estimator,
    process,
)
from wind_sensors.estimation.kalman import KalmanCore
from wind_sensors.station.signals import Recording

WINDOW = EstimatorSettings(window=100.0)


def errors(processed: ProcessedRecording, recording: Recording) -> tuple[float, float, float]:
    """Relative error of the mean speed, of the direction [rad], rms error [m/s], after 15 s."""
    late = processed.time > recording.start + 15_000_000_000
    truth = truth_at(recording, processed.time)[late]
    found = processed.velocity[late]
    a, b = found.mean(axis=0), truth.mean(axis=0)
    turn = np.angle((a[0] + 1j * a[1]) / (b[0] + 1j * b[1]))
    rms = np.sqrt(np.mean((found - truth)[:, :2] ** 2))
    return float(np.hypot(*a[:2]) / np.hypot(*b[:2]) - 1.0), float(turn), float(rms)


CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "friction": ({"friction_speed": 1.5}, {}),
    "gain": ({"calibration_gain": 0.93}, {}),
    "offset": ({"calibration_offset": -0.4}, {}),
    "inertia": ({"inertia_factor": 3.0}, {}),
    "wake shadow": (
        {"wake_shadows": [{"bearing_from_deg": 203.0, "depth": 0.25, "width_deg": 20.0}]},
        {},
    ),
    "flow distortion": ({"flow_distortion": {"cosine_1": 0.08, "sine_2": 0.05}}, {}),
    "slots": ({"electronics": {"slot_errors": [0.1, -0.1, 0.05, -0.05]}}, {}),
    "dead time": ({"electronics": {"dead_time": 0.026}}, {}),
    "late pulses": ({"clock": {"latency": 0.4}}, {}),
    "vane offset": ({}, {"offset_deg": 8.0}),
    "reversed vane": ({}, {"reversed": True, "offset_deg": -20.0}),
    "eccentricity": ({}, {"eccentricity_deg": 6.0, "eccentricity_phase_deg": 60.0}),
    "heavy vane": ({}, {"inertia_factor": 3.0}),
    "sticky vane": ({}, {"friction_speed": 1.2}),
    "late readings": ({}, {"clock": {"latency": 0.5}}),
    "filtered readings": ({}, {"filter_time_constant": 0.4}),
    "gap": ({}, {"gap_centre_deg": 222.0, "gap_width_deg": 25.0}),
}


@pytest.mark.parametrize("name", sorted(CASES))
def test_a_stated_effect_is_undone(name: str) -> None:
    cup, vane = CASES[name]
    station = mast(cup, vane)
    recording = blown(station, duration=60.0, seed=21)
    speed, turn, rms = errors(process(recording, WINDOW), recording)
    assert abs(speed) < 0.006
    assert abs(turn) < np.radians(1.5 if name == "gap" else 0.6)
    unaware = Recording(**{**vars(recording), "station": mast()})
    blind = errors(process(unaware, WINDOW), recording)
    assert rms < 0.4
    learnt = {"slots", "dead time", "gap", "heavy vane", "sticky vane"}
    if name not in learnt:
        assert blind[2] > 1.15 * rms
    else:
        assert rms < 1.15 * blind[2]


def test_slot_errors_are_learnt_without_being_told() -> None:
    planted = np.array([0.12, -0.08, 0.05, -0.09])
    recording = blown(mast({"electronics": {"slot_errors": list(planted)}}), duration=120.0)
    estimator = make_estimator(mast(), WINDOW)
    feed(estimator, messages(recording))
    core = estimator._core
    assert isinstance(core, KalmanCore)
    learnt = core.filter.slot_error[0, :4]
    # The filter does not know which slot came first.
    turned = [np.roll(planted - planted.mean(), k) for k in range(4)]
    assert min(np.abs(learnt - t).max() for t in turned) < 0.02
