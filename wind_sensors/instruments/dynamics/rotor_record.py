"""The rotor equation over a whole record of wind."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from wind_sensors.compiled import compiled, inlined
from wind_sensors.instruments.dynamics.rotor import (
    PROPELLER_JACKSON,
    Forced,
    RotorParameters,
    advance_forced,
    forced_by,
)

FloatArray = npt.NDArray[np.float64]


@inlined
def _between(now: Forced, then: Forced, share: float) -> Forced:
    """What drives a rotor after a share of the time from one instant to another."""
    return (
        now[0] + share * (then[0] - now[0]),
        now[1] + share * (then[1] - now[1]),
        now[2] + share * (then[2] - now[2]),
        now[3] + share * (then[3] - now[3]),
        now[4] + share * (then[4] - now[4]),
    )


@compiled
def integrate_rotor(
    p: RotorParameters,
    axial: FloatArray,
    transverse: FloatArray,
    lateral: FloatArray,
    density_ratio: FloatArray,
    temperature: FloatArray,
    dt: float,
    nodes: int,
    y_start: float,
    psi_start: float,
) -> tuple[FloatArray, FloatArray]:
    """Rate and angle of any rotor in a sampled wind given in its own axes.

    Args:
        p: Constants of the rotor.
        axial, transverse: Wind in rotor axes (see `rotor_forcing`), shape (n,) each; the forcing
            they make is linear between the samples.
        lateral: Direction of the transverse wind in the plane of rotation [rad], shape (n,).
        density_ratio: Air density relative to the calibration's, shape (n,).
        temperature: Air temperature [deg C], shape (n,).
        dt: Sampling interval [s].
        nodes: Results per sampling interval, 1 or more.
        y_start: l s at the first sample [m/s]; NaN means "in equilibrium with the wind".
        psi_start: Rotor angle at the first sample [rad].

    Returns:
        y = l s [m/s] and psi [rad] every dt / nodes, shape ((n - 1) nodes + 1,) each.
    """
    n = axial.shape[0]
    y_out = np.empty((n - 1) * nodes + 1)
    psi_out = np.empty((n - 1) * nodes + 1)
    now = forced_by(p, axial[0], transverse[0], lateral[0])
    y = y_start
    if math.isnan(y):
        y = now[0] if p.form == PROPELLER_JACKSON else max(now[0], 0.0)
    psi = psi_start
    y_out[0] = y
    psi_out[0] = psi
    position = 0
    for i in range(1, n):
        then = forced_by(p, axial[i], transverse[i], lateral[i])
        for k in range(nodes):
            y, psi = advance_forced(
                p, y, psi, _between(now, then, k / nodes), _between(now, then, (k + 1.0) / nodes),
                density_ratio[i], temperature[i], dt / nodes,
            )
            position += 1
            y_out[position] = y
            psi_out[position] = psi
        now = then
    return y_out, psi_out


@compiled
def cup_axes(wind: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Axial and transverse wind of a cup [m/s] and the transverse wind's direction [rad].

    Args:
        wind: In instrument axes, z along the rotor's axis [m/s], shape (n, 3).

    Returns:
        Shape (n,) each, for `integrate_rotor`.
    """
    n = wind.shape[0]
    axial = np.empty(n)
    transverse = np.empty(n)
    lateral = np.empty(n)
    for i in range(n):
        axial[i] = wind[i, 2]
        transverse[i] = math.hypot(wind[i, 0], wind[i, 1])
        lateral[i] = math.atan2(wind[i, 1], wind[i, 0])
    return axial, transverse, lateral


@compiled
def integrate_cup(
    p: RotorParameters,
    wind: FloatArray,
    density_ratio: FloatArray,
    temperature: FloatArray,
    dt: float,
    y_start: float,
    psi_start: float,
) -> tuple[FloatArray, FloatArray]:
    """Rotor rate and angle of a cup in a sampled wind.

    Args:
        p: Constants of the rotor.
        wind: Wind in instrument axes (x, y in the plane of rotation, z along the axis) [m/s],
            shape (n, 3).
        density_ratio, temperature, dt, psi_start: As in `integrate_rotor`.
        y_start: l s at the first sample [m/s]; negative means "in equilibrium with the wind".

    Returns:
        y = l s [m/s] and psi [rad] at the samples, shape (n,) each.
    """
    axial, transverse, lateral = cup_axes(wind)
    y = y_start if y_start >= 0.0 else math.nan
    return integrate_rotor(
        p, axial, transverse, lateral, density_ratio, temperature, dt, 1, y, psi_start
    )
