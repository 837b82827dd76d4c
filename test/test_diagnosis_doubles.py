"""Messages that came twice, and stamps that would make a recording one of years."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.errors import UserError
from wind_sensors.simulation.drive import drive_from_recording
from wind_sensors.station.doubles import without_doubles
from wind_sensors.station.signals import Angles, Pulses, Recording, Series, Winds


def twice(whole: Recording) -> Recording:
    """The recording with every message twice."""
    assert whole.reference is not None
    vane = whole.angles["vane"]
    return replace(
        whole,
        pulses={"cup": Pulses(np.repeat(whole.pulses["cup"].time, 2))},
        angles={"vane": Angles(np.repeat(vane.time, 2), np.repeat(vane.angle, 2))},
        reference=Winds(
            np.repeat(whole.reference.time, 2), np.repeat(whole.reference.velocity, 2, axis=0)
        ),
    )


def test_what_came_twice_counts_once() -> None:
    whole = recorded(STATION, 59)
    single, doubled = prepare(whole), prepare(twice(whole))
    assert np.array_equal(
        single.measured.flat(single.channels),
        doubled.measured.flat(doubled.channels),
        equal_nan=True,
    )
    assert single.repeated == doubled.repeated


def test_the_order_of_arrival_stays_and_sound_signals_are_the_same() -> None:
    whole = recorded(STATION, 59)
    assert without_doubles(whole).pulses["cup"] is whole.pulses["cup"]
    late = Pulses(np.array([5, 3, 5, 8, 3], dtype=np.int64), np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
    cleared = without_doubles(
        replace(whole, pulses={"cup": late}, pressure=Series(late.time, np.arange(5.0)))
    )
    assert cleared.pulses["cup"].time.tolist() == [5, 3, 8]
    assert cleared.pulses["cup"].turns is not None
    assert cleared.pulses["cup"].turns.tolist() == [1.0, 2.0, 4.0]
    assert cleared.pressure is not None
    assert cleared.pressure.value.tolist() == [0.0, 1.0, 3.0]


def test_a_wind_of_years_is_refused_before_it_fills_the_memory() -> None:
    whole = recorded(STATION, 59)
    assert whole.reference is not None
    time = whole.reference.time.copy()
    time[4000:] += 300_000_000 * 1_000_000_000
    with pytest.raises(UserError, match=r"spread over 34\d\d days: too long"):
        drive_from_recording(replace(whole, reference=replace(whole.reference, time=time)))
