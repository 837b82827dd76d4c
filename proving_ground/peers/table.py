"""Count what the peers say of a sealed set, beside the diagnosis and at equal false alarms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from proving_ground.peers.methods import METHODS
from proving_ground.peers.regress import Importance, regress_all
from proving_ground.peers.rows import PeerScore
from proving_ground.scoring.outcome import NAMES_SOMETHING, UNKNOWN, Judged
from proving_ground.scoring.rates import LARGE
from proving_ground.sealing.trial import read_manifest

FALSE_ALARMS = 0.05
FLOORS = (0.02, 0.1, 0.5)
"""Importances below which nothing is compared; every method gets the one that suits it best."""


def excess(
    found: Importance, healthy: Sequence[Importance], floor: float = FLOORS[0]
) -> Importance:
    """Importance of each effect over the largest it has in healthy recordings of the station."""
    return {
        name: value / max([floor, *(h.get(name, 0.0) for h in healthy)])
        for name, value in found.items()
    }


def threshold(healthy: Sequence[Sequence[Importance]], floor: float = FLOORS[0]) -> float:
    """Excess above which an effect is named, so that at most the wanted share of healthy
    recordings, each judged against the others of its station, is given a name."""
    largest = []
    for group in healthy:
        for i, one in enumerate(group):
            rest = [h for j, h in enumerate(group) if j != i]
            largest.append(max(excess(one, rest, floor).values(), default=0.0))
    return max(1.0, float(np.quantile(largest, 1.0 - FALSE_ALARMS, method="higher")))


def compare(
    folder: Path, answers: dict[str, Any], judged: Sequence[Judged], jobs: int = 1
) -> list[PeerScore]:
    """Every method's row, plain and whitened, and the diagnosis's own."""
    manifest = read_manifest(folder)["recordings"]
    rows = [own_row(judged)]
    for whitened, said in regress_all(folder, jobs).items():
        for method, settings in METHODS.items():
            label = f"{method}{', whitened' if whitened else ''}"
            seconds = float(np.median([one[method].seconds for one in said.values()]))
            tried = [
                row
                for number in range(len(settings))
                for row in _rows_of(
                    label,
                    {stem: one[method].settings[number] for stem, one in said.items()},
                    manifest,
                    answers,
                    rows[0].false_alarms[0],
                    seconds,
                )
            ]
            best = max(tried, key=lambda r: (r.exact[0], r.included[0], -r.wrong[0]))
            rows.append(replace(best, matched=max(r.matched for r in tried)))
    return rows


def _rows_of(
    label: str,
    by_name: Mapping[str, Importance],
    manifest: dict[str, Any],
    answers: dict[str, Any],
    alarms: int,
    seconds: float,
) -> Iterator[PeerScore]:
    """The rows of one setting of a method, one for each floor."""
    groups: dict[str, list[Importance]] = {}
    for stem, found in by_name.items():
        if stem.startswith("station-"):
            groups.setdefault(stem.rsplit("-healthy", 1)[0], []).append(found)
    for floor in FLOORS:
        over = {
            name: excess(by_name[name], groups[manifest[name]["healthy"]], floor)
            for name in answers
            if name in by_name
        }
        limits = threshold(list(groups.values()), floor), limit_with(over, answers, alarms)
        row, matched = (
            peer_row(label, names_above(over, limit), answers, seconds) for limit in limits
        )
        fair = [matched.exact, row.exact] if row.false_alarms[0] <= alarms else [matched.exact]
        yield replace(row, matched=max(fair))


def names_above(over: Mapping[str, Importance], limit: float) -> dict[str, set[str]]:
    """Effects whose excess is above a limit, for each recording."""
    return {
        name: {effect for effect, value in found.items() if value > limit}
        for name, found in over.items()
    }


def limit_with(over: Mapping[str, Importance], answers: dict[str, Any], alarms: int) -> float:
    """The lowest limit with so many false alarms among the sealed healthy recordings, or fewer.

    It is set with the answers in hand, in the method's favour.
    """
    largest = sorted(
        (max(over[name].values(), default=0.0) for name in over if _is_healthy(answers[name])),
        reverse=True,
    )
    return largest[alarms] if alarms < len(largest) else 0.0


def _is_healthy(answer: dict[str, Any]) -> bool:
    return str(answer["stratum"]) == "healthy"


def peer_row(
    label: str, named: dict[str, set[str]], answers: dict[str, Any], seconds: float
) -> PeerScore:
    """Count a method's names against the answers."""
    gone = {n: set(answers[n].get("without", ())) for n in named}
    truth = {
        n: {UNKNOWN if c["effect"] in gone[n] else str(c["effect"]) for c in answers[n]["causes"]}
        for n in named
    }
    size = {
        n: min((float(c["size_factor"]) for c in answers[n]["causes"]), default=0.0) for n in named
    }
    stratum = {n: str(answers[n]["stratum"]) for n in named}
    well = [n for n in named if stratum[n] == "healthy"]
    large = [n for n in named if stratum[n] in ("single", "onset") and size[n] >= LARGE]
    strange = [n for n in named if UNKNOWN in truth[n]]
    return PeerScore(
        method=label,
        false_alarms=(sum(bool(named[n]) for n in well), len(well)),
        exact=(sum(named[n] == truth[n] for n in large), len(large)),
        included=(sum(truth[n] <= named[n] for n in large), len(large)),
        wrong=(sum(bool(named[n] - truth[n]) for n in named), len(named)),
        unknown_named=(sum(bool(named[n]) for n in strange), len(strange)),
        seconds=seconds,
    )


def own_row(judged: Sequence[Judged]) -> PeerScore:
    """The diagnosis's own row."""
    well = [j for j in judged if j.stratum == "healthy"]
    large = [j for j in judged if j.stratum in ("single", "onset") and j.size >= LARGE]
    strange = [j for j in judged if UNKNOWN in j.truth]
    wrong = [j for j in judged if set(j.named) - set(j.truth)]
    exact = (sum(j.outcome == "exact" for j in large), len(large))
    times = [j.seconds for j in judged if j.verdict != "failed"]
    return PeerScore(
        method="wind diagnose",
        false_alarms=(sum(j.outcome in NAMES_SOMETHING for j in well), len(well)),
        exact=exact,
        matched=exact,
        included=(sum(j.found for j in large), len(large)),
        wrong=(len(wrong), len(judged)),
        unknown_named=(sum(bool(j.named) for j in strange), len(strange)),
        seconds=float(np.median(times)) if times else float("nan"),
    )
