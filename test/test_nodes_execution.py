"""Executables as a launcher sees them: exit codes, help, mistakes on the command line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from wind_sensors.nodes.outputs import TOPICS

ESTIMATORS = ("cup_vane_node", "propeller_vane_node", "propeller_array_node", "bivane_node")


def _start(node: str, tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    code = f"import sys; from wind_sensors.nodes.{node} import main; sys.exit(main(sys.argv[1:]))"
    return _run(code, tmp_path, *arguments)


def _run(code: str, tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    environment = os.environ | {
        "ROS_LOG_DIR": str(tmp_path),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(100 + os.getpid() % 100),
    }
    return subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("node", ["cup_vane_node", "sim_node"])
def test_every_way_to_stop_it_ends_with_status_zero(node: str, tmp_path: Path) -> None:
    cases: list[tuple[float, Sequence[signal.Signals]]] = [
        (0.7, [signal.SIGINT]),
        (1.4, [signal.SIGTERM]),
        (2.0, [signal.SIGINT, signal.SIGINT]),
        (6.0, [signal.SIGINT]),
        (6.0, [signal.SIGINT, signal.SIGINT]),
        (6.0, [signal.SIGTERM]),
    ]
    station = ["--ros-args", "-p", "station:=mast_cup_vane"]
    begin = time.monotonic()
    running = [_start(node, tmp_path, *station) for _ in cases]
    for process, (delay, signals) in zip(running, cases, strict=True):
        time.sleep(max(0.0, begin + delay - time.monotonic()))
        for number in signals:
            process.send_signal(number)
    for process, case in zip(running, cases, strict=True):
        _, errors = process.communicate(timeout=30)
        assert process.returncode == 0, f"{case}: {errors}"
        assert "Traceback" not in errors


_STOPPED_BEFORE_IT_PUBLISHES = """
import os, signal, sys, time
from wind_sensors.nodes.execution import run

def build():
    from rclpy.node import Node
    from std_msgs.msg import Float64

    node = Node("echo")
    source = node.create_publisher(Float64, "source", 10)
    echo = node.create_publisher(Float64, "echo", 10)

    def receive(message):
        for _ in range(2):
            os.kill(os.getpid(), int(sys.argv[1]))
        time.sleep(0.3)
        echo.publish(message)
        node.get_logger().info("published")

    node.create_subscription(Float64, "source", receive, 10)
    node.create_timer(0.002, lambda: source.publish(Float64()))
    return [node]

sys.exit(run(build, []))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_callback_that_a_stop_signal_meets_still_publishes(
    number: signal.Signals, tmp_path: Path
) -> None:
    process = _run(_STOPPED_BEFORE_IT_PUBLISHES, tmp_path, str(int(number)))
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert (output + errors).count("published") == 1
    for sign in ("FATAL", "Traceback", "Failed"):
        assert sign not in errors


_INTERRUPTED_CLASS = """
import os, signal, sys
from wind_sensors.nodes.execution import run

class Interrupting:
    def __set_name__(self, owner, name):
        os.kill(os.getpid(), signal.SIGINT)

def build():
    class Holder:
        part = Interrupting()
    raise SystemExit("the signal was lost")

sys.exit(run(build, []))
"""


_INTERRUPTED_WITHIN_COMPILED_CODE = """
import ctypes, os, signal, sys
from wind_sensors.nodes.execution import run

def build():
    if ctypes.pythonapi.PyRun_SimpleString(b"os.kill(os.getpid(), signal.SIGINT); 1 + 1"):
        raise ImportError("a library failed to import")
    raise SystemExit("the signal was lost")

sys.exit(run(build, []))
"""


@pytest.mark.parametrize("script", [_INTERRUPTED_CLASS, _INTERRUPTED_WITHIN_COMPILED_CODE])
def test_a_signal_that_becomes_another_error_ends_with_status_zero(
    script: str, tmp_path: Path
) -> None:
    process = _run(script, tmp_path)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors


@pytest.mark.parametrize("node", ESTIMATORS)
def test_help_lists_topics_and_parameters(node: str, tmp_path: Path) -> None:
    output, _ = _start(node, tmp_path, "--help").communicate(timeout=60)
    for topic in TOPICS:
        assert topic in output
    assert "smoother_lag" in output
    assert "distance_constant" in output


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--ros-args", "-p", "station:=nowhere.yaml"], "no such station file"),
        (["--ros-args", "-p", "output_rate:=0"], "'output_rate' must be at least 0.1"),
        (["--ros-args", "-p", "broken"], "--ros-args"),
        ([], "calibration_distance"),
    ],
)
def test_mistakes_end_with_status_two_and_a_sentence(
    arguments: list[str], told: str, tmp_path: Path
) -> None:
    process = _start("cup_vane_node", tmp_path, *arguments)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert told in errors
    assert "Traceback" not in errors


_TWO_NODES = """
import sys
from wind_sensors.nodes.execution import run

def build():
    from rclpy.node import Node

    first, second = Node("first"), Node("second")
    first.declare_parameter("window", 1.0)
    second.declare_parameter("rate", 1.0)
    return [first, second]

sys.exit(run(build, sys.argv[1:], until=lambda: True))
"""


def test_a_parameter_that_no_node_of_the_process_knows_is_told_once(tmp_path: Path) -> None:
    file = tmp_path / "fleet.yaml"
    file.write_text(
        "/**:\n  ros__parameters: {widnow: 5.0, window: 5.0, rate: 2.0, use_sim_time: false}\n",
        encoding="utf-8",
    )
    process = _run(_TWO_NODES, tmp_path, "--ros-args", "--params-file", str(file))
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    told = [line for line in (output + errors).splitlines() if "is not known" in line]
    assert len(told) == 1
    assert "'widnow'" in told[0] and "did you mean 'window'?" in told[0]


STOPPED_WITHIN_A_DESTRUCTOR = """
import os, signal
from wind_sensors.nodes.execution import run

class Held:
    def __init__(self, answer):
        self.answer = answer

    def __del__(self):
        self.answer()

def build():
    Held(lambda: os.kill(os.getpid(), signal.SIGINT))
    Held(lambda: 1 / 0)
    return []

raise SystemExit(run(build, []))
"""


STOPPED_WHILE_A_MISTAKE_IS_TOLD = """
import os, signal, sys
from wind_sensors.nodes.execution import run

class Held:
    def __del__(self):
        1 / 0

def tell(unraisable):
    os.kill(os.getpid(), signal.SIGINT)
    sys.__unraisablehook__(unraisable)

def build():
    Held()
    return []

sys.unraisablehook = tell
raise SystemExit(run(build, []))
"""


@pytest.mark.parametrize("script", [STOPPED_WITHIN_A_DESTRUCTOR, STOPPED_WHILE_A_MISTAKE_IS_TOLD])
def test_a_stop_within_a_destructor_is_silent_and_other_mistakes_there_are_not(
    script: str, tmp_path: Path
) -> None:
    environment = os.environ | {
        "ROS_LOG_DIR": str(tmp_path),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(100 + os.getpid() % 100),
    }
    done = subprocess.run(
        [sys.executable, "-c", script],
        env=environment, capture_output=True, text=True, timeout=60, check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "_Stopped" not in done.stderr
    assert "ZeroDivisionError" in done.stderr
