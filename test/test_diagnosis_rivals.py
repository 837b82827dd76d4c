"""What rivals a name, and which of two explanations stays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, drift, named, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.explanation import (
    Alternative,
    Naming,
)
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.moves import merged
from wind_sensors.diagnosis.explaining.naming import (
    name,
    named_alone,
    named_instead,
)
from wind_sensors.diagnosis.explaining.rounds import first_round
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.progress import Phases
from wind_sensors.diagnosis.proving import findings
from wind_sensors.diagnosis.proving.findings import equal_explanations
from wind_sensors.diagnosis.proving.judging import Judgement, judgement_of
from wind_sensors.diagnosis.regions import region_bank, strongest
from wind_sensors.diagnosis.verdict import first_claim
from wind_sensors.station.model import Station

DISTORTION = {
    "cosine_1": 0.08, "sine_1": -0.04, "cosine_2": 0.05, "sine_2": 0.05, "deflection": 1.0,
}


@pytest.fixture(scope="module")
def searcher() -> Searcher:
    return searcher_of(prepare(recorded(STATION, 71)), baseline(), catalogue(), {})


@pytest.mark.parametrize(
    ("effect", "values", "active", "behind", "equal"),
    [
        ("calibration_offset", {"offset": 0.2}, 1, 20.0, True),
        ("calibration_offset", {"offset": 0.2}, 2, 20.0, False),
        ("calibration_offset", {"offset": 0.2}, 2, 3.0, False),
        ("calibration_offset", {"offset": 0.2}, 2, 1.0, True),
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


@pytest.mark.parametrize(("behind", "equal"), [(3.0, False), (-1.0, True)])
def test_a_frame_that_leans_is_no_rival_of_an_axis_that_leans(
    searcher: Searcher, behind: float, equal: bool
) -> None:
    known = named(searcher, drift())
    axis, frame = (catalogue()[name] for name in ("axis_tilt", "frame_error"))
    tilted = replace(known.fit, terms=(Term(axis, "station", {"tilt_x": 8.0, "tilt_y": 0.0}),))
    turned = {"roll": 0.0, "pitch": 8.0, "velocity_turn": 1.0, "other_axes": 0.0}
    rival = Alternative(replace(known.fit, terms=(Term(frame, "platform", turned),)), behind)
    assert bool(equal_explanations(replace(known, fit=tilted, alternatives=(rival,)))) is equal


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
        whitener: Whitener,
        station: Station,
        terms: Sequence[Term],
        placebo: Sequence[Term],
        workers: int,
    ) -> None:
        placebos.append(placebo)

    monkeypatch.setattr(findings, "prove", kept)
    bank = region_bank(null, searcher.bank.without)
    before = strongest(null, bank, nothing, searcher.bank.without)
    findings.findings_of(naming, [], before, bank, searcher.baseline, with_proof=True)
    assert placebos == [(offset,)]


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


def _rivalled() -> tuple[Searcher, Naming]:
    """A rotor that reads less, explained by that; an offset fits nearly as well."""
    slow = with_effect(STATION, catalogue()["calibration_drift"], "cup", {"gain": 0.93})
    searcher = searcher_of(prepare(recorded(slow, 94)), baseline(), catalogue(), {})
    found = name(searcher, first_round(searcher))
    offset = Term(catalogue()["calibration_offset"], "cup", {"offset": -0.4})
    rival = fit(found.whitener, STATION, [offset], searcher.bank.without)
    further = Alternative(found.fit, 28.0)
    return searcher, replace(found, alternatives=(Alternative(rival, 6.0), further))


@pytest.mark.parametrize("contradicted", [True, False])
def test_a_rival_is_judged_where_the_signals_contradict_the_effect_that_led(
    contradicted: bool,
) -> None:
    searcher, led = _rivalled()
    assert [t.effect.name for t in led.fit.terms] == ["calibration_drift"]
    of_leader = judgement_of(searcher, led, baseline(), 1, Phases(None), False)
    asked: list[str] = []

    def judge(naming: Naming) -> Judgement:
        asked.append(naming.fit.terms[0].effect.name)
        if naming is led:
            return replace(of_leader, verdict="unknown", contradicted=contradicted)
        return replace(of_leader, naming=naming, verdict="named", contradicted=False)

    judged = first_claim(searcher, led, judge)
    if contradicted:
        assert asked == ["calibration_drift", "calibration_offset"]
        assert judged.naming.fit.terms[0].effect.name == "calibration_offset"
    else:
        assert asked == ["calibration_drift"]
        assert not judged.is_claim


def test_what_lost_against_the_first_is_as_far_behind_the_rival_in_its_place() -> None:
    searcher, led = _rivalled()
    instead = named_instead(searcher, led, led.alternatives[0])
    assert [t.effect.name for t in instead.fit.terms] == ["calibration_offset"]
    assert [a.behind for a in instead.alternatives] == [22.0]
    assert instead.gain < led.gain
