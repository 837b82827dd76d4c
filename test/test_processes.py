"""Processes beside each other get one thread of linear algebra each."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from wind_sensors.diagnosis.explaining.signatures import in_parallel
from wind_sensors.processes import ONE_THREAD, one_thread_of_linear_algebra

TASKS = Path("/proc/self/task")


@pytest.mark.skipif(not TASKS.exists(), reason="only Linux counts threads there")
def test_processes_started_from_here_get_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ONE_THREAD:
        monkeypatch.delenv(name)
    one_thread_of_linear_algebra()
    threads = "import numpy, os; numpy.ones((400, 400)) @ numpy.ones((400, 400)); "
    threads += f"print(len(os.listdir({str(TASKS)!r})))"
    shown = subprocess.run(
        [sys.executable, "-c", threads], capture_output=True, text=True, check=True
    )
    assert shown.stdout.strip() == "1"


def test_what_the_environment_says_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    one_thread_of_linear_algebra()
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"


def test_only_the_first_process_answers_an_interrupt() -> None:
    def answers(_: int) -> bool:
        return signal.getsignal(signal.SIGINT) is not signal.SIG_IGN

    # Where a shell started the tests in the background, nobody answers.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert not any(in_parallel(answers, range(4), 2))
        assert answers(0), "this one still does"
    finally:
        signal.signal(signal.SIGINT, before)
