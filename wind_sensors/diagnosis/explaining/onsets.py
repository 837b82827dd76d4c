"""Effects that begin or end inside the record."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.explaining.acceptance import plausible
from wind_sensors.diagnosis.explaining.explanation import penalised_cost, seen_in
from wind_sensors.diagnosis.explaining.fitting import Fit, cost_of, fit
from wind_sensors.diagnosis.explaining.intervals import (
    NEAR_AN_END,
    IntervalGains,
    cell_signatures,
    interval_gains,
    interval_of,
    window_of,
)
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.screening import (
    JOINT_TEMPLATES,
    Key,
    Score,
    group_sizes,
    starting_values,
)
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_INTERVAL, Searcher
from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener

FloatArray = npt.NDArray[np.float64]

WINDOW_STEP = 30.0
"""Onsets and endings are screened every so many seconds."""

SHORTEST_WINDOW = 60.0
"""What lasts less [s] tells an effect badly from a gust."""

WINDOW_CANDIDATES = 4
"""So many effects are fitted in a part of the record, those that promise most there."""

WINDOW_ADVANTAGE = 12.0
"""They must promise so much more there than if they always held: as much as a beginning or an end
must bring (`CLEARLY_BETTER`)."""

SMOOTHING_WINDOW_ADVANTAGE = 18.0
"""The same if they smooth: for some minutes the reference sees other eddies than the
instrument."""

LEAST_WINDOW_GAIN = 20.0
"""And so much in all: one edge costs half of it."""

ONSET_GAIN = 20.0
"""What a beginning or an end of a named effect must bring beyond its cost."""

ONSET_SHARE = 0.01
"""And this share of what the effect brings: one that is not there for half a minute of a quarter of
an hour would miss more if it always held, and the form of large ones errs by as much."""

REFINING_STEPS = (15.0, 4.0, 1.0)
"""Distances [s] between the beginnings and ends that are tried around the best so far."""

REFINING_REACH = 8
"""So many of them on either side."""

PARTS_TRIED = 8
"""Beginnings and ends that are tried without screening lie at these parts of the record."""

JUMP_REACH = 4.0
"""Stamps of a clock that begins or stops to be wrong jump within so many seconds [s] of where it
fits best when the jump itself is left out."""

JUMP_STEP = 0.2
"""They are placed to this share of a bin: one interval between pulses holds the jump."""


@dataclass(frozen=True)
class _Span:
    """The interval in which an effect gains most beyond the cost of its beginning and end.

    Attributes:
        gain: Linear, without the cost.
        net: With it.
        window: [s since the first bin].
        amplitudes: Of its templates.
    """

    gain: float
    net: float
    window: tuple[float, float]
    amplitudes: FloatArray


def _best_span(found: IntervalGains, shortest: float) -> _Span | None:
    """The best interval that is not the whole record; None: there is none."""
    cuts = found.cuts
    last = cuts.size - 1
    place = np.arange(cuts.size)
    edges = (place[:, None] > 0).astype(int) + (place[None, :] < last)
    long_enough = cuts[None, :] - cuts[:, None] >= shortest
    net = np.where((edges > 0) & long_enough, found.gains - PENALTY_PER_INTERVAL * edges, -np.inf)
    begin, end = np.unravel_index(int(np.argmax(net)), net.shape)
    if not np.isfinite(net[begin, end]):
        return None
    return _Span(
        float(found.gains[begin, end]), float(net[begin, end]),
        (float(cuts[begin]), float(cuts[end])), found.amplitudes[begin, end],
    )


def _screening_cuts(searcher: Searcher) -> FloatArray:
    length = searcher.comparison.grid.n * searcher.comparison.grid.dt
    return np.append(np.arange(0.0, length - 0.5 * WINDOW_STEP, WINDOW_STEP), length)


def window_starts(
    searcher: Searcher, whitener: Whitener, vector: FloatArray, used: set[tuple[str, str]]
) -> list[list[Term]]:
    """Effects that explain clearly more when they hold in a part of the record only.

    Args:
        searcher: The search.
        whitener: The null.
        vector: White vector of what is to be explained.
        used: Effects and instruments that are named already.

    Returns:
        Starting points of the most promising, several for each.
    """
    always = {(s.effect, s.instrument): s.gain for s in searcher.scores(whitener, vector)}
    cuts = _screening_cuts(searcher)
    groups = [
        (key, multiple, members)
        for (key, multiple), members in group_sizes(searcher.probes.templates).items()
        if key not in used and not searcher.effects[key[0]].legible
    ]

    def starts_of(group: tuple[Key, float, list[int]]) -> tuple[float, list[Term]] | None:
        key, multiple, members = group
        bank = searcher.probes
        effect = searcher.effects[key[0]]
        cells = [
            whitener.through_standing(
                cell_signatures(
                    searcher.comparison, bank.without, bank.with_each[k], whitener.trust, cuts
                )
            )
            for k in members
        ]
        joint = len(members) <= JOINT_TEMPLATES
        span = _best_span(interval_gains(cuts, cells, vector, joint), SHORTEST_WINDOW)
        advantage = SMOOTHING_WINDOW_ADVANTAGE if effect.smooths else WINDOW_ADVANTAGE
        if span is None or span.gain < max(
            always.get(key, 0.0) + advantage, LEAST_WINDOW_GAIN
        ):
            return None
        amplitudes = {
            bank.templates[k].number: multiple * float(a)
            for k, a in zip(members, span.amplitudes, strict=True) if a != 0.0
        }
        template = bank.templates[members[int(np.argmax(np.abs(span.amplitudes)))]]
        score = Score(
            *key, span.gain, amplitudes, template, amplitudes.get(template.number, 0.0)
        )
        interval = interval_of(searcher.comparison, *span.window)
        starts = [Term(effect, key[1], starting_values(score, searcher.comparison.drive), interval)]
        starts += [replace(g, interval=interval) for g in searcher.guesses.get(key, ())]
        return span.net, starts

    found: dict[Key, tuple[float, list[Term]]] = {}
    each = in_parallel(starts_of, groups, searcher.workers, work=lambda group: len(group[2]))
    for (key, _, _), one in zip(groups, each, strict=True):
        if one is not None and (key not in found or one[0] > found[key][0]):
            found[key] = one
    ranked = sorted(found.values(), key=lambda pair: -pair[0])
    return [starts for _, starts in ranked[:WINDOW_CANDIDATES]]


def _around(edge: float, step: float, low: float, high: float) -> FloatArray:
    """Places around an edge, none near the ends of the record."""
    places = edge + step * np.arange(-REFINING_REACH, REFINING_REACH + 1)
    return np.asarray(places[(places > low + NEAR_AN_END) & (places < high - NEAR_AN_END)])


def refined_interval(searcher: Searcher, whitener: Whitener, candidate: Fit) -> Fit:
    """The fit with its last term's beginning and end where they fit best.

    First a coarse search that may also give it an end, or a beginning, that it did not have; then
    finer ones around what it has.

    Args:
        searcher: The search.
        whitener: The null.
        candidate: The fit.
    """
    comparison = searcher.comparison
    fixed = candidate.terms[:-1]
    if not any(parameter.graded for parameter in candidate.terms[-1].effect.parameters):
        return _by_trial(searcher, whitener, candidate)
    without = comparison.possible(planted(searcher.station, fixed))
    if without is None:
        return candidate
    best = candidate
    proposed = {candidate.terms[-1].interval}
    always: Simulated | None = None
    for step in (WINDOW_STEP, *REFINING_STEPS):
        if always is None:
            endless = replace(best.terms[-1], interval=ALWAYS)
            always = comparison.possible(planted(searcher.station, [*fixed, endless]))
        if always is None:
            break
        window = _best_window(
            searcher, whitener, (without, always), best.terms[-1].interval, step
        )
        if window is None:
            break
        interval = interval_of(searcher.comparison, *window)
        proposed.add(interval)
        if interval in (best.terms[-1].interval, ALWAYS):
            continue
        moved = replace(best.terms[-1], interval=interval)
        trial = fit(
            whitener, searcher.station, [*fixed, moved], searcher.bank.without, iterations=2
        )
        if penalised_cost(trial) < penalised_cost(best):
            best, always = trial, None
    if moves_a_clock(best):
        best = _at_the_jump(searcher, whitener, best, proposed - {ALWAYS})
    return best


def moves_a_clock(candidate: Fit) -> bool:
    """Whether a fit's last term is of a clock: its moments are sought one by one, for long."""
    return candidate.terms[-1].effect.entrance == "clock"


