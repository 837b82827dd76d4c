"""What pulses and readings tell by themselves: slots, dead times, and what they rule out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, recorded
from hypothesis import assume, given
from hypothesis import strategies as st

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
from wind_sensors.diagnosis.comparing.raw_statistics.slots import slot_intervals
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import (
    ERRATIC,
    STILLNESS,
    chance_of_stillness,
    stillness_statistics,
)
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect, with_keys
from wind_sensors.diagnosis.effects.output import slot_values
from wind_sensors.diagnosis.explaining.acceptance import inexactness, only_makes_good, overlap
from wind_sensors.diagnosis.explaining.bounds import run_away, without_run_aways
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.explaining.vane_guesses import hole_between
from wind_sensors.diagnosis.healthy.whitening import trust_of
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Pulses

FloatArray = npt.NDArray[np.float64]

LOST_BY_CHANCE = {"dead_time": 0.0, "loss_probability": 0.2, "loss_growth": 0.0}
SLOTS = 10
TURNS = 900
TURN = 0.4


def edges(displaced: FloatArray, since: float = 0.0) -> FloatArray:
    """Edges [s] of a disc that turns every 0.4 s, a little faster and slower, slots displaced [1]
    from some time on."""
    place = np.arange(SLOTS * TURNS)
    even = place / SLOTS * TURN
    time = even + 0.05 * np.sin(even / 7.0)
    moved = displaced[place % SLOTS] * TURN / SLOTS
    return np.asarray(time + np.where(time > since, moved, 0.0))


def unevenness(time: FloatArray) -> tuple[float, float]:
    """Scatter of the slots and what swings once per turn."""
    grid = Grid(0, 0.1, round(TURNS * TURN / 0.1))
    cup = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": SLOTS})
    assert isinstance(cup, Cup)
    speed = np.full(grid.n, 2.0 * np.pi * cup.calibration_distance / TURN)
    pulses = Pulses(np.round(time * 1e9).astype(np.int64))
    found = interval_statistics(pulses, cup, np.zeros(grid.n), speed, grid)
    return float(found[2]), float(found[3])


@pytest.mark.parametrize(
    ("lost", "bounced", "followed"),
    [(0.02, 0.0, 0.9), (0.04, 0.0, 0.85), (0.0, 0.04, 0.95), (0.02, 0.02, 0.8)],
)
def test_slots_are_followed_past_lost_and_doubled_edges(
    lost: float, bounced: float, followed: float
) -> None:
    records = 40
    right = 0
    for seed in range(records):
        rng = np.random.default_rng(seed)
        displaced = np.clip(0.06 * rng.standard_normal(SLOTS), -0.2, 0.2)
        clean = edges(displaced)
        kept = clean[rng.random(clean.size) >= lost]
        again = kept[rng.random(kept.size) < bounced] + rng.uniform(0.0005, 0.003)
        expected, found = unevenness(clean), unevenness(np.sort(np.concatenate((kept, again))))
        # A wrong count anywhere spreads every slot over all of them, and next to nothing is left.
        right += found == pytest.approx(expected, abs=0.15 * max(expected))
    assert right >= followed * records


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
        found.append(interval_statistics(edges, cup, calm, calm + speed, grid))
    assert found[1][:3] == pytest.approx(found[0][:3], rel=0.05, abs=2e-4)
    assert found[0][1] > 0.001
    assert found[0][2] > 0.1


def test_slots_that_become_uneven_show_from_then_on() -> None:
    displaced = 0.05 * np.random.default_rng(3).standard_normal(SLOTS)
    cuts = np.linspace(0.0, TURNS * TURN, 13)
    shown = slot_intervals(edges(displaced, since=120.0), SLOTS).shown_in(cuts)
    begin = np.flatnonzero(cuts[:-1] >= 120.0)
    assert np.abs(shown[: begin[0] - 1]).max() < 0.1 * shown[begin].min()


@pytest.mark.parametrize("since", [0.0, 120.0])
def test_what_is_locked_to_a_wind_that_turns_is_not_the_disc(since: float) -> None:
    """Cups that pull more in one direction of the wind, once and three times per turn."""
    displaced = 0.03 * np.random.default_rng(3).standard_normal(SLOTS)
    displaced -= np.mean(displaced)
    time = edges(displaced, since)
    wind_from = 0.8 * np.sin(time / 40.0) + 0.004 * time
    angle = 2.0 * np.pi * np.arange(time.size) / SLOTS - wind_from
    pulled = time + TURN / SLOTS * (0.04 * np.cos(angle) + 0.02 * np.cos(3.0 * angle + 0.5))
    seen, even = (slot_intervals(t, SLOTS) for t in (pulled, time))
    aside, left = seen.without_what_turns(np.interp(seen.begin, time, wind_from))
    end = TURNS * TURN
    if since == 0.0:
        assert left < 0.1 * seen.left_by(0.0, end)
        assert aside.displacements(0.0, end) == pytest.approx(displaced, abs=0.003)
        assert np.abs(seen.displacements(0.0, end) - displaced).max() > 0.02
    # Slots that become uneven while the wind turns remain slots.
    _, left = even.without_what_turns(np.interp(even.begin, time, wind_from))
    assert (left > even.left_by(since, end)) is (since > 0.0)


def test_fewer_edges_than_a_turn_has_tell_nothing_of_slots() -> None:
    seen = slot_intervals(np.linspace(0.0, 50.0, 100), 120)
    aside, left = seen.without_what_turns(np.zeros(seen.begin.size))
    assert (aside.begin.size, left, seen.left_by(0.0, 50.0)) == (0, 0.0, 0.0)


def test_the_place_of_each_slot_is_read_off_the_pulses() -> None:
    displaced = np.clip(0.15 * np.random.default_rng(5).standard_normal(SLOTS), -0.3, 0.3)
    displaced -= np.mean(displaced)
    seen = slot_intervals(edges(displaced, since=120.0), SLOTS)
    assert seen.displacements(130.0, TURNS * TURN) == pytest.approx(displaced, abs=0.01)
    assert np.abs(seen.displacements(0.0, 110.0)).max() < 0.01


def test_a_disc_is_simulated_with_the_slots_that_its_pulses_show() -> None:
    slots = catalogue()["encoder_slot_error"]
    displaced = 0.1 * np.random.default_rng(6).standard_normal(12)
    displaced -= np.mean(displaced)
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    values = slot_values(displaced.tolist())
    corrected = with_effect(STATION, slots, "cup", values).instrument("cup")
    assert isinstance(corrected, Cup)
    assert corrected.electronics.slot_errors == pytest.approx(displaced)


def test_the_beginning_of_uneven_slots_is_part_of_the_finding() -> None:
    slots = {"scatter": 0.04, "once_per_turn": 0.03}
    station = with_effect(
        STATION, catalogue()["encoder_slot_error"], "cup", slots, (220.0, None)
    )
    (finding,) = diagnose(recorded(station, 81), baseline()).findings
    assert finding.term.effect.name == "encoder_slot_error"
    assert finding.term.interval[0] == pytest.approx(220.0, abs=20.0)
    assert finding.term.interval[1] is None
    assert finding.parameters["scatter"].value == pytest.approx(0.04, rel=0.2)


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


def test_a_vane_that_reads_in_steps_has_no_gap_where_it_reads() -> None:
    coarse = with_effect(
        STATION, catalogue()["quantisation"], "vane", {"step": 6.0, "origin": 0.0}
    )
    gapped = {"centre": 190.0, "width": 40.0, "reading": 0.0, "form": 0.0}
    gap = catalogue()["potentiometer_gap"]
    real = prepare(recorded(with_effect(STATION, gap, "vane", gapped), 84))
    stepped = prepare(recorded(coarse, 84))
    term = Term(gap, "vane", gapped)
    assert ruled_out(stepped, STATION, [term])
    assert not ruled_out(real, STATION, [term])
    assert not ruled_out(stepped, STATION, [Term(gap, "vane", {**gapped, "form": 2.0})])


def test_readings_a_last_digit_off_whole_degrees_bound_the_hole_between_them() -> None:
    lowest = np.nextafter(115.0, 0.0)
    steps = np.array([lowest, 125.0, 135.0, 145.0, 155.0, 165.0, 175.0, -175.0])
    found = hole_between(np.repeat(steps, [426, 4662, 3665, 2243, 3936, 2729, 337, 2]))
    assert found is not None
    centre, width = found
    assert width == pytest.approx(10.0)
    assert centre % 10.0 == pytest.approx(0.0, abs=1e-6) or centre % 10.0 > 9.999


def test_the_gap_of_a_vane_that_counts_backwards_is_looked_for_on_its_other_side() -> None:
    gap = Term(
        catalogue()["potentiometer_gap"],
        "vane",
        {"centre": 190.0, "width": 40.0, "reading": 0.0, "form": 0.0},
    )
    swap = Term(catalogue()["sensor_swap"], "vane", {"reversed": 1.0})
    only_swapped = prepare(recorded(swap.planted(STATION), 84))
    both = prepare(recorded(planted(STATION, [swap, gap]), 84))
    assert ruled_out(only_swapped, STATION, [swap, gap])
    assert not ruled_out(both, STATION, [swap, gap])


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
    ],
)
def test_a_damper_that_has_lost_its_oil_is_not_at_the_bounds_of_the_search(
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


def test_slots_are_counted_anew_after_a_silence() -> None:
    displaced = 0.05 * np.random.default_rng(5).standard_normal(SLOTS)
    whole = edges(displaced)
    # Of every record the disc goes on by another number of slots.
    for lost in range(3 * SLOTS, 4 * SLOTS):
        silent = (whole > 150.0) & (whole < 210.0)
        silent[np.flatnonzero(silent)[-1] + 1 + np.arange(lost)] = True
        assert unevenness(whole[~silent]) == pytest.approx(unevenness(whole), rel=0.1)


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


@pytest.mark.parametrize(("width", "begins"), [(12.0, 0.0), (34.0, 0.0), (16.0, 250.0)])
def test_readings_tell_where_a_gap_is_and_since_when(width: float, begins: float) -> None:
    value = 190.0 - 0.5 * width
    values = {"centre": 190.0, "width": width, "reading": value, "form": 1.0}
    gap = catalogue()["potentiometer_gap"]
    station = with_effect(STATION, gap, "vane", values, (begins, None))
    comparison = prepare(recorded(station, 84, swing=0.8))
    (told,) = (t for t in guesses_of(comparison, STATION)[("potentiometer_gap", "vane")] if t.held)
    assert np.mod(told.values["centre"] - 190.0 + 180.0, 360.0) - 180.0 == pytest.approx(0, abs=0.2)
    assert told.values["width"] == pytest.approx(width, abs=0.4)
    assert np.mod(told.values["reading"] - value + 180.0, 360.0) == pytest.approx(180.0, abs=0.01)
    assert told.interval[0] == pytest.approx(begins, abs=25.0)
    assert told.interval[1] is None


@pytest.mark.parametrize(("width", "begins"), [(12.0, 0.0), (34.0, 0.0), (16.0, 100.0)])
def test_good_readings_tell_where_a_wiper_floats_and_since_when(
    width: float, begins: float
) -> None:
    values = {"centre": 190.0, "width": width, "reading": 0.0, "form": 2.0}
    gap = catalogue()["potentiometer_gap"]
    station = with_effect(STATION, gap, "vane", values, (begins, None))
    comparison = prepare(recorded(station, 84, swing=0.8))
    (told,) = (t for t in guesses_of(comparison, STATION)[("potentiometer_gap", "vane")] if t.held)
    assert told.values["form"] == 2.0
    assert np.mod(told.values["centre"] - 190.0 + 180.0, 360.0) - 180.0 == pytest.approx(0, abs=0.6)
    # Good readings beside a jump count as jumps.
    assert told.values["width"] == pytest.approx(width + 0.7, abs=0.9)
    assert told.interval[0] == pytest.approx(begins, abs=25.0)
    assert told.interval[1] is None


@pytest.mark.filterwarnings("error")
def test_a_vane_that_reads_nothing_else_in_between_has_no_gap() -> None:
    stuck = catalogue()["stuck_sensor"]
    values = {"start": 150.0, "stop": 320.0, "reading": 185.0, "known": 1.0}
    comparison = prepare(recorded(with_effect(STATION, stuck, "vane", values), 84))
    guesses = guesses_of(comparison, STATION)
    assert ("stuck_sensor", "vane") in guesses
    assert not any(t.held for t in guesses.get(("potentiometer_gap", "vane"), []))


def test_a_floating_wiper_that_never_comes_out_on_one_side_tells_no_gap() -> None:
    values = {"centre": 230.0, "width": 80.0, "reading": 0.0, "form": 2.0}
    gap = catalogue()["potentiometer_gap"]
    comparison = prepare(recorded(with_effect(STATION, gap, "vane", values), 84))
    guesses = guesses_of(comparison, STATION)[("potentiometer_gap", "vane")]
    assert guesses
    assert not any(t.held for t in guesses)


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


def test_whether_a_turn_is_a_step_or_none_hangs_on_the_last_digit() -> None:
    step = np.radians(6.0)
    speed = np.full(2001, 5.0)
    usual = np.cumsum(np.tile([step, -step], 1001))[:2001]

    def stillness(share_of_none: float) -> float:
        moves = np.arange(2000) % 1000 >= 1000.0 * share_of_none
        series = np.cumsum(np.concatenate(([0.0], np.where(moves, step, 0.0))))
        # Wind from everywhere alike: the slowest third is any third.
        return float(stillness_statistics(series, usual, speed + 1e-3 * (np.arange(2001) % 7))[0])

    jump = abs(stillness(0.105) - stillness(0.095))
    assert jump > 1.0
    assert jump < 4.0 * chance_of_stillness(1.0, 1.0)[0]
    assert not np.any(chance_of_stillness(1.0, 0.0))


def test_the_null_knows_the_last_digit_where_both_read_in_steps() -> None:
    steps = catalogue()["quantisation"]
    coarse = with_effect(STATION, steps, "vane", {"step": 6.0, "origin": 0.0})
    comparison = prepare(recorded(coarse, 84))
    as_described, as_found = (
        trust_of(comparison, comparison.simulate(station), baseline())["vane/vane_angle"]
        for station in (STATION, coarse)
    )
    ratio = as_found.statistics_deviation / as_described.statistics_deviation
    still = slice(BANDS, BANDS + STILLNESS)
    steps_read = BANDS + STILLNESS + ERRATIC
    assert np.all(ratio[still] > 2.0)
    # Between two steps it rests a little: how coarse the readings are is known nearly as before.
    assert ratio[steps_read] < 2.0
    assert np.allclose(np.delete(ratio, np.r_[still, steps_read]), 1.0)


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
