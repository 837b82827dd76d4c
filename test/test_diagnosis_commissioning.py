"""What healthy days show of an instrument beyond its certificate, and sizes relative to that."""

from __future__ import annotations

from functools import lru_cache

import pytest
from diagnosis_cases import AEROVANE, recorded

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.report.diagnosis_page import page
from wind_sensors.station.model import Propeller, Station
from wind_sensors.station.signals import Recording

LIGHT = 0.5
"""In its gusts the propeller answers within this share of the certificate's distance."""


def with_inertia(factor: float) -> Station:
    inertia = catalogue()["rotor_inertia"]
    return with_effect(AEROVANE, inertia, "propeller", {"inertia_factor": factor})


def on_a_day(station: Station, seed: int, swing: float = 0.0) -> Recording:
    return recorded(station, seed, swing=swing, described=AEROVANE)


def propeller_of(station: Station) -> Propeller:
    propeller = station.instrument("propeller")
    assert isinstance(propeller, Propeller)
    return propeller


@lru_cache(maxsize=1)
def of_light_days() -> Baseline:
    return learn([on_a_day(with_inertia(LIGHT), seed) for seed in range(10, 13)])


def test_healthy_days_say_how_quickly_a_propeller_answers() -> None:
    baseline = of_light_days()
    propeller = propeller_of(baseline.station)
    assert propeller.inertia_factor == pytest.approx(LIGHT, rel=0.25)
    at_seven = propeller.calibration_gain * 7.0 + propeller.calibration_offset
    assert at_seven == pytest.approx(7.0, abs=0.05)
    assert propeller_of(baseline.original).inertia_factor == 1.0
    stays = learn([on_a_day(AEROVANE, seed) for seed in range(10, 13)])
    assert propeller_of(stays.station).inertia_factor == pytest.approx(1.0, rel=0.12)


def test_it_goes_on_top_of_a_recordings_own_file() -> None:
    baseline = Baseline.from_json(of_light_days().to_json())
    found = propeller_of(baseline.station).inertia_factor
    assert found == pytest.approx(propeller_of(of_light_days().station).inertia_factor)
    on_top = baseline.for_station(with_inertia(1.5))
    assert propeller_of(on_top.station).inertia_factor == pytest.approx(1.5 * found)
    assert propeller_of(on_top.original).inertia_factor == 1.5


def test_a_heavier_propeller_is_heavier_than_on_healthy_days() -> None:
    found = diagnose(on_a_day(with_inertia(2.5 * LIGHT), 50), of_light_days())
    (finding,) = found.findings
    assert finding.term.key == ("rotor_inertia", "propeller")
    factor = finding.parameters["inertia_factor"]
    assert factor.low < 2.5 < factor.high
    # The wind is corrected with the inertia that the propeller has.
    assert propeller_of(found.station).inertia_factor == pytest.approx(2.5 * LIGHT, rel=0.2)


def test_other_findings_leave_the_files_inertia() -> None:
    offset = catalogue()["vane_offset"]
    turned = with_effect(with_inertia(LIGHT), offset, "vane", {"offset": 9.0})
    found = diagnose(on_a_day(turned, 51, swing=0.8), of_light_days())
    assert "vane_offset" in {f.term.effect.name for f in found.findings}
    assert propeller_of(found.station).inertia_factor == 1.0


def test_the_report_says_what_sizes_count_from() -> None:
    text = page(diagnose(on_a_day(with_inertia(LIGHT), 52), of_light_days()))
    inertia = propeller_of(of_light_days().station).inertia_factor
    assert f"inertia factor {inertia:.2f}" in text
