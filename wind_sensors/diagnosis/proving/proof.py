"""Proof on data that took no part in the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import Term, planted, reached_by, simulated_with
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.proving.held_out import (
    Fold,
    Side,
    block_masks,
    blocks_for,
    curves,
    fold_of,
    least_left,
    of_part,
    removed,
    scored,
    side_of,
    speed_of,
    wind_masks,
)
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

LONGEST_LAG = 10.0
"""The residual is held against the wind up to so much later and earlier [s]."""

WITHIN = 1.96
"""Standard deviations that hold 95 % of normal numbers."""

DRAWS = 400


@dataclass(frozen=True)
class Proof:
    """How an explanation does on blocks that were not fitted.

    Attributes:
        before, after: Root mean square of the whitened residual on the scored blocks without and
            with the effects; 1 is the noise of a healthy day.
        floor: The same on the fitted blocks with the effects; without a measured reference what no
            explanation can remove, 0 where nobody knows how much that is.
        excess_removed: Share of the excess misfit, that above the floor, that the effects remove on
            the scored blocks.
        low, high: 95 % block-bootstrap interval of that share.
        placebo_removed: Share that the next-best explanation removes; None: there was none.
        curve_removed: Share that smooth curves over the wind's speed remove, added to every channel
            with as many coefficients as the effects have parameters; None: not asked.
        transfer: Share removed in the windier half of the blocks by what was fitted to the calmer
            half; None: the wind hardly changed.
        coverage: Share of the scored residuals, with the effects, within what holds 95 % on a
            healthy day; None: not asked.
        wind_correlation: Largest correlation of the scored residual with the wind at any lag,
            without and with the effects; None: not asked.
        own_removed: Share of the excess misfit of the signals that the effects reach: what is wrong
            with another instrument says nothing of them. None: not asked.
    """

    before: float
    after: float
    floor: float
    excess_removed: float
    low: float
    high: float
    placebo_removed: float | None
    curve_removed: float | None = None
    transfer: float | None = None
    coverage: float | None = None
    wind_correlation: tuple[float, float] | None = None
    own_removed: float | None = None

    @property
    def removed_where_it_acts(self) -> float:
        """Share of the excess misfit removed on the signals that the effects reach."""
        return self.excess_removed if self.own_removed is None else self.own_removed


def prove(
    whitener: Whitener,
    station: Station,
    terms: Sequence[Term],
    placebo: Sequence[Term] = (),
    seed: int = 1,
    workers: int = 1,
) -> Proof:
    """Fit on every other block, score on the rest, and the other way round.

    Args:
        whitener: The null in which the terms were named.
        station: The station as commissioned.
        terms: The named effects with their fitted values.
        placebo: The next-best explanation.
        seed: Of the block bootstrap.
        workers: Processes.
    """
    blocks = blocks_for([_acting(whitener, station, terms, term) for term in terms])
    masks = block_masks(whitener.comparison, blocks)
    even, odd = (side_of(whitener, station, mask, blocks) for mask in masks)
    ways = ((even, odd), (odd, even))
    competing = [terms, placebo] if placebo else [terms]
    jobs = [(*way, each) for each in competing for way in ways]
    found: list[Fold] = in_parallel(
        lambda job: fold_of(job[0], job[1], station, job[2]), jobs, workers
    )
    folds, rivals = found[: len(ways)], found[len(ways) :]
    own = _reached(whitener, terms)
    rng = np.random.default_rng(seed)
    drawn = [
        removed(folds, [rng.integers(0, f.before.size - 1, f.before.size - 1) for f in folds])
        for _ in range(DRAWS)
    ]
    low, high = np.quantile(drawn, (0.025, 0.975))
    parameters = sum(term.fits(p) for term in terms for p in term.effect.parameters)
    smooth = [_curve(*way, parameters) for way in ways]
    size = sum(fold.vector.size for fold in folds)
    series = [f.vector[: _series_size(s)] for f, (_, s) in zip(folds, ways, strict=True)]
    return Proof(
        before=float(np.sqrt(sum(f.before.sum() for f in folds) / size)),
        after=float(np.sqrt(sum(f.after.sum() for f in folds) / size)),
        floor=float(np.sqrt(sum(f.floor for f in folds) / size)),
        excess_removed=removed(folds),
        low=float(low),
        high=float(high),
        placebo_removed=removed(_instead(folds, rivals)) if rivals else None,
        curve_removed=removed(_instead(folds, smooth)),
        transfer=_transfer(whitener, station, terms),
        coverage=float(np.mean(np.abs(np.concatenate(series)) < WITHIN)),
        wind_correlation=(
            max(_wind_correlation(s, s.before) for _, s in ways),
            max(_wind_correlation(s, f.vector) for f, (_, s) in zip(folds, ways, strict=True)),
        ),
        own_removed=removed([of_part(f, *way, own) for f, way in zip(folds, ways, strict=True)]),
    )


def _acting(
    whitener: Whitener, station: Station, terms: Sequence[Term], term: Term
) -> FloatArray:
    """Squares of what one of several effects changes in each bin, in units of noise, shape (n,)."""
    comparison = whitener.comparison
    after = comparison.simulate(planted(station, terms))
    before = simulated_with(comparison, station, [t for t in terms if t is not term])
    squares = np.zeros(comparison.grid.n)
    for channel in comparison.channels:
        noise = float(np.median(whitener.trust[channel.name].deviation))
        squares += ((after.series[channel.name] - before.series[channel.name]) / noise) ** 2
    return squares


def _reached(whitener: Whitener, terms: Sequence[Term]) -> FloatArray:
    """One for what is compared of signals that effects reach, nought for the rest, shape (l,)."""
    comparison = whitener.comparison
    names = reached_by(comparison, comparison.station, terms)
    reached = np.array([float(c.instrument in names) for c in comparison.channels])
    return np.asarray(reached[comparison.channel_of_each])


def _instead(folds: Sequence[Fold], others: Sequence[Fold]) -> list[Fold]:
    """Folds of something else, which competes for the same excess."""
    return [replace(o, floor=f.floor) for f, o in zip(folds, others, strict=True)]


def _series_size(side: Side) -> int:
    comparison = side.whitener.comparison
    return comparison.coefficients * len(comparison.channels)


def _transfer(whitener: Whitener, station: Station, terms: Sequence[Term]) -> float | None:
    """Share removed in the windier blocks by what was fitted to the calmer ones.

    Of the excess there that the same effects remove when fitted to everything, with smooth curves
    beside them: how much noise a half has depends on its wind.
    """
    masks = wind_masks(whitener.comparison)
    if masks is None:
        return None
    calm, windy = (side_of(whitener, station, mask) for mask in masks)
    everywhere = windy.whitener.of_station(planted(station, terms))
    fold = fold_of(calm, windy, station, terms)
    return removed([replace(fold, floor=least_left(windy, everywhere))])


def _curve(fitting: Side, scoring: Side, parameters: int) -> Fold:
    """A polynomial of the slow wind speed added to every channel, with so many coefficients."""
    rows = [curves(side, max(parameters, 1) - 1, [speed_of(side)]) for side in (fitting, scoring)]
    coefficients = np.linalg.lstsq(rows[0].T, fitting.before, rcond=None)[0]
    left = fitting.before - coefficients @ rows[0]
    return scored(scoring, scoring.before - coefficients @ rows[1], left, float(left @ left))


def _wind_correlation(side: Side, vector: FloatArray) -> float:
    """Largest correlation of a white residual with what the healthy instruments would show."""
    comparison = side.whitener.comparison
    n, bins = comparison.coefficients, comparison.grid.n
    furthest = round(LONGEST_LAG / comparison.grid.dt)
    largest = 0.0
    for k, channel in enumerate(comparison.channels):
        full = np.zeros(bins)
        full[:n] = vector[k * n : (k + 1) * n]
        residual = spectra.from_cosine(full)
        full = np.zeros(bins)
        full[1:n] = side.healthy.cosine[channel.name][1:n]
        wind = spectra.from_cosine(full)
        scale = float(np.linalg.norm(residual) * np.linalg.norm(wind))
        if scale > 0.0:
            products = [
                abs(float(np.roll(wind, lag) @ residual)) for lag in range(-furthest, furthest + 1)
            ]
            largest = max(largest, max(products) / scale)
    return largest
