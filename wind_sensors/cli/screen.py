"""What the commands print on."""

from __future__ import annotations

import sys

from rich.console import Console


class _Screen(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to the front door, for which a reader that has read enough is no failure."""
        raise BrokenPipeError


def screen(*, stderr: bool = False, plain_width: int | None = None) -> Console:
    """A console that prints text as it stands: `[m/s]` is a unit and `[red]` part of a name.

    Args:
        stderr: To the standard error, for progress.
        plain_width: Of tables where no terminal says its own; None: 80 columns.
    """
    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() else plain_width
    return _Screen(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)
