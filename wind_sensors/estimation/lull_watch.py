"""Lulls in which a single rotor tells two winds.

The torque is quadratic in the wind: one acceleration belongs to two forcings whose sum is
y (2 - 1/a4), as for Jackson's propellers (undated report, c. 1980, (10)). The wind gets from one to
the other through their middle, where the rotor slows down most. A filter that expects gusts of the
usual size turns back before it; once its estimate has come close to the middle, either wind may
hold until the rotor speeds up, which only the larger one makes it do.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import rotors_of
from wind_sensors.estimation.core import Estimates
from wind_sensors.estimation.outputs import HealthItem, HealthLevel
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.station.model import Propeller, Station
from wind_sensors.station.parameters import rotor_parameters

FloatArray = npt.NDArray[np.float64]

_CLOSE = 0.42
"""Roots as close to each other as this share of the rotor's speed may have changed places: a wind
that falls from 5 to 0.5 m/s in a second is followed to 0.4, one of an intensity of 0.3 seldom."""
_CLEAR = 1.0
"""The other root is below zero by so many standard deviations: the rotor speeds up."""
_SHARE = 0.1
"""Doubt for a larger share of the recent time is told."""


class LullWatch:
    """Widens the covariance of estimates of which another wind explains the rotor as well.

    Args:
        station: The station, without changes.
        settings: `adaptation_time` is the memory, `output_rate` the rate of the estimates.
    """

    def __init__(self, station: Station, settings: EstimatorSettings) -> None:
        rotors = rotors_of(station)
        fixed = any(isinstance(r, Propeller) and not r.mounted_on for r in rotors)
        # Two rotors of different lengths, or axes, tell the winds apart.
        self._rotor = rotor_parameters(rotors[0]) if len(rotors) == 1 and not fixed else None
        self._name = rotors[0].name
        self._forget = 1.0 / (settings.adaptation_time * settings.output_rate)
        self._in_doubt = False
        self._share = 0.0
        self._seen = 0.0

    def widened(self, estimates: Estimates, y: FloatArray) -> Estimates:
        """The estimates, those in doubt uncertain by the distance of the other wind.

        Args:
            estimates: In order of time, n of them.
            y: l s of the first rotor at those instants [m/s], shape (n,).
        """
        p = self._rotor
        if p is None or p.a4 <= 0.5 or estimates.time.size == 0:
            return estimates
        speed = np.hypot(estimates.apparent[:, 0], estimates.apparent[:, 1])
        along = np.zeros_like(estimates.apparent)
        along[:, :2] = estimates.apparent[:, :2] / np.maximum(speed, 1e-6)[:, np.newaxis]
        variance = np.einsum("ni,nij,nj->n", along, estimates.apparent_covariance, along)
        deviation = p.calibration_gain * np.sqrt(variance)
        forcing = p.calibration_gain * speed - p.starting_speed + p.calibration_offset
        other = y * (2.0 - 1.0 / p.a4) - forcing
        away = np.zeros_like(speed)
        for k in range(speed.size):
            if not self._in_doubt:
                near = abs(forcing[k] - other[k]) < _CLOSE * y[k]
                self._in_doubt = bool(near and other[k] > 0.0)
            elif other[k] < -_CLEAR * deviation[k]:
                self._in_doubt = False
            if self._in_doubt:
                away[k] = (forcing[k] - max(other[k], 0.0)) / p.calibration_gain
            self._share += self._forget * (float(self._in_doubt) - self._share)
            self._seen += self._forget * (1.0 - self._seen)
        if not away.any():
            return estimates
        in_sensor = np.square(away)[:, None, None] * along[:, :, None] * along[:, None, :]
        turn = estimates.to_earth
        return estimates._replace(
            covariance=estimates.covariance + turn @ in_sensor @ turn.transpose(0, 2, 1),
            apparent_covariance=estimates.apparent_covariance + in_sensor,
        )

    def health(self) -> list[HealthItem]:
        """Item `<rotor> lulls`; none where a lull cannot be mistaken."""
        if self._rotor is None or self._rotor.a4 <= 0.5:
            return []
        share = 100.0 * self._share / max(self._seen, 1e-9)
        values = {"two winds fit": f"{share:.1f} %"}
        if share > 100.0 * _SHARE:
            text = (
                f"For {share:.0f} % of the time a far weaker wind fits its motion as well: the "
                "covariance says so."
            )
            return [HealthItem(f"{self._name} lulls", HealthLevel.WARN, text, values)]
        return [HealthItem(f"{self._name} lulls", HealthLevel.OK, "One wind fits.", values)]
