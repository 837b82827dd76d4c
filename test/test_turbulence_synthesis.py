"""Synthetic turbulence has the statistics asked for, whatever the way it is read."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from wind_sensors.turbulence import surface_layer, von_karman
from wind_sensors.turbulence.synthesis import (
    TurbulenceSpec,
    TurbulenceStream,
    isotropic_spec,
    largest_uw_correlation,
    surface_layer_spec,
    synthesize,
)

SPEC = TurbulenceSpec(
    mean_speed=7.0,
    direction=0.9,
    standard_deviations=(1.2, 0.9, 0.5),
    integral_lengths=(40.0, 20.0, 8.0),
    uw_correlation=-0.3,
    slow_amplitude=0.7,
    slow_period=433.0,
    turn_amplitude=0.1,
    seed=12,
)


def test_any_block_size_gives_the_same_bits() -> None:
    whole = synthesize(SPEC, 16.0, 20_000)
    stream = TurbulenceStream(SPEC, 16.0)
    sizes = [1, 2, 3, 1021, 4096, 7000, 1]
    pieces = [stream.read(size) for size in sizes]
    pieces.append(stream.read(20_000 - sum(sizes)))
    assert np.array_equal(np.concatenate(pieces), whole)
    stream.seek(13_333)
    assert np.array_equal(stream.read(77), whole[13_333:13_410])


def test_seeds_differ_and_repeat() -> None:
    spec = isotropic_spec(5.0, 0.1, 10.0, seed=1)
    other = isotropic_spec(5.0, 0.1, 10.0, seed=2)
    assert np.array_equal(synthesize(spec, 10.0, 500), synthesize(spec, 10.0, 500))
    assert not np.allclose(synthesize(spec, 10.0, 500), synthesize(other, 10.0, 500))


def test_memory_does_not_grow() -> None:
    stream = TurbulenceStream(isotropic_spec(5.0, 0.1, 10.0), 10.0)
    for _ in range(50):
        stream.read(997)
    assert len(stream._blocks) <= 2


def axes_of_the_mean_wind(spec: TurbulenceSpec, velocity: np.ndarray) -> np.ndarray:
    c, s = math.cos(spec.direction), math.sin(spec.direction)
    east, north, up = velocity.T
    return np.stack([east * c + north * s, -east * s + north * c, up])


def test_variances_flux_and_spectra_are_those_asked_for() -> None:
    """Against the von Karman spectra themselves, in bands from the largest to small scales."""
    spec = surface_layer_spec(8.0, 12.0, 0.05, direction=-0.6, seed=3)
    rate, count = 8.0, 2**19
    u, v, w = axes_of_the_mean_wind(spec, synthesize(spec, rate, count))
    sigmas = spec.standard_deviations
    duration = count / rate
    for axis, record in enumerate((u - spec.mean_speed, v, w)):
        scale = spec.integral_lengths[axis] / spec.mean_speed
        error = 4.0 * math.sqrt(scale / duration)
        assert float(np.mean(record)) == pytest.approx(
            0.0, abs=4.0 * sigmas[axis] * math.sqrt(2.0 * scale / duration)
        )
        assert float(np.var(record)) == pytest.approx(sigmas[axis] ** 2, rel=error)
    assert float(np.mean((u - spec.mean_speed) * w)) == pytest.approx(
        spec.uw_correlation * sigmas[0] * sigmas[2], rel=0.05
    )
    for axis, record in enumerate((u, v, w)):
        frequency, power = signal.welch(record, rate, nperseg=8192)
        wavenumber = 2.0 * math.pi * frequency / spec.mean_speed
        q = von_karman.wavenumber_from_integral_length(spec.integral_lengths[axis])
        shape = von_karman.longitudinal_spectrum if axis == 0 else von_karman.transverse_spectrum
        model = shape(wavenumber, sigmas[axis] ** 2, q) * 4.0 * math.pi / spec.mean_speed
        total = np.sum(model[1:]) * frequency[1]
        model *= sigmas[axis] ** 2 / total
        edges = np.geomspace(0.003, 3.9, 9)
        for low, high in itertools.pairwise(edges):
            band = (frequency >= low) & (frequency < high)
            ratio = float(np.mean(power[band]) / np.mean(model[band]))
            samples = 1.5 * duration * (high - low)
            assert ratio == pytest.approx(1.0, abs=0.03 + 5.0 / math.sqrt(samples))


def test_blocks_leave_no_seam() -> None:
    """The variance is the same at every place of a block, ensemble of seeds."""
    ensemble = []
    for seed in range(400):
        spec = isotropic_spec(5.0, 0.2, 2.0, seed=seed)
        ensemble.append(TurbulenceStream(spec, 10.0).fluctuations(0, 1024)[:, 0])
    variance = np.var(np.array(ensemble), axis=0)
    coarse = variance.reshape(16, 64).mean(axis=1)
    assert np.allclose(coarse, 1.0, atol=0.15)


def test_slow_mean_and_turn() -> None:
    calm = TurbulenceSpec(
        mean_speed=6.0, direction=0.4, slow_amplitude=2.0, slow_period=100.0, turn_amplitude=0.2
    )
    velocity = synthesize(calm, 1.0, 100)
    slow = np.sin(2.0 * np.pi * np.arange(100) / 100.0)
    assert np.allclose(np.hypot(velocity[:, 0], velocity[:, 1]), 6.0 + 2.0 * slow, rtol=1e-12)
    assert np.allclose(np.arctan2(velocity[:, 1], velocity[:, 0]), 0.4 + 0.2 * slow, rtol=1e-12)


def test_the_turn_may_have_a_period_of_its_own() -> None:
    calm = TurbulenceSpec(
        mean_speed=6.0, slow_amplitude=2.0, slow_period=100.0, turn_amplitude=0.3, turn_period=37.0
    )
    velocity = synthesize(calm, 1.0, 100)
    turned = 0.3 * np.sin(2.0 * np.pi * np.arange(100) / 37.0)
    assert np.allclose(np.arctan2(velocity[:, 1], velocity[:, 0]), turned, atol=1e-12)


def test_small_scales_of_the_surface_layer_are_isotropic() -> None:
    """The three inertial subranges have one dissipation, that of the surface layer."""
    spec = surface_layer_spec(8.0, 12.0, 0.05)
    u_star = float(surface_layer.friction_velocity(8.0, 12.0 / 0.05))
    dissipation = float(surface_layer.dissipation(u_star, 12.0))
    alpha = 0.165 / 0.4 ** (4.0 / 3.0) * 55.0 / 18.0
    for sigma, length in zip(spec.standard_deviations, spec.integral_lengths, strict=True):
        q = von_karman.wavenumber_from_integral_length(length)
        found = von_karman.dissipation_from_variance(sigma**2, q, alpha)
        assert found == pytest.approx(dissipation, rel=1e-12)


def test_impossible_wishes_are_refused() -> None:
    with pytest.raises(ValueError, match="correlation"):
        TurbulenceStream(
            TurbulenceSpec(5.0, 0.0, (1.0, 1.0, 1.0), (100.0, 100.0, 1.0), uw_correlation=-0.95),
            10.0,
        )
    with pytest.raises(ValueError, match="mean speed"):
        TurbulenceStream(TurbulenceSpec(0.0), 10.0)
    largest = largest_uw_correlation(SPEC, 10.0)
    assert 0.3 < largest < 1.0
    TurbulenceStream(replace(SPEC, uw_correlation=-0.999 * largest), 10.0)
    with pytest.raises(ValueError, match="correlation"):
        TurbulenceStream(replace(SPEC, uw_correlation=-1.001 * largest), 10.0)
