"""The station with what was found, as far as one cause can be corrected, and a word on the rest."""

from __future__ import annotations

from collections.abc import Sequence

from wind_sensors.diagnosis.explaining.terms import planted
from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.station.model import Station

PASSING = "icing"
"""Effect of episodes: within its interval it comes and goes."""


def corrected(station: Station, findings: Sequence[Finding]) -> Station:
    """The station with the findings that can be corrected, and with nothing else.

    Of an ambiguous set it has no member: correcting the healthy one of two rotors would make two
    wrong ones. It does not hold ice either; see `uncorrected`.
    """
    return planted(station, [f.term for f in findings if _is_correctable(f)])


def uncorrected(findings: Sequence[Finding]) -> list[str]:
    """What was found and is not in the corrected station, and why, for people."""
    sets: dict[int, list[str]] = {}
    for f in findings:
        sets.setdefault(f.set_number, []).append(_words(f))
    notes = [
        f"set {number}, {' or '.join(dict.fromkeys(names))}: the corrected station has none of "
        "it, for the data do not say what to correct."
        for number, names in sets.items()
        if number
    ]
    iced = [_words(f) for f in findings if f.set_number == 0 and not _is_correctable(f)]
    if iced:
        notes.append(
            f"{', '.join(iced)}: the corrected station does not hold it, for it comes and goes. "
            "Leave the episodes out."
        )
    return notes


def _is_correctable(finding: Finding) -> bool:
    return finding.set_number == 0 and finding.term.effect.name != PASSING


def _words(finding: Finding) -> str:
    return f"{finding.term.effect.name.replace('_', ' ')} ({finding.term.instrument})"
