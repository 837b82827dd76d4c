"""A potentiometer's gap: which readings are made in it, what they say, and where its edges are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, recorded
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics.vanes import chance_of_erratic
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.explaining.vane_guesses import vane_guesses
from wind_sensors.station.model import Angle, Station
from wind_sensors.station.signals import Angles, Recording, between_jumps

SECOND = 1_000_000_000


def readings(angle: np.ndarray) -> Angles:
    """Twenty readings a second."""
    return Angles(np.arange(angle.size, dtype=np.int64) * (SECOND // 20), angle)


def swinging(seed: int, length: int = 4000) -> np.ndarray:
    """Headings of a vane that swings by some tens of degrees [rad]."""
    rng = np.random.default_rng(seed)
    slow = np.convolve(rng.standard_normal(length + 60), np.hanning(61), "valid")
    return np.asarray(0.3 * slow[:length] / np.std(slow))


def station_with_gap(centre: float, width: float, form: float) -> Station:
    """The station with a vane whose track is interrupted [deg]."""
    values = {"centre": centre, "width": width, "reading": 170.0, "form": form}
    return with_effect(STATION, catalogue()["potentiometer_gap"], "vane", values)


def gaps_of(recording: Recording) -> list[Term]:
    """Gaps that the readings give away."""
    comparison = prepare(recording)
    (channel,) = (c for c in comparison.channels if c.kind == "vane_angle")
    vane = STATION.instrument("vane")
    assert isinstance(vane, Angle)
    guesses = vane_guesses(comparison, channel, vane)
    return [term for term in guesses if term.effect.name == "potentiometer_gap"]


def with_readings(recording: Recording, angle: np.ndarray) -> Recording:
    """The recording with other readings of its vane [rad]."""
    told = Angles(recording.angles["vane"].time, angle)
    return replace(recording, angles={**recording.angles, "vane": told})


@settings(max_examples=30)
@given(st.integers(0, 1000), st.floats(-0.3, 0.3), st.floats(0.05, 0.3), st.floats(-3.1, 3.1))
def test_a_number_to_which_a_vane_returns_is_told(
    seed: int, centre: float, width: float, number: float
) -> None:
    angle = swinging(seed)
    gone = np.abs(angle - centre) < 0.5 * width
    seen = readings(np.where(gone, number, angle)).at_one_number
    if seen.any():
        chance = np.abs(angle - number) < 1e-4
        np.testing.assert_array_equal((seen > 0.0) | chance, gone | chance)
    stays = np.count_nonzero(gone[1:] & gone[:-1] & ~np.concatenate(([False], gone[:-2])))
    assert seen.max() == (0.0 if stays < 12 else 1.0) or 12 <= stays < 24


@pytest.mark.parametrize("seed", range(4))
def test_a_number_is_told_within_the_noise_of_its_converter(seed: int) -> None:
    angle = swinging(seed)
    gone = np.abs(angle - 0.1) < 0.1
    noise = np.radians(0.05) * np.random.default_rng(seed).standard_normal(angle.size)
    seen = readings(np.where(gone, 2.0, angle) + noise).at_one_number > 0.0
    assert np.mean(seen[gone]) > 0.95
    assert not seen[~gone].any()
    assert not readings(angle + noise).at_one_number.any()


@pytest.mark.parametrize("step", [0.5, 6.0, 24.0])
def test_coarse_readings_and_rests_are_no_one_number(step: float) -> None:
    angle = swinging(3)
    coarse = np.radians(step) * np.rint(angle / np.radians(step))
    sticking = np.repeat(angle[::40], 40)
    stuck = np.where(np.arange(angle.size) < 1200, 0.2, angle)
    for other in (angle, coarse, sticking, stuck):
        assert not readings(other).at_one_number.any()


def test_jumps_a_second_apart_tell_no_edges_of_a_gap() -> None:
    """As where a logger averages angles on either side of the turn, block by block."""
    recording = recorded(STATION, 8)
    time = recording.angles["vane"].time
    block = (time - time[0]) // SECOND
    told = with_readings(recording, np.where(block % 2 == 0, 3.0, -0.5))
    assert told.angles["vane"].erratic.any()
    assert not between_jumps(told.angles["vane"]).any()
    assert all(not term.held for term in gaps_of(told))


def test_small_numbers_drawn_by_chance_are_told_where_others_are_large() -> None:
    angle = swinging(4)
    angle[1000:1100] = np.random.default_rng(1).uniform(-np.pi, np.pi, 100)
    angle[2500] += np.radians(20.0)
    wrong = readings(angle).erratic
    assert wrong[2500] and wrong[1000:1100].all()
    assert np.count_nonzero(wrong) < 130
    assert not readings(swinging(4)).erratic.any()
    missing = angle.copy()
    missing[200:220] = np.nan
    told = ~np.isnan(missing)
    np.testing.assert_array_equal(readings(missing).erratic[told], wrong[told])


@pytest.mark.parametrize("width", [4.0, 30.0])
def test_the_edges_of_a_gap_in_which_the_wiper_floats_are_read_off(width: float) -> None:
    rng = np.random.default_rng(77)
    recording = recorded(STATION, 75)
    angle = recording.angles["vane"].angle
    true = float(np.degrees(np.median(np.unwrap(angle))))
    away = np.degrees(angle) - true
    floating = np.abs((away + 180.0) % 360.0 - 180.0) < 0.5 * width
    broken = np.where(floating, rng.uniform(-np.pi, np.pi, angle.size), angle)
    (gap,) = (t for t in gaps_of(with_readings(recording, broken)) if t.values["form"] == 2.0)
    assert gap.values["width"] == pytest.approx(width, abs=0.3)
    assert (gap.values["centre"] - true + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.2)
    assert {"centre", "width"} <= gap.held
    assert gap.has_certain_form


@pytest.mark.parametrize("form", [1.0, 2.0])
@pytest.mark.parametrize("turned", [-9.0, 9.0])
def test_a_gap_is_told_beside_a_turned_vane(form: float, turned: float) -> None:
    # The wind's direction, too, says where the nose should be: by the turn beside the gap.
    healthy = recorded(STATION, 75)
    centre = float(np.degrees(np.median(np.unwrap(healthy.angles["vane"].angle)))) + 3.0
    gapped = recorded(station_with_gap(centre, 8.0, form), 75).angles["vane"].angle
    moved = np.angle(np.exp(1j * (gapped + np.radians(turned))))
    first = gaps_of(with_readings(healthy, moved))[0]
    assert first.values["form"] == form
    assert first.values["width"] == pytest.approx(8.0, abs=0.3)
    off = (first.values["centre"] - centre - turned + 180.0) % 360.0 - 180.0
    assert off == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("width", [4.0, 24.0])
def test_what_floats_leaves_no_trace_in_the_spectrum(width: float) -> None:
    healthy = recorded(STATION, 75)
    centre = float(np.degrees(np.median(np.unwrap(healthy.angles["vane"].angle))))
    comparison = prepare(healthy)
    bands = {
        form: comparison.simulate(station).statistics["vane/vane_angle"][:BANDS]
        for form, station in (
            ("healthy", STATION), ("floats", station_with_gap(centre, width, 2.0)),
        )
    }
    assert np.all(bands["floats"] < bands["healthy"] + 0.5)


def test_chance_has_a_part_in_what_both_records_have() -> None:
    assert chance_of_erratic(0.0, 0.4, 900.0) == 0.0
    assert chance_of_erratic(0.04, 0.05, 900.0) == chance_of_erratic(0.05, 0.04, 900.0)
    longer, shorter = (chance_of_erratic(0.2, 0.2, seconds) for seconds in (900.0, 225.0))
    assert shorter == pytest.approx(2.0 * longer)
    assert 0.01 < longer < 0.03
