"""The one place that decides how numeric kernels are compiled and where they are kept."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


@cache
def _kernel_folder(package: Path) -> str:
    """Where the machine code of a package's kernels is kept.

    A kernel contains the kernels that it calls, but the compiler's own cache watches only the file
    in which it stands. The folder is therefore named after the text of all kernel files together:
    after any change everything is compiled again, and nothing stale is ever run.
    """
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if b"@compiled" in text or b"@inlined" in text:
            digest.update(path.relative_to(package).as_posix().encode())
            digest.update(text)
    name = f"kernels-{digest.hexdigest()[:16]}"
    beside = package / "__pycache__"
    if not (beside / name).exists() and _writable(beside):
        for stale in beside.glob("kernels-*"):
            shutil.rmtree(stale, ignore_errors=True)
    users = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for folder in (beside, users / "wind_sensors", Path(tempfile.gettempdir()) / "wind_sensors"):
        if _writable(folder / name):
            return str(folder / name)
    return ""


def _package_of(function: Callable[..., Any]) -> Path:
    """Folder of the package that a function belongs to."""
    depth = function.__module__.count(".")
    return Path(function.__code__.co_filename).resolve().parents[max(depth - 1, 0)]


def is_kept(kernel: Callable[..., Any]) -> bool:
    """Whether an earlier run has compiled a kernel, so that its first call need not wait.

    Args:
        kernel: Made by `compiled`.
    """
    function = cast(Any, kernel).py_func
    file = Path(function.__code__.co_filename).stem
    folder = _kernel_folder(_package_of(function))
    return folder != "" and any(Path(folder).rglob(f"{file}.{function.__qualname__}-*.nbi"))


def compiled(function: _Function, inline: bool = False) -> _Function:
    """Compile a numeric kernel to machine code, keeping its type signature.

    Args:
        function: Of numbers and arrays.
        inline: Whether its machine code stands where other kernels call it.

    The machine code is kept between runs, so that only the first run after an installation pays
    for the compilation. Floating-point semantics stay strict (no reassociation), because the same
    input must give the same bits live and offline.
    """
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = _kernel_folder(_package_of(function))
    try:
        compile_it = numba.njit(cache=True, error_model="numpy", forceinline=inline)
        return cast(_Function, compile_it(function))
    finally:
        settings.CACHE_DIR = before


def inlined(function: _Function) -> _Function:
    """As `compiled`, of a small kernel in others' loops."""
    return compiled(function, True)
