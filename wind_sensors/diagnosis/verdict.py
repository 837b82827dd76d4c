"""The diagnosis of one recording: verdict, findings, what is left, what could have been seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.explaining.acceptance import ACCEPTED_GAIN
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.fitting import ALWAYS, planted
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.naming import name, named_alone
from wind_sensors.diagnosis.explaining.screening import group_templates
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_PARAMETER, Searcher, searcher_of
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.calibrated_range import (
    is_calm,
    is_too_calm,
    need_calibration,
    too_calm,
)
from wind_sensors.diagnosis.healthy.noise_level import Excess, described, excess_of
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.diagnosis.proving.contradictions import (
    is_discordant,
    is_uneven,
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
    Unexplained,
    equal_explanations,
    findings_of,
)
from wind_sensors.diagnosis.proving.support import (
    borne_out,
    determined,
    made_up,
    passes_unseen,
    stands_out,
)
from wind_sensors.diagnosis.proving.suspicions import suspicion_of
from wind_sensors.diagnosis.regions import OF_POWER, Found, RegionBank, region_bank, strongest
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

TURNING_MISFIT = 0.1
"""The search runs again without the seconds in which vanes turn round apart if these hold this
share of a vane's misfit."""


@dataclass(frozen=True)
class Diagnosis:
    """Everything that is said about one recording.

    Attributes:
        recording: Its name.
        verdict: In one word.
        calibrated: Whether healthy recordings stand behind the null.
        findings: Named effects; of an ambiguous set, all members.
        unexplained: What is left.
        smallest_detectable: By effect and instrument: value and unit.
        station: The station with the named physics.
        baseline: What was normal.
        comparison, naming, simulated, corrected: For reports.
        objection: Why what fits best is not named; empty: no name was withdrawn.
    """

    recording: str
    verdict: Verdict
    calibrated: bool
    findings: tuple[Finding, ...]
    unexplained: Unexplained
    smallest_detectable: Mapping[str, tuple[float, str]]
    station: Station
    baseline: Baseline
    comparison: Comparison = field(repr=False)
    naming: Naming = field(repr=False)
    simulated: Simulated = field(repr=False)
    corrected: Simulated = field(repr=False)
    regions_before: tuple[Found, ...] = ()
    objection: str = ""
    bank: RegionBank | None = field(default=None, repr=False)


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


def smallest_detectable(
    searcher: Searcher, whitener: Whitener
) -> dict[str, tuple[float, str, float]]:
    """Smallest size of each effect that the recording could have shown.

    Returns:
        By `effect` (the most sensitive instrument): value, unit and size in units of the
        smallest worth reporting.
    """
    signatures = searcher.white_signatures(whitener)
    power = np.einsum("ij,ij->i", signatures, signatures)
    templates = searcher.probes.templates
    out: dict[str, tuple[float, str, float]] = {}
    for (effect_name, _), members in group_templates(templates).items():
        # Of a small size much of what it changes may be chance: where larger ones were simulated,
        # they tell how much an effect shows.
        largest = max(abs(templates[k].multiple) for k in members)
        best = max(
            (k for k in members if abs(templates[k].multiple) == largest),
            key=lambda k: float(power[k]),
        )
        if power[best] < 1e-6:
            continue
        template = templates[best]
        effect: Effect = template.effect
        needed = ACCEPTED_GAIN + PENALTY_PER_PARAMETER * len(effect.parameters)
        amplitude = float(np.sqrt(needed / power[best]))
        graded = [p for p in effect.parameters if p.healthy is not None and p.minimum > 0.0]
        moved = [p for p in graded if template.values[p.name] != p.healthy]
        if not moved:
            continue
        parameter = moved[0]
        healthy = parameter.healthy or 0.0
        value = amplitude * abs(template.values[parameter.name] - healthy)
        size = value / parameter.minimum
        if effect_name not in out or size < out[effect_name][2]:
            out[effect_name] = (value, parameter.unit, size)
    return out


def _explained(
    comparison: Comparison,
    baseline: Baseline,
    effects: Mapping[str, Effect],
    workers: int,
    report: Callable[[str], Callable[[float], None]],
) -> tuple[Searcher, Naming]:
    """The explanation of a recording, and the search that found it."""
    guesses = {
        key: terms
        for key, terms in guesses_of(comparison, baseline.station).items()
        if key[0] in effects
    }
    searcher = searcher_of(
        comparison, baseline, effects, guesses, workers, report("simulating the catalogue")
    )
    return searcher, name(searcher, report("fitting effects"))


def _noise_left(naming: Naming, baseline: Baseline) -> Excess:
    """How far the residual's noise exceeds that of healthy days, where that can be judged."""
    apart = unstirred(naming, baseline.station)
    if apart is None:
        return Excess()
    simulated = apart.simulate(planted(baseline.station, naming.fit.terms))
    return excess_of(apart, simulated, baseline, with_own_noise(naming))


def _upheld(
    verdict: Verdict,
    findings: tuple[Finding, ...],
    naming: Naming,
    comparison: Comparison,
    station: Station,
    structured: bool,
    workers: int,
) -> tuple[Verdict, tuple[Finding, ...], str]:
    """Verdict and findings after what speaks against them, and what does, for people.

    What was only said of a part of the record, and is withdrawn, leaves nothing if the recording
    shows no more than healthy ones do: of the many intervals some fit the swings of a healthy vane.
    """
    if not findings:
        return verdict, (), ""
    names = " and ".join(t.effect.name for t in naming.fit.terms)
    passing = any(t.interval != ALWAYS for t in naming.fit.terms)
    left: Verdict = "unknown" if structured or not passing else "none"
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
        objection = "with another size in parts of the record"
    elif is_uneven(naming, station):
        objection = "with another size in lively minutes than in quiet ones"
    elif is_discordant(naming, station):
        objection = "with another size on one signal than on another"
    elif not determined(findings):
        objection = "of any size, nought among them"
    elif (suspicion := suspicion_of(naming, station, workers)) is not None:
        left, objection = "unknown", suspicion.words
    else:
        return verdict, findings, ""
    return left, (), f"{names} would fit, but {objection}"


