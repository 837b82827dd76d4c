"""Accuracy on the healthy recordings of the shared material: the README's table."""

from __future__ import annotations

import math
from pathlib import Path

from wind_sensors.estimation import EstimatorSettings, process
from wind_sensors.estimation.scoring import agreement
from wind_sensors.recordings import read_recording


def main() -> None:
    """Print one row per recording."""
    root = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    folders = sorted(root.glob("station-*/healthy-*"))
    if not folders:
        print("The shared recordings are not here.")
        return
    print(
        "| recording | vector mean | scalar mean | scalar, slow excess of the reference allowed "
        "| direction | rms error kalman / inverse / naive, fast part [m/s] | in 90 % interval |"
    )
    print("|---|---|---|---|---|---|---|")
    for folder in folders:
        recording = read_recording(folder)
        best, inverse, naive = (
            agreement(process(recording, EstimatorSettings(method=m, bandwidth=2.0, window=900.0)))
            for m in ("kalman", "inverse", "naive")
        )
        print(
            f"| {folder.parent.name}/{folder.name} | {100 * best.vector_speed_error:+.2f} % "
            f"| {100 * best.scalar_speed_error:+.2f} % "
            f"| {100 * best.scalar_speed_error_allowed:+.2f} % "
            f"| {math.degrees(best.direction_error):+.2f} deg "
            f"| {best.rms_fast:.3f} / {inverse.rms_fast:.3f} / {naive.rms_fast:.3f} "
            f"| {100 * best.coverage:.1f} % |",
            flush=True,
        )


if __name__ == "__main__":
    main()
