"""The outcome of one diagnosis against one answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from proving_ground.scoring.intervals import Coverage, covered

OUTCOMES = (
    "exact",
    "ambiguous with the truth",
    "partly",
    "wrong name",
    "wrong set",
    "unknown",
    "none",
    "inconclusive",
    "refused",
    "failed",
)
SILENT = ("unknown", "none", "inconclusive", "refused", "failed")
UNKNOWN = "unknown"
"""What stands in the place of a cause that the catalogue lacks."""

REFUSAL = 2
"""Exit status of `wind diagnose` for a recording that it will not judge."""

NAMES_SOMETHING = ("exact", "ambiguous with the truth", "partly", "wrong name", "wrong set")


@dataclass(frozen=True)
class Judged:
    """One recording of a sealed set, opened.

    truth: names of the concealed causes ("unknown" for one that is in no catalogue, or was taken
    out of it); stranger: its own name; without: effects taken out of the catalogue; size: of the
    smallest cause in multiples of its minimum; named: certain findings; sets: groups of
    alternatives; seconds on the clock and of processors; removed [1] on held-out data, by what
    was named, and excess_removed the same where it is exact, or None.
    """

    name: str
    stratum: str
    kind: str
    truth: tuple[str, ...]
    stranger: str
    without: tuple[str, ...]
    size: float
    verdict: str
    named: tuple[str, ...]
    sets: tuple[tuple[str, ...], ...]
    outcome: str
    seconds: float
    processor: float
    memory: float
    excess_removed: float | None
    removed: float | None
    coverage: tuple[Coverage, ...]

    @property
    def found(self) -> bool:
        """Whether the truth was named, or is in the set of alternatives."""
        return self.outcome in ("exact", "ambiguous with the truth")

    @property
    def reported(self) -> str:
        """What the diagnosis said, as a column of the confusion matrix."""
        if self.verdict in SILENT:
            return self.verdict
        if self.verdict == "ambiguous" or self.sets:
            return "ambiguous"
        if len(self.named) > 1:
            return "several"
        return self.named[0] if self.named else "none"

    @property
    def set_size(self) -> float:
        """Mean number of names offered for each finding."""
        groups = [1] * len(self.named) + [len(group) for group in self.sets]
        return sum(groups) / len(groups) if groups else 0.0


def judge(
    name: str,
    answer: dict[str, Any],
    diagnosis: dict[str, Any] | None,
    run: dict[str, Any] | None,
) -> Judged:
    """Compare a diagnosis with its answer; a missing one counts as refused or as failed."""
    causes = answer["causes"]
    without = tuple(str(effect) for effect in answer.get("without", ()))
    own = tuple(str(c["effect"]) for c in causes)
    truth = tuple(UNKNOWN if effect in without else effect for effect in own)
    strangers = [str(c["stranger"]) for c in causes if "stranger" in c]
    strangers += [effect for effect in own if effect in without]
    sizes = [float(c["size_factor"]) for c in causes]
    named, sets = findings_of(diagnosis) if diagnosis else ((), ())
    verdict = _verdict(diagnosis, run)
    outcome = outcome_of(truth, verdict, named, sets)
    return Judged(
        name=name,
        stratum=str(answer["stratum"]),
        kind=str(answer["kind"]),
        truth=truth,
        stranger=strangers[0] if strangers else "",
        without=without,
        size=min(sizes, default=0.0),
        verdict=verdict,
        named=named,
        sets=sets,
        outcome=outcome,
        seconds=float(run["seconds"]) if run else 0.0,
        processor=float(run.get("processor", 0.0)) if run else 0.0,
        memory=float(run["memory"]) if run else 0.0,
        excess_removed=excess_removed(diagnosis) if diagnosis and outcome == "exact" else None,
        removed=excess_removed(diagnosis) if diagnosis else None,
        coverage=covered(causes, diagnosis) if diagnosis and outcome == "exact" else (),
    )


def judged_from(entry: dict[str, Any]) -> Judged:
    """A recording's outcome as a file of numbers holds it."""
    return Judged(
        **{
            "removed": None,
            **entry,
            "truth": tuple(entry["truth"]),
            "without": tuple(entry.get("without", ())),
            "named": tuple(entry["named"]),
            "sets": tuple(tuple(s) for s in entry["sets"]),
            "coverage": tuple(Coverage(**c) for c in entry["coverage"]),
        }
    )


def findings_of(
    diagnosis: dict[str, Any],
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Certain names, and groups of alternatives, of a diagnosis."""
    named: list[str] = []
    groups: dict[object, list[str]] = {}
    for finding in diagnosis.get("findings", []):
        effect = str(finding["effect"])
        group = finding.get("set")
        if effect == UNKNOWN:
            continue
        if group is None:
            named.append(effect)
        else:
            groups.setdefault(group, []).append(effect)
    single = [members[0] for members in groups.values() if len(set(members)) == 1]
    several = tuple(tuple(dict.fromkeys(m)) for m in groups.values() if len(set(m)) > 1)
    return tuple(dict.fromkeys([*named, *single])), several


def outcome_of(
    truth: tuple[str, ...],
    verdict: str,
    named: tuple[str, ...],
    sets: tuple[tuple[str, ...], ...],
) -> str:
    """One of OUTCOMES."""
    if verdict in SILENT:
        return verdict
    real = set(truth) - {UNKNOWN}
    if any(effect not in real for effect in named):
        return "wrong name"
    if any(not real & set(group) for group in sets):
        return "wrong set"
    offered = set(named).union(*sets) if sets else set(named)
    if not offered:
        return "none"
    if not real <= offered or UNKNOWN in truth:
        return "partly"
    return "ambiguous with the truth" if sets else "exact"


def _verdict(diagnosis: dict[str, Any] | None, run: dict[str, Any] | None) -> str:
    if diagnosis:
        return str(diagnosis["verdict"])
    return "refused" if run and run.get("status") == REFUSAL else "failed"


def excess_removed(diagnosis: dict[str, Any]) -> float | None:
    """Share of the excess misfit that a diagnosis removed on held-out blocks [1]; None: none."""
    shares = [
        float(f["proof"]["excess_removed"])
        for f in diagnosis.get("findings", [])
        if isinstance(f.get("proof"), dict) and f["proof"].get("excess_removed") is not None
    ]
    return min(shares) if shares else None
