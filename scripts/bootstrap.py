"""Build the virtual environment of this checkout, or say in one sentence why that is impossible.

Usage: python3 scripts/bootstrap.py [EXTRA ...]

Where rclpy is importable (a sourced ROS 2 installation) the environment sees it; elsewhere the
wheels of the extra `ros` are installed, and where there are none the offline tools still work.
Runs again only when the declaration in setup.py or this file has changed.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "wind_sensors.stamp"
OLDEST = (3, 10)
WHEELS_UP_TO = (3, 14)
DECLARATION = ("setup.py", "setup.cfg", "pyproject.toml", "scripts/bootstrap.py")


def clean_environment() -> dict[str, str]:
    """The environment without what the ROS wheels of another environment left in it."""
    environment = dict(os.environ)
    if environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None):
        environment.pop("LD_LIBRARY_PATH", None)
    environment.pop("PYTHONHOME", None)
    return environment


def rclpy_is_importable() -> bool:
    """Whether this Python already has ROS 2."""
    answer = subprocess.run(
        [sys.executable, "-c", "import rclpy"],
        env=clean_environment(),
        capture_output=True,
        check=False,
    )
    return answer.returncode == 0


def wheels_exist() -> bool:
    """Whether PyPI has the ROS 2 wheels for this platform."""
    return (
        sys.platform == "linux"
        and platform.machine() == "x86_64"
        and platform.libc_ver()[0] == "glibc"
        and platform.python_implementation() == "CPython"
        and OLDEST <= sys.version_info[:2] <= WHEELS_UP_TO
    )


def run(*command: str) -> None:
    """Run a command; its failure ends the script with its output already shown."""
    result = subprocess.run(command, cwd=ROOT, env=clean_environment(), check=False)
    if result.returncode:
        sys.exit(f"wind_sensors: this step failed: {' '.join(command)}")


def main(extras: list[str]) -> None:
    """Make `.venv` ready."""
    if sys.version_info[:2] < OLDEST:
        sys.exit(
            f"wind_sensors needs Python 3.10 or newer; this is {platform.python_version()} "
            "(choose another one with `make PYTHON=python3.12 ...`)."
        )
    system_ros = rclpy_is_importable()
    with_wheels = not system_ros and wheels_exist()
    if not system_ros and not with_wheels:
        print(
            "wind_sensors: rclpy is not importable and its wheels exist for Linux x86-64 with "
            "CPython 3.10 to 3.14 only, so the nodes will not run here; the offline commands will."
        )
    if with_wheels:
        extras = [*extras, "ros"]
    text = "".join((ROOT / name).read_text(encoding="utf-8") for name in DECLARATION)
    wanted = hashlib.sha256(f"{text}{system_ros}".encode()).hexdigest()
    wanted = " ".join([wanted, *sorted(extras)])
    if STAMP.exists() and set(wanted.split()) <= set(STAMP.read_text(encoding="utf-8").split()):
        return
    python = VENV / "bin" / "python"
    if not python.exists():
        if importlib.util.find_spec("ensurepip") is None:
            version = f"{sys.version_info[0]}.{sys.version_info[1]}"
            sys.exit(
                "wind_sensors: this Python cannot make virtual environments; install them with "
                f"`sudo apt-get install python{version}-venv` and run the same command again."
            )
        options = ["--system-site-packages"] if system_ros else []
        run(sys.executable, "-m", "venv", *options, str(VENV))
        run(str(python), "-m", "pip", "install", "--quiet", "--upgrade", "pip")
    print(f"wind_sensors: installing into {VENV.name} ({', '.join(extras)})", flush=True)
    run(str(python), "-m", "pip", "install", "--quiet", "--editable", f".[{','.join(extras)}]")
    STAMP.write_text(wanted, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:] or ["test"])
