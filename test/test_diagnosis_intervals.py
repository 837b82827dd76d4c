"""Linear gains of all intervals at once, against one least-squares fit for each."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.intervals import cell_signatures, interval_gains
from wind_sensors.diagnosis.explaining.onsets import refined_interval
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted, simulated_with

CELLS = 7
LENGTH = 40


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000), number=st.integers(1, 4))
def test_gains_are_those_of_least_squares(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    cuts = np.arange(CELLS + 1.0)
    cells = [rng.standard_normal((CELLS, LENGTH)) for _ in range(number)]
    vector = rng.standard_normal(LENGTH)
    joint = interval_gains(cuts, cells, vector, joint=True)
    best = interval_gains(cuts, cells, vector, joint=False)
    for i in range(CELLS):
        for j in range(i + 1, CELLS + 1):
            rows = np.array([c[i:j].sum(axis=0) for c in cells])
            left = np.linalg.lstsq(rows.T, vector, rcond=None)[1]
            gain = float(vector @ vector - left[0])
            # A thousandth of the power is added against signatures that are nearly parallel.
            assert joint.gains[i, j] == pytest.approx(gain, rel=0.02)
            alone = max((row @ vector) ** 2 / (row @ row) for row in rows)
            assert best.gains[i, j] == pytest.approx(alone)
            assert np.count_nonzero(best.amplitudes[i, j]) == 1
    assert not np.any(np.tril(joint.gains))


def test_what_cannot_hold_all_the_time_keeps_its_interval() -> None:
    # A cup whose torque grows with its rate runs away in the lulls of this wind, not for a minute.
    comparison = prepare(recorded(STATION, 9, mean=3.0))
    asymmetry = catalogue()["torque_asymmetry"]
    passing = Term(asymmetry, "cup", {"a4": 2.7}, (180.0, 240.0))
    endless = Term(asymmetry, "cup", {"a4": 2.7}, ALWAYS)
    assert comparison.possible(planted(STATION, [passing])) is not None
    assert comparison.possible(planted(STATION, [endless])) is None
    searcher = searcher_of(comparison, baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    found = fit(null, STATION, [passing], None, iterations=0)
    assert refined_interval(searcher, null, found).terms == (passing,)


def test_what_is_left_without_a_term_that_held_it_back_is_nothing() -> None:
    # Alone, this cup would run away; beside an effect that slows it, it would not.
    comparison = prepare(recorded(STATION, 9, mean=3.0))
    asymmetry = Term(catalogue()["torque_asymmetry"], "cup", {"a4": 2.7})
    nothing = comparison.simulate(STATION).flat(comparison.channels)
    left = simulated_with(comparison, STATION, [asymmetry]).flat(comparison.channels)
    np.testing.assert_array_equal(left, nothing)
    slight = Term(catalogue()["torque_asymmetry"], "cup", {"a4": 0.5})
    moved = simulated_with(comparison, STATION, [slight]).flat(comparison.channels)
    assert np.abs(np.nan_to_num(moved - nothing)).max() > 0.1


def test_cells_add_up_to_what_the_effect_changes_all_the_time() -> None:
    comparison = prepare(recorded(STATION, 9))
    searcher = searcher_of(comparison, baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    heavy = Term(catalogue()["rotor_inertia"], "cup", {"inertia_factor": 3.0})
    without = searcher.bank.without
    changed = comparison.simulate(planted(STATION, [heavy]))
    cuts = np.array([0.0, 45.0, 130.0, 131.0, comparison.grid.n * comparison.grid.dt])
    cells = cell_signatures(comparison, without, changed, null.trust, cuts)
    channels = comparison.channels
    change = changed.flat(channels) - without.flat(channels)
    whole = np.nan_to_num(change * comparison.weights(null.trust))
    assert cells.sum(axis=0) == pytest.approx(whole, abs=1e-6)
    activities = sum(without.levels[c.name].size for c in comparison.channels)
    assert np.abs(cells[:, -activities:]).max() > 1.0
