"""The naive reading: calibration and vane as they are, nothing else; for comparison."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.circumstances import CircumstanceSource, with_mount_covariance
from wind_sensors.estimation.core import (
    Estimates,
    SmallScales,
    no_estimates,
    not_known,
    output_times,
)
from wind_sensors.estimation.forward import MOUNT_ROTATION
from wind_sensors.estimation.history import History
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.outputs import HealthItem
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.station.model import Cup, Propeller, Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_RELATIVE_DEVIATION = 0.1
_LEAST_DEVIATION = 0.1
"""Nobody states an uncertainty of a naive reading: a tenth of the speed, at least 0.1 m/s."""
_VERTICAL_DEVIATION = 1.0


def calibrated_speed(rotor: Cup | Propeller, y: FloatArray) -> FloatArray:
    """Speed [m/s] by the calibration from y = l s [m/s]; a rotor at rest reads zero."""
    offset = rotor.starting_speed if isinstance(rotor, Cup) else 0.0
    return np.where(y > 0.0, y + offset, 0.0)


def earth_estimates(
    times: TimeArray,
    speed: FloatArray,
    heading: FloatArray,
    along_variance: FloatArray,
    across_variance: FloatArray,
    vertical_variance: FloatArray,
    rows: FloatArray,
    vertical: FloatArray | None = None,
) -> Estimates:
    """Estimates from speed and nose heading in the sensor frame.

    Args:
        times: [ns], shape (n,).
        speed: Across the vane's axis [m/s], shape (n,).
        heading: Where the wind comes from, counter-clockwise from x [rad], shape (n,).
        along_variance, across_variance, vertical_variance: [m^2/s^2], shape (n,).
        rows: Circumstances, shape (n, 23).
        vertical: Along the vane's axis [m/s], shape (n,); None: not known, taken as zero.
    """
    c, s = -np.cos(heading), -np.sin(heading)
    upwards = np.zeros_like(speed) if vertical is None else vertical
    apparent = np.stack((speed * c, speed * s, upwards), axis=1)
    frame = np.zeros((times.size, 3, 3))
    frame[:, 0, 0], frame[:, 0, 1] = c, -s
    frame[:, 1, 0], frame[:, 1, 1] = s, c
    frame[:, 2, 2] = 1.0
    diagonal = np.stack((along_variance, across_variance, vertical_variance), axis=1)
    in_sensor = np.einsum("nij,nj,nkj->nik", frame, diagonal, frame)
    to_earth = rows[:, MOUNT_ROTATION : MOUNT_ROTATION + 9].reshape(-1, 3, 3)
    velocity = np.einsum("nij,nj->ni", to_earth, apparent) + rows[:, :3]
    covariance = np.einsum("nij,njk,nlk->nil", to_earth, in_sensor, to_earth)
    return Estimates(
        times, velocity, with_mount_covariance(covariance, velocity, rows), apparent, in_sensor,
        to_earth, not_known(times.size),
    )


class NaiveCore:
    """Calibration only.

    Args:
        station: The station.
        settings: Settings.
        origin: Start of the recording [ns].
    """

    def __init__(self, station: Station, settings: EstimatorSettings, origin: int) -> None:
        self._settings = settings
        self._history = History(station, origin, 2.0, restored=False)
        self._source = CircumstanceSource(station, settings.use_air)

    def process(self, block: Block) -> Estimates:
        """Take a block; its estimates."""
        self._source.take(block)
        self._history.take(block)
        self._history.forget_before(block.stop)
        history = self._history
        if not history.nose.time.size:
            return no_estimates()
        times = output_times(block.start, block.stop, self._settings.output_rate)
        speed = calibrated_speed(history.rotor, history.edges.latest_speed(times))
        heading = history.nose.latest(times)
        variance = np.square(_RELATIVE_DEVIATION * speed + _LEAST_DEVIATION)
        lift, vertical = None, np.full(times.size, _VERTICAL_DEVIATION**2)
        if history.elevation is not None:
            lift, vertical = speed * np.tan(history.elevation.latest(times)), variance
        rows = self._source.at(times, np.zeros(3))
        return earth_estimates(times, speed, heading, variance, variance, vertical, rows, lift)

    def finish(self) -> Estimates:
        """Nothing remains."""
        return no_estimates()

    def small_scales(self) -> SmallScales | None:
        """Not known."""
        return None

    def health(self) -> list[HealthItem]:
        """Nothing to say."""
        return []
