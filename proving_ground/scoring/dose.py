"""How large an effect must be to be found: logistic curves over the logarithm of the size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from proving_ground.inflow import Array
from proving_ground.scoring.outcome import Judged

RESAMPLES = 300
FEWEST = 4
"""Of fewer cases no curve is told."""


@dataclass(frozen=True)
class Dose:
    """Sizes, in multiples of the minimum, found in half and in 90 % of cases, with intervals at
    95 % (bootstrap over recordings); trials and finds by size."""

    title: str
    half: float
    half_interval: tuple[float, float]
    ninety: float
    ninety_interval: tuple[float, float]
    sizes: tuple[float, ...]
    finds: tuple[int, ...]
    trials: tuple[int, ...]
    slope: float
    middle: float

    def chance(self, size: Array) -> Array:
        """Fitted chance of a find at each size."""
        return np.asarray(1.0 / (1.0 + np.exp(-self.slope * (np.log(size) - self.middle))))


def fit_logistic(size: Array, found: Array) -> tuple[float, float]:
    """Slope and middle (logarithm of size) of a logistic curve, weakly held to sane values."""
    dose = np.log(size)

    def cost(parameters: Array) -> tuple[float, Array]:
        log_slope, middle = parameters
        slope = np.exp(log_slope)
        score = slope * (dose - middle)
        likelihood = np.sum(found * score - np.logaddexp(0.0, score))
        prior = 0.5 * ((log_slope - 0.7) / 0.7) ** 2 + 0.5 * ((middle - 0.5) / 1.5) ** 2
        missed = found - expit(score)
        gradient = [
            (log_slope - 0.7) / 0.7**2 - np.sum(missed * score),
            (middle - 0.5) / 1.5**2 + slope * np.sum(missed),
        ]
        return float(prior - likelihood), np.array(gradient)

    best = minimize(cost, [0.7, 0.5], jac=True, method="BFGS", options={"gtol": 1e-8})
    return float(np.exp(best.x[0])), float(best.x[1])


def dose_response(title: str, judged: Sequence[Judged], seed: int = 0) -> Dose | None:
    """Curve of the single effects among `judged`; None of too few cases, or of one size only."""
    cases = [j for j in judged if j.stratum == "single" and j.size > 0.0]
    if len(cases) < FEWEST or len({j.size for j in cases}) == 1:
        return None
    size = np.array([j.size for j in cases])
    found = np.array([float(j.found) for j in cases])
    slope, middle = fit_logistic(size, found)
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(RESAMPLES if len(cases) >= 20 else 60):
        pick = rng.integers(0, len(cases), len(cases))
        drawn.append(_sizes(*fit_logistic(size[pick], found[pick])))
    low, high = np.quantile(np.array(drawn), [0.025, 0.975], axis=0)
    half, ninety = _sizes(slope, middle)
    levels = sorted(set(size.tolist()))
    return Dose(
        title=title,
        half=half,
        half_interval=(float(low[0]), float(high[0])),
        ninety=ninety,
        ninety_interval=(float(low[1]), float(high[1])),
        sizes=tuple(levels),
        finds=tuple(int(found[size == s].sum()) for s in levels),
        trials=tuple(int((size == s).sum()) for s in levels),
        slope=slope,
        middle=middle,
    )


def _sizes(slope: float, middle: float) -> tuple[float, float]:
    return float(np.exp(middle)), float(np.exp(middle + np.log(9.0) / slope))
