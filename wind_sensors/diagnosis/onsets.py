"""Effects that begin or end inside the record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explanation import plausible, seen_in, total
from wind_sensors.diagnosis.fitting import ALWAYS, Fit, Term, fit, planted
from wind_sensors.diagnosis.screening import (
    group_templates,
    screen,
    screen_windows,
    windowed_signature,
    windows,
)
from wind_sensors.diagnosis.search import PENALTY_PER_INTERVAL, Searcher
from wind_sensors.diagnosis.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

NEAR_AN_END = 8.0
"""A beginning or an end this close to the record's own [s] is none."""

WINDOW_CANDIDATES = 4
WINDOW_ADVANTAGE = 15.0
SMOOTHING_WINDOW_ADVANTAGE = 120.0
LEAST_WINDOW_GAIN = 4.0

ONSET_GAIN = 25.0
"""What a beginning or an end of a named effect must bring beyond its cost."""


def window_starts(
    searcher: Searcher, whitener: Whitener, vector: FloatArray, used: set[tuple[str, str]]
) -> list[list[Term]]:
    """Effects that explain clearly more when they hold in a part of the record only."""
    signatures = searcher.white_signatures(whitener)
    groups = group_templates(searcher.bank.templates)
    power = np.einsum("ij,ij->i", signatures, signatures)
    ranked = []
    length = searcher.comparison.grid.n * searcher.comparison.grid.dt
    since = searcher.comparison.drive.elapsed
    scores = screen(searcher.bank.templates, signatures, vector)
    found: list[tuple[float, list[Term]]] = []
    for score in scores[: 2 * WINDOW_CANDIDATES]:
        key = (score.effect, score.instrument)
        if key in used or score.effect == "stuck_sensor" or score.gain < LEAST_WINDOW_GAIN:
            continue
        members = groups[key]
        strong = sorted(
            (k for k in members if power[k] > 1e-2),
            key=lambda k: -((signatures[k] @ vector) ** 2 / power[k]),
        )[:2]
        if not strong:
            continue
        gain, window, amplitude, which = screen_windows(
            whitener, searcher.bank, strong, vector
        )
        advantage = (
            SMOOTHING_WINDOW_ADVANTAGE
            if searcher.effects[score.effect].smooths
            else WINDOW_ADVANTAGE
        )
        if window is None or gain < score.gain + advantage:
            continue
        template = searcher.bank.templates[which]
        values = dict(template.values)
        for p in template.effect.parameters:
            if p.healthy is not None:
                moved = p.healthy + amplitude * (values[p.name] - p.healthy)
                values[p.name] = float(np.clip(moved, p.low, p.high))
        interval = (
            window[0] + since if window[0] > 0.0 else 0.0,
            None if window[1] >= length else window[1] + since,
        )
        starts = [Term(template.effect, score.instrument, values, interval)]
        starts += [replace(g, interval=interval) for g in searcher.guesses.get(key, ())]
        found.append((gain, starts))
    ranked = sorted(found, key=lambda pair: -pair[0])
    return [starts for _, starts in ranked[:WINDOW_CANDIDATES]]


def refined_interval(
    searcher: Searcher, whitener: Whitener, fixed: Sequence[Term], candidate: Fit
) -> Fit:
    """The fit with its last term's beginning and end moved to where they fit best."""
    best = candidate
    comparison = searcher.comparison
    length = comparison.grid.n * comparison.grid.dt + comparison.drive.elapsed
    for step in (15.0, 5.0, 2.0):
        for side in (0, 1):
            for direction in (-1.0, 1.0):
                for _ in range(3):
                    term = best.terms[-1]
                    start, stop = term.interval
                    if side == 0 and start > 0.0:
                        interval = (max(start + direction * step, 0.1), stop)
                    elif side == 1 and stop is not None:
                        interval = (start, stop + direction * step)
                    else:
                        break
                    if interval[0] < NEAR_AN_END:
                        interval = (0.0, interval[1])
                    if interval[1] is not None and interval[1] > length - NEAR_AN_END:
                        interval = (interval[0], None)
                    if interval[1] is not None and interval[1] - interval[0] < 5.0:
                        break
                    moved = replace(term, interval=interval)
                    trial = fit(
                        whitener, searcher.station, [*fixed, moved],
                        searcher.bank.without, iterations=1,
                    )  # fmt: skip
                    if trial.cost >= best.cost - 0.5:
                        break
                    best = trial
    return best


def with_interval(searcher: Searcher, current: Fit) -> Fit:
    """The explanation with beginnings and ends where its effects only hold for a while.

    Judged in the null in which the effects need not have the simulation's exact form, so that a
    wrong form does not pass for an interval.
    """
    comparison = searcher.comparison
    since = comparison.drive.elapsed
    length = comparison.grid.n * comparison.grid.dt
    at = comparison.grid.centres
    for k, term in enumerate(current.terms):
        if term.interval != ALWAYS or term.effect.name == "stuck_sensor":
            continue
        whitener = searcher.whitener(current.simulated, current.simulated)
        known = seen_in(whitener, current)
        others = [t for j, t in enumerate(current.terms) if j != k]
        without = comparison.simulate(planted(searcher.station, others))
        start = whitener.of(without)
        spans = windows(comparison)
        rows = whitener.through_standing(
            np.array(
                [
                    windowed_signature(
                        comparison, without, current.simulated, whitener.trust,
                        (at >= begin) & (at < end),
                    )
                    for begin, end in spans
                ]
            )
        )  # fmt: skip
        power = np.maximum(np.einsum("ij,ij->i", rows, rows), 1e-2)
        left = float(start @ start) - (rows @ start) ** 2 / power
        best = int(np.argmin(left))
        begin, end = spans[best]
        interval = (
            begin + since if begin > 0.0 else 0.0,
            None if end >= length else end + since,
        )
        edges = (interval[0] > 0.0) + (interval[1] is not None)
        if known.cost - left[best] < ONSET_GAIN + PENALTY_PER_INTERVAL * edges:
            continue
        passing = replace(term, interval=interval)
        trial = fit(whitener, searcher.station, [*others, passing], searcher.bank.without)
        trial = refined_interval(searcher, whitener, trial.terms[:-1], trial)
        always = fit(whitener, searcher.station, current.terms, searcher.bank.without)
        if total(trial) < total(always) - ONSET_GAIN and plausible(trial):
            current = trial
    return current
