"""What is to be said of an explanation: verdict, findings, and what speaks against them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.detectable import Detectable, smallest_detectable
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.intervals import window_of
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.calibrated_range import (
    is_too_calm,
    need_calibration,
    too_calm,
)
from wind_sensors.diagnosis.healthy.noise_level import Excess, described, excess_of
from wind_sensors.diagnosis.proving.contradictions import (
    comes_in_bursts,
    false_in_bursts,
    goes_with_speed,
    is_discordant,
    is_otherwise_in_eddies,
    undo_each_other,
    varies,
)
from wind_sensors.diagnosis.proving.decision import (
    REMAINDER_P,
    Remainder,
    Verdict,
    is_noisy,
    located,
    remainder_of,
    unstirred,
    verdict_of,
    with_own_noise,
)
from wind_sensors.diagnosis.proving.findings import (
    Finding,
    equal_explanations,
    findings_of,
)
from wind_sensors.diagnosis.proving.mere_shift import is_a_mere_shift
from wind_sensors.diagnosis.proving.support import (
    UNSEEN_NOISY_GAIN,
    borne_out,
    determined,
    made_up,
    passes_unseen,
    stands_out,
)
from wind_sensors.diagnosis.proving.suspicions import suspicion_beside, suspicion_of
from wind_sensors.diagnosis.regions import OF_POWER, Found, RegionBank, region_bank, strongest
from wind_sensors.station.model import Station

LEAST_JUDGED = 0.1
"""Share of the record that what passes must hold for its minutes' noise to be judged."""

REPEATED = 0.01
"""With more of the reference's samples repeating those before them, something is wrong with it."""

IN_BURSTS = "come in bursts, as a radio's or a motor's do: a contact bounces by chance"


@dataclass(frozen=True)
class Judgement:
    """An explanation and what is to be said of it.

    Attributes:
        naming: The explanation.
        verdict, findings, objection: What is said, and what speaks against it.
        remainder: What it leaves in the region where it leaves most.
        excess: Noise over that of healthy days.
        calm: Whether nobody knows what is normal in such a wind.
        detectable: Smallest detectable sizes, by effect.
        bank: Regions.
        regions_before: The strongest of them without any effect.
        regions: What is left, for people.
        contradicted: Whether the signals contradict the form of what is explained by: what fits as
            well may be true.
    """

    naming: Naming
    verdict: Verdict
    findings: tuple[Finding, ...]
    objection: str
    remainder: Remainder
    excess: Excess
    calm: bool
    detectable: Mapping[str, Detectable]
    bank: RegionBank
    regions_before: tuple[Found, ...]
    regions: tuple[Found, ...]
    contradicted: bool = False

    @property
    def is_claim(self) -> bool:
        """Whether something is named."""
        return self.verdict in {"named", "ambiguous"}

    def words(self, baseline: Baseline) -> str:
        """What is left, and why no name is given, for people.

        Args:
            baseline: What is normal.
        """
        description = ""
        repeated = self.naming.whitener.comparison.repeated
        if (self.verdict == "unknown" and repeated <= REPEATED) or self.remainder.p < REMAINDER_P:
            description = _description(self.regions[0])
        if self.verdict == "unknown" and is_noisy(self.naming, self.excess):
            description = f"{description}; {described(self.excess)}"
        if self.calm and self.verdict == "inconclusive":
            description = too_calm(baseline)
        said = [description, self.objection]
        if repeated > REPEATED:
            said.append(
                f"the reference repeats its last wind in {100.0 * repeated:.0f} % of its samples, "
                "which were left out: look at its heads and its driver"
            )
        return "; ".join(part for part in said if part)


def judgement_of(
    searcher: Searcher,
    naming: Naming,
    baseline: Baseline,
    workers: int,
    report: Callable[[str], Callable[[float], None]],
    with_proof: bool,
) -> Judgement:
    """What is to be said of an explanation.

    Args:
        searcher: The search that found it.
        naming: The explanation.
        baseline: What is normal.
        workers: Processes.
        report: Gives a phase's progress function.
        with_proof: Fit and score held-out blocks.
    """
    comparison = searcher.comparison
    whitener = naming.whitener
    bank = region_bank(whitener, searcher.bank.without)
    report("locating")(0.5)
    before = strongest(whitener, bank, naming.nothing, searcher.bank.without)
    rest = region_bank(naming.adequate, searcher.bank.without)
    left = naming.adequate.of(naming.fit.simulated)
    after = strongest(naming.adequate, rest, left, naming.fit.simulated)
    remainder = remainder_of(naming, rest, comparison, baseline)
    detectable = smallest_detectable(searcher, whitener)
    equal = equal_explanations(naming)
    located_p = bank.p_value(max(f.score for f in before))
    excess = _noise_left(naming, baseline)
    verdict = verdict_of(naming, equal, remainder, detectable, located_p, excess)
    calm = is_too_calm(comparison, baseline)
    if calm and verdict != "none" and need_calibration(naming.fit.terms):
        verdict = "inconclusive"
    report("proving")(0.2)
    findings = findings_of(
        naming, equal, before, bank, baseline, with_proof, workers
    ) if verdict in {"named", "ambiguous"} else ()  # fmt: skip
    report("proving")(1.0)
    structured = located(naming, bank, comparison, baseline).is_structure
    upheld = _upheld(
        verdict, findings, naming, comparison, baseline.station, structured, workers
    )
    verdict = upheld.verdict
    if verdict == "none" and comparison.repeated > REPEATED:
        # The instruments are well, but the recording is not.
        verdict = "unknown"
    if calm and verdict == "unknown":
        verdict = "inconclusive"
    return Judgement(
        naming=naming,
        verdict=verdict,
        findings=upheld.findings,
        objection=upheld.objection,
        remainder=remainder,
        excess=excess,
        calm=calm,
        detectable=detectable,
        bank=bank,
        regions_before=tuple(before),
        regions=tuple(_structured(before) if verdict == "unknown" else after),
        contradicted=upheld.contradicted,
    )


