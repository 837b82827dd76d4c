"""What drives the instruments: wind, platform motion and air on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.motion.platform_track import Motion, PlatformTrack
from wind_sensors.station.signals import Recording, Series, Winds

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

GAS_CONSTANT_DRY_AIR = 287.05
"""[J kg^-1 K^-1]"""
STANDARD_PRESSURE = 101_325.0
"""[Pa]"""

MOST_INSTANTS = 50_000_000
"""A drive of more (four weeks at 20 Hz) does not fit into a memory."""


def air_density(temperature: npt.ArrayLike, pressure: npt.ArrayLike) -> FloatArray:
    """Density of dry air [kg/m^3] at a temperature [deg C] and a pressure [Pa]."""
    kelvin = np.asarray(temperature, dtype=np.float64) + 273.15
    density: FloatArray = np.asarray(pressure, dtype=np.float64) / (GAS_CONSTANT_DRY_AIR * kelvin)
    return density


@dataclass(frozen=True)
class Drive:
    """Wind, motion and air at the instants start, start + dt, ...; linear in between.

    Attributes:
        start_ns: Time of the first instant, recording's clock [ns].
        dt: Interval [s].
        wind: Wind at the sensor, ENU [m/s], shape (n, 3).
        motion: The platform as it is reported, or None on a mast.
        temperature: [deg C], shape (n,); None: the instruments' reference temperature.
        density: Air density [kg/m^3], shape (n,); None: the standard density.
        elapsed: Seconds from the start of the recording to the first instant; changes, outages and
            drifting clocks count from there.
        motion_is_true: `motion` is what the platform does, not what it reports.
    """

    start_ns: int
    dt: float
    wind: FloatArray
    motion: Motion | None = None
    temperature: FloatArray | None = None
    density: FloatArray | None = None
    elapsed: float = 0.0
    motion_is_true: bool = False

    def __len__(self) -> int:
        return int(self.wind.shape[0])

    @property
    def times_ns(self) -> TimeArray:
        """The instants [ns], shape (n,)."""
        steps: TimeArray = np.rint(np.arange(len(self)) * (self.dt * 1e9)).astype(np.int64)
        return self.start_ns + steps

    def with_wind(self, wind: FloatArray) -> Drive:
        """The same drive with another wind."""
        return replace(self, wind=wind)


def _on_grid(series: Series | None, times: TimeArray) -> FloatArray | None:
    if series is None or series.time.size == 0:
        return None
    since = (series.time - times[0]) * 1e-9
    order = np.argsort(since, kind="stable")
    usable = order[np.isfinite(series.value[order])]
    if usable.size == 0:
        return None
    wanted = (times - times[0]) * 1e-9
    values: FloatArray = np.interp(wanted, since[usable], series.value[usable])
    return values


def _usual_interval(times: TimeArray) -> float:
    steps = np.diff(times)
    return float(np.median(steps[steps > 0])) * 1e-9


def _without_wind(recording: Recording) -> UserError:
    """What to do about a recording that no wind can be taken from."""
    stated = recording.station.reference
    if stated is not None:
        what = f"{stated.topic.topic}: the reference has less than two messages"
        remedy = "Check the topic of `reference` in the station file, and the recorder."
    elif recording.truth is not None:
        what = "the station file names no reference wind, though a simulator's true wind is here"
        topic = recording.truth_topic
        remedy = f"Add `reference: {{kind: truth, topic: {topic}}}` to the station file."
    else:
        what = "the station file names no reference wind to drive a simulation with"
        remedy = "If one was recorded, add `reference: {kind: sonic, topic: TOPIC}` to it."
    return UserError(f"{what}.", recording.name, remedy)


def drive_from_recording(
    recording: Recording, wind: Winds | None = None, dt: float | None = None
) -> Drive:
    """The drive that a recording's reference wind, platform and air make.

    Args:
        recording: The recording.
        wind: Wind to use instead of the recording's reference.
        dt: Interval of the grid [s]; None: the usual interval of the wind. A wind already on the
            grid keeps its samples to the bit.

    Raises:
        UserError: There is no wind, or one over too long a time, or no platform motion for a
            station on a platform.
    """
    source = wind if wind is not None else recording.reference
    if source is None or source.time.size < 2:
        raise _without_wind(recording)
    usable = np.isfinite(source.velocity).all(axis=1)
    stamps, first = np.unique(source.time[usable], return_index=True)
    velocity = source.velocity[usable][first]
    interval = _usual_interval(stamps) if dt is None else dt
    start = int(stamps[0])
    count = int(np.floor((int(stamps[-1]) - start) * 1e-9 / interval + 1e-6)) + 1
    if count > MOST_INSTANTS:
        raise UserError(
            f"{stamps.size} samples of wind, {interval:.3g} s apart, are spread over "
            f"{count * interval / 86400.0:.0f} days: too long to simulate.",
            recording.name,
            "Look for wrong stamps with `wind info`; cut the recording, or sample it more slowly.",
        )
    grid = Drive(start_ns=start, dt=interval, wind=np.zeros((count, 3)))
    times = grid.times_ns
    if stamps.size == count and np.array_equal(stamps, times):
        on_grid = velocity
    else:
        since = (stamps - start) * 1e-9
        wanted = (times - start) * 1e-9
        on_grid = np.stack([np.interp(wanted, since, velocity[:, k]) for k in range(3)], axis=1)
    motion = None
    if recording.station.platform is not None:
        if recording.platform is None:
            raise UserError(
                "The station stands on a platform, but the recording has no platform motion.",
                recording.name,
                "Record its odometry, or remove `platform` from the station.",
            )
        motion = PlatformTrack(recording.platform, with_travel=True).at(times).motion
    temperature = _on_grid(recording.temperature, times)
    pressure = _on_grid(recording.pressure, times)
    density = None
    if temperature is not None:
        density = air_density(temperature, STANDARD_PRESSURE if pressure is None else pressure)
    return replace(
        grid,
        wind=on_grid,
        motion=motion,
        temperature=temperature,
        density=density,
        elapsed=(start - recording.start) * 1e-9,
    )
