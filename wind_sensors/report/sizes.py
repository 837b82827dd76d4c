"""Sizes of effects for people: units, bearings from north or the bow, late moments as dates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.effects.wording import (
    BEARING,
    clockwise,
    counted_from,
    date_text,
    number_text,
)
from wind_sensors.diagnosis.proving.findings import Estimate, Finding
from wind_sensors.report.names import words
from wind_sensors.station.model import Station

DAY = 86400.0

LONG = 3.0 * DAY
"""Moments later than this [s] are told as dates."""

MOMENTS = ("start", "stop")
"""Parameters that are moments."""


@dataclass(frozen=True)
class Size:
    """One parameter as it is printed: name, value, ends of its interval, unit."""

    name: str
    value: str
    low: str
    high: str
    unit: str

    @property
    def text(self) -> str:
        """In one line."""
        unit = f" {self.unit}" if self.unit else ""
        interval = f" ({self.low} to {self.high})" if self.low else ""
        return f"{self.name} {self.value}{unit}{interval}"


def moment_text(elapsed: float, start: int) -> str:
    """A moment of a long recording, as a date.

    Args:
        elapsed: Since its start [s].
        start: Its start [ns].
    """
    return date_text(start + round(elapsed * 1e9))


def smallest_text(size: SmallestSize) -> str:
    """A smallest size with its parameter and its unit."""
    unit = "(share)" if size.unit == "1" else size.unit
    return f"{words(size.parameter)} {number_text(size.value)} {unit}".strip()


def sizes_of(finding: Finding, station: Station, start: int | None = None) -> list[Size]:
    """Parameters of a finding as they are printed.

    Args:
        finding: The finding.
        station: Tells whether headings count from north or from the bow.
        start: Of the recording [ns]: from a few days on moments are told as dates. None: in s.
    """
    either_or = {
        p.name
        for p in finding.term.effect.parameters
        if p.value_from == "forms" and (p.low, p.high) == (0.0, 1.0)
    }
    senses = {p.name: p.sense for p in finding.term.effect.parameters}
    return [
        Size(words(name), "yes" if e.value == 1.0 else "no", "", "", "")
        if name in either_or
        else _size(name, e, station, start, senses.get(name, ""))
        for name, e in finding.parameters.items()
    ]


def _size(name: str, e: Estimate, station: Station, start: int | None, sense: str) -> Size:
    if name == BEARING:
        return _bearing(e, station)
    known = np.isfinite(e.low)
    if start is not None and name in MOMENTS and abs(e.value) > LONG:
        ends = (moment_text(e.low, start), moment_text(e.high, start)) if known else ("", "")
        return Size(words(name), moment_text(e.value, start), *ends, "")
    ends = (number_text(e.low), number_text(e.high)) if known else ("", "")
    unit = "" if e.unit == "1" else e.unit
    return Size(words(name), number_text(e.value), *ends, f"{unit}, {sense}" if sense else unit)


def _bearing(e: Estimate, station: Station) -> Size:
    """A bearing clockwise, as winds are told."""

    def told(value: float) -> str:
        return f"{clockwise(value, station):.0f}" if np.isfinite(value) else ""

    return Size(
        "wind from", told(e.value), told(e.high), told(e.low), f"deg {counted_from(station)}"
    )
