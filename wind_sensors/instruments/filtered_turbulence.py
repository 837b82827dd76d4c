"""First-order instruments in von Karman turbulence: the fractions phi_L and phi_T lost to inertia.

phi_L(y) = 1/(2 sigma^2) int D_L exp(-r/l0) dr/l0 with y = q l0, K14 (105), and phi_T likewise,
K14 (106) with its misprints corrected. Closed forms in Gauss's hypergeometric function, real for
all y > 0: phi_L = 1 - (2/5) 2F1(1/2, 1; 11/6; 1 - y^2) and phi_T = phi_L + (y/2) phi_L'.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import special

FloatArray = npt.NDArray[np.float64]

_SERIES_LIMIT = 0.6
_SERIES_TERMS = 80
_FAR_LIMIT = 3.0

SMALL_ARGUMENT_COEFFICIENT = (
    0.4 * math.gamma(11.0 / 6.0) * 3.0 * math.gamma(2.0 / 3.0) / math.sqrt(math.pi)
)
"""phi_L -> 0.86237 y^(2/3) as y -> 0."""


def longitudinal_loss(reduced_length: npt.ArrayLike) -> FloatArray:
    """phi_L(q l0) [1]: share of the longitudinal variance an instrument of length l0 loses.

    Args:
        reduced_length: y = q l0 [1], not negative.
    """
    return _loss(reduced_length, transverse=False)


def transverse_loss(reduced_length: npt.ArrayLike) -> FloatArray:
    """phi_T(q l0) [1]: the same for a transverse component."""
    return _loss(reduced_length, transverse=True)


def longitudinal_loss_small(reduced_length: npt.ArrayLike) -> FloatArray:
    """Inertial-range limit of phi_L, 0.86237 y^(2/3) [1]; 3.3 % too high at y = 0.1."""
    y = np.asarray(reduced_length, dtype=np.float64)
    return SMALL_ARGUMENT_COEFFICIENT * y ** (2.0 / 3.0)


def transverse_loss_as_printed(reduced_length: npt.ArrayLike) -> FloatArray:
    """phi_T [1] with the denominator printed in K14 (106), 18 (1 - y^2) instead of its square.

    To show what the misprint does: .528 for .555 at y = 0.5, and negative beyond y = 4.
    """
    y = np.asarray(reduced_length, dtype=np.float64)
    longitudinal = longitudinal_loss(y)
    return longitudinal + (transverse_loss(y) - longitudinal) * (1.0 - y * y)


def exponential_loss(length_ratio: npt.ArrayLike) -> FloatArray:
    """Loss for the correlation exp(-r/L): l0/(l0 + L) [1] (Busch and Kristensen's form).

    Args:
        length_ratio: l0/L [1].
    """
    ratio = np.asarray(length_ratio, dtype=np.float64)
    return ratio / (1.0 + ratio)


def _loss(reduced_length: npt.ArrayLike, transverse: bool) -> FloatArray:
    y = np.asarray(reduced_length, dtype=np.float64)
    near = np.clip(y, 0.0, _SERIES_LIMIT)
    middle = np.clip(y, _SERIES_LIMIT, _FAR_LIMIT)
    far = np.maximum(y, _FAR_LIMIT)
    return np.where(
        y < _SERIES_LIMIT,
        _loss_near(near, transverse),
        np.where(y < _FAR_LIMIT, _loss_middle(middle, transverse), _loss_far(far, transverse)),
    )


def _loss_near(y: FloatArray, transverse: bool) -> FloatArray:
    """Connection formula in y^2: free of the cancellation of the form in 1 - y^2."""
    y2 = y * y
    bracket = 1.0 - y2
    front = SMALL_ARGUMENT_COEFFICIENT * y ** (2.0 / 3.0) * bracket ** (-5.0 / 6.0)
    if transverse:
        front = front * (4.0 / 3.0 + 5.0 / 6.0 * y2 / bracket)
    total = front
    term = np.ones_like(y)
    for n in range(_SERIES_TERMS):
        term = term * (n + 0.5) / (n + 2.0 / 3.0) * y2
        total = total - term * (2.0 + n if transverse else 1.0)
    return total


def _loss_middle(y: FloatArray, transverse: bool) -> FloatArray:
    z = 1.0 - y * y
    loss = 1.0 - 0.4 * special.hyp2f1(0.5, 1.0, 11.0 / 6.0, z)
    if transverse:
        loss = loss + 6.0 / 55.0 * y * y * special.hyp2f1(1.5, 2.0, 17.0 / 6.0, z)
    return np.asarray(loss, dtype=np.float64)


def _loss_far(y: FloatArray, transverse: bool) -> FloatArray:
    """Connection formula in 1/y^2."""
    inverse = 1.0 / y
    w = inverse * inverse
    gamma = math.gamma
    slow = 0.4 * gamma(11.0 / 6.0) * math.sqrt(math.pi) / gamma(4.0 / 3.0)
    fast = 0.4 * gamma(11.0 / 6.0) * gamma(-0.5) / (math.sqrt(math.pi) * gamma(5.0 / 6.0))
    first = slow * inverse * (1.0 - w) ** (-5.0 / 6.0)
    if transverse:
        first = first * (0.5 - 5.0 / 6.0 * w / (1.0 - w))
    second = np.zeros_like(y)
    term = fast * w
    for n in range(_SERIES_TERMS):
        second = second + term * (-n if transverse else 1.0)
        term = term * (n + 4.0 / 3.0) / (n + 1.5) * w
    return 1.0 - first - second
