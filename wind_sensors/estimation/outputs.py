"""What an estimator delivers: plain data, stamped with the time the wind blew."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


class WindEstimate(NamedTuple):
    """The wind at one instant.

    Attributes:
        time: When the wind blew [ns].
        velocity: Where the air goes: east, north, up [m/s], shape (3,). The vertical component is
            not measured by a horizontal station: its variance says so, as large as that of a
            neutral surface layer with the cross-wind's small scales.
        covariance: Of `velocity` [m^2/s^2], shape (3, 3).
        apparent: Wind minus the sensor's velocity, in the sensor frame (x, y, z) [m/s], shape (3,).
        apparent_covariance: Of `apparent` [m^2/s^2], shape (3, 3).
        to_earth: Matrix that turns the sensor's axes into ENU, shape (3, 3).
    """

    time: int
    velocity: FloatArray
    covariance: FloatArray
    apparent: FloatArray
    apparent_covariance: FloatArray
    to_earth: FloatArray


class BiasTerm(NamedTuple):
    """A relative bias of the raw mean speed.

    Attributes:
        value: The bias [1].
        uncertainty: Its standard uncertainty [1].
        relative_to: What both are a share of.
    """

    value: float
    uncertainty: float
    relative_to: Literal["mean speed", "vector mean"] = "mean speed"


@dataclass(frozen=True)
class WindowStatistics:
    """Statistics of one averaging window.

    Speeds in m/s, angles in rad, `direction` is where the air goes, counter-clockwise from east.
    Uncertainties are standard deviations. Everything but `complete` is nan where less than half of
    the window was measured; `wind_run_mean`, `bias`, `bias_terms`, `raw_scalar_mean` and
    the variances of direction are where the rotor that is counted, or its vane, was silent for so
    long; these variances are, too, where that rotor stood still throughout.

    Attributes:
        start, stop: First and last moment [ns].
        complete: Share of the window in which speed and direction were measured, 0 to 1.
        wind_run_mean: Vector mean by wind run, uncorrected; east, north, shape (2,). Kristensen
            (1994), (83).
        vector_mean: Vector mean after correction; east, north, up, shape (3,).
        vector_mean_covariance: Of `vector_mean` [m^2/s^2], shape (3, 3). Where the vertical wind is
            not measured, it allows for a vertical variance 2.5 times as large as assumed.
        bias: The velocity that was removed from the wind-run mean; east, north, up, shape (3,).
        bias_covariance: Of `bias` [m^2/s^2], shape (3, 3).
        raw_scalar_mean: Count mean of the rotor by its calibration, nan without pulses. On a moving
            platform that of the wind felt on board.
        scalar_mean, scalar_mean_uncertainty: Corrected mean speed.
        direction, direction_uncertainty: Of the corrected vector mean.
        direction_variance: 1 - R^2 of the vane's readings [rad^2], Kristensen (1994), (85).
        corrected_direction_variance, direction_variance_uncertainty: -ln R^2, which a spread of
            any size of a normal distribution leaves true, corrected for the vane's response
            [rad^2]. Like R it is weighted by wind run, not by time.
        turbulence: Standard deviations along, across and up [m/s], shape (3,).
        bias_terms: `u`, `v`, `w`, `vane_lag`, `translation`, `arithmetic_mean`: relative biases
            of the raw reading. `v`, by how much the mean speed exceeds the vector mean, is one only
            where the vector mean is wanted: `scalar_mean` keeps it. The Kalman method takes `u`
            from the moments of its smoothed state; its other terms, and those of other methods, are
            from inertial-range formulas that hold for distance constants much smaller than the
            turbulence's integral length.
        instrument: Name of the rotor the run was counted with.
    """

    start: int
    stop: int
    complete: float
    wind_run_mean: FloatArray
    vector_mean: FloatArray
    vector_mean_covariance: FloatArray
    bias: FloatArray
    bias_covariance: FloatArray
    raw_scalar_mean: float
    scalar_mean: float
    scalar_mean_uncertainty: float
    direction: float
    direction_uncertainty: float
    direction_variance: float
    corrected_direction_variance: float
    direction_variance_uncertainty: float
    turbulence: FloatArray
    bias_terms: dict[str, BiasTerm]
    instrument: str


class HealthLevel(IntEnum):
    """As in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class HealthItem:
    """State of one input or of the estimate, for people and for `/diagnostics`.

    Attributes:
        name: Input or aspect (`cup`, `vane`, `platform`, `clock`, `estimate`, `window`, `bias`).
        level: How bad.
        message: One sentence.
        values: Numbers behind it, as text with units.
    """

    name: str
    level: HealthLevel
    message: str
    values: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ProcessedRecording:
    """Everything an estimator found in a recording.

    Attributes:
        recording: What went in.
        method: Name of the method.
        time: Of the estimates [ns], shape (n,).
        velocity: East, north, up [m/s], shape (n, 3).
        covariance: [m^2/s^2], shape (n, 3, 3).
        apparent: In the sensor frame [m/s], shape (n, 3).
        apparent_covariance: [m^2/s^2], shape (n, 3, 3).
        to_earth: Matrices that turn the sensor's axes into ENU, shape (n, 3, 3).
        windows: Window statistics in order.
        health: Health at the end of the recording.
    """

    recording: Recording
    method: str
    time: TimeArray
    velocity: FloatArray
    covariance: FloatArray
    apparent: FloatArray
    apparent_covariance: FloatArray
    to_earth: FloatArray
    windows: tuple[WindowStatistics, ...]
    health: tuple[HealthItem, ...]
