"""Naming in a pair: effects that explain blocks of the record they were not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import stats

from wind_sensors.diagnosis.effects.definition import Effect, entry_of
from wind_sensors.diagnosis.fitting import ALWAYS, Interval, Term, planted
from wind_sensors.diagnosis.means.averages import BoolArray
from wind_sensors.diagnosis.means.pair import Pair
from wind_sensors.diagnosis.means.pair_effects import SINCE_A_MOMENT
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
Residual = Callable[[Station, BoolArray], FloatArray]

CLIP = 3.0
"""Residuals count no further than so many standard deviations."""

FAMILY_P = 0.01
"""Probability that the best of all templates looks so good by chance."""

EQUAL_T = 2.0
"""Explanations whose block-wise difference is smaller than so many standard errors are equal."""

EQUAL_SHARE = 0.05
"""So are those that lose less than this share of the winner's gain."""

SMALLEST_KEPT = 0.1
"""Terms below the smallest size worth reporting are kept in the model, or a larger one would take
their place; below this share of it they are not worth a parameter."""

SMALLEST_GAIN = 0.005
"""Share of the whole cost that a term must remove from held-out blocks."""

HEALTHY_PARTS = 3
HEALTHY_FACTOR = 2.5
"""A finding must be so many times as large as the largest in the parts of a healthy record."""

MOST_TERMS = 7
CANDIDATES = 9
DRAWS = 999


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


@dataclass(frozen=True)
class Candidate:
    """An effect on an instrument that the screening found promising."""

    term: Term
    gain: float


@dataclass(frozen=True)
class Screened:
    """Result of a screening: candidates, best first, and the family's p value."""

    candidates: tuple[Candidate, ...]
    p: float


