"""What a search keeps of its last results: by the objects themselves, and only so many."""

from __future__ import annotations

import numpy as np
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.explanation import judged
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.recent import Recent
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import Term


def test_results_are_kept_for_the_very_objects_and_the_oldest_is_forgotten() -> None:
    recent: Recent[int] = Recent(2)
    first, equal, last = np.zeros(3), np.zeros(3), np.ones(3)
    recent.keep((first, None), 1, how="roughly")
    assert recent.find((first, None), how="roughly") == 1
    assert recent.find((first, None)) is None
    assert recent.find((equal, None), how="roughly") is None
    calls: list[int] = []

    def computed() -> int:
        calls.append(1)
        return 10 + len(calls)

    assert [recent.of((equal, last), computed) for _ in range(3)] == [11, 11, 11]
    recent.keep((last,), 3)
    assert recent.find((first, None), how="roughly") is None
    assert recent.of((equal, last), computed) == 11


def test_an_explanation_is_judged_though_its_judgement_is_not_kept() -> None:
    searcher = searcher_of(prepare(recorded(STATION, 84)), baseline(), catalogue(), {})
    searcher.judgements = Recent(1)
    null = searcher.whitener(searcher.bank.without)
    gain = catalogue()["calibration_drift"]
    fits = [
        fit(null, STATION, [Term(gain, "cup", {"gain": value})], iterations=0)
        for value in (0.99, 1.01)
    ]
    first, again = judged(searcher, fits), judged(searcher, fits)
    assert len(first) == len(again) == len(fits)
    assert [r.penalised_deviance for r in again] == [r.penalised_deviance for r in first]
