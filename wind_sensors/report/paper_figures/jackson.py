"""Figures of Jackson's undated report (c. 1980), where a formula gives the curve."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from wind_sensors.instruments import friction_propeller, propeller_turbulence
from wind_sensors.report.paper_figures.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PRINTED,
    legend,
    single,
)

FIGURE_1_STALL_SPEED = 0.2
"""U_s [m/s] of Fig. 1."""
FIGURE_4_STALL_SPEED = 0.15
"""U_s [m/s] of Fig. 4."""


def steady_axial(figure: Figure) -> None:
    """Fig. 1: U P omega against U^2 is a line of slope one that meets zero at U_s^2."""
    axes = single(figure, r"$U^2$ [m$^2$ s$^{-2}$]", r"$UP\omega$ [m$^2$ s$^{-2}$]")
    speed = np.linspace(0.0, 1.0, 400)
    reading = speed * friction_propeller.steady_axial(speed, FIGURE_1_STALL_SPEED)
    axes.plot(speed**2, reading, color=BLUE, label=r"(6) corrected, $U_s=0.2$ m/s")
    axes.plot(speed**2, speed**2, color=GREY, linewidth=0.8, label="without friction")
    axes.plot(
        speed**2, speed**2 + FIGURE_1_STALL_SPEED**2, **PRINTED, label="(6) with the printed sign"
    )
    axes.annotate(
        r"$U_s^2$", (FIGURE_1_STALL_SPEED**2, 0.0), xytext=(0.1, 0.03), color=BLUE,
        arrowprops={"arrowstyle": "->", "color": BLUE},
    )
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(-0.02, 1.05)
    legend(axes, "upper left")


def torque_slope(figure: Figure) -> None:
    """Fig. 2: g(theta)/g(0) and what it means for the axial response length."""
    axes = single(figure, r"$\theta$ [deg]", r"$g(\theta)/g(0)$")
    degrees = np.linspace(0.0, 90.0, 721)
    theta = np.radians(degrees)
    g = friction_propeller.torque_slope_ratio(theta)
    axes.plot(degrees, g, color=BLUE, label=r"$\sqrt{\cos(0.98\theta)}$ (Jackson)")
    hicks = np.sqrt(np.maximum(np.cos(theta), 0.0))
    axes.plot(degrees, hicks, color=GREEN, linestyle="--", label=r"$\sqrt{\cos\theta}$ (Hicks)")
    axes.plot(
        degrees,
        np.cos(theta) / g,
        color=ORANGE,
        linestyle=":",
        label=r"axial response length, $g(0)\cos\theta/g(\theta)$",
    )
    at_plane = float(friction_propeller.torque_slope_ratio(0.5 * math.pi))
    axes.annotate(
        f"{at_plane:.3f} at 90 deg, not the 0.05 of (9b)", (90.0, at_plane), xytext=(38.0, 0.1),
        color=GREY, fontsize=9, arrowprops={"arrowstyle": "->", "color": GREY},
    )
    axes.set_xlim(0.0, 90.0)
    axes.set_ylim(0.0, 1.05)
    legend(axes, "lower left")


def transverse_length(figure: Figure) -> None:
    """Fig. 3: effective response length near 90 degrees against the turbulence's intensity."""
    axes = single(figure, r"$I_w=\sigma_w/\bar U$", r"$L_e/L$")
    intensity = np.linspace(0.005, 0.4, 400)
    axes.plot(
        intensity,
        propeller_turbulence.effective_length_ratio(intensity, 0.05, 1.5),
        color=BLUE,
        label=r"(9b): $L/L_e=0.05+1.5\,I_w$",
    )
    axes.plot(intensity, 0.05 + 1.5 * intensity, **PRINTED, label=r"the same printed as $L_e/L$")
    # Fichtl and Kumar's constant is not in the report; theirs is drawn through the fit at 0.1.
    factor = float(propeller_turbulence.effective_length_ratio(0.1, 0.05, 1.5)) / float(
        propeller_turbulence.fichtl_kumar_length_ratio(0.1, 1.0)
    )
    axes.plot(
        intensity,
        propeller_turbulence.fichtl_kumar_length_ratio(intensity, factor),
        color=GREEN,
        linestyle="--",
        label=r"Fichtl and Kumar, $\propto I_w^{-2/3}$, set equal at 0.1",
    )
    axes.set_xlim(0.0, 0.4)
    axes.set_ylim(0.0, 20.0)
    legend(axes, "upper right")


def distorted_sinusoid(figure: Figure) -> None:
    """Fig. 4: an axial propeller in U = 10 + 8 sin(2 pi t/T), wavelength 16 L."""
    axes = single(figure, r"$2\pi t/T$ [rad]", r"$(P\omega-\bar U)/\Delta u$")
    phase = np.linspace(0.0, 2.0 * math.pi, 500)
    frequency, stall = 2.0 * math.pi / 16.0, FIGURE_4_STALL_SPEED / 10.0
    axes.plot(phase, np.sin(phase), color=GREY, linewidth=0.9, label="wind")
    linear = propeller_turbulence.sinusoidal_gain(frequency, stall)
    axes.plot(
        phase, np.imag(linear * np.exp(1j * phase)), color=GREEN, linestyle="--",
        label=r"linear, time constant $L/\bar U$",
    )
    for amplitude, color in ((0.2, ORANGE), (0.8, BLUE)):
        rate = propeller_turbulence.sinusoidal_rate(amplitude, frequency, stall)
        axes.plot(
            phase,
            (rate.at(phase) - 1.0) / amplitude,
            color=color,
            label=rf"$\Delta u/\bar U={amplitude}$, mean {rate.mean:.3f} $\bar U$",
        )
    axes.set_xlim(0.0, 2.0 * math.pi)
    axes.set_xticks(np.arange(5) * 0.5 * math.pi, ["0", "π/2", "π", "3π/2", "2π"])
    legend(axes, "upper right")
