"""The diagnosis live and light: blocks of signals against their simulation, one after another."""

from wind_sensors.diagnosis.watch.finding import Finding
from wind_sensors.diagnosis.watch.settings import WatchSettings
from wind_sensors.diagnosis.watch.watching import Watch

__all__ = ["Finding", "Watch", "WatchSettings"]
