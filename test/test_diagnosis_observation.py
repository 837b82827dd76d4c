"""What is compared: rates at the record's ends, slots and damage, stillness, loose wipers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded
from hypothesis import given, settings
from hypothesis import strategies as st
from representatives import represented
from scipy.signal import lfilter

from wind_sensors.diagnosis.comparing.observation import Grid, rate_series
from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics.changes import (
    change_statistics,
    windy_changes,
)
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import (
    chance_of_steps,
    standing_share,
    step_statistics,
    stillness_statistics,
)
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Angles, Pulses, erratic_readings

SECOND = 1_000_000_000


def _readings(angle: np.ndarray) -> Angles:
    return Angles(np.arange(angle.size, dtype=np.int64) * (SECOND // 20), angle)


@settings(max_examples=30)
@given(st.floats(0.05, 0.9), st.floats(1.0, 9.0))
def test_a_steady_rotor_turns_evenly_to_both_ends(phase: float, rate: float) -> None:
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    spacing = 1.0 / (rate * cup.pulses_per_revolution)
    edges = np.arange(phase * spacing, 20.0, spacing)
    grid = Grid(0, 0.2, 100)
    found = rate_series(Pulses(np.round(edges * 1e9).astype(np.int64)), cup, grid)
    expected = 2.0 * np.pi * cup.calibration_distance * rate
    np.testing.assert_allclose(found, expected, rtol=1e-5)


@given(seed=st.integers(0, 2**31), slots=st.integers(1, 40))
@settings(max_examples=30)
def test_edges_are_a_slot_apart_unless_they_say_otherwise(seed: int, slots: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.integers(10_000_000, 90_000_000, 500))
    # A few are written down in the wrong order.
    swapped = np.arange(100, 500, 97)
    time[swapped], time[swapped - 1] = time[swapped - 1], time[swapped]
    rotor = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": slots})
    assert isinstance(rotor, Cup)
    grid = Grid(0, 0.5, 60)
    counted = rate_series(Pulses(time), rotor, grid)
    told = rate_series(Pulses(time, np.arange(time.size) / slots), rotor, grid)
    np.testing.assert_allclose(counted, told, rtol=1e-9, atol=1e-9)


def test_a_rotor_that_stops_stands() -> None:
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    time = (np.arange(0.0, 5.0, 0.02) * 1e9).astype(np.int64)
    found = rate_series(Pulses(time), cup, Grid(0, 0.2, 100))
    assert np.all(found[:24] > 0.0)
    assert np.all(found[27:] == 0.0)


@pytest.mark.parametrize("late", [0.3, -0.3])
def test_a_late_clock_leaves_no_calm_at_the_ends_of_a_record(late: float) -> None:
    """A recorder that starts with the rotor turning never gets what a late clock stamps before."""
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    pulses = np.arange(0.0, 20.0, 0.02)
    heard = pulses[(pulses >= late) & (pulses < 20.0 + late)]
    found = rate_series(Pulses((heard * 1e9).astype(np.int64)), cup, Grid(0, 0.2, 100))
    np.testing.assert_allclose(found, found[50], rtol=1e-5)


def test_pulses_stamped_in_one_lot_at_the_ends_do_not_matter() -> None:
    """A logger that writes down what came before with one stamp tells no rate."""
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    heard = np.arange(1.0, 19.0, 0.02)
    lot = np.full(3 * cup.pulses_per_revolution, 1.0)
    time = np.concatenate((0.5 * lot, heard, 19.5 * lot))
    found = rate_series(Pulses((time * 1e9).astype(np.int64)), cup, Grid(0, 0.2, 100))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[15:85], found[50], rtol=1e-5)


@pytest.mark.parametrize("slots", [1, 2, 3])
@pytest.mark.parametrize("bouncing", [0, 1, 2, -3, -2, -1])
def test_a_bounce_at_the_ends_of_a_record_is_no_gust(bouncing: int, slots: int) -> None:
    rotor = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": slots})
    assert isinstance(rotor, Cup)
    edges = np.arange(0.06, 19.99, 0.08)
    time = np.sort(np.append(edges, edges[bouncing] + 0.002))
    grid = Grid(0, 0.4, 50)
    found = rate_series(Pulses((time * 1e9).astype(np.int64)), rotor, grid)
    steady = 2.0 * np.pi * rotor.calibration_distance / slots / 0.08
    one_more = steady * 0.08 / grid.dt
    assert found.max() < steady + 1.5 * one_more
    assert found.min() > 0.8 * steady


def test_a_rotor_that_starts_late_stood_before() -> None:
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    time = (np.arange(2.0, 20.0, 0.02) * 1e9).astype(np.int64)
    found = rate_series(Pulses(time), cup, Grid(0, 0.2, 100))
    assert np.all(found[:9] == 0.0)
    assert np.all(found[11:] > 0.0)


@given(st.floats(-2.0, 2.0), st.floats(0.0, 4.0))
def test_a_vane_that_turns_is_not_erratic(start: float, rate: float) -> None:
    turning = start + rate * np.arange(400) / 20.0
    assert not erratic_readings(_readings(np.angle(np.exp(1j * turning)))).any()


def test_a_loose_wiper_is_erratic_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    angle = 0.1 * rng.standard_normal(2000)
    loose = np.zeros(2000, dtype=bool)
    loose[400:440] = loose[900:930] = loose[1500] = True
    angle[loose] = rng.uniform(-np.pi, np.pi, loose.sum())
    angle[1500] = 2.5
    found = erratic_readings(_readings(angle))
    assert np.mean(found[loose]) > 0.95
    near = np.convolve(loose, np.ones(9), "same") > 0
    assert not found[~near].any()


def test_no_chance_reading_survives_a_long_stay_in_a_gap() -> None:
    rng = np.random.default_rng(6)
    angle = 0.1 * rng.standard_normal(3000)
    loose = np.zeros(3000, dtype=bool)
    loose[600:2400] = True
    angle[loose] = rng.uniform(-np.pi, np.pi, loose.sum())
    assert erratic_readings(_readings(angle))[loose].all()


def test_coarse_readings_are_told_from_those_of_a_vane_that_sticks() -> None:
    rng = np.random.default_rng(7)
    angle = 0.4 * rng.standard_normal(4000)
    sticking = np.repeat(0.4 * rng.standard_normal(400), 10)
    grid = Grid(0, 0.2, 1000)
    for step in (1.0, 2.5, 6.0, 11.25):
        coarse = np.radians(step) * np.round(angle / np.radians(step)) + 0.3
        half = np.where(np.arange(4000) < 2000, coarse, angle)
        for readings, least, most in (
            (angle, 0.0, 0.02), (sticking, 0.0, 0.15), (half, 0.45, 0.55), (coarse, 0.9, 1.001),
        ):
            assert least <= step_statistics(_readings(readings), grid)[0] <= most
    first_half = (np.arange(1000) < 500).astype(float)
    assert step_statistics(_readings(half), grid, first_half)[0] > 0.9


def test_sparse_readings_are_not_judged_by_their_steps() -> None:
    time = np.arange(100, dtype=np.int64) * SECOND
    assert not erratic_readings(Angles(time, np.where(np.arange(100) % 2, 3.0, 0.0))).any()


def test_slots_do_not_look_like_a_damaged_cup() -> None:
    # Statistics: scatter, once per turn, once and twice per turn locked to the wind.
    def statistics(effect: str, **values: float) -> np.ndarray:
        station = with_effect(STATION, catalogue()[effect], "cup", values)
        simulated = prepare(recorded(STATION, 70, swing=0.8)).simulate(station)
        return simulated.statistics["cup/rotor_rate"][BANDS + 2 :]

    slots = statistics("encoder_slot_error", scatter=0.03, once_per_turn=0.06)
    damage = statistics("damaged_cup", torque_harmonic=0.2, gain=1.0)
    assert slots[0] > 0.02 and slots[1] > 0.02
    assert slots[2] < 0.1 * slots[1]
    assert damage[0] < 0.1 * damage[2]


@pytest.mark.parametrize("stands", [60, 400])
def test_a_vane_that_rests_at_a_few_angles_shows_steps_by_chance(stands: int) -> None:
    rng = np.random.default_rng(stands)
    grid = Grid(0, 0.2, 4500)

    def seen() -> tuple[float, float]:
        lengths = rng.exponential(1.0, stands)
        ends = np.ceil(np.cumsum(lengths) / lengths.sum() * 18_000).astype(int)
        angles = np.repeat(rng.uniform(-1.7, 1.7, stands), np.diff(ends, prepend=0))
        readings = _readings(angles)
        return standing_share(readings, grid), float(step_statistics(readings, grid)[0])

    shares, steps = np.array([seen() for _ in range(40)]).T
    # Of n lengths drawn like this the squares of the shares add up to 2 / n, four parts apart.
    np.testing.assert_allclose(shares.mean(), 4 * 2.0 / stands, rtol=0.25)
    allowed = [chance_of_steps(a, b) for a, b in zip(shares[::2], steps[1::2], strict=True)]
    differences = (steps[::2] - steps[1::2]) / allowed
    assert np.sqrt(np.mean(differences**2)) < 1.0
    assert 3.5 < np.mean(steps / shares) < 6.5
    # One that swings rests nowhere, in whatever steps its readings come.
    swinging = 0.3 * lfilter([0.05], [1.0, -0.95], rng.standard_normal(18_000)) / 0.16
    assert standing_share(_readings(swinging), grid) < 0.001
    steps_of_two = np.radians(2.0)
    coarse = _readings(steps_of_two * np.round(swinging / steps_of_two))
    assert chance_of_steps(standing_share(coarse, grid), 1.0) < 0.02
    assert step_statistics(coarse, grid)[0] > 0.9


def test_a_vane_that_turns_round_once_has_the_eddies_that_it_has() -> None:
    recording = recorded(STATION, 75)
    comparison = prepare(recording)
    readings = recording.angles["vane"]
    middle = int(readings.time[readings.time.size // 2])
    once_round = 2.0 * np.pi / (1.0 + np.exp(-(readings.time - middle) / 5e8))
    turned = Angles(readings.time, np.angle(np.exp(1j * (readings.angle + once_round))))
    seen = [comparison.observe({}, {"vane": r}) for r in (readings, turned)]
    before, after = (s.statistics["vane/vane_angle"][:BANDS] for s in seen)
    quick = slice(4, BANDS)
    assert np.all(np.isfinite(before[quick]))
    np.testing.assert_allclose(after[quick], before[quick], atol=0.15)


def test_a_vane_that_creeps_and_jumps_is_stiller_than_one_that_swings() -> None:
    rng = np.random.default_rng(6)
    speed = 3.0 + np.sin(np.arange(4000) / 300.0)
    swinging = 0.2 * rng.standard_normal(4000)
    sticking = np.repeat(swinging[::4], 4)
    still = stillness_statistics(sticking, swinging, speed)
    assert np.all(still < stillness_statistics(swinging, swinging, speed) - 1.0)
    # One that never moves is stiller yet, whatever the noise of its readings.
    noise = 1e-3 * rng.standard_normal(4000)
    standing = stillness_statistics(noise, swinging, speed)
    assert np.all(standing <= still + 1.3)
    assert np.all(standing < -2.5)


def test_a_limit_makes_the_largest_changes_smaller_than_damping_does() -> None:
    rng = np.random.default_rng(8)
    speed = 6.0 + np.sin(np.arange(20_000) / 300.0)
    lively = lfilter([1.0], [1.0, -0.9], rng.standard_normal(20_000))
    # Of Gaussian changes the 98 % quantile is 2.326 / 1.150 of the 75 % one, damped or not.
    gaussian = np.log(2.326 / 1.150)
    damped = lfilter([0.2], [1.0, -0.8], lively)
    windy = windy_changes(speed)
    for series in (lively, damped):
        assert change_statistics(series, windy)[0] == pytest.approx(gaussian, abs=0.05)
    limited = np.cumsum(np.clip(np.diff(lively), -1.2, 1.2))
    assert change_statistics(limited, windy[1:])[0] < gaussian - 0.5
    # Slow wind, masked bins and the steps into them do not count.
    mask = np.ones(20_000)
    mask[5_000:5_500] = 0.0
    mended = np.where(mask > 0.5, lively, 1e3)
    counted = windy_changes(speed, mask)
    expected = change_statistics(lively, counted)
    np.testing.assert_array_equal(change_statistics(mended, counted), expected)
    slow = speed < np.quantile(speed, 1.0 / 3.0)
    wild = np.where(slow & np.roll(slow, -1), 1e3 * rng.standard_normal(20_000), lively)
    assert change_statistics(wild, windy)[0] == pytest.approx(gaussian, abs=0.05)


@pytest.mark.parametrize(("size", "still"), [(300, 1.0), (5_000, 0.0)])
def test_too_little_change_says_nothing(size: int, still: float) -> None:
    series = still * np.random.default_rng(9).standard_normal(size)
    assert change_statistics(series, windy_changes(np.full(size, 5.0))).tolist() == [0.0]


@pytest.mark.parametrize("form", represented([0.0, 1.0, 2.0], by=(1.0,)))
def test_every_form_of_a_gap_is_named(form: float) -> None:
    healthy = recorded(STATION, 67)
    centre = float(np.degrees(np.angle(np.mean(np.exp(1j * healthy.angles["vane"].angle)))))
    reading = 200.0 if form == 1.0 else 0.0
    gap = {"centre": centre, "width": 16.0, "reading": reading, "form": form}
    station = with_effect(STATION, catalogue()["potentiometer_gap"], "vane", gap)
    (finding,) = diagnose(recorded(station, 67), baseline(), with_proof=False).findings
    assert finding.term.key == ("potentiometer_gap", "vane")
    assert finding.term.values["form"] == form
    assert finding.parameters["width"].value == pytest.approx(16.0, abs=3.0)
    off = np.radians(finding.parameters["centre"].value - centre)
    assert abs(np.degrees(np.angle(np.exp(1j * off)))) < 3.0
    assert ("reading" in finding.parameters) == (form == 1.0)
    assert "form" not in finding.parameters


def test_what_one_effect_contains_is_not_named_beside_it() -> None:
    station = with_effect(
        STATION, catalogue()["damaged_cup"], "cup", {"torque_harmonic": 0.15, "gain": 0.92}
    )
    (finding,) = diagnose(
        recorded(station, 68, swing=0.8), replace(baseline()), with_proof=False
    ).findings
    assert finding.term.key == ("damaged_cup", "cup")
    assert finding.parameters["gain"].value == pytest.approx(0.92, abs=0.02)


def test_which_pulses_chance_hits_moves_no_series() -> None:
    bounce = Term(
        catalogue()["extra_pulses"], "cup", {"bounce_probability": 0.05, "bounce_delay": 0.0005}
    )
    comparison = prepare(recorded(STATION, 62))

    def rate(gain: float) -> np.ndarray:
        slower = Term(catalogue()["calibration_drift"], "cup", {"gain": gain})
        return comparison.simulate(planted(STATION, [bounce, slower])).series["cup/rotor_rate"]

    # A thousandth of gain changes when pulses come, and so by chance which of them bounce.
    moved = rate(1.0) - rate(0.999)
    assert np.mean(moved) == pytest.approx(0.001 * np.mean(rate(1.0)), rel=0.2)
    pulses, _ = comparison.signals(planted(STATION, [bounce]))
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    drawn = rate_series(pulses["cup"], cup, comparison.grid) - rate(1.0)
    assert np.std(moved) < 0.5 * np.std(drawn)
