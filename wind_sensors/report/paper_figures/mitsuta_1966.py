"""Figures of Mitsuta (1966), from a simulated bivane and sonic anemometer."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from wind_sensors.instruments import bivane, vane
from wind_sensors.report.bivane_reduction import (
    MITSUTA_DAMPING,
    MITSUTA_INTERVAL,
    MITSUTA_SPEED,
    MITSUTA_WIND_RUN,
    compare_reductions,
)
from wind_sensors.report.paper_figures.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PRINTED,
    label,
    legend,
)


def frequency_response(figure: Figure) -> None:
    """Fig. 1: gain and phase of the bivane, and of the bivane with its reduction."""
    gain_axes, phase_axes = figure.subplots(
        2, 1, sharex=True, gridspec_kw={"height_ratios": (2, 1)}
    )
    s = np.geomspace(0.1, 10.0, 500)
    sampling = bivane.reduced_sampling(MITSUTA_WIND_RUN, MITSUTA_SPEED, MITSUTA_INTERVAL)
    nyquist = math.pi / sampling
    below = s[s <= nyquist]
    gain_axes.plot(s, vane.gain(s, MITSUTA_DAMPING), color=BLUE, label=r"bivane, $\zeta=0.15$")
    for half_width, color, name in (
        (1, ORANGE, "reduced by (6), 0.5 s"),
        (12, GREEN, "reduced with 25-point differences, 0.5 s"),
    ):
        gain = bivane.overall_gain(below, sampling, MITSUTA_DAMPING, half_width)
        gain_axes.plot(below, gain, color=color, label=name)
    gain_axes.axvline(nyquist, color=GREY, linewidth=0.8, linestyle=":")
    gain_axes.set_xscale("log")
    gain_axes.set_yscale("log")
    gain_axes.set_ylim(0.01, 5.0)
    label(gain_axes, "", r"gain $|H|$")
    legend(gain_axes, "lower left")
    phase_axes.plot(s, np.degrees(vane.phase(s, MITSUTA_DAMPING)), color=BLUE)
    phase_axes.set_yticks([0, -90, -180])
    phase_axes.set_xlim(0.1, 10.0)
    label(phase_axes, r"$\omega/\omega_0$ (dotted: Nyquist frequency)", "phase [deg]")


def spectra(figure: Figure) -> None:
    """Fig. 3: vertical wind by sonic, by the plain reading and by the reductions."""
    axes = figure.add_subplot()
    label(axes, "frequency [Hz]", r"power spectral density of $w$ [m$^2$ s$^{-2}$ Hz$^{-1}$]")
    result = compare_reductions()
    nyquist = 0.5 / MITSUTA_INTERVAL
    shown = (result.frequency > 0.0) & (result.frequency <= 0.88 * nyquist)
    f = result.frequency[shown]
    axes.plot(f, result.printed[shown], **PRINTED, label="(6) as printed, $L$ for $L^2$")
    axes.plot(f, result.plain[shown], color=GREY, label=r"plain reading $V\beta$")
    axes.plot(f, result.true[shown], color="black", linewidth=2.2, label="wind (sonic)")
    axes.plot(f, result.reduced[shown], color=ORANGE, label="(6) corrected, three points, 0.5 s")
    axes.plot(
        f, result.wide[shown], color=GREEN, linestyle="--", label="25-point differences, 0.5 s"
    )
    free = 1.0 / bivane.free_period(MITSUTA_WIND_RUN, MITSUTA_SPEED)
    axes.axvline(free, color=GREY, linewidth=0.8, linestyle=":")
    axes.annotate("free period", (free * 0.96, 3e-3), color=GREY, fontsize=9, ha="right")
    axes.set_xscale("log")
    axes.set_yscale("log")
    legend(axes, "lower left")
