"""First state of the filter from the first seconds of messages."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.estimation.constants import NoseAxis, array_axes
from wind_sensors.estimation.filter_state import FilterState
from wind_sensors.estimation.forward import MOUNT_ROTATION, Instruments
from wind_sensors.estimation.intake import Block
from wind_sensors.estimation.readings import headings
from wind_sensors.estimation.turbulence_process import (
    PAIRS,
    TIME_CONSTANTS,
    VARIANCES,
    VERTICAL_VARIANCES,
    WIND_STATES,
    initial_levels,
)
from wind_sensors.estimation.turn_counting import slots_between
from wind_sensors.instruments.propeller_array import uncorrected_velocity
from wind_sensors.station.model import Cup, Propeller

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_UNKNOWN_ANGLE = np.pi / 2.0
_LOWEST_DEVIATION = 0.3
"""Uncertainty of the first speed of a rotor that hardly turns [m/s]."""


def _first_rate(blocks: list[Block], rotor: Cup | Propeller) -> tuple[float, float]:
    """Mean y = l s [m/s] over the blocks and the turned angle at their start [rad]."""
    times = np.concatenate([b.pulses[rotor.name].time for b in blocks])
    turns = np.concatenate([b.pulses[rotor.name].value[:, 0] for b in blocks])
    if times.size < 2:
        return 0.0, float(turns[0] * 2.0 * np.pi) if np.isfinite(turns).any() else 0.0
    duration = (times[-1] - times[0]) * 1e-9
    if np.isfinite(turns).all():
        rate = 2.0 * np.pi * float(turns[-1] - turns[0]) / duration
        before = (times[0] - blocks[0].start) * 1e-9
        return rotor.calibration_distance * rate, 2.0 * np.pi * turns[0] - rate * before
    slots = float(slots_between(np.diff(times) * 1e-9, rotor.electronics.dead_time).sum())
    made = slots / rotor.pulses_per_revolution
    return 2.0 * np.pi * rotor.calibration_distance * made / duration, 0.0


def _array_wind(
    rotors: tuple[Cup | Propeller, ...], rates: list[tuple[float, float]]
) -> FloatArray:
    """Wind in the sensor frame that fixed propellers show [m/s], shape (3,)."""
    fixed = [
        (rotor, y)
        for rotor, (y, _) in zip(rotors, rates, strict=True)
        if isinstance(rotor, Propeller) and not rotor.mounted_on
    ]
    axes = array_axes(tuple(rotor for rotor, _ in fixed))
    return uncorrected_velocity(axes, np.array([y for _, y in fixed]))


def start_filter(
    f: FilterState,
    s: Instruments,
    rotors: tuple[Cup | Propeller, ...],
    axes: tuple[NoseAxis, ...],
    blocks: list[Block],
    circumstances: FloatArray,
    intensity: float,
    origin: int,
) -> None:
    """Set mean and covariance so wide that the data decide.

    Args:
        f: The filter.
        s: Constants.
        rotors, axes: In the filter's order.
        blocks: The first blocks of messages.
        circumstances: At the start, shape (23,).
        intensity: Assumed turbulence intensity [1].
        origin: Start of the recording [ns].
    """
    w = WIND_STATES
    rates = [_first_rate(blocks, r) for r in rotors]
    speeds = [
        abs(y) / r.calibration_gain + s.rotor[i, 2]
        for i, ((y, _), r) in enumerate(zip(rates, rotors, strict=True))
    ]
    speed = max([v for v in speeds if np.isfinite(v)], default=3.0)
    noses: list[float | None] = []
    for axis in axes:
        times = np.concatenate([b.readings[axis.name].time for b in blocks])
        values = np.concatenate([b.readings[axis.name].value[:, 0] for b in blocks])
        first = headings(axis.instrument, times, values, origin)
        noses.append(float(first.heading[0]) if first.heading.size else None)
    known = next(
        (n for n, a in zip(noses, axes, strict=True) if n is not None and a.azimuth < 0), None
    )
    nose = known if known is not None else 0.0
    rotation = circumstances[MOUNT_ROTATION : MOUNT_ROTATION + 9].reshape(3, 3)
    local = np.array([-speed * np.cos(nose), -speed * np.sin(nose), 0.0])
    if not axes:
        local = _array_wind(rotors, rates)
    felt = rotation @ local
    wind = felt + circumstances[:3]
    f.mean[:] = 0.0
    f.covariance[:] = 0.0
    f.mean[2 * PAIRS - 2 : 2 * PAIRS] = wind[:2]
    f.levels[:] = initial_levels(speed, intensity)
    pointed = known is not None or not axes
    spread = 0.2 * speed + _LOWEST_DEVIATION if pointed else speed + 1.0
    diagonal = np.zeros(f.mean.size)
    for i in range(len(TIME_CONSTANTS)):
        diagonal[2 * i : 2 * i + 2] = f.levels[0] * VARIANCES[i]
    diagonal[2 * PAIRS - 2 : 2 * PAIRS] = spread**2
    diagonal[2 * PAIRS : w] = f.levels[0] * VERTICAL_VARIANCES
    for i, (y, turned) in enumerate(rates):
        f.mean[w + 2 * i] = y
        f.mean[w + 2 * i + 1] = turned
        diagonal[w + 2 * i] = (0.2 * abs(y) + _LOWEST_DEVIATION) ** 2
        diagonal[w + 2 * i + 1] = (2.0 * np.pi / f.slots[i]) ** 2
    for i, (axis, heading) in enumerate(zip(axes, noses, strict=True)):
        j = w + 2 * (len(rotors) + i)
        level = 0.0 if axis.azimuth >= 0 else nose
        f.mean[j] = level if heading is None else heading
        diagonal[j] = _UNKNOWN_ANGLE**2 if heading is None else 0.05
        diagonal[j + 1] = 1.0
    np.fill_diagonal(f.covariance, diagonal)
    begin = blocks[0].start
    f.clock[:] = (begin - 1, begin - 1, 0, 0)
    f.circumstances[:] = circumstances
    f.last_edge[:] = begin
