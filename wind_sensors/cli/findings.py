"""Findings on the screen: one below the other, so that they are read in a narrow window too."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.text import Text

from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.report.sizes import Size


def print_finding(
    console: Console, finding: Finding, sizes: Sequence[Size], where: str, removed: str
) -> None:
    """One finding: its name and place, its sizes, and what it removes.

    Args:
        console: Where to.
        finding: The finding.
        sizes: What is told of its sizes.
        where: When or where it shows; may be empty.
        removed: What it removes on data that were not fitted; empty where nobody asked.
    """
    together = f" (one of set {finding.set_number})" if finding.set_number else ""
    place = f": {where}" if where else ""
    name = (finding.term.effect.name, "bold")
    console.print(Text.assemble("  ", name, f" {finding.term.instrument}{together}{place}"))
    for size in sizes:
        console.print(f"    {size.text}")
    if removed:
        console.print(f"    held out: it removes {removed}")