def in_a_part(searcher: Searcher, whitener: Whitener, candidate: Fit) -> Fit:
    """The fit with its last term beginning or ending inside the record, where that costs least.

    Tried as it is, part by part: what is seen in statistics of the whole record (how a vane turns)
    no sum of parts tells.

    Args:
        searcher: The search.
        whitener: The null.
        candidate: The fit, with a last term that always holds.
    """
    comparison = searcher.comparison
    *fixed, last = candidate.terms
    length = comparison.grid.n * comparison.grid.dt
    cuts = np.linspace(0.0, length, PARTS_TRIED + 1)[1:-1]
    windows = [(0.0, cut) for cut in cuts] + [(cut, length) for cut in cuts]

    def cost(window: tuple[float, float]) -> float:
        held = replace(last, interval=interval_of(comparison, *window))
        return cost_of(whitener, searcher.station, [*fixed, held])

    costs = in_parallel(cost, windows, searcher.workers)
    passing = replace(last, interval=interval_of(comparison, *windows[int(np.argmin(costs))]))
    trial = fit(whitener, searcher.station, [*fixed, passing], searcher.bank.without)
    return refined_interval(searcher, whitener, trial)


def _by_trial(searcher: Searcher, whitener: Whitener, candidate: Fit) -> Fit:
    """The fit with its last term, which comes in no sizes, where it costs least, each place tried.

    A vane that counts the other way turns round elsewhere, so that what it does in two parts of the
    record is not the sum of what it does in each.

    Args:
        searcher: The search.
        whitener: The null.
        candidate: The fit.
    """
    comparison = searcher.comparison
    *fixed, last = candidate.terms
    length = comparison.grid.n * comparison.grid.dt

    def cost(window: tuple[float, float]) -> float:
        if window[1] - window[0] < SHORTEST_WINDOW:
            return np.inf
        edges = (window[0] > 0.0) + (window[1] < length)
        held = replace(last, interval=interval_of(comparison, *window))
        reached = cost_of(whitener, searcher.station, [*fixed, held])
        return reached + PENALTY_PER_INTERVAL * edges

    begin, end = window_of(comparison, last.interval)
    for step in (WINDOW_STEP, WINDOW_STEP, *REFINING_STEPS):
        for begins in (True, False):
            edge = begin if begins else end
            if step == WINDOW_STEP:
                places = _screening_cuts(searcher)
            else:
                places = np.append(_around(edge, step, 0.0, length), edge)
            tried = [(place, end) if begins else (begin, place) for place in places.tolist()]
            begin, end = tried[int(np.argmin(in_parallel(cost, tried, searcher.workers)))]
    moved = replace(last, interval=interval_of(comparison, begin, end))
    trial = fit(
        whitener, searcher.station, [*fixed, moved], searcher.bank.without, iterations=2
    )
    return trial if penalised_cost(trial) < penalised_cost(candidate) else candidate


