"""Raw sums of one averaging window for propellers on fixed axes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.circumstances import CircumstanceSource
from wind_sensors.estimation.constants import array_axes, fixed_propellers_of
from wind_sensors.estimation.forward import MOUNT_ROTATION
from wind_sensors.estimation.history import RotorTrack
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.wind_run import RunSums, Windows
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_SAMPLES = 5
"""So often in a block the mount's motion is noted."""


class ArrayRunCounter:
    """Vector wind run of an array as its calibration gives it, in windows that follow one another.

    Every turn of a propeller is a run of air along its column of the axes' pseudo-inverse, turned
    into the earth frame; what is known of the steady calibration (gain, offset) is undone.
    `RunSums.directions` is scaled by the first propeller's calibration.

    Args:
        station: The station; its fixed propellers are used.
        start: Of the first block [ns].
        windows: Into which the turns are sorted.
        use_air: As in the settings.

    Attributes:
        rotor: The first propeller.
        vane: None.
    """

    def __init__(self, station: Station, start: int, windows: Windows, use_air: bool) -> None:
        self._propellers = fixed_propellers_of(station)
        self._columns = np.asarray(np.linalg.pinv(array_axes(self._propellers)), dtype=np.float64)
        # Wind at which all propellers would stand still, in sensor axes [m/s].
        self._offset: FloatArray = self._columns @ np.array(
            [-p.calibration_offset / p.calibration_gain for p in self._propellers]
        )
        self._tracks = [RotorTrack(p.name, station, start) for p in self._propellers]
        self._angle: list[float | None] = [None] * len(self._propellers)
        self._source = CircumstanceSource(station, use_air)
        self._windows = windows
        self.rotor = self._propellers[0]
        self.vane = None

    def take(self, block: Block) -> None:
        """Add a block."""
        self._source.take(block)
        step = (block.stop - block.start) // _SAMPLES
        times = block.start + step * np.arange(_SAMPLES, dtype=np.int64)
        rows = self._source.at(times, np.zeros(3))
        offset = (self._to_earth(rows) @ self._offset)[:, :2]
        for sums, part in self._windows.at(times):
            sums.readings += int(np.count_nonzero(part))
            sums.carried += rows[part, :2].sum(axis=0)
            sums.time_directions += offset[part].sum(axis=0)
        for i, track in enumerate(self._tracks):
            new = track.take(block.pulses[self._propellers[i].name])
            if new:
                self._sum_turns(i, track.time[-new:], track.angle[-new:])
            track.forget_before(block.stop)

    def window(self, number: int) -> RunSums:
        """Sums of a window, which is forgotten."""
        return self._windows.taken(number)

    @staticmethod
    def _to_earth(rows: FloatArray) -> FloatArray:
        return rows[:, MOUNT_ROTATION : MOUNT_ROTATION + 9].reshape(-1, 3, 3)

    def _sum_turns(self, i: int, times: TimeArray, angle: FloatArray) -> None:
        before = self._angle[i]
        turned = np.diff(angle, prepend=angle[0] if before is None else before)
        self._angle[i] = float(angle[-1])
        rows = self._source.at(times, np.zeros(3))
        propeller = self._propellers[i]
        scale = propeller.calibration_distance / self.rotor.calibration_distance
        scale /= propeller.calibration_gain
        runs = scale * turned[:, np.newaxis] * (self._to_earth(rows) @ self._columns[:, i])[:, :2]
        for sums, part in self._windows.at(times):
            sums.edges += int(np.count_nonzero(part))
            sums.directions += runs[part].sum(axis=0)
