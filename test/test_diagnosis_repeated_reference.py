"""A reference that fills gaps with its last wind: what it repeats is no wind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.counted_time import (
    soft,
    where_reference_is,
    without_repeats,
)
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects.definition import with_keys
from wind_sensors.diagnosis.healthy.whitening import trust_of, unstanding
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.errors import UserError
from wind_sensors.station.signals import Recording


def holding(recording: Recording, every: float, held: float) -> Recording:
    """The recording with a reference that repeats its wind for so long [s], every so often [s]."""
    assert recording.reference is not None
    time, velocity = recording.reference.time, recording.reference.velocity
    seconds = (time - time[0]) * 1e-9
    last = np.where(seconds % every < held, 0, np.arange(time.size))
    last = np.maximum.accumulate(last)
    return replace(recording, reference=replace(recording.reference, velocity=velocity[last]))


def test_what_is_repeated_for_long_is_left_out_and_the_first_of_it_stays() -> None:
    recording = holding(recorded(STATION, 61), 20.0, 4.0)
    found, share = without_repeats(recording)
    assert found.reference is not None and recording.reference is not None
    silent = ~np.all(np.isfinite(found.reference.velocity), axis=1)
    seconds = (recording.reference.time - recording.reference.time[0]) * 1e-9
    held = (seconds % 20.0 < 4.0) & (seconds > 1.0)
    np.testing.assert_array_equal(silent[seconds > 4.0], held[seconds > 4.0])
    assert share == pytest.approx(np.mean(held), abs=0.01)


def test_short_repeats_and_a_tunnels_wind_stay() -> None:
    short = holding(recorded(STATION, 61), 20.0, 0.8)
    assert without_repeats(short) == (short, 0.0)
    assert STATION.reference is not None
    tunnel = STATION.reference.model_copy(update={"kind": "tunnel"})
    long = holding(recorded(STATION, 61), 20.0, 4.0)
    long = replace(long, station=STATION.model_copy(update={"reference": tunnel}))
    assert without_repeats(long) == (long, 0.0)


def test_a_healthy_station_with_such_a_reference_is_told_of_it_and_nothing_is_named() -> None:
    found = diagnose(holding(recorded(STATION, 61), 20.0, 4.0), baseline(), with_proof=False)
    assert found.verdict == "unknown" and not found.findings
    assert "repeats its last wind in 20 %" in found.unexplained.description


def test_a_reference_that_hardly_ever_changes_is_refused() -> None:
    with pytest.raises(UserError, match="repeats the same wind"):
        prepare(holding(recorded(STATION, 61), 20.0, 18.0))


def test_what_counts_in_part_is_as_noisy_as_the_whole() -> None:
    whole = prepare(recorded(STATION, 61), baseline().station, baseline().place)
    counted = soft((np.floor(whole.grid.centres / 20.0) % 2 == 0).astype(np.float64))
    half = whole.within(counted)
    assert half.counted_share == pytest.approx(0.45, abs=0.05)
    noise, in_half = (
        trust_of(seen, seen.simulate(seen.station), baseline()) for seen in (whole, half)
    )
    for channel in whole.channels:
        ratio = in_half[channel.name].deviation / noise[channel.name].deviation
        assert np.median(ratio) == pytest.approx(1.0, abs=0.1)


def test_half_a_record_speaks_half_as_loud_for_the_truth() -> None:
    heavy = recorded(with_keys(STATION, "cup", {"inertia_factor": 3.0}), 61)
    whole = prepare(replace(heavy, station=STATION), baseline().station, baseline().place)
    counted = soft((np.floor(whole.grid.centres / 20.0) % 2 == 0).astype(np.float64))
    half = whole.within(counted)
    truth = with_keys(whole.station, "cup", {"inertia_factor": 3.0})

    def said(seen: Comparison) -> float:
        """What the truth brings, in the noise that it leaves."""
        known = seen.simulate(truth)
        whitener = unstanding(seen, trust_of(seen, known, baseline()))
        costs = [np.sum(whitener.of(each) ** 2) for each in (seen.simulate(seen.station), known)]
        return float(costs[0] - costs[1])

    assert said(half) == pytest.approx(half.counted_share * said(whole), rel=0.25)


@pytest.mark.parametrize("answering, wait", [(0.1, 1.0), (1.5, 4.5)])
def test_after_a_gap_an_instrument_has_time_to_forget_the_wind_made_up(
    answering: float, wait: float
) -> None:
    found, _ = without_repeats(holding(recorded(STATION, 61), 20.0, 4.0))
    grid = prepare(recorded(STATION, 61)).grid
    weights = where_reference_is(found, grid, np.full(grid.n, answering))
    since_gap = grid.centres % 20.0 - 4.0
    later = grid.centres > 20.0
    assert np.all(weights[later & (since_gap > 0.0) & (since_gap < wait - 0.3)] == 0.0)
    assert np.all(weights[later & (since_gap > wait + 3.0) & (since_gap < 12.0)] == 1.0)
