"""Changes from bin to bin of any series: limits, play and catches."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

CHANGES = 1
"""Number of statistics of the largest changes of a series."""

FEWEST_CHANGES = 500
"""Two per cent of fewer tell of single events."""

LEAST_USUAL = 0.2
"""Usual changes are no less than this share of the largest: what mostly stands tells its stillness,
and would drown all else here."""


def windy_changes(
    speed: FloatArray, mask: FloatArray | None = None
) -> npt.NDArray[np.bool_]:
    """Which changes from bin to bin count, shape (n - 1,).

    Args:
        speed: Slow wind speed at the bins [m/s], shape (n,); its slowest third does not count.
        mask: Weight of the bins; those below a half do not count.
    """
    counted = speed[1:] >= np.quantile(speed, 1.0 / 3.0)
    if mask is not None:
        counted &= (mask[1:] > 0.5) & (mask[:-1] > 0.5)
    return np.asarray(counted)


def change_statistics(series: FloatArray, counted: npt.NDArray[np.bool_]) -> FloatArray:
    """How large the largest changes from bin to bin are against the usual ones.

    Damping and inertia make all changes smaller, in proportion. A limit, a play or a catch does
    not.

    Args:
        series: Value in each bin, shape (n,).
        counted: Which changes count, see `windy_changes`, shape (n - 1,).

    Returns:
        Logarithm of the 98 % quantile over the 75 % one; 0 where too little changes.
    """
    changes = np.abs(np.diff(series))[counted]
    if changes.size < FEWEST_CHANGES:
        return np.zeros(CHANGES)
    usual, large = np.quantile(changes, (0.75, 0.98))
    if large <= 0.0:
        return np.zeros(CHANGES)
    return np.array([np.log(large / max(usual, LEAST_USUAL * large))])
