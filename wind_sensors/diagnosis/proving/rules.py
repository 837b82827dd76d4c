"""How a verdict is reached: lists of rules, of each of which the first that applies decides.

1. `FIRST_LOOK` says what an explanation as a whole allows to be said: that it names something
   (`named`, `ambiguous`), or why not.
2. `OBJECTIONS` withdraw a name that the data contradict, and say what is left then.
3. `of_the_recording` takes back what such a recording cannot bear out, whatever explains it, and
   `with_silence` that all is well where an instrument says nothing.

Diagnoses without a measured reference withdraw names as they find them: what they come to is put
into a word by `verdict_on_findings`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.detectable import Detectable
from wind_sensors.diagnosis.explaining.explanation import Alternative, Naming
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.healthy.calibrated_range import need_calibration
from wind_sensors.diagnosis.healthy.noise_level import Excess
from wind_sensors.diagnosis.proving.contradictions import (
    comes_in_bursts,
    goes_with_speed,
    is_discordant,
    is_otherwise_in_eddies,
    undo_each_other,
    varies,
)
from wind_sensors.diagnosis.proving.findings import Finding, Unexplained
from wind_sensors.diagnosis.proving.mere_shift import is_a_mere_shift
from wind_sensors.diagnosis.proving.remainder import (
    REMAINDER_P,
    REMAINDER_SCORE,
    Remainder,
    is_noisy,
)
from wind_sensors.diagnosis.proving.support import (
    UNSEEN_NOISY_GAIN,
    borne_out,
    clearly_borne_out,
    determined,
    made_up,
    passes_unseen,
    stands_out,
)
from wind_sensors.diagnosis.proving.suspicions import suspicion_of
from wind_sensors.station.model import Station
from wind_sensors.station.silence import Silent

Verdict = Literal["none", "named", "ambiguous", "unknown", "inconclusive"]

CLAIMS: frozenset[Verdict] = frozenset({"named", "ambiguous"})
"""Verdicts that name something."""

TOO_BLUNT = 6.0
"""A record that shows no effect below this many smallest sizes is inconclusive."""

MOST_FREE_PARAMETERS = 1
"""An explanation with more fitted parameters must also stand out somewhere in the data, or bring
much: several bend as chance bends the wind."""

FEW_PARAMETERS = 2
"""Up to so many fitted parameters `FEW_CERTAIN_GAIN` is much, with more `CERTAIN_GAIN`."""

CERTAIN_GAIN = 50.0
"""Gain of an explanation with many parameters that need not stand out anywhere."""

FEW_CERTAIN_GAIN = 40.0
"""The same with few: there is less that they can follow."""

REMAINDER_SHARE = 0.025
"""A remainder counts if its score, relative to the limit of its region, times its share of what
there was to explain is more: of a large effect the form may leave more. Of two effects four times
as much, each with its own and with what it makes of the other's; where the forms are certain two
leave no more than one."""

LEAST_REMAINDER = 0.006
"""Share of what there was to explain below which no remainder counts, however clear."""

FREELY_BENT = 5
"""Effects with so many parameters are series that follow whatever goes with direction or heading:
what they leave speaks against them however little it is."""

BENT_REMAINDER_P = 0.01
"""If a healthy day shows what they leave with less probability."""

UNEXPLAINED_P = 0.01
"""Without a measured reference a remainder counts that a healthy day shows with less probability:
of means there are few, and many ways to look at them."""

REPEATED = 0.01
"""With more of the reference's samples repeating those before them, something is wrong with it."""

IN_BURSTS = "come in bursts, as a radio's or a motor's do: a contact bounces by chance"


@dataclass(frozen=True)
class Case:
    """An explanation, as a whole.

    Attributes:
        naming: It.
        equal: Explanations that fit as well.
        remainder: What it leaves.
        detectable: Smallest detectable sizes, by effect.
        located_p: Probability, on a healthy day, of the strongest region without any effect.
        excess: Noise over that of healthy days.
        calm: Whether nobody knows what is normal in such a wind.
    """

    naming: Naming
    equal: Sequence[tuple[int, Alternative]]
    remainder: Remainder
    detectable: Mapping[str, Detectable]
    located_p: float
    excess: Excess
    calm: bool = False

    @property
    def terms(self) -> tuple[Term, ...]:
        """What explains the recording."""
        return self.naming.fit.terms


def first_look(case: Case) -> Verdict:
    """The verdict on an explanation, before its findings are proved one by one.

    What needs a calibration is neither named nor excluded in winds that none covers.

    Args:
        case: It.
    """
    verdict = next(said for rule in FIRST_LOOK if (said := rule(case)) is not None)
    if case.calm and verdict != "none" and need_calibration(case.terms):
        return "inconclusive"
    return verdict


