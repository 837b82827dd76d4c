"""A vane that says nothing for a while, or one number all the time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.errors import UserError
from wind_sensors.station.signals import Angles, Recording

Times = npt.NDArray[np.float64]


def silent(recording: Recording, when: Callable[[Times], npt.NDArray[np.bool_]]) -> Recording:
    """The recording without its vane's readings of some times [s since its start]."""
    readings = recording.angles["vane"]
    keep = ~when((readings.time - readings.time[0]) * 1e-9)
    told = Angles(readings.time[keep], readings.angle[keep])
    return replace(recording, angles={"vane": told})


def not_a_number(recording: Recording, when: Callable[[Times], npt.NDArray[np.bool_]]) -> Recording:
    """The same with readings that are no number in their place."""
    readings = recording.angles["vane"]
    gone = when((readings.time - readings.time[0]) * 1e-9)
    told = Angles(readings.time, np.where(gone, np.nan, readings.angle))
    return replace(recording, angles={"vane": told})


@pytest.mark.parametrize("lose", [silent, not_a_number])
def test_what_a_vane_does_not_tell_is_not_compared(
    lose: Callable[[Recording, Callable[[Times], npt.NDArray[np.bool_]]], Recording],
) -> None:
    lost = lose(recorded(STATION, 41), lambda t: t > 120.0)
    found = diagnose(lost, baseline())
    assert found.verdict == "none"
    (note,) = found.comparison.recording.notes
    assert note.startswith("vane: no readings for ") and " from 120 to " in note
    mask = found.comparison.mask
    assert mask is not None
    at = found.comparison.grid.centres
    assert np.all(mask[at > 125.0] == 0.0) and np.all(mask[(at > 2.0) & (at < 115.0)] == 1.0)


def test_readings_that_are_always_far_apart_are_no_silence() -> None:
    recording = recorded(STATION, 41)
    readings = recording.angles["vane"]
    seldom = Angles(readings.time[::40], readings.angle[::40])
    comparison = prepare(replace(recording, angles={"vane": seldom}))
    assert comparison.recording.notes == () and comparison.mask is None


def test_too_little_is_refused() -> None:
    lost = silent(recorded(STATION, 41), lambda t: t > 40.0)
    with pytest.raises(UserError, match="both the reference and the vanes"):
        prepare(lost)


def test_a_vane_that_reads_one_number_all_the_time_is_stuck() -> None:
    recording = recorded(STATION, 41)
    readings = recording.angles["vane"]
    stuck = Angles(readings.time, np.full_like(readings.angle, 2.0))
    found = diagnose(replace(recording, angles={"vane": stuck}), baseline())
    assert found.verdict == "named"
    assert [f.term.key for f in found.findings] == [("stuck_sensor", "vane")]
