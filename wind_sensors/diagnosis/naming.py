"""From scores to names: accept, compare, remove."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects.definition import Parameter
from wind_sensors.diagnosis.fitting import ALWAYS, Fit, Term, fit
from wind_sensors.diagnosis.screening import group_templates, screen, screen_windows
from wind_sensors.diagnosis.search import (
    PENALTY_PER_FURTHER_PARAMETER,
    PENALTY_PER_INTERVAL,
    PENALTY_PER_PARAMETER,
    Searcher,
)
from wind_sensors.diagnosis.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

ACCEPTED_GAIN = 14.0
"""Drop of the cost beyond its parameters that a name needs; healthy recordings stay below."""

ACCEPTED_FURTHER_GAIN = 22.0
"""The same for a second and a third effect."""

FURTHER_SHARE = 0.05
"""A further effect must also bring this share of the gain so far."""

SMALLEST_SIZE = 0.7
"""In units of the smallest size worth reporting."""

MOST_EFFECTS = 3

NARROW_SHARE = 0.85
"""Effects of single instruments win over broad ones from this share of their gain on, if they
need fewer parameters."""

NEAR_AN_END = 8.0
"""A beginning or an end this close to the record's own [s] is none."""

FIRST_CANDIDATES = 9
LATER_CANDIDATES = 6
WINDOW_CANDIDATES = 4
WINDOW_ADVANTAGE = 15.0
SMOOTHING_WINDOW_ADVANTAGE = 120.0
LEAST_WINDOW_GAIN = 4.0
FINALISTS = 5
FAR_BEHIND = 0.6
"""Fits that miss more than this share of the leader's gain do not compete with it."""

STALL_SPEED = 4.5
"""Up to this wind speed [m/s] a sticking bearing may hold a rotor."""

WORTH_ANOTHER_TURN = 14.0
"""Largest linear score below which no further effect is looked for."""


def parameter_cost(terms: Sequence[Term], parameters: int) -> float:
    """What parameters and intervals cost; a term's second parameter costs more than its first."""
    firsts = min(len(terms), parameters)
    cost = PENALTY_PER_PARAMETER * firsts + PENALTY_PER_FURTHER_PARAMETER * (parameters - firsts)
    for term in terms:
        if term.interval != ALWAYS:
            cost += PENALTY_PER_INTERVAL * sum(
                (term.interval[0] > 0.0, term.interval[1] is not None)
            )
    return cost


def _needed(current: Fit, nothing: float, first: bool) -> float:
    """Gain that the next term has to bring.

    After a large effect the simulation's own inexactness is worth a share of its gain.
    """
    if first:
        return ACCEPTED_GAIN
    return max(ACCEPTED_FURTHER_GAIN, FURTHER_SHARE * (nothing - current.cost))


@dataclass(frozen=True)
class Alternative:
    """An explanation that lost.

    Attributes:
        fit: Its fit.
        behind: How far its penalised cost lies above the winner's.
    """

    fit: Fit
    behind: float


@dataclass(frozen=True)
class Naming:
    """The explanation of a recording.

    Attributes:
        fit: Named terms, fitted; no terms: nothing was accepted.
        whitener: The null in which the fit was made.
        nothing: White vector without any effect, in that null.
        gain: Drop of the cost.
        alternatives: Losers of the last round, for each accepted term, nearest first.
        screened: Best scores of the first screening: effect, instrument, gain.
    """

    fit: Fit
    whitener: Whitener
    nothing: FloatArray
    gain: float
    alternatives: tuple[Alternative, ...] = ()
    screened: tuple[tuple[str, str, float], ...] = field(default=())


def _no_terms(whitener: Whitener, searcher: Searcher) -> Fit:
    vector = whitener.of(searcher.bank.without)
    return Fit((), float(vector @ vector), vector, searcher.bank.without, np.zeros((0, 0)), 0)


def _total(candidate: Fit) -> float:
    return candidate.cost + parameter_cost(candidate.terms, candidate.active)


def value_at(term: Term, parameter: Parameter) -> float:
    """Fitted value of a parameter."""
    return float(term.values[parameter.name])


def _plausible(candidate: Fit) -> bool:
    """Whether the newest term is large enough to matter and its parameters are determined.

    A search that ran into the bounds of a parameter has found the wrong effect.
    """
    term = candidate.terms[-1]
    if term.relative_size < SMALLEST_SIZE:
        return False
    for parameter in term.effect.parameters:
        if parameter.healthy is None or parameter.minimum <= 0.0:
            continue
        margin = 0.005 * (parameter.high - parameter.low)
        if parameter.healthy == 1.0 and value_at(term, parameter) > 0.85 * parameter.high:
            return False
        value = term.values[parameter.name]
        at_bound = value < parameter.low + margin or value > parameter.high - margin
        if at_bound and abs(value - parameter.healthy) > margin:
            return False
    return True


