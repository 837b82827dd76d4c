"""Sets of causes that somebody chose: how they are written, and what becomes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from proving_ground.generate import Planted
from proving_ground.sealing.chosen import chosen_plan, parse_causes
from proving_ground.sealing.opening import judge_all, open_answers
from proving_ground.sealing.seal import RECORDINGS, seal
from proving_ground.sealing.strata import FIRST_SCORING_STATION
from wind_sensors.errors import UserError

KEY = bytes(range(32))


def test_causes_are_read_with_their_sizes_and_intervals() -> None:
    assert parse_causes("none") == ()
    assert parse_causes("icing:4@0.4-0.9+vane_offset:3") == (
        Planted("icing", 4.0, 0.4, 0.9),
        Planted("vane_offset", 3.0),
    )
    assert parse_causes("winding_cable:2@0.3") == (Planted("winding_cable", 2.0, 0.3),)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gremlins:3", "'gremlins'"),
        ("icing", "cannot be read"),
        ("icing:much", "cannot be read"),
        ("icing:-2", "above nought"),
        ("icing:3@0.8-0.2", "interval"),
        ("icing:3@0.8-1.2", "interval"),
    ],
)
def test_a_cause_that_cannot_be_read_is_told_with_how_to_write_it(text: str, said: str) -> None:
    with pytest.raises(UserError) as told:
        parse_causes(text)
    assert said in str(told.value)
    assert "EFFECT:SIZE" in str(told.value)


def test_each_cause_comes_once_on_each_station_where_it_can_show() -> None:
    causes = ["none", "lever_arm:3", "vane_offset:3+icing:4@0.4", "vane_offset:6@0.2"]
    plan, names = chosen_plan(causes, np.random.default_rng(1), 10.0, 2, "AB")
    assert len(names) == len(set(names)) == len(plan.cases) == 7
    assert not any(n.startswith("A1-lever_arm") for n in names)
    assert {c.stratum for c in plan.cases} == {"healthy", "single", "pair", "onset"}
    assert all(s.seed < FIRST_SCORING_STATION for s in plan.stations)
    seeds = [s.seed for well in plan.healthy for s in well] + [c.spec.seed for c in plan.cases]
    assert len(seeds) == len(set(seeds))


def test_causes_that_cannot_show_anywhere_are_refused() -> None:
    with pytest.raises(UserError, match="none of the causes can show"):
        chosen_plan(["lever_arm:3"], np.random.default_rng(1), 10.0, 2, "A")


def test_a_chosen_set_is_written_and_opened_as_any_other(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    sealed = seal(
        folder, 60, 1, KEY, minutes=0.3, healthy_count=1, kinds="AA", causes=["vane_offset:3"]
    )
    assert sealed.recordings == 2
    names = sorted(p.name for p in (folder / RECORDINGS).iterdir())
    assert names == ["A1-vane_offset_3", "A2-vane_offset_3"]
    answers = open_answers(folder, KEY)
    assert {a["causes"][0]["effect"] for a in answers.values()} == {"vane_offset"}
    assert [j.outcome for j in judge_all(folder, answers)] == ["failed", "failed"]
