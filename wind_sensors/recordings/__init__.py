"""Bags, tables and NMEA files: the edge where files become signals and signals become files."""

from wind_sensors.recordings.reading import read_recording, read_series
from wind_sensors.recordings.station_files import load_station
from wind_sensors.recordings.writing import write_recording

__all__ = ["load_station", "read_recording", "read_series", "write_recording"]
