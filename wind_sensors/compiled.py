"""The one place that decides how numeric kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """Compile a numeric kernel to machine code, keeping its type signature.

    The compiled code is cached beside the source, so that only the first run after an
    installation pays for the compilation. Floating-point semantics stay strict (no reassociation),
    because the same input must give the same bits live and offline.
    """
    return cast(_Function, numba.njit(cache=True, error_model="numpy")(function))
