"""Periodic solutions of the nonlinear rotor equation: exact mean rates in periodic gusts.

The equation of `rotor_family` is solved for all phases at once by Fourier collocation and
Newton's method, which converges exponentially for smooth gusts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import optimize

FloatArray = npt.NDArray[np.float64]

_SIZES = (33, 65, 129, 257, 513, 1025)
_TAIL = 1e-13
_STOPPED = 1e-6


@dataclass(frozen=True)
class PeriodicRate:
    """A periodic rotor rate y(theta) = l s/U as a truncated Fourier series.

    Attributes:
        coefficients: c_n of y = sum c_n exp(i n theta), n = 0..N; the rest follows from
            c_-n = conj(c_n).
    """

    coefficients: npt.NDArray[np.complex128]

    @property
    def mean(self) -> float:
        """Mean of y over one period [1]."""
        return float(self.coefficients[0].real)

    def at(self, phase: npt.ArrayLike) -> FloatArray:
        """y at the phase(s) theta [rad]."""
        theta = np.asarray(phase, dtype=np.float64)
        orders = np.arange(1, self.coefficients.size)
        waves = np.exp(1j * theta[..., None] * orders)
        return np.asarray(self.mean + 2.0 * np.real(waves @ self.coefficients[1:]))

    def first_harmonic(self) -> complex:
        """Y of y = Im[Y exp(i theta)] + other harmonics: gain and phase against sin(theta)."""
        return complex(2.0j * self.coefficients[1])

    def maximum(self) -> float:
        """Largest value of y over the period [1]."""
        theta = np.linspace(0.0, 2.0 * math.pi, 8 * self.coefficients.size + 1)
        start = float(theta[int(np.argmax(self.at(theta)))])
        spacing = 2.0 * math.pi / (8 * self.coefficients.size)
        best = optimize.minimize_scalar(
            lambda angle: -float(self.at(angle)),
            bounds=(start - spacing, start + spacing),
            method="bounded",
            options={"xatol": 1e-10},
        )
        return -float(best.fun)


def periodic_rate(
    forcing: Callable[[FloatArray], FloatArray],
    a4: float,
    reduced_frequency: float,
    lift: Callable[[FloatArray], FloatArray] | None = None,
) -> PeriodicRate:
    """Periodic solution of k l0 dy/dtheta = (A - y)[a4 A + (1 - a4) y] + E.

    Args:
        forcing: A(theta) = h'/U [1], period 2 pi, theta = k U t.
        a4: Share of the torque's slope that follows the wind.
        reduced_frequency: k l0 [1].
        lift: E(theta) [1]: mu2 w^2/(2 U^2) of the K94 rotors, or -U_s^2/U^2 of a rotor with
            bearing friction that never stops.

    Raises:
        ValueError: If no periodic solution with a positive rate is found (the rotor stops, or the
            gust is not smooth).
    """
    for size in _SIZES:
        theta = 2.0 * math.pi * np.arange(size) / size
        a = forcing(theta)
        e = np.zeros(size) if lift is None else lift(theta)
        rate, settled = _solve(a, e, a4, reduced_frequency)
        coefficients = np.fft.rfft(rate) / size
        tail = np.max(np.abs(coefficients[-size // 8 :]))
        if settled and tail < _TAIL * np.max(np.abs(coefficients)):
            return PeriodicRate(coefficients)
    raise ValueError("no smooth periodic response: the rotor stops or the gust has corners")


def _solve(
    a: FloatArray, e: FloatArray, a4: float, reduced_frequency: float
) -> tuple[FloatArray, bool]:
    """Newton's method from the linear response: the rate, and whether it settled."""
    size = a.size
    derivative = _differentiation_matrix(size)
    orders = np.arange(size // 2 + 1)
    linear = np.fft.rfft(a) / (1.0 + 1j * orders * reduced_frequency)
    y = np.fft.irfft(linear, size)
    for _ in range(60):
        slope = a4 * a + (1.0 - a4) * y
        residual = reduced_frequency * (derivative @ y) - (a - y) * slope - e
        jacobian = reduced_frequency * derivative + np.diag(slope - (1.0 - a4) * (a - y))
        change = np.linalg.solve(jacobian, residual)
        # A step that would turn the rotor backwards leaves the model's range: shorten it.
        shortest = np.min(np.where(change > 0.0, 0.9 * np.abs(y) / np.maximum(change, 1e-300), 1.0))
        y = y - min(1.0, float(shortest)) * change
        if np.max(np.abs(change)) < 1e-11 * max(1.0, float(np.max(np.abs(y)))):
            return y, True
        if np.min(y) < _STOPPED:
            return y, False
    return y, False


def _differentiation_matrix(size: int) -> FloatArray:
    """Fourier differentiation on an odd number of equispaced points of [0, 2 pi)."""
    index = np.arange(size)
    difference = index[:, None] - index[None, :]
    sign = np.where(difference % 2 == 0, 1.0, -1.0)
    with np.errstate(divide="ignore"):
        matrix = 0.5 * sign / np.sin(math.pi * difference / size)
    np.fill_diagonal(matrix, 0.0)
    return np.asarray(matrix, dtype=np.float64)
