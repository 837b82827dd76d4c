"""Figures of Kristensen (1994)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from scipy import signal

from wind_sensors.instruments import cup, cup_vane, vane, vane_variance
from wind_sensors.report.paper_figures.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PRINTED,
    label,
    legend,
    single,
)
from wind_sensors.turbulence import surface_layer

_RUN_PER_RADIAN = 0.2
"""Of K94's cup [m/rad]."""


def first_order_step(figure: Figure) -> None:
    """Fig. 2: response of a cup anemometer to a step of the wind."""
    axes = single(figure, r"$t/\tau_0$", r"$[s(t)-s(0)]/[s(\infty)-s(0)]$")
    time = np.linspace(0.0, 5.0, 300)
    axes.plot(time, cup.step_response(time), color=BLUE)
    reached = float(cup.step_response(1.0))
    axes.plot([0.0, 1.0, 1.0], [reached, reached, 0.0], color=GREY, linestyle=":")
    axes.annotate(f"{reached:.3f}", (0.05, reached + 0.02), color=GREY, fontsize=9)
    axes.set_xlim(0.0, 5.0)
    axes.set_ylim(0.0, 1.05)


def damped_step(figure: Figure) -> None:
    """Fig. 5: response of vanes of different damping to a sudden turn of the wind."""
    axes = single(figure, r"$\omega_0 t$", r"$\phi(t)/\alpha$")
    time = np.linspace(0.0, 12.0, 600)
    zeta_0 = vane_variance.damping_without_loss()
    styles = (
        (0.15, GREY, r"$\zeta=0.15$ (M66's bivane)"),
        (zeta_0, ORANGE, rf"$\zeta_0={zeta_0:.4f}$, no loss of variance"),
        (math.sqrt(0.5), BLUE, r"$\zeta=1/\sqrt{2}$"),
        (1.0, GREEN, r"$\zeta=1$"),
        (2.0, "black", r"$\zeta=2$"),
    )
    for zeta, color, name in styles:
        axes.plot(time, vane.step_response(time, zeta), color=color, label=name)
    axes.axhline(1.0, color=GREY, linewidth=0.7)
    axes.set_xlim(0.0, 12.0)
    legend(axes, "lower right")


def strong_damping(figure: Figure) -> None:
    """Fig. 6: a vane with zeta = 2 against its first-order approximation (46)."""
    axes = single(figure, r"$\omega_0 t$", r"$\phi(t)/\alpha$")
    time = np.linspace(0.0, 20.0, 500)
    exact = vane.step_response(time, 2.0)
    axes.plot(time, exact, color=BLUE, label="exact, (45)")
    approximate = vane.first_order_step_response(time, 2.0)
    axes.plot(
        time,
        approximate,
        color=ORANGE,
        linestyle=":",
        label=r"first order, (46), $\ell=2\zeta\ell_v$",
    )
    slow = 1.0 - np.exp(-time / vane.slow_pole_length_ratio(2.0))
    axes.plot(time, slow, color=GREEN, linestyle="--", label="first order, exact slow pole")
    axes.set_xlim(0.0, 20.0)
    axes.set_ylim(0.0, 1.05)
    legend(axes, "lower right")


def resonance_integrals(figure: Figure) -> None:
    """Fig. 7: g and h of the inertial subrange."""
    axes = single(figure, r"$\zeta$", r"$g(\zeta),\ h(\zeta)$")
    zeta = np.linspace(0.1, 2.0, 400)
    g = [vane_variance.g_integral(z) for z in zeta.tolist()]
    h = [vane_variance.h_integral(z) for z in zeta.tolist()]
    axes.plot(zeta, g, color=BLUE, label=r"$g(\zeta)$")
    axes.plot(zeta, h, color=ORANGE, label=r"$h(\zeta)$")
    axes.set_xlim(0.0, 2.0)
    axes.set_ylim(0.0, 8.0)
    legend(axes)


def loss_function(figure: Figure) -> None:
    """Fig. 8: Delta, the loss of variance in the inertial subrange, and its zero."""
    axes = single(figure, r"$\zeta$", r"$\Delta(\zeta)$")
    zeta = np.linspace(0.1, 2.0, 400)
    axes.plot(zeta, [vane_variance.loss_integral(z) for z in zeta.tolist()], color=BLUE)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    zeta_0 = vane_variance.damping_without_loss()
    axes.plot([zeta_0], [0.0], "o", color=ORANGE)
    axes.annotate(
        rf"$\zeta_0=\cos(3\pi/8)={zeta_0:.4f}$",
        (zeta_0, 0.0),
        xytext=(zeta_0 + 0.12, -1.2),
        color=ORANGE,
    )
    axes.set_xlim(0.0, 2.0)


