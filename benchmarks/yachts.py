"""The wind two racing yachts sailed in: scatter before and after their motion is removed.

Raw NMEA 0183 logs are imported through the mapping that ships, processed, and judged by
`wind_sensors.report.heading_scatter`. No parameter is fitted; even the magnetic declination stays
at the mapping's zero unless it is given.

Run: python benchmarks/yachts.py ../shared/real/yacht_nmea/*.txt.gz
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from wind_sensors.cli.import_ import load_mapping
from wind_sensors.estimation import METHODS, EstimatorSettings, process
from wind_sensors.recordings import read_recording
from wind_sensors.recordings.importing import import_files, write_imported
from wind_sensors.report.heading_scatter import heading_scatter
from wind_sensors.station.signals import Recording


def imported(log: Path, declination_deg: float) -> Recording:
    """A log as a recording, through the files that the commands would write."""
    mapping = load_mapping("nmea_yacht")
    with TemporaryDirectory() as folder:
        target = Path(folder) / "yacht"
        write_imported(target, import_files([log], mapping), mapping)
        recording = read_recording(target)
    platform = recording.station.platform
    assert platform is not None
    platform = platform.model_copy(update={"magnetic_declination_deg": declination_deg})
    return replace(
        recording, station=recording.station.model_copy(update={"platform": platform})
    )


def main() -> None:
    """Import, process and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--declination-deg", type=float, default=0.0, help="east positive")
    options = parser.parse_args()
    table = Table("log", "method", "blocks", "wind m/s", "before m/s", "after m/s", "ratio")
    for log in track(options.logs, transient=True):
        recording = imported(log, options.declination_deg)
        for method in METHODS:
            settings = EstimatorSettings(method=method, output_rate=1.0, smoother_lag=10.0)
            found = process(recording, settings)
            scatter = heading_scatter(found)
            every = heading_scatter(found, 0.0)
            table.add_row(
                log.name.split(".")[0],
                method,
                f"{len(scatter.blocks)} of {len(every.blocks)}",
                f"{np.hypot(*found.velocity[:, :2].T).mean():.2f}",
                f"{scatter.before:.2f} (all {every.before:.2f})",
                f"{scatter.after:.2f} (all {every.after:.2f})",
                f"{scatter.ratio:.3f} (all {every.ratio:.3f})",
            )
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
