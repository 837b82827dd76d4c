"""`station_corrected.yaml`: the station file of a recording with what was found in it."""

from __future__ import annotations

from collections.abc import Sequence

import wind_sensors
from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.report.diagnosis_page import when_text
from wind_sensors.report.names import words
from wind_sensors.report.sizes import sizes_of
from wind_sensors.station.model import Station
from wind_sensors.station.writing import station_to_yaml

_DIGITS = 6
"""Significant ones of the numbers: far more than any interval is worth."""


def corrected_station(
    recording: str,
    verdict: str,
    findings: Sequence[Finding],
    station: Station,
    start: int | None = None,
) -> str:
    """The text of the file.

    Args:
        recording: Name of the diagnosed recording.
        verdict: In one word.
        findings: Named effects, and members of ambiguous sets.
        station: The station with the named physics.
        start: Of the recording [ns], where it lasts for days.
    """
    lines = [
        f"Written by `wind diagnose` (wind_sensors {wind_sensors.__version__}) of the recording "
        f"{recording!r}: {verdict}.",
        "Found, with 95 % intervals in brackets; of a set it is not known which one holds:"
        if findings
        else "Nothing was named, so the constants are those of the station file.",
    ]
    for finding in findings:
        sizes = "; ".join(size.text for size in sizes_of(finding, station, start))
        name = f"{words(finding.term.effect.name)} ({finding.term.instrument})"
        when = when_text(finding.term, start)
        one = f", one of set {finding.set_number}" if finding.set_number else ""
        lines.append(f"- {name}{one}{f', {when}' if when else ''}: {sizes}")
    # A name may hold anything, and a comment ends with its line.
    heading = "".join(f"# {' '.join(line.split())}\n" for line in lines)
    return heading + station_to_yaml(station, shipped_profiles(), digits=_DIGITS)
