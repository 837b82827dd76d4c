"""What the monitor's sums tell without a baseline: own simulation of a cup and a vane.

Healthy hours show how often chance passes for a mismatch; an effect that begins in minute eight
shows what is found, after how long, and under which names. In the second half the same instruments
are driven by another cup and vane half a metre away instead of a reference.

Run: python benchmarks/monitor_sums.py [--speed 8 --seed 4]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.watch import Watch, WatchSettings
from wind_sensors.diagnosis.watch.finding import Finding
from wind_sensors.diagnosis.watch.replaying import replay
from wind_sensors.recordings import load_station
from wind_sensors.simulation.drive import drive_from_recording
from wind_sensors.simulation.encoder import angle_readings
from wind_sensors.simulation.pulses import rotor_signals
from wind_sensors.simulation.response import respond
from wind_sensors.simulation.run import simulate
from wind_sensors.simulation.scenario import Scenario
from wind_sensors.station.model import Input, Reference, Station
from wind_sensors.station.signals import Angles, Recording
from wind_sensors.turbulence.synthesis import TurbulenceSpec

BEGINNING = 480.0
"""When an effect begins [s]."""

SECONDS = 1380.0
"""Fifteen minutes more."""

LEARNING = 6
"""Blocks from which normal is learnt."""

BY_REFERENCE = {
    "vane_offset": ("vane", {"offset": 3.0}),
    "vane_friction": ("vane", {"friction_speed": 1.5}),
    "timestamp_latency": ("vane", {"latency": 0.45}),
    "low_pass_filter": ("vane", {"time_constant": 0.3}),
    "missed_pulses": ("cup", {"dead_time": 0.0, "loss_probability": 0.03}),
    "extra_pulses": ("cup", {"bounce_probability": 0.03, "bounce_delay": 0.003}),
    "bearing_friction": ("cup", {"friction_speed": 1.5}),
    "calibration_drift": ("cup", {"gain": 0.97}),
    "rotor_inertia": ("cup", {"inertia_factor": 1.9}),
}
BY_INSTRUMENTS = {
    name: BY_REFERENCE[name]
    for name in ("missed_pulses", "vane_offset", "vane_friction", "bearing_friction")
} | {
    "calibration_drift": ("cup", {"gain": 0.95}),
    "rotor_inertia": ("cup", {"inertia_factor": 2.0}),
}


def healthy_station() -> Station:
    """A mast with a cup, a vane and a reference half a metre away."""
    reference = Reference(topic=Input(topic="/reference/wind"), separation=0.5, path_length=0.15)
    return load_station("mast_cup_vane").model_copy(update={"reference": reference})


def recorded(station: Station, seconds: float, seed: int, speed: float) -> Recording:
    """Signals of a station in turbulence of 1.1 m/s along the mean wind."""
    wind = TurbulenceSpec(
        mean_speed=speed, direction=0.5, standard_deviations=(1.1, 0.9, 0.6),
        integral_lengths=(60.0, 40.0, 20.0), seed=seed,
    )
    return simulate(station, Scenario(wind=wind, duration=seconds, seed=seed))


def with_second_pair(recording: Recording) -> Recording:
    """The recording with a healthy cup and vane where its reference stood, and without it."""
    station = healthy_station()
    second = [
        station.instrument(name).model_copy(update={"name": f"{name}2"})
        for name in ("cup", "vane")
    ]
    response = respond(station, drive_from_recording(recording))
    time_ns = recording.angles["vane"].time
    readings = Angles(time_ns, angle_readings(response, "vane", time_ns))
    return replace(
        recording,
        station=station.model_copy(update={"instruments": (*station.instruments, *second)}),
        pulses={**recording.pulses, "cup2": rotor_signals(response, "cup")},
        angles={**recording.angles, "vane2": readings},
        reference=None,
    )


def planted(name: str, instrument: str, values: dict[str, float]) -> Station:
    """The station with an effect from its beginning on."""
    effect = catalogue()[name]
    complete = {p.name: p.healthy or 0.0 for p in effect.parameters} | values
    return with_effect(healthy_station(), effect, instrument, complete, (BEGINNING, None))


def said(finding: Finding, start: int) -> str:
    """A finding: when it was told, where, and the candidates of the end."""
    after = (finding.detected - start) * 1e-9 - BEGINNING
    names = ", ".join(f"{c.effect} {100 * c.weight:.0f} %" for c in finding.candidates)
    return f"{after / 60.0:.1f} min, {finding.channel}: {names or 'no name'}"


def watched(what: str, recording: Recording, settings: WatchSettings) -> None:
    """Print what is told of a recording."""
    station = recording.station if settings.driving else healthy_station()
    watch = Watch(station, settings)
    begin = time.process_time()
    replay(recording, watch)
    took = time.process_time() - begin
    told = [*watch.past, *([] if watch.finding is None else [watch.finding])]
    text = "; ".join(said(f, recording.start) for f in told) or "nothing"
    print(
        f"| {what} | {text} | {watch.blocks} blocks | {took / max(watch.blocks, 1):.2f} s each |",
        flush=True,
    )


def main() -> None:
    """Print one row per run; times count from the beginning of the effect."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--speed", type=float, default=7.0, help="mean wind speed [m/s]")
    parser.add_argument("--seed", type=int, default=3, help="of the runs with an effect")
    options = parser.parse_args()
    speed, seed = options.speed, options.seed
    np.seterr(all="ignore")
    by_reference = WatchSettings(learning=LEARNING)
    by_pair = WatchSettings(drive="instruments", driving=("cup2", "vane2"), learning=LEARNING)
    for each in (3, 4, 5):
        hours = recorded(healthy_station(), 7200.0, each, speed)
        watched(f"healthy, seed {each}", hours, by_reference)
    for name, (instrument, values) in BY_REFERENCE.items():
        watched(name, recorded(planted(name, instrument, values), SECONDS, seed, speed),
                by_reference)
    for each in (3, 4):
        pair = with_second_pair(recorded(healthy_station(), 3600.0, each, speed))
        watched(f"second pair, healthy, seed {each}", pair, by_pair)
    for name, (instrument, values) in BY_INSTRUMENTS.items():
        signals = recorded(planted(name, instrument, values), SECONDS, seed, speed)
        watched(f"second pair, {name}", with_second_pair(signals), by_pair)


if __name__ == "__main__":
    main()
