"""What an estimator can be told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from wind_sensors.errors import UserError

Method = Literal["kalman", "inverse", "naive"]
METHODS: tuple[Method, ...] = ("kalman", "inverse", "naive")


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of a streaming estimator; times in seconds.

    Attributes:
        method: `kalman`: turbulence as a stochastic process, instruments' dynamics, fixed-lag
            smoother. `inverse`: the instruments' equations solved for the wind. `naive`: the
            calibration and the vane's reading, nothing else.
        output_rate: Estimates per second [Hz].
        smoother_lag: How much later data may still improve an estimate [s]; the live latency is
            this plus the reordering window. A large value makes a full smoother of a recording.
        reordering_window: How long to wait for messages that arrive out of order [s].
        bandwidth: Cut-off frequency of `inverse`'s noise filter [Hz].
        window: Averaging time of the window statistics [s]; windows follow one another.
        adaptation_time: Memory of the turbulence estimate [s].
        stop_time: A rotor without an edge for this long has stopped; so long is the wind told
            after the last sign of life of all rotors and vanes [s].
        gap_time: An input silent for this long has a gap [s].
        jump_time: A clock that steps back by more than this restarts the estimator; a stamp that
            is ahead by more waits for others that agree [s].
        turbulence_intensity: Assumed until the data have spoken.
        use_air: Use temperature and pressure for the air density where they are measured.

    Raises:
        UserError: A value is out of range.
    """

    method: Method = "kalman"
    output_rate: float = 20.0
    smoother_lag: float = 1.0
    reordering_window: float = 0.2
    bandwidth: float = 1.0
    window: float = 600.0
    adaptation_time: float = 120.0
    stop_time: float = 10.0
    gap_time: float = 2.0
    jump_time: float = 2.0
    turbulence_intensity: float = 0.15
    use_air: bool = True

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise UserError(
                f"'{self.method}' is no estimation method.",
                "method",
                f"Choose one of {', '.join(METHODS)}.",
            )
        limits = {
            "output_rate": (0.1, 200.0),
            "smoother_lag": (0.05, 600.0),
            "reordering_window": (0.0, 10.0),
            "bandwidth": (0.01, 50.0),
            "window": (1.0, 86400.0),
            "adaptation_time": (5.0, 3600.0),
            "stop_time": (0.5, 600.0),
            "gap_time": (0.1, 600.0),
            "jump_time": (0.5, 600.0),
            "turbulence_intensity": (0.01, 1.0),
        }
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UserError(
                    f"{value:g} is out of range.", name, f"Give a value from {low:g} to {high:g}."
                )
