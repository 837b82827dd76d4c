"""What happens in a simulation, apart from the station itself."""

from __future__ import annotations

from dataclasses import dataclass

from wind_sensors.simulation.trajectories import Trajectory
from wind_sensors.station.signals import PlatformStates, Winds
from wind_sensors.turbulence.synthesis import TurbulenceSpec


@dataclass(frozen=True)
class TransportFaults:
    """What happens to messages between the sensor and the receiver.

    Attributes:
        delay: From stamp to arrival [s].
        jitter: Largest further delay, uniform [s]; it reorders messages that lie closer.
        loss: Share of the messages lost.
        doubling: Share of the messages that arrive twice.
        holding: Share of the messages held back by `holding_time`, arriving out of order.
        holding_time: [s].
        not_a_number: Share of the angle messages that carry NaN.
        clock_jump_at: When the stamping clock jumps, seconds since the start; None: never.
        clock_jump: By how much, negative: back [s].
        counter_modulus: Pulse counters wrap to zero at this number; None: they do not wrap.
        seed: Of all of it.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    doubling: float = 0.0
    holding: float = 0.0
    holding_time: float = 0.2
    not_a_number: float = 0.0
    clock_jump_at: float | None = None
    clock_jump: float = 0.0
    counter_modulus: int | None = None
    seed: int = 0


@dataclass(frozen=True)
class Scenario:
    """A wind, a movement, an air and the rates at which they are sampled.

    Attributes:
        wind: Turbulence to make, or a measured wind to blow again.
        duration: [s].
        seed: Of noise, losses and bounces; the turbulence has its own.
        trajectory: Movement of the carrier: by parameters, or states to follow; None: at rest.
        sample_rate: Of the grid on which wind and instruments are computed [1/s].
        vane_rate, reference_rate, platform_rate, air_rate: Of the messages [1/s].
        temperature: Mean air temperature [deg C].
        temperature_amplitude: Of a slow sinusoidal change [K].
        temperature_period: Its period [s].
        pressure: Air pressure [Pa].
        platform_noise: The platform reports with the errors of its `attitude_noise_deg` and
            `velocity_noise`, wandering slowly as those of real navigation do.
        faults: What the transport does to the messages of a live simulation.
    """

    wind: TurbulenceSpec | Winds
    duration: float = 900.0
    seed: int = 0
    trajectory: Trajectory | PlatformStates | None = None
    sample_rate: float = 20.0
    vane_rate: float = 20.0
    reference_rate: float = 20.0
    platform_rate: float = 20.0
    air_rate: float = 1.0
    temperature: float = 15.0
    temperature_amplitude: float = 0.0
    temperature_period: float = 3600.0
    pressure: float = 101_325.0
    platform_noise: bool = True
    faults: TransportFaults = TransportFaults()
