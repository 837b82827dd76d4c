"""Verdicts on the shared recordings of three stations: healthy, open and sealed.

    OPENBLAS_NUM_THREADS=1 python benchmarks/station_recordings.py [healthy] [open] [sealed]

A healthy recording is judged by the others of its station, the rest by all healthy ones.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.recordings import read_recording

WORKERS = 2


def main() -> None:
    """Print one row per recording."""
    root = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    kinds = sys.argv[1:] or ["healthy", "open", "sealed"]
    stations = sorted(root.glob("station-*"))
    if not stations:
        print("The shared recordings are not here.")
        return
    print("| recording | verdict | effect | size (95 % interval) | share | p | held out, or left |")
    print("|---|---|---|---|---|---|---|")
    for station in stations:
        healthy = sorted(station.glob("healthy-*"))
        known = _learnt(healthy) if {"open", "sealed"} & set(kinds) else None
        for folder in sorted(station.glob("*-*")):
            if folder.name.partition("-")[0] not in kinds:
                continue
            baseline = known
            if folder in healthy:
                baseline = _learnt([other for other in healthy if other != folder])
            assert baseline is not None
            begin = time.perf_counter()
            found = diagnose(read_recording(folder), baseline, workers=WORKERS)
            took = time.perf_counter() - begin
            print(
                f"| {station.name}/{folder.name} | {_row(found)} | <!-- {took:.0f} s -->",
                flush=True,
            )


def _learnt(folders: list[Path]) -> Baseline:
    return learn([read_recording(folder) for folder in folders], workers=WORKERS)


def _row(found: Diagnosis) -> str:
    if not found.findings:
        left = found.unexplained
        said = left.description if found.verdict != "none" else ""
        return f"{found.verdict} |  |  |  | {left.p:.2g} | {said}"
    proof = found.findings[0].proof
    removed = "" if proof is None else f"{100 * proof.excess_removed:.0f} %"
    return " | ".join(
        (
            found.verdict,
            "<br>".join(f"{f.term.effect.name} ({f.term.instrument})" for f in found.findings),
            "<br>".join(_sizes(f) for f in found.findings),
            "<br>".join(f"{100 * f.share:.0f} %" for f in found.findings),
            "<br>".join(f"{f.p:.2g}" for f in found.findings),
            removed,
        )
    )


def _sizes(finding: Finding) -> str:
    parts = [
        f"{name.replace('_', ' ')} {e.value:.3g} ({e.low:.3g} to {e.high:.3g})"
        + ("" if e.unit == "1" else f" {e.unit}")
        for name, e in finding.parameters.items()
    ]
    return "; ".join(parts)


if __name__ == "__main__":
    main()
