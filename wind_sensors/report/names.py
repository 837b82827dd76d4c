"""Names of effects for people: what goes together, and what the data do not tell apart."""

from __future__ import annotations

from collections.abc import Sequence

from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.station.silence import Silent


def words(effect: str) -> str:
    """An identifier for people."""
    return effect.replace("_", " ")


def silence_of(silent: Sequence[Silent]) -> str:
    """That some instruments say nothing, in a few words; empty if there are none."""
    if not silent:
        return ""
    names = " and ".join(each.instrument for each in silent)
    return f"{names} {'says' if len(silent) == 1 else 'say'} nothing at all"


def names_of(findings: Sequence[Finding]) -> str:
    """All findings in one line: effects that act together by `and`, members of a set by `or`.

    Args:
        findings: Named effects, and members of ambiguous sets.
    """
    sets: dict[tuple[int, int], list[str]] = {}
    for k, finding in enumerate(findings):
        # What is in no set stands for itself.
        key = (finding.set_number, 0 if finding.set_number else k)
        name = f"{words(finding.term.effect.name)} ({finding.term.instrument})"
        sets.setdefault(key, []).append(name)
    together = [" or ".join(dict.fromkeys(names)) for names in sets.values()]
    if len(together) < 2:
        return "".join(together)
    return ", and ".join(together) if any(" or " in t for t in together) else " and ".join(together)
