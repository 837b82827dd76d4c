"""Command line of the world, for colleagues: single recordings (sets: `wind prove seal`)."""

from __future__ import annotations

import argparse
from pathlib import Path

from proving_ground.concealed.strangers import STRANGERS
from proving_ground.generate import (
    generate_recording,
    healthy,
    random_station,
    with_effect,
    write_answers,
)
from proving_ground.minimum_sizes import MINIMUM_SIZES


def main() -> int:
    """Parse the arguments and run one command; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m proving_ground", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("generate", help="write one recording and, beside it, its answer")
    one.add_argument("--kind", choices=["A", "B", "C"], default="A")
    one.add_argument("--station", type=int, default=1, help="seed of the station")
    one.add_argument("--seed", type=int, default=1, help="seed of the weather and the drawing")
    one.add_argument("--minutes", type=float, default=15.0)
    one.add_argument("--effect", choices=[*MINIMUM_SIZES, *STRANGERS])
    one.add_argument("--size", type=float, default=3.0, help="multiples of the minimum size")
    one.add_argument("--healthy", action="store_true")
    one.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    if arguments.healthy == bool(arguments.effect):
        parser.error("say either --healthy or --effect NAME")
    station = random_station(arguments.kind, arguments.station)
    spec = (
        healthy(station, arguments.seed, arguments.minutes)
        if arguments.healthy
        else with_effect(
            station, arguments.effect, arguments.size, arguments.seed, arguments.minutes
        )
    )
    folder: Path = arguments.output
    answer = generate_recording(spec.into(folder))
    write_answers(folder.with_name(folder.name + ".answer.yaml"), {folder.name: answer})
    print(f"wrote {folder} and {folder.name}.answer.yaml")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
