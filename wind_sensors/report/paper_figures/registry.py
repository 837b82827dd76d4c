"""Names of the figures and how to draw one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from wind_sensors.errors import UserError
from wind_sensors.report.paper_figures import jackson as j80
from wind_sensors.report.paper_figures import kristensen_1994 as k94
from wind_sensors.report.paper_figures import kristensen_2014 as k14
from wind_sensors.report.paper_figures import mitsuta_1966 as m66


class PaperFigure(NamedTuple):
    """A figure of a paper: its title and what draws it."""

    title: str
    draw: Callable[[Figure], None]


FIGURES: dict[str, PaperFigure] = {
    "k94-2": PaperFigure("First-order response of a cup", k94.first_order_step),
    "k94-5": PaperFigure("Step response of vanes", k94.damped_step),
    "k94-6": PaperFigure("A strongly damped vane", k94.strong_damping),
    "k94-7": PaperFigure("The integrals g and h", k94.resonance_integrals),
    "k94-8": PaperFigure("Loss of variance in the inertial subrange", k94.loss_function),
    "k94-9": PaperFigure("Spectrum of the wind and of the vane", k94.inertial_spectrum),
    "k94-10": PaperFigure("The same, slope 3/2", k94.spectrum_three_halves),
    "k94-11": PaperFigure("The same, slope 5/3", k94.spectrum_five_thirds),
    "k94-12": PaperFigure("The same, slope 2", k94.spectrum_two),
    "k94-13": PaperFigure("Variance regained by resonance", k94.recovered_fraction),
    "k94-14": PaperFigure("The vector wind run", k94.vector_run),
    "k94-16": PaperFigure("Propeller-vane in the surface layer", k94.surface_layer_function),
    "k14-2": PaperFigure("The von Kármán spectrum", k14.longitudinal_spectrum),
    "k14-3": PaperFigure("Structure functions", k14.structure_functions),
    "k14-5": PaperFigure("Variance lost by a first-order instrument", k14.filtered_fractions),
    "m66-1": PaperFigure("Frequency response of a bivane", m66.frequency_response),
    "m66-3": PaperFigure("Spectra of the vertical wind, simulated bivane", m66.spectra),
    "j80-1": PaperFigure("Steady axial response with friction", j80.steady_axial),
    "j80-2": PaperFigure("Torque slope in oblique flow", j80.torque_slope),
    "j80-3": PaperFigure("Response length near 90 degrees", j80.transverse_length),
    "j80-4": PaperFigure("Response to a large sinusoid", j80.distorted_sinusoid),
}
"""K94, K14, M66, J80 and the number of the figure in the paper."""

_PAPERS = {
    "k94": "Kristensen (1994)",
    "k14": "Kristensen et al. (2014)",
    "m66": "Mitsuta (1966)",
    "j80": "Jackson (c. 1980)",
}


def render(name: str, path: Path) -> None:
    """Draw one figure into a file; the suffix (png, svg, pdf) decides the format.

    Args:
        name: Key of `FIGURES`.
        path: File to write.

    Raises:
        UserError: If there is no such figure, or the format is unknown.
    """
    if name not in FIGURES:
        raise UserError(f"there is no figure '{name}'.", remedy=f"Known: {', '.join(FIGURES)}.")
    if path.suffix not in {".png", ".svg", ".pdf"}:
        raise UserError(f"figures cannot be written as '{path.suffix}'.", str(path), "Use .png.")
    entry = FIGURES[name]
    paper, number = name.split("-")
    figure = Figure(figsize=(7.2, 4.8), dpi=130, layout="constrained")
    figure.suptitle(f"{_PAPERS[paper]}, Fig. {number}: {entry.title}", fontsize=11)
    entry.draw(figure)
    figure.savefig(path)
