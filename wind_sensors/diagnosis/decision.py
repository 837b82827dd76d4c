"""From an explanation to a verdict: what speaks against it, and when nothing can be said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis import spectra
from wind_sensors.diagnosis.acceptance import LOUDEST_FACTOR
from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.comparison import Comparison
from wind_sensors.diagnosis.explanation import Alternative, Naming
from wind_sensors.diagnosis.findings import Finding
from wind_sensors.diagnosis.fitting import ALWAYS, Term, planted
from wind_sensors.diagnosis.intervals import cell_signatures
from wind_sensors.diagnosis.noise_level import Excess
from wind_sensors.diagnosis.regions import RegionBank
from wind_sensors.diagnosis.whitening import in_series
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

Verdict = Literal["none", "named", "ambiguous", "unknown", "inconclusive"]

LEAST_REMOVED = 0.7
"""Share of the excess misfit that held-out blocks must lose to what is named."""

REMAINDER_SCORES = {
    "frequency": 60.0,
    "statistic": 45.0,
    "spectrum": 30.0,
    "time": 30.0,
    "direction": 30.0,
    "heading": 30.0,
    "speed": 16.0,
    "all": 30.0,
}
"""Scores beyond which a remainder counts as structure, by kind of region. Gusts that come and go
raise the power of a band on healthy days, too; a named effect leaves less than this where its form
may differ from the simulation's."""

REMAINDER_SCORE = 0.8
REMAINDER_SHARE = 0.025
LEAST_REMAINDER = 0.01
"""A remainder makes a name unknown beyond this part of those scores if the score, relative to them,
times its share of what there was to explain is more than the second, and that share more than the
third: of a large effect the form may leave more."""

RIVAL_SHARE = 0.2
RIVAL_SCORE = 0.5
"""A smaller remainder, of this part of the score, with this share of it says as much: it rivals
what was named."""

REMAINDER_P = 0.05

NOISY = 6.0
VERY_NOISY = 8.0
"""Noise beyond this many standard deviations of healthy days is physics that a name left out;
without any name, where a reference of another day may err more, beyond the second."""

MOST_SHARED = 1.5
"""Largest sum of the shares of the misfit that two effects on the same signals explain, each in the
other's presence."""

LEAST_TOGETHER = 0.4
LEAST_CHANGE = 30.0
"""Two effects that change a signal must together change it by this share of the sum of what each
does, in squares, if that is more than the second."""

PARTS = 8
VARIES = 18.0
VARIES_SHARE = 0.02
"""What always holds, in a form that is certain, is the same in every part, half and quarter of the
record: a size of its own in one of them must not drop the cost by more than this, or than this
share of the gain."""

LIVELY_TIME = 5.0
"""A signal is lively or quiet by how fast it moves within so many seconds."""

UNEVEN = 12.0
UNEVEN_SHARE = 0.005
"""An effect has one size, whether its signal is lively or quiet: another one in lively moments must
not drop the cost by more than this, or than this share of the gain. What refuses jumps, or sticks
and slips in its own way, is taken for a filter or for friction otherwise."""

OWN_SHARE = 0.5
"""An effect with this share of the misfit stands out without a region of its own: a delay moves
nothing up or down."""

MOST_FREE_PARAMETERS = 2
CERTAIN_GAIN = 50.0
"""An explanation with more parameters that brings less than this must also stand out somewhere in
the data."""

UNSEEN_GAIN = 200.0
"""What begins or ends inside the record and brings more need not stand out in a region: what
changes the quick part of a signal moves none up or down."""

PASSING_P = 0.02
"""It stands out below this probability: of the many intervals that were tried one fits a gust."""

SURE_GAIN = 100.0
SURE_SIZE = 3.0
"""What brings so much and is so many of the smallest sizes worth reporting is there, whatever the
intervals of its parameters say."""

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


