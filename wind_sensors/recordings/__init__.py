"""Bags, tables and NMEA files: the edge where files become signals and signals become files.

The names below are looked up when they are asked for: a node that reads its station file needs
none of the libraries that read and write bags.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wind_sensors.recordings.reading import read_recording, read_series
    from wind_sensors.recordings.station_files import load_station
    from wind_sensors.recordings.writing import write_recording

__all__ = ["load_station", "read_recording", "read_series", "write_recording"]

_MODULES = {
    "load_station": "station_files",
    "read_recording": "reading",
    "read_series": "reading",
    "write_recording": "writing",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
