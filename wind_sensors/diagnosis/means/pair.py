"""Two rotors side by side: each is the other's reference."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.averages import (
    BLOWING,
    FEWEST_ROWS,
    Averages,
    BoolArray,
    blocks_of,
    part,
    thinned,
)
from wind_sensors.diagnosis.means.mean_response import mean_speed
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

SLOWEST = 2.0
"""Below this wind [m/s] starting speeds decide, and pairs are not compared."""

SLOWEST_OF_TWO = 0.5
"""The slower of two rotors must show as much [m/s]: one that stands says nothing of the wind."""

SECTORS = 36
"""Sectors of direction in what a function of direction and speed can be: 10 degrees, the standard
deviation of a tower's wake. A choice; wider ones smear the wake, narrower ones hold fewer means."""

SPEED_CLASSES = (0.0, 5.0, 8.0, 100.0)
"""Edges of its classes of speed [m/s]: where friction and offsets matter, the middle, and where
only gains and mounts are left. A choice; with more classes fewer cells are filled."""

FEWEST_IN_CELL = 12
"""So many means, two hours of them, give a cell a median of its own. A choice; with fewer the table
follows the noise, with more it borrows from other speeds more often."""

FEWEST_SHARED = 100
"""So many means with wind must be common to two sensors before their usual difference is believed.
A choice; it only keeps sensors that hardly ever worked together from being matched."""

NOISE_CLASSES = 8
"""Equally filled classes of speed in which the noise is taken; in between it is interpolated."""

_FEWEST_IN_NOISE_CLASS = 20

_SMALLEST_NOISE = 0.01
"""Least noise of a difference [m/s], that two equal columns do not divide by nought: about the
step in which means of speeds are written."""


def pairs_of(averages: Averages) -> list[tuple[str, str]]:
    """Rotors that agree best with each other, mutually: those at one height."""
    names = list(averages.speed)
    scatter = np.full((len(names), len(names)), np.inf)
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            va, vb = averages.speed[a], averages.speed[b]
            good = (va > BLOWING) & (vb > BLOWING)
            if i != j and np.count_nonzero(good) > FEWEST_SHARED:
                ratio = np.log(va[good] / vb[good])
                scatter[i, j] = float(np.median(np.abs(ratio - np.median(ratio))))
    nearest = np.argmin(scatter, axis=1)
    return [
        (names[i], names[int(j)])
        for i, j in enumerate(nearest)
        if i < j and nearest[j] == i and np.isfinite(scatter[i, j])
    ]


def direction_of(averages: Averages) -> FloatArray:
    """Where the wind comes from, counter-clockwise from x [rad], from the vanes that work.

    The vane with the most readings leads; where it is silent, another one stands in, turned by
    their median difference.
    """
    columns = sorted(
        averages.heading.values(), key=lambda v: -int(np.count_nonzero(np.isfinite(v)))
    )
    if not columns:
        return np.zeros(len(averages))
    out = columns[0].copy()
    for other in columns[1:]:
        both = np.isfinite(out) & np.isfinite(other)
        gap = ~np.isfinite(out) & np.isfinite(other)
        if both.sum() > FEWEST_SHARED and gap.any():
            turn = np.angle(np.mean(np.exp(1j * (out[both] - other[both]))))
            out[gap] = other[gap] + turn
    return np.asarray(out)


@dataclass(frozen=True)
class Standing:
    """What healthy recordings of a pair show: residual relative to the wind, cell by cell.

    Attributes:
        table: By direction sector and speed class [1], shape (36, 3).
        spread: Standard deviation of its mean over blocks [1].
    """

    table: FloatArray
    spread: float

    def at(self, speed: FloatArray, heading: FloatArray) -> FloatArray:
        """Residual to be expected [m/s]."""
        sector, level = cells(speed, heading)
        return np.asarray(self.table[sector, level] * speed)


