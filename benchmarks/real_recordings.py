"""Figures of diagnosed recordings of means: residuals of each pair before and after.

    python benchmarks/real_recordings.py RECORDING DIAGNOSIS -o FOLDER

RECORDING was imported, DIAGNOSIS is what `wind diagnose` wrote about it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from wind_sensors.diagnosis.means import panels
from wind_sensors.diagnosis.means.averages import averages_of
from wind_sensors.diagnosis.means.pair import pair_of, pairs_of
from wind_sensors.diagnosis.means.silences import silences, without_silences
from wind_sensors.recordings import load_station, read_recording
from wind_sensors.report import style
from wind_sensors.report.outcome_page import panel_figure

WIDTH = 8.0
"""Of a figure [inch]."""


def main() -> None:
    """Draw and say what was written."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("diagnosis", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    recording = read_recording(options.recording)
    corrected = load_station(options.diagnosis / "station_corrected.yaml")
    averages = averages_of(recording)
    averages = without_silences(averages, silences(averages))
    options.output.mkdir(parents=True, exist_ok=True)
    for first, second in pairs_of(averages):
        pair = pair_of(averages, first, second)
        shown = panels.of_pair(pair, recording.station, corrected)
        with style.house():
            target = options.output / f"means_{first}_{second}.png"
            panel_figure(shown[:2], recording.start, WIDTH).savefig(target, dpi=80)
        print(f"wrote {target}")


if __name__ == "__main__":
    main()
