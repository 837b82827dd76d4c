"""Checks of the readings themselves: silence, repeats, coarse steps, lost and doubled edges."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import BANDS, Simulated
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import INTERVALS
from wind_sensors.station.model import Rotor, Station
from wind_sensors.station.signals import Angles, Pulses

FloatArray = npt.NDArray[np.float64]

LONGEST_STILL = 10.0
"""A sensor that repeats itself for longer [s], while it should move, is stuck."""

COARSE = np.radians(3.0)
"""Steps of a reading larger than this are told [rad]."""

ODD_SHARE = 0.01
"""Share of intervals too long or too short, beyond the simulation's, that is told."""

_SCATTER = 4.0
_ALIVE = 8
_BRISK = 4.0
"""Below this wind [m/s] a rotor that stands may merely be braked."""

_MOVED = np.radians(2.0)


class Oddity(NamedTuple):
    """Something that needs no statistics.

    Attributes:
        effect, instrument: Names.
        start, stop: [ns]
        text: What was seen.
    """

    effect: str
    instrument: str
    start: int
    stop: int
    text: str


def _longest_repeat(readings: Angles) -> tuple[int, int]:
    """First and last time of the longest run of equal readings [ns]."""
    changes = np.flatnonzero(np.diff(readings.angle) != 0.0) + 1
    bounds = np.concatenate(([0], changes, [readings.time.size]))
    first = readings.time[bounds[:-1]]
    last = readings.time[bounds[1:] - 1]
    longest = int(np.argmax(last - first))
    return int(first[longest]), int(last[longest])


def _step(readings: Angles) -> float:
    """Smallest difference between distinct readings [rad]; 0 when there are too few."""
    distinct = np.unique(np.round(readings.angle, 9))
    return float(np.min(np.diff(distinct))) if distinct.size > 2 else 0.0


def _vane(
    name: str, measured: Angles | None, expected: Angles, start: int, stop: int
) -> Oddity | None:
    if measured is None or measured.time.size < 2:
        return Oddity("stuck_sensor", name, start, stop, f"{name} delivers no readings")
    begin, end = _longest_repeat(measured)
    during = (expected.time >= begin) & (expected.time <= end)
    turned = expected.angle[during]
    if (end - begin) * 1e-9 > LONGEST_STILL and turned.size:
        still = _longest_repeat(Angles(expected.time[during], turned))
        moved = float(np.std(np.unwrap(turned)))
        if moved > _MOVED and end - begin > 3 * (still[1] - still[0]):
            seconds = (end - begin) * 1e-9
            text = f"{name} repeats one reading for {seconds:.0f} s while the wind turns"
            return Oddity("stuck_sensor", name, begin, end, text)
    step = _step(measured)
    if step > COARSE and step > 3.0 * _step(expected):
        text = f"readings of {name} come in steps of {np.degrees(step):.1f} deg"
        return Oddity("quantisation", name, start, stop, text)
    return None


def _rotor(
    name: str, measured: Pulses | None, expected: Pulses, start: int, stop: int, speed: float
) -> Oddity | None:
    inside = np.empty(0, dtype=np.int64)
    if measured is not None:
        inside = measured.time[(measured.time > start) & (measured.time < stop)]
    marks = np.concatenate(([start], np.sort(inside), [stop]))
    gaps = np.diff(marks)
    widest = int(np.argmax(gaps))
    begin, end = int(marks[widest]), int(marks[widest + 1])
    awaited = int(np.count_nonzero((expected.time > begin) & (expected.time < end)))
    if (end - begin) * 1e-9 > LONGEST_STILL and awaited > _ALIVE and speed > _BRISK:
        seconds = (end - begin) * 1e-9
        text = f"{name} gives no edge for {seconds:.0f} s where {awaited} were expected"
        return Oddity("stuck_sensor", name, begin, end, text)
    return None


def _intervals(
    name: str, measured: FloatArray, expected: FloatArray, edges: int, start: int, stop: int
) -> Oddity | None:
    """Edges that are lost or doubled at random places, which no signature can foresee."""
    for k, effect, what in ((0, "missed_pulses", "long"), (1, "extra_pulses", "short")):
        beyond = float(measured[k] - expected[k])
        scatter = np.sqrt(float(expected[k]) * edges + 1.0) / max(edges, 1)
        if beyond > ODD_SHARE + _SCATTER * scatter:
            text = f"{100.0 * beyond:.1f} % of the pulse intervals of {name} are far too {what}"
            return Oddity(effect, name, start, stop, text)
    return None


def oddities(
    comparison: Comparison,
    simulated: Simulated,
    station: Station,
    pulses: Mapping[str, Pulses],
    angles: Mapping[str, Angles],
    start: int,
    stop: int,
) -> list[Oddity]:
    """What the readings of a block show at once.

    Args:
        comparison: The block.
        simulated: The healthy station in its wind.
        station: The healthy station.
        pulses, angles: Simulated signals of the block.
        start, stop: The block without its lead-in [ns].
    """
    recording = comparison.recording
    speed = float(np.mean(comparison.speed))
    found: list[Oddity | None] = []
    for instrument in station.instruments:
        name = instrument.name
        if isinstance(instrument, Rotor) and name in pulses:
            found.append(
                _rotor(name, recording.pulses.get(name), pulses[name], start, stop, speed)
            )
            channel = f"{name}/rotor_rate"
            found.append(
                _intervals(
                    name,
                    comparison.measured.statistics[channel][BANDS : BANDS + INTERVALS],
                    simulated.statistics[channel][BANDS : BANDS + INTERVALS],
                    pulses[name].time.size,
                    start,
                    stop,
                )
            )
        elif name in angles:
            found.append(_vane(name, recording.angles.get(name), angles[name], start, stop))
    return [oddity for oddity in found if oddity is not None]
