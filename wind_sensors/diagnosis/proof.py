"""Proof on data that took no part in the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis import spectra
from wind_sensors.diagnosis.comparison import Comparison, Simulated, Trust
from wind_sensors.diagnosis.fitting import ROUGHLY, Term, fit, planted
from wind_sensors.diagnosis.whitening import Whitener
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

BLOCKS = 12
"""The record is cut into so many blocks; every other one is fitted, the rest is scored."""

GAP = 4.0
"""Between a fitted and a scored block [s]."""

_RAMP = 2.0
_DRAWS = 400


@dataclass(frozen=True)
class Proof:
    """How an explanation does on blocks that were not fitted.

    Attributes:
        before, after: Root mean square of the whitened residual on the scored blocks without and
            with the effects; 1 is the noise of a healthy day.
        floor: The same on the fitted blocks with the effects.
        excess_removed: Share of the excess misfit that the effects remove on the scored blocks.
        low, high: 95 % block-bootstrap interval of that share.
        placebo_removed: Share that the next-best explanation removes; None: there was none.
    """

    before: float
    after: float
    floor: float
    excess_removed: float
    low: float
    high: float
    placebo_removed: float | None


def block_masks(comparison: Comparison) -> tuple[FloatArray, FloatArray]:
    """Two sets of blocks with gaps between them, with soft edges."""
    length = comparison.grid.n * comparison.grid.dt
    at = comparison.grid.centres
    width = length / BLOCKS
    within = np.mod(at, width)
    edge = np.minimum(within, width - within) - 0.5 * GAP
    soft = np.clip(edge / _RAMP, 0.0, 1.0)
    soft = 0.5 - 0.5 * np.cos(np.pi * soft)
    number = np.floor(at / width).astype(np.intp)
    even = np.where(number % 2 == 0, soft, 0.0)
    return even, np.where(number % 2 == 1, soft, 0.0)


def _masked_whitener(whitener: Whitener, mask: FloatArray) -> Whitener:
    """The noise-only null within the blocks of a mask."""
    share = float(np.mean(mask**2))
    trust: dict[str, Trust] = {}
    for channel in whitener.comparison.channels:
        t = whitener.trust[channel.name]
        trust[channel.name] = replace(
            t,
            deviation=t.deviation * np.sqrt(share),
            statistics_deviation=t.statistics_deviation / np.sqrt(max(share, 0.1)),
        )
    comparison = whitener.comparison.within(mask)
    return Whitener(comparison, trust, np.zeros((0, 0)), np.zeros(0), np.zeros(1))


def _block_costs(whitener: Whitener, vector: FloatArray) -> tuple[FloatArray, float]:
    """Cost of the series in each block, and of the statistics."""
    comparison = whitener.comparison
    n, bins = comparison.coefficients, comparison.grid.n
    costs = np.zeros(BLOCKS)
    number = np.minimum((np.arange(bins) * BLOCKS) // bins, BLOCKS - 1)
    place = 0
    for _ in comparison.channels:
        full = np.zeros(bins)
        full[:n] = vector[place : place + n]
        costs += np.bincount(number, spectra.from_cosine(full) ** 2, BLOCKS)
        place += n
    return costs, float(np.sum(vector[place:] ** 2))


@dataclass(frozen=True)
class _Fold:
    before: FloatArray
    after: FloatArray
    floor: float
    size: int


def _fold(
    fitting: Whitener, scoring: Whitener, station: Station, terms: Sequence[Term],
    rest: tuple[Simulated, Simulated],
) -> _Fold:
    fitted = fit(fitting, station, terms, rest[0], iterations=4, least=ROUGHLY)
    corrected = scoring.comparison.simulate(planted(station, fitted.terms))
    before = _block_costs(scoring, scoring.of(rest[1]))
    after = _block_costs(scoring, scoring.of(corrected))
    used = before[0] > 1e-9
    size = scoring.of(rest[1]).size
    return _Fold(
        np.append(before[0][used], before[1]), np.append(after[0][used], after[1]),
        fitted.cost, size,
    )  # fmt: skip


def _removed(folds: Sequence[_Fold], picks: Sequence[npt.NDArray[np.intp]] | None) -> float:
    before = after = floor = 0.0
    for k, fold in enumerate(folds):
        if picks is None:
            before += float(fold.before.sum())
            after += float(fold.after.sum())
        else:
            scale = (fold.before.size - 1) / picks[k].size
            before += float(fold.before[picks[k]].sum()) * scale + float(fold.before[-1])
            after += float(fold.after[picks[k]].sum()) * scale + float(fold.after[-1])
        floor += fold.floor
    excess = before - min(floor, after)
    return (before - after) / excess if excess > 0.0 else 0.0


def prove(
    whitener: Whitener,
    station: Station,
    terms: Sequence[Term],
    placebo: Sequence[Term] = (),
    seed: int = 1,
) -> Proof:
    """Fit on every other block, score on the rest, and the other way round.

    Args:
        whitener: The null in which the terms were named.
        station: The station as commissioned.
        terms: The named effects with their fitted values.
        placebo: The next-best explanation.
        seed: Of the block bootstrap.
    """
    sides = [_masked_whitener(whitener, mask) for mask in block_masks(whitener.comparison)]
    nothing = [side.comparison.simulate(station) for side in sides]
    pairs = ((0, 1), (1, 0))
    folds = [
        _fold(sides[a], sides[b], station, terms, (nothing[a], nothing[b])) for a, b in pairs
    ]
    removed = _removed(folds, None)
    rng = np.random.default_rng(seed)
    drawn = [
        _removed(
            folds,
            [rng.integers(0, fold.before.size - 1, fold.before.size - 1) for fold in folds],
        )
        for _ in range(_DRAWS)
    ]
    low, high = np.quantile(drawn, (0.025, 0.975))
    placebo_removed = None
    if placebo:
        others = [
            _fold(sides[a], sides[b], station, placebo, (nothing[a], nothing[b]))
            for a, b in pairs
        ]
        # The placebo competes for the same excess.
        for k, fold in enumerate(others):
            others[k] = replace(fold, floor=folds[k].floor)
        placebo_removed = _removed(others, None)
    size = sum(fold.size for fold in folds)
    return Proof(
        before=float(np.sqrt(sum(f.before.sum() for f in folds) / size)),
        after=float(np.sqrt(sum(f.after.sum() for f in folds) / size)),
        floor=float(np.sqrt(sum(f.floor for f in folds) / size)),
        excess_removed=removed,
        low=float(low),
        high=float(high),
        placebo_removed=placebo_removed,
    )
