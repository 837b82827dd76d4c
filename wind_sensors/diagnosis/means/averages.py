"""A recording of means as columns: one row for each averaging interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects.wording import date_text
from wind_sensors.errors import UserError
from wind_sensors.simulation.drive import air_density
from wind_sensors.station.doubles import without_doubles
from wind_sensors.station.model import Cup, Rotor, Station, Vane
from wind_sensors.station.signals import Angles, Pulses, Recording, Series, TimeArray

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

DAY = 86400.0
"""[s]"""

FEWEST_ROWS = 200
"""So many common means are compared at least: a day and a half of ten-minute means. A choice; fewer
do not make the blocks that held-out fits need."""

MOST_ROWS = 8_000
"""No more means are compared at a time; of more, evenly spaced ones are taken. A choice: neighbours
share their weather and tell little new, while the time of a search grows with their number."""

BLOWING = 3.0
"""Wind in which every rotor turns and every vane moves [m/s]."""

USUAL_INTENSITY = 0.12
"""Turbulence intensity where the recording has no deviations."""


@dataclass(frozen=True)
class Averages:
    """Means of all the instruments at common stamps.

    Attributes:
        station: The station.
        time: Stamps, ends of the intervals [ns], shape (n,).
        elapsed: The same [s since the start of the recording], shape (n,).
        interval: Averaging time [s].
        speed: Indicated speed of each rotor [m/s], shape (n,); NaN where it is missing.
        heading: Heading of each vane's nose, counter-clockwise from the sensor's x axis [rad].
        deviation: Standard deviation of the speed within the interval [m/s], where recorded.
        temperature: [deg C], shape (n,); NaN where unknown.
        density: Air density [kg/m^3], shape (n,); NaN where unknown.
    """

    station: Station
    time: TimeArray
    elapsed: FloatArray
    interval: float
    speed: Mapping[str, FloatArray]
    heading: Mapping[str, FloatArray]
    deviation: Mapping[str, FloatArray]
    temperature: FloatArray
    density: FloatArray

    def __len__(self) -> int:
        return int(self.time.size)

    def date(self, elapsed: float) -> str:
        """A moment [s since the start of the recording], for people."""
        return date_text(int(self.time[0]) + round((elapsed - float(self.elapsed[0])) * 1e9))

    def intensity(self, rotor: str) -> FloatArray:
        """Turbulence intensity at a rotor [1], shape (n,)."""
        if rotor not in self.deviation:
            return np.full(len(self), USUAL_INTENSITY)
        speed = np.maximum(self.speed[rotor], 0.5)
        found = np.clip(self.deviation[rotor] / speed, 0.0, 0.5)
        return np.where(np.isfinite(found), found, USUAL_INTENSITY)


def indicated_speed(rotor: Rotor, pulses: Pulses) -> tuple[TimeArray, FloatArray]:
    """Mean indicated speed [m/s] between stamps, at the later one; shape (n - 1,)."""
    if pulses.turns is None or pulses.time.size < 2:
        return pulses.time[:0], np.zeros(0)
    seconds = np.diff(pulses.time) * 1e-9
    rate = np.diff(pulses.turns) / np.where(seconds > 0.0, seconds, np.nan)
    start = rotor.starting_speed if isinstance(rotor, Cup) else 0.0
    run = 2.0 * np.pi * rotor.calibration_distance * rate
    return pulses.time[1:], np.where(run > 0.0, run + start, 0.0)


def _at(time: TimeArray, known: TimeArray, value: FloatArray) -> FloatArray:
    """Values at the stamps they share with `time`; NaN elsewhere."""
    out = np.full(time.size, np.nan)
    _, ours, theirs = np.intersect1d(time, known, return_indices=True)
    out[ours] = value[theirs]
    return out


def _series_at(time: TimeArray, series: Series | None) -> FloatArray:
    if series is None or series.time.size == 0:
        return np.full(time.size, np.nan)
    since = (series.time - time[0]) * 1e-9
    return np.asarray(np.interp((time - time[0]) * 1e-9, since, series.value))


def averages_of(recording: Recording, deviations: Mapping[str, Series] | None = None) -> Averages:
    """The means of a recording as columns.

    Args:
        recording: Its station states `averaging_time`.
        deviations: Standard deviations of the rotors' speeds [m/s], by rotor.

    Raises:
        UserError: There is no pair of rotors with enough common means.
    """
    recording = without_doubles(recording)
    station = recording.station
    interval = station.recording.averaging_time
    found: dict[str, tuple[TimeArray, FloatArray]] = {}
    for instrument in station.instruments:
        pulses = recording.pulses.get(instrument.name)
        if isinstance(instrument, Rotor) and pulses is not None:
            found[instrument.name] = indicated_speed(instrument, pulses)
    stamps = [time for time, _ in found.values() if time.size]
    time = np.unique(np.concatenate(stamps)) if stamps else np.zeros(0, dtype=np.int64)
    if time.size < FEWEST_ROWS or len(found) < 2:
        raise UserError(
            f"{time.size} means of {len(found)} rotors are too few to compare instruments.",
            recording.name,
            f"At least {FEWEST_ROWS} common means of two rotors are needed.",
        )
    temperature = _series_at(time, recording.temperature)
    pressure = _series_at(time, recording.pressure)
    return Averages(
        station=station,
        time=time,
        elapsed=np.asarray((time - recording.start) * 1e-9, dtype=np.float64),
        interval=interval,
        speed={name: _at(time, known, value) for name, (known, value) in found.items()},
        heading={
            i.name: _heading(time, i, recording.angles[i.name])
            for i in station.instruments
            if isinstance(i, Vane) and i.name in recording.angles
        },
        deviation={
            name: _at(time, series.time, series.value)
            for name, series in (deviations or {}).items()
        },
        temperature=temperature,
        density=air_density(temperature, pressure),
    )


def _heading(time: TimeArray, vane: Vane, angles: Angles) -> FloatArray:
    sign = -1.0 if vane.reversed else 1.0
    return _at(time, angles.time, sign * (angles.angle - np.radians(vane.offset_deg)))


def part(averages: Averages, rows: BoolArray | npt.NDArray[np.intp]) -> Averages:
    """Some of the rows."""
    return Averages(
        station=averages.station,
        time=averages.time[rows],
        elapsed=averages.elapsed[rows],
        interval=averages.interval,
        speed={k: v[rows] for k, v in averages.speed.items()},
        heading={k: v[rows] for k, v in averages.heading.items()},
        deviation={k: v[rows] for k, v in averages.deviation.items()},
        temperature=averages.temperature[rows],
        density=averages.density[rows],
    )


def thinned(good: BoolArray) -> BoolArray:
    """Of the good rows no more than `MOST_ROWS`, evenly spaced; shape (n,) as `good`."""
    step = max(1, int(np.ceil(np.count_nonzero(good) / MOST_ROWS)))
    chosen = np.zeros(good.size, dtype=bool)
    chosen[np.flatnonzero(good)[::step]] = True
    return chosen


def joined(several: Sequence[Averages]) -> Averages:
    """Recordings of one station as one, in the order of time.

    Instruments that are missing in one of them are NaN there; of means with the same stamp the
    first counts.
    """
    if len(several) == 1:
        return several[0]
    time, row = np.unique(np.concatenate([a.time for a in several]), return_index=True)

    def column(parts: Sequence[FloatArray | None]) -> FloatArray:
        filled = [
            np.full(len(a), np.nan) if p is None else p
            for a, p in zip(several, parts, strict=True)
        ]
        return np.asarray(np.concatenate(filled)[row])

    def columns(tables: Sequence[Mapping[str, FloatArray]]) -> dict[str, FloatArray]:
        names = dict.fromkeys(name for table in tables for name in table)
        return {name: column([table.get(name) for table in tables]) for name in names}

    return Averages(
        station=several[0].station,
        time=time,
        elapsed=np.asarray((time - time[0]) * 1e-9, dtype=np.float64),
        interval=several[0].interval,
        speed=columns([a.speed for a in several]),
        heading=columns([a.heading for a in several]),
        deviation=columns([a.deviation for a in several]),
        temperature=column([a.temperature for a in several]),
        density=column([a.density for a in several]),
    )


def blocks_of(averages: Averages, fewest: int = 24) -> npt.NDArray[np.intp]:
    """Number of the block of each row: a week, or less where that leaves too few blocks."""
    span = float(averages.elapsed[-1] - averages.elapsed[0])
    width = min(7.0 * DAY, span / fewest)
    number = np.floor((averages.elapsed - averages.elapsed[0]) / width).astype(np.intp)
    return np.unique(number, return_inverse=True)[1].astype(np.intp)
