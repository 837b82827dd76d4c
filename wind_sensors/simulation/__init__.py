"""The forward model: wind to signals, for simulators, live streams and the diagnosis."""

from wind_sensors.simulation.drive import Drive, air_density, drive_from_recording
from wind_sensors.simulation.encoder import AngleEncoder, angle_readings
from wind_sensors.simulation.pulses import PulseCircuit, edge_times
from wind_sensors.simulation.response import (
    AngleResponse,
    Response,
    ResponseState,
    RotorResponse,
    respond,
)

__all__ = [
    "AngleEncoder",
    "AngleResponse",
    "Drive",
    "PulseCircuit",
    "Response",
    "ResponseState",
    "RotorResponse",
    "air_density",
    "angle_readings",
    "drive_from_recording",
    "edge_times",
    "respond",
]
