"""Measured second-order coefficients of cups (Coppin; Wyngaard et al.) and their consistency.

Source: Kristensen (1994), table and (15) to (20); K14, sec. 4. The expansion is that of
`rotor_family.SecondOrderCoefficients`. A rotor with a linear calibration and a speed-independent
distance constant has a1 = 1, a3 = a4 - 1, a6 = 1 - 2 a4: one number instead of four.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True)
class PublishedCup:
    """One row of the published tables; coefficients are dimensionless.

    Relative uncertainty is 10 % for a1, a3, a4, a6 and 0.1 absolute for the rest.
    """

    name: str
    source: str
    a1: float
    a3: float
    a4: float
    a5: float
    a6: float
    a2: float | None = None
    a7: float | None = None
    a8: float | None = None


PUBLISHED_CUPS = (
    PublishedCup("Friedrichs", "Coppin", 1.27, 0.0, 1.10, 0.85, -1.17),
    PublishedCup("Siggelkow", "Coppin", 1.18, -0.05, 1.03, 0.90, -0.90),
    PublishedCup("Teledyne 3", "Coppin", 1.25, -0.19, 1.11, 0.82, -0.86),
    PublishedCup("Teledyne 6", "Coppin", 1.26, -0.20, 1.15, 0.47, -0.89),
    PublishedCup("Gill 3", "Coppin", 1.22, -0.20, 1.14, 0.0, -0.79),
    PublishedCup("Casella", "Coppin", 1.19, -0.29, 0.98, 0.0, -0.69),
    PublishedCup("Thies", "Coppin", 1.18, -0.11, 1.18, 0.95, -1.26),
    PublishedCup(
        "Wyngaard", "Wyngaard et al.", 1.03, -0.23, 0.96, 0.67, -0.73, a2=0.06, a7=0.04, a8=-0.12
    ),
)
"""As listed by K94."""

RELATIVE_UNCERTAINTY = 0.1
"""Of a1, a3, a4, a6."""
ABSOLUTE_UNCERTAINTY = 0.1
"""Of the other coefficients, and the least for any."""
_SMALLEST_UNCERTAINTY = 0.02


class Value(NamedTuple):
    """A number with its standard uncertainty."""

    value: float
    uncertainty: float


class ConstraintFit(NamedTuple):
    """Result of forcing a table row onto the one-parameter family.

    Attributes:
        a4: Fitted share of the torque's slope.
        mu2: 2 a5.
        sum_residual: a3 + a4 + a6, zero by K94 (18).
        slope_residual: 2 a3 + a6 + 1, zero by K94 (20).
        torque_residual: a4 - a3 - 1, zero for a linear calibration with constant l0.
        chi_square: Misfit of a3, a4, a6 (2 degrees of freedom).
    """

    a4: Value
    mu2: Value
    sum_residual: Value
    slope_residual: Value
    torque_residual: Value
    chi_square: float


def fit_constraints(cup: PublishedCup, normalise: bool = False) -> ConstraintFit:
    """Weighted least squares of a3 = a4 - 1, a4, a6 = 1 - 2 a4 for the one unknown a4.

    Args:
        cup: Row of the table.
        normalise: Divide the row by its a1 first, which must be one.
    """
    scale = cup.a1 if normalise else 1.0
    a3, a4, a5, a6 = cup.a3 / scale, cup.a4 / scale, cup.a5 / scale, cup.a6 / scale
    u3, u4, u6 = _uncertainty(a3), _uncertainty(a4), _uncertainty(a6)
    # Each row: measured = slope a4 + constant.
    rows = ((a3 + 1.0, 1.0, u3), (a4, 1.0, u4), (a6 - 1.0, -2.0, u6))
    weight = math.fsum(slope**2 / u**2 for _, slope, u in rows)
    best = math.fsum(slope * measured / u**2 for measured, slope, u in rows) / weight
    chi_square = math.fsum(((measured - slope * best) / u) ** 2 for measured, slope, u in rows)
    return ConstraintFit(
        a4=Value(best, 1.0 / math.sqrt(weight)),
        mu2=Value(2.0 * a5, 2.0 * ABSOLUTE_UNCERTAINTY),
        sum_residual=Value(a3 + a4 + a6, math.sqrt(u3**2 + u4**2 + u6**2)),
        slope_residual=Value(2.0 * a3 + a6 + 1.0, math.sqrt(4.0 * u3**2 + u6**2)),
        torque_residual=Value(a4 - a3 - 1.0, math.sqrt(u4**2 + u3**2)),
        chi_square=chi_square,
    )


def _uncertainty(coefficient: float) -> float:
    return max(RELATIVE_UNCERTAINTY * abs(coefficient), _SMALLEST_UNCERTAINTY)