@dataclass(frozen=True)
class _Judged:
    """An explanation and what is to be said of it.

    Attributes:
        naming: The explanation.
        verdict, findings, objection: What is said, and what speaks against it.
        remainder: What it leaves in the region where it leaves most.
        excess: Noise over that of healthy days.
        calm: Whether nobody knows what is normal in such a wind.
        detectable: Smallest detectable sizes: value, unit, in units of the smallest of interest.
        bank: Regions.
        regions_before: The strongest of them without any effect.
        regions: What is left, for people.
    """

    naming: Naming
    verdict: Verdict
    findings: tuple[Finding, ...]
    objection: str
    remainder: Remainder
    excess: Excess
    calm: bool
    detectable: Mapping[str, tuple[float, str, float]]
    bank: RegionBank
    regions_before: tuple[Found, ...]
    regions: tuple[Found, ...]

    @property
    def is_claim(self) -> bool:
        """Whether something is named."""
        return self.verdict in {"named", "ambiguous"}


def _judged(
    searcher: Searcher,
    naming: Naming,
    baseline: Baseline,
    workers: int,
    report: Callable[[str], Callable[[float], None]],
    with_proof: bool,
) -> _Judged:
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
    findings = findings_of(naming, equal, before, bank, baseline, with_proof) if verdict in {
        "named", "ambiguous"
    } else ()  # fmt: skip
    report("proving")(1.0)
    structured = located(naming, bank, comparison, baseline).is_structure
    verdict, findings, objection = _upheld(
        verdict, findings, naming, comparison, baseline.station, structured, workers
    )
    if calm and verdict == "unknown":
        verdict = "inconclusive"
    if verdict == "unknown" and not objection:
        suspicion = suspicion_of(naming, baseline.station, workers, beside=True)
        objection = suspicion.words if suspicion is not None else ""
    return _Judged(
        naming=naming,
        verdict=verdict,
        findings=findings,
        objection=objection,
        remainder=remainder,
        excess=excess,
        calm=calm,
        detectable=detectable,
        bank=bank,
        regions_before=tuple(before),
        regions=tuple(_structured(before) if verdict == "unknown" else after),
    )


def _described(judged: _Judged, baseline: Baseline) -> str:
    """What is left, and why no name is given, for people."""
    description = ""
    if judged.verdict == "unknown" or judged.remainder.p < REMAINDER_P:
        description = _description(judged.regions[0])
    if judged.verdict == "unknown" and is_noisy(judged.naming, judged.excess):
        description = f"{description}; {described(judged.excess)}"
    if judged.calm and judged.verdict == "inconclusive":
        description = too_calm(baseline)
    if judged.objection:
        said = judged.objection
        description = f"{description}; {said}" if description else said
    return description


def diagnose(
    recording: Recording,
    baseline: Baseline,
    effects: Mapping[str, Effect] | None = None,
    workers: int = 1,
    progress: Callable[[str, float], None] | None = None,
    with_proof: bool = True,
) -> Diagnosis:
    """Find the physics that a station file leaves out.

    Args:
        recording: With a reference wind.
        baseline: What is normal for the station.
        effects: Catalogue; None: all known effects.
        workers: Processes.
        progress: Called with a phase and the share of it that is done.
        with_proof: Fit and score held-out blocks.

    Raises:
        UserError: The recording cannot be compared with its station.
    """
    known = catalogue() if effects is None else effects

    def report(phase: str) -> Callable[[float], None]:
        return lambda share: progress(phase, share) if progress else None

    baseline = baseline.for_station(recording.station)
    comparison = prepare(recording, baseline.station, baseline.place)
    if is_calm(comparison):
        baseline = baseline.in_calm()
    searcher, naming = _explained(comparison, baseline, known, workers, report)
    if naming.fit.terms:
        rivals = [naming.fit.simulated, *(a.fit.simulated for a in naming.alternatives)]
        follows = comparison.where_vanes_follow(rivals)
        if comparison.misfit_outside(follows, naming.fit.simulated) > TURNING_MISFIT:
            comparison = comparison.within(follows)
            searcher, naming = _explained(comparison, baseline, known, workers, report)
    judged = _judged(searcher, naming, baseline, workers, report, with_proof)
    if not judged.is_claim:
        # A second effect that does not hold must not take the first one along.
        alone = named_alone(searcher, naming)
        if alone is not None:
            single = _judged(searcher, alone, baseline, workers, report, with_proof)
            judged = single if single.is_claim else judged
    naming = judged.naming
    named = naming.fit.terms if judged.is_claim else ()
    # What commissioning found makes up for the reference as much as for the instrument.
    station = planted(baseline.original, named)
    remainder = judged.remainder
    return Diagnosis(
        recording=recording.name,
        verdict=judged.verdict,
        calibrated=baseline.calibrated,
        findings=judged.findings,
        unexplained=Unexplained(
            remainder.p, remainder.share, judged.regions, _described(judged, baseline)
        ),
        smallest_detectable={k: (v, unit) for k, (v, unit, _) in judged.detectable.items()},
        station=station,
        baseline=baseline,
        comparison=comparison,
        naming=naming,
        simulated=searcher.bank.without,
        corrected=naming.fit.simulated if named else searcher.bank.without,
        regions_before=judged.regions_before,
        objection=judged.objection,
        bank=judged.bank,
    )
