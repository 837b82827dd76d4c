"""Screening: scores of every template, block by block, with the whole family's p value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect, entry_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term, planted
from wind_sensors.diagnosis.means.bench import CLIP, Bench, FloatArray, block_sums
from wind_sensors.diagnosis.means.pair_effects import SINCE_A_MOMENT

SMALLEST_KEPT = 0.1
"""Terms below the smallest size worth reporting are kept in the model, or a larger one would take
their place; below this share of it they are not worth a parameter."""

CANDIDATES = 9
"""So many templates are fitted and scored on held-out blocks. A choice: the time of a search is
nearly in proportion to it; with fewer, an explanation that fits as well may not be tried."""

SECTOR = 60.0
"""Of an effect with a bearing one template in each sector so wide [deg] goes on: neighbouring ones
are fitted to the same wake, and must not take the places of other effects. The wakes of a
tower on opposite booms lie some 170 degrees apart."""

PROMISING_T = 2.5
"""Templates whose score is fewer standard errors over blocks are not fitted. A choice below what
held-out blocks ask for (2.6 and more), for a fit improves on the template; a larger one would leave
out explanations whose template is a poor likeness."""

DRAWS = 999
BATCH = 111
"""Of the sign flips, so many are drawn at a time, that their scores fit into memory."""


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
                s = block_sums(score, bench.block, bench.blocks)
                i = block_sums(power, bench.block, bench.blocks)
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
    for drawn in range(0, DRAWS, BATCH):
        signs = rng.choice((-1.0, 1.0), (min(BATCH, DRAWS - drawn), bench.blocks))
        null = np.abs(signs @ centred.T) / spread
        exceed += int(np.count_nonzero(null.max(axis=1) >= best))
    p = (exceed + 1.0) / (DRAWS + 1.0)
    gain = amplitude**2 * powers.sum(axis=1)
    found: dict[tuple[object, ...], Candidate] = {}
    for k in np.argsort(-gain):
        term, size = rows[k][2], float(amplitude[k])
        sector = round(term.values.get("bearing_from", 0.0) / SECTOR) % round(360.0 / SECTOR)
        key = (*term.key, term.interval == ALWAYS, sector)
        if t[k] < PROMISING_T or key in found:
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
