"""A ROS graph of its own for a test: real DDS on this machine, its own domain, several contexts."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from wind_sensors.nodes.execution import make_executor
from wind_sensors.nodes.quality import input_quality

_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_DOMAINS = itertools.count(os.getppid() * _WORKERS + _WORKER, _WORKERS)
"""Test processes that run side by side share their parent and never meet in one domain."""

_MOST_DOMAINS = 100
"""Ports of higher domains may be those that Linux gives to anybody."""

_BATCH = 20
"""Callbacks of one node before it is the next one's turn."""


class Graph:
    """Nodes, each in a participant of its own, spun in turns from the test's thread."""

    def __init__(self, tmp_path: Any, monkeypatch: Any) -> None:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
        self.domain = 1 + next(_DOMAINS) % _MOST_DOMAINS
        self._contexts: list[Context] = []
        self._executors: list[Any] = []
        self._nodes: list[Any] = []
        self._resting: set[int] = set()

    def add(self, make: Callable[..., Any], **options: Any) -> Any:
        """Make a node in a new participant; options go to `make` together with `context`."""
        context = Context()
        context.init([], domain_id=self.domain)
        node = make(context=context, **options)
        executor = make_executor(context)
        executor.add_node(node)
        self._contexts.append(context)
        self._executors.append(executor)
        self._nodes.append(node)
        return node

    def listener(self) -> Any:
        """A plain node for subscriptions of the test."""
        return self.add(lambda **options: Node("listener", **options))

    def listen(self, node: Any, message_type: Any, topic: str, reliable: bool = True) -> list[Any]:
        """Collect the messages of a topic."""
        got: list[Any] = []
        quality = input_quality(reliable=reliable, depth=10_000)
        node.create_subscription(message_type, topic, got.append, quality)
        return got

    def rest(self, node: Any) -> None:
        """Let a node do nothing more; what it has published still arrives."""
        self._resting.add(self._nodes.index(node))

    def spin(
        self,
        until: Callable[[], bool],
        at_most: float = 20.0,
        so_far: Callable[[], object] = lambda: "",
    ) -> None:
        """Spin everything until the condition holds.

        Args:
            until: The condition.
            at_most: Seconds to wait for it.
            so_far: Tells how far it has come, if it never holds.

        Raises:
            AssertionError: It never did.
        """
        end = time.monotonic() + at_most
        while not until():
            late = time.monotonic() >= end
            assert not late, f"what the test waits for never happened {so_far()}"
            self.spin_once()
            time.sleep(0.0005)

    def spin_once(self) -> None:
        """A turn of every node that does not rest."""
        for index, executor in enumerate(self._executors):
            if index in self._resting:
                continue
            for _ in range(_BATCH):
                executor.spin_once(timeout_sec=0.0)

    def close(self) -> None:
        """Destroy everything."""
        for executor, node, context in zip(
            self._executors, self._nodes, self._contexts, strict=True
        ):
            executor.shutdown()
            node.destroy_node()
            context.try_shutdown()


def overrides(**values: Any) -> list[Parameter]:
    """Parameter overrides; names with dots come as `**{"a.b": 1}`."""
    return [Parameter(name, value=value) for name, value in values.items()]


def stamps_and_velocities(messages: list[Any]) -> tuple[Any, Any, Any]:
    """Times [ns], velocities and covariances of TwistWithCovarianceStamped messages."""
    times = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in messages]
    linear = [m.twist.twist.linear for m in messages]
    velocity = np.array([[v.x, v.y, v.z] for v in linear])
    covariance = np.array([np.reshape(m.twist.covariance, (6, 6))[:3, :3] for m in messages])
    return np.array(times, dtype=np.int64), velocity, covariance


def status(messages: list[Any], name: str) -> Any:
    """The newest diagnostic status whose name ends so; None if there is none."""
    for array in reversed(messages):
        for item in array.status:
            if item.name.endswith(name):
                return item
    return None


def values(item: Any) -> dict[str, str]:
    """Details of a diagnostic status."""
    return {pair.key: pair.value for pair in item.values}
