"""Vanes of one mast against each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.means.averages import Averages, BoolArray, blocks_of, part, thinned
from wind_sensors.diagnosis.means.bench import Bench
from wind_sensors.diagnosis.means.mean_response import mean_heading
from wind_sensors.diagnosis.means.pair import FEWEST_IN_CELL, noise_of
from wind_sensors.motion.frames import wrap
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

WINDY = 4.0
"""Vanes are compared above this wind [m/s]; below it their directions wander apart."""

SECTORS = 12
"""Sectors of direction in which vanes have a usual difference: 30 degrees, for a mount and an
eccentric disc turn a vane once or twice a turn. A choice; narrower ones follow the noise."""

FEWEST_COMMON = 500
"""So many means, half a week of them, two vanes must share. A choice; with fewer, single days
decide how far the wind's own turning with height wanders."""


@dataclass(frozen=True)
class VaneStanding:
    """What healthy recordings show: difference by direction [rad], shape (12,)."""

    table: FloatArray
    spread: float

    def at(self, heading: FloatArray) -> FloatArray:
        """Difference to be expected [rad]."""
        return np.asarray(self.table[_sector(heading)])


def _sector(heading: FloatArray) -> npt.NDArray[np.intp]:
    turned = np.mod(heading, 2.0 * np.pi) / (2.0 * np.pi / SECTORS)
    return np.clip(np.floor(turned).astype(np.intp), 0, SECTORS - 1)


@dataclass(frozen=True)
class VaneBench:
    """A vane against the others.

    Attributes:
        vane: Its name.
        bench: For the search.
        heading: What the others show [rad], shape (n,).
        difference: Vane minus others [rad], shape (n,).
    """

    vane: str
    bench: Bench
    heading: FloatArray
    difference: FloatArray


def _direction(averages: Averages, names: list[str]) -> FloatArray:
    columns = np.array([np.exp(1j * averages.heading[n]) for n in names])
    return np.asarray(np.angle(columns.mean(axis=0)))


def vane_bench(
    averages: Averages, station: Station, vane: str, standing: VaneStanding | None
) -> VaneBench | None:
    """A vane against the mean of the others where all work; None: too few such rows."""
    others = [n for n in averages.heading if n != vane]
    shared = {n: np.isfinite(averages.heading[n] + averages.heading[vane]) for n in others}
    usable = [n for n in others if np.count_nonzero(shared[n]) > FEWEST_COMMON]
    if not usable:
        return None
    speed = np.nanmax(np.array(list(averages.speed.values())), axis=0)
    good = np.isfinite(averages.heading[vane]) & (speed > WINDY)
    for name in usable:
        good &= np.isfinite(averages.heading[name])
    if np.count_nonzero(good) < FEWEST_COMMON:
        return None
    chosen = thinned(good)
    rows = part(averages, chosen)
    heading = _direction(rows, usable)
    difference = np.asarray(wrap(rows.heading[vane] - heading))
    expected = np.zeros(len(rows)) if standing is None else standing.at(heading)

    def residual(candidate: Station, keep: BoolArray) -> FloatArray:
        shown = mean_heading(candidate, vane, heading[keep], rows.elapsed[keep])
        turned = shown - heading[keep]
        return np.asarray(wrap(difference[keep] - turned - expected[keep]))

    everything = np.ones(len(rows), dtype=bool)

    def change(base: Station) -> Callable[[Station], FloatArray]:
        before = residual(base, everything)
        return lambda candidate: residual(candidate, everything) - before

    noise = noise_of(difference - np.median(difference), speed[chosen])
    bench = Bench(station, residual, change, noise, blocks_of(rows), rows.elapsed)
    return VaneBench(vane, bench, heading, difference)


def vane_standing(averages: Averages, station: Station, vane: str) -> VaneStanding | None:
    """What healthy means show of a vane against the others."""
    found = vane_bench(averages, station, vane, None)
    if found is None:
        return None
    sector = _sector(found.heading)
    overall = float(np.median(found.difference))
    table = np.array(
        [
            np.median(found.difference[sector == s])
            if np.sum(sector == s) > FEWEST_IN_CELL
            else overall
            for s in range(SECTORS)
        ]
    )
    rest = found.difference - table[sector]
    block = found.bench.block
    means = [float(np.median(rest[block == b])) for b in range(found.bench.blocks)]
    return VaneStanding(table, float(np.std(means)))


def vane_effects(calibrated: bool) -> dict[str, Effect]:
    """Effects that mean directions can show.

    Without healthy recordings a constant difference between heights is no finding: the wind itself
    turns with height.
    """
    known = catalogue()
    offset = replace(known["vane_offset"], everywhere=False)
    if not calibrated:
        return {"vane_offset": offset}
    return {"vane_offset": offset, "vane_eccentricity": known["vane_eccentricity"]}