def _windows(bench: Bench) -> list[Interval]:
    """From each block's beginning on, and until there; the first and last few excepted."""
    edges = [float(bench.elapsed[bench.block == b].min()) for b in range(bench.blocks)]
    step = max(1, bench.blocks // 24)
    inner = edges[3:-2:step]
    return [(e, None) for e in inner] + [(0.0, e) for e in inner]


def _sums(values: FloatArray, block: npt.NDArray[np.intp], count: int) -> FloatArray:
    return np.asarray(np.bincount(block, values, count), dtype=np.float64)


def screen(
    bench: Bench,
    effects: dict[str, Effect],
    instruments: Sequence[str],
    terms: Sequence[Term],
    constant: bool = True,
    seed: int = 1,
) -> Screened:
    """Score every template, block by block.

    Args:
        bench: Rows.
        effects: Catalogue.
        instruments: Which ones may have them.
        terms: What has been named already.
        constant: Whether effects that always hold can be seen; otherwise only beginnings and
            endings.
        seed: Of the sign flips.
    """
    base = planted(bench.station, terms)
    everything = bench.everything
    before = bench.residual(base, everything)
    change = bench.change(base)
    psi = np.clip(before / bench.noise, -CLIP, CLIP)
    rows: list[tuple[FloatArray, FloatArray, Term]] = []
    for name, effect in effects.items():
        for instrument in instruments:
            if not effect.applies(entry_of(base, instrument), base):
                continue
            for template in effect.templates:
                term = Term(effect, instrument, template)
                signature = -change(term.planted(base))
                g = signature / bench.noise
                score, power = psi * g, g * g
                windows = [ALWAYS] if constant else []
                if name in SINCE_A_MOMENT:
                    windows += _windows(bench)
                s = _sums(score, bench.block, bench.blocks)
                i = _sums(power, bench.block, bench.blocks)
                starts = np.array(
                    [bench.elapsed[bench.block == b].min() for b in range(bench.blocks)]
                )
                for window in windows:
                    inside = starts >= window[0]
                    if window[1] is not None:
                        inside &= starts < window[1]
                    rows.append((s * inside, i * inside, replace(term, interval=window)))
    rows = [r for r in rows if r[1].sum() > 1.0]
    if not rows:
        return Screened((), 1.0)
    scores = np.array([r[0] for r in rows])
    powers = np.array([r[1] for r in rows])
    amplitude = scores.sum(axis=1) / powers.sum(axis=1)
    error = np.sqrt(np.sum((scores - amplitude[:, None] * powers) ** 2, axis=1))
    error = np.hypot(error / powers.sum(axis=1), 1e-9)
    t = np.abs(amplitude) / error
    best = float(t.max())
    rng = np.random.default_rng(seed)
    centred = scores - amplitude[:, None] * powers
    spread = np.sqrt(np.sum(centred**2, axis=1)) + 1e-12
    exceed = 0
    for _ in range(0, DRAWS, 111):
        signs = rng.choice((-1.0, 1.0), (111, bench.blocks))
        null = np.abs(signs @ centred.T) / spread
        exceed += int(np.count_nonzero(null.max(axis=1) >= best))
    p = (exceed + 1.0) / (DRAWS + 1.0)
    gain = amplitude**2 * powers.sum(axis=1)
    found: dict[tuple[object, ...], Candidate] = {}
    for k in np.argsort(-gain):
        term, size = rows[k][2], float(amplitude[k])
        sector = round(term.values.get("bearing_from", 0.0) / 60.0) % 6
        key = (*term.key, term.interval == ALWAYS, sector)
        if t[k] < 2.5 or key in found:
            continue
        values = {}
        for parameter in term.effect.parameters:
            value = term.values[parameter.name]
            if parameter.healthy is not None:
                value = parameter.healthy + size * (value - parameter.healthy)
                # A quadratic effect (friction) starts from the root of its linear amplitude.
                if term.effect.name == "bearing_friction":
                    value = term.values[parameter.name] * float(np.sqrt(max(size, 0.01)))
                value = float(np.clip(value, parameter.low, parameter.high))
            values[parameter.name] = value
        hidden = {k: v for k, v in term.values.items() if k not in values}
        start = replace(term, values={**values, **hidden})
        if start.relative_size > 0.5 * SMALLEST_KEPT:
            found[key] = Candidate(start, float(gain[k]))
        if len(found) >= CANDIDATES:
            break
    return Screened(tuple(found.values()), p)


def fit(
    bench: Bench, fixed: Sequence[Term], free: Sequence[Term], rows: BoolArray, rounds: int = 6
) -> tuple[Term, ...]:
    """Fit the parameters of some terms by damped, robust least squares.

    Args:
        bench: Rows.
        fixed: Terms that stay as they are.
        free: Terms to fit.
        rows: Rows that count.
    """
    terms = list(free)
    names = [(k, p) for k, term in enumerate(terms) for p in term.effect.parameters]

    def with_values(values: FloatArray) -> list[Term]:
        out = []
        for k, term in enumerate(terms):
            own = dict(term.values)
            for (j, p), value in zip(names, values, strict=True):
                if j == k:
                    own[p.name] = float(np.clip(value, p.low, p.high))
            out.append(replace(term, values=own))
        return out

    def white(values: FloatArray) -> FloatArray:
        station = planted(bench.station, [*fixed, *with_values(values)])
        return bench.white(station, rows)

    values = np.array([terms[k].values[p.name] for k, p in names])
    now = white(values)
    cost = float(huber(now).sum())
    damping = 1e-3
    for _ in range(rounds):
        jacobian = np.empty((now.size, values.size))
        for j, (_, p) in enumerate(names):
            moved = values.copy()
            step = p.difference if values[j] + p.difference <= p.high else -p.difference
            moved[j] += step
            jacobian[:, j] = (white(moved) - now) / step
        weight = np.minimum(1.0, CLIP / np.maximum(np.abs(now), 1e-9))
        normal = jacobian.T @ (weight[:, None] * jacobian)
        gradient = jacobian.T @ (weight * now)
        scale = np.maximum(np.diag(normal), 1e-12)
        better = False
        for _ in range(4):
            step_by = np.linalg.solve(normal + damping * np.diag(scale), -gradient)
            trial = np.array(
                [np.clip(v, p.low, p.high) for v, (_, p) in
                 zip(values + step_by, names, strict=True)]
            )  # fmt: skip
            then = white(trial)
            new = float(huber(then).sum())
            if new < cost:
                better = cost - new > 1e-4 * cost
                values, now, cost = trial, then, new
                damping = max(damping * 0.2, 1e-6)
                break
            damping *= 10.0
        if not better:
            break
    return tuple(with_values(values))


@dataclass(frozen=True)
class Trial:
    """An explanation and how it does on blocks that it was not fitted to.

    Attributes:
        terms: Fitted to the whole record.
        block_cost: Cost of each block, fitted on the other half of the blocks.
    """

    terms: tuple[Term, ...]
    block_cost: FloatArray

    @property
    def cost(self) -> float:
        """On all blocks."""
        return float(self.block_cost.sum())


def halves(bench: Bench) -> tuple[BoolArray, BoolArray]:
    """Odd and even blocks."""
    odd: BoolArray = bench.block % 2 == 1
    return odd, ~odd


def held_out(
    bench: Bench, fixed: Sequence[Sequence[Term]], free: Sequence[Term], rounds: int = 4
) -> tuple[FloatArray, list[tuple[Term, ...]]]:
    """Cost of each block under a fit to the other half, and those two fits.

    Args:
        bench: Rows.
        fixed: For each half the terms as fitted there before.
        free: Terms to fit in each half.
    """
    cost = np.zeros(bench.blocks)
    fits = []
    sides = halves(bench)
    for k in (0, 1):
        own = fit(bench, fixed[k], free, sides[k], rounds) if free else ()
        fits.append((*fixed[k], *own))
        other = sides[1 - k]
        white = bench.white(planted(bench.station, fits[k]), other)
        cost += _sums(huber(white), bench.block[other], bench.blocks)
    return cost, fits


@dataclass(frozen=True)
class Named:
    """An accepted term.

    Attributes:
        key: Effect and instrument.
        p: Probability of the best template's score by chance, all templates considered.
        gain: Drop of the cost on held-out blocks, block by block.
        equal: Other explanations of the same, as fitted, with how far they stay behind.
        runner_up: Gain of the best explanation that is not equal, block by block.
    """

    term: Term
    p: float
    gain: FloatArray
    equal: tuple[tuple[Term, float], ...]
    others: tuple[tuple[Term, float], ...]
    runner_up: FloatArray | None


@dataclass(frozen=True)
class Explained:
    """What a search found.

    Attributes:
        terms: Fitted together: the given ones, then in the order in which they were accepted.
        named: How each was accepted.
        cost: Held-out cost of each block after each acceptance; the first without any term.
        p: Of what is left.
    """

    terms: tuple[Term, ...]
    named: tuple[Named, ...]
    cost: tuple[FloatArray, ...]
    p: float


def _t(gain: FloatArray) -> float:
    error = float(np.std(gain, ddof=1)) / np.sqrt(gain.size)
    return float(gain.mean() / max(error, 1e-12))


def search(
    bench: Bench,
    effects: dict[str, Effect],
    instruments: Sequence[str],
    progress: Callable[[float], None] | None = None,
    most: int = MOST_TERMS,
    given: Sequence[Term] = (),
    normal: Callable[[Term], bool] | None = None,
) -> Explained:
    """Add effects while they explain held-out blocks.

    With `given` terms, which are fitted along but not named, only beginnings and endings are
    looked for. A term that is `normal` on healthy days is not accepted.

    A term is accepted when the family-wide p value of its screening and the t value of its gain
    over held-out blocks say so, whatever its size.
    """
    terms = fit(bench, (), given, bench.everything) if given else ()
    cost, fits = held_out(bench, [(), ()], terms)
    costs = [cost]
    named: list[Named] = []
    refused: set[tuple[str, str]] = set()
    p = 1.0
    needed = float(stats.t.ppf(1.0 - 0.005, bench.blocks - 1))
    while len(named) < most:
        screened = screen(bench, effects, instruments, terms, not given)
        p = screened.p
        if p > FAMILY_P:
            break
        trials: list[tuple[Term, FloatArray, list[tuple[Term, ...]]]] = []
        for candidate in screened.candidates:
            taken = any(
                t.key == candidate.term.key and t.effect.name != "wake_shadow" for t in terms
            )
            if candidate.term.key in refused or (taken and candidate.term.interval == ALWAYS):
                continue
            cost, both = held_out(bench, fits, (candidate.term,))
            whole = fit(bench, terms, (candidate.term,), bench.everything, 4)[0]
            trials.append((whole, costs[-1] - cost, both))
        trials = [t for t in trials if _inside(t[0]) and _t(t[1]) > needed]
        if not trials:
            break
        trials.sort(key=lambda t: -float(t[1].sum()))
        best, gain, _ = trials[0]
        if float(gain.sum()) < SMALLEST_GAIN * float(costs[0].sum()):
            break
        equal, others, runner = [], [], None
        for other, its_gain, _ in trials[1:]:
            behind = gain - its_gain
            lost = float(behind.sum()) / float(gain.sum())
            if lost < EQUAL_SHARE or _t(behind) < EQUAL_T:
                equal.append((other, 0.5 * float(behind.sum())))
            else:
                others.append((other, 0.5 * float(behind.sum())))
                runner = its_gain if runner is None else runner
        if normal is not None and normal(best):
            refused.add(best.key)
            continue
        together = fit(bench, (), (*terms, best), bench.everything)
        if not all(_inside(t) for t in together[len(given) :]):
            # Two names for one thing push each other out of what is possible.
            refused.add(best.key)
            continue
        terms = together
        cost, fits = held_out(bench, [(), ()], terms)
        named.append(
            Named(terms[-1], p, costs[-1] - cost, tuple(equal), tuple(others), runner)
        )
        costs.append(cost)
        if progress:
            progress(len(named) / most)
    return Explained(terms, tuple(named), tuple(costs), p)


def is_normal(healthy: Bench) -> Callable[[Term], bool]:
    """Whether a term is no larger than what healthy days show between themselves.

    The same effect is fitted to each third of the healthy record, after the record's standing
    difference has been taken out.
    """
    third = healthy.block * HEALTHY_PARTS // healthy.blocks
    sizes: dict[tuple[str, str], float] = {}

    def normal(term: Term) -> bool:
        if term.key not in sizes:
            start = replace(term, interval=ALWAYS)
            found = [
                fit(healthy, (), (start,), third == k, 4)[0].relative_size
                for k in range(HEALTHY_PARTS)
            ]
            sizes[term.key] = max(found)
        return term.relative_size < HEALTHY_FACTOR * sizes[term.key]

    return normal


def _inside(term: Term) -> bool:
    """Not at the end of what the search allows, and not nothing."""
    if term.relative_size < SMALLEST_KEPT:
        return False
    for p in term.effect.parameters:
        if p.healthy is None and not p.wraps and term.values[p.name] > 0.98 * p.high:
            return False
        if p.healthy is None or p.minimum <= 0.0:
            continue
        margin = 0.005 * (p.high - p.low)
        value = term.values[p.name]
        if abs(value - p.healthy) > margin and not p.low + margin < value < p.high - margin:
            return False
    return True


def intervals(
    bench: Bench, terms: Sequence[Term], seed: int = 1
) -> list[dict[str, tuple[float, float]]]:
    """95 % intervals of all parameters, from the scatter of their scores over blocks."""
    names = [(k, p) for k, term in enumerate(terms) for p in term.effect.parameters]
    if not names:
        return []
    everything = bench.everything
    now = bench.white(planted(bench.station, terms), everything)
    jacobian = np.empty((now.size, len(names)))
    for j, (k, p) in enumerate(names):
        own = dict(terms[k].values)
        step = p.difference if own[p.name] + p.difference <= p.high else -p.difference
        own[p.name] += step
        moved = [replace(t, values=own) if i == k else t for i, t in enumerate(terms)]
        there = bench.white(planted(bench.station, moved), everything)
        jacobian[:, j] = (there - now) / step
    psi = np.clip(now, -CLIP, CLIP)
    bread = np.linalg.pinv(jacobian.T @ jacobian)
    scores = np.array(
        [_sums(jacobian[:, j] * psi, bench.block, bench.blocks) for j in range(len(names))]
    )
    covariance = bread @ (scores @ scores.T) @ bread
    factor = float(stats.t.ppf(0.975, max(bench.blocks - len(names), 2)))
    out: list[dict[str, tuple[float, float]]] = [{} for _ in terms]
    for j, (k, p) in enumerate(names):
        error = factor * float(np.sqrt(max(covariance[j, j], 0.0)))
        value = terms[k].values[p.name]
        out[k][p.name] = (max(value - error, p.low), min(value + error, p.high))
    return out