def _at_the_jump(
    searcher: Searcher, whitener: Whitener, candidate: Fit, proposed: set[Interval]
) -> Fit:
    """The fit with its last term, of a clock, beginning and ending where the stamps jump.

    A jump at another moment than the measured one leaves two, so that only the right moment, within
    a bin, costs less than a wrong one far away.

    Args:
        searcher: The search.
        whitener: The null.
        candidate: The fit.
        proposed: Intervals near which the jumps may be.
    """
    comparison = searcher.comparison
    *fixed, last = candidate.terms
    best, lowest = last.interval, candidate.cost
    dt = comparison.grid.dt

    def cost(interval: Interval) -> float:
        held = replace(last, interval=interval)
        return cost_of(whitener, searcher.station, [*fixed, held])

    for begins in (True, False):
        edges = {i[0] if begins else i[1] for i in proposed} - {0.0, None}
        for reach, step in ((JUMP_REACH, dt), (dt, JUMP_STEP * dt)):
            steps = round(reach / step)
            moves = step * np.arange(-steps, steps + 1)
            places = np.unique(np.round([e + moves for e in edges if e is not None], 3))
            tried = [(p, best[1]) if begins else (best[0], p) for p in places.tolist()]
            costs = in_parallel(cost, tried, searcher.workers)
            if min(costs, default=np.inf) < lowest:
                best, lowest = tried[int(np.argmin(costs))], min(costs)
            edges = {best[0] if begins else best[1]} if edges else edges
    if best == last.interval:
        return candidate
    moved = [*fixed, replace(last, interval=best)]
    trial = fit(whitener, searcher.station, moved, searcher.bank.without, iterations=2)
    return trial if penalised_cost(trial) < penalised_cost(candidate) else candidate


