"""What is to be said of an explanation: verdict, findings, and what speaks against them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wind_sensors.diagnosis.effects.wording import number_text
from wind_sensors.diagnosis.explaining.detectable import Detectable, smallest_detectable
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.intervals import window_of
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.calibrated_range import (
    is_too_calm,
    too_calm,
)
from wind_sensors.diagnosis.healthy.noise_level import Excess, described, excess_of
from wind_sensors.diagnosis.progress import Phases
from wind_sensors.diagnosis.proving.contradictions import false_in_bursts
from wind_sensors.diagnosis.proving.findings import (
    Finding,
    equal_explanations,
    findings_of,
)
from wind_sensors.diagnosis.proving.remainder import (
    REMAINDER_P,
    Remainder,
    is_noisy,
    located,
    remainder_of,
    unstirred,
    with_own_noise,
)
from wind_sensors.diagnosis.proving.rules import (
    CLAIMS,
    IN_BURSTS,
    REPEATED,
    Case,
    Claim,
    Objection,
    Verdict,
    first_look,
    objection_to,
    of_the_recording,
)
from wind_sensors.diagnosis.proving.suspicions import suspicion_beside
from wind_sensors.diagnosis.regions import OF_POWER, Found, RegionBank, region_bank, strongest
from wind_sensors.station.model import Station

LEAST_JUDGED = 0.1
"""Share of the record that what passes must hold for its minutes' noise to be judged."""


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
        return self.verdict in CLAIMS

    def words(self, baseline: Baseline) -> str:
        """What is left, and why no name is given, for people.

        Args:
            baseline: What is normal.
        """
        description = ""
        repeated = self.naming.whitener.comparison.repeated
        if (self.verdict == "unknown" and repeated <= REPEATED) or self.remainder.p < REMAINDER_P:
            description = _description(self.regions[0])
        if self.calm and self.verdict == "inconclusive":
            description = too_calm(baseline)
        said = [description]
        if self.verdict == "unknown" and is_noisy(self.naming, self.excess):
            said.append(described(self.excess))
        said.append(self.objection)
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
    phases: Phases,
    with_proof: bool,
) -> Judgement:
    """What is to be said of an explanation.

    Args:
        searcher: The search that found it.
        naming: The explanation.
        baseline: What is normal.
        workers: Processes.
        phases: Are told how much is done.
        with_proof: Fit and score held-out blocks.
    """
    comparison = searcher.comparison
    whitener = naming.whitener
    locating, proving = phases.run("locating"), phases.run("proving")
    bank = region_bank(whitener, searcher.bank.without)
    locating(0.5)
    before = strongest(whitener, bank, naming.nothing, searcher.bank.without)
    rest = region_bank(naming.adequate, searcher.bank.without)
    left = naming.adequate.of(naming.fit.simulated)
    after = strongest(naming.adequate, rest, left, naming.fit.simulated)
    remainder = remainder_of(naming, rest, comparison, baseline)
    detectable = smallest_detectable(searcher, whitener)
    equal = equal_explanations(naming)
    located_p = bank.p_value(max(f.score for f in before))
    excess = _noise_left(naming, baseline)
    calm = is_too_calm(comparison, baseline)
    case = Case(naming, equal, remainder, detectable, located_p, excess, calm)
    verdict = first_look(case)
    locating(1.0)
    findings = findings_of(
        naming, equal, before, bank, baseline, with_proof, workers
    ) if verdict in CLAIMS else ()
    proving(0.5)
    objection = None
    if findings:
        structured = located(naming, bank, comparison, baseline).is_structure
        objection = objection_to(
            Claim(
                verdict, findings, naming, comparison, baseline.station, structured,
                baseline.calibrated, workers,
            )
        )
    proving(1.0)
    if objection is not None:
        verdict, findings = objection.leaves, ()
    verdict = of_the_recording(verdict, comparison.repeated, calm)
    return Judgement(
        naming=naming,
        verdict=verdict,
        findings=findings,
        objection="" if objection is None else _in_words(naming.fit.terms, objection),
        remainder=remainder,
        excess=excess,
        calm=calm,
        detectable=detectable,
        bank=bank,
        regions_before=tuple(before),
        regions=tuple(_structured(before) if verdict == "unknown" else after),
        contradicted=objection is not None and objection.contradicts,
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


def _in_words(terms: Sequence[Term], objection: Objection) -> str:
    """What would fit, and what speaks against it, for people."""
    return f"{' and '.join(_names(terms))} would fit, but {objection.words}"


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
        f"{channel}: measured {number_text(abs(found.excess), 2)} {found.unit} {sign} "
        f"the simulation, {found.region.label}"
    )
