"""Effects that begin or end inside the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explanation import plausible, seen_in, total
from wind_sensors.diagnosis.fitting import ALWAYS, Fit, Interval, Term, fit, planted
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

REFINED_BY = ((60.0, 5.0), (4.0, 1.0))
"""How far beginnings and ends are moved each way, and in which steps [s]."""

REFINEMENTS = 3
"""Largest number of times that an interval is moved and its effect fitted again."""

LEAST_REFINEMENT = 0.5
"""What a moved interval must bring."""

SIZE_CHANGE = (0.5, 2.0)
"""Factors by which an effect's size may change when its interval does."""

SHORTEST_INTERVAL = 5.0
"""[s]"""

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


def refined_interval(searcher: Searcher, whitener: Whitener, candidate: Fit) -> Fit:
    """The fit with its last term's beginning and end moved to where they fit best."""
    best = candidate
    for _ in range(REFINEMENTS):
        interval = _sharpest(searcher, whitener, best)
        if interval == best.terms[-1].interval:
            break
        moved = replace(best.terms[-1], interval=interval)
        trial = fit(
            whitener, searcher.station, [*best.terms[:-1], moved], searcher.bank.without,
            iterations=3,
        )  # fmt: skip
        if trial.cost >= best.cost - LEAST_REFINEMENT:
            break
        best = trial
    return best


def _sharpest(searcher: Searcher, whitener: Whitener, candidate: Fit) -> Interval:
    """The last term's interval with its beginning and end where they explain most.

    Judged without further simulations: the signals follow the station with the effect inside the
    interval and the one without it outside, but for the seconds that an instrument takes to
    settle.
    """
    comparison = searcher.comparison
    *others, passing = candidate.terms
    without, always = (
        comparison.simulate(planted(searcher.station, terms))
        for terms in (others, [*others, replace(passing, interval=ALWAYS)])
    )
    start = whitener.of(without)
    at = comparison.grid.centres + comparison.drive.elapsed
    length = comparison.grid.n * comparison.grid.dt + comparison.drive.elapsed

    def left(interval: Interval) -> float:
        begin, end = interval[0], length if interval[1] is None else interval[1]
        inside = (at >= begin) & (at < end)
        row = whitener.through_standing(
            windowed_signature(comparison, without, always, whitener.trust, inside)
        )
        power = max(float(row @ row), 1e-2)
        amplitude = float(np.clip(row @ start / power, *SIZE_CHANGE))
        rest = start - amplitude * row
        return float(rest @ rest)

    best = passing.interval
    least = left(best)
    for reach, step in REFINED_BY:
        for side in (0, 1):
            middle = best
            for shift in np.arange(-reach, reach + step, step):
                trial = _moved(middle, side, float(shift), length)
                cost = least if trial is None else left(trial)
                if trial is not None and cost < least:
                    best, least = trial, cost
    return best


def _moved(interval: Interval, side: int, shift: float, length: float) -> Interval | None:
    """An interval with its beginning (side 0) or end (1) moved; None: there is none to move.

    Args:
        interval: [s since the start of the recording].
        side: Which edge.
        shift: [s].
        length: End of the record [s since the start of the recording].
    """
    start, stop = interval
    if (start <= 0.0) if side == 0 else (stop is None):
        return None
    if side == 0:
        start = 0.0 if start + shift < NEAR_AN_END else start + shift
    elif stop is not None:
        stop = None if stop + shift > length - NEAR_AN_END else stop + shift
    if (length if stop is None else stop) - start < SHORTEST_INTERVAL:
        return None
    return start, stop


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
        trial = refined_interval(searcher, whitener, trial)
        always = fit(
            whitener, searcher.station, current.terms, searcher.bank.without, known=current
        )
        if total(trial) < total(always) - ONSET_GAIN and plausible(trial):
            current = trial
    return current
