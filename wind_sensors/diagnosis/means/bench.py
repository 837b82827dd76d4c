"""What a search for causes works on: rows with noise and blocks, and a residual of each station."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.averages import BoolArray
from wind_sensors.diagnosis.means.pair import Pair
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
Residual = Callable[[Station, BoolArray], FloatArray]

CLIP = 3.0
"""Residuals count no further than so many standard deviations."""


@dataclass(frozen=True)
class Bench:
    """What a search works on: rows with noise and blocks, and a residual for every station.

    Attributes:
        station: The station as commissioned.
        residual: Residual of a station [m/s or rad] on some of the rows.
        change: From a station, how another station's residual differs in the wind that the
            first shows.
        noise: Its standard deviation, shape (n,).
        block: Number of the block of each row.
        elapsed: Time of each row [s].
    """

    station: Station
    residual: Residual
    change: Callable[[Station], Callable[[Station], FloatArray]]
    noise: FloatArray
    block: npt.NDArray[np.intp]
    elapsed: FloatArray

    @property
    def everything(self) -> BoolArray:
        """All rows."""
        return np.ones(self.noise.size, dtype=bool)

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return int(self.block.max()) + 1

    def white(self, station: Station, rows: BoolArray) -> FloatArray:
        """Residual over its noise."""
        return self.residual(station, rows) / self.noise[rows]


def bench_of(pair: Pair, station: Station) -> Bench:
    """A pair as a bench."""

    def residual(candidate: Station, rows: BoolArray) -> FloatArray:
        return (pair if rows.all() else pair.rows(rows)).residual(candidate)

    def change(base: Station) -> Callable[[Station], FloatArray]:
        speed = pair.wind(base)
        before = pair.residual(base, speed)
        return lambda candidate: pair.residual(candidate, speed) - before

    return Bench(station, residual, change, pair.noise, pair.block, pair.averages.elapsed)


def huber(white: FloatArray) -> FloatArray:
    """Cost of each residual: its square, growing linearly beyond `CLIP`."""
    size = np.abs(white)
    return np.where(size < CLIP, white**2, CLIP * (2.0 * size - CLIP))


def block_sums(values: FloatArray, block: npt.NDArray[np.intp], count: int) -> FloatArray:
    """Sum of values in each block."""
    return np.asarray(np.bincount(block, values, count), dtype=np.float64)


def halves(bench: Bench) -> tuple[BoolArray, BoolArray]:
    """Odd and even blocks."""
    odd: BoolArray = bench.block % 2 == 1
    return odd, ~odd
