"""What stands in a vane's series where its readings tell no direction."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from wind_sensors.diagnosis.comparing.observation import Grid, where_untold
from wind_sensors.diagnosis.comparing.untold import as_known_elsewhere
from wind_sensors.station.signals import Angles

FloatArray = npt.NDArray[np.float64]

DT = 0.2
N = 3000
UNTOLD = (np.arange(N) // 25) % 5 < 2
"""Two fifths of the record, five seconds at a time."""


def _filtered(noise: FloatArray, decay: float) -> FloatArray:
    """Noise of which each frequency has exp(-f / decay) of its amplitude."""
    frequency = np.fft.rfftfreq(noise.size, DT)
    return np.fft.irfft(np.fft.rfft(noise) * np.exp(-frequency / decay), noise.size)


def _quick(series: FloatArray) -> FloatArray:
    """What is above 0.5 Hz."""
    spectrum = np.fft.rfft(series)
    spectrum[np.fft.rfftfreq(series.size, DT) < 0.5] = 0.0
    return np.fft.irfft(spectrum, series.size)


@pytest.mark.parametrize("seed", range(4))
def test_only_what_the_told_series_shows_is_put_in(seed: int) -> None:
    rng = np.random.default_rng(seed)
    expected = rng.standard_normal(N)
    shared = _filtered(expected, 0.2)
    measured = shared + 0.3 * rng.standard_normal(N)
    completed = as_known_elsewhere(measured, expected, UNTOLD, DT)
    assert np.array_equal(completed[~UNTOLD], measured[~UNTOLD])
    left = np.std((completed - shared)[UNTOLD])
    assert left < 0.15 * np.std((expected - shared)[UNTOLD])
    # An eddy that only the reference felt is no eddy of the vane's.
    assert abs(np.corrcoef(_quick(completed)[UNTOLD], _quick(expected)[UNTOLD])[0, 1]) < 0.35


def test_a_vane_that_shows_all_is_completed_with_all() -> None:
    expected = np.random.default_rng(5).standard_normal(N)
    completed = as_known_elsewhere(expected, expected, UNTOLD, DT)
    assert np.allclose(completed, expected)


def test_a_bin_is_untold_if_all_its_readings_jump_about() -> None:
    rng = np.random.default_rng(6)
    time = np.arange(0, 60_000_000_000, 50_000_000)
    angle = 0.02 * rng.standard_normal(time.size)
    floats = (time >= 20_000_000_000) & (time < 30_000_000_000)
    angle[floats] = rng.uniform(-np.pi, np.pi, np.count_nonzero(floats))
    grid = Grid(0, DT, 300)
    untold = where_untold(Angles(time, angle), grid)
    assert untold[102:148].all()
    assert not untold[:98].any() and not untold[152:].any()
