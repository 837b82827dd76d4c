"""What begins or ends inside a record, what brings eddies of its own, and what rivals a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from test_diagnosis_naming import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics import STATISTICS
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining import acceptance
from wind_sensors.diagnosis.explaining.acceptance import calms_too_much
from wind_sensors.diagnosis.explaining.explanation import (
    Alternative,
    Judged,
    Naming,
    judged,
    no_terms,
)
from wind_sensors.diagnosis.explaining.fitting import ALWAYS, Fit, Interval, Term, fit
from wind_sensors.diagnosis.explaining.moments import is_steady, single_event
from wind_sensors.diagnosis.explaining.moves import merged
from wind_sensors.diagnosis.explaining.naming import kept_if_better, name, named_alone
from wind_sensors.diagnosis.explaining.onsets import in_a_part
from wind_sensors.diagnosis.explaining.rounds import blind_starts, first_round
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.proving import findings
from wind_sensors.diagnosis.proving.decision import (
    REMAINDER_SCORE,
    REMAINDER_SCORES,
    STIRRED_TIMES,
    carriers_of,
    remainder_of,
    unstirred,
)
from wind_sensors.diagnosis.proving.findings import equal_explanations
from wind_sensors.diagnosis.regions import Region, RegionBank, region_bank, strongest
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Series

FloatArray = npt.NDArray[np.float64]

DISTORTION = {
    "cosine_1": 0.08, "sine_1": -0.04, "cosine_2": 0.05, "sine_2": 0.05, "deflection": 1.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def searcher() -> Searcher:
    return searcher_of(prepare(recorded(STATION, 71)), baseline(), catalogue(), {})


def in_first_channel(comparison: Comparison, series: FloatArray, size: int) -> FloatArray:
    """A white vector of which the first channel's series is given."""
    out = np.zeros(size)
    out[: comparison.coefficients] = spectra.to_cosine(series)[: comparison.coefficients]
    return out


def drift(interval: Interval = ALWAYS) -> Term:
    return Term(catalogue()["calibration_drift"], "cup", {"gain": 1.03}, interval)


@pytest.mark.parametrize(
    ("begin", "end", "steady"), [(60.0, 240.0, True), (140.0, 152.0, False)]
)
def test_what_passes_gains_all_the_time_that_it_holds(
    searcher: Searcher, begin: float, end: float, steady: bool
) -> None:
    comparison = searcher.comparison
    nothing = no_terms(searcher.whitener(searcher.bank.without), searcher)
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


@pytest.mark.parametrize(
    ("gust", "acts_then", "taken_off"),
    [(0.0, False, False), (1.5, False, False), (40.0, False, True), (40.0, True, False)],
)
def test_a_gust_is_taken_off_a_gain_but_not_that_one_moment_is_always_the_best(
    searcher: Searcher, gust: float, acts_then: bool, taken_off: bool
) -> None:
    comparison = searcher.comparison
    nothing = no_terms(searcher.whitener(searcher.bank.without), searcher)
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


def test_where_another_effect_passes_one_that_the_screening_hardly_sees_is_tried_too(
    searcher: Searcher,
) -> None:
    null = searcher.whitener(searcher.bank.without)
    nothing = no_terms(null, searcher)
    gap = Term(
        catalogue()["potentiometer_gap"],
        "vane",
        {"centre": 40.0, "width": 10.0, "reading": 35.0},
    )
    rotor = Term(catalogue()["missed_pulses"], "cup", {"dead_time": 0.01, "loss_probability": 0.0})
    guesses = {(t.effect.name, t.instrument): (t,) for t in (gap, rotor)}
    guessing = replace(searcher, guesses=guesses)
    eccentric = Term(
        catalogue()["vane_eccentricity"], "vane", {"sine": 3.0, "cosine": 1.0}, (100.0, None)
    )

    def starts(term: Term) -> list[list[Term]]:
        return blind_starts(guessing, [Judged(replace(nothing, terms=(term,)), null, 0.0)])

    # Beside an effect of the vane the vane's, in its minutes; beside itself not again.
    assert [replace(gap, interval=(100.0, None))] in starts(eccentric)
    assert not {rotor.key, eccentric.key} & {tried[0].key for tried in starts(eccentric)}
    assert gap.key not in {t[0].key for t in starts(replace(gap, interval=(100.0, None)))}
    # It is challenged by what it is mistaken for on the vane, and by nothing on the cup.
    challengers = {tried[0].key: tried for tried in starts(eccentric)}
    assert ("vane_imbalance", "vane") in challengers
    assert {instrument for _, instrument in challengers} == {"vane"}
    assert all(t.interval == (100.0, None) for t in challengers["vane_imbalance", "vane"])


