"""Where fits begin: what the screening sees of effects that a small size does not show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.screening import starting_values
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.healthy.learning import default_baseline


def test_an_imbalance_at_rest_is_screened_by_its_pull_not_by_the_lean_it_needs() -> None:
    pull = {"imbalance": 15.0, "tilt_x": 0.96, "tilt_y": -0.48}
    heavy = with_effect(STATION, catalogue()["vane_imbalance"], "vane", pull)
    recording = replace(recorded(heavy, 71, mean=4.0, swing=0.8), station=STATION)
    comparison = prepare(recording)
    searcher = searcher_of(comparison, default_baseline(STATION), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    key = ("vane_imbalance", "vane")
    score = next(
        s
        for s in searcher.scores(null, null.of(searcher.bank.without))
        if (s.effect, s.instrument) == key
    )
    assert score.gain > 100.0
    assert starting_values(score, comparison.drive) == pytest.approx(pull, rel=0.3, abs=0.2)


def test_fits_of_a_lean_begin_on_both_sides() -> None:
    lean = {"tilt_x": 9.0, "tilt_y": 4.0}
    leaning = with_effect(STATION, catalogue()["axis_tilt"], "station", lean)
    recording = replace(recorded(leaning, 71, swing=0.8), station=STATION)
    searcher = searcher_of(prepare(recording), default_baseline(STATION), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    vector = null.of(searcher.bank.without)
    starts = {
        of_one[0].effect.name: of_one for of_one in searcher.single_candidates(null, vector, 20)
    }
    one, other = (np.array([t.values["tilt_x"], t.values["tilt_y"]]) for t in starts["axis_tilt"])
    assert np.any(one != 0.0)
    assert other == pytest.approx(-one)
    turned = {"offset": 5.0}
    assert catalogue()["vane_offset"].either_sign(turned) == [turned]
