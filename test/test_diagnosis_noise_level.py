"""What a residual may be: the level of the noise on healthy days."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.healthy.baseline import WAVENUMBERS, Baseline
from wind_sensors.diagnosis.healthy.learning import default_baseline, learn
from wind_sensors.diagnosis.healthy.noise_level import (
    EXPECTED_SCATTER,
    excess_of,
    learnt_levels,
    levels,
)
from wind_sensors.diagnosis.proving.remainder import NOISY
from wind_sensors.recordings import load_station
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Input, Reference, Station
from wind_sensors.station.signals import Angles, Recording
from wind_sensors.turbulence.synthesis import TurbulenceSpec


def station() -> Station:
    reference = Reference(topic=Input(topic="/reference/wind"), separation=2.0, noise=0.05)
    return load_station("mast_cup_vane").model_copy(update={"reference": reference})


def recorded(seed: int, speed: float) -> Recording:
    wind = TurbulenceSpec(
        mean_speed=speed,
        direction=0.5,
        standard_deviations=(0.14 * speed, 0.11 * speed, 0.07 * speed),
        integral_lengths=(80.0, 50.0, 20.0),
        seed=seed,
    )
    return simulate(station(), Scenario(wind, duration=400.0, seed=seed))


@pytest.fixture(scope="module")
def baseline() -> Baseline:
    return learn([recorded(seed, speed) for seed, speed in enumerate((5.0, 7.0, 9.0, 6.0))])


def with_shaking_vane(recording: Recording, wavelength: float, degrees: float) -> Recording:
    """A vane that swings by itself, faster in a faster wind, as one that sheds eddies would."""
    assert recording.reference is not None
    speed = float(np.mean(np.linalg.norm(recording.reference.velocity, axis=1)))
    readings = recording.angles["vane"]
    seconds = (readings.time - recording.start) * 1e-9
    # A line would be a single coefficient: the frequency wanders.
    frequency = speed / wavelength * (1.0 + 0.2 * np.sin(2.0 * np.pi * seconds / 50.0))
    phase = 2.0 * np.pi * np.cumsum(frequency) * np.median(np.diff(seconds))
    shaken = readings.angle + np.radians(degrees) * np.sin(phase)
    return replace(recording, angles={"vane": Angles(readings.time, shaken)})


def test_the_level_is_the_same_in_every_wind(baseline: Baseline) -> None:
    """For eddies of some 30 m and less a function of the wavenumber alone."""
    rows = []
    for seed, speed in ((20, 4.5), (21, 9.5)):
        comparison = prepare(recorded(seed, speed), baseline.station)
        simulated = comparison.simulate(baseline.station)
        assert excess_of(comparison, simulated, baseline).score < 4.0
        channel = comparison.channels[0]
        rows.append(levels(comparison, simulated, baseline.channels[channel.name], channel)[0])
    # Noise as large as the signal where eddies are smaller than the distance between the two,
    # hundreds of times smaller where they are larger; and where it matters the same in both winds.
    small = WAVENUMBERS > 0.03
    assert np.abs(rows[0] - rows[1])[small].max() < 0.3
    assert all(np.ptp(row) > 3.0 for row in rows)


@pytest.mark.parametrize("wavelength", [15.0, 60.0])
def test_a_vane_that_shakes_is_seen_at_the_size_of_its_eddies(
    baseline: Baseline, wavelength: float
) -> None:
    comparison = prepare(with_shaking_vane(recorded(30, 7.0), wavelength, 12.0), baseline.station)
    found = excess_of(comparison, comparison.simulate(baseline.station), baseline)
    assert found.score > NOISY
    assert found.channel == "vane/vane_angle"
    assert found.ratio > 2.0
    step = WAVENUMBERS[1] / WAVENUMBERS[0]
    assert wavelength / step < found.wavelength < wavelength * step


def test_certificates_know_no_level() -> None:
    comparison = prepare(with_shaking_vane(recorded(30, 7.0), 30.0, 20.0))
    certificates = default_baseline(station())
    simulated = comparison.simulate(station())
    assert excess_of(comparison, simulated, certificates).score == -np.inf


@settings(max_examples=40)
@given(st.integers(2, 12), st.floats(0.3, 1.5), st.integers(0, 2**32 - 1))
def test_a_few_healthy_days_do_not_make_another_one_loud(
    days: int, scatter: float, seed: int
) -> None:
    """Where days differ about as expected, five deviations are rare, however few the days are."""
    rng = np.random.default_rng(seed)
    trials = 60
    loud = 0
    for _ in range(trials):
        drawn = rng.normal(0.0, scatter * EXPECTED_SCATTER, (days + 1, WAVENUMBERS.size))
        mean, deviation = learnt_levels(drawn[:-1])
        loud += int(np.any((drawn[-1] - mean) / deviation > 5.0))
    assert loud <= 6


def test_one_healthy_day_shows_no_scatter() -> None:
    mean, deviation = learnt_levels(np.arange(6.0)[None, :])
    np.testing.assert_allclose(mean, np.arange(6.0))
    assert np.isinf(deviation).all()


def test_levels_survive_the_baseline_file(baseline: Baseline) -> None:
    for known in (baseline, default_baseline(station())):
        again = Baseline.from_json(known.to_json())
        for name, channel in known.channels.items():
            np.testing.assert_allclose(again.channels[name].noise_mean, channel.noise_mean)
            np.testing.assert_allclose(
                again.channels[name].noise_deviation, channel.noise_deviation
            )
