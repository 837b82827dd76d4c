"""A mount that moves: what its known motion makes of the signals, beside what the eddies do."""

from __future__ import annotations

from dataclasses import dataclass, field

from scipy.ndimage import uniform_filter1d

from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.memory import DriveMemory
from wind_sensors.station.model import Station


@dataclass(frozen=True)
class Moving:
    """A mount that moves, in a wind without eddies.

    However little the reference tells of the eddies at the sensors, what the motion makes of the
    signals is known, and expected in full.

    Attributes:
        station: The station, moving as it is believed to.
        drive: The recording's motion and air in such a wind.
        memory: What instruments did in it.
    """

    station: Station
    drive: Drive
    memory: DriveMemory = field(repr=False, compare=False)


def in_slow_wind(drive: Drive, station: Station, seconds: float) -> Moving:
    """A station that moves, in the slow wind of a drive.

    Args:
        drive: Of the recording.
        station: Moving as it is believed to.
        seconds: Time over which the wind is averaged [s].
    """
    width = min(int(seconds / drive.dt), len(drive) - 1) | 1
    slow = drive.with_wind(uniform_filter1d(drive.wind, width, axis=0, mode="mirror"))
    return Moving(station, slow, DriveMemory(slow))
