"""Time stamps against the time of measurement."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.station.model import Clock

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


def stamps(clock: Clock, measured: TimeArray, origin: int) -> TimeArray:
    """What a clock stamps on measurements.

    Args:
        clock: Latency and drift.
        measured: True times of measurement [ns], shape (n,).
        origin: Start of the recording [ns], where the drift is zero.

    Returns:
        [ns], shape (n,).
    """
    if clock.latency == 0.0 and clock.drift == 0.0:
        return measured
    late = clock.latency * 1e9 + clock.drift * (measured - origin)
    stamped: TimeArray = measured + np.rint(late).astype(np.int64)
    return stamped


def measured_seconds(clock: Clock, stamped: TimeArray, origin: int) -> FloatArray:
    """When stamped measurements were made [s since `origin`]; the inverse of `stamps`."""
    since = (np.asarray(stamped, dtype=np.int64) - origin).astype(np.float64) * 1e-9
    if clock.latency == 0.0 and clock.drift == 0.0:
        return since
    seconds: FloatArray = (since - clock.latency) / (1.0 + clock.drift)
    return seconds
