"""Wind of the shared recordings before and after the diagnosis, against that of healthy ones.

Each open and each sealed recording of the shared material is diagnosed with the healthy recordings
of its station as baseline. Its wind is estimated with its own station file, with
`station_corrected.yaml` and with the named physics on its own station file, and compared with the
reference; the wind of the healthy recordings with their own station files says how close one can
come. A sonic half a metre away differs from the instruments also on a healthy day, the more so the
stronger the gusts. Therefore differences are divided by the gusts of their own recording, and the
fast part of them by what the reference's distance, path and noise make in the turbulence of the
recording.

Run: python benchmarks/corrected_wind.py -o build/corrected_wind
Diagnoses and baselines are kept there; `--again` makes them anew.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.progress import Progress, TaskID

from wind_sensors.diagnosis.explaining.terms import planted
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.estimation import EstimatorSettings, Method, process
from wind_sensors.estimation.scoring import agreement
from wind_sensors.recordings import read_recording
from wind_sensors.recordings.station_files import load_station, shipped_profiles
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording
from wind_sensors.station.writing import station_to_yaml

FloatArray = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2] / "shared" / "recordings"
SKIPPED = 30.0
"""Seconds at the start that are left out, while the estimator learns the turbulence."""
GUST_TIME = 30.0
"""Changes of the wind within this time are its gusts [s]."""
MEAN_LIMIT = 0.007
RMS_LIMIT = 0.2


@dataclass(frozen=True)
class Closeness:
    """An estimated horizontal wind against the reference.

    Attributes:
        vector_error: Size of the error of the mean vector, relative to it.
        turn: Of the mean vector [rad].
        rms: Of the instantaneous vector difference [m/s].
        relative_rms: The same over the reference's gusts.
        fast: Its part above 0.15 Hz over what the reference alone makes there.
        window_error: Relative error of the speed of the window's vector mean (`wind/mean`).
    """

    vector_error: float
    turn: float
    rms: float
    relative_rms: float
    fast: float
    window_error: float


def gusts(velocity: FloatArray, seconds: FloatArray) -> float:
    """Rms departure of a horizontal wind from its own mean over `GUST_TIME` [m/s]."""
    width = max(round(GUST_TIME / float(np.median(np.diff(seconds)))), 1)
    sums = np.cumsum(np.vstack((np.zeros(2), velocity)), axis=0)
    means = (sums[width:] - sums[:-width]) / width
    middle = velocity[width // 2 : width // 2 + means.shape[0]]
    return float(np.sqrt(np.mean(np.sum(np.square(middle - means), axis=1))))


def closeness(recording: Recording, station: Station, method: Method) -> Closeness:
    """Process a recording with a station and compare with its reference.

    Args:
        recording: With a reference wind.
        station: What is taken to be mounted.
        method: Of the estimator.
    """
    reference = recording.reference
    if reference is None:
        raise ValueError(f"{recording.name} has no reference")
    seen = replace(recording, station=station)
    length = (reference.time[-1] - reference.time[0]) * 1e-9
    processed = process(seen, EstimatorSettings(method=method, bandwidth=2.0, window=length + 60.0))
    origin = processed.time[0] + round(SKIPPED * 1e9)
    inside = (processed.time >= max(origin, reference.time[0])) & (
        processed.time <= reference.time[-1]
    )
    found = processed.velocity[inside, :2]
    at = (processed.time[inside] - reference.time[0]) * 1e-9
    seconds = (reference.time - reference.time[0]) * 1e-9
    true = np.stack([np.interp(at, seconds, reference.velocity[:, i]) for i in range(2)], axis=1)
    a, b = found.mean(axis=0), true.mean(axis=0)
    size = float(np.hypot(*b))
    rms = float(np.sqrt(np.mean(np.sum(np.square(found - true), axis=1))))
    agreed = agreement(processed, skip=SKIPPED)
    window = processed.windows[0].vector_mean[:2]
    whole = reference.velocity[:, :2].mean(axis=0)
    return Closeness(
        vector_error=float(np.hypot(*(a - b))) / size,
        turn=math.atan2(a[1] * b[0] - a[0] * b[1], float(a @ b)),
        rms=rms,
        relative_rms=rms / gusts(true, at),
        fast=agreed.rms_fast / agreed.reference_fast,
        window_error=float(np.hypot(*window) / np.hypot(*whole)) - 1.0,
    )


def baseline_of(folder: Path, healthy: list[Recording], kept: Path, again: bool) -> Baseline:
    """The baseline of a station, from its file where there is one."""
    file = kept / f"{folder.name}.json"
    if file.exists() and not again:
        return Baseline.from_json(file.read_text(encoding="utf-8"))
    baseline = learn(healthy)
    file.write_text(baseline.to_json() + "\n", encoding="utf-8")
    return baseline


def corrected(
    recording: Recording, baseline: Baseline, stem: Path, again: bool
) -> tuple[str, Station, Station]:
    """What was found, `station_corrected.yaml`, and the found physics on the station's own file."""
    files = [stem.with_suffix(ending) for ending in (".txt", ".yaml", ".own.yaml")]
    if again or not all(f.exists() for f in files):
        diagnosis = diagnose(recording, baseline)
        terms = diagnosis.naming.fit.terms if diagnosis.findings else ()
        names = " + ".join(t.effect.name for t in terms)
        files[0].write_text(f"{diagnosis.verdict}: {names or 'nothing'}", encoding="utf-8")
        for file, station in (
            (files[1], diagnosis.station), (files[2], planted(recording.station, terms)),
        ):
            file.write_text(station_to_yaml(station, shipped_profiles()), encoding="utf-8")
    return files[0].read_text(encoding="utf-8"), load_station(files[1]), load_station(files[2])


