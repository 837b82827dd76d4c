"""Where the reference stands: learnt from delays, taken off before anything is compared."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, recorded
from hypothesis import given
from hypothesis import strategies as st

from wind_sensors.cli.baseline import told_place
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.reference_place import Place, delayed
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import default_baseline, learn
from wind_sensors.diagnosis.healthy.reference_lag import is_a_way_of_the_wind, misplaced
from wind_sensors.diagnosis.healthy.reference_search import located, pooled
from wind_sensors.simulation.drive import Drive
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

AWAY = 3.0
STANDS = (-1.5, 2.0)
"""East and north of the mast [m]."""


def far(recording: Recording) -> Recording:
    """The recording with its reference at `STANDS`, past which the same eddies are carried."""
    assert recording.reference is not None
    seen = recording.reference
    ten_seconds = np.ones(200) / 200.0
    mean = np.stack(
        [np.convolve(seen.velocity[:, k], ten_seconds, "same") for k in (0, 1)], axis=1
    )
    ahead = mean @ np.array(STANDS) / np.sum(mean * mean, axis=1)
    at = (seen.time - seen.time[0]) * 1e-9
    shown = np.stack(
        [np.interp(at - ahead, at, seen.velocity[:, k]) for k in range(3)], axis=1
    )
    reference = STATION.reference
    assert reference is not None
    station = recording.station.model_copy(
        update={"reference": reference.model_copy(update={"separation": AWAY})}
    )
    return replace(recording, station=station, reference=replace(seen, velocity=shown))


@lru_cache(maxsize=1)
def days() -> tuple[Recording, ...]:
    """Four healthy days with winds from several directions."""
    return tuple(far(recorded(STATION, seed)) for seed in (3, 4, 5, 6))


def test_the_wind_arrives_later_from_a_reference_that_stands_upwind() -> None:
    at = np.arange(0.0, 120.0, 0.05)
    gust = np.exp(-(((at - 60.0) / 1.5) ** 2))
    wind = np.stack([8.0 + 0.2 * gust, np.zeros_like(at), np.zeros_like(at)], axis=1)
    upwind = delayed(Drive(0, 0.05, wind), wind, Place(-4.0, 2.0, 0.1))
    downwind = delayed(Drive(0, 0.05, wind), wind, Place(4.0, 2.0, 0.1))
    for arrived, peak in ((upwind, 60.5), (downwind, 59.5)):
        assert at[np.argmax(arrived.wind[:, 0])] == pytest.approx(peak, abs=0.06)


def test_a_calm_carries_nothing_across_the_record() -> None:
    calm = np.zeros((400, 3))
    assert np.array_equal(delayed(Drive(0, 0.05, calm), calm, Place(1.0, 1.0, 0.1)).wind, calm)


def test_healthy_days_tell_where_the_reference_stands() -> None:
    station = days()[0].station
    place = located(days(), default_baseline(station))
    assert place is not None
    assert place.error < 0.5 * AWAY
    for found, true in zip((place.x, place.y), STANDS, strict=True):
        assert abs(found - true) < 2.0 * place.error + 0.1


def test_people_are_told_the_place_with_its_error() -> None:
    told = told_place(Place(0.506, -0.628, 0.118))
    assert "0.51 m along the sensors' x and -0.63 m along their y (± 0.12 m)" in told


def test_delays_that_do_not_follow_the_wind_tell_no_place() -> None:
    station = days()[0].station
    beside = [replace(recorded(STATION, seed), station=station) for seed in (3, 4, 5, 6)]
    assert located(beside, default_baseline(station)) is None


def test_a_reference_at_the_sensors_has_no_place_to_learn() -> None:
    reference = STATION.reference
    assert reference is not None
    beside = STATION.model_copy(
        update={"reference": reference.model_copy(update={"separation": 0.0})}
    )
    assert located([recorded(STATION, 3)], default_baseline(beside)) is None


def test_a_known_place_makes_the_comparison_closer_and_delays_telling() -> None:
    recording = far(recorded(STATION, 9))
    known = Place(*STANDS, 0.2)
    blind, seeing = prepare(recording), prepare(recording, place=known)

    def misfit(comparison: Comparison) -> float:
        simulated = comparison.simulate(comparison.station)
        return sum(
            float(np.sum((comparison.measured.cosine[k] - v) ** 2))
            for k, v in simulated.cosine.items()
        )

    assert misfit(seeing) < 0.8 * misfit(blind)
    short = Term(catalogue()["timestamp_latency"], "cup", {"latency": 0.1})
    healthy = blind.simulate(STATION)
    assert is_a_way_of_the_wind(blind, short, healthy)
    assert not is_a_way_of_the_wind(seeing, replace(short, values={"latency": 1.0}), healthy)


def test_a_delay_that_other_instruments_do_not_show_is_not_the_winds_way() -> None:
    latency = catalogue()["timestamp_latency"]
    cup = Term(latency, "cup", {"latency": 0.35})
    # The wind comes past the reference first on the one day, past the instruments on the other.
    for seed, is_way in ((3, True), (9, False)):
        blind = prepare(far(recorded(STATION, seed)))
        assert is_a_way_of_the_wind(blind, cup, blind.simulate(STATION)) == is_way


def test_a_baseline_keeps_the_place_until_the_reference_moves() -> None:
    baseline = learn(days())
    assert baseline.place is not None
    again = Baseline.from_json(baseline.to_json())
    assert again.place == baseline.place
    same = days()[0].station
    assert again.for_station(same).place == baseline.place
    assert same.reference is not None
    moved = same.model_copy(
        update={"reference": same.reference.model_copy(update={"separation": 1.0})}
    )
    assert again.for_station(moved).place is None


@given(
    st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2),
    st.integers(2, 6),
    st.integers(0, 1000),
)
def test_witnesses_that_agree_are_believed(
    truth: list[float], witnesses: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    seen = []
    for _ in range(witnesses):
        rows = rng.normal(size=(2, 5))
        information = rows @ rows.T + np.eye(2)
        seen.append((information, information @ np.array(truth)))
    scatter, prior = np.full(2, 1e-3), np.full(2, 1e3)
    solved, covariance = pooled(seen, scatter, prior)
    assert solved == pytest.approx(truth, abs=1e-3)
    one, alone = pooled(seen[:1], scatter, prior)
    assert one == pytest.approx(truth, abs=1e-3)
    assert np.trace(covariance) < np.trace(alone)


def test_the_error_of_a_place_delays_by_the_direction() -> None:
    # In the mean wind an error along it comes late by its way, one across it hardly does; the wind
    # wanders by half a radian and a quarter of its speed.
    comparison = prepare(recorded(STATION, 9), STATION, Place(0.0, 0.0, 0.5))
    searcher = searcher_of(comparison, default_baseline(STATION), catalogue(), {})
    latency = {"latency": 0.5 / float(np.mean(comparison.speed))}
    late = with_effect(STATION, catalogue()["timestamp_latency"], "cup", latency)
    n = comparison.coefficients
    without = comparison.simulate(STATION).flat(comparison.channels)
    delayed_cup = (comparison.simulate(late).flat(comparison.channels) - without)[:n]
    mean = comparison.drive.wind.mean(axis=0)[:2]
    east, north = mean / np.linalg.norm(mean)
    along = -np.array([east, north]) @ searcher.misplaced[:, :n]
    across = np.array([north, -east]) @ searcher.misplaced[:, :n]

    def likeness(change: FloatArray) -> float:
        return float(change @ delayed_cup / (np.linalg.norm(change) * np.linalg.norm(delayed_cup)))

    assert likeness(along) > 0.7
    assert abs(likeness(across)) < 0.3
    assert np.linalg.norm(along) == pytest.approx(np.linalg.norm(delayed_cup), rel=0.25)


def test_an_unknown_place_has_no_error_of_its_own() -> None:
    comparison = prepare(recorded(STATION, 9), STATION)
    assert misplaced(comparison, STATION, comparison.simulate(STATION)).shape[0] == 0