def named(searcher: Searcher, term: Term, alternatives: tuple[Alternative, ...] = ()) -> Naming:
    null = searcher.whitener(searcher.bank.without)
    nothing = no_terms(null, searcher)
    one = fit(null, STATION, [term], None, iterations=0)
    return Naming(one, null, null, nothing.vector, 1000.0, alternatives)


def test_noise_is_judged_outside_a_wake(searcher: Searcher) -> None:
    comparison = searcher.comparison
    bearing = float(np.degrees(np.quantile(comparison.wind_from, 0.001)))
    values = {"bearing_from": bearing, "depth": 0.3, "width": 3.0, "flank": 0.0}
    wake = Term(catalogue()["wake_shadow"], "cup", values)
    away = np.angle(np.exp(1j * (comparison.wind_from - np.radians(bearing))))
    outside = unstirred(named(searcher, wake), STATION)
    assert outside is not None
    assert outside.mask is not None
    assert np.all(outside.mask[np.abs(away) < np.radians(3.0)] < 0.01)
    assert np.mean(outside.mask) > 0.15
    assert unstirred(named(searcher, drift()), STATION) is comparison


@pytest.mark.parametrize(
    ("effect", "values", "active", "behind", "equal"),
    [
        ("calibration_offset", {"offset": 0.2}, 1, 20.0, True),
        ("calibration_offset", {"offset": 0.2}, 2, 20.0, False),
        ("calibration_offset", {"offset": 0.2}, 2, 13.0, False),
        ("calibration_offset", {"offset": 0.2}, 2, 11.0, True),
        ("damaged_cup", {"torque_harmonic": 0.0, "gain": 1.03}, 2, 1.0, False),
        ("damaged_cup", {"torque_harmonic": 0.0, "gain": 1.03}, 2, -1.0, True),
    ],
)
def test_a_rival_with_more_parameters_has_to_fit_as_well(
    searcher: Searcher,
    effect: str,
    values: dict[str, float],
    active: int,
    behind: float,
    equal: bool,
) -> None:
    drifted = named(searcher, drift())
    drifted = replace(drifted, fit=replace(drifted.fit, active=1))
    rival = replace(drifted.fit, terms=(Term(catalogue()[effect], "cup", values),), active=active)
    found = equal_explanations(replace(drifted, alternatives=(Alternative(rival, behind),)))
    assert [a.fit.terms[0].effect.name for _, a in found] == ([effect] if equal else [])


@pytest.mark.parametrize(("cosine", "equal"), [(0.5, True), (0.3, False)])
def test_what_fits_as_well_is_a_rival_if_it_is_half_alike(
    searcher: Searcher, cosine: float, equal: bool
) -> None:
    drifted = named(searcher, drift())
    own = drifted.nothing - drifted.fit.vector
    across = np.roll(own, 7)
    across -= own * float(across @ own) / float(own @ own)
    across *= np.linalg.norm(own) / np.linalg.norm(across)
    correction = cosine * own + np.sqrt(1.0 - cosine**2) * across
    terms = (Term(catalogue()["calibration_offset"], "cup", {"offset": 0.2}),)
    rival = replace(drifted.fit, terms=terms, vector=drifted.nothing - correction)
    found = equal_explanations(replace(drifted, alternatives=(Alternative(rival, 4.0),)))
    assert bool(found) is equal


