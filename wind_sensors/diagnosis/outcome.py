"""What a diagnosis without a measured reference says: the same verdicts, on other evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.json_output import finding_json, silent_json
from wind_sensors.diagnosis.proving.findings import Finding, Unexplained
from wind_sensors.diagnosis.proving.rules import Verdict, with_silence
from wind_sensors.station.model import Station
from wind_sensors.station.silence import Silent, told_first

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
        unexplained: What is left of what speaks.
        smallest_detectable: By effect and instrument: the least size that would have shown.
        station: The station with the named physics.
        start: Of the recording [ns].
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
    start: int
    length: float
    reference: str
    declined: tuple[str, ...] = ()
    panels: tuple[Panel, ...] = ()
    healthy: tuple[str, ...] = ()
    silent: tuple[Silent, ...] = ()

    @property
    def left_over(self) -> str:
        """What says nothing, and what is left of the rest, for people."""
        return told_first(self.silent, self.unexplained.description)


def with_silent(outcome: Outcome, silent: Sequence[Silent]) -> Outcome:
    """The outcome with what is said of instruments that say nothing: that all is well is not.

    Args:
        outcome: Without a word of them.
        silent: Instruments of the station that say nothing in the whole recording.
    """
    if not silent:
        return outcome
    return replace(
        outcome, verdict=with_silence(outcome.verdict, silent), silent=tuple(silent)
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
            "description": outcome.left_over,
        },
        "silent": silent_json(outcome.silent),
        "declined": list(outcome.declined),
        "smallest_detectable": {
            key: {"value": float(f"{s.value:.4g}"), "unit": s.unit, "parameter": s.parameter}
            for key, s in outcome.smallest_detectable.items()
        },
    }
