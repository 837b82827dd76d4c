"""What a diagnosis without a measured reference says: the same verdicts, on other evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.json_output import finding_json, silent_json
from wind_sensors.diagnosis.proving.decision import Verdict
from wind_sensors.diagnosis.proving.findings import Finding, Unexplained
from wind_sensors.station.model import Station
from wind_sensors.station.silence import Silent

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Panel:
    """A residual before and after, over something: one figure of the page.

    Attributes:
        title: What is compared.
        axis: Label of the abscissa.
        at: Abscissa, shape (n,).
        before, after: Mean residual in each bin, shape (n,).
        error: Standard error of them, shape (n,).
        unit: Unit of the residuals.
    """

    title: str
    axis: str
    at: FloatArray
    before: FloatArray
    after: FloatArray
    error: FloatArray
    unit: str


@dataclass(frozen=True)
class Outcome:
    """Everything that is said about a recording with a borrowed or latent reference.

    Attributes:
        recording: Its name.
        verdict: In one word.
        calibrated: Whether healthy recordings stand behind the null.
        findings: Named effects; of an ambiguous set, all members.
        unexplained: What is left.
        smallest_detectable: By effect and instrument: the least size that would have shown.
        station: The station with the named physics.
        length: Of the recording [s].
        reference: What took the place of a measured wind, for people.
        declined: What was seen and not claimed, and why.
        panels: Figures.
        healthy: Names of the healthy recordings.
        silent: Instruments of the station that say nothing in the whole recording.
    """

    recording: str
    verdict: Verdict
    calibrated: bool
    findings: tuple[Finding, ...]
    unexplained: Unexplained
    smallest_detectable: Mapping[str, SmallestSize]
    station: Station
    length: float
    reference: str
    declined: tuple[str, ...] = ()
    panels: tuple[Panel, ...] = ()
    healthy: tuple[str, ...] = ()
    silent: tuple[Silent, ...] = ()


def verdict_of(findings: tuple[Finding, ...], unexplained: Unexplained, limit: float) -> Verdict:
    """The word for findings and a remainder.

    Args:
        findings: All of them.
        unexplained: What is left.
        limit: Share of the misfit above which a remainder counts.
    """
    if any(f.set_number == 0 for f in findings):
        return "named"
    if findings:
        return "ambiguous"
    if unexplained.p < 0.01 and unexplained.share > limit:
        return "unknown"
    return "none"


def with_silent(outcome: Outcome, silent: Sequence[Silent]) -> Outcome:
    """The outcome with what is said of instruments that say nothing: that all is well is not.

    Args:
        outcome: Without a word of them.
        silent: Instruments of the station that say nothing in the whole recording.
    """
    if not silent:
        return outcome
    said = (*(each.words for each in silent), outcome.unexplained.description)
    description = "; ".join(part for part in said if part)
    return replace(
        outcome,
        verdict="unknown" if outcome.verdict == "none" else outcome.verdict,
        unexplained=replace(outcome.unexplained, description=description),
        silent=tuple(silent),
    )


def outcome_json(outcome: Outcome) -> dict[str, Any]:
    """The content of `diagnosis.json`."""
    return {
        "recording": outcome.recording,
        "verdict": outcome.verdict,
        "null_calibrated": outcome.calibrated,
        "reference": outcome.reference,
        "findings": [finding_json(f, outcome.length) for f in outcome.findings],
        "unexplained": {
            "p": round(outcome.unexplained.p, 4),
            "share": round(outcome.unexplained.share, 4),
            "description": outcome.unexplained.description,
        },
        "silent": silent_json(outcome.silent),
        "declined": list(outcome.declined),
        "smallest_detectable": {
            key: {"value": float(f"{s.value:.4g}"), "unit": s.unit, "parameter": s.parameter}
            for key, s in outcome.smallest_detectable.items()
        },
    }
