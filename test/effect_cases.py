"""What a station file can say to be wrong: a station with it, one without, a wind over both."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from estimation_cases import mast, truth_at

from wind_sensors.estimation import EstimatorSettings, Method, ProcessedRecording, process
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording
from wind_sensors.turbulence.synthesis import surface_layer_spec

SETTLED = 15_000_000_000
DURATION = 60.0
SPEED_LIMIT = 0.006
TURN_LIMIT = np.radians(0.6)
WINDOW_FACTOR = 1.5
"""A window also holds the first seconds, in which the turbulence is being learnt."""
Keys = dict[str, Any]


@dataclass(frozen=True)
class Case:
    """What is wrong with a mast or boat, and by how much the plain station would err.

    Attributes:
        cup, vane, both, platform, changes: Keys of the station file.
        rotor: Keys of the cup of either station.
        scenario: Of the simulation.
        speed, turn: Error of mean speed or direction [deg] that the plain station at least makes.
        rms: Rms error of the plain station over that of the true one, at least; with the method.
        found_out: The Kalman filter finds it out from the signals, so that there the plain station
            errs no more than the true one; `speed`, `turn` and `rms` are those of the inverse
            method.
        limits: Other limits of mean speed [1] and direction [deg].
    """

    cup: Keys = field(default_factory=dict)
    vane: Keys = field(default_factory=dict)
    both: Keys = field(default_factory=dict)
    platform: Keys | None = None
    changes: tuple[Keys, ...] = ()
    rotor: Keys = field(default_factory=dict)
    scenario: Keys = field(default_factory=dict)
    speed: float = 0.0
    turn: float = 0.0
    rms: float = 0.0
    found_out: bool = False
    limits: tuple[float, float] = (SPEED_LIMIT, float(np.degrees(TURN_LIMIT)))

    def station(self, wrong: bool) -> Station:
        """The station with what is wrong with it, or without."""
        cup, vane, both = (self.cup, self.vane, self.both) if wrong else ({}, {}, {})
        content = mast({**self.rotor, **both, **cup}, {**both, **vane}).model_dump()
        content["air"] = {"temperature": {"topic": "t"}, "pressure": {"topic": "p"}}
        if self.platform is not None:
            keys = self.platform if wrong else {}
            content["platform"] = {
                "odometry": {"topic": "o"}, "sensor_position": (0.3, 0.0, 1.5), **keys
            }
        if wrong:
            content["changes"] = self.changes
        return Station.model_validate(content)


def change(instrument: str, start: float = 20.0, stop: float | None = 45.0, **keys: Any) -> Keys:
    """Keys of an entry from one moment to another [s]."""
    return {"instrument": instrument, "start": start, "stop": stop, "set": keys}


def wake(bearing: float, depth: float, width: float) -> Keys:
    """A wake [deg, 1, deg]."""
    shadow = {"bearing_from_deg": bearing, "depth": depth, "width_deg": width}
    return {"wake_shadows": [shadow]}


DISTORTION = {"cosine_1": 0.06, "sine_1": 0.08, "sine_2": 0.05, "deflection": 1.0}


def blown(case: Case, seed: int = 21) -> Recording:
    """The case simulated in a surface-layer wind that blows over it from 203 degrees."""
    wind = surface_layer_spec(8.0, 10.0, 0.01, direction=0.4, seed=seed)
    return simulate(
        case.station(wrong=True), Scenario(wind, duration=DURATION, seed=seed, **case.scenario)
    )


def errors(found: ProcessedRecording, recording: Recording) -> tuple[float, float, float]:
    """Of the mean vector's speed, relative, and direction [rad]; rms error [m/s]."""
    late = found.time > recording.start + SETTLED
    truth = truth_at(recording, found.time)[late, :2]
    velocity = found.velocity[late, :2]
    a, b = velocity.mean(axis=0), truth.mean(axis=0)
    turn = float(np.angle((a[0] + 1j * a[1]) / (b[0] + 1j * b[1])))
    rms = float(np.sqrt(np.mean((velocity - truth) ** 2)))
    return float(np.hypot(*a) / np.hypot(*b)) - 1.0, turn, rms


def settings(method: Method) -> EstimatorSettings:
    """One window, a wide band."""
    return EstimatorSettings(method=method, bandwidth=2.0, window=100.0)


def check(case: Case, method: Method) -> None:
    """The mean wind comes back with the true station, and would not with the plain one."""
    assert case.speed or case.turn or case.rms, "say by how much the plain station errs"
    recording = blown(case)
    found = process(recording, settings(method))
    speed, turn, rms = errors(found, recording)
    assert abs(speed) < case.limits[0]
    assert abs(np.degrees(turn)) < case.limits[1]
    window, true = found.windows[0].vector_mean, truth_at(recording, found.time).mean(axis=0)
    off = complex(window[0], window[1]) / complex(true[0], true[1])
    assert abs(abs(off) - 1.0) < WINDOW_FACTOR * case.limits[0]
    assert abs(np.degrees(np.angle(off))) < WINDOW_FACTOR * case.limits[1]
    unaware = replace(recording, station=case.station(wrong=False))
    plain = errors(process(unaware, settings(method)), recording)
    if case.found_out and method == "kalman":
        assert abs(plain[0]) < case.limits[0]
        assert abs(np.degrees(plain[1])) < case.limits[1]
        assert plain[2] == pytest.approx(rms, rel=0.02)
        return
    assert abs(plain[0]) >= case.speed
    assert abs(np.degrees(plain[1])) >= case.turn
    assert plain[2] >= case.rms * rms


METHODS: tuple[Method, ...] = ("kalman", "inverse")
