"""`diagnosis.json`: a diagnosis as plain data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wind_sensors.diagnosis.explaining.terms import ALWAYS
from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.diagnosis.proving.proof import Proof
from wind_sensors.diagnosis.verdict import Diagnosis
from wind_sensors.station.silence import Silent, told_first


def as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """The content of `diagnosis.json`."""
    length = diagnosis.comparison.grid.n * diagnosis.comparison.grid.dt
    return {
        "recording": diagnosis.recording,
        "verdict": diagnosis.verdict,
        "null_calibrated": diagnosis.calibrated,
        "findings": [finding_json(f, length) for f in diagnosis.findings],
        "silent": silent_json(diagnosis.silent),
        "notes": list(diagnosis.comparison.recording.notes),
        "unexplained": {
            "p": round(diagnosis.unexplained.p, 4),
            "share": round(diagnosis.unexplained.share, 4),
            "description": told_first(diagnosis.silent, diagnosis.unexplained.description),
            "regions": [
                {
                    "channel": f.region.channel, "kind": f.region.kind, "label": f.region.label,
                    "excess": f.excess, "unit": f.unit, "score": f.score,
                }
                for f in diagnosis.unexplained.regions
            ],
        },
        "smallest_detectable": {
            key: {"value": _rounded(s.value), "unit": s.unit, "parameter": s.parameter}
            for key, s in diagnosis.smallest_detectable.items()
        },
    }


def silent_json(silent: Sequence[Silent]) -> list[dict[str, str]]:
    """Instruments that say nothing in the whole recording."""
    return [{"instrument": s.instrument, "topic": s.topic, "words": s.words} for s in silent]


def _rounded(value: float, unit: str = "") -> float | None:
    """To five digits, moments of long recordings to the second."""
    if not np.isfinite(value):
        return None
    return float(round(value)) if unit == "s" and abs(value) >= 1e5 else float(f"{value:.5g}")


def _alternatives(finding: Finding) -> list[tuple[str, str, float]]:
    """The nearest of each other effect and instrument: starts of one effect are no alternatives."""
    nearest: dict[tuple[str, str], float] = {}
    for name, instrument, behind in finding.alternatives:
        key = (name, instrument)
        nearest[key] = min(behind, nearest.get(key, behind))
    nearest.pop((finding.term.effect.name, finding.term.instrument), None)
    return [(*key, behind) for key, behind in nearest.items()][:6]


def finding_json(finding: Finding, length: float) -> dict[str, Any]:
    """One finding; `length` is the recording's [s]."""
    term = finding.term
    begin, end = term.interval
    region = finding.located.region
    alternatives = _alternatives(finding)
    out: dict[str, Any] = {
        "effect": term.effect.name,
        "instrument": term.instrument,
        "located": {
            "channel": region.channel.partition("/")[2],
            "time": [begin, length if end is None else end],
            "region": {region.kind: [region.low, region.high]},
            "excess": _rounded(finding.located.excess),
            "unit": finding.located.unit,
            "share": _rounded(finding.share),
            "p": finding.p if np.isfinite(finding.p) else None,
        },
        "gain": _rounded(finding.gain) if finding.gain else None,
        "physics": term.effect.meaning,
        "equation": term.effect.equation,
        "source": term.effect.source,
        "parameters": {
            key: {
                "value": _rounded(e.value, e.unit), "low": _rounded(e.low, e.unit),
                "high": _rounded(e.high, e.unit), "unit": e.unit,
            }
            for key, e in finding.parameters.items()
        },
        "relative_size": _rounded(term.relative_size) if np.isfinite(finding.share) else None,
        "interval_s": None if term.interval == ALWAYS else [begin, end],
        "alternatives": [
            {"effect": name, "instrument": instrument, "log_likelihood_behind": _rounded(behind)}
            for name, instrument, behind in alternatives
        ],
        "separate_by": {
            name: term.effect.confusable[name]
            for name, _, _ in alternatives
            if name in term.effect.confusable
        },
    }
    if finding.set_number:
        out["set"] = finding.set_number
    if finding.proof is not None:
        out["proof"] = _proof_json(finding.proof)
    return out


def _proof_json(proof: Proof) -> dict[str, object]:
    def number(value: float | None) -> float | None:
        return None if value is None else _rounded(value)

    correlation = proof.wind_correlation
    return {
        "score_before": _rounded(proof.before),
        "score_after": _rounded(proof.after),
        "score_floor": _rounded(proof.floor),
        "excess_removed": _rounded(proof.excess_removed),
        "interval": [_rounded(proof.low), _rounded(proof.high)],
        "placebo_removed": number(proof.placebo_removed),
        "curve_removed": number(proof.curve_removed),
        "calm_to_windy_removed": number(proof.transfer),
        "coverage_of_95": number(proof.coverage),
        "correlation_with_wind": correlation and [_rounded(c) for c in correlation],
    }
