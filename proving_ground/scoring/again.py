"""What one program said of a set, against what another says of the same recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

from proving_ground.scoring.card import is_failure
from proving_ground.scoring.outcome import OUTCOMES, Judged


@dataclass(frozen=True)
class Change:
    """One recording of which two programs say different things."""

    before: Judged
    after: Judged


def changes(before: Sequence[Judged], after: Sequence[Judged]) -> list[Change]:
    """Recordings of which the two say different things, in the order of the first."""
    now = {j.name: j for j in after}
    both = [Change(j, now[j.name]) for j in before if j.name in now]
    return [c for c in both if _said(c.before) != _said(c.after)]


def chance(found: Sequence[Change]) -> float:
    """Probability of so uneven a count of failures gone and failures new where neither program is
    better (exact sign test, two-sided)."""
    gone = sum(is_failure(c.before) and not is_failure(c.after) for c in found)
    new = sum(is_failure(c.after) and not is_failure(c.before) for c in found)
    return float(binomtest(gone, gone + new).pvalue) if gone + new else 1.0


def lines(before: Sequence[Judged], after: Sequence[Judged]) -> list[str]:
    """The comparison for people: how often each outcome came, and all that changed."""
    names = {j.name for j in after}
    counted = [Counter(j.outcome for j in some if j.name in names) for some in (before, after)]
    failed = [sum(is_failure(j) for j in some if j.name in names) for some in (before, after)]
    found = changes(before, after)
    return [
        "| outcome | before | after |",
        "|---|---|---|",
        *(f"| {o} | {counted[0][o]} | {counted[1][o]} |" for o in OUTCOMES if o in counted[0]
          or o in counted[1]),
        f"| failures, of {len(names)} | {failed[0]} | {failed[1]} |",
        "",
        f"{len(found)} recordings are answered differently. Where neither program is better, so "
        f"many more or fewer failures come with a probability of {chance(found):.2f}.",
        "",
        "| recording | stratum | concealed | size | before | after |",
        "|---|---|---|---|---|---|",
        *(
            f"| {c.before.name} | {c.before.stratum} | {_concealed(c.before)} | "
            f"{c.before.size:g} | {_told(c.before)} | {_told(c.after)} |"
            for c in found
        ),
    ]


def _said(judged: Judged) -> tuple[object, ...]:
    return judged.outcome, set(judged.named), {frozenset(s) for s in judged.sets}


def _concealed(judged: Judged) -> str:
    return " + ".join(judged.truth) + (f" ({judged.stranger})" if judged.stranger else "")


def _told(judged: Judged) -> str:
    sets = ["{" + ", ".join(s) + "}" for s in judged.sets]
    said = ", ".join([*judged.named, *sets]) or judged.verdict
    return f"{said} (failure)" if is_failure(judged) else said
