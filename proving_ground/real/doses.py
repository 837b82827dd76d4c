"""Causes planted into the ten-minute means of a real mast."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

Row = dict[str, str]
STRETCH = 8000
"""Rows of a stretch: about eight weeks."""


@dataclass(frozen=True)
class Dose:
    """What is planted: the effect, on which channel, how much, and how a row changes."""

    effect: str
    instrument: str
    amount: str
    change: Callable[[Row], None]


def _scaled(columns: tuple[str, ...], factor: float) -> Callable[[Row], None]:
    def change(row: Row) -> None:
        for column in columns:
            if row[column]:
                row[column] = f"{float(row[column]) * factor:.4g}"

    return change


def _slowed(column: str, loss: float) -> Callable[[Row], None]:
    """Dry friction: `loss` m/s at 5 m/s, less in proportion in a stronger wind."""

    def change(row: Row) -> None:
        if row[column]:
            speed = float(row[column])
            row[column] = f"{max(0.0, speed - 5.0 * loss / max(speed, 1.0)):.4g}"

    return change


def _turned(column: str, offset: float) -> Callable[[Row], None]:
    def change(row: Row) -> None:
        if row[column]:
            row[column] = f"{(float(row[column]) + offset) % 360.0:.4g}"

    return change


DOSES = (
    Dose("none", "", "nothing", lambda row: None),
    Dose(
        "calibration_drift",
        "cup_80_north",
        "3 % less",
        _scaled(("Spd80mN", "Spd80mNStd", "Spd80mNMax"), 0.97),
    ),
    Dose("bearing_friction", "cup_60_north", "0.4 m/s less at 5 m/s", _slowed("Spd60mN", 0.4)),
    Dose("vane_offset", "vane_58", "8 degrees", _turned("Dir58mS", 8.0)),
)


def read_rows(path: Path) -> tuple[list[str], Iterator[Row]]:
    """Columns and rows of the mast's table."""
    file = path.open(encoding="utf-8-sig", newline="")
    reader = csv.DictReader(file)
    return list(reader.fieldnames or []), iter(reader)


def write_stretch(
    columns: list[str], rows: list[Row], target: Path, change: Callable[[Row], None]
) -> None:
    """Write rows as a table, each changed by a dose."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        for row in rows:
            changed = dict(row)
            change(changed)
            writer.writerow(changed)
