"""A rotor's pulse line that falls silent for a while."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.signals import Pulses, Recording

KEY = ("stuck_sensor", "cup")
SECOND = 1_000_000_000


def silent(begin: float, end: float, strays: tuple[float, ...] = ()) -> Recording:
    """A recording without the cup's pulses between two times [s], but for strays."""
    recording = recorded(STATION, 58)
    time = recording.pulses["cup"].time
    kept = time[(time < begin * SECOND) | (time > end * SECOND)]
    added = np.array([round(s * SECOND) for s in strays], dtype=np.int64)
    return replace(recording, pulses={"cup": Pulses(np.sort(np.concatenate((kept, added))))})


@pytest.mark.parametrize("strays", [(), (147.0,), (104.0, 118.5, 147.8)])
def test_stray_pulses_do_not_cut_a_silence_short(strays: tuple[float, ...]) -> None:
    (term,) = guesses_of(prepare(silent(100.0, 150.0, strays)), STATION)[KEY]
    assert term.values["start"] == pytest.approx(100.0, abs=0.2)
    assert term.values["stop"] == pytest.approx(150.0, abs=0.2)


def test_a_rotor_that_turns_on_is_not_silent() -> None:
    # A second or two with most of the pulses is the rotor.
    strays = tuple(np.arange(125.0, 127.0, 0.03))
    (term,) = guesses_of(prepare(silent(100.0, 150.0, strays)), STATION)[KEY]
    assert term.values["start"] == pytest.approx(100.0, abs=0.3)
    assert term.values["stop"] == pytest.approx(125.0, abs=0.3)
    assert KEY not in guesses_of(prepare(recorded(STATION, 58)), STATION)


def test_a_silence_is_named_with_its_times() -> None:
    found = diagnose(silent(100.0, 150.0, (147.0,)), baseline())
    assert found.verdict == "named"
    (finding,) = found.findings
    assert finding.term.key == KEY
    for name, true in (("start", 100.0), ("stop", 150.0)):
        estimate = finding.parameters[name]
        assert estimate.low < true < estimate.high
        assert estimate.high - estimate.low < 1.0
