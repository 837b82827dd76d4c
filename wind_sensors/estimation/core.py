"""What every estimation method delivers for a block of messages."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.outputs import HealthItem

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


class Estimates(NamedTuple):
    """Estimates in order of time.

    Attributes:
        time: [ns], shape (n,).
        velocity: ENU [m/s], shape (n, 3).
        covariance: [m^2/s^2], shape (n, 3, 3).
        apparent: Sensor frame [m/s], shape (n, 3).
        apparent_covariance: [m^2/s^2], shape (n, 3, 3).
        to_earth: Matrices that turn the sensor's axes into ENU, shape (n, 3, 3).
        unfollowed: Of the first rotor: forcing A, A - y [m/s] and the covariance of both at that
            instant [m^2/s^2], shape (n, 3); nan where the method does not know the rotor's rate
            apart from the wind, or the rotor stands still.
    """

    time: TimeArray
    velocity: FloatArray
    covariance: FloatArray
    apparent: FloatArray
    apparent_covariance: FloatArray
    to_earth: FloatArray
    unfollowed: FloatArray


class SmallScales(NamedTuple):
    """Inertial range as the method sees it now: D(t) = level t^(2/3) [m^2 s^-2 s^(-2/3)].

    Attributes:
        along, across: Levels of the wind along and across its mean.
    """

    along: float
    across: float


class Core(Protocol):
    """A method of estimation, fed with blocks in order."""

    def process(self, block: Block) -> Estimates:
        """Take a block; estimates that became final by it."""

    def finish(self) -> Estimates:
        """No block will follow; the remaining estimates."""

    def small_scales(self) -> SmallScales | None:
        """Turbulence at small scales, if the method knows it."""

    def health(self) -> list[HealthItem]:
        """What the method has to say about rotors, vanes and itself."""


def no_estimates() -> Estimates:
    """Nothing became final."""
    return Estimates(
        np.empty(0, dtype=np.int64),
        np.empty((0, 3)),
        np.empty((0, 3, 3)),
        np.empty((0, 3)),
        np.empty((0, 3, 3)),
        np.empty((0, 3, 3)),
        np.empty((0, 3)),
    )


def not_known(count: int) -> FloatArray:
    """`Estimates.unfollowed` of a method that does not know it."""
    return np.full((count, 3), np.nan)


def part_of(estimates: Estimates, where: slice | npt.NDArray[np.bool_]) -> Estimates:
    """Some of the estimates."""
    return Estimates(
        estimates.time[where],
        estimates.velocity[where],
        estimates.covariance[where],
        estimates.apparent[where],
        estimates.apparent_covariance[where],
        estimates.to_earth[where],
        estimates.unfollowed[where],
    )


def trusted(estimates: Estimates) -> Estimates:
    """The estimates whose covariance is known: the others would be guesswork."""
    known = np.asarray(np.isfinite(estimates.covariance).all(axis=(1, 2)))
    return estimates if known.all() else part_of(estimates, known)


def joined(parts: list[Estimates]) -> Estimates:
    """Estimates of successive blocks as one."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        return no_estimates()
    return Estimates(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def output_times(start: int, stop: int, rate: float) -> TimeArray:
    """Output instants in an interval: whole multiples of the period since the epoch [ns]."""
    period = round(1e9 / rate)
    first = -(-start // period) * period
    return np.arange(first, stop, period, dtype=np.int64)
