"""The parts of the page that hold numbers, each from the files that were published."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from proving_ground.minimum_sizes import MINIMUM_SIZES
from proving_ground.peers.rows import FILE as PEERS
from proving_ground.peers.rows import read_rows, row_lines
from proving_ground.real.page import NUMBERS as REAL
from proving_ground.real.page import row_table
from proving_ground.scoring.card import NUMBERS as SCORE
from proving_ground.scoring.card import (
    Card,
    about_lines,
    coverage_lines,
    dose_lines,
    failure_lines,
    rate_lines,
    read_card,
    stratum_lines,
)
from proving_ground.scoring.oracle import FILE as ORACLE
from proving_ground.scoring.oracle import oracle_lines, read_shares
from proving_ground.scoring.rates import Rate
from proving_ground.scoring.twins import FILE as TWINS
from proving_ground.scoring.twins import read_removals, twin_lines
from proving_ground.sealing.strata import SHARES

FILES = (SCORE, ORACLE, TWINS, PEERS, REAL)
EARLIER = "earlier"
VERSIONS = 8
"""So many of the newest versions stand beside each other on the page; all of them are kept."""
TOGETHER = 15
"""So many of the newest sets are counted together: one of sixty holds an effect once or twice."""

MISSING = "Not measured yet."
PARTS = (
    "about", "rates", "strata", "doses", "coverage", "failures",
    "oracle", "twins", "peers", "real", "sizes", "shares", "versions",
)


def blocks(folder: Path) -> dict[str, str]:
    """Every part by its name, from the files of a folder; what has no file says so."""
    found = {name: [MISSING] for name in PARTS}
    cards = cards_of(folder)
    if (folder / SCORE).is_file():
        card = cards[-1][1]
        found["about"] = about_lines(card)
        found["rates"] = rate_lines(card)
        found["strata"] = stratum_lines(card)
        found["doses"] = dose_lines(together(cards))
        found["coverage"] = coverage_lines(card)
        found["failures"] = failure_lines(card)
    if (folder / ORACLE).is_file():
        found["oracle"] = oracle_lines(read_shares(folder / ORACLE))
    if (folder / TWINS).is_file():
        found["twins"] = twin_lines(read_removals(folder / TWINS))
    if (folder / PEERS).is_file():
        found["peers"] = row_lines(*read_rows(folder / PEERS))
    if (folder / REAL).is_file():
        real = json.loads((folder / REAL).read_text(encoding="utf-8"))
        found["real"] = row_table(real["rows"], real["about"])
    found["sizes"] = size_lines()
    found["shares"] = [
        ", ".join(f"{name.replace('_', ' ')} {100 * s:.0f} %" for name, s in SHARES.items())
    ]
    found["versions"] = version_lines(cards)
    return {name: "\n".join(lines) for name, lines in found.items()}


def cards_of(folder: Path) -> list[tuple[str, Card]]:
    """Version and card of every set that was scored, in their order, the newest last."""
    files = sorted((folder / EARLIER).glob("*.json"))
    files += [p for p in [folder / SCORE] if p.is_file()]
    cards = [(path, read_card(path)) for path in files]
    return [(str(card.about.get("version", path.stem)), card) for path, card in cards]


def together(cards: Sequence[tuple[str, Card]]) -> Card:
    """One card of the recordings of the newest sets."""
    newest = [card for _, card in cards[-TOGETHER:]]
    return Card({"sets": len(newest)}, tuple(j for card in newest for j in card.judged))


def size_lines() -> list[str]:
    """The smallest sizes worth reporting, and the largest that are planted, as a table."""
    lines = ["| effect | smallest | largest | of what | stations |", "|---|---|---|---|---|"]
    for name, size in MINIMUM_SIZES.items():
        unit = "" if size.unit == "1" else f" {size.unit}"
        largest = f"{size.value * size.most:.3g}{unit}" if size.graded else ""
        least = f"{size.value:g}{unit}"
        lines.append(f"| `{name}` | {least} | {largest} | {size.meaning} | {size.kinds} |")
    return lines


def version_lines(cards: Sequence[tuple[str, Card]]) -> list[str]:
    """The promised rates of the newest versions one by one, and of more together, as a table."""
    if not cards:
        return [MISSING]
    newest = cards[-VERSIONS:]
    names = " | ".join(name for name, _ in newest)
    pooled = together(cards)
    last = f"newest {pooled.about['sets']} together"
    lines = [f"| what | {names} | {last} | promised |", "|---" * (len(newest) + 3) + "|"]
    for *each, all_sets in zip(*(card.rates for _, card in newest), pooled.rates, strict=True):
        told = " | ".join([*map(_brief, each), _with_interval(all_sets), all_sets.promised])
        lines.append(f"| {all_sets.title} | {told} |")
    return lines


def _brief(rate: Rate) -> str:
    return f"{100 * rate.value:.0f} % ({rate.hits}/{rate.total})" if rate.total else ""


def _with_interval(rate: Rate) -> str:
    if not rate.total:
        return ""
    low, high = rate.interval
    return f"{_brief(rate)}, {100 * low:.0f} to {100 * high:.0f} %"
