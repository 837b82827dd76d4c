"""Effects seen at sizes that matter: larger probes, wide differences, what readings give away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, diagnosed, recorded

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect, with_keys
from wind_sensors.diagnosis.explaining.acceptance import (
    SMALLEST_SIZE,
    SMALLEST_SURE,
    SURE_ALONE_GAIN,
    brought,
    gained_alike,
    is_plausible,
    least_size,
    overlap,
)
from wind_sensors.diagnosis.explaining.bounds import without_spare
from wind_sensors.diagnosis.explaining.explanation import (
    Judged,
    Naming,
    empty_fit,
    judged,
    penalised_deviance,
)
from wind_sensors.diagnosis.explaining.fitting import Fit, covariance_of, fit
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.leading import (
    explaining_what_stands_out,
    leader_of,
    leading_alone,
)
from wind_sensors.diagnosis.explaining.moments import is_its_moment
from wind_sensors.diagnosis.explaining.screening import scores_of
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.signatures import LARGER
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import default_baseline
from wind_sensors.diagnosis.proving.contradictions import undo_each_other, varies
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Angles, Recording

SLOW = Station.model_validate(
    {
        **STATION.model_dump(mode="json", by_alias=True, exclude_none=True),
        "instruments": [
            {
                **entry.model_dump(mode="json", by_alias=True, exclude_none=True),
                **({"pulses_per_revolution": 1, "calibration_distance": 2.5}
                   if entry.name == "cup" else {}),
            }
            for entry in STATION.instruments
        ],
    }
)
"""One pulse for every 2.5 m of wind: three in a second."""


def searched(planted: Station, seed: int = 70) -> Searcher:
    recording = replace(recorded(planted, seed), station=SLOW)
    return searcher_of(prepare(recording), default_baseline(SLOW), catalogue(), {})


def with_offset(offset: float) -> Station:
    return with_effect(SLOW, catalogue()["calibration_offset"], "cup", {"offset": offset})


def test_a_larger_size_shows_what_the_scatter_of_few_pulses_hides() -> None:
    searcher = searched(with_offset(-0.4))
    null = searcher.whitener(searcher.bank.without)
    vector = null.of(searcher.bank.without)
    small = len(searcher.bank.templates)
    signatures = searcher.white_signatures(null)
    alone = scores_of(
        searcher.bank.templates,
        signatures[:small] @ signatures[:small].T,
        signatures[:small] @ vector,
    )
    key = ("calibration_offset", "cup")
    gain = {
        name: next(s for s in scores if (s.effect, s.instrument) == key)
        for name, scores in (("small", alone), ("any", searcher.scores(null, vector)))
    }
    assert gain["any"].gain > 1.5 * gain["small"].gain
    assert gain["any"].template.multiple in LARGER
    # Amplitudes stay in units of the effect's own template.
    estimate = gain["any"].amplitude * gain["any"].template.effect.templates[0]["offset"]
    assert estimate == pytest.approx(-0.4, rel=0.5)


def test_what_is_small_but_sure_keeps_its_name() -> None:
    # Left out for its size, uneven slots would be called a damaged cup.
    found = diagnosed("encoder_slot_error", "cup", scatter=0.005, once_per_turn=0.006)
    (finding,) = [f for f in found.findings if f.proof is not None]
    assert finding.term.effect.name == "encoder_slot_error"
    assert SMALLEST_SURE < finding.term.relative_size < SMALLEST_SIZE
    assert finding.gain > SURE_ALONE_GAIN


@pytest.mark.parametrize(
    ("gain", "begins", "plausible_size"),
    [(0.995, 0.0, True), (0.995, 60.0, False), (0.999, 0.0, False)],
)
def test_only_what_always_holds_may_be_small(
    gain: float, begins: float, plausible_size: bool
) -> None:
    interval = (begins, None) if begins else ALWAYS
    term = Term(catalogue()["calibration_drift"], "cup", {"gain": gain}, interval)
    assert is_plausible(term, least_size((term,))) is plausible_size
    assert not is_plausible(term, least_size((term, term)))


def test_chance_on_the_borders_of_bins_is_no_information() -> None:
    searcher = searched(with_offset(-0.4))
    null = searcher.whitener(searcher.bank.without)
    term = Term(catalogue()["calibration_offset"], "cup", {"offset": -0.4})
    found = fit(null, SLOW, [term], searcher.bank.without)
    errors = []
    for seed in range(71, 77):
        other = searched(with_offset(-0.4), seed)
        null_of = other.whitener(other.bank.without)
        estimate = fit(null_of, SLOW, [term], other.bank.without).terms[0].values["offset"]
        errors.append(estimate + 0.4)
    wide = float(np.sqrt(covariance_of(null, SLOW, found)[0, 0]))
    assert wide > float(np.sqrt(found.covariance[0, 0]))
    # Six estimates from other days: their scatter is what the deviation promises, within chance.
    assert 0.3 < float(np.sqrt(np.mean(np.square(errors)))) / wide < 3.0


def test_readings_that_repeat_tell_the_step_and_since_when() -> None:
    coarse = {"step": 7.5, "origin": 2.0}
    effect = catalogue()["quantisation"]
    station = with_effect(STATION, effect, "vane", coarse, (160.0, 310.0))
    (term,) = guesses_of(prepare(recorded(station, 71)), STATION)[("quantisation", "vane")]
    assert term.values["step"] == pytest.approx(7.5, abs=0.01)
    assert np.mod(term.values["origin"], 7.5) == pytest.approx(2.0, abs=0.01)
    assert term.interval[0] == pytest.approx(160.0, abs=3.0)
    assert term.interval[1] == pytest.approx(310.0, abs=3.0)
    healthy = guesses_of(prepare(recorded(STATION, 71)), STATION)
    assert ("quantisation", "vane") not in healthy


@pytest.mark.parametrize("seed", range(70, 80))
def test_a_vane_that_sticks_stands_on_no_steps(seed: int) -> None:
    sticking = {"friction_speed": 3.5}
    station = with_effect(STATION, catalogue()["vane_friction"], "vane", sticking)
    guesses = guesses_of(prepare(recorded(station, seed)), STATION)
    assert ("quantisation", "vane") not in guesses


def test_few_fine_readings_hide_no_coarse_ones() -> None:
    """A coarse part so long that most readings repeat, and the fine ones beside it do not."""
    effect = catalogue()["quantisation"]
    station = with_effect(STATION, effect, "vane", {"step": 8.0, "origin": 0.0}, (60.0, None))
    (term,) = guesses_of(prepare(recorded(station, 76)), STATION)[("quantisation", "vane")]
    assert term.values["step"] == pytest.approx(8.0, abs=0.01)
    assert term.interval[0] == pytest.approx(60.0, abs=3.0)


def _read(angle: np.ndarray, seed: int) -> Recording:
    """A recording of the mast whose vane reads these angles [rad]."""
    recording = recorded(STATION, seed)
    vane = recording.angles["vane"]
    return replace(recording, angles={"vane": Angles(vane.time, angle)})


def test_readings_that_repeat_here_and_there_are_not_coarse() -> None:
    angle = recorded(STATION, 71).angles["vane"].angle.copy()
    angle[::5] = np.resize(np.radians([10.0, 20.0, 30.0, 40.0]), angle[::5].size)
    assert ("quantisation", "vane") not in guesses_of(prepare(_read(angle, 71)), STATION)


def test_a_wiper_that_floats_in_a_gap_interrupts_no_steps() -> None:
    angle = recorded(STATION, 71, swing=0.8).angles["vane"].angle
    coarse = np.radians(6.0) * np.round(angle / np.radians(6.0))
    gap = np.abs(np.angle(np.exp(1j * (angle - np.median(angle))))) < np.radians(5.0)
    drawn = np.random.default_rng(1).uniform(-np.pi, np.pi, angle.size)
    seen = prepare(_read(np.where(gap, drawn, coarse), 71))
    (term,) = guesses_of(seen, STATION)[("quantisation", "vane")]
    assert term.values["step"] == pytest.approx(6.0, abs=0.01)
    assert term.interval == ALWAYS


def test_coarse_steps_are_not_tried_on_readings_that_have_none() -> None:
    station = with_effect(STATION, catalogue()["vane_friction"], "vane", {"friction_speed": 3.0})
    comparison = prepare(recorded(station, 72))
    guesses = guesses_of(comparison, STATION)
    searcher = searcher_of(comparison, default_baseline(STATION), catalogue(), guesses)
    null = searcher.whitener(searcher.bank.without)
    vector = null.of(searcher.bank.without)
    scores = searcher.scores(null, vector)
    tried = [starts[0].key for starts in searcher.single_candidates(null, vector, len(scores))]
    assert ("vane_friction", "vane") in tried
    assert ("quantisation", "vane") in {(s.effect, s.instrument) for s in scores}
    assert ("quantisation", "vane") not in tried


def test_the_step_that_readings_tell_is_kept() -> None:
    searcher = searched(SLOW)
    null = searcher.whitener(searcher.bank.without)
    coarse = Term(catalogue()["quantisation"], "vane", {"step": 6.0, "origin": 1.5})
    assert coarse.is_told
    assert fit(null, SLOW, [coarse], searcher.bank.without).terms[0].values == coarse.values


def test_coarse_readings_hide_no_vane_that_sticks() -> None:
    effects = catalogue()
    station = with_effect(STATION, effects["vane_friction"], "vane", {"friction_speed": 2.5})
    coarse = {"step": 6.0, "origin": 1.5}
    station = with_effect(station, effects["quantisation"], "vane", coarse)
    found = diagnose(recorded(station, 73), baseline())
    assert found.verdict == "named"
    first, second = found.findings
    assert first.term.key == ("quantisation", "vane")
    assert second.term.key == ("vane_friction", "vane")
    step = first.parameters["step"]
    assert step.low < 6.0 < step.high < 6.6


@pytest.mark.parametrize(("interval", "same"), [((158.0, 204.0), True), ((40.0, 90.0), False)])
def test_what_passes_while_another_effect_shows_is_its_form(
    interval: tuple[float, float], same: bool
) -> None:
    searcher = searched(SLOW)
    turned = Term(catalogue()["vane_offset"], "vane", {"offset": 20.0}, (160.0, 200.0))
    null = searcher.whitener(searcher.bank.without)
    current = fit(null, SLOW, [turned], searcher.bank.without, iterations=1)
    further = Term(catalogue()["vane_eccentricity"], "vane", {"sine": 5.0, "cosine": 0.0}, interval)
    assert is_its_moment(searcher, current, further) is same


def test_the_form_of_what_acts_for_a_while_says_nothing_of_the_rest() -> None:
    searcher = searched(SLOW)
    null = searcher.whitener(searcher.bank.without)
    effects = catalogue()
    turned = Term(effects["vane_offset"], "vane", {"offset": 20.0}, (100.0, 200.0))
    bent = Term(effects["vane_eccentricity"], "vane", {"sine": 4.0, "cosine": 0.0})
    shares = []
    for first in (turned, replace(turned, interval=ALWAYS)):
        one = fit(null, SLOW, [first], searcher.bank.without, iterations=0)
        two = fit(null, SLOW, [first, bent], searcher.bank.without, iterations=0)
        shares.append(overlap(searcher, one, two))
    # A quarter of the record, with the turns that the wind happens to make in it.
    assert 0.1 < shares[0] < 0.6
    assert shares[1] > 0.99


def test_exchanged_wires_are_there_or_not() -> None:
    found = diagnosed("sensor_swap", "vane", reversed=1.0)
    assert found.verdict == "named"
    assert [f.term.key for f in found.findings] == [("sensor_swap", "vane")]
    assert found.findings[0].term.values == {"reversed": 1.0}
    assert found.findings[0].term.interval == ALWAYS


@pytest.mark.parametrize(("days", "share"), [(2, 1.0), (3, 1.0), (6, 0.5), (12, 0.25)])
def test_the_fewer_days_the_more_other_instruments_count(days: int, share: float) -> None:
    loud: Baseline = replace(
        default_baseline(STATION),
        recordings=tuple(f"day-{k}" for k in range(days)),
        loudest={"vane": 80.0, "cup": 5.0},
    )
    assert loud.loudness("vane") == 80.0
    assert loud.loudness("cup") == loud.loudness("station") == share * 80.0
    assert default_baseline(STATION).loudness("cup") == 0.0


@pytest.mark.parametrize(("gain", "opposed"), [(1.1, False), (0.92, True)])
def test_effects_that_take_each_other_back_explain_nothing(gain: float, opposed: bool) -> None:
    searcher = searcher_of(prepare(recorded(STATION, 72)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    # At 7 m/s eight per cent less of it and 0.55 m/s more are much the same.
    terms = [
        Term(catalogue()["calibration_offset"], "cup", {"offset": 0.55}),
        Term(catalogue()["calibration_drift"], "cup", {"gain": gain}),
    ]
    both = fit(null, STATION, terms, None, iterations=0)
    naming = Naming(both, null, null, null.of(searcher.bank.without), 0.0)
    assert undo_each_other(naming, STATION) is opposed


@pytest.mark.parametrize(
    ("clock", "size", "opposed"),
    [("timestamp_latency", {"latency": -0.4}, True), ("clock_drift", {"drift": -2700.0}, False)],
)
def test_a_drifting_clock_makes_good_a_filters_delay_at_one_time_only(
    clock: str, size: dict[str, float], opposed: bool
) -> None:
    searcher = searcher_of(prepare(recorded(STATION, 72)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    # In the mean of the five minutes each shifts the signal by four tenths of a second.
    terms = [
        Term(catalogue()["low_pass_filter"], "vane", {"time_constant": 0.4}),
        Term(catalogue()[clock], "vane", size),
    ]
    both = fit(null, STATION, terms, None, iterations=0)
    naming = Naming(both, null, null, null.of(searcher.bank.without), 0.0)
    assert undo_each_other(naming, STATION) is opposed


def test_bounces_that_are_seen_may_make_up_for_a_slow_rotor() -> None:
    searcher = searcher_of(prepare(recorded(STATION, 72)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    bounce = {"bounce_probability": 0.06, "bounce_delay": 0.0005}
    terms = [
        Term(catalogue()["extra_pulses"], "cup", bounce),
        Term(catalogue()["calibration_drift"], "cup", {"gain": 0.94}),
    ]
    both = fit(null, STATION, terms, None, iterations=0)
    naming = Naming(both, null, null, null.of(searcher.bank.without), 0.0)
    assert not undo_each_other(naming, STATION)


@pytest.mark.parametrize(
    ("planted", "values", "growing"),
    [("timestamp_latency", {"latency": 0.5}, False), ("clock_drift", {"drift": 2500.0}, True)],
)
def test_a_delay_that_grows_is_no_latency(
    planted: str, values: dict[str, float], growing: bool
) -> None:
    station = with_effect(STATION, catalogue()[planted], "vane", values)
    recording = replace(recorded(station, 72), station=STATION)
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    late = Term(catalogue()["timestamp_latency"], "vane", {"latency": 0.5})
    named = fit(null, STATION, [late], searcher.bank.without)
    adequate = searcher.whitener(named.simulated, named)
    nothing = null.of(searcher.bank.without)
    gain = float(nothing @ nothing) - named.cost
    assert gain > 40.0
    assert varies(Naming(named, null, adequate, nothing, gain), STATION) is growing


def test_of_explanations_as_good_the_one_of_what_stands_out_leads() -> None:
    station = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": 4.0})
    recording = replace(recorded(station, 72), station=STATION)
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    nothing = empty_fit(null, searcher)

    def explained(effect: str, instrument: str, **values: float) -> Judged:
        term = Term(catalogue()[effect], instrument, values)
        fitted = fit(null, STATION, [term], searcher.bank.without, iterations=0)
        return Judged(fitted, 0.0, lambda: null)

    slow = explained("calibration_offset", "cup", offset=-0.1)
    turned = explained("vane_offset", "vane", offset=4.0)
    nearly, clearly = [(24.0, slow), (20.0, turned)], [(40.0, slow), (20.0, turned)]
    assert explaining_what_stands_out(searcher, null, nothing, nearly) == nearly[1:]
    assert explaining_what_stands_out(searcher, null, nothing, clearly) == clearly
    between = [(30.0, slow), (20.0, turned)]
    assert explaining_what_stands_out(searcher, null, nothing, between) == between
    assert explaining_what_stands_out(searcher, null, nothing, between, 12.0) == between[1:]


@pytest.mark.parametrize(
    ("effect", "instrument", "values", "share", "leads"),
    [
        ("vane_offset", "vane", {"offset": 4.0}, 0.8, True),
        ("vane_offset", "vane", {"offset": 4.0}, 0.7, False),
        ("calibration_offset", "cup", {"offset": 0.5}, 0.8, False),
    ],
)
def test_what_explains_a_region_that_chance_hardly_makes_needs_less(
    monkeypatch: pytest.MonkeyPatch,
    effect: str,
    instrument: str,
    values: dict[str, float],
    share: float,
    leads: bool,
) -> None:
    both = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": 4.0})
    both = with_effect(both, catalogue()["calibration_offset"], "cup", {"offset": 0.5})
    searcher = compared(both)
    null = searcher.whitener(searcher.bank.without)
    nothing = empty_fit(null, searcher)
    # The turned vane is the clearer of the two.
    term = Term(catalogue()[effect], instrument, values)
    (one,) = judged(searcher, [fit(null, STATION, [term], searcher.bank.without)])
    brings = brought(searcher, one, nothing, penalised_deviance(nothing, null))
    assert brings > 0.0
    monkeypatch.setattr(
        "wind_sensors.diagnosis.explaining.leading.needed_gain", lambda *_: brings / share
    )
    assert (leader_of(searcher, null, nothing, [one]) is one) is leads


def compared(planted: Station) -> Searcher:
    recording = replace(recorded(planted, 72), station=STATION)
    return searcher_of(prepare(recording), baseline(), catalogue(), {})


def test_the_form_of_an_effect_counts_in_the_kind_of_comparison_in_which_it_is_seen() -> None:
    slots = {"scatter": 0.05, "once_per_turn": 0.1}
    searcher = compared(with_effect(STATION, catalogue()["encoder_slot_error"], "cup", slots))
    null = searcher.whitener(searcher.bank.without)
    uneven = Term(catalogue()["encoder_slot_error"], "cup", slots)
    offset = Term(catalogue()["calibration_offset"], "cup", {"offset": -0.3})
    drift = Term(catalogue()["calibration_drift"], "cup", {"gain": 0.95})

    def seen(*terms: Term) -> Fit:
        return fit(null, STATION, list(terms), searcher.bank.without, iterations=0)

    nothing = float(np.sum(null.of(searcher.bank.without) ** 2))
    gained = nothing - seen(uneven).cost
    # What slots gain, they gain in the pulse intervals, which no offset changes.
    assert gained > 1000.0
    assert gained_alike(searcher, null, seen(uneven), seen(uneven, offset)) < 0.1 * gained
    wide = replace(uneven, values={"scatter": 0.08, "once_per_turn": 0.1})
    assert gained_alike(searcher, null, seen(uneven), seen(wide)) > 0.9 * gained
    slower = {"offset": -0.5}
    both = compared(with_effect(STATION, catalogue()["calibration_offset"], "cup", slower))
    null = both.whitener(both.bank.without)
    far = Term(catalogue()["calibration_offset"], "cup", slower)
    one = fit(null, STATION, [far], both.bank.without, iterations=0)
    two = fit(null, STATION, [far, drift], both.bank.without, iterations=0)
    gained = float(np.sum(null.of(both.bank.without) ** 2)) - one.cost
    assert gained_alike(both, null, one, two) > 0.5 * gained


def test_a_single_effect_that_is_left_of_two_has_to_explain_what_stands_out() -> None:
    offset = {"offset": 4.0}
    searcher = compared(with_effect(STATION, catalogue()["vane_offset"], "vane", offset))
    null = searcher.whitener(searcher.bank.without)

    def alone(effect: str, instrument: str, **values: float) -> Fit:
        term = Term(catalogue()[effect], instrument, values)
        return fit(null, STATION, [term], searcher.bank.without)

    turned = alone("vane_offset", "vane", offset=4.0)
    slow = alone("calibration_offset", "cup", offset=-0.1)
    assert leading_alone(searcher, slow, turned.terms).terms[0].key == turned.terms[0].key
    assert leading_alone(searcher, turned, slow.terms).terms[0].key == turned.terms[0].key
    assert leading_alone(searcher, turned, turned.terms) is turned


@pytest.mark.parametrize(
    ("place", "kept"),
    [
        ((0.3, -0.1, 2.5), {"dz"}),
        ((1.5, -0.1, 2.5), {"dx", "dz"}),
        ((0.3, -0.1, 0.5), {"dx", "dy", "dz"}),
    ],
)
def test_what_a_recording_does_not_ask_for_is_left_as_stated(
    place: tuple[float, float, float], kept: set[str]
) -> None:
    values = dict(zip(("dx", "dy", "dz"), place, strict=True))
    lever = Term(catalogue()["lever_arm"], "platform", values)
    offset = Term(catalogue()["vane_offset"], "vane", {"offset": 3.0})
    nothing = Simulated({}, {}, {}, {}, np.zeros(0, dtype=np.bool_))
    found = Fit(
        (offset, lever), 0.0, np.zeros(1), nothing, np.diag([0.01, *[0.3**2] * 3]), 0, 4
    )
    _, left = without_spare(found, 4.0)
    assert {name for name, value in left.values.items() if value != 0.0} == kept
    assert left.held == set(values) - kept


def test_a_dead_time_is_reported_without_losses_that_nobody_sees() -> None:
    dead = {"dead_time": 0.0075, "loss_probability": 0.0, "loss_growth": 0.0}
    station = with_effect(STATION, catalogue()["missed_pulses"], "cup", dead)
    (finding,) = diagnose(recorded(station, 82), baseline(), with_proof=False).findings
    assert set(finding.parameters) == {"dead_time"}
    assert finding.term.values["loss_probability"] == 0.0


def test_a_heavy_vane_that_is_damped_too_is_both() -> None:
    """At the resonance the one takes back most of what the other does there."""
    swinging = {"inertia_factor": 2.2, "damping_factor": 2.5}
    found = diagnose(recorded(with_keys(STATION, "vane", swinging), 73), baseline())
    assert found.verdict == "named"
    sizes = {f.term.effect.name: f.term.values for f in found.findings}
    assert set(sizes) == {"vane_inertia", "vane_damping"}
    assert sizes["vane_inertia"]["inertia_factor"] == pytest.approx(2.2, rel=0.15)
    assert sizes["vane_damping"]["damping_factor"] == pytest.approx(2.5, rel=0.15)
