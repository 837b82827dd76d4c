"""What may be said of a recording where no healthy one tells what is normal."""

from __future__ import annotations

import pytest
from diagnosis_cases import STATION, recorded
from estimation_cases import shared_recording

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.healthy.learning import default_baseline
from wind_sensors.diagnosis.verdict import diagnose


def test_what_is_plain_is_named() -> None:
    turned = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": 9.0})
    found = diagnose(recorded(turned, 31), default_baseline(STATION))
    assert found.verdict == "named"
    assert [f.term.key for f in found.findings] == [("vane_offset", "vane")]


@pytest.mark.parametrize("name", ["station-a/healthy-4", "station-c/healthy-2"])
def test_a_healthy_day_of_an_instrument_that_is_not_as_its_certificate_gets_no_name(
    name: str,
) -> None:
    """Both instruments depart from their equations in a way that a fault would, too."""
    recording = shared_recording(name)
    found = diagnose(recording, default_baseline(recording.station))
    assert found.verdict == "inconclusive"
    assert found.findings == ()
    assert "no healthy recording tells what is normal" in found.objection
