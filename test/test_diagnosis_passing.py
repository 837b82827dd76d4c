"""What begins or ends inside a record, and what takes eddies away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, drift, recorded

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining import acceptance
from wind_sensors.diagnosis.explaining.acceptance import calms_too_much
from wind_sensors.diagnosis.explaining.explanation import (
    Judged,
    empty_fit,
    judged,
)
from wind_sensors.diagnosis.explaining.fitting import Fit, fit
from wind_sensors.diagnosis.explaining.moments import is_late_again, is_steady, single_event
from wind_sensors.diagnosis.explaining.onsets import in_a_part, refined_interval
from wind_sensors.diagnosis.explaining.rounds import blind_starts, later_starts
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.signals import Series

FloatArray = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def searcher() -> Searcher:
    return searcher_of(prepare(recorded(STATION, 71)), baseline(), catalogue(), {})


def in_first_channel(comparison: Comparison, series: FloatArray, size: int) -> FloatArray:
    """A white vector of which the first channel's series is given."""
    out = np.zeros(size)
    out[: comparison.coefficients] = spectra.to_cosine(series)[: comparison.coefficients]
    return out


@pytest.mark.parametrize(
    ("begin", "end", "steady"), [(60.0, 240.0, True), (140.0, 152.0, False)]
)
def test_what_passes_gains_all_the_time_that_it_holds(
    searcher: Searcher, begin: float, end: float, steady: bool
) -> None:
    comparison = searcher.comparison
    nothing = empty_fit(searcher.whitener(searcher.bank.without), searcher)
    at = comparison.grid.centres + comparison.drive.elapsed
    noise = np.random.default_rng(3).standard_normal(comparison.grid.n)
    misfit = np.where((at > begin) & (at < end), np.sqrt(180.0 / (end - begin)), 0.0)

    def seen(series: FloatArray, term: Term) -> Fit:
        vector = in_first_channel(comparison, series, nothing.vector.size)
        return replace(nothing, terms=(term,), vector=vector, cost=float(vector @ vector))

    passing = drift((50.0, 250.0))
    before, after = seen(noise + misfit, passing), seen(noise, passing)
    assert before.cost > after.cost + 50.0
    assert is_steady(comparison, before, after) is steady
    # In a gusty wind a true effect gains in a few gusts, but in more than two of them.
    gusts = np.zeros(comparison.grid.n)
    for gust, at_once in enumerate((300.0, 200.0, 60.0 if steady else 0.0)):
        there = np.abs(at - 67.5 - 30.0 * gust) < 1.0
        gusts[there] = np.sqrt(at_once / there.sum())
    still = noise * 0.01
    assert is_steady(comparison, seen(still + gusts, passing), seen(still, passing)) is steady
    # What always holds is judged by its best moment, what is drawn at random not at all.
    assert is_steady(comparison, before, seen(noise, drift()))
    bounce = {"bounce_probability": 0.02, "bounce_delay": 0.001}
    drawn = Term(catalogue()["extra_pulses"], "cup", bounce, (50.0, 250.0))
    assert is_steady(comparison, before, seen(noise, drawn))
    # A vane out of balance swings in each lull, while the wind may cross a wake but once.
    leans = {"imbalance": 15.0, "tilt_x": 1.0, "tilt_y": 0.0}
    swings = Term(catalogue()["vane_imbalance"], "vane", leans, (50.0, 250.0))
    assert is_steady(comparison, before, seen(noise, swings)) is steady
    wake = {"bearing_from": 0.0, "depth": 0.2, "width": 10.0, "flank": 0.0}
    shaded = Term(catalogue()["wake_shadow"], "cup", wake, (50.0, 250.0))
    assert is_steady(comparison, before, seen(noise, shaded))


@pytest.mark.parametrize(
    ("gust", "acts_then", "taken_off"),
    [(0.0, False, False), (1.5, False, False), (40.0, False, True), (40.0, True, False)],
)
def test_a_gust_is_taken_off_a_gain_but_not_that_one_moment_is_always_the_best(
    searcher: Searcher, gust: float, acts_then: bool, taken_off: bool
) -> None:
    comparison = searcher.comparison
    nothing = empty_fit(searcher.whitener(searcher.bank.without), searcher)
    seconds = comparison.grid.centres
    steady = np.full(comparison.grid.n, 2.0 * 24 / comparison.grid.n)
    lasting = 0.08 * seconds[-1]
    bump = np.exp(-0.5 * ((seconds - 0.4 * seconds[-1]) / (lasting / 6.0)) ** 2)
    gain = steady + gust * bump / bump.sum()
    # What it changes: the same all the time, or most where it gains most.
    change = np.sqrt(gain if acts_then else steady)
    misfit = 0.5 * (gain / change + change)

    def seen(series: FloatArray) -> Fit:
        vector = in_first_channel(comparison, series, nothing.vector.size)
        return replace(nothing, terms=(drift(),), vector=vector, cost=float(vector @ vector))

    more = single_event(comparison, seen(misfit), seen(misfit - change))
    assert more == pytest.approx(gust if taken_off else 0.0, rel=0.15)


