"""A mast of the package's own simulator whose reference errs, healthy days of it, and terms."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.explanation import Alternative, Naming, empty_fit
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.encoder import angle_readings
from wind_sensors.simulation.pulses import edge_times
from wind_sensors.simulation.response import respond
from wind_sensors.station.model import Rotor, Station
from wind_sensors.station.signals import Angles, FloatArray, Pulses, Recording, Winds

DT = 0.05
SECONDS = 400.0

STATION = Station.model_validate(
    {
        "instruments": [
            {
                "name": "cup", "kind": "cup", "pulses": {"topic": "/cup/pulses"},
                "pulses_per_revolution": 12, "calibration_distance": 0.14,
                "starting_speed": 0.1, "distance_constant": 1.8,
            },
            {
                "name": "vane", "kind": "vane", "joint_states": {"topic": "/vane/joint_states"},
                "distance_constant": 0.5, "damping_ratio": 0.25,
            },
        ],
        "reference": {"topic": {"topic": "/reference/wind"}, "separation": 0.5},
    }
)

AEROVANE = Station.model_validate(
    {
        "instruments": [
            {
                "name": "vane", "kind": "vane", "joint_states": {"topic": "/vane/joint_states"},
                "distance_constant": 0.6, "damping_ratio": 0.3,
            },
            {
                "name": "propeller", "kind": "propeller",
                "pulses": {"topic": "/propeller/pulses"}, "pulses_per_revolution": 6,
                "mounted_on": "vane", "calibration_distance": 0.05, "distance_constant": 2.4,
            },
        ],
        "reference": {"topic": {"topic": "/reference/wind"}, "separation": 0.5},
    }
)


def _noise(rng: np.random.Generator, n: int, seconds: float, size: float) -> FloatArray:
    """Gaussian noise with a correlation time [s] and a standard deviation."""
    decay = np.exp(-DT / seconds)
    drawn = rng.standard_normal(n + 4000)
    noise: FloatArray = size * np.sqrt(1.0 - decay**2) * lfilter([1.0], [1.0, -decay], drawn)[4000:]
    return noise


def recorded(
    station: Station,
    seed: int,
    mean: float = 7.0,
    swing: float = 0.0,
    described: Station = STATION,
    seconds: float = SECONDS,
) -> Recording:
    """A recording of a station in a wind that its reference sees with errors.

    Args:
        station: Made the signals.
        seed: Of the wind.
        mean: Speed [m/s].
        swing: Amplitude of a turning to and fro every 45 s [rad].
        described: What the recording's station file says.
        seconds: Length.
    """
    rng = np.random.default_rng(seed)
    n = int(seconds / DT)
    speed = mean + _noise(rng, n, 60.0, 1.3) + _noise(rng, n, 3.0, 0.8)
    speed = np.maximum(speed, 0.5)
    turn = np.radians(20.0 * rng.standard_normal()) + _noise(rng, n, 80.0, 0.5)
    turn = turn + _noise(rng, n, 2.0, 0.1)
    turn = turn + swing * np.sin(2.0 * np.pi * DT * np.arange(n) / 45.0)
    wind = np.stack((speed * np.cos(turn), speed * np.sin(turn), _noise(rng, n, 1.0, 0.35)), axis=1)
    seen = wind + np.stack([_noise(rng, n, 1.5, 0.25) for _ in range(3)], axis=1)
    drive = Drive(start_ns=0, dt=DT, wind=wind)
    response = respond(station, drive)
    times = drive.times_ns
    (rotor,) = (entry.name for entry in described.instruments if isinstance(entry, Rotor))
    return Recording(
        name=f"seed-{seed}",
        station=described,
        start=0,
        stop=int(times[-1]),
        pulses={rotor: Pulses(edge_times(response, rotor))},
        angles={"vane": Angles(times, angle_readings(response, "vane", times))},
        reference=Winds(times, seen),
    )


@lru_cache(maxsize=1)
def baseline() -> Baseline:
    return learn([recorded(STATION, seed) for seed in range(4)])


@lru_cache(maxsize=4)
def diagnosed(effect: str, instrument: str, **values: float) -> Diagnosis:
    """What is found with one effect in a wind that turns far enough to tell where it acts."""
    station = with_effect(STATION, catalogue()[effect], instrument, values)
    return diagnose(recorded(station, 50, swing=0.8), baseline())


def drift(interval: Interval = ALWAYS) -> Term:
    return Term(catalogue()["calibration_drift"], "cup", {"gain": 1.03}, interval)


def named(searcher: Searcher, term: Term, alternatives: tuple[Alternative, ...] = ()) -> Naming:
    null = searcher.whitener(searcher.bank.without)
    nothing = empty_fit(null, searcher)
    one = fit(null, STATION, [term], None, iterations=0)
    return Naming(one, null, null, nothing.vector, 1000.0, alternatives)
