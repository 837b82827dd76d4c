"""Bivane: reduction of its angles to the vertical (and lateral) wind; Mitsuta (1966), corrected.

The bivane is a vane in two planes, omega0 = 2 pi V/L with L the free wind run of M66, so
l_v = L/(2 pi). Small angles; V is the wind speed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.vane import transfer_function

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


class SamplingVerdict(NamedTuple):
    """Whether a sampling interval serves the discrete reduction.

    Attributes:
        samples_per_period: T0/dt.
        gain_at_resonance: |H R| at omega0; 1 is perfect.
        nyquist_gain: Amplification of noise at the Nyquist frequency.
        good: Whether the error at resonance stays within the tolerance asked for.
    """

    samples_per_period: float
    gain_at_resonance: float
    nyquist_gain: float
    good: bool


def free_period(free_wind_run: float, speed: float) -> float:
    """T0 = L/V [s]; M66 (2)."""
    return free_wind_run / speed


def distance_constant(free_wind_run: float) -> float:
    """l_v = L/(2 pi) [m]: K94's vane length of M66's L."""
    return free_wind_run / (2.0 * math.pi)


def damped_period(free_wind_run: float, speed: float, damping_ratio: float) -> float:
    """T0/sqrt(1 - zeta^2) [s]: the period seen when a deflected bivane is released."""
    width = math.sqrt((1.0 - damping_ratio) * (1.0 + damping_ratio))
    return free_period(free_wind_run, speed) / width


def vertical_velocity(
    angle: npt.ArrayLike,
    rate: npt.ArrayLike,
    acceleration: npt.ArrayLike,
    speed: npt.ArrayLike,
    free_wind_run: float,
    damping_ratio: float,
) -> FloatArray:
    """W = V beta + zeta L/pi beta' + L^2/(4 pi^2 V) beta'' [m/s]; M66 (5).

    Args:
        angle, rate, acceleration: beta [rad] and its derivatives [rad/s], [rad/s^2].
        speed: V [m/s]; NaN is returned where it is not positive.
        free_wind_run: L [m].
        damping_ratio: zeta.
    """
    v = _positive(speed)
    length = distance_constant(free_wind_run)
    return (
        v * np.asarray(angle, dtype=np.float64)
        + 2.0 * damping_ratio * length * np.asarray(rate, dtype=np.float64)
        + length * length / v * np.asarray(acceleration, dtype=np.float64)
    )


def reduce_samples(
    angle: npt.ArrayLike,
    speed: npt.ArrayLike,
    interval: float,
    free_wind_run: float,
    damping_ratio: float,
    half_width: int = 1,
    printed_form: bool = False,
) -> FloatArray:
    """W [m/s] from sampled angles by central differences; M66 (6) with L^2 in the last term.

    Args:
        angle: beta [rad], shape (n,).
        speed: V [m/s], shape (n,) or scalar.
        interval: dt [s].
        free_wind_run: L [m].
        damping_ratio: zeta.
        half_width: Samples used on each side; 1 is M66's (6), more keep the gain right closer to
            the Nyquist frequency.
        printed_form: Use L instead of L^2 as the paper prints, to show that it fails.

    Returns:
        Shape (n,); NaN where a difference would reach beyond the ends, and where V is not
        positive.
    """
    beta = np.asarray(angle, dtype=np.float64)
    v = np.broadcast_to(_positive(speed), beta.shape)
    length = distance_constant(free_wind_run)
    curvature = length * length
    if printed_form:
        curvature = free_wind_run / (4.0 * math.pi**2)
    out = np.full(beta.shape, np.nan)
    if beta.size <= 2 * half_width:
        return out
    inner = slice(half_width, beta.size - half_width)
    middle = beta[inner]
    slope = np.zeros_like(middle)
    bend = np.zeros_like(middle)
    for k, (first, second) in enumerate(zip(*difference_weights(half_width), strict=True), 1):
        ahead = beta[half_width + k : beta.size - half_width + k]
        behind = beta[half_width - k : beta.size - half_width - k]
        slope += first * (ahead - behind) / interval
        bend += second * (ahead + behind - 2.0 * middle) / interval**2
    v = v[inner]
    out[inner] = v * middle + 2.0 * damping_ratio * length * slope + curvature / v * bend
    return out


def difference_weights(half_width: int) -> tuple[FloatArray, FloatArray]:
    """Weights of the widest-order central differences, shape (half_width,) each.

    beta' = sum_k first_k (beta_k - beta_-k)/dt, beta'' = sum_k second_k (beta_k + beta_-k -
    2 beta_0)/dt^2, exact for polynomials of degree 2 half_width + 1.

    Raises:
        ValueError: If the half width is below one.
    """
    if half_width < 1:
        raise ValueError("a central difference needs at least one sample on each side")
    m = half_width
    first = [
        (-1) ** (k + 1)
        * math.factorial(m) ** 2
        / (k * math.factorial(m - k) * math.factorial(m + k))
        for k in range(1, m + 1)
    ]
    orders = np.arange(1, m + 1)
    slopes = np.array(first)
    return slopes, 2.0 * slopes / orders


def correction_gain(
    frequency: npt.ArrayLike, sampling: float, damping_ratio: float, half_width: int = 1
) -> ComplexArray:
    """Complex gain R of the discrete reduction (derived).

    Args:
        frequency: omega/omega0 [1].
        sampling: omega0 dt [1].
        damping_ratio: zeta.
        half_width: As in `reduce_samples`.
    """
    turn = np.asarray(frequency, dtype=np.float64) * sampling
    slope = np.zeros_like(turn)
    bend = np.zeros_like(turn)
    for k, (first, second) in enumerate(zip(*difference_weights(half_width), strict=True), 1):
        slope = slope + 2.0 * first * np.sin(k * turn)
        bend = bend + 4.0 * second * np.sin(0.5 * k * turn) ** 2
    return np.asarray(1.0 - bend / sampling**2 + 2j * damping_ratio * slope / sampling)


def overall_gain(
    frequency: npt.ArrayLike, sampling: float, damping_ratio: float, half_width: int = 1
) -> FloatArray:
    """|H R| [1] of bivane and reduction together. Arguments as in `correction_gain`."""
    response = transfer_function(frequency, damping_ratio)
    gain = correction_gain(frequency, sampling, damping_ratio, half_width)
    return np.asarray(np.abs(response * gain))


def half_width_for(
    nyquist_share: float, sampling: float, damping_ratio: float, tolerance: float
) -> int:
    """Smallest half width whose overall gain stays right up to a share of the Nyquist frequency.

    Args:
        nyquist_share: Share of the Nyquist frequency, below 1.
        sampling: omega0 dt [1].
        damping_ratio: zeta.
        tolerance: Largest error of |H R|.

    Raises:
        ValueError: If no half width up to 30 samples serves.
    """
    frequency = np.linspace(0.0, nyquist_share, 200) * math.pi / sampling
    for half_width in range(1, 31):
        gain = overall_gain(frequency, sampling, damping_ratio, half_width)
        if np.max(np.abs(gain - 1.0)) <= tolerance:
            return half_width
    raise ValueError("no difference formula reaches that close to the Nyquist frequency")


def nyquist_gain(sampling: float) -> float:
    """|1 - 4/(omega0 dt)^2| [1]: amplification of noise at the Nyquist frequency."""
    return abs(1.0 - 4.0 / sampling**2)


def reduced_sampling(free_wind_run: float, speed: float, interval: float) -> float:
    """omega0 dt = 2 pi V dt/L [1]."""
    return 2.0 * math.pi * speed * interval / free_wind_run


def judge_sampling(
    free_wind_run: float,
    speed: float,
    interval: float,
    damping_ratio: float,
    tolerance: float = 0.02,
) -> SamplingVerdict:
    """Whether dt is short enough for the reduction at resonance.

    Args:
        free_wind_run: L [m].
        speed: V [m/s], the largest to be met.
        interval: dt [s].
        damping_ratio: zeta.
        tolerance: Error of the gain at resonance allowed.
    """
    sampling = reduced_sampling(free_wind_run, speed, interval)
    at_resonance = float(overall_gain(1.0, sampling, damping_ratio))
    return SamplingVerdict(
        samples_per_period=2.0 * math.pi / sampling,
        gain_at_resonance=at_resonance,
        nyquist_gain=nyquist_gain(sampling),
        good=abs(at_resonance - 1.0) <= tolerance and sampling < math.pi,
    )


def _positive(speed: npt.ArrayLike) -> FloatArray:
    v = np.asarray(speed, dtype=np.float64)
    return np.where(v > 0.0, v, np.nan)
