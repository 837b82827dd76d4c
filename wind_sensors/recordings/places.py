"""Places that results are written to: tried before hours of computing, refused in words."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wind_sensors.errors import UserError


@contextmanager
def refused_in_words(where: str | Path, what: str = "result") -> Iterator[None]:
    """What is written inside becomes a message for people where it fails.

    Args:
        where: File or folder.
        what: Is written there.

    Raises:
        UserError: It cannot be written.
    """
    try:
        yield
    except OSError as problem:
        raise UserError(
            f"the {what} cannot be written ({problem.strerror or problem}).",
            str(where),
            "Choose another place with -o.",
        ) from None


def check_writable(folder: Path) -> None:
    """Try whether a folder can be made and written to; what was made for it goes again.

    Raises:
        UserError: It cannot.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    with refused_in_words(folder):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        finally:
            for path in missing:
                with suppress(OSError):
                    path.rmdir()