@pytest.mark.parametrize(("gain", "equal"), [(400.0, True), (33.0, True), (31.0, False)])
def test_what_passes_and_would_not_be_named_is_no_rival(
    searcher: Searcher, gain: float, equal: bool
) -> None:
    drifted = named(searcher, drift())
    terms = (Term(catalogue()["calibration_offset"], "cup", {"offset": 0.2}, (0.0, 200.0)),)
    alternatives = (Alternative(replace(drifted.fit, terms=terms), 4.0),)
    found = equal_explanations(replace(drifted, gain=gain, alternatives=alternatives))
    assert bool(found) is equal


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
    ("effect", "values", "gained", "too_much"),
    [
        ("vane_friction", {"friction_speed": 0.6}, -12.0, True),
        ("vane_friction", {"friction_speed": 0.6}, -8.0, False),
        ("timestamp_latency", {"latency": 0.5}, -12.0, False),
        ("vane_offset", {"offset": 2.0}, -12.0, False),
    ],
)
def test_what_takes_eddies_away_that_the_signals_have_calms_too_much(
    monkeypatch: pytest.MonkeyPatch, searcher: Searcher, effect: str, values: dict[str, float],
    gained: float, too_much: bool,
) -> None:  # fmt: skip
    null = searcher.whitener(searcher.bank.without)
    term = Term(catalogue()[effect], "vane", values)
    found = fit(null, STATION, [term], searcher.bank.without, iterations=0)
    monkeypatch.setattr(acceptance, "gained_by_eddies", lambda *_: gained)
    (one,) = judged(searcher, [found])
    assert calms_too_much(searcher, one, no_terms(null, searcher)) is too_much


def test_the_same_effect_at_other_times_is_no_other_explanation(
    monkeypatch: pytest.MonkeyPatch, searcher: Searcher
) -> None:
    null = searcher.whitener(searcher.bank.without)
    found = fit(null, STATION, [drift((200.0, None))], searcher.bank.without, iterations=0)
    offset = Term(catalogue()["vane_offset"], "vane", {"offset": 2.0})
    later, other = (
        fit(null, STATION, [term], searcher.bank.without, iterations=0)
        for term in (drift((230.0, None)), offset)
    )
    nothing = null.of(searcher.bank.without)
    alternatives = (Alternative(later, 2.0), Alternative(other, 40.0))
    naming = Naming(found, null, null, nothing, 50.0, alternatives)
    placebos: list[Sequence[Term]] = []

    def kept(
        whitener: Whitener, station: Station, terms: Sequence[Term], placebo: Sequence[Term]
    ) -> None:
        placebos.append(placebo)

    monkeypatch.setattr(findings, "prove", kept)
    bank = region_bank(null, searcher.bank.without)
    before = strongest(null, bank, nothing, searcher.bank.without)
    findings.findings_of(naming, [], before, bank, searcher.baseline, with_proof=True)
    assert placebos == [(offset,)]


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


def test_a_search_without_some_effects_does_not_end_with_one_of_them() -> None:
    drifted = with_effect(STATION, catalogue()["flow_distortion"], "station", DISTORTION)
    searcher = searcher_of(
        prepare(recorded(drifted, 76, swing=1.0)), baseline(), catalogue(), {}
    )
    null = searcher.whitener(searcher.bank.without)
    terms = [
        Term(catalogue()["calibration_drift"], "cup", {"gain": 1.02}),
        Term(catalogue()["vane_eccentricity"], "vane", {"sine": 1.0, "cosine": 1.0}),
    ]
    both = fit(null, STATION, terms, searcher.bank.without)
    one = merged(searcher, null, both, [], frozenset())
    assert [t.effect.name for t in one.terms] == ["flow_distortion"]
    assert merged(searcher, null, both, [], frozenset({"flow_distortion"})) is both
    # A single effect has nothing to merge with.
    assert merged(searcher, null, one, [], frozenset()) is one


@pytest.mark.parametrize(("begin", "end"), [(150.3, None), (100.7, 290.1)])
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


