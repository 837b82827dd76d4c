"""Inertial range of the turbulence from the estimates of a method without a filter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.core import SmallScales
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.estimation.unresolved import VARIANCE_ABOVE

FloatArray = npt.NDArray[np.float64]

_ALONG, _ACROSS = 6.0 / 7.0, 8.0 / 7.0
"""Levels along and across the wind relative to their mean: the second is 4/3 of the first."""


class ScaleFollower:
    """Inertial range from the structure function of the estimates at one period of the bandwidth.

    Args:
        settings: `bandwidth`, `output_rate`, `adaptation_time`.
    """

    def __init__(self, settings: EstimatorSettings) -> None:
        self._settings = settings
        self._structure = np.zeros(2)
        self._recent: list[FloatArray] = []

    @property
    def unresolved(self) -> float:
        """Variance of a component above the bandwidth, for level 1."""
        return float(VARIANCE_ABOVE * self._settings.bandwidth ** (-2.0 / 3.0))

    def follow(self, velocity: FloatArray) -> None:
        """Take new estimates [m/s], shape (n, 3)."""
        lag = max(round(self._settings.output_rate / self._settings.bandwidth), 1)
        self._recent.append(velocity[:, :2])
        joined = np.concatenate(self._recent)
        if joined.shape[0] > lag:
            steps = np.square(joined[lag:] - joined[:-lag]).mean()
            share = velocity.shape[0] / self._settings.output_rate / self._settings.adaptation_time
            keep = max(1.0 - share, 0.0)
            self._structure[0] = keep * self._structure[0] + share * steps
            self._structure[1] = keep * self._structure[1] + share
        self._recent = [joined[-lag:]]

    def level(self) -> float:
        """D(t) = level t^(2/3), mean of both components, with what is lost above the bandwidth."""
        if self._structure[1] <= 0.0:
            return 0.5
        seen = self._structure[0] / self._structure[1]
        lag = 1.0 / self._settings.bandwidth
        return float(seen / (lag ** (2.0 / 3.0) * (1.0 - 2.0 * VARIANCE_ABOVE)))

    def small_scales(self) -> SmallScales | None:
        """Levels of an inertial range with that mean; None before there were estimates."""
        if self._structure[1] <= 0.0:
            return None
        level = self.level()
        return SmallScales(_ALONG * level, _ACROSS * level)
