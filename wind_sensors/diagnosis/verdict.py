"""The diagnosis of one recording: verdict, findings, what is left, what could have been seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.baseline import Baseline
from wind_sensors.diagnosis.calibrated_range import is_too_calm, need_calibration, too_calm
from wind_sensors.diagnosis.comparison import Comparison, Simulated, prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect
from wind_sensors.diagnosis.explanation import ACCEPTED_GAIN, Alternative, Naming
from wind_sensors.diagnosis.findings import Finding, Unexplained, equal_explanations, findings_of
from wind_sensors.diagnosis.fitting import ALWAYS, planted
from wind_sensors.diagnosis.guesses import guesses_of
from wind_sensors.diagnosis.naming import name
from wind_sensors.diagnosis.noise_level import Excess, described, excess_of
from wind_sensors.diagnosis.regions import Found, RegionBank, region_bank, strongest
from wind_sensors.diagnosis.screening import group_templates
from wind_sensors.diagnosis.search import PENALTY_PER_PARAMETER, Searcher, searcher_of
from wind_sensors.diagnosis.whitening import Whitener
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]

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
RIVAL_SCORE = 0.4
"""A smaller remainder, of this part of the score, with this share of it says as much: it rivals
what was named."""

REMAINDER_P = 0.05

NOISY = 5.0
VERY_NOISY = 8.0
"""Noise beyond this many standard deviations of healthy days is physics that a name left out;
without any name, where a reference of another day may err more, beyond the second."""

MOST_SHARED = 1.25
"""Largest sum of the shares of the misfit that two effects explain in the other's presence."""

MOST_FREE_PARAMETERS = 2
"""An explanation with more parameters must also stand out somewhere in the data."""

TOO_BLUNT = 6.0
"""A record that shows no effect below this many smallest sizes is inconclusive."""


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
    bank: RegionBank | None = field(default=None, repr=False)