@pytest.mark.parametrize(
    ("name", "values", "steadily", "again"),
    [
        ("timestamp_latency", {"latency": 0.4}, 0.0, False),
        ("timestamp_latency", {"latency": 0.4}, 30.0, True),
        ("clock_drift", {"drift": 900.0}, 4.0, False),
        ("vane_damping", {"damping_factor": 3.0, "viscous": 0.0}, 0.0, True),
    ],
)
def test_one_swing_of_the_wind_makes_no_clock_late(
    searcher: Searcher, name: str, values: dict[str, float], steadily: float, again: bool
) -> None:
    comparison = searcher.comparison
    nothing = empty_fit(searcher.whitener(searcher.bank.without), searcher)
    n = comparison.grid.n
    swing = np.where(np.abs(np.arange(n) - 0.6 * n) < 0.01 * n, np.sqrt(60.0 / (0.02 * n)), 0.0)
    misfit = np.hypot(swing, np.sqrt(steadily / n))
    term = Term(catalogue()[name], "vane", values)

    def seen(series: FloatArray) -> Fit:
        vector = in_first_channel(comparison, series, nothing.vector.size)
        return replace(nothing, terms=(term,), vector=vector, cost=float(vector @ vector))

    before, after = seen(misfit), seen(np.zeros(n))
    assert before.cost > 50.0
    assert is_late_again(comparison, before, after) is again


def test_where_another_effect_passes_one_that_the_screening_hardly_sees_is_tried_too(
    searcher: Searcher,
) -> None:
    null = searcher.whitener(searcher.bank.without)
    nothing = empty_fit(null, searcher)
    gap = Term(
        catalogue()["potentiometer_gap"],
        "vane",
        {"centre": 40.0, "width": 10.0, "reading": 35.0},
    )
    dead = {"dead_time": 0.01, "loss_probability": 0.0, "loss_growth": 0.0}
    rotor = Term(catalogue()["missed_pulses"], "cup", dead)
    guesses = {(t.effect.name, t.instrument): (t,) for t in (gap, rotor)}
    guessing = replace(searcher, guesses=guesses)
    eccentric = Term(
        catalogue()["vane_eccentricity"], "vane", {"sine": 3.0, "cosine": 1.0}, (100.0, None)
    )

    def starts(term: Term) -> list[list[Term]]:
        return blind_starts(guessing, [Judged(replace(nothing, terms=(term,)), 0.0, lambda: null)])

    # Beside an effect of the vane the vane's, in its minutes; beside itself not again.
    assert [replace(gap, interval=(100.0, None))] in starts(eccentric)
    assert not {rotor.key, eccentric.key} & {tried[0].key for tried in starts(eccentric)}
    assert gap.key not in {t[0].key for t in starts(replace(gap, interval=(100.0, None)))}
    # It is challenged by what it is mistaken for on the vane, and by nothing on the cup.
    challengers = {tried[0].key: tried for tried in starts(eccentric)}
    assert ("vane_imbalance", "vane") in challengers
    assert {instrument for _, instrument in challengers} == {"vane"}
    assert all(t.interval == (100.0, None) for t in challengers["vane_imbalance", "vane"])


def test_an_axis_that_leans_for_some_minutes_is_found_though_small_leans_show_no_way() -> None:
    since = (60.0, 240.0)
    lean = {"tilt_x": 10.0, "tilt_y": 26.0}
    station = with_effect(STATION, catalogue()["axis_tilt"], "station", lean, since)
    found = diagnose(recorded(station, 78, swing=0.6), baseline(), with_proof=False)
    (term,) = found.naming.fit.terms
    assert term.effect.name == "axis_tilt"
    assert term.interval[0] == pytest.approx(since[0], abs=15.0)
    assert term.interval[1] == pytest.approx(since[1], abs=15.0)


