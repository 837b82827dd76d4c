"""`wind`: the commands and what they share."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import NoReturn

from wind_sensors.cli.encoding import show_any_text
from wind_sensors.errors import UserError
from wind_sensors.processes import one_thread_of_linear_algebra

COMMANDS: dict[str, str] = {
    "simulate": "wind to signals: write the recording a station would make",
    "process": "signals to wind: corrected wind of a recording, with its uncertainty",
    "compare": "recorded minus simulated: where a recording differs from its station",
    "baseline": "learn from healthy recordings what is normal for a station",
    "diagnose": "find the physics that a station file leaves out",
    "record": "record live topics into a recording",
    "replay": "publish a recording as live topics",
    "compose": "simulator, estimators and recorder of a station in one process",
    "import": "tables, logger exports and NMEA 0183 logs to a recording",
    "info": "what is in a recording or a station file",
    "plot": "figures of a recording",
    "figures": "the figures of the papers, computed again",
    "monte-carlo": "the formulas for biases against the equations of motion",
    "prove": "the proving ground: an independent world to test against",
    "demo": "the main job end to end, with a page that shows it",
}
"""Every command with its one-line description; a module that is not installed is not listed."""

_LIVE = frozenset({"record", "replay", "compose"})
"""Commands that a stop signal ends as it ends a node: with status 0, at any moment."""


class _Parser(argparse.ArgumentParser):
    """A parser that tells what is wrong with the arguments first, and no page of usage."""

    def error(self, message: str) -> NoReturn:
        stop = "" if message.endswith((".", "!", "?")) else "."
        self.exit(2, f"{self.prog}: {message}{stop} `{self.prog} --help` explains the options.\n")


def module_of(command: str) -> str:
    """Name of the module behind a command."""
    name = command.replace("-", "_")
    return f"wind_sensors.cli.{name}_" if name == "import" else f"wind_sensors.cli.{name}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `wind`.

    Args:
        arguments: Command line without the program's name; None: this process's.

    Returns:
        0 on success, 1 on a judgement that the user asked for, 2 on bad input.
    """
    show_any_text()
    one_thread_of_linear_algebra()
    given = list(sys.argv[1:] if arguments is None else arguments)
    commands = {name: text for name, text in COMMANDS.items() if find_spec(module_of(name))}
    chosen = given[0] if given and given[0] in commands else None
    if chosen in _LIVE:
        from wind_sensors.nodes.execution import stop_signals_answered

        with stop_signals_answered():
            return _run(commands, chosen, given)
    return _run(commands, chosen, given)


def _run(commands: Mapping[str, str], chosen: str | None, given: Sequence[str]) -> int:
    try:
        parser = _parser(commands, chosen)
        if not given:
            parser.print_help()
            return 0
        options = parser.parse_args(given)
        status = int(options.run(options))
        # A reader that has gone is met here and not at the end of the interpreter.
        sys.stdout.flush()
        return status
    except UserError as problem:
        print(f"wind {chosen}: {problem}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _parser(commands: Mapping[str, str], chosen: str | None) -> argparse.ArgumentParser:
    """The parser; only the chosen command's module is imported, so that help is instant."""
    parser = _Parser(
        prog="wind",
        description="Corrected wind from cups, propellers and vanes, on masts and on robots.",
        epilog="A RECORDING is a folder with recording.yaml and bag/, or a bag with --station "
        "FILE. `wind COMMAND --help` explains each command.",
    )
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", dest="command")
    subparsers.required = True
    for name, text in commands.items():
        if name == chosen:
            import_module(module_of(name)).register(subparsers)
        else:
            subparsers.add_parser(name, help=text, add_help=False)
    return parser
