"""The rows of the comparison, as a page and as numbers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from proving_ground.scoring.rates import clopper_pearson
from wind_sensors.errors import UserError

FILE = "peers.json"


@dataclass(frozen=True)
class PeerScore:
    """One method's row: counts of hits and cases by column, and median seconds.

    matched: exact, with as many false alarms as the diagnosis has, or fewer.
    """

    method: str
    false_alarms: tuple[int, int]
    exact: tuple[int, int]
    included: tuple[int, int]
    wrong: tuple[int, int]
    unknown_named: tuple[int, int]
    seconds: float
    matched: tuple[int, int] = (0, 0)


def write_table(folder: Path, rows: Sequence[PeerScore], about: dict[str, Any]) -> Path:
    """Write the comparison as a page and as numbers; the page's path."""
    folder.mkdir(parents=True, exist_ok=True)
    page = folder / "peers.md"
    text = "\n".join(["# Peers on the same recordings", "", *row_lines(rows, about)])
    page.write_text(text + "\n", encoding="utf-8")
    numbers = json.dumps({"about": about, "rows": [asdict(r) for r in rows]}, indent=1)
    (folder / FILE).write_text(numbers + "\n", encoding="utf-8")
    return page


def read_rows(path: Path) -> tuple[list[PeerScore], dict[str, Any]]:
    """Rows of a file of numbers and what they are of. Raises UserError if it is something else."""
    try:
        numbers = json.loads(path.read_text(encoding="utf-8"))
        return [_row(entry) for entry in numbers["rows"]], numbers["about"]
    except (ValueError, TypeError, KeyError):
        raise UserError(
            "this is no comparison", str(path), "`wind prove peers` writes one."
        ) from None


def _row(entry: dict[str, Any]) -> PeerScore:
    counts = {k: (int(v[0]), int(v[1])) for k, v in entry.items() if isinstance(v, list)}
    return PeerScore(method=str(entry["method"]), seconds=float(entry["seconds"]), **counts)


def row_lines(rows: Sequence[PeerScore], about: dict[str, Any]) -> list[str]:
    """The comparison for people: what it is of, and a table."""
    lines = [f"- {key}: {value}" for key, value in about.items()]
    lines += [
        "",
        "| method | healthy named | exact (single, 3 x and more) | exact, at the first row's false "
        "alarms | truth included | a wrong name, all | unknown named | seconds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            _cell(c)
            for c in (
                row.false_alarms,
                row.exact,
                row.matched,
                row.included,
                row.wrong,
                row.unknown_named,
            )
        ]
        lines.append(f"| {row.method} | " + " | ".join(cells) + f" | {row.seconds:.1f} |")
    return lines


def _cell(count: tuple[int, int]) -> str:
    hits, total = count
    if not total:
        return ""
    low, high = clopper_pearson(hits, total)
    return f"{100 * hits / total:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
