"""Figures of Kristensen, Hansen & Hansen (2014)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wind_sensors.instruments import filtered_turbulence
from wind_sensors.report.paper_figures.style import BLUE, GREY, ORANGE, PRINTED, legend, single
from wind_sensors.turbulence import von_karman


def longitudinal_spectrum(figure: Figure) -> None:
    """Fig. 2: the von Karman spectrum in the area-conserving form."""
    axes = single(figure, r"$k/q$", r"$kF_L(k)/\sigma^2$")
    x = np.geomspace(1e-2, 1e3, 500)
    axes.plot(x, x * von_karman.longitudinal_spectrum(x, 1.0, 1.0), color=BLUE)
    peak = von_karman.PEAK_WAVENUMBER_RATIO
    height = peak * float(von_karman.longitudinal_spectrum(peak, 1.0, 1.0))
    axes.plot([peak], [height], "o", color=ORANGE)
    axes.annotate(
        r"peak at $k=q\sqrt{3/2}$", (peak, height), xytext=(-8, 3),
        textcoords="offset points", color=ORANGE, fontsize=9, ha="right",
    )
    right = von_karman.INTEGRAL_LENGTH_TIMES_WAVENUMBER
    axes.axvline(1.0 / right, color=GREY, linewidth=0.8)
    axes.annotate(
        rf"$1/L_u$, $L_uq={right:.4f}$", (0.9 / right, 0.008), color=GREY, fontsize=9, ha="right"
    )
    printed = 1.0 / von_karman.BETA_HALF_THIRD
    axes.axvline(1.0 / printed, **PRINTED, label=rf"$1/L_u$ with (52) as printed, {printed:.3f}")
    axes.set_xscale("log")
    axes.set_xlim(1e-2, 1e3)
    axes.set_ylim(0.0, 0.165)
    legend(axes, "upper right")


def structure_functions(figure: Figure) -> None:
    """Fig. 3: longitudinal (lower) and transverse (upper) structure functions."""
    axes = single(figure, r"$qr$", r"$D(r)/\sigma^2$")
    x = np.linspace(0.0, 8.0, 500)
    axes.plot(
        x,
        von_karman.transverse_structure_function(x, 1.0, 1.0),
        color=ORANGE,
        label=r"$D_T$, (54): exceeds $2\sigma^2$ a little",
    )
    axes.plot(
        x, von_karman.longitudinal_structure_function(x, 1.0, 1.0), color=BLUE, label=r"$D_L$, (53)"
    )
    axes.axhline(2.0, color=GREY, linewidth=0.8)
    axes.set_xlim(0.0, 8.0)
    axes.set_ylim(0.0, 2.2)
    legend(axes, "lower right")


def filtered_fractions(figure: Figure) -> None:
    """Fig. 5: shares of variance that a first-order instrument loses, and misprint of (106)."""
    axes = single(figure, r"$q\ell_0$", r"$\varphi_L,\ \varphi_T$")
    y = np.geomspace(1e-3, 1e2, 500)
    axes.plot(
        y,
        filtered_turbulence.transverse_loss(y),
        color=ORANGE,
        label=r"$\varphi_T$, (106) corrected",
    )
    axes.plot(y, filtered_turbulence.longitudinal_loss(y), color=BLUE, label=r"$\varphi_L$, (105)")
    printed = filtered_turbulence.transverse_loss_as_printed(y)
    axes.plot(
        y,
        np.where(printed > 1e-3, printed, np.nan),
        **PRINTED,
        label=r"$\varphi_T$ with the printed denominator",
    )
    law = filtered_turbulence.longitudinal_loss_small(y)
    for factor, color in ((1.0, BLUE), (4.0 / 3.0, ORANGE)):
        values = factor * law
        axes.plot(
            y, np.where(values < 1.5, values, np.nan), color=color, linestyle=":", linewidth=1.0
        )
    axes.annotate(r"$\propto(q\ell_0)^{2/3}$", (3e-2, 0.045), color=GREY, fontsize=9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(1e-3, 1e2)
    axes.set_ylim(5e-3, 2.0)
    legend(axes, "upper left")