def remainder_of(
    naming: Naming, bank: RegionBank, comparison: Comparison, baseline: Baseline
) -> Remainder:
    """What is left in the channels that the named effects reach.

    What another instrument shows beside them says nothing against the names, nor does what a
    healthy day shows as loudly.
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
    loudest = {
        c.name: LOUDEST_FACTOR * baseline.loudness(c.instrument) for c in comparison.channels
    }
    limits = np.array([max(REMAINDER_SCORES[r.kind], loudest[r.channel]) for r in bank.regions])
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
    """Whether passing effects were pieced together on the same signals: nothing known fits."""
    comparison = naming.whitener.comparison
    passing = [
        instrument
        for term in naming.fit.terms
        if term.interval != ALWAYS
        for instrument in comparison.affected(comparison.station, term.instrument)
    ]
    return len(passing) != len(set(passing))


def undo_each_other(naming: Naming, station: Station) -> bool:
    """Whether two effects take back on some instrument most of what each does there.

    Args:
        naming: The explanation.
        station: As commissioned.
    """
    if len(naming.fit.terms) < 2:
        return False
    comparison = naming.whitener.comparison
    weights = comparison.weights(naming.whitener.trust)
    without = comparison.simulate(station).flat(comparison.channels)

    first, second = naming.fit.terms
    squares = []
    for terms in ((first,), (second,), naming.fit.terms):
        moved = comparison.possible(planted(station, terms))
        if moved is None:
            return False
        change = np.nan_to_num(moved.flat(comparison.channels) - without) * weights
        squares.append(change**2)
    n = comparison.coefficients
    for k in range(len(comparison.channels)):
        one, other, together = (float(s[k * n : (k + 1) * n].sum()) for s in squares)
        if one + other > LEAST_CHANGE and together < LEAST_TOGETHER * (one + other):
            return True
    return False


def varies(naming: Naming, station: Station) -> bool:
    """Whether an effect that should hold throughout has another size in a part of the record.

    Only a form that is certain can be held to that: others depend on the wind in ways of their own.

    Args:
        naming: The explanation.
        station: As commissioned.
    """
    null = naming.adequate
    comparison = null.comparison
    left = null.of(naming.fit.simulated)
    cuts = np.linspace(0.0, comparison.grid.n * comparison.grid.dt, PARTS + 1)
    most = max(VARIES, VARIES_SHARE * naming.gain)
    for term in naming.fit.terms:
        if term.interval != ALWAYS or term.effect.noisy or not term.effect.exact:
            continue
        others = [t for t in naming.fit.terms if t is not term]
        without = comparison.possible(planted(station, others))
        if without is None:
            continue
        cells = cell_signatures(comparison, without, naming.fit.simulated, null.trust, cuts)
        cells = null.through_standing(in_series(comparison, cells))
        for length in (1, 2, 4):
            parts = cells.reshape(PARTS // length, length, -1).sum(axis=1)
            power = np.maximum(np.einsum("ij,ij->i", parts, parts), 1.0)
            if np.any((parts @ left) ** 2 / power > most):
                return True
    return False


def unevenness(naming: Naming, station: Station, term: Term) -> float:
    """Drop of the cost if an effect had one size while its signals are lively, another while not.

    Args:
        naming: The explanation.
        station: As commissioned.
        term: One of its effects.
    """
    null = naming.adequate
    comparison = null.comparison
    others = [t for t in naming.fit.terms if t is not term]
    without = comparison.possible(planted(station, others))
    if without is None:
        return 0.0
    n = comparison.coefficients
    halves = np.zeros((2, n * len(comparison.channels)))
    for k, channel in enumerate(comparison.channels):
        name = channel.name
        change = naming.fit.simulated.series[name] - without.series[name]
        if not np.any(change):
            continue
        trust = null.trust[name]
        lively = _lively(without.series[name], comparison.grid.dt)
        for half, weight in zip(halves, (1.0 - lively, lively), strict=True):
            part = spectra.to_cosine(comparison.masked(change * weight))[:n]
            half[k * n : (k + 1) * n] = trust.slope / trust.deviation * part
    left = null.of(naming.fit.simulated)
    padded = np.pad(halves, ((0, 0), (0, left.size - halves.shape[1])))
    parts = null.through_standing(padded)
    power = np.maximum(np.einsum("ij,ij->i", parts, parts), 1e-9)
    sizes = parts @ left / power
    return float((sizes[1] - sizes[0]) ** 2 / np.sum(1.0 / power))


def _lively(series: FloatArray, dt: float) -> FloatArray:
    """Weights from nought where a series is quiet to one where it is lively, shape (n,)."""
    moving = uniform_filter1d(np.gradient(series) ** 2, round(LIVELY_TIME / dt), mode="nearest")
    rank = np.argsort(np.argsort(moving)) / max(series.size - 1, 1)
    return np.asarray(np.clip(2.0 * rank - 0.5, 0.0, 1.0))


def is_uneven(naming: Naming, station: Station) -> bool:
    """Whether an effect has another size while its signals are lively than while they are quiet.

    Those whose form is certain are held to one size in all parts of the record instead.
    """
    most = max(UNEVEN, UNEVEN_SHARE * naming.gain)
    return any(
        unevenness(naming, station, term) > most
        for term in naming.fit.terms
        if not term.effect.exact and not term.effect.legible and not term.is_told
    )


def made_up(findings: tuple[Finding, ...], comparison: Comparison) -> bool:
    """Whether several effects were put together that the data do not show one by one.

    One of them stands out nowhere, or each has to make good what the other does to the same
    signals.
    """
    own = [f for f in findings if f.proof is not None]
    if len(own) < 2:
        return False
    if any(f.p > REMAINDER_P and f.share < OWN_SHARE for f in own):
        return True
    reached = [set(comparison.affected(comparison.station, f.term.instrument)) for f in own]
    together = bool(set.intersection(*reached))
    return together and sum(f.share for f in own) > MOST_SHARED


def passes_unseen(findings: tuple[Finding, ...], gain: float) -> bool:
    """Whether something is said to begin or end inside the record that stands out nowhere.

    Of the many intervals some fit the swings of a healthy vane; but none brings much.

    Args:
        findings: What is said.
        gain: Drop of the cost by all of it.
    """
    return gain < UNSEEN_GAIN and any(
        f.term.interval != ALWAYS
        and not f.term.effect.legible
        and f.proof is not None
        and not _shows(f)
        for f in findings
    )


def borne_out(findings: tuple[Finding, ...]) -> bool:
    """Whether blocks that were not fitted speak for the findings.

    What acts in a few minutes or in one sector may show in the fitted blocks only, or only in the
    others: it has to stand out instead, and do there what the next-best explanation does.
    """
    proof = next((f.proof for f in findings if f.proof is not None), None)
    if proof is None or proof.excess_removed > LEAST_REMOVED:
        return True
    seldom = any(f.term.interval != ALWAYS or f.term.effect.occasional for f in findings)
    rival = -np.inf if proof.placebo_removed is None else proof.placebo_removed
    return seldom and stands_out(findings) and proof.excess_removed >= rival


def determined(findings: tuple[Finding, ...], gain: float) -> bool:
    """Whether the data tell, of every effect named, at least one size that is not nought.

    Of a vane out of balance on a mast at rest they tell the product with the lean, so that neither
    has a narrow interval; what brings much and is large is not nought for all that.

    Args:
        findings: What is said.
        gain: Drop of the cost by all of it.
    """
    return all(
        _has_a_size(f) or (f.share * gain > SURE_GAIN and f.term.relative_size > SURE_SIZE)
        for f in findings
        if f.proof is not None
    )


def _has_a_size(finding: Finding) -> bool:
    effect = finding.term.effect
    graded = [
        p for p in effect.parameters if p.graded and p.minimum > 0.0
    ]
    if effect.size is not None or not graded:
        return True
    known = [(p.healthy or 0.0, finding.parameters.get(p.name)) for p in graded]
    return any(e is None or not e.low <= healthy <= e.high for healthy, e in known)


def stands_out(findings: tuple[Finding, ...]) -> bool:
    """Whether the data show a mismatch where one of the findings acts."""
    return any(_shows(f) for f in findings)


def _shows(finding: Finding) -> bool:
    passing = finding.term.interval != ALWAYS and not finding.term.effect.legible
    return finding.p < (PASSING_P if passing else REMAINDER_P)


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
    asked_for = located_p <= REMAINDER_P or naming.gain > CERTAIN_GAIN
    if naming.fit.active > MOST_FREE_PARAMETERS and not asked_for:
        return "none"
    sizeable = share > max(REMAINDER_SHARE / max(remainder.score, 1e-9), LEAST_REMAINDER)
    clear = remainder.score > REMAINDER_SCORE and sizeable
    rivals = remainder.score > RIVAL_SCORE and share > RIVAL_SHARE
    if (p < REMAINDER_P and (clear or rivals)) or _patchwork(naming):
        return "unknown"
    return "ambiguous" if equal else "named"
