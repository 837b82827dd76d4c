"""The least-squares search on costs whose shape is known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
TILT = catalogue()["axis_tilt"]
TRUE = 30.0


class Valley:
    """A comparison with one datum, how far a lean is from the truth, and a rough one.

    Args:
        ripple: Height of what is rough: over a step of the derivative it does what chance does.
    """

    def __init__(self, ripple: float) -> None:
        self.ripple = ripple
        self.comparison = self
        self.channels = ()
        self.drive = SimpleNamespace(temperature=None, dt=1.0, elapsed=0.0)

    def possible(self, station: Station, *_: Any, **__: Any) -> Any:
        x = station.instruments[1].tilt_deg[0]
        wave = np.sin(1e3 * x)
        data = np.array([0.5 * (x - TRUE), self.ripple * wave])
        return SimpleNamespace(flat=lambda channels, with_motion=True: data)

    def of(self, simulated: Any) -> FloatArray:
        return -np.asarray(simulated.flat(()))

    def of_changes(self, changes: FloatArray) -> FloatArray:
        return changes


@pytest.mark.parametrize(
    ("ripple", "start", "within"), [(0.0, 6.0, 0.3), (4.0, 9.0, 14.0), (4.0, 12.0, 8.0)]
)
def test_hollows_in_the_cost_are_stepped_over(
    ripple: float, start: float, within: float
) -> None:
    begun = Term(TILT, "station", {"tilt_x": start, "tilt_y": 0.0}, held=frozenset({"tilt_y"}))
    found = fit(cast(Whitener, Valley(ripple)), STATION, [begun])
    assert found.terms[0].values["tilt_x"] == pytest.approx(TRUE, abs=within)
