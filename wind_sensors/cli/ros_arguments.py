"""`--ros-args` for the commands that talk to live topics."""

from __future__ import annotations

import argparse


def add_ros_arguments(parser: argparse.ArgumentParser) -> None:
    """Let a command take `--ros-args ...` at its end."""
    parser.add_argument(
        "--ros-args",
        nargs=argparse.REMAINDER,
        default=[],
        metavar="...",
        help="remappings and parameters for ROS, as for any node; last on the line",
    )


def ros_arguments(args: argparse.Namespace) -> list[str]:
    """What to hand to rclpy."""
    return ["--ros-args", *args.ros_args] if args.ros_args else []
