"""What a vane's readings tell by themselves: gaps, steps, and what they rule out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import (
    ERRATIC,
    STILLNESS,
    chance_of_stillness,
    stillness_statistics,
)
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.explaining.vane_guesses import hole_between
from wind_sensors.diagnosis.healthy.whitening import trust_of

FloatArray = npt.NDArray[np.float64]


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
