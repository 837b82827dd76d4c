"""Write recorded signals as a ROS 2 bag (mcap, zstd) without a ROS installation."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from proving_ground.boat import quaternion
from proving_ground.inflow import Array
from proving_ground.measure import Signals

START = 1_767_225_600
NANOSECONDS = 1_000_000_000
STORE = get_typestore(Stores.ROS2_JAZZY)
MARKS = tuple(1.0e-300 * (3 + i) for i in range(32))


@dataclass(frozen=True)
class Template:
    """A serialised message with the places of its stamp and of its numbers."""

    message_type: str
    body: bytes
    places: tuple[int, ...]

    def fill(self, seconds: int, nanoseconds: int, values: tuple[float, ...]) -> bytes:
        """The message with its stamp and numbers filled in."""
        body = bytearray(self.body)
        struct.pack_into("<iI", body, 4, seconds, nanoseconds)
        for place, value in zip(self.places, values, strict=True):
            struct.pack_into("<d", body, place, value)
        return bytes(body)


@dataclass(frozen=True)
class Channel:
    """One topic: stamps [s] and rows of numbers in the order of the template."""

    topic: str
    template: Template
    time: Array
    values: Array


def _message(name: str, /, **fields: Any) -> Any:
    return STORE.types[name](**fields)


def _header(frame: str) -> Any:
    time = _message("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    return _message("std_msgs/msg/Header", stamp=time, frame_id=frame)


def _template(message_type: str, message: Any, count: int) -> Template:
    body = bytes(STORE.serialize_cdr(message, message_type))
    places = tuple(body.index(struct.pack("<d", MARKS[i])) for i in range(count))
    return Template(message_type, body, places)


def _vector(first: int) -> Any:
    x, y, z = MARKS[first : first + 3]
    return _message("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def wind_template() -> Template:
    """Reference wind: geometry_msgs/Vector3Stamped."""
    name = "geometry_msgs/msg/Vector3Stamped"
    return _template(name, _message(name, header=_header("enu"), vector=_vector(0)), 3)


def pulse_template(rotor: str) -> Template:
    """A pulse: std_msgs/Header."""
    name = "std_msgs/msg/Header"
    return _template(name, _header(f"{rotor}_rotor"), 0)


def vane_template() -> Template:
    """Vane reading: sensor_msgs/JointState."""
    name = "sensor_msgs/msg/JointState"
    message = _message(
        name,
        header=_header("wind_sensor"),
        name=["vane"],
        position=np.array([MARKS[0]]),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )
    return _template(name, message, 1)


def temperature_template() -> Template:
    """Air temperature: sensor_msgs/Temperature."""
    name = "sensor_msgs/msg/Temperature"
    message = _message(name, header=_header("air"), temperature=MARKS[0], variance=0.01)
    return _template(name, message, 1)


def pressure_template() -> Template:
    """Air pressure: sensor_msgs/FluidPressure."""
    name = "sensor_msgs/msg/FluidPressure"
    message = _message(name, header=_header("air"), fluid_pressure=MARKS[0], variance=100.0)
    return _template(name, message, 1)


def odometry_template() -> Template:
    """Platform motion: nav_msgs/Odometry; 13 numbers as they stand in the message."""
    x, y, z = MARKS[0:3]
    qx, qy, qz, qw = MARKS[3:7]
    point = _message("geometry_msgs/msg/Point", x=x, y=y, z=z)
    turn = _message("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw)
    pose = _message("geometry_msgs/msg/Pose", position=point, orientation=turn)
    twist = _message("geometry_msgs/msg/Twist", linear=_vector(7), angular=_vector(10))
    message = _message(
        "nav_msgs/msg/Odometry",
        header=_header("enu"),
        child_frame_id="base_link",
        pose=_message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
        twist=_message(
            "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)
        ),
    )
    return _template("nav_msgs/msg/Odometry", message, 13)


def channels(signals: Signals, rotor: str) -> list[Channel]:
    """The topics of a recording with a rotor called `rotor`."""
    found = [
        Channel("/reference/wind", wind_template(), signals.reference_time, signals.reference),
        Channel("/vane/joint_states", vane_template(), signals.vane_time, signals.vane[:, None]),
        Channel(
            "/air/temperature",
            temperature_template(),
            signals.air_time,
            signals.temperature[:, None],
        ),
        Channel("/air/pressure", pressure_template(), signals.air_time, signals.pressure[:, None]),
        Channel(
            f"/{rotor}/pulses",
            pulse_template(rotor),
            signals.pulses,
            np.zeros((signals.pulses.size, 0)),
        ),
    ]
    motion = signals.odometry
    if motion is not None:
        turn = quaternion(motion.yaw, motion.pitch, motion.roll)[:, [1, 2, 3, 0]]
        values = np.concatenate([motion.position, turn, motion.velocity, motion.turning], axis=1)
        found.append(Channel("/platform/odom", odometry_template(), signals.odometry_time, values))
    return found


def write_bag(folder: Path, signals: Signals, rotor: str) -> None:
    """Write the bag of a recording into `folder`, messages in the order of their stamps."""
    topics = channels(signals, rotor)
    stamps = np.concatenate([c.time for c in topics])
    owner = np.repeat(np.arange(len(topics)), [c.time.size for c in topics])
    row = np.concatenate([np.arange(c.time.size) for c in topics])
    whole = np.round(stamps * NANOSECONDS).astype(np.int64) + START * NANOSECONDS
    order = np.argsort(whole, kind="stable")
    rows = [c.values.tolist() for c in topics]
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = [
            writer.add_connection(c.topic, c.template.message_type, typestore=STORE) for c in topics
        ]
        for i in order.tolist():
            channel = int(owner[i])
            moment = int(whole[i])
            data = topics[channel].template.fill(
                moment // NANOSECONDS, moment % NANOSECONDS, tuple(rows[channel][int(row[i])])
            )
            writer.write(connections[channel], moment, data)
