"""What is said about one effect: its sizes, where it shows, its rivals, its proof."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.explaining.acceptance import passing_gain
from wind_sensors.diagnosis.explaining.explanation import (
    EQUAL_SHARE,
    Alternative,
    Naming,
)
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, simulated_with
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.proving.proof import Proof, prove
from wind_sensors.diagnosis.regions import Found, RegionBank, strongest

FloatArray = npt.NDArray[np.float64]

LEAST_LIKENESS = 0.4
"""Cosine between the white corrections of two explanations of the same thing. Where two that are
half alike fit as well, neither is all that is wrong."""

INTERVAL_FACTOR = 1.96
"""Standard errors from the middle of a 95 % interval to its ends."""

MISMATCH_FACTOR = 1.25
"""Standard errors are so many times as large as the noise alone would make them, for the simulation
is not exact."""

LEAST_NOISE = 0.95
"""Share of the number of data that the squares of noise alone sum up to at least: what exceeds it
is the misfit of which effects have their shares."""

REPORTED_TOGETHER = 4.0
"""Explanations whose log-likelihoods lie closer are reported together. Where forms are not exact
and the truth may be in no catalogue, less tells no two apart: of 43 leaders on concealed data with
a rival within this, 19 were wrong, of fourteen with the nearest one between this and six, one."""

TOGETHER_WITH_MORE = 1.0
"""The same of a rival with more parameters: it can take more shapes and fits worse all the same. Of
24 on concealed data none was the truth."""

LARGEST_EQUAL = 60.0
"""Explanations are never equal if their penalised deviances differ by more."""


@dataclass(frozen=True)
class Estimate:
    """A fitted parameter with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """One named effect.

    Attributes:
        term: The effect with its values and interval.
        parameters: With intervals, by name.
        located: Where the mismatch shows most; of what begins or ends inside the record, beside
            the other effects.
        share: Share of the whole misfit that the effect removes; NaN where none was fitted.
        p: Probability of the location's score on a healthy day; NaN where nobody computed it.
        alternatives: Other effects and how far their log-likelihood lies behind.
        proof: On held-out blocks; None for a member of an ambiguous set that did not win.
        set_number: Number of the ambiguous set it belongs to, 0 for none.
        gain: Drop of the cost by the effect beside the others; 0 where no cost is fitted.
    """

    term: Term
    parameters: Mapping[str, Estimate]
    located: Found
    share: float
    p: float
    alternatives: tuple[tuple[str, str, float], ...]
    proof: Proof | None
    set_number: int = 0
    gain: float = 0.0


@dataclass(frozen=True)
class Unexplained:
    """What is left over the baseline.

    Attributes:
        p: Probability of the largest remainder on a healthy day.
        share: Its share of the whole misfit.
        regions: Where it shows most.
        description: For people.
    """

    p: float
    share: float
    regions: tuple[Found, ...]
    description: str


def estimates_of(explanation: Fit) -> list[dict[str, Estimate]]:
    """Values with 95 % intervals of what the recording sees, for each term of a fit."""
    out = []
    place = 0
    for term in explanation.terms:
        found = {}
        for parameter in term.effect.parameters:
            variance = float(explanation.covariance[place, place])
            value = term.values[parameter.name]
            departure = 0.0 if parameter.healthy is None else value - parameter.healthy
            noise = MISMATCH_FACTOR * float(np.sqrt(max(variance, 0.0)))
            if parameter.name in term.held and parameter.healthy is None:
                noise = parameter.step
            elif parameter.name in term.held:
                noise = parameter.told_to if departure != 0.0 else np.inf
            elif parameter.value_from == "signals" and parameter.graded:
                noise = 0.0
            elif parameter.value_from == "signals" and parameter.step:
                noise = parameter.step
            # What an inexact form adds to one component of an effect, it takes from others.
            size = max(abs(departure), term.relative_size * parameter.minimum)
            error = INTERVAL_FACTOR * float(np.hypot(noise, term.effect.form_error * size))
            place += 1
            if not np.isfinite(error):
                if parameter.value_from == "forms" and departure != 0.0:
                    # One form of several that were tried: the others are not excluded.
                    found[parameter.name] = Estimate(
                        value, parameter.low, parameter.high, parameter.unit
                    )
                continue
            found[parameter.name] = Estimate(
                value,
                max(value - error, parameter.low),
                min(value + error, parameter.high),
                parameter.unit,
            )
        out.append(found)
    return out