def test_a_pair_can_be_judged_by_the_effect_that_led() -> None:
    slow = with_effect(STATION, catalogue()["rotor_inertia"], "cup", {"inertia_factor": 2.5})
    both = with_effect(slow, catalogue()["vane_offset"], "vane", {"offset": 6.0})
    searcher = searcher_of(prepare(recorded(both, 93)), baseline(), catalogue(), {})
    pair = name(searcher, first_round(searcher))
    assert {t.effect.name for t in pair.fit.terms} == {"rotor_inertia", "vane_offset"}
    alone = named_alone(searcher, pair)
    assert alone is not None and pair.alone is not None
    assert [t.key for t in alone.fit.terms] == [t.key for t in pair.alone.terms]
    assert 0.0 < alone.gain < pair.gain
    assert named_alone(searcher, alone) is None


def test_what_is_left_before_an_effect_began_must_stand_out_by_itself() -> None:
    drifting = catalogue()["calibration_drift"]
    early = with_effect(STATION, drifting, "cup", {"gain": 1.1}, (0.0, 50.0))
    searcher = searcher_of(prepare(recorded(early, 94)), baseline(), catalogue(), {})
    passing = named(searcher, drift((200.0, None)))
    always = replace(passing, fit=replace(passing.fit, terms=(drift(),)))
    bank = region_bank(passing.adequate, searcher.bank.without)
    left = [
        remainder_of(one, bank, searcher.comparison, baseline()).score for one in (passing, always)
    ]
    assert left[1] > 0.5
    assert left[0] == pytest.approx(REMAINDER_SCORE * left[1])


def test_what_a_signal_shows_that_an_effect_hardly_changes_is_not_held_against_it() -> None:
    turned = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": 3.0})
    both = with_effect(turned, catalogue()["calibration_drift"], "cup", {"gain": 1.03})
    searcher = searcher_of(prepare(recorded(both, 95)), baseline(), catalogue(), {})
    bank = region_bank(searcher.whitener(searcher.bank.without), searcher.bank.without)
    # A gain reaches the cup alone, whatever the vane beside it shows.
    turn = Term(catalogue()["vane_offset"], "vane", {"offset": 1.0})
    for term, held in ((drift(), False), (turn, True)):
        remainder = remainder_of(named(searcher, term), bank, searcher.comparison, baseline())
        assert (remainder.score > 1.0) is held


@pytest.mark.parametrize("carried", [True, False])
def test_what_is_left_on_the_vane_that_carries_a_propeller_speaks_against_its_name(
    searcher: Searcher, carried: bool
) -> None:
    propeller = {
        "name": "propeller", "kind": "propeller", "pulses": {"topic": "/propeller/pulses"},
        "pulses_per_revolution": 6, "calibration_distance": 0.05, "distance_constant": 2.7,
        "mounted_on": "vane" if carried else "", "axis": None if carried else (-1.0, 0.0, 0.0),
    }  # fmt: skip
    station = Station.model_validate({"instruments": [propeller, STATION.instrument("vane")]})
    channels = tuple(
        replace(channel, name=f"{instrument}/{channel.kind}", instrument=instrument)
        for channel, instrument in zip(
            searcher.comparison.channels, ("propeller", "vane"), strict=True
        )
    )
    seen = replace(searcher.comparison, station=station, channels=channels)
    carriers = {"vane/vane_angle"} if carried else set()
    assert carriers_of(seen, {"propeller/rotor_rate"}) == carriers
    # What is left on the propeller is nothing against a name of its vane.
    assert carriers_of(seen, {"vane/vane_angle"}) == set()


class _Loud(RegionBank):
    """One region whose score is given."""

    def scores(self, vector: FloatArray) -> FloatArray:
        return np.array([300.0])


