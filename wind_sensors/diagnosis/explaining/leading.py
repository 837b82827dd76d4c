"""Which of several explanations leads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wind_sensors.diagnosis.explaining.acceptance import (
    brought,
    calms_too_much,
    inexactness,
    is_plausible,
    needed_gain,
    owed,
    passing_gain,
)
from wind_sensors.diagnosis.explaining.explanation import (
    CLEARLY_BETTER,
    EQUAL_SHARE,
    Judged,
    empty_fit,
    judged,
    penalised_deviance,
)
from wind_sensors.diagnosis.explaining.fitting import Fit, fit
from wind_sensors.diagnosis.explaining.onsets import ONSET_GAIN, ONSET_SHARE
from wind_sensors.diagnosis.explaining.ruled_out import ruled_out
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.regions import region_bank

STANDS_OUT = 0.05
"""Probability, on a healthy day, of the strongest region below which it asks for an explanation."""

NEARLY_AS_WELL = 4.0
"""What holds throughout explains nearly as much as what begins or ends, beyond what its edges cost,
if it brings less by no more than this."""

NEARLY_AS_WELL_BESIDE = 25.0
"""The same beside another effect, whose own form may err in a part of the record."""

AS_MUCH = 6.0
"""Of explanations that bring less by no more than this, the region that stands out decides."""

HARDLY_BY_CHANCE = 0.005
NEARLY_ENOUGH = 0.75
"""Where the strongest region has no larger probability on a healthy day (none of 73 healthy
recordings has one), an explanation of it that brings this share of what a name needs is enough."""

EXPLAINED = 0.5
"""Share of the region's score below which what is left is no more than its noise."""


def leader_of(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    ranked: Sequence[Judged],
) -> Judged | None:
    """The explanation that brings most of those that bring enough; None: there is none.

    What the signals tell by themselves comes first. Of the others only those compete that are not
    clearly behind in likelihood; of those that bring the same the likeliest leads. One that is both
    simpler and likelier leads in any case; than what contains it, it may be a little less likely.

    Args:
        searcher: The search.
        whitener: The null of the terms so far.
        current: The terms so far.
        ranked: Explanations with one more, best first.
    """
    so_far = penalised_deviance(current, whitener)
    enough: list[tuple[float, Judged]] = []
    nearly: list[tuple[float, Judged]] = []
    likeliest = np.inf
    for one in sorted(ranked, key=not_told):
        told = one.fit.terms[-1].is_told
        if one.penalised_deviance > likeliest + CLEARLY_BETTER:
            break
        brings = brought(searcher, one, current, so_far)
        newest = one.fit.terms[-1]
        least = max(
            needed_gain(current, newest, searcher.baseline),
            passing_gain(newest, beside=bool(current.terms)),
            inexactness(searcher, whitener, current, one.fit),
        )
        if brings >= least and told:
            return one
        if brings >= NEARLY_ENOUGH * least:
            nearly.append((brings, one))
        if brings >= least:
            enough.append((brings, one))
            likeliest = min(likeliest, one.penalised_deviance)
    if not enough:
        return None if current.terms else _hardly_by_chance(searcher, whitener, current, nearly)
    enough = [
        pair
        for pair in enough
        if not _holds_always_as_well(
            pair[1], enough, _as_well(current, so_far - pair[1].penalised_deviance)
        )
    ]
    enough = explaining_what_stands_out(searcher, whitener, current, enough)
    most = max(brings for brings, _ in enough)
    leader = next(one for brings, one in enough if brings >= (1.0 - EQUAL_SHARE) * most)
    simpler = [
        one
        for _, one in enough
        if one.fit.active < leader.fit.active
        and one.penalised_deviance
        < leader.penalised_deviance + owed(leader.fit.terms[-1], one.fit.terms[-1])
    ]
    return min(simpler, key=lambda one: one.penalised_deviance, default=leader)


def _hardly_by_chance(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    nearly: list[tuple[float, Judged]],
) -> Judged | None:
    """What brings nearly enough and explains a region that no healthy day shows; None: nothing.

    What is compared everywhere and the region that stands out tell of one thing in two ways: a
    vane's friction, small in the whole record, and the small turns of a lull.

    Args:
        searcher: The search.
        whitener: The null.
        current: Without a term.
        nearly: What each brings, and the explanation.
    """
    if not nearly:
        return None
    explaining = _explaining_strongest(searcher, whitener, current, nearly, HARDLY_BY_CHANCE)
    return max(explaining, key=lambda pair: pair[0])[1] if explaining else None


def _explaining_strongest(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    rivals: list[tuple[float, Judged]],
    probability: float,
) -> list[tuple[float, Judged]]:
    """Those that explain most of the strongest region; none, where chance may well have made it.

    Args:
        searcher: The search.
        whitener: The null of the terms so far.
        current: The terms so far.
        rivals: What each brings, and the explanation.
        probability: Of the region on a healthy day, at most.
    """
    bank = region_bank(whitener, searcher.bank.without)
    before = bank.scores(current.vector)
    strongest = int(np.argmax(before))
    score = float(before[strongest])
    if bank.p_value(score) > probability:
        return []

    def left(one: Judged) -> float:
        return float(bank.scores(whitener.of(one.fit.simulated))[strongest])

    return [pair for pair in rivals if left(pair[1]) < EXPLAINED * score]


