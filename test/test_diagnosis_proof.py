"""What the proof says of right and of wrong explanations, on recordings whose cause is known."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.healthy.whitening import trust_of, whitener_of
from wind_sensors.diagnosis.proving.held_out import (
    BLOCKS,
    LEAST_CONTRAST,
    block_masks,
    blocks_for,
    wind_masks,
)
from wind_sensors.diagnosis.proving.proof import Proof, prove
from wind_sensors.station.signals import Recording

OFFSET = Term(catalogue()["calibration_offset"], "cup", {"offset": -0.6})
GAIN = Term(catalogue()["calibration_drift"], "cup", {"gain": 0.92})
TURNED = Term(catalogue()["vane_offset"], "vane", {"offset": 5.0})


@lru_cache(maxsize=1)
def slow_cup() -> Recording:
    """A cup that loses the same speed at every wind, in a wind that changes much."""
    station = with_effect(STATION, OFFSET.effect, OFFSET.instrument, OFFSET.values)
    return recorded(station, seed=61, mean=4.0)


def proved(term: Term, placebo: Term | None = None) -> Proof:
    comparison = prepare(slow_cup(), baseline().station)
    true = comparison.simulate(planted(STATION, [OFFSET]))
    trust = trust_of(comparison, true, baseline())
    size = comparison.coefficients * len(comparison.channels) + sum(
        comparison.measured.statistics[c.name].size for c in comparison.channels
    )
    null = whitener_of(comparison, trust, np.zeros((0, size)), np.zeros(0), np.zeros(0))
    return prove(null, baseline().station, [term], [placebo] if placebo else [])


def test_the_true_effect_is_borne_out_by_every_check() -> None:
    proof = proved(OFFSET, TURNED)
    assert proof.excess_removed > 0.9
    assert proof.placebo_removed is not None and proof.placebo_removed < 0.1
    assert proof.transfer is not None and proof.transfer > 0.9
    assert proof.coverage == pytest.approx(0.95, abs=0.02)


def test_another_form_of_the_same_loss_carries_less_from_calm_to_windy() -> None:
    right, wrong = proved(OFFSET), proved(GAIN)
    assert right.transfer is not None and wrong.transfer is not None
    assert wrong.transfer < right.transfer - 0.02
    assert wrong.excess_removed < right.excess_removed
    assert right.wind_correlation is not None and wrong.wind_correlation is not None
    assert right.wind_correlation[1] < 0.6 * wrong.wind_correlation[1]


def test_an_effect_of_another_signal_removes_nothing() -> None:
    proof = proved(TURNED)
    assert proof.excess_removed < 0.05
    assert proof.curve_removed is not None and proof.curve_removed > 0.5


def test_fitted_and_scored_blocks_do_not_touch() -> None:
    comparison = prepare(slow_cup())
    even, odd = block_masks(comparison)
    assert not np.any((even > 0.0) & (odd > 0.0))
    inside = np.flatnonzero((even > 0.0) | (odd > 0.0))
    between = np.diff(inside)[np.diff(inside) > 1] * comparison.grid.dt
    assert between.size == 11 and np.all(between > 3.5)


def test_blocks_are_parted_by_their_wind_where_it_changes() -> None:
    comparison = prepare(slow_cup())
    masks = wind_masks(comparison)
    assert masks is not None
    calm, windy = (float(np.average(comparison.speed, weights=m)) for m in masks)
    assert windy > LEAST_CONTRAST * calm


@pytest.mark.parametrize(
    ("begin", "end", "times"), [(0.0, 1.0, 1), (0.43, 0.5, 2), (0.43, 0.46, 4), (0.43, 0.431, 4)]
)
def test_what_acts_for_a_short_while_is_proved_in_shorter_blocks(
    begin: float, end: float, times: int
) -> None:
    at = np.linspace(0.0, 1.0, 4000)
    acting = ((at >= begin) & (at <= end)).astype(float)
    assert blocks_for([np.ones(4000), 100.0 * acting]) == times * BLOCKS
    # What shows in the pulses' intervals alone has no place in the record.
    assert blocks_for([1e-7 * acting]) == BLOCKS
