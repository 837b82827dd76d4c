"""Levels of quick eddies from half-minute to half-minute."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wind_sensors.diagnosis import activity
from wind_sensors.diagnosis.observation import Channel, Grid

CUP = Channel("cup/rotor_rate", "cup", "rotor_rate", length=2.0)
GRID = Grid(start=0, dt=0.2, n=4510)
SPEED = 7.0


def test_the_last_segment_holds_what_remains() -> None:
    number = activity.segments_of(GRID)
    assert np.bincount(number).tolist() == [150] * 29 + [160]
    assert activity.segments_of(Grid(0, 0.2, 40)).tolist() == [0] * 40


def test_a_level_rises_where_eddies_grow_and_in_no_other_band() -> None:
    """A sine of 0.5 Hz lies in the second band (0.45 to 1.11 Hz); twice its amplitude is log 4."""
    time = GRID.centres
    size = np.where(time < 450.0, 1.0, 2.0)
    found = activity.levels(size * np.sin(np.pi * time), CUP, SPEED, GRID)
    low, high = activity.band_frequencies(CUP, SPEED, GRID)[1]
    assert low < 0.5 < high
    rise = activity.contrasts(found, np.ones(30, dtype=np.bool_))[1]
    # Segments beside the change see something of both.
    assert rise[:14] == pytest.approx(-0.5 * np.log(4.0), abs=0.05)
    assert rise[16:] == pytest.approx(0.5 * np.log(4.0), abs=0.05)
    assert np.all(found[[0, 2], 3:12] < found[1, 3:12] - 4.0)


def test_levels_of_independent_noise_scatter_as_stated() -> None:
    rng = np.random.default_rng(5)
    one, other = (
        np.array([activity.levels(rng.normal(size=GRID.n), CUP, SPEED, GRID) for _ in range(40)])
        for _ in range(2)
    )
    stated = activity.sampling_variance(CUP, SPEED, GRID)
    scatter = np.var(one - other, axis=(0, 2))
    # The logarithm of a mean of few squares scatters somewhat more than its first order says.
    assert scatter == pytest.approx(stated, rel=0.15)


def test_bands_with_too_few_coefficients_say_nothing() -> None:
    slow = Channel("vane/vane_angle", "vane", "vane_angle", length=0.2)
    assert np.isinf(activity.sampling_variance(slow, 5.0, GRID)[-1])
    assert np.isfinite(activity.sampling_variance(CUP, SPEED, GRID)).all()


def test_segments_with_bins_outside_the_mask_do_not_count() -> None:
    mask = np.ones(GRID.n)
    mask[200] = 0.0
    counted = activity.counted_segments(GRID, mask)
    assert np.flatnonzero(~counted).tolist() == [1]
    assert activity.counted_segments(GRID, None).all()


@given(
    arrays(np.float64, (3, 12), elements=st.floats(-20.0, 20.0)),
    arrays(np.bool_, 12),
    st.floats(-10.0, 10.0),
)
def test_contrasts_know_no_common_level(
    level: np.ndarray, counted: np.ndarray, common: float
) -> None:
    found = activity.contrasts(level, counted)
    assert np.all(found[:, ~counted] == 0.0)
    assert np.abs(found.sum(axis=1)).max() < 1e-9
    assert activity.contrasts(level + common, counted) == pytest.approx(found, abs=1e-9)
