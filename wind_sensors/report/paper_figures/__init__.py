"""The papers' figures, computed again from this package, with the errata that matter visible."""

from wind_sensors.report.paper_figures.registry import FIGURES, render

__all__ = ["FIGURES", "render"]
