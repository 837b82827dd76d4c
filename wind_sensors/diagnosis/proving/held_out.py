"""Blocks of a record that are fitted, and blocks that are scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison, Trust
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.explaining.fitting import ROUGHLY, fit
from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener, unstanding
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

BLOCKS = 12
"""The record is cut into so many blocks, or more."""

FINEST = 4
"""Up to so many times as many."""

LEAST_IN_A_HALF = 0.15
"""Until every other block holds this share of what each effect changes: a vane that is in its gap
for one minute cannot tell, in the minutes without it, what the gap reads."""

ACTS_IN_SERIES = 1.0
"""What changes the series by less, in squares of noise, shows in statistics alone, and asks for no
finer blocks."""

GAP = 4.0
"""Between a fitted and a scored block [s]."""

LEAST_CONTRAST = 1.1
"""The windier half of the blocks has at least this many times the wind of the calmer half where a
transfer from one to the other says something."""

SMOOTH = 3
"""Degree of the smooth curves that tell how much more could be removed."""

CHANCE = 4.0
"""What a coefficient of such a curve removes of a healthy day's slow errors, in squared whitened
units; of white noise it were 1."""

_RAMP = 2.0


def blocks_for(acting: Sequence[FloatArray]) -> int:
    """Into how many blocks a record is cut to prove effects of which some act for a short while.

    Args:
        acting: Squares of what each effect changes in each bin, shape (n,) each.
    """
    blocks = BLOCKS
    shown = [one for one in acting if float(one.sum()) > ACTS_IN_SERIES]
    while blocks < FINEST * BLOCKS:
        shares = [
            float(one[_block_numbers(one.size, blocks) % 2 == 1].sum() / one.sum())
            for one in shown
        ]
        if all(LEAST_IN_A_HALF < share < 1.0 - LEAST_IN_A_HALF for share in shares):
            return blocks
        blocks *= 2
    return blocks


def block_masks(comparison: Comparison, blocks: int = BLOCKS) -> tuple[FloatArray, FloatArray]:
    """Two sets of blocks with gaps between them, with soft edges."""
    odd = np.arange(blocks) % 2 == 1
    return _mask_of(comparison, ~odd), _mask_of(comparison, odd)


def wind_masks(comparison: Comparison) -> tuple[FloatArray, FloatArray] | None:
    """The calmer half of the blocks and the windier one; None: they are too much alike."""
    number = _block_numbers(comparison.grid.n, BLOCKS)
    speed = np.bincount(number, comparison.speed, BLOCKS) / np.bincount(number, minlength=BLOCKS)
    windy = speed > np.median(speed)
    if np.mean(speed[windy]) < LEAST_CONTRAST * np.mean(speed[~windy]):
        return None
    return _mask_of(comparison, ~windy), _mask_of(comparison, windy)


def _block_numbers(bins: int, blocks: int) -> npt.NDArray[np.intp]:
    return np.minimum((np.arange(bins) * blocks) // bins, blocks - 1)


def _mask_of(comparison: Comparison, chosen: npt.NDArray[np.bool_]) -> FloatArray:
    """Weights of the bins in the chosen blocks, which have soft edges."""
    blocks = chosen.size
    width = comparison.grid.n * comparison.grid.dt / blocks
    within = np.mod(comparison.grid.centres, width)
    edge = np.minimum(within, width - within) - 0.5 * GAP
    soft = 0.5 - 0.5 * np.cos(np.pi * np.clip(edge / _RAMP, 0.0, 1.0))
    return np.where(chosen[_block_numbers(comparison.grid.n, blocks)], soft, 0.0)


@dataclass(frozen=True)
class Side:
    """Some blocks of a record.

    Attributes:
        whitener: The noise-only null within them.
        healthy: The simulation of the station as commissioned, seen there.
        blocks: How many the record has, of those with them and of the others.
    """

    whitener: Whitener
    healthy: Simulated
    blocks: int = BLOCKS

    @property
    def before(self) -> FloatArray:
        """White residual without any effect, shape (m,)."""
        return self.whitener.of(self.healthy)


def side_of(
    whitener: Whitener, station: Station, mask: FloatArray, blocks: int = BLOCKS
) -> Side:
    """The blocks of a mask.

    Args:
        whitener: The null of the whole record.
        station: As commissioned.
        mask: Weights of the bins, shape (n,).
        blocks: Into how many the record is cut.
    """
    comparison = whitener.comparison.within(mask)
    share = comparison.counted_share
    of_blocks = float(np.mean(mask**2))
    trust: dict[str, Trust] = {}
    for channel in whitener.comparison.channels:
        t = whitener.trust[channel.name]
        trust[channel.name] = replace(
            t,
            deviation=t.deviation * np.sqrt(share),
            statistics_deviation=t.statistics_deviation / np.sqrt(max(of_blocks, 0.1)),
        )
    return Side(unstanding(comparison, trust), comparison.simulate(station), blocks)


def curves(side: Side, degree: int, over: Sequence[FloatArray]) -> FloatArray:
    """White signatures of polynomials added to each channel, one a row.

    Args:
        side: Where they are seen.
        degree: Highest power.
        over: What they are polynomials of, each within -1 and 1 at the bins, shape (n,).
    """
    comparison, trust = side.whitener.comparison, side.whitener.trust
    n, size = comparison.coefficients, side.before.size
    rows = []
    for k, channel in enumerate(comparison.channels):
        scale = comparison.speed if channel.kind == "vane_angle" else 1.0
        for at in over:
            for power in range(degree + 1):
                curve = scale * np.polynomial.Legendre.basis(power)(at)
                row = np.zeros(size)
                row[k * n : (k + 1) * n] = (
                    spectra.to_cosine(comparison.masked(curve))[:n] / trust[channel.name].deviation
                )
                rows.append(row)
    return np.array(rows)


def speed_of(side: Side) -> FloatArray:
    """Slow wind speed at the bins between its smallest (-1) and its largest (1)."""
    speed = side.whitener.comparison.speed
    return _between(speed)


def time_of(side: Side) -> FloatArray:
    """Time at the bins from the record's beginning (-1) to its end (1)."""
    return _between(side.whitener.comparison.grid.centres)


