"""What pulses tell by themselves: dead times, bounces, losses, and what they rule out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, recorded
from hypothesis import assume, given
from hypothesis import strategies as st
from turned_disc import SLOTS, edges

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import (
    INTERVALS,
    _is_usual_longer,
    bursts_of_bounces,
    chance_of_intervals,
    interval_statistics,
)
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect, with_keys
from wind_sensors.diagnosis.explaining.acceptance import inexactness, only_makes_good, overlap
from wind_sensors.diagnosis.explaining.bounds import run_away, without_run_aways
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Pulses

FloatArray = npt.NDArray[np.float64]

LOST_BY_CHANCE = {"dead_time": 0.0, "loss_probability": 0.2, "loss_growth": 0.0}


@given(
    intervals=st.lists(st.sampled_from([0.1, 0.4, 0.5, 1.0, 1.1, 3.0]), min_size=2, max_size=40),
    limit=st.sampled_from([0.05, 0.45, 0.75, 1.05, 2.0, 5.0]),
)
def test_the_median_lies_on_the_side_of_most(intervals: list[float], limit: float) -> None:
    time = np.cumsum([0.0, *intervals])
    median = float(np.median(np.diff(time)))
    assume(abs(median - limit) > 1e-9)
    assert _is_usual_longer(time, 0, time.size - 1, limit) == (median > limit)


def test_of_very_many_edges_some_tell_as_much_as_all() -> None:
    rng = np.random.default_rng(5)
    slots, turn = 40, 0.02
    cup = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": slots})
    assert isinstance(cup, Cup)
    speed = 2.0 * np.pi * cup.calibration_distance / turn
    displaced = 0.1 * rng.standard_normal(slots)
    found = []
    for turns in (4_000, 12_000):  # read in full, and in part
        place = np.arange(turns * slots) + np.tile(displaced, turns)
        # Bounces do not slip the count of slots; lost edges may.
        bounced = place[rng.random(place.size) < 0.002] + 0.03
        time = np.sort(np.concatenate((place, bounced))) * turn / slots
        grid = Grid(0, 0.2, int(turns * turn / 0.2))
        calm = np.zeros(grid.n)
        edges = Pulses(np.rint(time * 1e9).astype(np.int64))
        found.append(interval_statistics(edges, cup, np.exp(1j * calm), calm + speed, grid))
    assert found[1][:3] == pytest.approx(found[0][:3], rel=0.05, abs=2e-4)
    assert found[0][1] > 0.001
    assert found[0][2] > 0.1


DEAD = {"dead_time": 0.0075, "loss_probability": 0.0, "loss_growth": 0.0}


def test_a_dead_time_is_read_off_beside_another_gain() -> None:
    """In a quarter of an hour; seven minutes leave the gain to whatever turns with the wind."""
    lossy = with_effect(STATION, catalogue()["missed_pulses"], "cup", DEAD)
    station = with_effect(lossy, catalogue()["calibration_drift"], "cup", {"gain": 1.05})
    found = diagnose(recorded(station, 82, seconds=900.0), baseline(), with_proof=False)
    named = {f.term.effect.name: f.term.values for f in found.findings}
    assert found.verdict == "named" and len(named) == 2
    assert named["missed_pulses"]["dead_time"] == pytest.approx(0.0075, rel=0.01)
    assert named["calibration_drift"]["gain"] == pytest.approx(1.05, abs=0.015)


@pytest.mark.parametrize("growth", [0.0, 2.0])
def test_losses_that_grow_with_the_rate_are_told_from_those_that_do_not(growth: float) -> None:
    values = {"dead_time": 0.0, "loss_probability": 0.05, "loss_growth": growth}
    station = with_effect(STATION, catalogue()["missed_pulses"], "cup", values)
    (finding,) = diagnose(recorded(station, 87), baseline()).findings
    assert finding.term.effect.name == "missed_pulses"
    assert finding.term.values["loss_growth"] == pytest.approx(growth, abs=0.6)
    # The mean wind tells how many are lost; at another speed the exponent's error comes in.
    lost = finding.term.values["loss_probability"] * (7.0 / 5.0) ** (
        finding.term.values["loss_growth"]
    )
    assert lost == pytest.approx(0.05 * (7.0 / 5.0) ** growth, rel=0.15)
    assert finding.proof is not None and finding.proof.excess_removed > 0.8


@pytest.mark.parametrize(
    ("effect", "values", "held"),
    [
        ("missed_pulses", DEAD, True),
        ("calibration_drift", {"gain": 0.85}, False),
        ("rotor_inertia", {"inertia_factor": 4.0}, False),
    ],
)
def test_only_a_counter_cuts_intervals_off(
    effect: str, values: dict[str, float], held: bool
) -> None:
    station = with_effect(STATION, catalogue()[effect], "cup", values)
    guesses = guesses_of(prepare(recorded(station, 83)), STATION)
    terms = guesses.get(("missed_pulses", "cup"), [])
    assert any(term.held for term in terms) is held


def test_what_the_recording_does_not_show_is_held_where_it_was() -> None:
    angular = catalogue()["angular_response"]
    stray = Term(angular, "cup", {"change": 1.95, "skewness": -1.1})
    assert run_away(stray) == {"change"}
    held = without_run_aways(stray)
    assert held is not None
    assert held.values == {"change": 0.0, "skewness": -1.1} and held.held == {"change"}
    assert without_run_aways(Term(angular, "cup", {"change": 1.95, "skewness": 2.0})) is None
    assert without_run_aways(Term(angular, "cup", {"change": 0.5, "skewness": 0.3})) is None
    # Ice without weight would be another effect.
    ice = catalogue()["icing"]
    values = {**ice.templates[0], "gain": 0.9, "inertia_factor": 1.0}
    assert without_run_aways(Term(ice, "cup", values, ALWAYS)) is None


@pytest.mark.parametrize(
    ("effect", "name", "value", "away"),
    [
        ("vane_damping", "damping_factor", 0.3, False),
        ("vane_damping", "damping_factor", 0.1, True),
        ("vane_damping", "damping_factor", 17.5, True),
        ("vane_inertia", "inertia_factor", 0.5, False),
        ("icing", "inertia_factor", 1.0, False),
        # A vane that swings round in a lull asks for a lean that no mast has.
        ("vane_imbalance", "tilt_y", 6.0, True),
        ("vane_imbalance", "tilt_y", -4.0, False),
    ],
)
def test_what_physics_allows_is_not_at_the_bounds_of_the_search(
    effect: str, name: str, value: float, away: bool
) -> None:
    values = {**catalogue()[effect].templates[0], name: value}
    assert (name in run_away(Term(catalogue()[effect], "vane", values))) is away


def test_oil_in_a_vane_s_bearing_is_told_from_a_fin_that_damps_more() -> None:
    oiled = with_keys(STATION, "vane", {"viscous_damping": 3.0})
    found = diagnose(recorded(oiled, 83, mean=4.5), baseline())
    (finding,) = found.findings
    assert finding.term.effect.name == "vane_damping"
    assert finding.term.values["viscous"] == 1.0
    assert finding.term.values["damping_factor"] == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize(("breakaway", "noisy"), [(1.0, False), (2.2, True)])
def test_a_bearing_that_sticks_leaves_noise_of_its_own(breakaway: float, noisy: bool) -> None:
    values = {"friction_speed": 1.5, "temperature_coefficient": 0.0, "breakaway": breakaway}
    assert Term(catalogue()["bearing_friction"], "cup", values).leaves_noise is noisy


@pytest.mark.parametrize(("begins", "ruled"), [(0.0, True), (200.0, False)])
def test_a_counter_that_is_deaf_throughout_is_not_said_to_become_so(
    begins: float, ruled: bool
) -> None:
    deaf = catalogue()["missed_pulses"]
    comparison = prepare(recorded(with_effect(STATION, deaf, "cup", DEAD, (begins, None)), 82))
    term = Term(deaf, "cup", DEAD, (200.0, None), frozenset({"dead_time"}))
    assert ruled_out(comparison, STATION, [term]) is ruled
    assert not ruled_out(comparison, STATION, [replace(term, interval=ALWAYS)])
    assert not ruled_out(comparison, STATION, [replace(term, held=frozenset())])


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("bearing_friction", {"friction_speed": 2.5, "temperature_coefficient": 0.0}),
        ("stuck_sensor", {"start": 100.0, "stop": 200.0, "reading": 0.0, "known": 0.0}),
        ("missed_pulses", {"dead_time": 0.0, "loss_probability": 0.9, "loss_growth": 0.0}),
    ],
)
def test_pulses_that_come_soon_or_not_at_all_were_not_lost_one_by_one(
    monkeypatch: pytest.MonkeyPatch, effect: str, values: dict[str, float]
) -> None:
    station = with_effect(STATION, catalogue()[effect], "cup", values)
    comparison = prepare(recorded(station, 82))
    lost = catalogue()["missed_pulses"]
    usual = float(np.median(np.diff(comparison.recording.pulses["cup"].time))) * 1e-9
    deaf = Term(lost, "cup", {**DEAD, "dead_time": 1.5 * usual})
    seldom = Term(lost, "cup", {"dead_time": 0.0, "loss_probability": 0.9, "loss_growth": 0.0})
    silent = effect == "stuck_sensor"
    assert ruled_out(comparison, STATION, [deaf])
    assert ruled_out(comparison, STATION, [seldom]) is silent
    # Something else may have silenced it.
    stuck = Term(catalogue()["stuck_sensor"], "cup", {"start": 100.0, "stop": 200.0})
    assert not ruled_out(comparison, STATION, [seldom, stuck])
    # In a lull, where few pulses are due, a rotor may have stood still.
    monkeypatch.setattr("wind_sensors.diagnosis.explaining.ruled_out.FEWEST_DUE", 10**6)
    assert not ruled_out(comparison, STATION, [seldom])


def test_what_chance_draws_differs_by_as_much_as_chance_says() -> None:
    bouncing = catalogue()["extra_pulses"]
    values = {"bounce_probability": 0.06, "bounce_delay": 0.0005}
    seen = []
    for seed in range(6):
        comparison = prepare(recorded(with_effect(STATION, bouncing, "cup", values), seed))
        seen.append(comparison.measured.statistics["cup/rotor_rate"][BANDS : BANDS + INTERVALS])
    edges = comparison.recording.pulses["cup"].time.size
    deviation = chance_of_intervals(seen[0], seen[1], edges)
    short = np.array(seen)[:, 1]
    assert np.std(short, ddof=1) < 3.0 * deviation[1] / np.sqrt(2.0)
    assert np.std(short, ddof=1) > deviation[1] / np.sqrt(2.0) / 5.0
    lost, doubled = np.array([0.06, *[0.0] * 5]), np.array([0.0, 0.06, *[0.0] * 4])
    assert not np.any(chance_of_intervals(lost, doubled, edges))


@pytest.mark.parametrize(
    ("one", "other", "mends"),
    [
        (("rotor_inertia", "cup", 1.5), ("calibration_drift", "cup", 1.1), True),
        (("rotor_inertia", "cup", 1.8), ("calibration_drift", "cup", 1.1), False),
        (("rotor_inertia", "cup", 1.5), ("vane_offset", "vane", 20.0), False),
        (("rotor_inertia", "cup", 1.5), ("calibration_drift", "cup", 1.01), False),
    ],
)
def test_what_is_small_beside_a_large_effect_on_the_same_signals_mends_its_form(
    one: tuple[str, str, float], other: tuple[str, str, float], mends: bool
) -> None:
    searcher = searcher_of(prepare(recorded(STATION, 85)), baseline(), catalogue(), {})
    terms = []
    for name, instrument, value in (one, other):
        effect = catalogue()[name]
        terms.append(Term(effect, instrument, {effect.parameters[0].name: value}))
    assert only_makes_good(searcher, terms[0], terms) is mends
    assert not only_makes_good(searcher, terms[0], terms[:1])


@pytest.mark.parametrize(
    ("effect", "values", "counted"),
    [
        ("missed_pulses", LOST_BY_CHANCE, 0.8),
        # These bounces are told from edges, and not counted.
        ("extra_pulses", {"bounce_probability": 0.2, "bounce_delay": 0.0005}, 1.0),
    ],
)
def test_what_chance_does_to_slow_rates_is_known(
    effect: str, values: dict[str, float], counted: float
) -> None:
    changed = with_effect(STATION, catalogue()[effect], "cup", values)
    seen = []
    for seed in range(6):
        # The same wind and the same noise; only the draws differ.
        whole, drawn = (prepare(recorded(s, seed)) for s in (STATION, changed))
        hit = [c.measured.cosine["cup/rotor_rate"] for c in (drawn, whole)]
        seen.append((hit[0] - counted * hit[1])[1:150] ** 2)
    told = drawn.simulate(changed)
    assert told.chance["cup/rotor_rate"] == pytest.approx(np.mean(seen), rel=0.25, abs=1e-3)
    assert not drawn.simulate(STATION).chance
    # It does not stay where another effect takes the place of that one.
    assert not told.with_others(drawn.simulate(STATION)).chance


@pytest.mark.parametrize(
    ("effect", "values", "shared"),
    [
        ("missed_pulses", LOST_BY_CHANCE, 1.0),
        ("extra_pulses", {"bounce_probability": 0.2, "bounce_delay": 0.0005}, 0.0),
    ],
)
def test_bounces_that_are_told_from_edges_leave_the_rate_to_other_effects(
    effect: str, values: dict[str, float], shared: float
) -> None:
    pulses = Term(catalogue()[effect], "cup", values)
    offset = Term(catalogue()["calibration_offset"], "cup", {"offset": -0.4})
    both = planted(STATION, (pulses, offset))
    searcher = searcher_of(prepare(recorded(both, 27)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    one, two = (
        fit(null, searcher.station, terms, searcher.bank.without, iterations=0)
        for terms in ((pulses,), (pulses, offset))
    )
    assert overlap(searcher, one, two) == pytest.approx(shared, abs=0.02)
    needed = inexactness(searcher, null, one, two)
    assert (needed > 0.0) == (shared > 0.0)


@given(
    seed=st.integers(0, 2**16),
    share=st.floats(0.01, 0.15),
    pause=st.floats(12.0, 40.0),
    length=st.floats(1.0, 4.0),
)
def test_a_contact_bounces_by_chance_and_a_radio_sends_in_bursts(
    seed: int, share: float, pause: float, length: float
) -> None:
    rng = np.random.default_rng(seed)
    true = edges(np.zeros(SLOTS))
    bounced = true[rng.random(true.size) < share]
    after = bounced + rng.uniform(0.001, 0.006, bounced.size)
    sent = np.arange(0.0, true[-1], 1.0 / 12.0)
    sent = sent[sent % pause < length]

    def seen(false: FloatArray) -> tuple[float, float]:
        time = np.sort(np.concatenate((true, false)))
        pulses = Pulses(np.round(time * 1e9).astype(np.int64))
        return bursts_of_bounces(pulses, SLOTS, 0, int(true[-1] * 1e9))

    by_chance, _ = seen(after)
    assert by_chance == pytest.approx(1.0, abs=0.5)
    by_radio, squares = seen(sent)
    assert by_radio > 2.0
    assert squares > 1.0


def test_of_a_counter_or_few_pulses_nobody_knows_whether_they_come_in_bursts() -> None:
    true = edges(np.zeros(SLOTS))
    sent = np.arange(0.0, true[-1], 1.0 / 12.0)
    both = np.sort(np.concatenate((true, sent[sent % 20.0 < 2.0])))
    time = np.round(both * 1e9).astype(np.int64)
    end = int(time[-1])
    assert bursts_of_bounces(Pulses(time), SLOTS, 0, end)[0] > 2.0
    counter = Pulses(time, np.arange(time.size) / SLOTS)
    assert bursts_of_bounces(counter, SLOTS, 0, end) == (1.0, 0.0)
    # A hundred edges, and some thousands of which one in a thousand bounces.
    assert bursts_of_bounces(Pulses(time), SLOTS, 0, int(time[100])) == (1.0, 0.0)
    seldom = np.sort(np.concatenate((true, true[10::1000] + 0.003)))
    few = Pulses(np.round(seldom * 1e9).astype(np.int64))
    assert bursts_of_bounces(few, SLOTS, 0, end) == (1.0, 0.0)