@pytest.mark.parametrize(
    ("effect", "kind", "times"),
    [
        ("wake_shadow", "frequency", STIRRED_TIMES),
        ("wake_shadow", "speed", 1.0),
        ("calibration_drift", "frequency", 1.0),
    ],
)
def test_a_wake_may_leave_some_more_eddies_than_the_simulation_knows(
    searcher: Searcher, effect: str, kind: str, times: float
) -> None:
    comparison = searcher.comparison
    bearing = float(np.degrees(np.median(comparison.wind_from)))
    values = {"bearing_from": bearing, "depth": 0.3, "width": 20.0, "flank": 0.0}
    values = values if effect == "wake_shadow" else {"gain": 1.1}
    naming = named(searcher, Term(catalogue()[effect], "cup", values))
    region = Region(comparison.channels[0].name, kind, 0.1, 0.5, "0.1 to 0.5 Hz")
    loud = _Loud((region,), np.zeros((0, 0)), (), (), np.zeros(0))
    left = remainder_of(naming, loud, comparison, baseline())
    assert left.score == pytest.approx(300.0 / REMAINDER_SCORES[kind] / times)


@pytest.mark.parametrize(
    ("effect", "label", "times"),
    [
        ("missed_pulses", "beat of the pulses with the wind, twice per turn", STIRRED_TIMES),
        ("missed_pulses", "unevenness of the slots once per turn", 1.0),
        ("calibration_drift", "beat of the pulses with the wind, twice per turn", 1.0),
    ],
)
def test_which_pulse_of_a_turn_a_dead_time_takes_is_not_held_against_it(
    searcher: Searcher, effect: str, label: str, times: float
) -> None:
    assert label in STATISTICS["rotor_rate"]
    values = {"dead_time": 0.02, "loss_probability": 0.1, "gain": 1.1}
    naming = named(searcher, Term(catalogue()[effect], "cup", values))
    region = Region(searcher.comparison.channels[0].name, "statistic", 0.0, 1.0, label)
    loud = _Loud((region,), np.zeros((0, 0)), (), (), np.zeros(0))
    left = remainder_of(naming, loud, searcher.comparison, baseline())
    assert left.score == pytest.approx(300.0 / REMAINDER_SCORES["statistic"] / times)


def test_what_a_vane_shows_beside_the_propeller_that_it_carries_has_to_stand_out_by_itself(
    searcher: Searcher,
) -> None:
    carried = {
        "name": "cup", "kind": "propeller", "pulses": {"topic": "/cup/pulses"},
        "pulses_per_revolution": 6, "calibration_distance": 0.05, "distance_constant": 2.7,
        "mounted_on": "vane",
    }  # fmt: skip
    station = Station.model_validate({"instruments": [carried, STATION.instrument("vane")]})
    seen = replace(searcher.comparison, station=station)
    naming = named(searcher, drift())
    left = [
        remainder_of(
            naming,
            _Loud((Region(name, "time", 0.0, 90.0, "0 to 90 s"),), np.zeros((0, 0)), (), (),
                  np.zeros(0)),
            seen, baseline(),
        ).score
        for name in ("cup/rotor_rate", "vane/vane_angle")
    ]  # fmt: skip
    assert left[0] == pytest.approx(300.0 / REMAINDER_SCORES["time"])
    assert left[1] == pytest.approx(REMAINDER_SCORE * left[0])


def test_what_was_known_before_stays_if_it_fits_clearly_better() -> None:
    slow = with_effect(STATION, catalogue()["rotor_inertia"], "cup", {"inertia_factor": 3.0})
    searcher = searcher_of(prepare(recorded(slow, 96)), baseline(), catalogue(), {})
    heavy = Term(catalogue()["rotor_inertia"], "cup", {"inertia_factor": 3.0})
    right, wrong = named(searcher, heavy), named(searcher, drift())
    kept = kept_if_better(searcher, right, wrong)
    assert [t.key for t in kept.fit.terms] == [heavy.key]
    # Nor does what is no better come back.
    assert kept_if_better(searcher, wrong, right) is right
    assert kept_if_better(searcher, right, right) is right
    # The second search may find nothing.
    nothing = replace(right, fit=no_terms(right.whitener, searcher), gain=0.0)
    kept = kept_if_better(searcher, right, nothing)
    assert [t.key for t in kept.fit.terms] == [heavy.key]
    assert kept_if_better(searcher, wrong, nothing) is nothing
