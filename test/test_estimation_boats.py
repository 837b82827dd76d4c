"""Healthy boats of the shared material: the earth's wind once motion is removed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from estimation_cases import shared_recording
from representatives import represented

from wind_sensors.estimation import EstimatorSettings, process
from wind_sensors.estimation.scoring import agreement

BOATS = [f"station-b/healthy-{i}" for i in range(1, 5)]
WHOLE = EstimatorSettings(window=900.0)


@pytest.mark.parametrize("name", represented(BOATS, by=("station-b/healthy-1",)))
def test_the_earths_wind_is_found_on_a_moving_boat(name: str) -> None:
    found = agreement(process(shared_recording(name), WHOLE))
    assert abs(found.vector_speed_error) < 0.01
    assert abs(found.scalar_speed_error_allowed) < 0.01
    assert abs(found.direction_error) < math.radians(1.0)
    assert 0.85 <= found.coverage <= 0.95


def test_estimates_that_ignore_the_motion_are_far_off() -> None:
    recording = shared_recording("station-b/healthy-2")
    result = process(recording, WHOLE)
    still = agreement(result)
    # The apparent wind in the boat's own axes is no substitute for the earth's.
    carried = agreement(result, velocity=result.apparent)
    assert carried.rms > 3.0 * still.rms
    assert np.all(np.isfinite(result.velocity))