def cells(
    speed: FloatArray, heading: FloatArray
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Direction sector and speed class of each row."""
    sector = np.floor(np.mod(heading, 2.0 * np.pi) / (2.0 * np.pi / SECTORS)).astype(np.intp)
    level = np.searchsorted(SPEED_CLASSES[1:-1], speed).astype(np.intp)
    return np.clip(sector, 0, SECTORS - 1), level


@dataclass(frozen=True)
class Pair:
    """The rows in which two rotors can be compared.

    Attributes:
        first, second: Rotors.
        averages: Those rows.
        heading: Where the wind comes from [rad], shape (n,).
        intensity: Turbulence intensity [1].
        block: Number of the block of each row.
        noise: Standard deviation of the residual [m/s], shape (n,).
        standing: What is normal, if healthy recordings tell.
    """

    first: str
    second: str
    averages: Averages
    heading: FloatArray
    intensity: FloatArray
    block: npt.NDArray[np.intp]
    noise: FloatArray
    standing: Standing | None = None

    def __len__(self) -> int:
        return len(self.averages)

    @property
    def name(self) -> str:
        """For people and channels."""
        return f"{self.second} - {self.first}"

    def readings(self, station: Station, rotor: str, speed: FloatArray) -> FloatArray:
        """Indicated speed of one rotor in a wind [m/s]."""
        a = self.averages
        return mean_speed(
            station, rotor, speed, self.heading, self.intensity, a.temperature, a.density,
            a.elapsed,
        )

    def wind(self, station: Station) -> FloatArray:
        """Wind that both rotors together show, seen through their own inverse models [m/s]."""
        one, two = self.averages.speed[self.first], self.averages.speed[self.second]
        speed = 0.5 * (one + two)
        for _ in range(3):
            off = one - self.readings(station, self.first, speed)
            off = off + two - self.readings(station, self.second, speed)
            speed = np.maximum(speed + 0.5 * off, 0.1)
        return speed

    def residual(self, station: Station, speed: FloatArray | None = None) -> FloatArray:
        """Difference of the two rotors minus its simulation and minus what is normal [m/s].

        Args:
            station: The station.
            speed: The wind; None: what the two rotors show through this station.
        """
        speed = self.wind(station) if speed is None else speed
        measured = self.averages.speed[self.second] - self.averages.speed[self.first]
        simulated = self.readings(station, self.second, speed) - self.readings(
            station, self.first, speed
        )
        left = measured - simulated
        if self.standing is not None:
            left = left - self.standing.at(speed, self.heading)
        return np.asarray(left)

    def rows(self, keep: BoolArray) -> Pair:
        """Some of the rows."""
        return replace(
            self,
            averages=part(self.averages, keep),
            heading=self.heading[keep],
            intensity=self.intensity[keep],
            block=self.block[keep],
            noise=self.noise[keep],
        )


def _cell_medians(
    relative: FloatArray, speed: FloatArray, heading: FloatArray
) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    sector, level = cells(speed, heading)
    number = sector * (len(SPEED_CLASSES) - 1) + level
    size = SECTORS * (len(SPEED_CLASSES) - 1)
    order = np.argsort(number, kind="stable")
    edges = np.searchsorted(number[order], np.arange(size + 1))
    table = np.full(size, np.nan)
    count = np.diff(edges)
    for k in np.flatnonzero(count >= FEWEST_IN_CELL):
        table[k] = np.median(relative[order[edges[k] : edges[k + 1]]])
    return table.reshape(SECTORS, -1), count


def table_of(relative: FloatArray, speed: FloatArray, heading: FloatArray) -> FloatArray:
    """Median of a residual relative to the wind in every cell; neighbours fill empty cells."""
    table, _ = _cell_medians(relative, speed, heading)
    overall = float(np.median(relative)) if relative.size else 0.0
    by_sector = np.array(
        [np.nanmean(row) if np.isfinite(row).any() else overall for row in table]
    )
    return np.where(np.isfinite(table), table, by_sector[:, None])


def noise_of(residual: FloatArray, speed: FloatArray) -> FloatArray:
    """Robust standard deviation of a residual as a function of the wind [m/s]."""
    edges = np.quantile(speed, np.linspace(0.0, 1.0, NOISE_CLASSES + 1))
    middles, widths = [], []
    for low, high in pairwise(edges):
        inside = (speed >= low) & (speed <= high)
        if np.count_nonzero(inside) > _FEWEST_IN_NOISE_CLASS:
            chosen = residual[inside]
            middles.append(float(np.median(speed[inside])))
            widths.append(1.4826 * float(np.median(np.abs(chosen - np.median(chosen)))))
    return np.maximum(np.interp(speed, middles, widths), _SMALLEST_NOISE)


def is_comparable(averages: Averages, first: str, second: str) -> bool:
    """Whether two rotors have enough common means in wind."""
    one, two = averages.speed[first], averages.speed[second]
    return int(np.count_nonzero((one > SLOWEST) & (two > SLOWEST))) >= FEWEST_ROWS


def pair_of(averages: Averages, first: str, second: str, standing: Standing | None = None) -> Pair:
    """The rows in which a pair can be compared, thinned to a number that tells as much."""
    one, two = averages.speed[first], averages.speed[second]
    heading = direction_of(averages)
    good = (
        np.isfinite(one) & np.isfinite(two) & np.isfinite(heading)
        & (np.fmax(one, two) > SLOWEST) & (np.fmin(one, two) > SLOWEST_OF_TWO)
    )
    chosen = thinned(good)
    rows = part(averages, chosen)
    intensity = np.minimum(rows.intensity(first), rows.intensity(second))
    blank = Pair(
        first, second, rows, heading[chosen], intensity, blocks_of(rows), np.ones(len(rows)),
        standing,
    )
    speed = blank.wind(averages.station)
    residual = blank.residual(averages.station)
    sector, level = cells(speed, blank.heading)
    table = table_of(residual / speed, speed, blank.heading)
    return replace(blank, noise=noise_of(residual - table[sector, level] * speed, speed))


def standing_of(averages: Averages, first: str, second: str) -> Standing:
    """What healthy means of a pair show."""
    pair = pair_of(averages, first, second)
    speed = pair.wind(averages.station)
    relative = pair.residual(averages.station) / speed
    table = table_of(relative, speed, pair.heading)
    sector, level = cells(speed, pair.heading)
    rest = relative - table[sector, level]
    means = [float(np.median(rest[pair.block == b])) for b in range(int(pair.block.max()) + 1)]
    return Standing(table, float(np.std(means)))