def _physics_in_the_noise(case: Case) -> Verdict | None:
    """More noise than healthy days leave is physics that nothing in the catalogue describes."""
    return "unknown" if is_noisy(case.naming, case.excess) else None


def _structure_without_a_name(case: Case) -> Verdict | None:
    """Nothing explains a region that healthy days do not show."""
    return "unknown" if not case.terms and case.remainder.is_structure else None


def _too_blunt(case: Case) -> Verdict | None:
    """Nothing is seen, where hardly anything could be."""
    if case.terms:
        return None
    sizes = sorted(each.relative for each in case.detectable.values())
    return "inconclusive" if not sizes or sizes[len(sizes) // 3] > TOO_BLUNT else None


def _nothing(case: Case) -> Verdict | None:
    """Nothing is seen."""
    return None if case.terms else "none"


def _nothing_asks_for_it(case: Case) -> Verdict | None:
    """Several parameters fit what no region shows, and bring little."""
    fitted = case.naming.fit.active
    certain = CERTAIN_GAIN if fitted > FEW_PARAMETERS else FEW_CERTAIN_GAIN
    asked_for = case.located_p <= REMAINDER_P or case.naming.gain > certain
    return "none" if fitted > MOST_FREE_PARAMETERS and not asked_for else None


def _too_much_is_left(case: Case) -> Verdict | None:
    """What is named leaves more than another form of it would."""
    p, score = case.remainder.p, case.remainder.score
    forms = sum(not term.has_certain_form for term in case.terms)
    product = REMAINDER_SHARE * max(forms, 1) ** 2
    sizeable = case.remainder.share > max(product / max(score, 1e-9), LEAST_REMAINDER)
    bent = any(len(term.effect.parameters) >= FREELY_BENT for term in case.terms)
    counts = (p < REMAINDER_P and sizeable) or (p < BENT_REMAINDER_P and bent)
    return "unknown" if score > REMAINDER_SCORE and counts else None


def _patchwork(case: Case) -> Verdict | None:
    """Passing effects were pieced together on the same signals: nothing known fits."""
    comparison = case.naming.whitener.comparison
    passing = [
        instrument
        for term in case.terms
        if term.interval != ALWAYS
        for instrument in comparison.affected(comparison.station, term.instrument)
    ]
    return "unknown" if len(passing) != len(set(passing)) else None


def _others_fit_as_well(case: Case) -> Verdict | None:
    """Several explanations fit as well."""
    return "ambiguous" if case.equal else None


def _fits(case: Case) -> Verdict | None:
    """One explanation fits, and nothing is left."""
    return "named"


FIRST_LOOK: tuple[Callable[[Case], Verdict | None], ...] = (
    _physics_in_the_noise,
    _structure_without_a_name,
    _too_blunt,
    _nothing,
    _nothing_asks_for_it,
    _too_much_is_left,
    _patchwork,
    _others_fit_as_well,
    _fits,
)
"""What an explanation as a whole allows to be said; the first that says something decides."""


@dataclass(frozen=True)
class Claim:
    """What is to be named, with its proof.

    Attributes:
        verdict: That of the first look.
        findings: Of it, at least one.
        naming: The explanation.
        comparison: The recording.
        station: As commissioned.
        structured: Whether the recording shows, without any effect, more than healthy ones do.
        calibrated: Whether healthy recordings tell what is normal for the station.
        workers: Processes.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    naming: Naming
    comparison: Comparison
    station: Station
    structured: bool
    calibrated: bool
    workers: int

    @property
    def withdrawn(self) -> Verdict:
        """What is left of the verdict if the name is withdrawn.

        What was only said of a part of the record and brought little leaves nothing if the
        recording shows no more than healthy ones do: of the many intervals some fit the swings of
        a healthy vane.
        """
        passing = any(t.interval != ALWAYS for t in self.naming.fit.terms)
        something = self.structured or not passing or self.naming.gain > UNSEEN_NOISY_GAIN
        return "unknown" if something else "none"

    @property
    def withdrawn_unless_it_shows(self) -> Verdict:
        """The same where only what stands out in a region is left."""
        return self.withdrawn if stands_out(self.findings) else "none"


@dataclass(frozen=True)
class Objection:
    """What speaks against a claim.

    Attributes:
        words: For people, after "would fit, but".
        leaves: The verdict without the name.
        contradicts: Whether the signals contradict the form of what was named: what fits as well
            may be true.
    """

    words: str
    leaves: Verdict
    contradicts: bool = False


def objection_to(claim: Claim) -> Objection | None:
    """The first objection to a claim; None: it stands.

    Args:
        claim: What is to be named.
    """
    return next((said for rule in OBJECTIONS if (said := rule(claim)) is not None), None)


def _not_borne_out(claim: Claim) -> Objection | None:
    if borne_out(claim.findings):
        return None
    words = "blocks that were not fitted do not bear it out"
    return Objection(words, claim.withdrawn_unless_it_shows)


def _may_be_normal(claim: Claim) -> Objection | None:
    if claim.calibrated or clearly_borne_out(claim.findings):
        return None
    words = (
        "blocks that were not fitted bear it out too little for a station of which no healthy "
        "recording tells what is normal"
    )
    return Objection(words, "inconclusive")


def _passes_unseen(claim: Claim) -> Objection | None:
    if not passes_unseen(claim.findings):
        return None
    words = "only for a part of the record, where nothing stands out"
    return Objection(words, claim.withdrawn_unless_it_shows)


def _made_up(claim: Claim) -> Objection | None:
    if not made_up(claim.findings, claim.comparison, claim.naming.gain):
        return None
    return Objection("the data do not show the one without the other", claim.withdrawn)


def _undo_each_other(claim: Claim) -> Objection | None:
    if not undo_each_other(claim.naming, claim.station):
        return None
    return Objection("each would have to undo what the other does", claim.withdrawn)


def _varies(claim: Claim) -> Objection | None:
    if not varies(claim.naming, claim.station):
        return None
    return Objection("with another size in parts of the record", claim.withdrawn, True)


def _suspected(claim: Claim) -> Objection | None:
    suspicion = suspicion_of(claim.naming, claim.station, claim.workers)
    return None if suspicion is None else Objection(suspicion.words, "unknown")


def _in_bursts(claim: Claim) -> Objection | None:
    if not comes_in_bursts(claim.naming):
        return None
    return Objection(f"they {IN_BURSTS}", claim.withdrawn, True)


def _goes_with_speed(claim: Claim) -> Objection | None:
    if not goes_with_speed(claim.naming, claim.station):
        return None
    words = "with another size in strong wind than in weak wind"
    return Objection(words, claim.withdrawn, True)


def _is_discordant(claim: Claim) -> Objection | None:
    if not is_discordant(claim.naming, claim.station):
        return None
    return Objection("with another size on one signal than on another", claim.withdrawn, True)


def _is_otherwise_in_eddies(claim: Claim) -> Objection | None:
    if not is_otherwise_in_eddies(claim.naming, claim.station):
        return None
    words = "with another size in the power of eddies than in the course of the signal"
    return Objection(words, claim.withdrawn, True)


def _is_a_mere_shift(claim: Claim) -> Objection | None:
    # In a set with others it is not said that it goes with the direction.
    if claim.verdict != "named" or not is_a_mere_shift(claim.naming, claim.station):
        return None
    words = "a constant would, too: the wind does not show that it goes with the direction"
    return Objection(words, "unknown")


def _of_any_size(claim: Claim) -> Objection | None:
    if determined(claim.findings):
        return None
    return Objection("of any size, nought among them", claim.withdrawn)


OBJECTIONS: tuple[Callable[[Claim], Objection | None], ...] = (
    _not_borne_out,
    _may_be_normal,
    _passes_unseen,
    _made_up,
    _undo_each_other,
    _varies,
    _suspected,
    _in_bursts,
    _goes_with_speed,
    _is_discordant,
    _is_otherwise_in_eddies,
    _is_a_mere_shift,
    _of_any_size,
)
"""What withdraws a name; the first that applies is told."""


def of_the_recording(verdict: Verdict, repeated: float, calm: bool) -> Verdict:
    """The verdict that such a recording bears out.

    Args:
        verdict: On what explains it.
        repeated: Share of the reference's samples that repeat those before them.
        calm: Whether nobody knows what is normal in such a wind.
    """
    if verdict == "none" and repeated > REPEATED:
        # The instruments are well, but the recording is not.
        verdict = "unknown"
    return "inconclusive" if calm and verdict == "unknown" else verdict


def with_silence(verdict: Verdict, silent: Sequence[Silent]) -> Verdict:
    """The verdict with what says nothing: nobody knows that it is well.

    Args:
        verdict: On what speaks.
        silent: Instruments of the station that say nothing in the whole recording.
    """
    return "unknown" if silent and verdict == "none" else verdict


def verdict_on_findings(
    findings: Sequence[Finding], unexplained: Unexplained, limit: float
) -> Verdict:
    """The word for findings and a remainder, where no reference was measured.

    Args:
        findings: All of them.
        unexplained: What is left.
        limit: Share of the misfit above which a remainder counts.
    """
    if any(f.set_number == 0 for f in findings):
        return "named"
    if findings:
        return "ambiguous"
    if unexplained.p < UNEXPLAINED_P and unexplained.share > limit:
        return "unknown"
    return "none"
