"""Weights of competing explanations in the monitor's looks."""

from __future__ import annotations

import pytest

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.watch.believing import SOMETHING_ELSE, Rival, believed

OFFSET = Term(catalogue()["vane_offset"], "vane", {"offset": 5.0})
FRICTION = Term(catalogue()["vane_friction"], "vane", {"friction_speed": 1.0})
TURN = Term(catalogue()["vane_eccentricity"], "vane", {"amplitude": 3.0, "phase": 0.0})


def test_explanations_that_do_equally_well_are_believed_equally() -> None:
    weights = [w for _, w in believed([Rival(OFFSET, 0.0), Rival(TURN, 0.0)], 200.0)]
    assert weights == pytest.approx([0.5 * (1.0 - SOMETHING_ELSE)] * 2)


def test_one_that_falls_far_behind_is_not_told() -> None:
    told = believed([Rival(FRICTION, 190.0), Rival(OFFSET, 0.0)], 200.0)
    assert [rival.term for rival, _ in told] == [OFFSET]
    assert told[0][1] == pytest.approx(1.0 - SOMETHING_ELSE, abs=0.01)


def test_the_same_gap_counts_less_where_much_is_explained() -> None:
    def leading(gain: float) -> float:
        return believed([Rival(OFFSET, 0.0), Rival(TURN, 20.0)], gain)[0][1]

    assert leading(100.0) > leading(1000.0) > 0.5 * (1.0 - SOMETHING_ELSE)
