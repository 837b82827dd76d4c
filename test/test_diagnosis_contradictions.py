"""Names that their own sizes speak against, and fits that stop short of the right size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect, with_keys
from wind_sensors.diagnosis.explaining import leading, rounds
from wind_sensors.diagnosis.explaining.beside import Beside
from wind_sensors.diagnosis.explaining.explanation import (
    Judged,
    Naming,
    empty_fit,
    judged,
    penalised_deviance,
)
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.leading import held_throughout
from wind_sensors.diagnosis.explaining.moves import looked_around
from wind_sensors.diagnosis.explaining.rounds import best_beside
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term
from wind_sensors.diagnosis.healthy.noise_level import Excess
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.proving import contradictions
from wind_sensors.diagnosis.proving.contradictions import (
    drop_by_own_delays,
    goes_with_speed,
    is_discordant,
    is_otherwise_in_eddies,
    varies,
)
from wind_sensors.diagnosis.proving.remainder import Remainder
from wind_sensors.diagnosis.proving.rules import Case, Verdict, first_look
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.signals import Angles, Pulses


def searched(
    effect: str, instrument: str, values: dict[str, float], interval: Interval = ALWAYS
) -> tuple[Searcher, Whitener]:
    """The search on a recording that holds an effect, and its null."""
    station = with_effect(STATION, catalogue()[effect], instrument, values, interval)
    recording = replace(recorded(station, 72), station=STATION)
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    return searcher, searcher.whitener(searcher.bank.without)


def named(searcher: Searcher, null: Whitener, term: Term) -> Naming:
    fitted = fit(null, STATION, [term], searcher.bank.without)
    adequate = searcher.whitener(fitted.simulated, fitted)
    nothing = null.of(searcher.bank.without)
    return Naming(fitted, null, adequate, nothing, float(nothing @ nothing) - fitted.cost)


@pytest.mark.parametrize(
    ("effect", "instrument", "values", "discordant"),
    [
        ("air_density", "station", {"density_ratio": 0.5}, False),
        ("rotor_inertia", "cup", {"inertia_factor": 2.5}, True),
    ],
)
def test_thin_air_shows_on_the_vane_as_well(
    effect: str, instrument: str, values: dict[str, float], discordant: bool
) -> None:
    searcher, null = searched(effect, instrument, values)
    thin = Term(catalogue()["air_density"], "station", {"density_ratio": 0.6})
    naming = named(searcher, null, thin)
    # By the rotor alone it is thin air either way.
    assert naming.gain > 40.0
    assert naming.fit.terms[0].values["density_ratio"] < 0.75
    assert is_discordant(naming, STATION) is discordant


@pytest.mark.parametrize("off_centre", [False, True])
def test_what_gravity_does_to_a_vane_falls_with_the_square_of_the_speed(off_centre: bool) -> None:
    """An eccentric disc errs by as much in strong wind, a weight on a leaning mast does not."""
    weight = {"imbalance": 15.0, "tilt_deg": (1.5, 2.0)}
    disc = {"eccentricity_deg": 6.0, "eccentricity_phase_deg": 40.0}
    wrong = with_keys(STATION, "vane", disc if off_centre else weight)
    searcher = searcher_of(prepare(recorded(wrong, 73)), baseline(), catalogue(), {})
    pulled = {"imbalance": 15.0, "tilt_x": 0.5, "tilt_y": 0.7}
    term = Term(catalogue()["vane_imbalance"], "vane", pulled)
    naming = named(searcher, searcher.whitener(searcher.bank.without), term)
    assert naming.gain > 40.0
    assert goes_with_speed(naming, STATION) is off_centre


@pytest.mark.parametrize("with_speed", [False, True])
def test_an_offset_is_the_same_in_strong_wind(with_speed: bool) -> None:
    recording = recorded(STATION, 73)
    assert recording.reference is not None
    speed = np.hypot(*recording.reference.velocity[:, :2].T)
    pressure = uniform_filter1d((speed / speed.mean()) ** 2, 100)
    shift = np.radians(8.0) * (pressure if with_speed else 1.0)
    readings = recording.angles["vane"]
    turned = Angles(readings.time, np.angle(np.exp(1j * (readings.angle + shift))))
    shown = replace(recording, angles={"vane": turned})
    searcher = searcher_of(prepare(shown), baseline(), catalogue(), {})
    offset = Term(catalogue()["vane_offset"], "vane", {"offset": 8.0})
    naming = named(searcher, searcher.whitener(searcher.bank.without), offset)
    assert goes_with_speed(naming, STATION) is with_speed
    # A bearing has its own law of the speed, and so has what damps.
    for own in (
        Term(catalogue()["vane_friction"], "vane", {"friction_speed": 2.0}),
        Term(catalogue()["vane_damping"], "vane", {"damping_factor": 4.0, "viscous": 0.0}),
    ):
        assert not goes_with_speed(replace(naming, fit=replace(naming.fit, terms=(own,))), STATION)


@pytest.mark.parametrize("damping", [2.5, 1.0])
def test_what_damps_a_vane_that_sticks_is_found_in_the_noise_that_it_leaves(
    damping: float,
) -> None:
    sticking = {"friction_speed": 2.0, "damping_factor": damping}
    recording = replace(recorded(with_keys(STATION, "vane", sticking), 75), station=STATION)
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    stuck = Term(catalogue()["vane_friction"], "vane", {"friction_speed": 2.0})
    first = fit(searcher.whitener(searcher.bank.without), STATION, [stuck])
    found = best_beside(Beside(searcher, first, []), frozenset())
    if damping == 1.0:
        assert found is None
        return
    assert found is not None
    damped = found[0].fit.terms[-1]
    assert damped.key == ("vane_damping", "vane")
    assert damped.values["damping_factor"] == pytest.approx(damping, rel=0.2)


@pytest.mark.parametrize(
    ("effect", "values", "growing"),
    [("timestamp_latency", {"latency": 0.6}, False), ("clock_drift", {"drift": 3000.0}, True)],
)
def test_a_delay_that_grows_while_it_lasts_is_no_latency(
    effect: str, values: dict[str, float], growing: bool
) -> None:
    since = (120.0, None)
    planted = ALWAYS if growing else since
    searcher, null = searched(effect, "vane", values, planted)
    late = Term(catalogue()["timestamp_latency"], "vane", {"latency": 0.6}, since)
    naming = named(searcher, null, late)
    assert naming.gain > 40.0
    assert varies(naming, STATION) is growing
    # Beside a form that is not certain on the same signals, what varies may be that one's.
    heavy = Term(catalogue()["vane_inertia"], "vane", {"inertia_factor": 1.1})
    beside = replace(naming, fit=replace(naming.fit, terms=(*naming.fit.terms, heavy)))
    assert not varies(beside, STATION)
    # On other signals it is not.
    slow = Term(catalogue()["rotor_inertia"], "cup", {"inertia_factor": 1.1})
    apart = replace(naming, fit=replace(naming.fit, terms=(*naming.fit.terms, slow)))
    assert varies(apart, STATION) is growing


@pytest.mark.parametrize(
    ("effect", "values", "begun", "drifts"),
    [
        ("timestamp_latency", {"latency": 1.2}, (120.0, None), False),
        ("clock_drift", {"drift": 6000.0}, ALWAYS, True),
    ],
)
def test_long_delays_are_compared_part_by_part(
    effect: str, values: dict[str, float], begun: Interval, drifts: bool
) -> None:
    # Of delays that long a small change of size says nothing: quick eddies are out of step.
    searcher, null = searched(effect, "vane", values, begun)
    late = Term(catalogue()["timestamp_latency"], "vane", {"latency": 1.2}, (120.0, None))
    naming = named(searcher, null, late)
    assert naming.gain > 40.0
    each, steadily = drop_by_own_delays(naming, STATION, naming.fit.terms[0])
    assert (each > 0.3 * naming.gain) is drifts
    assert (steadily > 0.1 * naming.gain) is drifts
    assert varies(naming, STATION) is drifts


@pytest.mark.parametrize(
    ("effect", "p", "verdict"),
    [
        ("flow_distortion", 0.002, "unknown"),
        ("flow_distortion", 0.03, "named"),
        ("calibration_drift", 0.002, "named"),
    ],
)
def test_a_series_of_harmonics_must_leave_nothing(effect: str, p: float, verdict: Verdict) -> None:
    searcher, null = searched("calibration_drift", "cup", {"gain": 0.9})
    term = Term(catalogue()[effect], "cup", dict(catalogue()[effect].templates[0]))
    one = fit(null, STATION, [term], searcher.bank.without, iterations=0)
    naming = Naming(one, null, null, null.of(searcher.bank.without), 2000.0)
    little = Remainder(score=1.1, p=p, share=0.005)
    assert first_look(Case(naming, [], little, {}, 0.002, Excess())) == verdict


CERTAIN = (("calibration_drift", "cup"), ("vane_offset", "vane"))
UNCERTAIN = (("bearing_friction", "cup"), ("vane_damping", "vane"))


@pytest.mark.parametrize(
    ("effects", "share", "verdict"),
    [
        (UNCERTAIN[:1], 0.05, "unknown"),
        (UNCERTAIN, 0.05, "named"),
        (UNCERTAIN[:1], 0.01, "named"),
        (UNCERTAIN, 0.08, "unknown"),
        (CERTAIN, 0.05, "unknown"),
        (CERTAIN, 0.01, "named"),
    ],
)
def test_two_effects_each_in_its_own_form_may_leave_more_than_one(
    effects: tuple[tuple[str, str], ...], share: float, verdict: Verdict
) -> None:
    searcher, null = searched("calibration_drift", "cup", {"gain": 0.9})
    known = catalogue()
    terms = [Term(known[name], where, dict(known[name].templates[0])) for name, where in effects]
    fitted = fit(null, STATION, terms, searcher.bank.without, iterations=0)
    naming = Naming(fitted, null, null, null.of(searcher.bank.without), 2000.0)
    left = Remainder(score=1.5, p=0.002, share=share)
    assert first_look(Case(naming, [], left, {}, 0.002, Excess())) == verdict


@pytest.mark.parametrize("made_good", [False, True])
def test_a_filter_takes_from_the_power_of_eddies_what_it_takes_from_the_course(
    made_good: bool,
) -> None:
    values = {"time_constant": 1.0}
    filtered = with_effect(STATION, catalogue()["low_pass_filter"], "vane", values)
    recording = replace(recorded(filtered, 72, seconds=800.0), station=STATION)
    seen = recording.angles["vane"]
    # Another day's eddies, of which the filter lets none through, in the place of those lost.
    lost = (
        recorded(STATION, 73, seconds=800.0).angles["vane"].angle
        - recorded(filtered, 73, seconds=800.0).angles["vane"].angle
    )
    shown = np.angle(np.exp(1j * (seen.angle + (lost if made_good else 0.0))))
    recording = replace(recording, angles={"vane": Angles(seen.time, shown)})
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    term = Term(catalogue()["low_pass_filter"], "vane", values)
    null = searcher.whitener(searcher.bank.without)
    there = fit(null, STATION, [term], searcher.bank.without, iterations=0)
    adequate = searcher.whitener(there.simulated, there)
    naming = Naming(there, null, adequate, null.of(searcher.bank.without), 100.0)
    assert is_otherwise_in_eddies(naming, STATION) is made_good


@pytest.mark.parametrize(
    ("effect", "values", "asked"),
    [
        ("vane_inertia", {"inertia_factor": 2.0}, True),
        ("timestamp_latency", {"latency": 0.5}, False),
        ("vane_damping", {"damping_factor": 2.0, "viscous": 0.0}, False),
        ("vane_friction", {"friction_speed": 2.0}, False),
    ],
)
def test_what_jumps_when_it_likes_or_only_comes_late_may_differ_in_its_eddies(
    monkeypatch: pytest.MonkeyPatch, effect: str, values: dict[str, float], asked: bool
) -> None:
    searcher, null = searched(effect, "vane", values)
    there = fit(
        null, STATION, [Term(catalogue()[effect], "vane", values)], searcher.bank.without, 0
    )
    naming = Naming(there, null, null, null.of(searcher.bank.without), 100.0)
    monkeypatch.setattr(contradictions, "_drop_by_sizes_on", lambda *_: 50.0)
    assert is_otherwise_in_eddies(naming, STATION) is asked


def test_a_fit_leaves_a_hollow_that_small_steps_stay_in() -> None:
    searcher, null = searched("calibration_drift", "cup", {"gain": 0.9})
    short = Term(catalogue()["calibration_drift"], "cup", {"gain": 0.93})
    stopped = fit(null, STATION, [short], searcher.bank.without, iterations=0)
    found = looked_around(searcher, null, stopped)
    assert found.cost < stopped.cost - 10.0
    assert found.terms[0].values["gain"] == pytest.approx(0.9, abs=0.01)
    # What is where it belongs stays there.
    assert looked_around(searcher, null, found).terms == found.terms


@pytest.mark.parametrize("planted", [ALWAYS, (150.0, 300.0)])
def test_what_holds_throughout_is_not_said_to_pass(planted: Interval) -> None:
    searcher, null = searched("vane_offset", "vane", {"offset": 8.0}, planted)
    passing = Term(catalogue()["vane_offset"], "vane", {"offset": 8.0}, (150.0, 300.0))
    one = fit(null, STATION, [passing], searcher.bank.without)
    null = searcher.whitener(one.simulated)
    kept = held_throughout(searcher, Judged(one, penalised_deviance(one, null), lambda: null), None)
    assert kept.fit.terms[0].interval == planted
    assert empty_fit(null, searcher).cost > kept.fit.cost


def test_what_would_miss_the_eddies_of_the_whole_record_is_not_said_to_hold_throughout(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    searcher, null = searched("vane_friction", "vane", {"friction_speed": 2.0})
    passing = Term(
        catalogue()["vane_friction"], "vane", {"friction_speed": 2.0}, (150.0, None)
    )
    one = fit(null, STATION, [passing], searcher.bank.without)
    null = searcher.whitener(one.simulated)
    candidate = Judged(one, penalised_deviance(one, null), lambda: null)
    assert held_throughout(searcher, candidate, None).fit.terms[0].interval == ALWAYS
    monkeypatch.setattr(leading, "calms_too_much", lambda *_: True)
    assert held_throughout(searcher, candidate, None).fit.terms[0].interval == (150.0, None)


@pytest.mark.parametrize("planted", [ALWAYS, (150.0, None)])
def test_a_part_that_explains_less_than_the_whole_only_hides_where_eddies_are_missed(
    monkeypatch: pytest.MonkeyPatch, planted: Interval
) -> None:
    searcher, null = searched("vane_friction", "vane", {"friction_speed": 2.0}, planted)
    if planted == ALWAYS:
        # Nothing is missed in the eddies of a vane that always sticks; say that it were.
        monkeypatch.setattr(rounds, "calms_too_much", lambda *_: True)
    sticks = Term(catalogue()["vane_friction"], "vane", {"friction_speed": 2.0})
    always = judged(searcher, [fit(null, STATION, [sticks], searcher.bank.without)])
    parts = rounds._where_they_calm(searcher, empty_fit(null, searcher), always, None)
    assert [part.fit.terms[-1].interval for part in parts] == [planted] * (planted != ALWAYS)


@pytest.mark.parametrize("bursts", [True, False])
def test_a_radio_that_sends_beside_the_rotor_is_no_contact_that_bounces(bursts: bool) -> None:
    recording = recorded(STATION, 74)
    pulses = recording.pulses["cup"].time
    if bursts:
        sent = pulses[0] + np.arange(0, pulses[-1] - pulses[0], 60_000_000)
        false = sent[(sent - sent[0]) % 20_000_000_000 < 3_000_000_000]
    else:
        chance = np.random.default_rng(3)
        bounced = pulses[chance.random(pulses.size) < 0.05]
        false = bounced + chance.integers(500_000, 3_000_000, bounced.size)
    seen = Pulses(np.sort(np.concatenate((pulses, false))))
    found = diagnose(replace(recording, pulses={**recording.pulses, "cup": seen}), baseline())
    named = [f.term.effect.name for f in found.findings]
    if bursts:
        assert (found.verdict, named) == ("unknown", [])
        assert "come in bursts" in found.unexplained.description
    else:
        assert (found.verdict, named) == ("named", ["extra_pulses"])
