"""Sizes of effects in words."""

from __future__ import annotations

from math import isfinite

import numpy as np

from wind_sensors.diagnosis.effects.definition import Parameter
from wind_sensors.station.model import Station

BEARING = "bearing_from"
"""Name of the parameters that say where a wind comes from."""


def number_text(value: float, digits: int = 3) -> str:
    """A number as people write it: 1660 and not 1.66e+03.

    Args:
        value: The number.
        digits: Significant ones; numbers from a million on, and those below 1e-4, have a power of
            ten.
    """
    return f"{float(f'{value:.{digits}g}'):g}" if isfinite(value) else "?"


def date_text(time_ns: int) -> str:
    """A moment [ns] to the minute."""
    minute = np.datetime_as_string(np.datetime64(time_ns, "ns"), unit="m")
    return f"{minute.replace('T', ' ')} UTC"


def clockwise(bearing_deg: float, station: Station) -> float:
    """A bearing as winds are told [deg, 0 to 360); files count counter-clockwise from the x axis.

    Args:
        bearing_deg: Counter-clockwise from the sensor's x axis [deg].
        station: Tells whether it counts from north or from the bow, see `counted_from`.
    """
    platform = station.platform
    start = 90.0 if platform is None else -platform.sensor_rotation_deg[2]
    return (start - bearing_deg) % 360.0


def counted_from(station: Station) -> str:
    """From where the bearings of `clockwise` count."""
    return "from north" if station.platform is None else "from the bow"


def parameter_text(parameter: Parameter, value: float, station: Station | None = None) -> str:
    """A parameter with its value, its unit and what its sign means.

    Args:
        parameter: The parameter.
        value: Its value.
        station: Tells from where bearings count. None: they count as in a station file, and the
            text says so.
    """
    if parameter.name == BEARING:
        if station is None:
            return f"wind from {number_text(value % 360.0)} deg counter-clockwise from the x axis"
        return f"wind from {clockwise(value, station):.0f} deg {counted_from(station)}"
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    sense = f", {parameter.sense}" if parameter.sense else ""
    return f"{parameter.name.replace('_', ' ')} {number_text(value)}{unit}{sense}"
