"""Whether the data bear out what is said of each effect."""

from __future__ import annotations

import math

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.moments import needs_to_be_steady
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_FURTHER_PARAMETER
from wind_sensors.diagnosis.explaining.terms import ALWAYS, of_one_equation, reached_by
from wind_sensors.diagnosis.proving.findings import Finding

SHOWN_P = 0.05
"""An effect shows if a healthy day has a mismatch as clear where it acts with less probability."""

LEAST_REMOVED = 0.7
"""Share of the excess misfit that held-out blocks must lose to what is named."""

LEAST_OF_ALL = 0.2
"""The same of the excess on all signals, those among them that the effects do not reach: what makes
up less is not what is wrong with the record."""

LEAST_WITHOUT_HEALTHY = 0.15
"""Lower end of the 95 % interval of that share, where no healthy recording tells what is normal."""

LEAST_NOISY_REMOVED = 0.5
"""The same as `LEAST_REMOVED` where an effect comes with noise of its own, which is another one in
blocks that were not fitted."""

NOISE_LEFT = 1.1
"""If no more is left there than so many times the noise of a healthy day."""

MOST_SHARED = 1.5
"""Largest sum of what two effects on the same signals bring, each in the other's presence, over
what they bring together: more, and each only makes good what the other does."""

MOST_ALONE = 0.75
"""Unless one of them brings this share of what they bring together alone: beside friction that
makes a vane jump, damping that calms it is no help to either."""

OWN_SHARE = 0.5
"""An effect with this share of the misfit stands out without a region of its own: a delay moves
nothing up or down."""

UNSEEN_GAIN = 40.0
"""What begins or ends inside the record and brings more need not stand out in a region: what
changes the quick part of a signal moves none up or down. On no healthy day does a part of the
record bring so much."""

UNSEEN_NOISY_GAIN = 100.0
"""The same of what acts now and then only: it need not gain all the time, so that a few gusts may
bring what it brings."""

PASSING_P = 0.02
"""What begins or ends inside the record stands out below this probability, which is less than
`SHOWN_P`: of the many intervals that were tried one fits a gust."""

SURE_GAIN = 50.0
"""One of several effects that brings more, on signals of its own, need not stand out in a
region."""

SURE_QUICK_GAIN = 30.0
"""The same of what only damps or delays such signals, and so moves none up or down: no region could
show it."""

SURE_BESIDE_GAIN = 100.0
"""The same of what acts on the signals of another effect of its kind, and so has no region of its
own: it may be the form of that one."""

SURE_SIZE = 3.0
"""What brings `SURE_GAIN` and is so many of the smallest sizes worth reporting is there, whatever
the intervals of its parameters say."""


def made_up(findings: tuple[Finding, ...], comparison: Comparison, gain: float) -> bool:
    """Whether several effects were put together that the data do not show one by one.

    One of them stands out nowhere, though it brings little or not on signals of its own, or each
    has to make good what the other does to the same signals. A delay makes good no damping, and of
    two constants of one equation either shows beside the other.

    Args:
        findings: What is said.
        comparison: The recording.
        gain: Drop of the cost by all of it.
    """
    own = [f for f in findings if f.proof is not None]
    if len(own) < 2:
        return False
    reached = [reached_by(comparison, comparison.station, [f.term]) for f in own]
    for k, f in enumerate(own):
        alone = not reached[k] & set().union(*reached[:k], *reached[k + 1 :])
        quick = f.term.effect.is_quick and f.term.interval == ALWAYS
        others = [other.term.effect for other in (*own[:k], *own[k + 1 :])]
        if alone:
            least = SURE_QUICK_GAIN if quick else SURE_GAIN
        elif any(other.is_quick == f.term.effect.is_quick for other in others):
            least = SURE_BESIDE_GAIN
        else:
            # What delays moves nothing up or down, and what moves it up delays nothing.
            least = SURE_GAIN
        # A form with several parameters gains more by chance.
        least += PENALTY_PER_FURTHER_PARAMETER * max(len(f.parameters) - 1, 0)
        if f.p > SHOWN_P and f.share < OWN_SHARE and f.gain <= least:
            return True
    if of_one_equation([f.term for f in own]):
        return False
    delayed = any(f.term.effect.entrance == "clock" and f.gain > SURE_BESIDE_GAIN for f in own)
    if delayed or not frozenset.intersection(*reached) or any(_is_counted(f) for f in own):
        return False
    brought = sum(f.gain for f in own)
    single = max(gain - (brought - f.gain) for f in own)
    return brought > MOST_SHARED * gain and single < MOST_ALONE * gain


def _is_counted(finding: Finding) -> bool:
    """Whether the raw signals show by themselves what chance does to them.

    Pulses that bounce and a slow rotor undo each other in the mean, where alone either gains little
    and both together much; the bounces are seen all the same.
    """
    by_itself = finding.located.region.kind == "statistic" and finding.p <= SHOWN_P
    return by_itself and finding.term.effect.noisy


def passes_unseen(findings: tuple[Finding, ...]) -> bool:
    """Whether something is said to begin or end inside the record that stands out nowhere.

    Of the many intervals some fit the swings of a healthy vane; but none brings much.
    """
    return any(
        f.term.interval != ALWAYS
        and not f.term.effect.legible
        and f.proof is not None
        and not _shows(f)
        and f.gain < (UNSEEN_GAIN if needs_to_be_steady(f.term) else UNSEEN_NOISY_GAIN)
        for f in findings
    )


def borne_out(findings: tuple[Finding, ...]) -> bool:
    """Whether blocks that were not fitted speak for the findings.

    What acts in a few minutes or in one sector may show in the fitted blocks only, or only in the
    others: it has to stand out instead, and do there what the next-best explanation does.
    """
    proof = next((f.proof for f in findings if f.proof is not None), None)
    if proof is None:
        return True
    if proof.removed_where_it_acts > LEAST_REMOVED:
        return proof.excess_removed > LEAST_OF_ALL
    noisy = any(f.term.effect.noisy for f in findings)
    if noisy and proof.after < NOISE_LEFT and proof.removed_where_it_acts > LEAST_NOISY_REMOVED:
        return True
    seldom = any(f.term.interval != ALWAYS or f.term.effect.occasional for f in findings)
    rival = -math.inf if proof.placebo_removed is None else proof.placebo_removed
    return seldom and stands_out(findings) and proof.excess_removed >= max(rival, 0.0)


def clearly_borne_out(findings: tuple[Finding, ...]) -> bool:
    """Whether blocks that were not fitted speak for the findings beyond what chance makes of them.

    Of fourteen healthy recordings judged without the others six got a name or were `unknown`, of
    which these blocks bore out 0.06 at the most; eight of nine with a fault got a name, of which
    they bore out 0.18 at the least.
    """
    proof = next((f.proof for f in findings if f.proof is not None), None)
    return proof is None or proof.low > LEAST_WITHOUT_HEALTHY


def determined(findings: tuple[Finding, ...]) -> bool:
    """Whether the data tell, of every effect named, at least one size that is not nought.

    Of a vane out of balance on a mast at rest they tell the product with the lean, so that neither
    has a narrow interval; what brings much and is large is not nought for all that.
    """
    return all(
        _has_a_size(f) or (f.gain > SURE_GAIN and f.term.relative_size > SURE_SIZE)
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
    return finding.p < (PASSING_P if passing else SHOWN_P)
