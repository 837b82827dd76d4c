"""Levels of quick eddies from half-minute to half-minute."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from wind_sensors.diagnosis.comparing import activity
from wind_sensors.diagnosis.comparing.observation import Channel, Grid
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import Term, planted

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


@given(st.floats(-50.0, 50.0), st.floats(0.0, 50.0))
def test_large_differences_count_less_but_never_fall(low: float, step: float) -> None:
    small, large = activity.compressed(np.array([low, low + step]))
    assert small <= large
    assert abs(small) <= abs(low)
    assert activity.compressed(np.array([-low])) == pytest.approx(-small)
    assert activity.compressed(np.array([0.5])) == pytest.approx(0.5, rel=0.02)


def test_what_all_instruments_share_is_found_among_their_own_noise() -> None:
    rng = np.random.default_rng(8)
    counted = np.ones(30, dtype=np.bool_)
    slow = activity.waves(counted, activity.USUAL_LIVELINESS)
    drawn = rng.normal(size=activity.WAVES)
    variances = np.array([0.02, 0.05, np.inf, 0.04])
    noise = np.sqrt(np.where(np.isinf(variances), 1.0, variances))[:, None]
    changes = activity.contrasts(drawn @ slow + noise * rng.normal(size=(4, 30)), counted)
    sizes, unknown = activity.shared_waves(changes, variances, counted)
    away = (sizes - drawn) @ np.linalg.solve(unknown, sizes - drawn)
    assert 1.0 < away < 25.0
    # Without any band that is seen, everything is as unknown as it was before.
    sizes, unknown = activity.shared_waves(changes, np.full(4, np.inf), counted)
    assert np.all(sizes == 0.0)
    assert unknown == pytest.approx(np.eye(activity.WAVES))


def test_a_change_of_all_instruments_is_the_winds_and_of_one_is_its_own() -> None:
    """The reference comes into a lee for a while: both instruments are livelier than it says."""
    searcher = searcher_of(prepare(recorded(STATION, 9)), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    comparison = searcher.comparison
    counted = comparison.measured.counted
    second_half = np.arange(counted.size) >= 0.5 * counted.size
    later = activity.contrasts(second_half.astype(np.float64), counted)

    def length_of(livelier: dict[str, float]) -> tuple[float, float]:
        rises = [livelier[c.name] * np.tile(later, activity.BANDS) for c in comparison.channels]
        change = np.zeros(comparison.channel_of_each.size)
        change[-sum(r.size for r in rises) :] = np.concatenate(rises)
        noise = np.nan_to_num(change * comparison.weights(null.trust))
        white = null.of_changes(change)
        return float(noise @ noise), float(white @ white)

    cup, vane = (c.name for c in comparison.channels)
    both, both_left = length_of({cup: 0.3, vane: 0.3})
    one, one_left = length_of({cup: 0.3, vane: -0.3})
    assert one == pytest.approx(both)
    assert both_left < 0.3 * both
    assert one_left > 2.0 * both_left


def test_where_a_rotor_stands_still_eddies_do_not_count() -> None:
    sticky = {"friction_speed": 3.0, "temperature_coefficient": 0.0, "breakaway": 1.0}
    braked = planted(STATION, [Term(catalogue()["bearing_friction"], "cup", sticky)])
    healthy = prepare(recorded(STATION, 9, mean=3.0)).measured.counted
    halted = prepare(recorded(braked, 9, mean=3.0)).measured.counted
    assert healthy.mean() > 0.9
    assert halted.mean() < 0.5
