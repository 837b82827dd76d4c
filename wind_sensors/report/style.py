"""How figures look: one place for colours, sizes and fonts."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK = "#22303c"
MUTED = "#7a8793"
GRID = "#e3e8ec"
REFERENCE = "#22303c"
RAW = "#d9822b"
CORRECTED = "#1f6fb2"
SERIES = ("#1f6fb2", "#d9822b", "#4f9d69", "#b0487c", "#7d6bb0", "#8a6d3b")
"""Told apart by colour-blind readers too, in this order."""

_SETTINGS: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.2,
    "svg.fonttype": "none",
    "svg.hashsalt": "wind_sensors",
    "savefig.dpi": 160,
}


def house() -> AbstractContextManager[None]:
    """The settings under which figures are drawn and saved."""
    return rc_context(_SETTINGS)


def figure(rows: int = 1, height: float = 3.2, **options: Any) -> tuple[Figure, list[Axes]]:
    """An empty figure with one column of axes; to be drawn inside `house()`.

    Args:
        rows: Number of axes.
        height: Of one of them [inch].
        options: For `Figure.subplots`.
    """
    made = Figure(figsize=(9.0, height * rows), layout="constrained")
    axes = made.subplots(rows, 1, squeeze=False, **options)
    return made, list(axes[:, 0])


def save(made: Figure, path: str) -> None:
    """Write a figure; the ending of the path decides the format."""
    with house():
        metadata = {"Date": None} if path.endswith(".svg") else {}
        made.savefig(path, metadata=metadata)
