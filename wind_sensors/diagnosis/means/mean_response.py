"""What a rotor or a vane indicates over an averaging interval: steady and bias equations.

The mean wind takes the place of the instant's wind, and what turbulence adds to the mean enters
through its variance (Kristensen, Hansen & Hansen (2014), (92) to (106)).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.filtered_turbulence import longitudinal_loss
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.wind_at_sensor import WindAtSensors
from wind_sensors.station.changes import segments
from wind_sensors.station.model import Cup, Propeller, Station, Vane
from wind_sensors.station.parameters import rotor_parameters

FloatArray = npt.NDArray[np.float64]

VERTICAL_SHARE = 1.25 / 2.39
"""Ratio of the vertical to the along-wind deviation over flat ground, neutral; K14, sec. 7."""

LENGTH_PER_HEIGHT = 4.0
"""Turbulence's von Karman length 1/q per height above ground [1], neutral surface layer."""


@lru_cache(maxsize=256)
def _loss(distance_constant: float, height: float) -> float:
    return float(longitudinal_loss(distance_constant / (LENGTH_PER_HEIGHT * height)))


def _indicated(
    rotor: Cup | Propeller,
    station: Station,
    felt: FloatArray,
    intensity: FloatArray,
    temperature: FloatArray,
    density: FloatArray,
) -> FloatArray:
    """Indicated speed [m/s] of a rotor of which nothing changes; see `mean_speed`."""
    p = rotor_parameters(rotor)
    height = max(station.recording.measuring_height + rotor.position[2], 2.0)
    ratio = np.where(np.isfinite(density), density / rotor.reference_density, 1.0)
    kelvin = np.where(np.isfinite(temperature), temperature - p.reference_temperature, 0.0)
    friction = p.friction * np.exp(p.friction_temperature_coefficient * kelvin)
    length = p.distance_constant * p.inertia_factor / float(np.median(ratio))
    # The calibration holds for a rotor with a4 = 1 and a cosine response in this turbulence: only
    # what departs from it is added.
    overspeeding = (p.a4 - 1.0) * _loss(round(length, 3), height)
    oblique = 0.5 * p.mu2 * VERTICAL_SHARE**2
    wind = felt * (1.0 + (overspeeding + oblique) * intensity**2)
    forcing = p.calibration_gain * wind - p.starting_speed + p.calibration_offset
    forcing = np.maximum(forcing, 0.0)
    load = np.maximum(friction, 0.0) / ratio
    y = _steady_rate(forcing, load, p.a4)
    return np.where(y > 0.0, y + p.starting_speed, 0.0)


def _steady_rate(forcing: FloatArray, load: FloatArray, a4: float) -> FloatArray:
    """l s [m/s] at which (A - y)(a4 A + (1 - a4) y) equals the friction; 0 for a stalled rotor."""
    if not load.any():
        return forcing
    share = 1.0 - a4
    middle = (share - a4) * forcing
    constant = a4 * forcing**2 - load
    if abs(share) < 1e-6:
        y = np.divide(constant, -middle, out=np.zeros_like(forcing), where=middle != 0.0)
    else:
        under = middle**2 + 4.0 * share * constant
        y = (middle + np.sqrt(np.maximum(under, 0.0))) / (2.0 * share)
        y = np.where(under >= 0.0, y, 0.0)
    return np.where((forcing**2 * max(a4, 0.05) > load) & (y > 0.0), np.minimum(y, forcing), 0.0)


def mean_speed(
    station: Station,
    rotor: str,
    speed: FloatArray,
    heading: FloatArray,
    intensity: FloatArray,
    temperature: FloatArray,
    density: FloatArray,
    elapsed: FloatArray,
) -> FloatArray:
    """Indicated mean speed of a rotor.

    Args:
        station: The station; its changes hold in their intervals.
        rotor: Name.
        speed: Mean wind speed at the mast [m/s], shape (n,).
        heading: Where it comes from, counter-clockwise from the sensor's x axis [rad].
        intensity: Turbulence intensity [1].
        temperature, density: Of the air [deg C], [kg/m^3]; NaN where unknown.
        elapsed: Seconds since the start of the recording.

    Returns:
        Shape (n,) [m/s].
    """
    wind = np.stack((-speed * np.cos(heading), -speed * np.sin(heading), np.zeros_like(speed)), 1)
    drive = Drive(0, 600.0, wind)
    level = station.model_copy(update={"sensor_heading_deg": 0.0})
    out = np.full(speed.shape, np.nan)
    for segment in segments(level):
        rows = (elapsed >= segment.start) & (elapsed < segment.stop)
        if not rows.any():
            continue
        instrument = segment.station.instrument(rotor)
        assert isinstance(instrument, Cup | Propeller)
        flow = WindAtSensors(segment.station, drive.with_wind(wind[rows])).flow(instrument).wind
        out[rows] = _indicated(
            instrument, segment.station, np.hypot(flow[:, 0], flow[:, 1]), intensity[rows],
            temperature[rows], density[rows],
        )
    return out


def mean_heading(
    station: Station, vane: str, heading: FloatArray, elapsed: FloatArray
) -> FloatArray:
    """Indicated mean heading of a vane's nose [rad]; arguments as in `mean_speed`."""
    out = np.full(heading.shape, np.nan)
    for segment in segments(station):
        rows = (elapsed >= segment.start) & (elapsed < segment.stop)
        instrument = segment.station.instrument(vane)
        assert isinstance(instrument, Vane)
        true = heading[rows]
        swing = np.radians(instrument.eccentricity_deg) * np.sin(
            true - np.radians(instrument.eccentricity_phase_deg)
        )
        out[rows] = true + swing + np.radians(instrument.offset_deg)
    return out
