"""What a rotor does beside pulses that are lost: by a dead time, or one by one."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded
from hypothesis import given
from hypothesis import strategies as st
from turned_disc import SLOTS, TURN, edges

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import with_missed
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.guesses import Guesses, as_counted, guesses_of
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.whitening import trust_of, unstanding
from wind_sensors.simulation.pulses import share_in_time
from wind_sensors.station.signals import FloatArray, Pulses

GAIN = 0.96
KEY = ("missed_pulses", "cup")


@lru_cache(maxsize=4)
def looked_at(
    dead_time: float, loss: float, since: float = 0.0
) -> tuple[Comparison, Comparison, Guesses]:
    """A cup that loses pulses and reads 4 % too little: as it is, as it is compared, guesses."""
    lost = {"dead_time": dead_time, "loss_probability": loss, "loss_growth": 0.0}
    lossy = with_effect(STATION, catalogue()["missed_pulses"], "cup", lost, (since, None))
    station = with_effect(lossy, catalogue()["calibration_drift"], "cup", {"gain": GAIN})
    plain = prepare(recorded(station, 31), STATION)
    guesses = guesses_of(plain, STATION)
    return plain, as_counted(plain, guesses), guesses


@given(
    ratio=st.floats(0.3, 3.6).filter(lambda r: abs(r - round(r)) > 0.12 * r),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_deaf_counter_takes_as_many_as_it_does_on_average(ratio: float, seed: int) -> None:
    """Against the circuit itself, away from the rates at which one more is lost at once."""
    rng = np.random.default_rng(seed)
    interval = 0.01 * np.exp(0.005 * rng.standard_normal(4000))
    time = np.cumsum(interval)
    taken, last = 0, -np.inf
    for at in time:
        if at - last >= ratio * 0.01:
            taken, last = taken + 1, at
    share = share_in_time(np.round(time * 1e9).astype(np.int64), ratio * 0.01)
    assert share.mean() == pytest.approx(taken / time.size, rel=0.01)


def test_no_dead_time_takes_nothing() -> None:
    assert np.all(share_in_time(np.arange(0, 10**9, 10**7), 0.0) == 1.0)
    assert share_in_time(np.array([5]), 1.0).tolist() == [1.0]


@given(
    displaced=st.lists(st.floats(-0.08, 0.08), min_size=SLOTS, max_size=SLOTS),
    share=st.floats(0.005, 0.05),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_is_missing_is_put_back_where_its_slot_is(
    displaced: list[float], share: float, seed: int
) -> None:
    true = edges(np.array(displaced))
    rng = np.random.default_rng(seed)
    kept = rng.random(true.size) >= share
    kept[: 3 * SLOTS] = kept[-3 * SLOTS :] = True
    mended = with_missed(Pulses(np.round(true[kept] * 1e9).astype(np.int64)), SLOTS)
    assert mended is not None
    back = mended.time * 1e-9
    assert abs(back.size - true.size) <= 0.006 * true.size
    nearest: FloatArray = np.abs(back - true[np.clip(np.searchsorted(true, back), 1, None) - 1])
    following = np.abs(back - true[np.clip(np.searchsorted(true, back), 0, true.size - 1)])
    away = np.minimum(nearest, following) * SLOTS / TURN
    assert np.quantile(away, 0.995) < 0.2


def test_a_silence_is_not_filled() -> None:
    true = edges(np.zeros(SLOTS))
    silent = true[(true < 100.0) | (true > 160.0)]
    mended = with_missed(Pulses(np.round(silent * 1e9).astype(np.int64)), SLOTS)
    assert mended is not None and mended.time.size == silent.size


def test_where_some_edges_bounce_or_too_many_are_missing_none_is_put_back() -> None:
    true = edges(np.zeros(SLOTS))
    bounced = np.sort(np.concatenate((true, true[::50] + 0.004)))
    assert with_missed(Pulses(np.round(bounced * 1e9).astype(np.int64)), SLOTS) is None
    few = true[np.random.default_rng(4).random(true.size) > 0.15]
    assert with_missed(Pulses(np.round(few * 1e9).astype(np.int64)), SLOTS) is None


def test_the_intervals_tell_that_a_dead_time_is_all() -> None:
    _, seen, guesses = looked_at(0.0075, 0.0)
    (told,) = guesses[KEY]
    assert told.held == {"dead_time", "loss_probability", "loss_growth"}
    assert seen.deaf == {"cup"} and not seen.mended
    (both,) = looked_at(0.0075, 0.02)[2][KEY]
    assert both.held == {"dead_time"}


def test_losses_by_chance_are_put_back_if_they_hold_all_the_time() -> None:
    plain, seen, _ = looked_at(0.0, 0.03)
    assert list(seen.mended) == ["cup"]
    whole = seen.measured.series["cup/rotor_rate"]
    raw = plain.measured.series["cup/rotor_rate"]
    assert float(np.mean(whole) / np.mean(raw)) == pytest.approx(1.0 / 0.97, abs=0.003)
    intervals = slice(-7, -5)
    for statistics in (plain.measured.statistics, seen.measured.statistics):
        assert statistics["cup/rotor_rate"][intervals][0] == pytest.approx(0.03, abs=0.006)
    assert not looked_at(0.0, 0.03, 200.0)[1].mended


@pytest.mark.parametrize("lost", [(0.0075, 0.0), (0.0, 0.03)])
@pytest.mark.parametrize("start", [0.94, 1.02])
def test_a_gain_beside_lost_pulses_is_fitted_from_either_side(
    lost: tuple[float, float], start: float
) -> None:
    _, seen, guesses = looked_at(*lost)
    lossy = guesses[KEY][0]
    null = unstanding(seen, trust_of(seen, seen.simulate(lossy.planted(STATION)), baseline()))
    terms = [lossy, Term(catalogue()["calibration_drift"], "cup", {"gain": start})]
    found = fit(null, STATION, terms)
    assert found.terms[1].values["gain"] == pytest.approx(GAIN, abs=0.012)
