"""`wind figures`: the figures of the papers, computed again."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.progress import track

from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.report.paper_figures import FIGURES, render


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "figures",
        help="the figures of the papers, computed again",
        description="Draw the figures of Kristensen (1994), Kristensen et al. (2014), Mitsuta "
        "(1966) and Jackson (c. 1980) from this package's formulas and simulations. Where a paper "
        "prints a wrong formula, its curve is shown dashed in red beside the right one.",
        epilog="Names: " + ", ".join(FIGURES),
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="figures to draw, like k94-13; all if none given"
    )
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="folder to write to")
    parser.add_argument(
        "--format", choices=("png", "svg", "pdf"), default="png", help="default: png"
    )
    parser.add_argument("--force", action="store_true", help="replace files that are there")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw the figures asked for."""
    names = list(args.names) or list(FIGURES)
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        raise UserError(
            f"there is no figure '{unknown[0]}'.", remedy=f"Known: {', '.join(FIGURES)}."
        )
    folder = Path(args.output)
    if folder.exists() and not folder.is_dir():
        raise UserError(
            "this is a file, not a folder.", str(folder), "Choose another place with -o."
        )
    targets = {name: folder / f"{name}.{args.format}" for name in names}
    present = [path for path in targets.values() if path.exists()]
    if present and not args.force:
        raise UserError(
            "the file is already there.", str(present[0]), "Use --force to replace it."
        )
    console = screen()
    with refused_in_words(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in track(names, description="drawing", console=console, transient=True):
            render(name, targets[name])
    for path in targets.values():
        print(f"wrote {path}")
    return 0
