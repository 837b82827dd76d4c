"""What every process that computes for others beside it has to keep to."""

from __future__ import annotations

import os

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def one_thread_of_linear_algebra() -> None:
    """Give the linear algebra of this process and of those it starts a single thread.

    Numpy reads this when it is first imported: to be called before that. What the environment
    already says is kept. The matrices of this package are small; threads that wait in loops for
    each other beside processes at work on every core double the time and more.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)