def _window_starts(
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
        found.append((gain, [Term(template.effect, score.instrument, values, interval)]))
    ranked = sorted(found, key=lambda pair: -pair[0])
    return [starts for _, starts in ranked[:WINDOW_CANDIDATES]]


def _is_a_stall(searcher: Searcher, current: Fit, start: Term) -> bool:
    """Whether a rotor's silence is what a braked bearing does in the wind of that time.

    A bearing that sticks lets go later than the simulated friction does.
    """
    braked = any(t.effect.name == "bearing_friction" for t in current.terms)
    if start.effect.name != "stuck_sensor" or not braked:
        return False
    comparison = searcher.comparison
    for channel in comparison.channels:
        if channel.instrument == start.instrument and channel.kind == "rotor_rate":
            at = comparison.grid.centres + comparison.drive.elapsed
            inside = (at > start.values["start"]) & (at < start.values["stop"])
            if not inside.any():
                return False
            return float(np.median(comparison.speed[inside])) < STALL_SPEED
    return False


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


def name(
    searcher: Searcher, progress: Callable[[float], None] | None = None
) -> Naming:
    """Find the effects that explain the recording.

    An effect of the whole station may stand in for two of single instruments. Where it needs the
    help of others, the search runs once more without such effects, and the better one counts.

    Args:
        searcher: Prepared search.
        progress: Called with the share done.
    """
    found = _greedy(searcher, progress, frozenset())
    broad = {t.effect.name for t in found.fit.terms if t.effect.everywhere}
    if not broad or len(found.fit.terms) < 2:
        return found
    narrow = _greedy(
        searcher, progress, frozenset(n for n, e in searcher.effects.items() if e.everywhere)
    )
    simpler = 0 < narrow.fit.active < found.fit.active
    return narrow if simpler and narrow.gain > NARROW_SHARE * found.gain else found


def _greedy(
    searcher: Searcher, progress: Callable[[float], None] | None, excluded: frozenset[str]
) -> Naming:
    """Add the best effect, judge the noise again, and so on while it pays."""
    whitener = searcher.whitener(searcher.bank.without)
    current = _no_terms(whitener, searcher)
    screened = tuple(
        (s.effect, s.instrument, s.gain)
        for s in screen(
            searcher.bank.templates, searcher.white_signatures(whitener), current.vector
        )[:12]
    )
    alternatives: tuple[Alternative, ...] = ()
    for turn in range(MOST_EFFECTS):
        first = turn == 0
        fixed = current.terms
        used = {t.key for t in fixed}
        number = FIRST_CANDIDATES if first else LATER_CANDIDATES
        candidates = [
            starts
            for starts in searcher.single_candidates(whitener, current.vector, number)
            if starts[0].key not in used
            and starts[0].effect.name not in excluded
            and not _is_a_stall(searcher, current, starts[0])
        ]
        windowed = [
            starts
            for starts in _window_starts(searcher, whitener, current.vector, used)
            if starts[0].effect.name not in excluded
        ]
        if not first and not windowed:
            scores = screen(
                searcher.bank.templates, searcher.white_signatures(whitener), current.vector
            )
            if all(s.gain < WORTH_ANOTHER_TURN for s in scores if (s.effect, s.instrument)
                   not in used):
                break
        fits = searcher.fit_all(whitener, fixed, [*candidates, *windowed])
        fits = sorted((f for f in fits if _plausible(f)), key=_total)
        nothing_now = whitener.of(searcher.bank.without)
        needed = _needed(current, float(nothing_now @ nothing_now), first)
        if progress:
            progress((turn + 0.6) / MOST_EFFECTS)
        if not fits or _total(current) - _total(fits[0]) < needed:
            break
        # Noise and coherence were judged with the mismatch still in them: judge again, and let
        # the best few compete in that null.
        refitted: list[Fit] = []
        for _ in range(2):
            leader = (refitted or fits)[0]
            whitener = searcher.whitener(leader.simulated)
            best = _total(leader)
            reach = FAR_BEHIND * (_total(current) - best)
            pool = [f for f in (refitted or fits)[:FINALISTS] if _total(f) - best <= reach]
            null = whitener
            refitted = searcher.refit_all(null, [f.terms for f in pool])
            refitted = [
                refined_interval(searcher, null, f.terms[:-1], f)
                if k < 2 and f.terms[-1].interval != ALWAYS
                else f
                for k, f in enumerate(sorted(refitted, key=_total))
            ]
            refitted = sorted(
                (f for f in refitted if f is leader or _plausible(f)), key=_total
            ) or [leader]
            if refitted[0].terms[-1].key == leader.terms[-1].key:
                break
        before = fit(whitener, searcher.station, fixed, searcher.bank.without) if fixed else (
            _no_terms(whitener, searcher)
        )
        if _total(before) - _total(refitted[0]) < needed or not _plausible(refitted[0]):
            current = before
            break
        current = refitted[0]
        losers = tuple(
            Alternative(f, _total(f) - _total(current)) for f in refitted[1:]
        )
        alternatives = (*alternatives, *losers) if not first else losers
    current, whitener = _pruned(searcher, whitener, current)
    nothing = whitener.of(searcher.bank.without)
    if progress:
        progress(1.0)
    return Naming(
        current, whitener, nothing, float(nothing @ nothing) - current.cost, alternatives, screened
    )


def _pruned(searcher: Searcher, whitener: Whitener, current: Fit) -> tuple[Fit, Whitener]:
    """The fit without terms that later ones made superfluous."""
    while len(current.terms) > 1:
        without = [
            fit(
                whitener, searcher.station,
                [t for j, t in enumerate(current.terms) if j != k], searcher.bank.without,
            )
            for k in range(len(current.terms))
        ]  # fmt: skip
        best = min(without, key=_total)
        if _total(best) - _total(current) > ACCEPTED_GAIN and all(
            t.relative_size >= SMALLEST_SIZE for t in current.terms
        ):
            break
        current = best
    return current, whitener
