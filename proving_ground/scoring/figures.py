"""Figures of a score card."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from proving_ground.scoring.dose import Dose
from proving_ground.scoring.outcome import Judged
from proving_ground.scoring.rates import Rate, clopper_pearson

KEPT, BROKEN, NEUTRAL = "#2a7f62", "#b5442d", "#4a6fa5"
LAST_COLUMNS = ("several", "ambiguous", "unknown", "none", "inconclusive", "refused", "failed")


def rows_of(judged: Sequence[Judged]) -> list[str]:
    """Row of the confusion matrix for each recording: its truth."""
    rows = []
    for one in judged:
        if one.stratum == "too_little":
            rows.append("too little")
        elif one.stratum == "withheld":
            rows.append("taken out")
        elif not one.truth:
            rows.append("none")
        elif len(one.truth) > 1:
            rows.append("several")
        else:
            rows.append(one.truth[0])
    return rows


def confusion(judged: Sequence[Judged]) -> tuple[list[str], list[str], np.ndarray]:
    """Rows, columns and counts of the confusion matrix."""
    rows = rows_of(judged)
    columns = [one.reported for one in judged]
    tail = [
        name for name in ("several", "unknown", "taken out", "none", "too little") if name in rows
    ]
    row_names = sorted(set(rows) - set(tail)) + tail
    last = [name for name in LAST_COLUMNS if name in columns]
    column_names = sorted(set(columns) - set(last)) + last
    counts = np.zeros((len(row_names), len(column_names)), dtype=int)
    for row, column in zip(rows, columns, strict=True):
        counts[row_names.index(row), column_names.index(column)] += 1
    return row_names, column_names, counts


def draw_confusion(judged: Sequence[Judged], path: Path) -> None:
    """Confusion matrix: truth in rows, what was said in columns."""
    rows, columns, counts = confusion(judged)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = Figure(figsize=(3.2 + 0.34 * len(columns), 2.4 + 0.27 * len(rows)))
    axes = figure.add_subplot()
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (i, j), count in np.ndenumerate(counts):
        if count:
            colour = "white" if share[i, j] > 0.55 else "black"
            axes.text(j, i, str(count), ha="center", va="center", fontsize=7, color=colour)
    axes.set_xticks(range(len(columns)), columns, rotation=90, fontsize=7)
    axes.set_yticks(range(len(rows)), rows, fontsize=7)
    axes.set_xlabel("reported")
    axes.set_ylabel("concealed")
    _save(figure, path)


def draw_doses(doses: Sequence[Dose], path: Path) -> None:
    """Chance of a find against size, one panel for each curve with the number of its cases; shares
    with their intervals."""
    columns = min(5, len(doses))
    lines = -(-len(doses) // columns)
    figure = Figure(figsize=(0.8 + 3.2 * columns, 0.6 + 2.2 * lines), layout="constrained")
    size = np.geomspace(0.4, 15.0, 80)
    for i, dose in enumerate(doses):
        axes = figure.add_subplot(lines, columns, i + 1)
        axes.plot(size, dose.chance(size), color=NEUTRAL)
        for level, finds, trials in zip(dose.sizes, dose.finds, dose.trials, strict=True):
            low, high = clopper_pearson(finds, trials)
            axes.plot([level, level], [low, high], color="0.6", linewidth=1.0)
            axes.plot(level, finds / trials, "o", color=NEUTRAL, markersize=3.5)
        axes.set_xscale("log")
        axes.set_xticks([0.5, 1, 3, 6, 12], ["½", "1", "3", "6", "12"], fontsize=7)
        axes.xaxis.set_minor_locator(mpl.ticker.NullLocator())
        axes.set_yticks([0.0, 0.5, 1.0], ["0", "½", "1"], fontsize=7)
        axes.set_ylim(-0.05, 1.05)
        axes.set_title(f"{dose.title} ({sum(dose.trials)})", fontsize=8)
        axes.grid(alpha=0.25)
    figure.supxlabel("size in multiples of the smallest worth reporting", fontsize=8)
    figure.supylabel("share found", fontsize=8)
    _save(figure, path)


def draw_rates(rates: Sequence[Rate], path: Path, together: Sequence[Rate] = ()) -> None:
    """Rates with their intervals beside what was promised; below each the same rate of several
    sets together, where it is given."""
    shown = [r for r in rates if r.total]
    pooled = {r.title: r for r in together}
    figure = Figure(figsize=(8.6, 0.8 + 0.42 * len(shown)))
    axes = figure.add_subplot()
    for i, one in enumerate(reversed(shown)):
        low, high = one.interval
        colour = NEUTRAL if one.met is None or one.promised.startswith("(") else BROKEN
        if one.met and not one.promised.startswith("("):
            colour = KEPT
        axes.plot([low, high], [i, i], color=colour, linewidth=2.0)
        axes.plot(one.value, i, "o", color=colour)
        if one.title in pooled:
            all_sets = pooled[one.title]
            low, high = all_sets.interval
            axes.plot([low, high], [i - 0.25, i - 0.25], color="0.55", linewidth=1.2)
            axes.plot(all_sets.value, i - 0.25, "o", color="0.55", markersize=3.5)
        for promise in (one.at_least, one.at_most):
            if promise is not None:
                axes.plot([promise, promise], [i - 0.3, i + 0.3], color="black", linewidth=1.5)
    axes.set_yticks(range(len(shown)), [r.title for r in reversed(shown)], fontsize=8)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xlabel(
        "rate, with its 95 % interval; bars: promised"
        + ("; grey: several sets together" if together else "")
    )
    axes.grid(axis="x", alpha=0.25)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=140, bbox_inches="tight")
