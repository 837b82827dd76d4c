"""Real turbulence through simulated instruments, against the best linear estimate."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from estimation_cases import SHARED
from representatives import represented

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def wiener_limit() -> ModuleType:
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        import wiener_limit as module
    finally:
        sys.path.pop(0)
    return module


@pytest.mark.parametrize("quarter", represented(["1245", "1300"], by=("1245",)))
def test_the_estimate_is_within_a_tenth_of_the_best_linear_one(
    wiener_limit: ModuleType, quarter: str
) -> None:
    folder = SHARED / wiener_limit.SONIC_FOLDER
    files = sorted(folder.glob(f"*_{quarter}.dat.gz"))
    if not files:
        pytest.skip("shared material absent")
    result = wiener_limit.compare(wiener_limit.sonic_wind(files[0]))
    for found, limit, naive in zip(result.found, result.limit, result.naive, strict=True):
        assert found < 1.1 * limit
        assert found < 0.5 * naive


def test_the_linear_limit_is_met_by_a_signal_that_is_filtered_noise(
    wiener_limit: ModuleType,
) -> None:
    """A white signal sampled without noise at half its grid: half of its variance is lost."""
    n = 4096
    white = np.ones(n // 2 + 1)
    flat = np.ones(n // 2 + 1, dtype=np.complex128)
    assert wiener_limit._limit(white, flat, 0.0, n) == pytest.approx(0.0, abs=1e-6)
    assert wiener_limit._limit(white, flat, 0.0, n // 2) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert wiener_limit._limit(white, flat, 1.0, n) == pytest.approx(np.sqrt(0.5), rel=1e-3)