def _filtered_spectrum(figure: Figure, slope: float, name: str) -> None:
    axes = single(figure, r"$s=k\ell_v$", r"$kF_v(k)$ (arbitrary unit)")
    zeta = vane_variance.damping_without_loss(slope)
    edge = vane_variance.crossing(slope)
    s = np.geomspace(0.1, 10.0, 900)
    true = s ** (1.0 - slope)
    seen = true / vane.inverse_gain_squared(s, zeta)
    axes.fill_between(s, true, seen, where=s <= edge, color=ORANGE, alpha=0.25, linewidth=0.0)
    axes.fill_between(s, true, seen, where=s >= edge, color=BLUE, alpha=0.18, linewidth=0.0)
    axes.plot(s, true, color=BLUE, label=rf"wind, $F_v\propto k^{{-{name}}}$")
    axes.plot(s, seen, color=ORANGE, label=rf"vane, $\zeta_0={zeta:.4f}$")
    axes.axvline(edge, color=GREY, linewidth=0.8)
    axes.annotate(rf"$s_c={edge:.4f}$", (edge * 1.05, true[0] * 0.55), color=GREY, fontsize=9)
    printed = vane_variance.crossing_as_printed(slope)
    if abs(printed - edge) > 1e-9:
        axes.axvline(printed, **PRINTED, label=f"limit printed in (81): {printed:.4f}")
    axes.set_xscale("log")
    axes.set_xlim(0.1, 10.0)
    axes.set_ylim(0.0, None)
    legend(axes, "upper right")


def inertial_spectrum(figure: Figure) -> None:
    """Fig. 9: wind and vane in the inertial subrange; the shaded areas are equal."""
    _filtered_spectrum(figure, 5.0 / 3.0, "5/3")


def spectrum_three_halves(figure: Figure) -> None:
    """Fig. 10: the same for a slope of 3/2."""
    _filtered_spectrum(figure, 1.5, "3/2")


def spectrum_five_thirds(figure: Figure) -> None:
    """Fig. 11: the same for a slope of 5/3."""
    _filtered_spectrum(figure, 5.0 / 3.0, "5/3")


def spectrum_two(figure: Figure) -> None:
    """Fig. 12: the same for a slope of 2, where the printed limit is right."""
    _filtered_spectrum(figure, 2.0, "2")


def recovered_fraction(figure: Figure) -> None:
    """Fig. 13: share of the lost variance that resonance regains, and the misprinted limit."""
    axes = single(figure, r"$\beta$", r"$D(\beta)$")
    slope = np.linspace(1.01, 2.985, 160).tolist()
    axes.plot(
        slope,
        [vane_variance.recovered_fraction(b) for b in slope],
        color=BLUE,
        label=r"limit $\sqrt{-2\cos[2\pi/(\beta+1)]}$",
    )
    axes.plot(
        slope,
        [vane_variance.recovered_fraction_as_printed(b) for b in slope],
        **PRINTED,
        label=r"as printed, limit $2\sin[\pi/2(\beta+1)]$",
    )
    for beta, name in ((1.5, "3/2"), (5.0 / 3.0, "5/3"), (2.0, "2")):
        value = vane_variance.recovered_fraction(beta)
        axes.plot([beta], [value], "o", color=BLUE, markersize=4)
        axes.annotate(
            rf"$\beta={name}$: {value:.3f}", (beta, value), xytext=(5, 4),
            textcoords="offset points", fontsize=9, color=BLUE,
        )
    axes.set_xlim(1.0, 3.0)
    axes.set_ylim(0.0, 1.05)
    legend(axes, "lower left")


def vector_run(figure: Figure) -> None:
    """Fig. 14: the vane's heading at every turn of the cup, summed up to the vector wind run."""
    axes = single(figure, "towards east [m]", "towards north [m]")
    generator = np.random.Generator(np.random.PCG64(14))
    steps = generator.normal(0.0, math.radians(12.0), 30)
    headings = math.radians(40.0) + signal.lfilter([1.0], [1.0, -0.8], steps)
    per_turn = 2.0 * math.pi * _RUN_PER_RADIAN
    path = np.cumsum(per_turn * np.stack([np.cos(headings), np.sin(headings)]), axis=1)
    path = np.concatenate([np.zeros((2, 1)), path], axis=1)
    run = cup_vane.vector_wind_run(headings, 1.0, _RUN_PER_RADIAN)
    axes.plot(path[0], path[1], "o-", color=BLUE, markersize=3, label="one step a turn of the cup")
    axes.plot(
        [0.0, run.east], [0.0, run.north], color=ORANGE,
        label=f"vector run {run.speed:.1f} m of {run.scalar_speed:.1f} m",
    )
    axes.set_aspect("equal")
    legend(axes, "upper left")


def surface_layer_function(figure: Figure) -> None:
    """Fig. 16: chi_pv in the stratified surface layer; K94 does not say which z/z0 it shows."""
    axes = single(figure, r"$z/L$", r"$\chi_{pv}(z/z_0,\,z/L)$")
    stability = np.linspace(-2.0, 1.0, 601)
    for ratio, color in ((100.0, BLUE), (1000.0, ORANGE)):
        for exponent, style, name in (
            (surface_layer.THIRD, "-", "(123), (124), exponent $-1/3$"),
            (surface_layer.QUARTER, ":", "usual exponent $-1/4$"),
        ):
            chi = surface_layer.surface_layer_bias_function(ratio, stability, exponent=exponent)
            axes.plot(
                stability,
                chi,
                color=color,
                linestyle=style,
                label=rf"$z/z_0={ratio:.0f}$, {name}",
            )
    label(axes, r"$z/L$", r"$\chi_{pv}(z/z_0,\,z/L)$")
    axes.set_yscale("log")
    axes.set_xlim(-2.0, 1.0)
    legend(axes, "upper right")
