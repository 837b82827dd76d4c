"""Linear gains of all intervals at once, against one least-squares fit for each."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.diagnosis.intervals import interval_gains

CELLS = 7
LENGTH = 40


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), number=st.integers(1, 4))
def test_gains_are_those_of_least_squares(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    cuts = np.arange(CELLS + 1.0)
    cells = [rng.standard_normal((CELLS, LENGTH)) for _ in range(number)]
    vector = rng.standard_normal(LENGTH)
    joint = interval_gains(cuts, cells, vector, joint=True)
    best = interval_gains(cuts, cells, vector, joint=False)
    for i in range(CELLS):
        for j in range(i + 1, CELLS + 1):
            rows = np.array([c[i:j].sum(axis=0) for c in cells])
            left = np.linalg.lstsq(rows.T, vector, rcond=None)[1]
            gain = float(vector @ vector - left[0])
            # A thousandth of the power is added against signatures that are nearly parallel.
            assert joint.gains[i, j] == pytest.approx(gain, rel=0.02)
            alone = max((row @ vector) ** 2 / (row @ row) for row in rows)
            assert best.gains[i, j] == pytest.approx(alone)
            assert np.count_nonzero(best.amplitudes[i, j]) == 1
    assert not np.any(np.tril(joint.gains))
