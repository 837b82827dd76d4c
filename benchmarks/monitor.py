"""What the monitor tells of recordings with known answers, and when.

Recordings of a station are replayed by their stamps through the watch of `monitor_node`, with a
baseline from healthy recordings of the station: for a healthy one the others of it. Times are those
of the recording.

Run: python benchmarks/monitor.py ../shared/recordings/station-*
     python benchmarks/monitor.py DEVELOPMENT_SET/A1 --names 'healthy-*' '*-3' --healthy 3
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.watch import Watch, WatchSettings
from wind_sensors.diagnosis.watch.finding import Finding
from wind_sensors.diagnosis.watch.naming import Candidate
from wind_sensors.diagnosis.watch.replaying import replay
from wind_sensors.recordings import read_recording
from wind_sensors.station.model import Station


class Listening(Watch):
    """A watch that keeps what it told first of each mismatch, and how near it was to an alarm.

    Args:
        station: The station.
        baseline: From healthy recordings.

    Attributes:
        told: First findings, by the time they were told.
        highest: The largest alarm level while nothing was told; 1 would be an alarm.
    """

    def __init__(self, station: Station, baseline: Baseline) -> None:
        super().__init__(station, WatchSettings(), baseline)
        self.told: dict[int, Finding] = {}
        self.highest = 0.0

    def add_wind(self, time_ns: int, velocity: npt.ArrayLike) -> None:
        """Take the reference's wind, then see what is told by now."""
        super().add_wind(time_ns, velocity)
        if self.finding is None:
            self.highest = max(self.highest, self.alarm_level)
        else:
            self.told.setdefault(self.finding.detected, self.finding)


def _listed(candidates: Sequence[Candidate]) -> str:
    return ", ".join(f"{c.effect} {100 * c.weight:.0f} %" for c in candidates) or "no name"


def _row(folder: Path, baseline: Baseline) -> str:
    """What was told of one recording, as a row of a table."""
    recording = read_recording(folder)
    watch = Listening(recording.station, baseline)
    begin = time.process_time()
    replay(recording, watch)
    took = time.process_time() - begin
    told = "; ".join(
        f"{(at - recording.start) / 6e10:.1f} min {finding.channel}: {_listed(finding.candidates)}"
        for at, finding in watch.told.items()
    )
    last = watch.finding
    end = "" if last is None else f"{last.channel}: {_listed(last.candidates)}"
    return (
        f"| {folder.parent.name} {folder.name} | {told or 'nothing'} | {end} | "
        f"{50.0 * watch.highest:.0f} of 50 | {watch.blocks} | {took:.0f} s |"
    )


def main() -> None:
    """Replay and print one row per recording."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("stations", nargs="+", type=Path, help="folders of recordings")
    parser.add_argument("--names", nargs="+", default=["healthy-*", "open-*"], help="which ones")
    parser.add_argument("--healthy", type=int, help="so many healthy ones make a baseline; all")
    options = parser.parse_args()
    np.seterr(all="ignore")
    print("| recording | told | at the end | highest while nothing was told | blocks | processor |")
    print("|---|---|---|---|---|---|")
    known: dict[tuple[Path, ...], Baseline] = {}
    for station in options.stations:
        healthy = sorted(station.glob("healthy-*"))
        for folder in sorted(station.iterdir()):
            if not any(fnmatch(folder.name, name) for name in options.names):
                continue
            normal = tuple([h for h in healthy if h != folder][: options.healthy])
            if normal not in known:
                known[normal] = learn([read_recording(h) for h in normal])
            print(_row(folder, known[normal]), flush=True)


if __name__ == "__main__":
    main()
