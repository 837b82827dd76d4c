"""Small recordings to be written and read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wind_sensors.recordings import read_recording
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.recordings.writing import write_topics
from wind_sensors.station.model import (
    Air,
    Bivane,
    Cup,
    Input,
    Platform,
    Reference,
    Station,
    Vane,
)
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    Winds,
)
from wind_sensors.station.writing import station_to_yaml

START = 1_767_225_600_000_000_000
EDGES = START + np.cumsum(np.full(40, 37_000_000, dtype=np.int64))
TYPES = typestore()


def cup(pulses: Input, **constants: float) -> Cup:
    return Cup(
        name="cup",
        pulses=pulses,
        pulses_per_revolution=4,
        calibration_distance=0.2,
        distance_constant=1.7,
        starting_speed=constants.get("starting_speed", 0.0),
    )


def vane(joint_states: Input) -> Vane:
    return Vane(name="vane", joint_states=joint_states, distance_constant=0.5, damping_ratio=0.4)


def recorded(station: Station, **signals: Any) -> Recording:
    return Recording("test", station, START, START + 10_000_000_000, **signals)


def full_recording(rng: np.random.Generator) -> Recording:
    station = Station(
        instruments=(
            cup(Input(topic="/cup/pulses")),
            vane(Input(topic="/vane")),
            Bivane(
                name="bivane",
                azimuth=Input(topic="/bivane"),
                elevation=Input(topic="/bivane"),
                distance_constant=2.4,
                damping_ratio=0.15,
            ),
        ),
        reference=Reference(topic=Input(topic="/reference/wind")),
        air=Air(temperature=Input(topic="/t"), pressure=Input(topic="/p")),
        platform=Platform(odometry=Input(topic="/odom")),
    )
    time = START + np.sort(rng.integers(0, 10_000_000_000, 50))
    attitude = rng.normal(size=(50, 4))
    attitude /= np.linalg.norm(attitude, axis=1, keepdims=True)
    return recorded(
        station,
        pulses={"cup": Pulses(time)},
        angles={
            "vane": Angles(time, rng.uniform(-np.pi, np.pi, 50)),
            "bivane": Angles(time, rng.uniform(-np.pi, np.pi, 50)),
            "bivane/elevation": Angles(time, rng.uniform(-0.5, 0.5, 50)),
        },
        reference=Winds(time, rng.normal(size=(50, 3))),
        truth=Winds(time, rng.normal(size=(50, 3))),
        platform=PlatformStates(time, attitude, *(rng.normal(size=(50, 3)) for _ in range(3))),
        temperature=Series(time, rng.normal(15.0, 3.0, 50)),
        pressure=Series(time, rng.normal(101_300.0, 300.0, 50)),
    )


def counter(tmp_path: Path, values: list[float], source: Input) -> Recording:
    time = START + np.arange(len(values), dtype=np.int64) * 1_000_000_000
    raw = serialised(TYPES, template(TYPES, source.type), {("data",): np.asarray(values)})
    text = station_to_yaml(Station(instruments=(cup(source),)))
    topics = [TopicMessages("/c", source.type, time, raw)]
    return read_recording(write_topics(tmp_path / "r", text, topics))
