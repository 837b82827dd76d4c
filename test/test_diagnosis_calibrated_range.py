"""Certificates say what is normal only in the winds of a calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observation import NORMALISED_BANDS, channels_of
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.baseline import CALIBRATED_FROM, Baseline, default_channel
from wind_sensors.diagnosis.healthy.calibrated_range import (
    is_calm,
    is_too_calm,
    need_calibration,
    slowest_wind,
)
from wind_sensors.diagnosis.healthy.learning import default_baseline, learn
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.recordings import load_station
from wind_sensors.simulation.run import simulate
from wind_sensors.simulation.scenario import Scenario
from wind_sensors.station.model import Input, Reference, Station
from wind_sensors.station.signals import Angles
from wind_sensors.turbulence.synthesis import TurbulenceSpec


def station() -> Station:
    reference = Reference(topic=Input(topic="/reference/wind"), separation=0.5, path_length=0.15)
    return load_station("mast_cup_vane").model_copy(update={"reference": reference})


def compared(speed: float) -> Comparison:
    wind = TurbulenceSpec(
        mean_speed=speed,
        direction=0.5,
        standard_deviations=(0.12 * speed, 0.1 * speed, 0.07 * speed),
        integral_lengths=(40.0, 25.0, 15.0),
        seed=2,
    )
    return prepare(simulate(station(), Scenario(wind=wind, duration=200.0, seed=2)))


@pytest.mark.parametrize(("speed", "calm"), [(1.5, True), (3.0, True), (6.0, False)])
def test_below_the_calibrated_winds_only_healthy_recordings_help(speed: float, calm: bool) -> None:
    comparison = compared(speed)
    certificates = default_baseline(station())
    assert is_too_calm(comparison, certificates) is calm
    in_the_same_wind: Baseline = replace(certificates, usual_wind=speed)
    assert not is_too_calm(comparison, in_the_same_wind)


def test_healthy_recordings_say_what_is_normal_in_their_winds_only() -> None:
    scenarios = [
        Scenario(wind=TurbulenceSpec(mean_speed=speed, direction=0.5, seed=k), duration=120.0)
        for k, speed in enumerate((2.0, 8.0))
    ]
    calm, windy = (simulate(station(), scenario) for scenario in scenarios)
    assert 0.3 < slowest_wind(learn([calm])) < 1.0
    assert 2.5 < slowest_wind(learn([windy])) <= CALIBRATED_FROM
    assert not is_too_calm(prepare(calm), learn([calm, windy]))
    assert is_too_calm(prepare(calm), learn([windy]))


def test_a_reading_that_repeats_is_told_in_any_wind() -> None:
    effects = catalogue()
    stuck = Term(effects["stuck_sensor"], "vane", {"start": 0.0, "stop": 60.0})
    slow = Term(effects["calibration_drift"], "cup", {"gain": 0.97})
    assert not need_calibration([stuck])
    assert need_calibration([stuck, slow])
    assert not need_calibration([])


def test_a_day_is_calm_if_a_fifth_of_it_lies_below_calibrations() -> None:
    comparison = compared(6.0)
    windy = np.full(comparison.grid.n, 6.0)
    lulls = np.where(np.arange(windy.size) < 0.3 * windy.size, 3.0, windy)
    assert not is_calm(replace(comparison, speed=windy))
    assert is_calm(replace(comparison, speed=lulls))


def test_in_a_calm_spectra_may_depart_by_more_and_nothing_else() -> None:
    for channel in channels_of(station()):
        known = default_channel(channel)
        calm, fresh, stormy = (known.statistics_deviation_in(speed) for speed in (2.5, 5.0, 15.0))
        bands = len(NORMALISED_BANDS) - 1
        usual = known.statistics_deviation
        added = np.sqrt(np.maximum(calm**2 - usual**2, 0.0))
        assert added[:bands] == pytest.approx(0.5)
        assert np.sqrt(fresh**2 - usual**2)[:bands] == pytest.approx(0.125)
        assert stormy == pytest.approx(usual, rel=0.01)
        assert np.array_equal(calm[bands:], usual[bands:])


@pytest.mark.parametrize(("mean", "verdict"), [(1.0, "inconclusive"), (7.0, "unknown")])
def test_what_has_no_name_in_a_calm_is_no_mismatch(mean: float, verdict: str) -> None:
    recording = recorded(STATION, 91, mean=mean)
    angles = recording.angles["vane"]
    # The reading runs away and back by half a turn, again and again.
    wrong = np.pi * np.sin(np.arange(angles.angle.size) * 0.02) ** 8
    wrapped = np.angle(np.exp(1j * (angles.angle + wrong)))
    found = diagnose(
        replace(recording, angles={"vane": Angles(angles.time, wrapped)}), baseline()
    )
    assert found.verdict == verdict
    assert not found.findings
    assert ("calibrations do not reach" in found.unexplained.description) is (mean < 2.0)
