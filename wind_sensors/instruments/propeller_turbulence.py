"""Jackson's propeller in unsteady flow: turbulence, sinusoids, and flow across its axis.

Source: Jackson (undated report, c. 1980), sec. 3.4, (8), (9), signs and factors corrected; the
equation itself is in `friction_propeller`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.filtered_turbulence import longitudinal_loss
from wind_sensors.instruments.friction_propeller import FrictionPropeller
from wind_sensors.instruments.periodic import PeriodicRate, periodic_rate

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_SMALL_ANGLE = 1e-5
"""Step of the derivatives of f and g [rad]."""


def mean_excess_von_karman(reduced_length: npt.ArrayLike, stall_ratio: float) -> FloatArray:
    """(P <omega>/U - 1 + U_s^2/U^2)/(sigma^2/U^2) [1]; Jackson, sec. 3.4, U_s^2 restored.

    Args:
        reduced_length: q L [1].
        stall_ratio: U_s/U [1].
    """
    loss = longitudinal_loss(reduced_length)
    return 1.0 - (1.0 + stall_ratio**2) * (1.0 - loss)


def variance_von_karman(reduced_length: npt.ArrayLike, stall_ratio: float) -> FloatArray:
    """P^2 var(omega)/sigma^2 [1]; Jackson, sec. 3.4, spurious factor 1/2 removed."""
    return (1.0 + stall_ratio**2) ** 2 * (1.0 - longitudinal_loss(reduced_length))


def sinusoidal_gain(reduced_frequency: float, stall_ratio: float) -> complex:
    """Linear response P omega'/u' [1] to a small axial sinusoid; Jackson, sec. 3.4.

    Args:
        reduced_frequency: 2 pi L/wavelength [1].
        stall_ratio: U_s/U [1].
    """
    return (1.0 + stall_ratio**2) / (1.0 + 1j * reduced_frequency)


def transfer_function(
    reduced_wavenumber: npt.ArrayLike, speed: float, angle: float, propeller: FrictionPropeller
) -> ComplexArray:
    """P omega'/(u', v') [1] of a fixed propeller in a steady oblique wind (derived from (5)).

    A = U f and B = U g/g(0) vary with the gust; friction adds U_s^2/B^2 times the variation of B.

    Args:
        reduced_wavenumber: k L [1], shape (n,).
        speed: U [m/s].
        angle: theta [rad], outside the dead sector, below 90 degrees.
        propeller: Constants.

    Returns:
        Shape (n, 2): for gusts along the mean wind, and across it in the plane of wind and axis,
        positive where they turn the wind towards the axis.
    """
    near = np.array([angle - _SMALL_ANGLE, angle + _SMALL_ANGLE])
    f, g = float(propeller.f(angle)), float(propeller.g(angle))
    f_slope, g_slope = (
        float(np.diff(np.asarray(h(near)))[0]) / (2.0 * _SMALL_ANGLE)
        for h in (propeller.f, propeller.g)
    )
    friction = (propeller.stall_speed / (speed * g)) ** 2
    k = np.asarray(reduced_wavenumber, dtype=np.float64)
    slowness = 1.0 + 1j * k / g
    along = (f + friction * g) / slowness
    across = -(f_slope + friction * g_slope) / slowness
    return np.stack([along, across], axis=-1)


def sinusoidal_rate(
    relative_amplitude: float, reduced_frequency: float, stall_ratio: float
) -> PeriodicRate:
    """Exact P omega/U in the axial flow U [1 + A sin(theta)]; Jackson, Fig. 4.

    Args:
        relative_amplitude: A [1], below 1.
        reduced_frequency: 2 pi L/wavelength [1].
        stall_ratio: U_s/U [1].

    Raises:
        ValueError: If the rotor stops within the period.
    """
    return periodic_rate(
        lambda theta: 1.0 + relative_amplitude * np.sin(theta),
        1.0,
        reduced_frequency,
        lambda theta: np.full(theta.shape, -(stall_ratio**2)),
    )


def effective_length_ratio(intensity: npt.ArrayLike, base: float, slope: float) -> FloatArray:
    """L_e/L = 1/(b + c h I_w) [1] near 90 degrees; Jackson (9b) (the text prints L/L_e).

    Args:
        intensity: I_w = sigma_w/U [1].
        base: b = g(pi/2)/g(0); 0.05 in Jackson's tentative fit.
        slope: c h; 1.5 in the fit.
    """
    return 1.0 / (base + slope * np.asarray(intensity, dtype=np.float64))


def fichtl_kumar_length_ratio(intensity: npt.ArrayLike, factor: float) -> FloatArray:
    """L_e/L = factor I_w^(-2/3) [1]: b = 0 and h ~ I_w^(-1/3) in (9b); the factor is not given."""
    return factor * np.asarray(intensity, dtype=np.float64) ** (-2.0 / 3.0)


def transverse_acceleration(
    indicated: npt.ArrayLike,
    speed: npt.ArrayLike,
    axial: npt.ArrayLike,
    response_length: float,
    stall_speed: float,
    a: float,
    b: float,
    c: float,
) -> FloatArray:
    """P domega/dt [m/s^2] near 90 degrees; Jackson (8) with U_s^2, for a turning rotor.

    Args:
        indicated: P omega [m/s].
        speed: U [m/s].
        axial: U_A [m/s].
        response_length: L [m].
        stall_speed: U_s [m/s].
        a, b, c: f = a sin(phi), g/g(0) = b + c |sin(phi)|, phi = pi/2 - theta.
    """
    y = np.asarray(indicated, dtype=np.float64)
    u = np.asarray(speed, dtype=np.float64)
    u_a = np.asarray(axial, dtype=np.float64)
    drive = (b * u + c * np.abs(u_a)) * (a * u_a - y)
    return (drive - stall_speed**2 * np.sign(y)) / response_length


def transverse_spectral_ratio(
    reduced_frequency: npt.ArrayLike, response: float = 1.0
) -> FloatArray:
    """E_a/E = a^2/(1 + (s L_e/U)^2) [1] near 90 degrees; Jackson sets a = 1.

    Args:
        reduced_frequency: s L_e/U [1].
        response: a [1].
    """
    x = np.asarray(reduced_frequency, dtype=np.float64)
    return response**2 / (1.0 + x * x)
