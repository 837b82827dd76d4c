"""Whether a record lies where it is known what is normal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.comparison import Comparison
from wind_sensors.diagnosis.fitting import Term

FEWEST_KNOWN = 0.25
"""Share of a record in which that must be known."""


def is_too_calm(comparison: Comparison, baseline: Baseline) -> bool:
    """Whether nothing says what is normal in the winds of a record.

    Healthy recordings say it for their winds, certificates for the winds of a calibration.
    """
    return float(np.mean(comparison.speed >= baseline.slowest_wind)) < FEWEST_KNOWN


def too_calm(baseline: Baseline) -> str:
    """Why nothing is said about such a record."""
    return (
        f"the wind is below {baseline.slowest_wind:.1f} m/s nearly all the time, where "
        "calibrations do not reach, and no healthy recording shows what is normal there"
    )


def need_calibration(terms: Sequence[Term]) -> bool:
    """Whether any of some effects stands on healthy instruments too, in small.

    What is there or is not (readings that repeat, swapped sensors) needs no calibration.
    """
    return any(term.effect.standing > 0.0 for term in terms)
