"""The cosine-domain tools of the diagnosis against what they claim."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.station.signals import FloatArray

N, DT = 4096, 0.2


def _red(seed: int, n: int = N) -> np.ndarray:
    return lfilter([1.0], [1.0, -0.95], np.random.default_rng(seed).standard_normal(n))


def test_cosine_transform_is_orthonormal() -> None:
    series = _red(1)
    coefficients = spectra.to_cosine(series)
    assert np.sum(coefficients**2) == pytest.approx(np.sum(series**2))
    assert spectra.from_cosine(coefficients) == pytest.approx(series)


def test_bands_cover_every_coefficient_once() -> None:
    for n in (37, 400, 2249):
        edges = spectra.band_edges(n)
        assert edges[0] == 0
        assert edges[-1] == n
        assert np.all(np.diff(edges) > 0)


@pytest.mark.parametrize(
    ("reference_error", "own_error", "exponent"), [(1.0, 0.0, 1.0), (0.7, 0.7, 0.5)]
)
def test_slope_is_the_power_of_the_coherence_that_the_errors_imply(
    reference_error: float, own_error: float, exponent: float
) -> None:
    slopes, powers = [], []
    for seed in range(20):
        truth = _red(seed)
        reference = truth + reference_error * _red(100 + seed)
        measured = truth + own_error * _red(200 + seed)
        coherence = spectra.coherence_of(
            spectra.to_cosine(measured), spectra.to_cosine(reference), DT, N
        )
        slopes.append((coherence.cross / coherence.simulated)[5:])
        powers.append((coherence.squared**exponent)[5:])
    assert np.mean(slopes) == pytest.approx(np.mean(powers), rel=0.03)


def test_of_a_simulation_without_coherence_nothing_is_expected() -> None:
    """Noise that a simulation adds where it knows nothing must not be held against it."""
    wide = slice(200, None)
    chance: list[FloatArray] = []
    known: list[FloatArray] = []
    for seed in range(20):
        truth = _red(seed)
        for kept, other in ((chance, _red(300 + seed)), (known, truth + 0.5 * _red(100 + seed))):
            coherence = spectra.coherence_of(
                spectra.to_cosine(truth), spectra.to_cosine(other), DT, N
            )
            exponent = np.full(coherence.frequency.size, 0.3)
            kept.append(spectra.shrinkage(coherence, exponent, N)[wide])
    assert np.mean(chance) < 0.02
    assert np.mean(known) == pytest.approx(0.8**0.3, rel=0.02)


@given(st.integers(1, 200_000))
def test_quick_lengths_have_no_large_prime_factor_and_cost_little(n: int) -> None:
    length = spectra.quick_length(n)
    assert n - max(2.0, 0.03 * n) <= length <= n
    rest = length
    for factor in range(2, 24):
        while rest % factor == 0:
            rest //= factor
    assert rest == 1
    assert spectra.quick_length(length) == length


def test_noise_variance_whitens_red_noise() -> None:
    squares = []
    for seed in range(10):
        residual = spectra.to_cosine(_red(seed))[:2000]
        squares.append(residual**2 / spectra.noise_variance(residual, None, 0))
    mean = np.mean(squares, axis=0)
    assert np.mean(mean) == pytest.approx(1.0, abs=0.06)
    assert np.mean(mean[10:100]) == pytest.approx(1.0, abs=0.15)


def test_noise_variance_ignores_a_few_large_coefficients() -> None:
    residual = np.random.default_rng(3).standard_normal(2000)
    clean = spectra.noise_variance(residual, None, 0)
    residual[[300, 700, 1500]] = 60.0
    assert spectra.noise_variance(residual, None, 0) == pytest.approx(clean, rel=0.1)


def test_the_noise_of_narrow_bands_is_known_well() -> None:
    # A median of each band alone errs by 0.4 in the logarithm there.
    errors = []
    for seed in range(200):
        residual = np.random.default_rng(seed).standard_normal(2000)
        errors.append(np.log(spectra.noise_variance(residual, None, 0))[30:100])
    assert np.sqrt(np.mean(np.square(errors))) < 0.25
    assert np.mean(errors) == pytest.approx(0.0, abs=0.1)


def test_what_is_slow_does_not_raise_the_noise_above_it() -> None:
    residual = np.random.default_rng(7).standard_normal(2000)
    slow = residual.copy()
    slow[:30] *= 30.0
    ratio = np.ones(spectra.band_edges(2000).size - 1)
    plain, disturbed = (spectra.noise_variance(r, ratio, 36) for r in (residual, slow))
    assert disturbed == pytest.approx(plain)


def test_what_chance_adds_to_slow_noise_is_not_in_the_ratio_of_healthy_days() -> None:
    # Healthy noise is slow here by a factor of four less; chance adds as much as it has above.
    edges = spectra.band_edges(2000)
    ratio = np.full(edges.size - 1, 0.25)
    squares: dict[float, list[np.ndarray]] = {0.0: [], 1.0: []}
    for seed in range(40):
        rng = np.random.default_rng(seed)
        healthy = rng.standard_normal(2000) * np.where(np.arange(2000) < 36, 0.5, 1.0)
        residual = healthy + rng.standard_normal(2000)
        for by_chance, found in squares.items():
            variance = spectra.noise_variance(residual, ratio, 36, by_chance)
            found.append((residual**2 / variance)[:30])
    assert np.mean(squares[1.0]) == pytest.approx(1.0, abs=0.1)
    assert np.mean(squares[0.0]) > 2.0
