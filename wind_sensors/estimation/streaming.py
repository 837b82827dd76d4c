"""The estimator that every node and every command uses: messages in, wind out."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.outputs import HealthItem, WindEstimate, WindowStatistics

FloatArray = npt.NDArray[np.float64]


class StreamingEstimator(Protocol):
    """Fed by stamps alone: the same messages give the same bits, live and offline."""

    def add_pulse(self, name: str, time_ns: int, turns: float | None = None) -> None:
        """An edge of a rotor; `turns` is the rotor's total revolutions where the source tells."""

    def add_angle(self, name: str, time_ns: int, angle: float) -> None:
        """A reading of a vane: heading of its nose, counter-clockwise from x [rad]."""

    def add_platform(
        self,
        time_ns: int,
        attitude_xyzw: FloatArray,
        velocity: FloatArray,
        angular_rate: FloatArray,
        position: FloatArray,
    ) -> None:
        """State of the carrier, as in `PlatformStates`."""

    def add_air(
        self, time_ns: int, temperature: float | None = None, pressure: float | None = None
    ) -> None:
        """Air temperature [deg C] or pressure [Pa]."""

    def advance(self, time_ns: int) -> None:
        """Time has passed although no message came."""

    def take_estimates(self) -> list[WindEstimate]:
        """Estimates that became final since the last call, in order of time."""

    def take_windows(self) -> list[WindowStatistics]:
        """Windows that were completed since the last call."""

    def health(self) -> list[HealthItem]:
        """State of every input and of the estimate."""

    def flush(self) -> None:
        """No more messages: make everything final, including the last, shorter window."""

    def reset(self) -> None:
        """Forget everything."""
