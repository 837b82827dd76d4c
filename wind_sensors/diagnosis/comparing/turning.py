"""Vanes that turn round: a wind from behind, or a vane that counts the other way."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.counted_time import soft
from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.motion.frames import wrap

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IndexArray = npt.NDArray[np.intp]

TURNED_ROUND = 0.5 * np.pi
"""A vane that is this far from its simulation [rad] turns round."""

BESIDE_TURNING = 2.0
"""So much before and after belongs to it [s]."""

LONGEST_TURNING = 20.0
"""What takes longer [s] is no turning round."""

MOST_TURNING = 0.05
"""Nor is what takes a larger share of a recording."""

HARDLY_HELD = 2.0
"""Slower winds [m/s] do not count in either: a vane that they hardly hold comes round when it
may, heavy or oiled ones late."""

DEPARTURE_TIME = 5.0
"""A vane that stays away does so on average over this time [s]."""


def where_vanes_follow(
    differences: Iterable[FloatArray], speed: FloatArray, grid: Grid
) -> FloatArray:
    """Weights that are zero while a vane turns round to a wind from behind, shape (n,).

    Whether it does so on one side or the other hangs on a hair: measured and simulated vane may be
    half a turn apart for some seconds, which says nothing about the vane. What lasts longer or
    comes often is no such thing.

    Args:
        differences: Of each vane, measured minus simulated angle at the bins [rad].
        speed: Slow wind speed at the bins [m/s], shape (n,).
        grid: Bins.
    """
    weight = np.ones(grid.n)
    for difference in differences:
        begins, ends = _turning(difference, grid)
        if _stays_away(begins, ends, speed, grid):
            continue
        for begin, end in zip(begins, ends, strict=True):
            weight[begin:end] = 0.0
    return soft(weight)


def slow_departure(difference: FloatArray, speed: FloatArray, grid: Grid) -> FloatArray:
    """How far a vane points from where it should, slowly and continuously [rad], shape (n,).

    A vane that counts the other way round comes to point backwards, where each reading would lie a
    turn above or below by chance; near its own slow departure none does.

    Args:
        difference: Measured minus simulated angle at the bins [rad].
        speed: Slow wind speed at the bins [m/s], shape (n,).
        grid: Bins.

    Returns:
        Nought for vanes that stay near, or turn round for some seconds only.
    """
    if not _stays_away(*_turning(difference, grid), speed, grid):
        return np.zeros(grid.n)
    width = round(DEPARTURE_TIME / grid.dt)
    east, north = (
        uniform_filter1d(f(difference), width, mode="nearest") for f in (np.cos, np.sin)
    )
    return np.asarray(np.unwrap(np.arctan2(north, east)), dtype=np.float64)


def _turning(difference: FloatArray, grid: Grid) -> tuple[IndexArray, IndexArray]:
    """First bins and ends of the times in which a vane is turned round."""
    away = np.abs(wrap(difference)) > TURNED_ROUND
    return _runs(_widened(away, round(BESIDE_TURNING / grid.dt)))


def _stays_away(begins: IndexArray, ends: IndexArray, speed: FloatArray, grid: Grid) -> bool:
    """Whether a vane is turned round for longer, or more often, than by a wind from behind."""
    held = np.concatenate(([0], np.cumsum(speed > HARDLY_HELD)))
    lasting = held[ends] - held[begins]
    often = np.sum(lasting) > MOST_TURNING * grid.n
    return bool(often or np.any(lasting * grid.dt > LONGEST_TURNING))


def _widened(inside: BoolArray, bins: int) -> BoolArray:
    """True also within so many bins of what is."""
    return np.convolve(inside, np.ones(2 * bins + 1), "same") > 0.5


def _runs(inside: BoolArray) -> tuple[IndexArray, IndexArray]:
    """First bins and ends of the runs in which something holds."""
    edges = np.diff(np.concatenate(([False], inside, [False])).astype(np.int8))
    return np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
