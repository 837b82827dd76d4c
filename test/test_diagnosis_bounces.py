"""Contacts that bounce, and silences of a counter: what is seen pulse by pulse is no riddle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.observation import rate_series
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import without_bounces
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Pulses, Recording

CHANNEL = "cup/rotor_rate"
OF_A_CUP = (
    "calibration_drift", "calibration_offset", "bearing_friction", "rotor_inertia",
    "angular_response", "missed_pulses", "extra_pulses", "stuck_sensor", "timestamp_latency",
)


def _bouncing(recording: Recording, share: float, seed: int) -> Recording:
    """The recording with a second edge 1 to 3 ms after so many of the cup's."""
    rng = np.random.default_rng(seed)
    time = recording.pulses["cup"].time
    hit = time[rng.random(time.size) < share]
    second = hit + rng.integers(1_000_000, 3_000_000, hit.size)
    return replace(recording, pulses={"cup": Pulses(np.sort(np.concatenate((time, second))))})


@pytest.mark.parametrize("share", [0.01, 0.05, 0.15])
def test_bounces_are_taken_out_of_the_series_that_is_compared(share: float) -> None:
    clean = recorded(STATION, 50)
    seen, healthy = prepare(_bouncing(clean, share, 1)), prepare(clean)
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    counted = rate_series(seen.recording.pulses["cup"], cup, seen.grid)
    true = healthy.measured.series[CHANNEL]
    assert np.std(seen.measured.series[CHANNEL] - true) < 0.3 * np.std(counted - true)
    shown = seen.measured.statistics[CHANNEL] - healthy.measured.statistics[CHANNEL]
    assert np.nanmax(np.abs(shown)) > 0.005, "they stay in the statistics"


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_edge_is_taken_from_a_contact_that_does_not_bounce(seed: int) -> None:
    assert without_bounces(recorded(STATION, seed).pulses["cup"], 12) is None


@pytest.mark.parametrize("pause", [0.3, 0.8])
def test_edges_that_a_logger_stamps_late_in_lots_are_no_bounces(pause: float) -> None:
    time = recorded(STATION, 0).pulses["cup"].time
    since = 1e-9 * time
    begun = 10.0 * np.floor(since / 10.0)
    late = since - begun < pause
    stamped = np.where(late, 1e9 * (begun + pause) + 2000.0 * (np.arange(time.size) % 50), time)
    assert without_bounces(Pulses(np.sort(stamped.astype(np.int64))), 12) is None


def _said(recording: Recording, known: Baseline) -> set[str]:
    """Names that are given, of what can happen to a cup."""
    effects = {name: catalogue()[name] for name in OF_A_CUP}
    found = diagnose(recording, known, effects, with_proof=False)
    return {finding.term.effect.name for finding in found.findings}


def test_a_drift_shows_beside_bounces_of_the_same_cup() -> None:
    station = with_effect(STATION, catalogue()["calibration_drift"], "cup", {"gain": 1.06})
    seen = _bouncing(recorded(station, 50, swing=0.8), 0.03, 2)
    assert {"extra_pulses", "calibration_drift"} <= _said(seen, baseline())


def _twice_a_turn(recording: Recording) -> Recording:
    """The recording of a cup that closes its contact twice a turn."""
    slow = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": 2})
    station = STATION.model_copy(update={"instruments": (slow, STATION.instrument("vane"))})
    edges = recording.pulses["cup"].time[::6]
    return replace(recording, station=station, pulses={"cup": Pulses(edges)})


@pytest.mark.parametrize("begin", [100.13, 210.4])
def test_the_edges_of_a_silence_call_for_no_second_effect(begin: float) -> None:
    healthy = learn([_twice_a_turn(recorded(STATION, seed, mean=4.0)) for seed in range(4)])
    whole = _twice_a_turn(recorded(STATION, 50, mean=4.0))
    since = 1e-9 * whole.pulses["cup"].time
    heard = (since < begin) | (since > begin + 60.0)
    silent = replace(whole, pulses={"cup": Pulses(whole.pulses["cup"].time[heard])})
    assert _said(silent, healthy) == {"stuck_sensor"}
