"""Robust fits of effects to a bench, on all of it and on halves, and intervals from blocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from wind_sensors.diagnosis.explaining.terms import Term, planted
from wind_sensors.diagnosis.means.averages import BoolArray
from wind_sensors.diagnosis.means.bench import (
    CLIP,
    Bench,
    FloatArray,
    block_sums,
    halves,
    huber,
)


def fit(
    bench: Bench, fixed: Sequence[Term], free: Sequence[Term], rows: BoolArray, rounds: int = 6
) -> tuple[Term, ...]:
    """Fit the parameters of some terms by damped, robust least squares.

    Levenberg-Marquardt steps with Huber's weights, cut off at the bounds. `least_squares` of scipy
    minimises the same (loss `huber`, `f_scale` `CLIP`) in 1.0 to 1.2 times the time, but stops
    elsewhere, and a search in which names nearly tie then takes another way: on the mast of
    docs/real_recordings.md to an angular response at 80 m and a set of three at 40 m.

    Args:
        bench: Rows.
        fixed: Terms that stay as they are.
        free: Terms to fit.
        rows: Rows that count.
        rounds: So many steps are taken at most.
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
            )
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


def held_out(
    bench: Bench, fixed: Sequence[Sequence[Term]], free: Sequence[Term], rounds: int = 4
) -> tuple[FloatArray, list[tuple[Term, ...]]]:
    """Cost of each block under a fit to the other half, and those two fits.

    Args:
        bench: Rows.
        fixed: For each half the terms as fitted there before.
        free: Terms to fit in each half.
        rounds: So many steps each fit takes at most.
    """
    cost = np.zeros(bench.blocks)
    fits = []
    sides = halves(bench)
    for k in (0, 1):
        own = fit(bench, fixed[k], free, sides[k], rounds) if free else ()
        fits.append((*fixed[k], *own))
        other = sides[1 - k]
        white = bench.white(planted(bench.station, fits[k]), other)
        cost += block_sums(huber(white), bench.block[other], bench.blocks)
    return cost, fits


def intervals(bench: Bench, terms: Sequence[Term]) -> list[dict[str, tuple[float, float]]]:
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
        [block_sums(jacobian[:, j] * psi, bench.block, bench.blocks) for j in range(len(names))]
    )
    covariance = bread @ (scores @ scores.T) @ bread
    factor = float(stats.t.ppf(0.975, max(bench.blocks - len(names), 2)))
    out: list[dict[str, tuple[float, float]]] = [{} for _ in terms]
    for j, (k, p) in enumerate(names):
        error = factor * float(np.sqrt(max(covariance[j, j], 0.0)))
        value = terms[k].values[p.name]
        out[k][p.name] = (max(value - error, p.low), min(value + error, p.high))
    return out