def _remainder(
    naming: Naming, bank: RegionBank, comparison: Comparison
) -> tuple[float, float, float]:
    """Largest remaining score relative to its limit, its p value, its share of the misfit.

    Of the channels that the named effects reach: what another instrument shows beside them says
    nothing against the names.
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
    return left / float(limits[worst]), bank.p_value(left), share


def _with_own_noise(naming: Naming) -> set[str]:
    """Instruments whose named effects leave noise of their own."""
    comparison = naming.whitener.comparison
    return {
        instrument
        for term in naming.fit.terms
        if term.effect.noisy
        for instrument in comparison.affected(comparison.station, term.instrument)
    }


def _patchwork(naming: Naming) -> bool:
    """Whether passing effects were pieced together on one instrument: nothing known fits."""
    passing = [t.instrument for t in naming.fit.terms if t.interval != ALWAYS]
    return len(passing) != len(set(passing))


def made_up(findings: tuple[Finding, ...]) -> bool:
    """Whether several effects were put together that the data do not show one by one.

    One of them stands out nowhere, or they undo each other: each has to make good what the other
    does.
    """
    own = [f for f in findings if f.proof is not None]
    if len(own) < 2:
        return False
    return any(f.p > REMAINDER_P for f in own) or sum(f.share for f in own) > MOST_SHARED


def _structured(found: list[Found]) -> list[Found]:
    """Regions of time, speed and direction before those of spectra and statistics."""
    return sorted(found, key=lambda f: f.region.kind in {"frequency", "spectrum", "statistic"})


def _description(found: Found) -> str:
    channel = found.region.channel
    if found.region.kind in {"spectrum", "statistic", "frequency"}:
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
    out: dict[str, tuple[float, str, float]] = {}
    for (effect_name, _), members in group_templates(searcher.bank.templates).items():
        best = max(members, key=lambda k: float(power[k]))
        if power[best] < 1e-6:
            continue
        template = searcher.bank.templates[best]
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


def _verdict(
    naming: Naming,
    equal: list[tuple[int, Alternative]],
    remainder: tuple[float, float, float],
    detectable: Mapping[str, tuple[float, str, float]],
    located_p: float,
    excess: Excess,
) -> Verdict:
    left, p, share = remainder
    structured = left > 1.0 and p < REMAINDER_P
    if excess.score > (NOISY if naming.fit.terms else VERY_NOISY):
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
    rivals = left > RIVAL_SCORE and p < REMAINDER_P and share > RIVAL_SHARE
    if (structured and share > REMAINDER_SHARE) or rivals or _patchwork(naming):
        return "unknown"
    return "ambiguous" if equal else "named"


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
    comparison = prepare(recording, baseline.station)
    guesses = {
        key: terms for key, terms in guesses_of(comparison, baseline.station).items()
        if key[0] in known
    }  # fmt: skip
    searcher = searcher_of(
        comparison, baseline, known, guesses, workers, report("simulating the catalogue")
    )
    naming = name(searcher, report("fitting effects"))
    whitener = naming.whitener
    bank = region_bank(whitener, searcher.bank.without)
    report("locating")(0.5)
    before = strongest(whitener, bank, naming.nothing, searcher.bank.without)
    rest = region_bank(naming.adequate, searcher.bank.without)
    left = naming.adequate.of(naming.fit.simulated)
    after = strongest(naming.adequate, rest, left, naming.fit.simulated)
    remainder = _remainder(naming, rest, comparison)
    detectable = smallest_detectable(searcher, whitener)
    equal = equal_explanations(naming)
    located_p = bank.p_value(max(f.score for f in before))
    excess = excess_of(comparison, naming.fit.simulated, baseline, _with_own_noise(naming))
    verdict = _verdict(naming, equal, remainder, detectable, located_p, excess)
    calm = is_too_calm(comparison, baseline) and verdict != "none" and (
        not naming.fit.terms or need_calibration(naming.fit.terms)
    )
    if calm:
        verdict = "inconclusive"
    report("proving")(0.2)
    findings = findings_of(naming, equal, before, bank, baseline, with_proof) if verdict in {
        "named", "ambiguous"
    } else ()  # fmt: skip
    report("proving")(1.0)
    refuted = findings and not _borne_out(findings)
    if refuted:
        refuted_names = ", ".join(f.term.effect.name for f in findings)
        verdict, findings = "none", ()
    if made_up(findings):
        verdict, findings = "unknown", ()
    named = naming.fit.terms if verdict in {"named", "ambiguous"} else ()
    # What commissioning found makes up for the reference as much as for the instrument.
    station = planted(baseline.original, named)
    if verdict == "unknown":
        after = _structured(before)
    description = ""
    if verdict == "unknown" or remainder[1] < REMAINDER_P:
        description = _description(after[0])
    if verdict == "unknown" and excess.score > VERY_NOISY:
        description = described(excess)
    if calm:
        description = too_calm(baseline)
    if refuted:
        description = (
            f"{refuted_names} would fit, but no region stands out and blocks that were not fitted "
            "do not bear it out"
        )
    return Diagnosis(
        recording=recording.name,
        verdict=verdict,
        calibrated=baseline.calibrated,
        findings=findings,
        unexplained=Unexplained(remainder[1], remainder[2], tuple(after), description),
        smallest_detectable={k: (v, unit) for k, (v, unit, _) in detectable.items()},
        station=station,
        baseline=baseline,
        comparison=comparison,
        naming=naming,
        simulated=searcher.bank.without,
        corrected=naming.fit.simulated if named else searcher.bank.without,
        regions_before=tuple(before),
        bank=bank,
    )


def _borne_out(findings: tuple[Finding, ...]) -> bool:
    """Whether a region of the data or held-out blocks speak for the findings."""
    proofs = [f.proof for f in findings if f.proof is not None]
    located = any(f.p < REMAINDER_P for f in findings)
    return located or not proofs or proofs[0].excess_removed > LEAST_REMOVED
