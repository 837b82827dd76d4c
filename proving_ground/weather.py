"""Weather of a record: a wind that wanders, veers and gusts, and the air it blows in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from proving_ground.inflow import Array

GAS_CONSTANT = 287.05
GRAVITY = 9.81


@dataclass(frozen=True)
class Weather:
    """What a record's weather is drawn from.

    mean_speed [m/s]; turbulence [1] is the along-wind standard deviation over the local speed;
    wander_speed [1] is the standard deviation of the logarithm of the slow speed, wander_direction
    [rad] that of the slow heading, veer [rad] its steady turn over the record; heading [rad] is
    where the air goes, counter-clockwise from east; gust_fronts counts sudden changes;
    temperature [deg C] with its swing [K]; pressure [Pa]; cross_ratio and vertical_ratio [1] of the
    other standard deviations; slowest [m/s] the slow wind gets.
    """

    mean_speed: float
    turbulence: float
    wander_speed: float
    wander_direction: float
    veer: float
    heading: float
    gust_fronts: int = 0
    temperature: float = 12.0
    temperature_swing: float = 3.0
    pressure: float = 101300.0
    cross_ratio: float = 0.8
    vertical_ratio: float = 0.5
    slowest: float = 0.6


@dataclass(frozen=True)
class SlowWind:
    """Slow wind of a record on its time grid: speed [m/s], heading [rad], local turbulence [1]."""

    speed: Array
    heading: Array
    turbulence: Array


def random_weather(rng: np.random.Generator) -> Weather:
    """Draw a day: 3 to 13 m/s, turbulence 5 to 25 %, from settled to squally."""
    restless = rng.uniform(0.15, 1.0)
    return Weather(
        mean_speed=float(rng.uniform(3.0, 11.0)),
        turbulence=float(rng.uniform(0.06, 0.22)),
        wander_speed=float(0.4 * restless * rng.uniform(0.5, 1.1)),
        wander_direction=float(0.8 * restless * rng.uniform(0.3, 1.0)),
        veer=float(rng.normal(0.0, 1.2)),
        heading=float(rng.uniform(-np.pi, np.pi)),
        gust_fronts=int(rng.random() < 0.3),
        temperature=float(rng.uniform(2.0, 24.0)),
        temperature_swing=float(rng.uniform(1.0, 4.0)),
        pressure=float(rng.uniform(98500.0, 103000.0)),
        cross_ratio=float(rng.uniform(0.7, 0.95)),
        vertical_ratio=float(rng.uniform(0.45, 0.6)),
    )


def wandering(rng: np.random.Generator, time: Array, shortest: float, longest: float) -> Array:
    """Smooth unit-variance random signal with periods between shortest and longest [s]."""
    count = 12
    period = np.geomspace(shortest, longest, count) * rng.uniform(0.85, 1.15, count)
    size = rng.standard_normal(count) * (period / longest) ** 0.5
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    signal = np.zeros_like(time)
    for p, a, f in zip(period, size, phase, strict=True):
        signal += a * np.sin(2.0 * np.pi * time / p + f)
    return np.asarray((signal - signal.mean()) / max(float(signal.std()), 1e-9))


def slow_wind(rng: np.random.Generator, time: Array, weather: Weather) -> SlowWind:
    """Slow speed, heading and turbulence on the grid `time` [s]."""
    duration = float(time[-1])
    logarithm = weather.wander_speed * wandering(rng, time, 90.0, 1.3 * duration)
    speed = weather.mean_speed * np.exp(logarithm - 0.5 * weather.wander_speed**2)
    heading = weather.heading + weather.wander_direction * wandering(
        rng, time, 120.0, 1.3 * duration
    )
    heading = heading + weather.veer * time / duration
    for _ in range(weather.gust_fronts):
        arrival = rng.uniform(0.1, 0.85) * duration
        rise = expit((time - arrival) / rng.uniform(0.6, 2.5))
        relax = np.exp(-np.maximum(time - arrival, 0.0) / rng.uniform(40.0, 150.0))
        speed = speed * (1.0 + rng.uniform(0.25, 0.7) * rise * relax)
        heading = heading + rng.normal(0.0, 0.5) * rise * relax
    burst = np.exp(0.2 * wandering(rng, time, 20.0, 300.0))
    return SlowWind(np.clip(speed, weather.slowest, 18.0), heading, weather.turbulence * burst)


def air_density(temperature: Array | float, pressure: Array | float) -> Array:
    """Density of dry air [kg/m^3] from temperature [deg C] and pressure [Pa]."""
    return np.asarray(np.asarray(pressure) / (GAS_CONSTANT * (np.asarray(temperature) + 273.15)))
