"""One look for all figures."""

from __future__ import annotations

from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, GREY = "#1f5fa8", "#d9822b", "#3a8f5c", "#777777"
PRINTED: dict[str, Any] = {"color": "#c23b3b", "linestyle": (0, (5, 3)), "linewidth": 1.3}
"""Curves as a paper prints them, where that is wrong."""


def single(figure: Figure, x_label: str, y_label: str) -> Axes:
    """One pair of axes that fills the figure."""
    axes = figure.add_subplot()
    label(axes, x_label, y_label)
    return axes


def label(axes: Axes, x_label: str, y_label: str) -> None:
    """Label and grid, the same everywhere."""
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, which="major", color="#dddddd", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


Place = Literal["best", "upper left", "upper right", "lower left", "lower right"]


def legend(axes: Axes, location: Place = "best") -> None:
    """A legend without a frame."""
    axes.legend(frameon=False, loc=location, fontsize=9)
