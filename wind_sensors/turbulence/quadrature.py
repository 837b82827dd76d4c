"""Integrals over all wavenumbers, exact to rounding for the spectra and filters of this package."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def integrate_over_wavenumbers(
    integrand: Callable[[FloatArray], FloatArray],
    slowest: float,
    fastest: float,
    resonance_width: float = 1.0,
    decades_below: float = 20.0,
    decades_above: float = 26.0,
) -> float:
    """Integral of f(k) over 0 < k < infinity by the trapezoidal rule in ln k.

    The rule converges exponentially for functions analytic in ln k. Its step follows the width of
    the narrowest resonance, because a pole at distance w from the real ln k axis leaves an error
    of exp(-2 pi w / step).

    Args:
        integrand: f(k) for an array of k.
        slowest: Smallest wavenumber at which f changes its power law.
        fastest: Largest such wavenumber, same units.
        resonance_width: Distance of the nearest pole of f from the real ln k axis; pi/2 for a
            first-order filter, arcsin(zeta) for a vane.
        decades_below: Where to begin, in decades below `slowest`.
        decades_above: Where to end, in decades above `fastest`.

    Returns:
        The integral, in the units of f times those of k.
    """
    step = 2.0 * math.pi * min(resonance_width, math.pi / 2.0) / 40.0
    low = math.log(slowest) - decades_below * math.log(10.0)
    high = math.log(fastest) + decades_above * math.log(10.0)
    count = math.ceil((high - low) / step) + 1
    wavenumber = np.exp(np.linspace(low, high, count))
    return float(np.sum(integrand(wavenumber) * wavenumber)) * (high - low) / (count - 1)