@dataclass(frozen=True)
class Row:
    """One recording with its own station file, the corrected one, and the physics on its own."""

    name: str
    found: str
    before: Closeness
    after: Closeness | None = None
    on_own: Closeness | None = None


def station_rows(
    folder: Path, kept: Path, method: Method, again: bool, progress: Progress, task: TaskID
) -> tuple[list[Row], list[Row]]:
    """Healthy recordings of one station, and the others."""
    healthy = [read_recording(f) for f in sorted(folder.glob("healthy-*"))]
    baseline = baseline_of(folder, healthy, kept, again)
    place = folder.name.removeprefix("station-")
    well = []
    for recording in healthy:
        own = closeness(recording, recording.station, method)
        well.append(Row(f"{place}/{recording.name}", "", own))
        progress.advance(task)
    ill = []
    for path in sorted((*folder.glob("open-*"), *folder.glob("sealed-*"))):
        recording = read_recording(path)
        stem = kept / f"{folder.name}-{path.name}"
        found, station, on_own = corrected(recording, baseline, stem, again)
        ill.append(
            Row(
                f"{place}/{path.name}", found,
                *(closeness(recording, s, method) for s in (recording.station, station, on_own)),
            )
        )
        progress.advance(task)
    return well, ill


def print_table(method: Method, stations: list[tuple[list[Row], list[Row]]]) -> None:
    """As Markdown; `x1.0` is the mean of the station's healthy recordings."""
    print(f"\nMethod `{method}`\n")
    print(
        "| recording | found | mean vector | direction | rms m/s | rms/gusts | fast rms "
        "| window mean | mean vector, physics on own file | mean within 0.7 % | rms within 20 % |"
    )
    print("|" + "---|" * 11)
    for well, ill in stations:
        usual = float(np.mean([r.before.relative_rms for r in well]))
        usual_fast = float(np.mean([r.before.fast for r in well]))
        for row in well:
            c = row.before
            print(
                f"| {row.name} | | {100 * c.vector_error:.2f} % | {math.degrees(c.turn):+.2f} deg "
                f"| {c.rms:.3f} | x{c.relative_rms / usual:.2f} | x{c.fast / usual_fast:.2f} "
                f"| {100 * c.window_error:+.2f} % | | | |"
            )
        for row in ill:
            was, now, own = row.before, row.after, row.on_own
            if now is None or own is None:
                continue
            mean = "yes" if now.vector_error <= MEAN_LIMIT else "no"
            if own.vector_error <= MEAN_LIMIT and mean == "no":
                mean = "on own file"
            close = max(now.relative_rms / usual, now.fast / usual_fast) <= 1.0 + RMS_LIMIT
            print(
                f"| {row.name} | {row.found} "
                f"| {100 * was.vector_error:.2f} to {100 * now.vector_error:.2f} % "
                f"| {math.degrees(was.turn):+.2f} to {math.degrees(now.turn):+.2f} deg "
                f"| {was.rms:.3f} to {now.rms:.3f} "
                f"| x{was.relative_rms / usual:.2f} to x{now.relative_rms / usual:.2f} "
                f"| x{was.fast / usual_fast:.2f} to x{now.fast / usual_fast:.2f} "
                f"| {100 * was.window_error:+.2f} to {100 * now.window_error:+.2f} % "
                f"| {100 * own.vector_error:.2f} % | {mean} | {'yes' if close else 'no'} |"
            )


def main() -> None:
    """Diagnose, process, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("build/corrected_wind"))
    parser.add_argument("--method", choices=("kalman", "inverse"), action="append")
    parser.add_argument("--again", action="store_true", help="diagnose anew")
    options = parser.parse_args()
    folders = sorted(ROOT.glob("station-*"))
    if not folders:
        print("The shared recordings are not here.")
        return
    options.output.mkdir(parents=True, exist_ok=True)
    methods: list[Method] = options.method or ["kalman", "inverse"]
    total = sum(len(list(f.glob("*-*"))) for f in folders)
    again = options.again
    for method in methods:
        with Progress(console=Console(stderr=True), transient=True) as progress:
            task = progress.add_task(f"method {method}", total=total)
            stations = [
                station_rows(f, options.output, method, again, progress, task) for f in folders
            ]
        again = False
        print_table(method, stations)


if __name__ == "__main__":
    main()
