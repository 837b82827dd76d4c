"""What a moving platform costs: error of the mean earth wind, source by source.

A boat that circles and a multirotor that flies legs, both at 5 m/s with 5 degrees rms of sway, in
turbulent wind. Each row is simulated with one thing that the estimator does not know about, once in
the size that care leaves and once in the size that happens, and processed with the healthy station.
The error is that of the mean wind vector over the run, relative to the mean apparent wind.

Run: python benchmarks/platform_errors.py
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from wind_sensors.estimation import EstimatorSettings, process
from wind_sensors.simulation import Scenario, Trajectory, simulate
from wind_sensors.simulation.trajectories import boat, multirotor
from wind_sensors.station.model import (
    Clock,
    Cup,
    Downwash,
    HeadingDeviation,
    Input,
    Platform,
    Station,
    Vane,
)
from wind_sensors.turbulence.synthesis import isotropic_spec

FloatArray = npt.NDArray[np.float64]

PLATFORM = Platform(odometry=Input(topic="/odometry"), sensor_position=(0.2, 0.0, 1.5))
NOISE = "noise"
"""Key of a source for the wandering errors that the station states as its noise."""

Source = dict[str, object]

CAREFUL: dict[str, Source] = {
    "attitude 0.5 deg, velocity 0.05 m/s, wandering": {NOISE: True},
    "compass deviation 1 deg sin(heading)": {"heading_deviation": HeadingDeviation(sine_deg=1.0)},
    "compass offset 0.5 deg": {"heading_deviation": HeadingDeviation(constant_deg=0.5)},
    "sensor mounted 0.5 deg askew": {"sensor_rotation_deg": (0.0, 0.0, 0.5)},
    "sensor leans 1 deg in roll and pitch": {"sensor_rotation_deg": (1.0, 1.0, 0.0)},
    "velocity reads 1 % high": {"velocity_scale": 1.01},
    "sensor 0.1 m from where stated": {"sensor_position": (0.3, 0.0, 1.6)},
    "odometry 0.05 s late": {"clock": Clock(latency=0.05)},
    "rotor inflow 0.3 m/s (multirotor)": {"downwash": Downwash(induced_velocity=0.3)},
}
CARELESS: dict[str, Source] = {
    "attitude 2 deg, velocity 0.2 m/s, wandering": {
        NOISE: True, "attitude_noise_deg": 2.0, "velocity_noise": 0.2,
    },
    "compass deviation 3 deg sin(heading)": {"heading_deviation": HeadingDeviation(sine_deg=3.0)},
    "compass offset 2 deg": {"heading_deviation": HeadingDeviation(constant_deg=2.0)},
    "sensor mounted 2 deg askew": {"sensor_rotation_deg": (0.0, 0.0, 2.0)},
    "sensor leans 3 deg in roll and pitch": {"sensor_rotation_deg": (3.0, 3.0, 0.0)},
    "velocity reads 3 % high": {"velocity_scale": 1.03},
    "sensor 0.5 m from where stated": {"sensor_position": (0.7, 0.0, 2.0)},
    "odometry 0.2 s late": {"clock": Clock(latency=0.2)},
    "rotor inflow 1 m/s (multirotor)": {"downwash": Downwash(induced_velocity=1.0)},
}


def together(sources: dict[str, Source]) -> Source:
    """All of the sources at once; what two of them change adds up."""
    everything: Source = {}
    for source in sources.values():
        everything |= source
    # Both of these change the same key as another source.
    deviations = [s["heading_deviation"] for s in sources.values() if "heading_deviation" in s]
    everything["heading_deviation"] = HeadingDeviation(
        constant_deg=sum(d.constant_deg for d in deviations if isinstance(d, HeadingDeviation)),
        sine_deg=sum(d.sine_deg for d in deviations if isinstance(d, HeadingDeviation)),
    )
    turns = [s["sensor_rotation_deg"] for s in sources.values() if "sensor_rotation_deg" in s]
    everything["sensor_rotation_deg"] = tuple(np.sum(np.array(turns, dtype=float), axis=0))
    return everything


def station(platform: Platform) -> Station:
    """Cup and vane on a platform."""
    return Station(
        instruments=(
            Vane(
                name="vane", joint_states=Input(topic="/vane"), distance_constant=0.5,
                damping_ratio=0.3, noise_deg=0.3,
            ),
            Cup(
                name="cup", pulses=Input(topic="/cup"), pulses_per_revolution=8,
                calibration_distance=0.2, distance_constant=1.7, mu2=0.8,
            ),
        ),
        platform=platform,
    )


def mean_error(trajectory: Trajectory, source: Source, minutes: float) -> FloatArray:
    """Error of the mean wind relative to the apparent wind: size, and how much is direction.

    Returns:
        Error of the mean vector and of the mean speed over the mean apparent wind, error of the
        mean direction [deg]; shape (3,).
    """
    noise = bool(source.get(NOISE, False))
    changed = PLATFORM.model_copy(update={k: v for k, v in source.items() if k != NOISE})
    scenario = Scenario(
        isotropic_spec(7.0, 0.12, 60.0, direction=0.6, seed=11),
        duration=60.0 * minutes,
        trajectory=trajectory,
        platform_noise=noise,
        seed=3,
    )
    recording = simulate(station(changed), scenario)
    believed = replace(recording, station=station(PLATFORM))
    found = process(believed, EstimatorSettings(window=60.0 * minutes))
    assert recording.truth is not None
    inside = slice(400, -100)
    seconds = (recording.truth.time - recording.start) * 1e-9
    at = (found.time - recording.start) * 1e-9
    truth = np.stack(
        [np.interp(at, seconds, recording.truth.velocity[:, k]) for k in range(2)], axis=1
    )[inside]
    wind = found.velocity[inside, :2]
    felt = np.hypot(found.apparent[inside, 0], found.apparent[inside, 1]).mean()
    off = wind.mean(axis=0) - truth.mean(axis=0)
    speed = np.hypot(*wind.mean(axis=0)) - np.hypot(*truth.mean(axis=0))
    turn = np.arctan2(*wind.mean(axis=0)[::-1]) - np.arctan2(*truth.mean(axis=0)[::-1])
    return np.array([np.hypot(*off) / felt, speed / felt, np.degrees(turn)])


def main() -> None:
    """Simulate, process and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--minutes", type=float, default=12.0, help="length of each run")
    minutes = parser.parse_args().minutes
    sway = np.radians(5.0)
    carriers = {
        "boat": replace(boat(speed=5.0), roll=sway, pitch=0.5 * sway),
        "multirotor": replace(multirotor(speed=5.0), roll=sway, pitch=sway),
    }
    groups = {"carefully set up": CAREFUL, "carelessly set up": CARELESS}
    rows: list[tuple[str, str, Source]] = [("exact platform", "nothing", {})]
    for group, sources in groups.items():
        rows += [(group, name, source) for name, source in sources.items()]
        rows.append((group, "all of these", together(sources)))
    table = Table(
        "", "not known to the estimator",
        *(f"{n}: vector | speed | direction" for n in carriers),
        title="error of the mean wind, % of the apparent wind (5 m/s, sway 5 deg)",
    )
    with Progress(transient=True) as progress:
        task = progress.add_task("simulating", total=len(rows) * len(carriers))
        for group, name, source in rows:
            cells = []
            for carrier, trajectory in carriers.items():
                known = {k: v for k, v in source.items() if k != "downwash" or carrier != "boat"}
                total, speed, turn = mean_error(trajectory, known, minutes)
                cells.append(f"{100 * total:.2f} | {100 * speed:+.2f} | {turn:+.2f} deg")
                progress.advance(task)
            table.add_row(group, name, *cells)
    Console(width=150).print(table)


if __name__ == "__main__":
    main()
