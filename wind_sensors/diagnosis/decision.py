"""From an explanation to a verdict: what speaks against it, and when nothing can be said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wind_sensors.diagnosis.comparison import Comparison
from wind_sensors.diagnosis.explanation import Alternative, Naming
from wind_sensors.diagnosis.findings import Finding
from wind_sensors.diagnosis.fitting import ALWAYS
from wind_sensors.diagnosis.noise_level import Excess
from wind_sensors.diagnosis.regions import RegionBank

Verdict = Literal["none", "named", "ambiguous", "unknown", "inconclusive"]

LEAST_REMOVED = 0.5
"""Share of the excess misfit that held-out blocks must lose to an effect that no region shows."""

REMAINDER_SCORES = {
    "frequency": 60.0,
    "statistic": 45.0,
    "spectrum": 30.0,
    "time": 28.0,
    "direction": 28.0,
    "heading": 28.0,
    "speed": 16.0,
    "all": 20.0,
}
"""Scores beyond which a remainder counts as structure, by kind of region. Gusts that come and go
raise the power of a band on healthy days, too; a named effect leaves less than this where its form
may differ from the simulation's."""

REMAINDER_SHARE = 0.02
"""Share of what there was to explain beyond which a structured remainder makes it unknown."""

RIVAL_SHARE = 0.1
RIVAL_SCORE = 0.5
"""A smaller remainder, of this part of the score, with this share of it says as much: it rivals
what was named."""

REMAINDER_P = 0.05

NOISY = 6.0
VERY_NOISY = 8.0
"""Noise beyond this many standard deviations of healthy days is physics that a name left out;
without any name, where a reference of another day may err more, beyond the second."""

MOST_SHARED = 1.25
"""Largest sum of the shares of the misfit that two effects on the same signals explain, each in the
other's presence."""

OWN_SHARE = 0.5
"""An effect with this share of the misfit stands out without a region of its own: a delay moves
nothing up or down."""

MOST_FREE_PARAMETERS = 2
"""An explanation with more parameters must also stand out somewhere in the data."""

TOO_BLUNT = 6.0
"""A record that shows no effect below this many smallest sizes is inconclusive."""


@dataclass(frozen=True)
class Remainder:
    """What an explanation leaves in the region where it leaves most.

    Attributes:
        score: Relative to the limit for a region of its kind.
        p: Probability of it on a healthy day.
        share: Of the whole misfit.
    """

    score: float
    p: float
    share: float


def remainder_of(naming: Naming, bank: RegionBank, comparison: Comparison) -> Remainder:
    """What is left in the channels that the named effects reach.

    What another instrument shows beside them says nothing against the names.
    """
    scores = bank.scores(naming.adequate.of(naming.fit.simulated))
    if naming.fit.terms:
        reached = {
            instrument
            for term in naming.fit.terms
            for instrument in comparison.affected(comparison.recording.station, term.instrument)
        }
        channels = {c.name for c in comparison.channels if c.instrument in reached}
        scores = np.where([r.channel in channels for r in bank.regions], scores, 0.0)
    limits = np.array([REMAINDER_SCORES[r.kind] for r in bank.regions])
    worst = int(np.argmax(scores / limits))
    left = float(scores[worst])
    share = left / (left + max(naming.gain, 0.0)) if naming.fit.terms else 1.0
    return Remainder(left / float(limits[worst]), bank.p_value(left), share)


def with_own_noise(naming: Naming) -> set[str]:
    """Instruments whose named effects leave noise of their own."""
    comparison = naming.whitener.comparison
    return {
        instrument
        for term in naming.fit.terms
        if term.effect.noisy
        for instrument in comparison.affected(comparison.station, term.instrument)
    }


def is_noisy(naming: Naming, excess: Excess) -> bool:
    """Whether more noise is left than any healthy day leaves."""
    return excess.score > (NOISY if naming.fit.terms else VERY_NOISY)


def _patchwork(naming: Naming) -> bool:
    """Whether passing effects were pieced together on one instrument: nothing known fits."""
    passing = [t.instrument for t in naming.fit.terms if t.interval != ALWAYS]
    return len(passing) != len(set(passing))


def made_up(findings: tuple[Finding, ...], comparison: Comparison) -> bool:
    """Whether several effects were put together that the data do not show one by one.

    One of them stands out nowhere, or they undo each other: each has to make good what the other
    does to the same signals.
    """
    own = [f for f in findings if f.proof is not None]
    if len(own) < 2:
        return False
    if any(f.p > REMAINDER_P and f.share < OWN_SHARE for f in own):
        return True
    reached = [set(comparison.affected(comparison.station, f.term.instrument)) for f in own]
    together = bool(set.intersection(*reached))
    return together and sum(f.share for f in own) > MOST_SHARED


def borne_out(findings: tuple[Finding, ...]) -> bool:
    """Whether a region of the data or held-out blocks speak for the findings."""
    proofs = [f.proof for f in findings if f.proof is not None]
    located = any(f.p < REMAINDER_P for f in findings)
    return located or not proofs or proofs[0].excess_removed > LEAST_REMOVED


def verdict_of(
    naming: Naming,
    equal: list[tuple[int, Alternative]],
    remainder: Remainder,
    detectable: Mapping[str, tuple[float, str, float]],
    located_p: float,
    excess: Excess,
) -> Verdict:
    """The verdict on a naming, before its findings are proved one by one.

    Args:
        naming: The explanation.
        equal: Explanations that fit as well.
        remainder: What it leaves.
        detectable: Smallest detectable sizes: value, unit, in units of the smallest of interest.
        located_p: Probability, on a healthy day, of the strongest region without any effect.
        excess: Noise over that of healthy days.
    """
    p, share = remainder.p, remainder.share
    structured = remainder.score > 1.0 and p < REMAINDER_P
    if is_noisy(naming, excess):
        return "unknown"
    if not naming.fit.terms:
        if structured:
            return "unknown"
        sizes = sorted(size for _, _, size in detectable.values())
        if not sizes or sizes[len(sizes) // 3] > TOO_BLUNT:
            return "inconclusive"
        return "none"
    if naming.fit.active > MOST_FREE_PARAMETERS and located_p > REMAINDER_P:
        # Many parameters that no region of the data asks for.
        return "none"
    rivals = remainder.score > RIVAL_SCORE and p < REMAINDER_P and share > RIVAL_SHARE
    if (structured and share > REMAINDER_SHARE) or rivals or _patchwork(naming):
        return "unknown"
    return "ambiguous" if equal else "named"
