"""What a recording bears out, whatever explains it."""

from __future__ import annotations

import pytest

from wind_sensors.diagnosis.proving.rules import Verdict, of_the_recording, with_silence
from wind_sensors.station.silence import Silent, told_first

SILENT = Silent("vane", "/vane", "readings")


@pytest.mark.parametrize(
    ("verdict", "repeated", "calm", "final"),
    [
        ("none", 0.0, False, "none"),
        ("none", 0.0, True, "none"),
        ("none", 0.2, False, "unknown"),
        ("none", 0.2, True, "inconclusive"),
        ("unknown", 0.0, False, "unknown"),
        ("unknown", 0.0, True, "inconclusive"),
        ("named", 0.2, True, "named"),
        ("ambiguous", 0.2, True, "ambiguous"),
    ],
)
def test_a_recording_bears_out_only_what_is_normal_in_it(
    verdict: Verdict, repeated: float, calm: bool, final: Verdict
) -> None:
    assert of_the_recording(verdict, repeated, calm) == final


def test_nobody_knows_that_what_says_nothing_is_well() -> None:
    assert with_silence("none", [SILENT]) == "unknown"
    assert with_silence("none", []) == "none"
    assert with_silence("named", [SILENT]) == "named"
    assert with_silence("inconclusive", [SILENT]) == "inconclusive"


def test_what_says_nothing_is_told_first() -> None:
    assert told_first([SILENT], "left") == f"{SILENT.words}; left"
    assert told_first([SILENT], "") == SILENT.words
    assert told_first([], "left") == "left"
