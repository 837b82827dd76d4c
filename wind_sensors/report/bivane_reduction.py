"""Mitsuta's comparison of bivane and sonic anemometer, repeated with a simulated bivane.

The vertical wind is a random record below 0.9 of the Nyquist frequency of the readings, so that
spectra up to there can be compared without aliasing. The bivane's inclination follows the
compiled vane equation in the vertical plane.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import signal

from wind_sensors.instruments import bivane
from wind_sensors.instruments.dynamics.vane import VaneParameters, integrate_vane
from wind_sensors.turbulence import von_karman
from wind_sensors.turbulence.modes import draw_modes, modal_variances, sum_modes

FloatArray = npt.NDArray[np.float64]

MITSUTA_WIND_RUN = 15.0
"""L [m] of M66's bivane."""
MITSUTA_DAMPING = 0.15
MITSUTA_SPEED = 5.3
"""Mean wind of M66's record [m/s]."""
MITSUTA_INTERVAL = 0.5
"""Sampling interval of M66 [s]."""

_OVERSAMPLING = 20
_READINGS = 2**12
_SPIN_UP = 200


class Comparison(NamedTuple):
    """Spectra of the vertical wind as different readings give it, one-sided [m^2/s^2/Hz].

    Attributes:
        frequency: [Hz], shape (n,).
        true: Of the wind itself (the sonic anemometer of M66).
        plain: Of V beta, the traditional reading.
        reduced: Of the three-point reduction, M66 (6) corrected.
        wide: Of the reduction with differences wide enough for the sampling.
        printed: Of (6) as printed, with L for L^2.
        errors: Root mean square error of plain, reduced, wide and printed over that of the wind.
    """

    frequency: FloatArray
    true: FloatArray
    plain: FloatArray
    reduced: FloatArray
    wide: FloatArray
    printed: FloatArray
    errors: tuple[float, float, float, float]


def compare_reductions(
    interval: float = MITSUTA_INTERVAL,
    half_width: int = 12,
    realisations: int = 16,
    seed: int = 1,
    speed: float = MITSUTA_SPEED,
    intensity: float = 0.1,
    integral_length: float = 5.0,
    band: float = 0.9,
) -> Comparison:
    """Simulate, sample, reduce and compare.

    Args:
        interval: Sampling interval of the readings [s].
        half_width: Of the wide reduction, see `bivane.reduce_samples`.
        realisations: Records averaged, each 4096 readings long.
        seed: Of the wind.
        speed: V [m/s].
        intensity: sigma_w/V [1].
        integral_length: Of the vertical wind's von Karman spectrum [m].
        band: Largest frequency of the wind over the readings' Nyquist frequency.
    """
    generator = np.random.Generator(np.random.PCG64(seed))
    sums: list[list[FloatArray]] = [[] for _ in range(5)]
    squares = np.zeros(5)
    frequency = np.zeros(0)
    for _ in range(realisations):
        fine = _vertical_wind(generator, interval, speed, intensity, integral_length, band)
        angle = _bivane_angle(fine, speed, interval / _OVERSAMPLING)
        true = fine[::_OVERSAMPLING]
        sampled = angle[::_OVERSAMPLING]
        constants = (speed, interval, MITSUTA_WIND_RUN, MITSUTA_DAMPING)
        readings = (
            true,
            speed * sampled,
            bivane.reduce_samples(sampled, *constants),
            bivane.reduce_samples(sampled, *constants, half_width=half_width),
            bivane.reduce_samples(sampled, *constants, printed_form=True),
        )
        valid = slice(half_width, _READINGS - half_width)
        for index, reading in enumerate(readings):
            frequency, power = signal.welch(reading[valid], 1.0 / interval, nperseg=256)
            sums[index].append(power)
            squares[index] += float(np.mean((reading[valid] - true[valid]) ** 2))
    variance = realisations * (intensity * speed) ** 2
    errors = np.sqrt(squares[1:] / variance)
    spectra = [np.mean(rows, axis=0) for rows in sums]
    return Comparison(
        frequency=frequency,
        true=spectra[0],
        plain=spectra[1],
        reduced=spectra[2],
        wide=spectra[3],
        printed=spectra[4],
        errors=(float(errors[0]), float(errors[1]), float(errors[2]), float(errors[3])),
    )


def _vertical_wind(
    generator: np.random.Generator,
    interval: float,
    speed: float,
    intensity: float,
    integral_length: float,
    band: float,
) -> FloatArray:
    count = _READINGS * _OVERSAMPLING
    spacing = 2.0 * math.pi / (_READINGS * interval * speed)
    wavenumber = spacing * np.arange(math.floor(0.5 * _READINGS * band) + 1, dtype=np.float64)
    q = von_karman.wavenumber_from_integral_length(integral_length)
    variances = modal_variances(von_karman.transverse_spectrum(wavenumber, 1.0, q), spacing)
    variances *= (intensity * speed) ** 2 / np.sum(variances)
    return sum_modes(draw_modes(generator, variances), count)


def _bivane_angle(vertical: FloatArray, speed: float, step: float) -> FloatArray:
    """Inclination of a bivane: the vane equation in the vertical plane of the mean wind."""
    extended = np.concatenate([vertical[-_SPIN_UP * _OVERSAMPLING :], vertical])
    count = extended.size
    wind = np.stack([np.full(count, -speed), -extended, np.zeros(count)], axis=1)
    length = bivane.distance_constant(MITSUTA_WIND_RUN)
    angle, _ = integrate_vane(
        VaneParameters(length, MITSUTA_DAMPING, 1.0, 1.0, 0.0, 0.0, 0.0),
        wind,
        np.zeros(count),
        np.zeros((count, 2)),
        np.ones(count),
        step,
        math.nan,
        0.0,
    )
    return angle[_SPIN_UP * _OVERSAMPLING :]
