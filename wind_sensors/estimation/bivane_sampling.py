"""Whether a bivane is read often enough for its resonance to be removed.

Mitsuta (1966), (6), differences three samples: within 2 % at resonance from 18 samples in a free
period on (derived, for a damping ratio of 0.15). The filter integrates the equation of motion
between the samples and keeps the gain at resonance within some percent down to six.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from wind_sensors.estimation.intake import InputRecord
from wind_sensors.estimation.outputs import HealthItem, HealthLevel
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.instruments.bivane import judge_sampling
from wind_sensors.station.model import Bivane, Station

FEWEST_SAMPLES = {"kalman": 6.0, "inverse": 18.0}
"""In a free period, by method."""
_CALM = 0.5
"""Below this speed there is no resonance to speak of [m/s]."""


def sampling_health(
    station: Station,
    records: Mapping[str, InputRecord],
    settings: EstimatorSettings,
    speed: float,
) -> list[HealthItem]:
    """Item `<bivane> sampling` of each bivane.

    Args:
        station: The station.
        records: Inputs with their rates.
        settings: The method matters.
        speed: Apparent wind speed [m/s].
    """
    items = []
    for bivane in station.instruments:
        if not isinstance(bivane, Bivane) or speed < _CALM:
            continue
        rate = records[f"{bivane.name}/elevation"].rate
        if rate <= 0.0:
            continue
        free_wind_run = 2.0 * math.pi * bivane.distance_constant
        verdict = judge_sampling(free_wind_run, speed, 1.0 / rate, bivane.damping_ratio)
        values = {
            "free period": f"{free_wind_run / speed:.2f} s at {speed:.1f} m/s",
            "samples per free period": f"{verdict.samples_per_period:.1f}",
            "gain of a three-point reduction at resonance": f"{verdict.gain_at_resonance:.3f}",
        }
        items.append(
            HealthItem(
                f"{bivane.name} sampling",
                *_judged(verdict.samples_per_period, settings.method, speed, free_wind_run),
                values,
            )
        )
    return items


def _judged(
    samples: float, method: str, speed: float, free_wind_run: float
) -> tuple[HealthLevel, str]:
    if method not in FEWEST_SAMPLES:
        return HealthLevel.WARN, f"Method {method} leaves the resonance in the vertical wind."
    fewest = FEWEST_SAMPLES[method]
    if samples >= fewest:
        return HealthLevel.OK, "Read often enough to remove the resonance."
    needed = fewest * speed / free_wind_run
    return (
        HealthLevel.WARN,
        f"Only {samples:.1f} readings in a free period: the resonance is not removed well; read "
        f"it at {needed:.1f} Hz or more at this wind speed"
        + ("." if method == "kalman" else ", or use method kalman."),
    )
