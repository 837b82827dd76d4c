"""The score card: a page for people and the same numbers for machines."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from proving_ground.scoring.dose import Dose, dose_response
from proving_ground.scoring.figures import draw_confusion, draw_doses, draw_rates
from proving_ground.scoring.outcome import OUTCOMES, Judged
from proving_ground.scoring.rates import (
    Rate,
    mean_set_size,
    median_seconds,
    open_minded,
    promised_rates,
)

CARD = "score.md"
NUMBERS = "score.json"


def write_card(folder: Path, judged: Sequence[Judged], about: dict[str, Any]) -> list[Rate]:
    """Write the card, its figures and its numbers into a folder; the promised rates."""
    folder.mkdir(parents=True, exist_ok=True)
    rates = promised_rates(judged)
    doses = _doses(judged)
    if judged:
        draw_rates(rates, folder / "rates.png")
        draw_confusion(judged, folder / "confusion.png")
    if doses:
        draw_doses(doses, folder / "dose_response.png")
    (folder / CARD).write_text(_page(judged, rates, doses, about), encoding="utf-8")
    numbers = {
        "about": about,
        "rates": [{**asdict(r), "interval": r.interval} for r in rates],
        "recordings": [asdict(j) for j in judged],
        "doses": [asdict(d) for d in doses],
    }
    (folder / NUMBERS).write_text(json.dumps(numbers, indent=1), encoding="utf-8")
    return rates


def _doses(judged: Sequence[Judged]) -> list[Dose]:
    singles = [j for j in judged if j.stratum == "single"]
    names = sorted({j.truth[0] for j in singles})
    curves = [dose_response("all effects", singles)]
    curves += [dose_response(n, [j for j in singles if j.truth == (n,)]) for n in names]
    return [c for c in curves if c is not None]


def _page(
    judged: Sequence[Judged], rates: Sequence[Rate], doses: Sequence[Dose], about: dict[str, Any]
) -> str:
    lines = ["# Score card", ""]
    lines += [f"- {key}: {value}" for key, value in about.items()]
    lines += [f"- recordings: {len(judged)}", ""]
    clock, processor = median_seconds(judged)
    lines += ["| what | rate | 95 % interval | promised | kept |", "|---|---|---|---|---|"]
    lines += [_rate_row(r) for r in rates]
    lines += [
        "",
        f"Mean number of names for a finding: {mean_set_size(judged):.2f} (promised below 1.5). "
        f"Median run time: {clock:.1f} s on the clock, {processor:.1f} s of processors.",
        "",
        "![rates](rates.png)",
        "",
        "## By stratum",
        "",
        "| stratum | cases | " + " | ".join(OUTCOMES) + " |",
        "|---" * (len(OUTCOMES) + 2) + "|",
    ]
    for stratum in sorted({j.stratum for j in judged}):
        inside = [j for j in judged if j.stratum == stratum]
        tally = [sum(j.outcome == o for j in inside) for o in OUTCOMES]
        lines.append(f"| {stratum} | {len(inside)} | " + " | ".join(map(str, tally)) + " |")
    lines += ["", "## What was said of what", "", "![confusion matrix](confusion.png)", ""]
    if doses:
        lines += ["## How large an effect must be", ""]
        lines += ["| effect | found in half [minima] | found in 90 % [minima] | cases |"]
        lines += ["|---|---|---|---|"]
        lines += [_dose_row(d) for d in doses]
        lines += ["", "![dose and response](dose_response.png)", ""]
    lines += _failures(judged)
    return "\n".join(lines) + "\n"


def _rate_row(rate: Rate) -> str:
    if not rate.total:
        return f"| {rate.title} | no case | | {rate.promised} | |"
    low, high = rate.interval
    kept = {True: "yes", False: "no", None: ""}[rate.met]
    if rate.promised.startswith("("):
        kept = ""
    return (
        f"| {rate.title} | {100 * rate.value:.1f} % ({rate.hits}/{rate.total}) | "
        f"{100 * low:.1f} to {100 * high:.1f} % | {rate.promised} | {kept} |"
    )


def _dose_row(dose: Dose) -> str:
    low, high = dose.half_interval
    low90, high90 = dose.ninety_interval
    return (
        f"| {dose.title} | {dose.half:.1f} ({low:.1f} to {high:.1f}) | "
        f"{dose.ninety:.1f} ({low90:.1f} to {high90:.1f}) | {sum(dose.trials)} |"
    )


def is_failure(judged: Judged) -> bool:
    """Whether a recording counts against the diagnosis."""
    if judged.outcome == "failed":
        return True
    if judged.stratum == "healthy":
        return judged.verdict != "none"
    if judged.stratum == "unknown":
        return judged.verdict != "unknown"
    if judged.stratum == "withheld":
        return not open_minded(judged)
    if judged.stratum == "too_little":
        return judged.verdict not in ("inconclusive", "refused", "none") and not judged.found
    if judged.outcome in ("none", "inconclusive") and judged.size < 1.0:
        return False
    return not judged.found


def _failures(judged: Sequence[Judged]) -> list[str]:
    failed = [j for j in judged if is_failure(j)]
    lines = ["## Every failure", "", f"{len(failed)} of {len(judged)} recordings.", ""]
    if failed:
        lines += ["| recording | stratum | concealed | size | said |", "|---|---|---|---|---|"]
    for one in sorted(failed, key=lambda j: (j.stratum, j.truth, j.size)):
        truth = " + ".join(one.truth) or "nothing"
        if one.stranger:
            gone = one.stratum == "withheld"
            truth = (
                f"{one.stranger} ({'taken out of the catalogue' if gone else 'in no catalogue'})"
            )
        said = " + ".join([*one.named, *("{" + ", ".join(s) + "}" for s in one.sets)])
        said = f"{one.verdict}: {said}" if said else one.verdict
        size = f"{one.size:g}" if one.size else ""
        lines.append(f"| {one.name} | {one.stratum} | {truth} | {size} | {said} |")
    return lines
