"""Whether a record lies where it is known what is normal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.baseline import CALIBRATED_FROM, Baseline

FEWEST_KNOWN = 0.25
"""Share of a record in which that must be known."""


CALM_SHARE = 0.2
"""A record is calm from this share in such winds on."""

REACH = 0.5
"""Down to this share of their wind, healthy recordings say something of what is normal."""


def slowest_wind(baseline: Baseline) -> float:
    """Wind speed [m/s] below which nothing is known of what is normal."""
    return min(CALIBRATED_FROM, REACH * baseline.usual_wind)


def calm_share(comparison: Comparison, baseline: Baseline) -> float:
    """Share of a record in winds that neither certificates nor healthy recordings cover."""
    return float(np.mean(comparison.speed < min(CALIBRATED_FROM, baseline.usual_wind)))


def is_calm(comparison: Comparison) -> bool:
    """Whether much of a record lies in winds below those of a calibration.

    A rotor near its starting speed and a vane that hardly feels the wind do there what they never
    do in a wind: what a calm day shows is no measure of a windy one.
    """
    return float(np.mean(comparison.speed < CALIBRATED_FROM)) > CALM_SHARE


def is_too_calm(comparison: Comparison, baseline: Baseline) -> bool:
    """Whether nothing says what is normal in the winds of a record.

    Healthy recordings say it for their winds, certificates for the winds of a calibration.
    """
    return float(np.mean(comparison.speed >= slowest_wind(baseline))) < FEWEST_KNOWN


def too_calm(baseline: Baseline) -> str:
    """Why nothing is said about such a record."""
    return (
        f"the wind is below {slowest_wind(baseline):.1f} m/s nearly all the time, where "
        "calibrations do not reach, and no healthy recording shows what is normal there"
    )


def need_calibration(terms: Sequence[Term]) -> bool:
    """Whether any of some effects stands on healthy instruments too, in small.

    What is there or is not (readings that repeat, swapped sensors) needs no calibration.
    """
    return any(term.effect.standing > 0.0 for term in terms)
