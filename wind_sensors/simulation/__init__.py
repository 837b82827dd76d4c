"""The forward model: wind to signals, for simulators, live streams and the diagnosis."""

from wind_sensors.simulation.drive import Drive, air_density, drive_from_recording
from wind_sensors.simulation.encoder import AngleEncoder, angle_readings
from wind_sensors.simulation.pulses import (
    PulseCircuit,
    edge_times,
    expected_signals,
    passed_slots,
    rotor_signals,
)
from wind_sensors.simulation.response import (
    AngleResponse,
    Response,
    ResponseState,
    RotorResponse,
    respond,
)
from wind_sensors.simulation.run import SignalStream, simulate
from wind_sensors.simulation.scenario import Scenario, TransportFaults
from wind_sensors.simulation.trajectories import CARRIERS, Trajectory

__all__ = [
    "CARRIERS",
    "AngleEncoder",
    "AngleResponse",
    "Drive",
    "PulseCircuit",
    "Response",
    "ResponseState",
    "RotorResponse",
    "Scenario",
    "SignalStream",
    "Trajectory",
    "TransportFaults",
    "air_density",
    "angle_readings",
    "drive_from_recording",
    "edge_times",
    "expected_signals",
    "passed_slots",
    "respond",
    "rotor_signals",
    "simulate",
]
