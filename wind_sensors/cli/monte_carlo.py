"""`wind monte-carlo`: the bias formulas against the equations of motion."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from wind_sensors.cli.screen import screen
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.report.monte_carlo import Row, run_monte_carlo, table_markdown
from wind_sensors.report.monte_carlo_cases import standard_cases


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "monte-carlo",
        help="the formulas for biases against the equations of motion",
        description="Integrate the equations of motion of cups, propellers and vanes in synthetic "
        "von Karman turbulence and compare their mean rates with the second-order formulas. "
        "Numbers are in units of the turbulence intensity squared; 'same modes' is the formula "
        "evaluated with the turbulence that was actually drawn. Exit status 1 if a difference is "
        "larger than three standard errors plus the stated fourth-order remainder.",
    )
    parser.add_argument("-o", "--output", metavar="OUT", help="Markdown file to write the table to")
    parser.add_argument("--force", action="store_true", help="replace OUT if it is there")
    parser.add_argument(
        "--pairs", type=int, default=200, metavar="N",
        help="realisations, each with its mirror (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="of the turbulence, from 0 (default: %(default)s)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the experiment, print its table, write it where asked."""
    if args.pairs < 2:
        raise UserError(
            f"{args.pairs} is too few.", "--pairs", "Give at least 2; 200 take a minute or two."
        )
    if args.seed < 0:
        raise UserError("The seed must not be negative.", "--seed", "Use 0 or more.")
    target = Path(args.output) if args.output else None
    if target is not None and target.exists() and not args.force:
        raise UserError("the file is already there.", str(target), "Use --force to replace it.")
    console = screen()
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting", total=len(standard_cases()))
        started = 0

        def tell(name: str) -> None:
            nonlocal started
            progress.update(task, description=name, completed=started)
            started += 1

        rows = run_monte_carlo(args.pairs, args.seed, progress=tell)
    # One row, one line, also where the output is not a terminal.
    console.width = max(console.width, 130)
    console.print(_table(rows))
    if target is not None:
        with refused_in_words(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(table_markdown(rows), encoding="utf-8")
        print(f"wrote {target}")
    return 0 if all(row.passed for row in rows) else 1


def _table(rows: list[Row]) -> Table:
    table = Table(
        title="Mean bias over I² (variance over σ²); difference: with the turbulence drawn"
    )
    for name in ("case", "I", "simulation", "formula", "difference", "allowed", ""):
        table.add_column(name, justify="left" if name == "case" else "right", no_wrap=True)
    for row in rows:
        table.add_row(
            row.case,
            f"{row.intensity:g}",
            f"{row.simulation:.4f} ± {row.simulation_error:.4f}",
            f"{row.formula:.4f}",
            f"{row.difference:+.5f} ± {row.difference_error:.5f}",
            f"{row.allowed:.5f}",
            "ok" if row.passed else Text("outside", "red"),
        )
    return table