def explaining_what_stands_out(
    searcher: Searcher,
    whitener: Whitener,
    current: Fit,
    enough: list[tuple[float, Judged]],
    near: float = AS_MUCH,
) -> list[tuple[float, Judged]]:
    """Of explanations that bring as much as the best, those of the region that stands out.

    Args:
        searcher: The search.
        whitener: The null of the terms so far.
        current: The terms so far.
        enough: What each brings, and the explanation.
        near: What brings less than the best by no more than this brings as much.
    """
    most = max(brings for brings, _ in enough)
    rivals = [pair for pair in enough if pair[0] > most - near]
    if len({one.fit.terms[-1].key for _, one in rivals}) < 2:
        return enough
    return _explaining_strongest(searcher, whitener, current, rivals, STANDS_OUT) or enough


def leading_alone(searcher: Searcher, left: Fit, alone: Sequence[Term]) -> Fit:
    """The single effect that is left of two, or the one that led before the second came.

    Where the first explains what stands out and the other does not, only one that brings clearly
    more takes its place.

    Args:
        searcher: The search.
        left: What is left of the explanation by two effects.
        alone: The single effect that led.
    """
    if left.terms[0].key == alone[0].key:
        return left
    whitener = searcher.whitener(searcher.bank.without)
    nothing = empty_fit(whitener, searcher)
    so_far = penalised_deviance(nothing, whitener)
    first = fit(whitener, searcher.station, alone, searcher.bank.without)
    rivals = [
        (brought(searcher, one, nothing, so_far), one) for one in judged(searcher, [left, first])
    ]
    rivals = explaining_what_stands_out(searcher, whitener, nothing, rivals, CLEARLY_BETTER)
    return max(rivals, key=lambda rival: rival[0])[1].fit


def _as_well(current: Fit | None, gain: float) -> float:
    """By how much less an effect may bring that always holds, to be as good as one that passes.

    Args:
        current: The terms so far.
        gain: What the one that passes brings.
    """
    least = NEARLY_AS_WELL_BESIDE if current is not None and current.terms else NEARLY_AS_WELL
    return max(least, ONSET_SHARE * gain)


def _holds_always_as_well(
    one: Judged, others: Sequence[tuple[float, Judged]], near: float
) -> bool:
    """Whether an effect that passes would explain nearly as much if it always held."""
    newest = one.fit.terms[-1]
    if newest.interval == ALWAYS or newest.effect.legible:
        return False
    return any(
        other.fit.terms[-1].key == newest.key
        and other.fit.terms[-1].interval == ALWAYS
        and other.penalised_deviance < one.penalised_deviance + near
        for _, other in others
    )


def held_throughout(
    searcher: Searcher,
    one: Judged,
    named: Fit | None,
    gain: float = 0.0,
    others: Sequence[Judged] = (),
) -> Judged:
    """The explanation with its last effect all the time, where that explains nearly as much.

    A fit that has to find a large effect from a small one may go astray over the whole record and
    arrive in a part of it. An interval that the raw signals show by themselves stays unless the
    whole record explains clearly more; and what would take away eddies that the signals have, or
    what the raw signals rule out elsewhere, holds in its part only.

    Args:
        searcher: The search.
        one: An explanation.
        named: The terms so far; None: there are none.
        gain: What it brings.
        others: Explanations that were found with it, the same effect all the time among them.
    """
    newest = one.fit.terms[-1]
    if newest.interval == ALWAYS:
        return one
    read = any(guess.interval != ALWAYS for guess in searcher.guesses.get(newest.key, ()))
    always = [
        other
        for other in others
        if other.fit.terms[-1].key == newest.key and other.fit.terms[-1].interval == ALWAYS
    ]
    if not newest.effect.legible:
        terms = (*one.fit.terms[:-1], replace(newest, interval=ALWAYS))
        again = fit(one.whitener, searcher.station, terms, searcher.bank.without)
        always += judged(searcher, [again], named)
    allowed = -ONSET_GAIN if read else _as_well(named, gain)
    before = named if named is not None else empty_fit(one.whitener, searcher)
    as_well = [
        other
        for other in always
        if is_plausible(other.fit.terms[-1])
        and other.penalised_deviance < one.penalised_deviance + allowed
        and not calms_too_much(searcher, other, before)
        and not ruled_out(searcher.comparison, searcher.station, other.fit.terms)
    ]
    return min(as_well, key=lambda other: other.penalised_deviance, default=one)


def not_told(one: Judged) -> bool:
    """Sorts what the signals tell by themselves before what only a fit says."""
    return not one.fit.terms[-1].is_told
