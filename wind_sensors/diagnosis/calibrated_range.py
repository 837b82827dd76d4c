"""Whether a record lies where certificates say what is normal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.comparison import Comparison
from wind_sensors.diagnosis.fitting import Term

CALIBRATED_FROM = 4.0
"""Slowest wind of a calibration [m/s] (IEC 61400-12-1). Below it the straight line through the
calibration is continued to the starting speed, near which it cannot hold."""

FEWEST_CALIBRATED = 0.25
"""Share of a record that must lie above."""

TOO_CALM = (
    f"the wind is below {CALIBRATED_FROM:g} m/s nearly all the time, where calibrations do not "
    "reach, and no healthy recording shows what is normal there"
)


def is_too_calm(comparison: Comparison, baseline: Baseline) -> bool:
    """Whether nothing says what is normal in the winds of a record.

    Healthy recordings say it for their winds; without any, the certificates stand in, for the
    winds of a calibration.
    """
    if baseline.calibrated:
        return False
    return float(np.mean(comparison.speed >= CALIBRATED_FROM)) < FEWEST_CALIBRATED


def need_calibration(terms: Sequence[Term]) -> bool:
    """Whether any of some effects stands on healthy instruments too, in small.

    What is there or is not (readings that repeat, swapped sensors) needs no calibration.
    """
    return any(term.effect.standing > 0.0 for term in terms)