def _between(values: FloatArray) -> FloatArray:
    middle, half = 0.5 * (values.max() + values.min()), 0.5 * np.ptp(values)
    return np.asarray((values - middle) / max(half, 1e-9), dtype=np.float64)


@dataclass(frozen=True)
class Fold:
    """Costs on the scored blocks, one by one and then of the statistics, shape (b + 1,).

    Attributes:
        before, after: Without and with what was fitted to the other blocks.
        floor: Cost that is left on the fitted blocks when smooth curves over speed and time make
            good what the effects leave, so that a poor fit is not its own measure.
        vector: White residual of the scored blocks, with the effects.
        fitted: White residual of the fitted blocks, with the effects.
    """

    before: FloatArray
    after: FloatArray
    floor: float
    vector: FloatArray
    fitted: FloatArray


def fold_of(fitting: Side, scoring: Side, station: Station, terms: Sequence[Term]) -> Fold:
    """Fit effects to some blocks and score them on others."""
    null = fitting.whitener
    fitted = fit(null, station, terms, fitting.healthy, iterations=4, least=ROUGHLY)
    corrected = scoring.whitener.comparison.simulate(planted(station, fitted.terms))
    left = fitted.vector
    return scored(scoring, scoring.whitener.of(corrected), left, least_left(fitting, left))


def of_part(fold: Fold, fitting: Side, scoring: Side, part: FloatArray) -> Fold:
    """The same fit, scored on a part of what is compared.

    Args:
        fold: The fit.
        fitting, scoring: Its sides.
        part: Ones and noughts, shape (m,).
    """
    left = part * fold.fitted
    floor = least_left(fitting, left)
    return scored(scoring, part * fold.vector, left, floor, part * scoring.before)


def least_left(fitting: Side, left: FloatArray) -> float:
    """Cost that is left beside smooth curves, beyond what those remove on healthy days."""
    rows = curves(fitting, SMOOTH, (speed_of(fitting), time_of(fitting)))
    coefficients, _, rank, _ = np.linalg.lstsq(rows.T, left, rcond=1e-6)
    rest = left - coefficients @ rows
    return min(float(left @ left), float(rest @ rest) + CHANCE * float(rank))


def scored(
    scoring: Side,
    vector: FloatArray,
    fitted: FloatArray,
    floor: float,
    without: FloatArray | None = None,
) -> Fold:
    """Costs of a white residual on the scored blocks.

    Args:
        scoring: The blocks.
        vector: The residual, shape (m,).
        fitted: That of the fitted blocks.
        floor: Its cost.
        without: The residual without what was fitted; None: of all that is compared.
    """
    before = _block_costs(scoring, scoring.before if without is None else without)
    after = _block_costs(scoring, vector)
    used = np.append(before[:-1] > 1e-9, True)
    return Fold(before[used], after[used], floor, vector, fitted)


def removed(
    folds: Sequence[Fold], picks: Sequence[npt.NDArray[np.intp]] | None = None
) -> float:
    """Share of the excess misfit that is gone on the scored blocks.

    Args:
        folds: Scored blocks.
        picks: For each fold the blocks that count, as often as they are named; None: all once.
    """
    before = after = floor = 0.0
    for k, fold in enumerate(folds):
        chosen = np.arange(fold.before.size - 1) if picks is None else picks[k]
        scale = (fold.before.size - 1) / chosen.size
        before += float(fold.before[chosen].sum()) * scale + float(fold.before[-1])
        after += float(fold.after[chosen].sum()) * scale + float(fold.after[-1])
        floor += fold.floor
    excess = before - min(floor, after)
    return (before - after) / excess if excess > 0.0 else 0.0


def _block_costs(side: Side, vector: FloatArray) -> FloatArray:
    """Cost of the series in each block, then that of the statistics."""
    comparison = side.whitener.comparison
    n, bins = comparison.coefficients, comparison.grid.n
    costs = np.zeros(side.blocks + 1)
    number = _block_numbers(bins, side.blocks)
    place = 0
    for _ in comparison.channels:
        full = np.zeros(bins)
        full[:n] = vector[place : place + n]
        costs[:-1] += np.bincount(number, spectra.from_cosine(full) ** 2, side.blocks)
        place += n
    costs[-1] = np.sum(vector[place:] ** 2)
    return costs
