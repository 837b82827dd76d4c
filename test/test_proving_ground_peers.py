"""The comparison with peers is fair: same data, thresholds from healthy recordings alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from proving_ground.peers import regress, table
from proving_ground.peers.methods import forward_bic
from proving_ground.peers.regress import autoregression, whiten
from proving_ground.peers.rows import FILE, read_rows, write_table
from proving_ground.peers.table import excess, peer_row, threshold


def test_forward_selection_finds_the_columns_that_made_the_residual() -> None:
    rng = np.random.default_rng(1)
    signatures = rng.standard_normal((800, 12))
    residual = 0.8 * signatures[:, 3] - 0.5 * signatures[:, 7] + rng.standard_normal(800)
    found = forward_bic(signatures, residual)
    assert {3, 7} <= set(np.flatnonzero(found))
    assert found[3] == pytest.approx(0.8, abs=0.12)


def test_whitening_leaves_white_noise_and_keeps_the_relation_to_the_signature() -> None:
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(4000)
    coloured = np.zeros(4000)
    for i in range(1, 4000):
        coloured[i] = 0.9 * coloured[i - 1] + noise[i]
    assert autoregression(coloured)[1] == pytest.approx(-0.9, abs=0.03)
    signature = np.sin(np.arange(4000) / 40.0)
    residual, columns = whiten(coloured + signature, signature[:, None], np.zeros(4000))
    centred = residual - residual.mean()
    lagged = float(centred[1:] @ centred[:-1] / (centred @ centred))
    assert abs(lagged) < 0.05
    slope = float(columns[:, 0] @ residual / (columns[:, 0] @ columns[:, 0]))
    assert slope == pytest.approx(1.0, abs=0.35)


def test_the_threshold_lets_at_most_the_wanted_share_of_healthy_recordings_through() -> None:
    rng = np.random.default_rng(3)
    groups = [[{"icing": float(v)} for v in rng.exponential(1.0, 6)] for _ in range(10)]
    limit = threshold(groups)
    named = [
        max(excess(one, [h for j, h in enumerate(group) if j != i]).values()) > limit
        for group in groups
        for i, one in enumerate(group)
    ]
    assert np.mean(named) <= 0.05


def test_a_peer_is_judged_like_the_diagnosis() -> None:
    cause = {"effect": "vane_offset", "size_factor": 3.0}
    answers = {
        "a": {"stratum": "single", "causes": [cause]},
        "b": {"stratum": "healthy", "causes": []},
        "c": {"stratum": "unknown", "causes": [{"effect": "unknown", "size_factor": 3.0}]},
    }
    assert peer_row("x", {"c": {"icing"}}, answers, 1.0).unknown_named == (1, 1)
    row = peer_row("x", {"a": {"vane_offset"}, "b": {"icing"}, "c": set()}, answers, 1.0)
    assert (row.exact, row.false_alarms, row.unknown_named) == ((1, 1), (1, 1), (0, 1))
    assert row.wrong == (1, 3)


def test_a_matched_threshold_allows_the_alarms_of_the_diagnosis_and_no_more() -> None:
    over = {
        name: {"icing": value} for name, value in zip("abcd", (1.0, 4.0, 2.0, 9.0), strict=True)
    }
    answers = {name: {"stratum": "healthy"} for name in "abc"} | {"d": {"stratum": "single"}}
    for alarms in range(4):
        named = table.names_above(over, table.limit_with(over, answers, alarms))
        assert sum(bool(named[name]) for name in "abc") == alarms


def test_a_name_for_an_effect_taken_out_is_a_name_for_the_unknown() -> None:
    cause = {"effect": "vane_offset", "size_factor": 3.0}
    answers = {"a": {"stratum": "withheld", "causes": [cause], "without": ["vane_offset"]}}
    row = peer_row("x", {"a": {"vane_damping"}}, answers, 1.0)
    assert (row.unknown_named, row.wrong, row.exact) == ((1, 1), (1, 1), (0, 0))


def test_the_comparison_runs_from_regressors_to_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A planted signature is named, noise is not, and what is taken out cannot be."""
    monkeypatch.setattr(regress, "require_peers", lambda: None)
    for module in (regress, table):
        monkeypatch.setattr(module, "METHODS", {"forward": (forward_bic,)})
    effects = np.array(["icing", "vane_offset", "wake_shadow"])
    rng = np.random.default_rng(5)
    planted = {"found": 1, "gone": 1, "well": None}
    places = [tmp_path / "recordings" / name for name in planted]
    places += [tmp_path / "healthy" / "station-1" / f"healthy-{i}" for i in range(6)]
    (tmp_path / "regressors").mkdir()
    for place in places:
        place.mkdir(parents=True)
        signatures = rng.standard_normal((600, 3))
        column = planted.get(place.name)
        residual = rng.standard_normal(600)
        if column is not None:
            residual += 3.0 * signatures[:, column]
        np.savez(
            regress.regressor_file(tmp_path, place), residual=residual, signatures=signatures,
            effects=effects, sizes=np.ones(3), channel=np.zeros(600, dtype=int),
        )
    cause = {"effect": "vane_offset", "size_factor": 3.0}
    answers: dict[str, dict[str, Any]] = {
        "found": {"stratum": "single", "causes": [cause], "without": []},
        "gone": {"stratum": "withheld", "causes": [cause], "without": ["vane_offset"]},
        "well": {"stratum": "healthy", "causes": [], "without": []},
    }
    entries = {n: {"healthy": "station-1", "without": a["without"]} for n, a in answers.items()}
    (tmp_path / "manifest.json").write_text(json.dumps({"recordings": entries}))
    rows = table.compare(tmp_path, answers, [])
    assert rows[1:] == table.compare(tmp_path, answers, [])[1:], "what was kept is what was found"
    assert [r.method for r in rows] == ["wind diagnose", "forward", "forward, whitened"]
    for row in rows[1:]:
        assert (row.exact, row.false_alarms, row.unknown_named) == ((1, 1), (0, 1), (0, 1))
        assert row.matched == (1, 1)
    page = write_table(tmp_path / "score", rows[1:], {"sealed": 3})
    assert "| forward, whitened | 0 % (0 to 98) | 100 % (3 to 100) |" in page.read_text()
    assert read_rows(tmp_path / "score" / FILE) == (
        rows[1:],
        {"sealed": 3},
    )
