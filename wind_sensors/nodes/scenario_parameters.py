"""The scenario of a simulation as node parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wind_sensors.errors import UserError
from wind_sensors.motion.frames import velocity_from_direction
from wind_sensors.nodes.parameters import Parameter, Value
from wind_sensors.simulation.scenario import Scenario, TransportFaults
from wind_sensors.simulation.trajectories import CARRIERS
from wind_sensors.station.model import Station
from wind_sensors.turbulence.synthesis import TurbulenceSpec, surface_layer_spec

_FAULTS = TransportFaults()
_REST = "rest"


def _share(name: str, default: float, description: str) -> Parameter:
    return Parameter(name, float, default, description, minimum=0.0, maximum=1.0)


def _rate(name: str, default: float, what: str) -> Parameter:
    return Parameter(name, float, default, f"{what} per second [Hz].", minimum=0.01, maximum=1000.0)


SCENARIO_PARAMETERS: tuple[Parameter, ...] = (
    Parameter("mean_speed", float, 8.0, "Mean wind speed [m/s].", minimum=0.01, maximum=100.0),
    Parameter(
        "direction_from",
        float,
        270.0,
        "Direction the mean wind comes from [deg clockwise from north].",
        minimum=-360.0,
        maximum=360.0,
    ),
    Parameter(
        "turbulence",
        str,
        "isotropic",
        "isotropic: the three components alike, from intensity and integral_length; "
        "surface_layer: from the station's height and roughness, and stability.",
        choices=("isotropic", "surface_layer"),
    ),
    Parameter(
        "intensity",
        float,
        0.12,
        "Standard deviation of each component over the mean speed (isotropic).",
        minimum=0.0,
        maximum=1.0,
    ),
    Parameter(
        "integral_length",
        float,
        60.0,
        "Longitudinal integral length [m] (isotropic).",
        minimum=0.1,
        maximum=10_000.0,
    ),
    Parameter(
        "stability",
        float,
        0.0,
        "Height over Obukhov length (surface_layer); negative by day.",
        minimum=-5.0,
        maximum=2.0,
    ),
    Parameter(
        "gust_amplitude",
        float,
        0.0,
        "Amplitude of a slow sinusoidal change of the mean speed [m/s].",
        minimum=0.0,
        maximum=50.0,
    ),
    Parameter("gust_period", float, 600.0, "Its period [s].", minimum=1.0, maximum=86_400.0),
    Parameter(
        "turn_amplitude_deg",
        float,
        0.0,
        "Amplitude of a slow turn of the mean direction, same period [deg].",
        minimum=0.0,
        maximum=180.0,
    ),
    Parameter("seed", int, 0, "Of everything that is random.", minimum=0),
    Parameter(
        "carrier",
        str,
        _REST,
        "How a station with a platform moves.",
        choices=(_REST, *CARRIERS),
    ),
    Parameter(
        "carrier_speed", float, 0.0, "Its speed over ground [m/s].", minimum=0.0, maximum=100.0
    ),
    Parameter(
        "carrier_course_deg",
        float,
        90.0,
        "Its course at the start [deg clockwise from north].",
        minimum=-360.0,
        maximum=360.0,
    ),
    _rate("sample_rate", 20.0, "Steps of the simulated instruments"),
    _rate("vane_rate", 20.0, "Messages of a vane"),
    _rate("reference_rate", 20.0, "Messages of the reference wind"),
    _rate("platform_rate", 20.0, "Messages of the platform"),
    _rate("air_rate", 1.0, "Messages of temperature and pressure"),
    Parameter("temperature", float, 15.0, "Air temperature [deg C].", minimum=-90.0, maximum=60.0),
    Parameter(
        "pressure",
        float,
        101_325.0,
        "Air pressure [Pa].",
        minimum=10_000.0,
        maximum=120_000.0,
    ),
    Parameter(
        "faults.delay",
        float,
        _FAULTS.delay,
        "Of every message, from stamp to arrival [s].",
        minimum=0.0,
        maximum=60.0,
    ),
    Parameter(
        "faults.jitter",
        float,
        _FAULTS.jitter,
        "Largest further delay, uniform [s].",
        minimum=0.0,
        maximum=60.0,
    ),
    _share("faults.loss", _FAULTS.loss, "Share of the messages lost."),
    _share("faults.doubling", _FAULTS.doubling, "Share of the messages that arrive twice."),
    _share("faults.holding", _FAULTS.holding, "Share held back, so that they arrive too late."),
    Parameter(
        "faults.holding_time",
        float,
        _FAULTS.holding_time,
        "By how much [s].",
        minimum=0.0,
        maximum=60.0,
    ),
    _share("faults.not_a_number", _FAULTS.not_a_number, "Share of the angles that are NaN."),
    Parameter(
        "faults.clock_jump_at",
        float,
        None,
        "When the stamping clock jumps [s since the start]; unset: never.",
        minimum=0.0,
    ),
    Parameter(
        "faults.clock_jump",
        float,
        _FAULTS.clock_jump,
        "By how much; negative: back [s].",
        minimum=-86_400.0,
        maximum=86_400.0,
    ),
    Parameter(
        "faults.counter_modulus",
        int,
        None,
        "Pulse counters wrap at this number; unset: the station file's modulus.",
        minimum=2,
    ),
)
"""Parameters that make up a `Scenario`."""


def scenario_of(values: Mapping[str, Value], station: Station) -> Scenario:
    """The scenario that the parameters describe.

    Args:
        values: Accepted values of `SCENARIO_PARAMETERS`.
        station: For the surface layer's height and roughness.

    Raises:
        UserError: The parameters contradict each other or the station.
    """
    number = {
        name: float(value)
        for name, value in values.items()
        if isinstance(value, (int, float)) and not isinstance(value, bool)
    }
    carrier = str(values["carrier"])
    if carrier != _REST and station.platform is None:
        raise UserError(
            f"the station stands on a mast, so it cannot move as a {carrier}.",
            "carrier",
            "Give the station file a `platform`, or leave `carrier` at rest.",
        )
    course = np.radians(90.0 - number["carrier_course_deg"])
    seed = int(number["seed"])
    return Scenario(
        wind=_wind(values, number, station),
        seed=seed,
        trajectory=(
            None
            if carrier == _REST
            else CARRIERS[carrier](number["carrier_speed"], float(course), seed)
        ),
        sample_rate=number["sample_rate"],
        vane_rate=number["vane_rate"],
        reference_rate=number["reference_rate"],
        platform_rate=number["platform_rate"],
        air_rate=number["air_rate"],
        temperature=number["temperature"],
        pressure=number["pressure"],
        faults=TransportFaults(
            delay=number["faults.delay"],
            jitter=number["faults.jitter"],
            loss=number["faults.loss"],
            doubling=number["faults.doubling"],
            holding=number["faults.holding"],
            holding_time=number["faults.holding_time"],
            not_a_number=number["faults.not_a_number"],
            clock_jump_at=number.get("faults.clock_jump_at"),
            clock_jump=number["faults.clock_jump"],
            counter_modulus=(
                int(number["faults.counter_modulus"])
                if "faults.counter_modulus" in number
                else None
            ),
            seed=seed,
        ),
    )


def _wind(
    values: Mapping[str, Value], number: Mapping[str, float], station: Station
) -> TurbulenceSpec:
    speed, seed = number["mean_speed"], int(number["seed"])
    east, north, _ = velocity_from_direction(1.0, number["direction_from"])
    direction = float(np.arctan2(north, east))
    if values["turbulence"] == "surface_layer":
        info = station.recording
        spec = surface_layer_spec(
            speed,
            info.measuring_height,
            info.roughness_length,
            number["stability"],
            direction=direction,
            seed=seed,
        )
    else:
        sigma = number["intensity"] * speed
        length = number["integral_length"]
        spec = TurbulenceSpec(
            mean_speed=speed,
            direction=direction,
            standard_deviations=(sigma, sigma, sigma),
            integral_lengths=(length, length, length),
            seed=seed,
        )
    return replace(
        spec,
        slow_amplitude=number["gust_amplitude"],
        slow_period=number["gust_period"],
        turn_amplitude=float(np.radians(number["turn_amplitude_deg"])),
    )