def equal_explanations(naming: Naming) -> list[tuple[int, Alternative]]:
    """Explanations that fit as well with one effect exchanged: its position, the explanation.

    One with more parameters could follow what the simulation is inexact about: if it is behind all
    the same, it must be close. What contains an effect, or includes one that is
    named, and fits no better adds something to it that the recording does not show. What passes and
    brings too little to be named by itself is no rival either, nor beside what always holds what
    would not be named beside it.
    """
    always = all(t.interval == ALWAYS for t in naming.fit.terms)
    own = [t.key for t in naming.fit.terms]
    share = EQUAL_SHARE if len(own) == 1 else 0.0
    inexact = max(2.0 * REPORTED_TOGETHER, min(share * naming.gain, LARGEST_EQUAL))
    seen = set(own)
    out: list[tuple[int, Alternative]] = []
    for alternative in naming.alternatives:
        theirs = [t.key for t in alternative.fit.terms]
        missing = [k for k, key in enumerate(own) if key not in theirs]
        if len(theirs) != len(own) or len(missing) != 1 or theirs[-1] in seen:
            continue
        newest, rival = alternative.fit.terms[-1], naming.fit.terms[missing[0]]
        contained = rival.effect.name in newest.effect.contains
        included = any(t.effect.name in newest.effect.includes for t in naming.fit.terms)
        if (contained or included) and alternative.behind > 0.0:
            continue
        least = passing_gain(newest, beside=always)
        if len(own) == 1 and naming.gain - alternative.behind < least:
            continue
        more = alternative.fit.active > naming.fit.active
        limit = 2.0 * TOGETHER_WITH_MORE if more else inexact
        if alternative.behind < limit and _alike(naming, alternative):
            seen.add(theirs[-1])
            out.append((missing[0], alternative))
    return out


def _alike(naming: Naming, alternative: Alternative) -> bool:
    """Whether an alternative explains the same part of the data as the winner."""
    own = naming.nothing - naming.fit.vector
    other = naming.nothing - alternative.fit.vector
    cosine = float(own @ other) / max(float(np.linalg.norm(own) * np.linalg.norm(other)), 1e-9)
    return cosine > LEAST_LIKENESS


def findings_of(
    naming: Naming,
    equal: list[tuple[int, Alternative]],
    before: list[Found],
    bank: RegionBank,
    baseline: Baseline,
    with_proof: bool,
    workers: int = 1,
) -> tuple[Finding, ...]:
    """Findings of a naming.

    Args:
        naming: With terms.
        equal: Explanations that fit as well.
        before: Strongest regions without any effect.
        bank: Regions.
        baseline: What is normal.
        with_proof: Fit and score held-out blocks.
        workers: Processes.
    """
    whitener = naming.whitener
    estimates = estimates_of(naming.fit)
    named = {t.key for t in naming.fit.terms}
    behind = tuple(
        (a.fit.terms[-1].effect.name, a.fit.terms[-1].instrument, 0.5 * a.behind)
        for a in naming.alternatives
        if a.fit.terms[-1].key not in named
    )
    others = (a.fit.terms for a in naming.alternatives)
    # The same effects at other times are no other explanation.
    placebo = next((terms for terms in others if {t.key for t in terms} != named), ())
    proof = (
        prove(whitener, baseline.station, naming.fit.terms, placebo, workers=workers)
        if with_proof
        else None
    )
    misfit = float(naming.nothing @ naming.nothing)
    out = []
    for k, term in enumerate(naming.fit.terms):
        rest = [t for t in naming.fit.terms if t is not term]
        beside = simulated_with(whitener.comparison, baseline.station, rest)
        vector = whitener.of(beside) if rest else naming.nothing
        gain = float(vector @ vector) - naming.fit.cost
        passing = term.interval != ALWAYS
        own = _location(
            naming, bank, vector if passing else naming.nothing,
            beside if passing else whitener.comparison.simulate(baseline.station), term,
        ) or before[0]
        share = gain / max(misfit - LEAST_NOISE * naming.nothing.size, gain)
        out.append(
            Finding(
                term, estimates[k], own, float(np.clip(share, 0.0, 1.0)),
                bank.p_value(own.score), behind, proof,
                k + 1 if any(position == k for position, _ in equal) else 0, gain,
            )
        )
    for position, alternative in equal:
        term = alternative.fit.terms[-1]
        rival = out[position]
        values = estimates_of(alternative.fit)[-1]
        out.append(
            Finding(
                term, values, rival.located, rival.share, rival.p,
                ((rival.term.effect.name, rival.term.instrument, -0.5 * alternative.behind),),
                None, position + 1, rival.gain,
            )
        )
    return tuple(out)


def _location(
    naming: Naming, bank: RegionBank, vector: FloatArray, simulated: Simulated, term: Term
) -> Found | None:
    """The strongest region in a channel of the term's instrument.

    Args:
        naming: The explanation.
        bank: Regions.
        vector: White vector of what is to be explained.
        simulated: Simulation without it.
        term: One of the explanation's.
    """
    comparison = naming.whitener.comparison
    channels = {
        c.name
        for c in comparison.channels
        if c.instrument in comparison.affected(comparison.station, term.instrument)
    }
    every = strongest(naming.whitener, bank, vector, simulated, len(bank.regions))
    return next((found for found in every if found.region.channel in channels), None)
