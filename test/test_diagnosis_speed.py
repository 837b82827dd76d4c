"""What makes a diagnosis fast must not change what it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.onsets import refined_interval
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.simulation.memory import Memory

OFFSET = Term(catalogue()["vane_offset"], "vane", {"offset": 8.0})


def test_a_memory_keeps_what_was_used_last() -> None:
    memory = Memory(2)
    computed: list[str] = []

    def result(key: str) -> str:
        def compute() -> str:
            computed.append(key)
            return key.upper()

        return memory.of(key, compute)

    assert [result(k) for k in "abacab"] == list("ABACAB")
    assert computed == list("abcb")


@pytest.mark.parametrize(
    ("effect", "instrument", "values", "interval"),
    [
        ("vane_offset", "vane", {"offset": 5.0}, (100.0, 200.0)),
        ("calibration_drift", "cup", {"gain": 0.9}, None),
        ("low_pass_filter", "vane", {"time_constant": 1.0}, None),
        ("vane_friction", "vane", {"friction_speed": 1.0}, (150.0, None)),
    ],
)
def test_what_is_remembered_is_what_would_be_computed(
    effect: str,
    instrument: str,
    values: dict[str, float],
    interval: tuple[float, float | None] | None,
) -> None:
    station = with_effect(STATION, catalogue()[effect], instrument, values, interval)
    comparison = prepare(recorded(STATION, 70))
    comparison.simulate(STATION)
    remembered = comparison.simulate(station).flat(comparison.channels)
    forgetful: Comparison = replace(prepare(recorded(STATION, 70)), memory=None)
    assert np.array_equal(remembered, forgetful.simulate(station).flat(comparison.channels))


def test_a_beginning_moves_to_where_it_is_after_one_fit() -> None:
    planted = with_effect(STATION, OFFSET.effect, "vane", OFFSET.values, (140.0, None))
    searcher = searcher_of(prepare(recorded(planted, 71)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    early = replace(OFFSET, interval=(110.0, None))
    found = refined_interval(searcher, null, fit(null, STATION, [early], searcher.bank.without))
    start, stop = found.terms[0].interval
    assert start == pytest.approx(140.0, abs=3.0)
    assert stop is None


def test_carried_derivatives_lead_to_the_same_values_with_fewer_simulations() -> None:
    planted = with_effect(STATION, OFFSET.effect, "vane", OFFSET.values)
    searcher = searcher_of(prepare(recorded(planted, 72)), baseline(), catalogue(), {})
    rest = searcher.bank.without
    first = fit(searcher.whitener(rest), STATION, [replace(OFFSET, values={"offset": 6.0})], rest)
    null = searcher.whitener(first.simulated)
    anew = fit(null, STATION, first.terms, rest)
    carried = fit(null, STATION, first.terms, rest, known=first)
    assert carried.evaluations < anew.evaluations
    assert carried.cost == pytest.approx(anew.cost, abs=0.1)