def with_suspicion(judgement: Judgement, station: Station, workers: int) -> Judgement:
    """The same; of an unknown to which nothing was objected, what it might be.

    Args:
        judgement: What was judged.
        station: As commissioned.
        workers: Processes.
    """
    if judgement.verdict != "unknown" or judgement.objection:
        return judgement
    comparison = judgement.naming.whitener.comparison
    for channel in comparison.channels:
        rotor = channel.instrument
        if channel.kind == "rotor_rate" and false_in_bursts(comparison, rotor):
            return replace(judgement, objection=f"{rotor}: false pulses {IN_BURSTS}")
    suspicion = suspicion_beside(judgement.naming, station, workers)
    return judgement if suspicion is None else replace(judgement, objection=suspicion.words)


def _noise_left(naming: Naming, baseline: Baseline) -> Excess:
    """How far the residual's noise exceeds that of healthy days, where that can be judged.

    In the whole record, and in the minutes in which something that passes is said to hold.
    """
    apart = unstirred(naming, baseline.station)
    if apart is None:
        return Excess()
    corrected = planted(baseline.station, naming.fit.terms)
    seconds = apart.grid.centres + apart.drive.elapsed
    views = [apart]
    for term in naming.fit.terms:
        begin, end = window_of(apart, term.interval)
        inside = ((seconds > begin) & (seconds < end)).astype(np.float64)
        if term.interval != ALWAYS and np.mean(apart.masked(inside)) > LEAST_JUDGED:
            views.append(apart.within(inside))
    own = with_own_noise(naming)
    found = [excess_of(view, view.simulate(corrected), baseline, own) for view in views]
    return max(found, key=lambda excess: excess.score)


@dataclass(frozen=True)
class _Upheld:
    """What stands of a verdict, and what speaks against it, for people.

    Attributes:
        verdict, findings, objection: As in a judgement.
        contradicted: As there.
    """

    verdict: Verdict
    findings: tuple[Finding, ...] = ()
    objection: str = ""
    contradicted: bool = False


def _upheld(
    verdict: Verdict,
    findings: tuple[Finding, ...],
    naming: Naming,
    comparison: Comparison,
    station: Station,
    structured: bool,
    workers: int,
) -> _Upheld:
    """Verdict and findings after what speaks against them.

    What was only said of a part of the record, brought little and is withdrawn, leaves nothing if
    the recording shows no more than healthy ones do: of the many intervals some fit the swings of a
    healthy vane.
    """
    if not findings:
        return _Upheld(verdict)
    names = " and ".join(_names(naming.fit.terms))
    passing = any(t.interval != ALWAYS for t in naming.fit.terms)
    something = structured or not passing or naming.gain > UNSEEN_NOISY_GAIN
    left: Verdict = "unknown" if something else "none"
    contradiction = ""
    if not borne_out(findings):
        left = left if stands_out(findings) else "none"
        objection = "blocks that were not fitted do not bear it out"
    elif passes_unseen(findings):
        left = left if stands_out(findings) else "none"
        objection = "only for a part of the record, where nothing stands out"
    elif made_up(findings, comparison, naming.gain):
        objection = "the data do not show the one without the other"
    elif undo_each_other(naming, station):
        objection = "each would have to undo what the other does"
    elif varies(naming, station):
        objection = contradiction = "with another size in parts of the record"
    elif (suspicion := suspicion_of(naming, station, workers)) is not None:
        left, objection = "unknown", suspicion.words
    elif contradiction := _contradiction(naming, station):
        objection = contradiction
    elif verdict == "named" and is_a_mere_shift(naming, station):
        left = "unknown"
        objection = "a constant would, too: the wind does not show that it goes with the direction"
    elif not determined(findings):
        objection = "of any size, nought among them"
    else:
        return _Upheld(verdict, findings)
    return _Upheld(left, (), f"{names} would fit, but {objection}", bool(contradiction))


def _contradiction(naming: Naming, station: Station) -> str:
    """How the signals contradict the form of what is named; empty: they do not."""
    if comes_in_bursts(naming):
        return f"they {IN_BURSTS}"
    if goes_with_speed(naming, station):
        return "with another size in strong wind than in weak wind"
    if is_discordant(naming, station):
        return "with another size on one signal than on another"
    if is_otherwise_in_eddies(naming, station):
        return "with another size in the power of eddies than in the course of the signal"
    return ""


def _names(terms: Sequence[Term]) -> list[str]:
    """Names of effects, with their instruments where one effect stands for two."""
    names = [term.effect.name for term in terms]
    return [
        f"{name} ({term.instrument})" if names.count(name) > 1 else name
        for name, term in zip(names, terms, strict=True)
    ]


def _structured(found: list[Found]) -> list[Found]:
    """Regions of time, speed and direction before those of spectra and statistics."""
    return sorted(found, key=lambda f: f.region.kind in OF_POWER)


def _description(found: Found) -> str:
    channel = found.region.channel
    if found.region.kind in OF_POWER:
        return f"{channel}: {found.region.label} differs from the simulation"
    sign = "above" if found.excess > 0.0 else "below"
    return (
        f"{channel}: measured {abs(found.excess):.2g} {found.unit} {sign} the simulation, "
        f"{found.region.label}"
    )
