"""Speed of the estimators: processor time per minute of recording, and against real time."""

from __future__ import annotations

import time

from wind_sensors.estimation import METHODS, EstimatorSettings, process
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Station
from wind_sensors.turbulence.synthesis import isotropic_spec

DURATION = 300.0
STATION = Station.model_validate(
    {
        "instruments": [
            {
                "kind": "cup", "name": "cup", "pulses": {"topic": "cup/pulses"},
                "pulses_per_revolution": 4, "calibration_distance": 0.14,
                "starting_speed": 0.1, "distance_constant": 1.7,
            },
            {
                "kind": "vane", "name": "vane", "joint_states": {"topic": "vane/joint_states"},
                "distance_constant": 0.5, "damping_ratio": 0.3,
            },
        ]
    }
)


def main() -> None:
    """Print processor times after compilation."""
    scenario = Scenario(wind=isotropic_spec(8.0, 0.12, 60.0, 0.4, 1), duration=DURATION, seed=1)
    recording = simulate(STATION, scenario)
    messages = len(recording.pulses["cup"].time) + len(recording.angles["vane"].time)
    for method in METHODS:
        settings = EstimatorSettings(method=method)
        process(recording, settings)
        begin = time.process_time()
        process(recording, settings)
        spent = time.process_time() - begin
        print(
            f"{method:8s} {spent / DURATION * 60.0:.3f} s per minute, "
            f"{DURATION / spent:.0f} times real time, {1e6 * spent / messages:.1f} us per message"
        )


if __name__ == "__main__":
    main()