def test_a_vane_that_sticks_from_some_moment_on_does_so_in_that_part_of_the_record() -> None:
    friction = {"friction_speed": 1.3}
    station = with_effect(STATION, catalogue()["vane_friction"], "vane", friction, (260.0, None))
    searcher = searcher_of(prepare(recorded(station, 88)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    sticking = Term(catalogue()["vane_friction"], "vane", friction)
    always = fit(null, STATION, [sticking], searcher.bank.without)
    part = in_a_part(searcher, null, always)
    assert part.cost < always.cost - 20.0
    assert part.terms[-1].interval[0] == pytest.approx(260.0, abs=30.0)
    assert part.terms[-1].interval[1] is None


@pytest.mark.parametrize(
    ("planted", "effect", "values", "too_much"),
    [
        (False, "vane_friction", {"friction_speed": 1.3}, True),
        (False, "vane_inertia", {"inertia_factor": 3.0}, True),
        # So little takes away less than chance does; an offset takes nothing.
        (False, "vane_friction", {"friction_speed": 0.6}, False),
        (False, "vane_offset", {"offset": 20.0}, False),
        (True, "vane_friction", {"friction_speed": 1.3}, False),
        (True, "vane_inertia", {"inertia_factor": 3.0}, False),
    ],
)
def test_what_takes_eddies_away_that_the_signals_have_calms_too_much(
    planted: bool, effect: str, values: dict[str, float], too_much: bool
) -> None:
    station = with_effect(STATION, catalogue()[effect], "vane", values) if planted else STATION
    recording = replace(recorded(station, 71), station=STATION)
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    term = Term(catalogue()[effect], "vane", values)
    found = fit(null, STATION, [term], searcher.bank.without, iterations=0)
    (one,) = judged(searcher, [found])
    assert calms_too_much(searcher, one, empty_fit(null, searcher)) is too_much


def test_a_delay_is_not_asked_what_becomes_of_eddies(
    monkeypatch: pytest.MonkeyPatch, searcher: Searcher
) -> None:
    null = searcher.whitener(searcher.bank.without)
    late = Term(catalogue()["timestamp_latency"], "vane", {"latency": 0.5})
    found = fit(null, STATION, [late], searcher.bank.without, iterations=0)
    monkeypatch.setattr(acceptance, "gained_by_eddies", lambda *_: -1000.0)
    (one,) = judged(searcher, [found])
    assert not calms_too_much(searcher, one, empty_fit(null, searcher))


def test_a_grease_tells_nothing_of_its_stiffening_within_minutes_at_one_temperature() -> None:
    recording = recorded(STATION, 75)
    minutes = np.arange(0, recording.stop, 1_000_000_000)
    rising = np.where(minutes < 200e9, 15.0 - 5.0 * np.sin(minutes / 60e9), 15.0)
    warm = replace(recording, temperature=Series(minutes, rising))
    searcher = searcher_of(prepare(warm), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    stiff = {"friction_speed": 1.0, "temperature_coefficient": -0.05, "breakaway": 1.0}
    for interval, tells in ((ALWAYS, True), ((210.0, None), False)):
        braked = Term(catalogue()["bearing_friction"], "cup", stiff, interval)
        (fitted,) = fit(null, STATION, [braked], searcher.bank.without, iterations=2).terms
        assert (fitted.values["temperature_coefficient"] != 0.0) is tells


@pytest.mark.parametrize(("begin", "end"), [
    (150.3, None), pytest.param(100.7, 290.1, marks=pytest.mark.slow),
])
def test_stamps_that_are_late_from_some_moment_on_jump_there(
    begin: float, end: float | None
) -> None:
    late = catalogue()["timestamp_latency"]
    station = with_effect(STATION, late, "cup", {"latency": 0.4}, (begin, end))
    found = diagnose(recorded(station, 92), baseline(), with_proof=False)
    (finding,) = found.findings
    assert finding.term.effect is late
    assert finding.parameters["latency"].value == pytest.approx(0.4, abs=0.01)
    assert finding.term.interval[0] == pytest.approx(begin, abs=0.05)
    stop = finding.term.interval[1]
    assert (stop is None) is (end is None)
    assert stop is None or stop == pytest.approx(end, abs=0.1)


def test_a_vane_that_counts_backwards_for_a_while_is_sought_moment_by_moment() -> None:
    """From a swing to the next a vane that counts backwards turns round elsewhere."""
    swap = Term(catalogue()["sensor_swap"], "vane", {"reversed": 1.0}, (100.0, 290.0))
    station = with_effect(STATION, swap.effect, "vane", swap.values, swap.interval)
    searcher = searcher_of(
        prepare(recorded(station, 74, swing=1.6)), baseline(), catalogue(), {}
    )
    null = searcher.whitener(searcher.bank.without)
    part = replace(swap, interval=(180.0, 240.0))
    found = refined_interval(searcher, null, fit(null, STATION, [part], searcher.bank.without))
    start, stop = found.terms[0].interval
    assert start == pytest.approx(100.0, abs=3.0)
    assert stop == pytest.approx(290.0, abs=3.0)


def test_what_turns_the_whole_wind_is_tried_from_the_best_moment_on(searcher: Searcher) -> None:
    null = searcher.whitener(searcher.bank.without)
    nothing = empty_fit(null, searcher)
    lean = Term(catalogue()["axis_tilt"], "station", {"tilt_x": 20.0, "tilt_y": 0.0})

    def seen(term: Term, deviance: float) -> Judged:
        return Judged(replace(nothing, terms=(term,)), deviance, lambda: null)

    def tried(
        interval: Interval, ahead: float, *lasting: Judged
    ) -> list[tuple[tuple[str, str], Interval]]:
        passing = seen(replace(drift(), interval=interval), -ahead)
        return [(t.key, t.interval) for of in later_starts([passing], lasting) for t in of]

    everywhere = [seen(lean, 0.0), seen(drift(), 0.0)]
    assert tried((100.0, None), 1.0, *everywhere) == [(lean.key, (100.0, None))]
    assert tried((100.0, 200.0), 1.0, *everywhere) == [
        (lean.key, (100.0, None)), (lean.key, (100.0, 200.0)),
    ]
    # Not where something that always holds is ahead, or nothing begins.
    assert tried((100.0, 200.0), -1.0, *everywhere) == []
    assert tried((0.0, 200.0), 1.0, *everywhere) == []
