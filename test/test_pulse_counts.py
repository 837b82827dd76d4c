"""What the counts of a logger show, by rotors that turn as one likes."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from wind_sensors.station.model import Station
from wind_sensors.station.signals import Pulses, Recording

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

from pulse_counts import compare_pair, count_statistics

FloatArray = npt.NDArray[np.float64]


def counted(rates: FloatArray, keep: int = 1) -> Recording:
    """Counts of a rotor read every second; with `keep` 2 the counter sees only pairs of pulses."""
    station = Station.model_validate(
        {
            "instruments": [
                {
                    "name": name, "kind": "cup", "pulses_per_revolution": 4,
                    "pulses": {"topic": f"/{name}", "type": "std_msgs/msg/Int64"},
                    "calibration_distance": 0.2, "starting_speed": 0.2, "distance_constant": 2.0,
                }
                for name in ("a", "b")
            ]
        }
    )
    time = np.arange(rates.size + 1, dtype=np.int64) * 1_000_000_000
    total = np.floor(np.concatenate([[0.0], np.cumsum(rates)]) / keep) * keep
    pulses = Pulses(time, total / 4.0)
    return Recording("roof", station, 0, int(time[-1]), {"a": pulses, "b": pulses})


def test_what_counting_adds_to_the_scatter_is_told_from_the_wind() -> None:
    rng = np.random.default_rng(2)
    found = count_statistics(counted(11.4 + 0.6 * rng.standard_normal(20_000)), "a")
    assert found.quantisation == pytest.approx(found.pulse_speed / np.sqrt(6.0))
    assert found.deviation**2 == pytest.approx(0.6**2 + 1.0 / 6.0, rel=0.03)
    assert found.rapid == pytest.approx(0.6 * found.pulse_speed, rel=0.05)
    assert not found.missing


def test_a_counter_that_sees_every_second_pulse_shows_even_numbers_only() -> None:
    rng = np.random.default_rng(3)
    rates = np.clip(12.0 + 4.0 * rng.standard_normal(3000), 2.0, None)
    assert count_statistics(counted(rates), "a").even_p > 1e-3
    halved = count_statistics(counted(rates, keep=2), "a")
    assert halved.even == 1.0
    assert halved.even_p < 1e-12
    assert halved.missing


def test_two_equal_counters_do_not_differ() -> None:
    rng = np.random.default_rng(4)
    found = compare_pair(counted(np.clip(9.0 + 3.0 * rng.standard_normal(2400), 0, None)), "a", "b")
    assert found.difference == 0.0
