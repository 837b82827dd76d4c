"""The score card: a page for people and the same numbers for machines."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from proving_ground.scoring.dose import Dose, dose_response
from proving_ground.scoring.figures import draw_confusion, draw_doses, draw_rates
from proving_ground.scoring.outcome import OUTCOMES, Judged, judged_from
from proving_ground.scoring.rates import (
    Rate,
    mean_set_size,
    median_seconds,
    open_minded,
    promised_rates,
)
from wind_sensors.errors import UserError

CARD = "score.md"
NUMBERS = "score.json"


@dataclass(frozen=True)
class Card:
    """The scores of one set, or of several: what they are of, and every recording."""

    about: dict[str, Any]
    judged: tuple[Judged, ...]

    @cached_property
    def rates(self) -> tuple[Rate, ...]:
        """The promised rates."""
        return tuple(promised_rates(self.judged))

    @cached_property
    def doses(self) -> tuple[Dose, ...]:
        """Chance of a find against size: of all effects, then of each, the easiest first."""
        return tuple(_doses(self.judged))


def write_card(folder: Path, judged: Sequence[Judged], about: dict[str, Any]) -> list[Rate]:
    """Write the card, its figures and its numbers into a folder; the promised rates."""
    folder.mkdir(parents=True, exist_ok=True)
    card = Card(about, tuple(judged))
    if judged:
        draw_rates(card.rates, folder / "rates.png")
        draw_confusion(judged, folder / "confusion.png")
    if card.doses:
        draw_doses(card.doses, folder / "dose_response.png")
    (folder / CARD).write_text(_page(card), encoding="utf-8")
    numbers = {
        "about": about,
        "rates": [{**asdict(r), "interval": r.interval} for r in card.rates],
        "recordings": [asdict(j) for j in judged],
        "doses": [asdict(d) for d in card.doses],
    }
    (folder / NUMBERS).write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    return list(card.rates)


def read_card(file: Path) -> Card:
    """The card of a file of numbers: counted again from its recordings.

    Raises UserError if the file is absent or something else.
    """
    try:
        numbers = json.loads(file.read_text(encoding="utf-8"))
        judged = [judged_from(entry) for entry in numbers["recordings"]]
    except (OSError, ValueError, KeyError, TypeError):
        raise UserError(
            "this is no score card", str(file), "`wind prove open` writes one."
        ) from None
    return Card(numbers["about"], tuple(judged))


def _doses(judged: Sequence[Judged]) -> list[Dose]:
    singles = [j for j in judged if j.stratum == "single"]
    names = sorted({j.truth[0] for j in singles})
    together = dose_response("all effects", singles)
    curves = [dose_response(n, [j for j in singles if j.truth == (n,)]) for n in names]
    each = sorted((c for c in curves if c is not None), key=lambda c: c.half)
    return [] if together is None else [together, *each]


def _page(card: Card) -> str:
    lines = ["# Score card", "", *about_lines(card), ""]
    lines += [*rate_lines(card), "", "![rates](rates.png)", "", "## By stratum", ""]
    lines += [*stratum_lines(card), "", "## What was said of what", ""]
    lines += ["![confusion matrix](confusion.png)", ""]
    if card.doses:
        lines += ["## How large an effect must be", "", *dose_lines(card), ""]
        lines += ["![dose and response](dose_response.png)", ""]
    lines += ["## Parameters", "", *coverage_lines(card), ""]
    lines += ["## Every failure", "", *failure_lines(card)]
    return "\n".join(lines) + "\n"


def about_lines(card: Card) -> list[str]:
    """What the scores are of, as a list."""
    lines = [f"- {key}: {value}" for key, value in card.about.items()]
    return [*lines, f"- recordings: {len(card.judged)}"]


def rate_lines(card: Card) -> list[str]:
    """The promised rates as a table, and how long it took."""
    clock, processor = median_seconds(card.judged)
    lines = ["| what | rate | 95 % interval | promised | kept |", "|---|---|---|---|---|"]
    lines += [_rate_row(r) for r in card.rates]
    return [
        *lines,
        "",
        f"Mean number of names for a finding: {mean_set_size(card.judged):.2f} (promised below "
        f"1.5). Median run time: {clock:.1f} s on the clock, {processor:.1f} s of processors.",
    ]


def stratum_lines(card: Card) -> list[str]:
    """Outcomes by stratum as a table."""
    lines = [
        "| stratum | cases | " + " | ".join(OUTCOMES) + " |",
        "|---" * (len(OUTCOMES) + 2) + "|",
    ]
    for stratum in sorted({j.stratum for j in card.judged}):
        inside = [j for j in card.judged if j.stratum == stratum]
        tally = [sum(j.outcome == o for j in inside) for o in OUTCOMES]
        lines.append(f"| {stratum} | {len(inside)} | " + " | ".join(map(str, tally)) + " |")
    return lines


def dose_lines(card: Card) -> list[str]:
    """Sizes found in half and in nine tenths of the cases as a table."""
    lines = ["| effect | found in half [minima] | found in 90 % [minima] | cases |"]
    return [*lines, "|---|---|---|---|", *(_dose_row(d) for d in card.doses)]


def coverage_lines(card: Card) -> list[str]:
    """Every parameter that could be compared with what was planted, as a table."""
    lines = ["| recording | effect | parameter | planted | 95 % interval | holds |"]
    lines.append("|---|---|---|---|---|---|")
    lines += [
        f"| {j.name} | {c.effect} | {c.parameter} | {c.truth:.4g} | {c.low:.4g} to {c.high:.4g} | "
        f"{'yes' if c.holds else 'no'} |"
        for j in card.judged
        for c in j.coverage
    ]
    return lines


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


def failure_lines(card: Card) -> list[str]:
    """Every failure by name, as a table."""
    failed = [j for j in card.judged if is_failure(j)]
    lines = [f"{len(failed)} of {len(card.judged)} recordings.", ""]
    if failed:
        lines += ["| recording | stratum | concealed | size | said |", "|---|---|---|---|---|"]
    for one in sorted(failed, key=lambda j: (j.stratum, j.truth, j.size)):
        truth = " + ".join(one.truth) or "nothing"
        if one.stranger:
            gone = one.stratum == "withheld"
            where = "taken out of the catalogue" if gone else "in no catalogue"
            truth = f"{one.stranger} ({where})"
        said = " + ".join([*one.named, *("{" + ", ".join(s) + "}" for s in one.sets)])
        said = f"{one.verdict}: {said}" if said else one.verdict
        size = f"{one.size:g}" if one.size else ""
        lines.append(f"| {one.name} | {one.stratum} | {truth} | {size} | {said} |")
    return lines
