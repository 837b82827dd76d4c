"""What the pulse counts of a logger show: a table of each rotor, and pairs of one calibration."""

from __future__ import annotations

import argparse
import math
from itertools import combinations

from pulse_counts import compare_pair, count_statistics
from rich.console import Console
from rich.table import Table

from wind_sensors.recordings import read_recording
from wind_sensors.station.model import Rotor


def main() -> None:
    """Read and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording")
    recording = read_recording(parser.parse_args().recording)
    console = Console(width=140)
    table = Table(
        "rotor", "seconds", "pulses per s", "no pulse", "one pulse m/s", "counting m/s",
        "second to second m/s", "even", "p", "missing",
    )
    rotors = [i for i in recording.station.instruments if isinstance(i, Rotor)]
    for rotor in rotors:
        s = count_statistics(recording, rotor.name)
        table.add_row(
            rotor.name, str(s.seconds), f"{s.mean:.2f} +- {s.deviation:.2f}",
            f"{100.0 * s.still:.1f} %", f"{s.pulse_speed:.3f}", f"{s.quantisation:.3f}",
            f"{s.rapid:.3f}", f"{100.0 * s.even:.1f} %",
            f"{s.even_p:.2g}" if math.isfinite(s.even_p) else "too few counts",
            ", ".join(map(str, s.missing)) or "none",
        )
    console.print(table)
    for one, two in combinations(rotors, 2):
        if one.calibration_distance != two.calibration_distance:
            continue
        c = compare_pair(recording, one.name, two.name)
        misfit = ", ".join(f"{name} {value:.3f}" for name, value in c.misfit.items())
        console.print(
            f"{two.name} - {one.name}: {c.difference:+.3f} +- {c.difference_error:.3f} m/s in "
            f"{c.blocks} half-minute means, slope {c.slope:+.3f} +- {c.slope_error:.3f}; "
            f"left (m/s)^2 by {misfit}"
        )


if __name__ == "__main__":
    main()