def _best_window(
    searcher: Searcher,
    whitener: Whitener,
    simulated: tuple[Simulated, Simulated],
    interval: Interval,
    step: float,
) -> tuple[float, float] | None:
    """Where an effect gains most [s since the first bin]; None: there is no room to search.

    Args:
        searcher: The search.
        whitener: The null.
        simulated: Without the effect, and with it all the time.
        interval: Where it holds so far.
        step: Distance of beginnings and ends [s]; at `WINDOW_STEP` anywhere in the record, below
            around what there is.
    """
    comparison = searcher.comparison
    without, always = simulated
    since = comparison.drive.elapsed
    length = comparison.grid.n * comparison.grid.dt
    begin, end = interval
    if step == WINDOW_STEP:
        first = last = _screening_cuts(searcher)
    else:
        first = np.zeros(1) if begin <= 0.0 else _around(begin - since, step, 0.0, length)
        last = np.array([length]) if end is None else _around(end - since, step, 0.0, length)
    cuts = np.unique(np.concatenate(([0.0], first, last, [length])))
    cells = cell_signatures(comparison, without, always, whitener.trust, cuts)
    gains = interval_gains(
        cuts, [whitener.through_standing(cells)], whitener.of(without), joint=False
    )
    if step == WINDOW_STEP:
        span = _best_span(gains, SHORTEST_WINDOW)
        return None if span is None else span.window
    allowed = np.isin(cuts, first)[:, None] & np.isin(cuts, last)[None, :]
    allowed &= cuts[None, :] - cuts[:, None] >= SHORTEST_WINDOW
    if not allowed.any():
        return None
    net = np.where(allowed, gains.gains, -np.inf)
    i, j = np.unravel_index(int(np.argmax(net)), net.shape)
    return float(cuts[i]), float(cuts[j])


def with_interval(searcher: Searcher, current: Fit) -> Fit:
    """The explanation with beginnings and ends where its effects only hold for a while.

    Judged in the null in which the effects need not have the simulation's exact form, so that a
    wrong form does not pass for an interval.

    Args:
        searcher: The search.
        current: The explanation.
    """
    waiting = [term.key for term in current.terms]
    while waiting:
        terms = [next(t for t in current.terms if t.key == key) for key in waiting]
        passing = in_parallel(
            partial(_passing, searcher, current), terms, searcher.workers
        )
        # What one leaves may be the others' interval: they are asked again beside it.
        first = next((k for k, found in enumerate(passing) if found is not None), None)
        if first is None:
            break
        current = passing[first]
        waiting = waiting[first + 1 :]
    return current


def _passing(searcher: Searcher, current: Fit, term: Term) -> Fit | None:
    """The explanation with one of its terms beginning or ending; None: it always holds.

    Args:
        searcher: The search.
        current: The explanation.
        term: One of its terms.
    """
    if term.interval != ALWAYS or term.effect.legible:
        return None
    comparison = searcher.comparison
    whitener = searcher.whitener(current.simulated, current)
    known = seen_in(whitener, current)
    others = [t for t in current.terms if t.key != term.key]
    without = comparison.possible(planted(searcher.station, others))
    if without is None:
        return None
    start = whitener.of(without)
    cuts = _screening_cuts(searcher)
    cells = cell_signatures(comparison, without, current.simulated, whitener.trust, cuts)
    gains = interval_gains(cuts, [whitener.through_standing(cells)], start, joint=False)
    span = _best_span(gains, SHORTEST_WINDOW)
    before = float(start @ start)
    # Not in the null, which lets the effect have another size.
    gain = np.sum(whitener.noise_whitened(without) ** 2)
    gain -= np.sum(whitener.noise_whitened(current.simulated) ** 2)
    least = max(ONSET_GAIN, ONSET_SHARE * float(gain))
    if span is None or known.cost - (before - span.net) < least:
        return None
    interval = interval_of(comparison, *span.window)
    passing = replace(term, interval=interval)
    if ruled_out(comparison, searcher.station, [*others, passing]):
        return None
    trial = fit(whitener, searcher.station, [*others, passing], searcher.bank.without)
    trial = refined_interval(searcher, whitener, trial)
    always = fit(whitener, searcher.station, current.terms, searcher.bank.without, known=current)
    if penalised_cost(trial) < penalised_cost(always) - least and plausible(trial):
        return trial
    return None
