"""Two effects on the same signals, which one with more parameters imitates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, diagnosed, recorded
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.acceptance import inexactness, may_be_form, owed
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.moves import simplified, swapped
from wind_sensors.diagnosis.explaining.pairs import built_on_simple, promise, promising_pairs
from wind_sensors.diagnosis.explaining.rounds import first_round
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.verdict import diagnose

ICE = {"growth_time": 0.0, "friction_speed": 0.0}
"""That is there at once, and brakes nothing."""


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000), several=st.integers(1, 3))
def test_a_promise_is_the_drop_of_the_sum_of_squares(seed: int, several: int) -> None:
    rng = np.random.default_rng(seed)
    changes = rng.standard_normal((5, 40))
    vector = 3.0 * changes[0] - changes[2] + rng.standard_normal(40)
    members = [0, 2, 4][:several]
    drop, multiples = promise(changes @ changes.T, changes @ vector, members)
    left = vector - multiples @ changes[members]
    assert drop == pytest.approx(vector @ vector - left @ left)
    (solved, *_) = np.linalg.lstsq(changes[members].T, vector, rcond=None)
    assert multiples == pytest.approx(solved)


def test_what_does_the_same_as_another_promises_nothing_more() -> None:
    change = np.linspace(-1.0, 1.0, 50)
    vector = change + 0.1 * np.cos(np.arange(50.0))
    changes = np.array([change, 2.0 * change])
    gram, seen = changes @ changes.T, changes @ vector
    assert promise(gram, seen, [0, 1])[0] == pytest.approx(promise(gram, seen, [0])[0])


def test_a_pair_that_smooths_starts_from_the_sizes_that_both_have_alone_too() -> None:
    effects = catalogue()
    both = [
        Term(effects["air_density"], "station", {"density_ratio": 0.45}),
        Term(effects["vane_eccentricity"], "vane", {"sine": -6.0, "cosine": 1.0}),
    ]
    recording = recorded(planted(STATION, both), 68)
    searcher = searcher_of(prepare(recording), baseline(), effects, {})
    first = first_round(searcher)
    nothing = fit(first.whitener, STATION, [], searcher.bank.without)
    pairs = promising_pairs(searcher, first.whitener, first.singles, nothing)
    alone = [f.terms[0] for f in first.singles]
    smoothing = [pair for pair in pairs if any(t.effect.smooths for t in pair)]
    assert smoothing
    for pair in smoothing:
        same = [other for other in smoothing if [t.key for t in other] == [t.key for t in pair]]
        as_alone = [all(any(t is one for one in alone) for t in other) for other in same]
        assert sorted(as_alone) == [False, True]


def null_of(searcher: Searcher, terms: Sequence[Term]) -> Whitener:
    """The null seen from the simulation with some effects."""
    simulated = searcher.comparison.simulate(planted(searcher.station, terms))
    return searcher.whitener(simulated)


def test_a_heavy_rotor_in_a_bad_bearing_is_not_called_iced() -> None:
    """Ice makes a rotor slower and heavier with two numbers of one effect."""
    effects = catalogue()
    friction = {"friction_speed": 1.8, "temperature_coefficient": 0.0, "breakaway": 1.0}
    terms = [
        Term(effects["rotor_inertia"], "cup", {"inertia_factor": 2.5}),
        Term(effects["bearing_friction"], "cup", friction),
    ]
    found = diagnose(recorded(planted(STATION, terms), 68), baseline(), with_proof=False)
    named = {f.term.effect.name for f in found.findings}
    assert {"rotor_inertia", "bearing_friction"} <= named
    assert "icing" not in named


def test_ice_without_weight_is_a_calibration() -> None:
    drifted = with_effect(STATION, catalogue()["calibration_drift"], "cup", {"gain": 0.9})
    searcher = searcher_of(prepare(recorded(drifted, 69)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    ice = Term(catalogue()["icing"], "cup", {**ICE, "gain": 0.9, "inertia_factor": 1.01})
    weightless = fit(null, STATION, [ice], None, iterations=0)
    (left,) = simplified(searcher, null, weightless).terms
    assert left.key == ("calibration_drift", "cup")
    assert left.values["gain"] == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize(("drift", "left"), [(1.02, True), (1.3, False)])
def test_a_small_effect_that_brings_most_mends_nothing(drift: float, left: bool) -> None:
    """A rotor one and a half times as heavy beside a gain of more of its smallest sizes."""
    effects = catalogue()
    heavy = Term(effects["rotor_inertia"], "cup", {"inertia_factor": 1.5})
    terms = [heavy, Term(effects["calibration_drift"], "cup", {"gain": drift})]
    assert heavy.relative_size < terms[1].relative_size
    searcher = searcher_of(
        prepare(recorded(planted(STATION, terms), 71, swing=1.0)), baseline(), effects, {}
    )
    both = fit(null_of(searcher, terms), STATION, terms, searcher.bank.without, iterations=0)
    names = {t.effect.name for t in simplified(searcher, null_of(searcher, terms), both).terms}
    assert names == ({"rotor_inertia", "calibration_drift"} if left else {"calibration_drift"})


@pytest.mark.parametrize(
    ("effect", "values", "form"),
    [
        ("damaged_cup", {"torque_harmonic": 0.2, "gain": 1.0}, False),
        ("calibration_drift", {"gain": 0.9}, True),
    ],
)
def test_a_small_effect_is_the_form_of_none_that_acts_in_another_way(
    effect: str, values: dict[str, float], form: bool
) -> None:
    """An offset of one and a half of its smallest sizes: what a cup does within its turns moves no
    mean."""
    effects = catalogue()
    first = Term(effects[effect], "cup", values)
    small = Term(effects["calibration_offset"], "cup", {"offset": 0.15})
    assert small.relative_size < first.relative_size
    searcher = searcher_of(
        prepare(recorded(planted(STATION, [first, small]), 75, swing=0.8)), baseline(), effects, {}
    )
    null = null_of(searcher, [first])
    alone, both = (
        fit(null, STATION, terms, searcher.bank.without, iterations=0)
        for terms in ([first], [first, small])
    )
    assert alone.cost - both.cost < fit(null, STATION, []).cost - alone.cost
    assert may_be_form(searcher, null, alone, both) is form
    assert np.isinf(inexactness(searcher, null, alone, both)) == form


def test_of_a_healthy_rotor_no_ice_is_left() -> None:
    searcher = searcher_of(prepare(recorded(STATION, 69)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    ice = Term(catalogue()["icing"], "cup", {**ICE, "gain": 0.97, "inertia_factor": 1.01})
    assert simplified(searcher, null, fit(null, STATION, [ice], None, iterations=0)).terms == ()


def test_a_pair_is_built_on_a_simple_effect_that_hides_the_other() -> None:
    """Beside an offset of the vane a leaning axis promises nothing until the offset is there."""
    effects = catalogue()
    terms = [
        Term(effects["vane_offset"], "vane", {"offset": 4.0}),
        Term(effects["axis_tilt"], "station", {"tilt_x": 20.0, "tilt_y": -12.0}),
    ]
    recording = recorded(planted(STATION, terms), 72, swing=0.6)
    searcher = searcher_of(
        comparison := prepare(recording), baseline(), effects, guesses_of(comparison, STATION)
    )
    null = searcher.whitener(searcher.bank.without)
    offset = Term(effects["vane_offset"], "vane", {"offset": 3.0})
    flow = {"cosine_1": -0.02, "sine_1": 0.02, "cosine_2": 0.02, "sine_2": 0.02, "deflection": 1.0}
    distorted = Term(effects["flow_distortion"], "station", flow)
    simple, leader = (fit(null, STATION, [t], None) for t in (offset, distorted))
    assert leader.active > 1
    (built,) = built_on_simple(searcher, null, [simple, leader], leader)
    assert {t.effect.name for t in built} == {"vane_offset", "axis_tilt"}
    # Of one parameter that leads nothing is imitated.
    assert built_on_simple(searcher, null, [simple, leader], simple) == []


def test_a_term_on_other_signals_leaves_the_first_one_alone() -> None:
    effects = catalogue()
    bounce = {"bounce_probability": 0.05, "bounce_delay": 0.002}
    terms = [
        Term(effects["extra_pulses"], "cup", bounce),
        Term(effects["vane_offset"], "vane", {"offset": 4.0}),
    ]
    searcher = searcher_of(
        prepare(recorded(planted(STATION, terms), 73)), baseline(), effects, {}
    )
    null = searcher.whitener(searcher.bank.without)
    first = fit(null, STATION, [terms[0]], searcher.bank.without)
    start = Term(effects["vane_offset"], "vane", {"offset": 2.0})
    assert searcher.is_apart(first, start)
    both = searcher.fit_beside(null, first, start)
    assert both.terms[0] == first.terms[0]
    assert both.terms[1].values["offset"] == pytest.approx(4.0, abs=0.5)
    assert both.cost < first.cost - 50.0
    again = Term(effects["calibration_drift"], "cup", {"gain": 1.02})
    assert not searcher.is_apart(first, again)


def test_a_loud_effect_beside_a_distorted_flow_does_not_hide_what_the_flow_brings() -> None:
    # Nearly all that both bring comes from the pulses: any second effect has most of it.
    effects = catalogue()
    bounce = {"bounce_probability": 0.06, "bounce_delay": 0.002}
    flow = {"cosine_1": 0.05, "sine_1": -0.02, "cosine_2": 0.04, "sine_2": 0.03, "deflection": 1.0}
    terms = [
        Term(effects["extra_pulses"], "cup", bounce),
        Term(effects["flow_distortion"], "station", flow),
    ]
    found = diagnose(recorded(planted(STATION, terms), 77, swing=1.0), baseline(), with_proof=False)
    assert {t.effect.name for t in found.naming.fit.terms} == {"extra_pulses", "flow_distortion"}


def test_a_flow_is_as_distorted_as_where_it_changes_most() -> None:
    flow = {"cosine_1": 0.03, "sine_1": 0.0, "cosine_2": 0.03, "sine_2": 0.0, "deflection": 1.0}
    assert catalogue()["flow_distortion"].relative_size(flow) == pytest.approx(0.06 / 0.02)
    opposed = {**flow, "cosine_1": 0.0}
    assert catalogue()["flow_distortion"].relative_size(opposed) == pytest.approx(0.03 / 0.02)


def test_an_effect_of_a_pair_is_exchanged_for_what_competed_before() -> None:
    # An offset of the rotor's reading beside a late vane: a gain of the calibration does nearly the
    # same in such a wind, whatever the screening of what is left suggests.
    effects = catalogue()
    late = Term(effects["timestamp_latency"], "vane", {"latency": 0.8})
    terms = [late, Term(effects["calibration_offset"], "cup", {"offset": -0.4})]
    searcher = searcher_of(
        prepare(recorded(planted(STATION, terms), 74)), baseline(), effects, {}
    )
    gain = Term(effects["calibration_drift"], "cup", {"gain": 0.95})
    null = searcher.whitener(searcher.bank.without)
    wrong = fit(null, STATION, [late, gain], searcher.bank.without)
    null = searcher.whitener(wrong.simulated)
    wrong = fit(null, STATION, wrong.terms, searcher.bank.without)
    right, losers = swapped(searcher, null, wrong, [terms[1]])
    assert {t.effect.name for t in right.terms} == {"timestamp_latency", "calibration_offset"}
    beside = {t.effect.name for a in losers for t in a.fit.terms if t.instrument == "cup"}
    assert "calibration_drift" in beside
    # Nothing of the rotor takes the vane's place, or the other way round.
    for loser in losers:
        assert {t.instrument for t in loser.fit.terms} & {"vane", "station"}


def test_what_another_effect_explains_better_goes_if_that_brings_too_little() -> None:
    # A slow filter, and what is left of it called an imbalance; a bearing that sticks a little
    # explains that better, but not by as much as the filter's own form may be wrong by.
    effects = catalogue()
    slow = Term(effects["low_pass_filter"], "vane", {"time_constant": 0.7})
    sticks = Term(effects["vane_friction"], "vane", {"friction_speed": 0.6})
    searcher = searcher_of(
        prepare(recorded(planted(STATION, [slow, sticks]), 75, swing=0.6)), baseline(), effects, {}
    )
    null = null_of(searcher, [slow])
    lean = {"imbalance": 0.3, "tilt_x": 0.0, "tilt_y": 0.0}
    wrong = fit(null, STATION, [slow, Term(effects["vane_imbalance"], "vane", lean)], None)
    found, losers = swapped(searcher, null, wrong, [sticks])
    assert [t.effect.name for t in found.terms] == ["low_pass_filter"]
    assert all(len(a.fit.terms) == 1 for a in losers)


def test_a_rotor_of_another_calibration_is_not_called_damaged() -> None:
    # A damaged cup pulls less and reads less: without the former it is a calibration.
    station = with_effect(STATION, catalogue()["calibration_drift"], "cup", {"gain": 0.85})
    found = diagnose(recorded(station, 79), baseline(), with_proof=False)
    assert {f.term.effect.name for f in found.findings} == {"calibration_drift"}
    damaged = Term(catalogue()["damaged_cup"], "cup", {"torque_harmonic": 0.05, "gain": 0.9})
    drift = Term(catalogue()["calibration_drift"], "cup", {"gain": 0.9})
    assert owed(damaged, drift) > 0.0
    assert owed(drift, damaged) == 0.0
    assert owed(damaged, replace(drift, instrument="other")) == 0.0


def test_bounces_tell_their_delay() -> None:
    effects = catalogue()
    bounce = {"bounce_probability": 0.06, "bounce_delay": 0.0017}
    station = with_effect(STATION, effects["extra_pulses"], "cup", bounce)
    comparison = prepare(recorded(station, 79))
    (guess,) = (t for t in guesses_of(comparison, STATION)[("extra_pulses", "cup")])
    assert guess.held == {"bounce_delay"}
    assert guess.values["bounce_delay"] == pytest.approx(0.0017, rel=0.06)


def test_a_rotor_that_turns_too_fast_is_not_called_damaged() -> None:
    found = diagnosed("calibration_drift", "cup", gain=1.04)
    rivals = {f.term.effect.name for f in found.findings}
    assert "calibration_drift" in rivals
    assert "damaged_cup" not in rivals
