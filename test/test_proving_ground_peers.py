"""The comparison with peers is fair: same data, thresholds from healthy recordings alone."""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.peers.methods import forward_bic
from proving_ground.peers.table import autoregression, excess, peer_row, threshold, whiten


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
    row = peer_row("x", {"a": {"vane_offset"}, "b": {"icing"}, "c": set()}, answers, 1.0)
    assert (row.exact, row.false_alarms, row.unknown_named) == ((1, 1), (1, 1), (0, 1))
    assert row.wrong == (1, 3)
