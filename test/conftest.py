"""Read before any test module, and so before numpy is imported."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from wind_sensors.processes import one_thread_of_linear_algebra

if TYPE_CHECKING:
    from nodes_harness import Graph

one_thread_of_linear_algebra()

# An example that takes long says that the machine is busy, or that a kernel is being compiled.
settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    """A graph of nodes over DDS, on a domain of its own."""
    from nodes_harness import Graph  # where no rclpy is, the other tests still run

    made = Graph(tmp_path, monkeypatch)
    yield made
    made.close()
