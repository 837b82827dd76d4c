"""A propeller whose bearing brakes it until its blades stall."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import AEROVANE, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.verdict import diagnose

BRAKED = {"friction_speed": 2.4, "temperature_coefficient": 0.0, "breakaway": 5.4}


def test_a_propeller_that_stalls_in_lulls_has_a_bad_bearing_and_nothing_else() -> None:
    baseline = learn([recorded(AEROVANE, seed, described=AEROVANE) for seed in (10, 11, 12)])
    braked = with_effect(AEROVANE, catalogue()["bearing_friction"], "propeller", BRAKED)
    recording = recorded(braked, 55, mean=5.0, described=AEROVANE)
    rate = prepare(recording).measured.series["propeller/rotor_rate"]
    assert 0.1 < np.mean(rate < 0.2) < 0.9
    found = diagnose(recording, baseline, with_proof=False)
    assert found.verdict == "named"
    (finding,) = found.findings
    assert finding.term.effect.name == "bearing_friction"
    values = finding.term.values
    assert values["friction_speed"] == pytest.approx(2.4, rel=0.2)
    # From rest it starts where the air pushes as hard as so strong a bearing holds.
    starts = values["friction_speed"] * values["breakaway"] ** 0.5
    assert starts == pytest.approx(2.4 * 5.4**0.5, rel=0.1)
