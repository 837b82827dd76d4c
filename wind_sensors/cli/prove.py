"""`wind prove`: seal recordings, diagnose them blind, open and score."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from wind_sensors.errors import UserError

if TYPE_CHECKING:
    from proving_ground.scoring.rates import Rate


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add `prove` and its steps to the command line."""
    parser = subparsers.add_parser(
        "prove",
        help="the proving ground: an independent world to test against",
        description="Recordings of an independent world with concealed causes: one person seals "
        "them, another diagnoses them, and opening them gives the score card.",
    )
    steps = parser.add_subparsers(dest="step", required=True)

    seal = steps.add_parser("seal", help="write recordings, hide the answers, print a commitment")
    seal.add_argument("-n", "--number", type=_positive, default=60, help="recordings to seal")
    seal.add_argument("--seed", type=int, default=1)
    seal.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    seal.add_argument("--key", type=Path, metavar="FILE", help="write or read the secret here")
    seal.add_argument("--minutes", type=float, default=15.0, help="length of a recording")
    seal.add_argument("--healthy", type=_positive, default=6, help="healthy ones for each station")
    seal.add_argument("--kinds", default="ABC", help="station kinds: A mast, B boat, C propeller")
    seal.add_argument(
        "--cause",
        action="append",
        default=[],
        metavar="EFFECT:SIZE[@BEGIN[-END]]",
        help="conceal this on each kind of station instead of drawing; several joined by +; "
        "repeatable (the names of such recordings tell what is in them)",
    )
    seal.add_argument("--jobs", type=_positive, default=1)

    trial = steps.add_parser("run", help="diagnose each recording where the answers cannot be read")
    trial.add_argument("folder", type=Path, metavar="DIR")
    trial.add_argument("--jobs", type=_positive, default=1)
    trial.add_argument("--timeout", type=float, default=300.0, help="seconds for one diagnosis")
    trial.add_argument(
        "--option", action="append", default=[], help="passed on to `wind diagnose`; repeatable"
    )

    opened = steps.add_parser("open", help="check the commitment, open the answers and score")
    opened.add_argument("folder", type=Path, metavar="DIR")
    opened.add_argument("--key", required=True, metavar="FILE|HEX")
    opened.add_argument("-o", "--output", type=Path, metavar="OUT", help="default DIR/score")
    opened.add_argument("--force", action="store_true", help="write over an earlier score")
    opened.add_argument("--jobs", type=_positive, default=1, help="of the oracle")
    opened.add_argument("--no-oracle", action="store_true", help="do not fit the true models")
    opened.add_argument("--partial", action="store_true", help="score before all is diagnosed")

    again = steps.add_parser(
        "again", help="diagnose an opened set with another program, and tell what changed"
    )
    again.add_argument("folder", type=Path, metavar="DIR")
    again.add_argument("--key", required=True, metavar="FILE|HEX")
    again.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    again.add_argument("--jobs", type=_positive, default=1)
    again.add_argument("--only", nargs="+", metavar="RECORDING", help="some of the recordings")

    peers = steps.add_parser("peers", help="other methods on the recordings of an opened set")
    peers.add_argument("folder", type=Path, metavar="DIR")
    peers.add_argument("--key", metavar="FILE|HEX", help="without it, all but the counting is done")
    peers.add_argument("-o", "--output", type=Path, metavar="OUT", help="default DIR/score")
    peers.add_argument("--jobs", type=_positive, default=1)

    twins = steps.add_parser("twins", help="misfit removed, against a twin without the cause")
    twins.add_argument("folder", type=Path, metavar="DIR")
    twins.add_argument("--key", required=True, metavar="FILE|HEX")
    twins.add_argument("-o", "--output", type=Path, metavar="OUT", help="default DIR/score")

    real = steps.add_parser("real", help="diagnose real records, and doses planted into them")
    real.add_argument("-o", "--output", type=Path, required=True, metavar="OUT")
    real.add_argument("--from", dest="local", type=Path, metavar="DIR", help="copies to use")
    real.add_argument("--force", action="store_true", help="replace an earlier page")

    page = steps.add_parser("publish", help="fill a page with the numbers of scored sets")
    page.add_argument(
        "folders", type=Path, nargs="*", metavar="SCORE", help="what open, peers, real wrote"
    )
    page.add_argument("--page", type=Path, default=Path("docs/proof.md"), metavar="FILE")

    demo = steps.add_parser("demo", help="one case from sealing to opening in two minutes")
    demo.add_argument("-o", "--output", type=Path, default=Path("prove_demo"), metavar="DIR")
    demo.add_argument("--seed", type=int, default=7)
    demo.add_argument("--force", action="store_true", help="replace an earlier demo")

    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run one step; 0 on success, 1 where `open` finds a promise broken."""
    steps = {
        "seal": _seal,
        "run": _run,
        "open": _open,
        "again": _again,
        "peers": _peers,
        "twins": _twins,
        "real": _real,
        "publish": _publish,
        "demo": _demo,
    }
    return steps[arguments.step](arguments)


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return value


def _seal(arguments: argparse.Namespace) -> int:
    from proving_ground.sealing.cipher import new_key
    from proving_ground.sealing.seal import seal

    if set(arguments.kinds) - set("ABC") or not arguments.kinds:
        raise UserError(f"unknown station kinds {arguments.kinds!r}", "--kinds", "Use A, B, C.")
    file: Path | None = arguments.key
    key = _read_key(str(file)) if file is not None and file.exists() else new_key()
    sealed = seal(
        arguments.output,
        arguments.number,
        arguments.seed,
        key,
        minutes=arguments.minutes,
        healthy_count=arguments.healthy,
        kinds=arguments.kinds,
        causes=arguments.cause,
        jobs=arguments.jobs,
    )
    print(f"sealed {sealed.recordings} recordings in {sealed.folder}")
    print(f"commitment {sealed.commitment}")
    if file is None:
        print(f"key {key.hex()}  (keep it apart from the recordings)")
    else:
        _write_key(file, key)
        print(f"the key is in {file}; keep it apart from the recordings")
    return 0


def _run(arguments: argparse.Namespace) -> int:
    from proving_ground.sealing.trial import run_all

    failed = run_all(
        arguments.folder,
        jobs=arguments.jobs,
        timeout=arguments.timeout,
        options=arguments.option,
    )
    print(f"diagnoses are in {arguments.folder / 'runs'}; {failed} failed")
    return 0


def _open(arguments: argparse.Namespace) -> int:
    from proving_ground.sealing.opening import score

    output = arguments.output or arguments.folder / "score"
    rates = score(
        arguments.folder,
        _read_key(arguments.key),
        output,
        force=arguments.force,
        partial=arguments.partial,
    )
    _print_rates(rates)
    if not arguments.no_oracle:
        from proving_ground.scoring.card import NUMBERS, read_card
        from proving_ground.scoring.oracle import shares, write_shares

        judged = read_card(output / NUMBERS).judged
        write_shares(output, shares(arguments.folder, judged, arguments.jobs))
    print(f"wrote {output}")
    return int(any(rate.met is False for rate in rates))


def _again(arguments: argparse.Namespace) -> int:
    from proving_ground.scoring.again import lines
    from proving_ground.sealing.opening import check_all_said, judge_said, open_answers
    from proving_ground.sealing.trial import run_all

    folder: Path = arguments.folder
    check_all_said(folder)
    answers = open_answers(folder, _read_key(arguments.key))
    unknown = sorted(set(arguments.only or ()) - set(answers))
    if unknown:
        raise UserError(
            f"no recording is called {', '.join(unknown)}", "--only", "The manifest lists them."
        )
    before = judge_said(folder, answers)
    run_all(folder, jobs=arguments.jobs, results=arguments.output, only=arguments.only)
    page = "\n".join(lines(before, judge_said(arguments.output, answers)))
    path = arguments.output / "again.md"
    path.write_text(page + "\n", encoding="utf-8")
    print(page)
    print(f"wrote {path}")
    return 0


def _peers(arguments: argparse.Namespace) -> int:
    from proving_ground.peers.rows import write_table
    from proving_ground.peers.table import compare
    from proving_ground.sealing.opening import about_set, judge_all, open_sealed

    if arguments.key is None:
        from proving_ground.peers.regress import regress_all

        said = regress_all(arguments.folder, arguments.jobs)
        print(f"the peers have judged {len(said[False])} recordings; --key counts")
        return 0
    sealed = open_sealed(arguments.folder, _read_key(arguments.key))
    judged = judge_all(arguments.folder, sealed["answers"])
    rows = compare(arguments.folder, sealed["answers"], judged, arguments.jobs)
    about = about_set(arguments.folder, sealed)
    print(f"wrote {write_table(arguments.output or arguments.folder / 'score', rows, about)}")
    return 0


def _twins(arguments: argparse.Namespace) -> int:
    from proving_ground.scoring.twins import removals, write_removals

    found = removals(arguments.folder, _read_key(arguments.key))
    print(f"wrote {write_removals(arguments.output or arguments.folder / 'score', found)}")
    return 0


def _real(arguments: argparse.Namespace) -> int:
    import shutil

    from proving_ground.real.page import run_real

    output: Path = arguments.output
    if output.exists():
        if not arguments.force:
            raise UserError("the folder exists already.", str(output), "Add --force to replace it.")
        shutil.rmtree(output)
    print(f"wrote {run_real(output, arguments.local)}")
    return 0


def _publish(arguments: argparse.Namespace) -> int:
    from proving_ground.publishing.page import publish

    for path in publish(arguments.page, arguments.folders):
        print(f"wrote {path}")
    return 0


def _demo(arguments: argparse.Namespace) -> int:
    from proving_ground.sealing.demo import play

    play(arguments.output, arguments.seed, force=arguments.force)
    return 0


def _print_rates(rates: list[Rate]) -> None:
    from rich.table import Table

    from wind_sensors.cli.screen import screen

    table = Table("what", "rate", "95 % interval", "promised")
    for rate in rates:
        if rate.total:
            low, high = rate.interval
            table.add_row(
                rate.title,
                f"{100 * rate.value:.1f} % ({rate.hits}/{rate.total})",
                f"{100 * low:.1f} to {100 * high:.1f} %",
                rate.promised,
                style="" if rate.met is not False else "bold",
            )
    screen().print(table)


def _read_key(given: str) -> bytes:
    path = Path(given)
    text = path.read_text(encoding="ascii").strip() if path.is_file() else given
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    if len(key) != 32:
        raise UserError(
            "this is not a key", given if path.is_file() else "--key", "A key is 64 hex digits."
        )
    return key


def _write_key(path: Path, key: bytes) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.write(key.hex() + "\n")
