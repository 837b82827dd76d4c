"""Reading and writing many messages at once equals rosbags' message by message."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.fields import columns, leaf, stamps
from wind_sensors.recordings.serialising import serialised, template
from wind_sensors.station.inputs import field_path, field_value

TYPES = typestore()
JOINT = "sensor_msgs/msg/JointState"
number = st.floats(allow_nan=False, allow_infinity=False, width=64)


@st.composite
def joint_states(draw: st.DrawFn) -> bytes:
    message = template(TYPES, JOINT)
    message.header.frame_id = draw(st.text("abcdef", max_size=9))
    message.header.stamp.sec = draw(st.integers(0, 2**31 - 1))
    message.header.stamp.nanosec = draw(st.integers(0, 999_999_999))
    message.name = draw(st.lists(st.text("xyz", max_size=7), max_size=3))
    message.position = np.asarray(draw(st.lists(number, max_size=3)), dtype=np.float64)
    message.velocity = np.asarray(draw(st.lists(number, max_size=2)), dtype=np.float64)
    message.effort = np.asarray(draw(st.lists(number, max_size=2)), dtype=np.float64)
    little = draw(st.booleans())
    return bytes(TYPES.serialize_cdr(message, JOINT, little_endian=little))


@settings(max_examples=150)
@given(st.lists(joint_states(), min_size=1, max_size=6))
def test_fields_of_mixed_layouts_equal_rosbags(raw: list[bytes]) -> None:
    places = [("position", 0), ("position", 2), ("velocity", 1)]
    found = columns(raw, TYPES, JOINT, places)
    time = stamps(raw, TYPES, JOINT, ("header", "stamp"))
    for index, data in enumerate(raw):
        message: Any = TYPES.deserialize_cdr(data, JOINT)
        assert time[index] == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        for column, (name, item) in zip(found, places, strict=True):
            values = getattr(message, name)
            expected = values[item] if item < len(values) else np.nan
            assert np.array_equal(column[index], expected, equal_nan=True)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("std_msgs/msg/Int32", "data"),
        ("std_msgs/msg/Bool", "data"),
        ("std_msgs/msg/UInt8", "data"),
        ("std_msgs/msg/Float32", "data"),
        ("std_msgs/msg/Int64", "data"),
        ("nav_msgs/msg/Odometry", "twist.covariance[7]"),
        ("nav_msgs/msg/Odometry", "pose.pose.orientation.w"),
        ("sensor_msgs/msg/Imu", "angular_velocity.z"),
        ("diagnostic_msgs/msg/DiagnosticStatus", "level"),
    ],
)
def test_what_is_serialised_from_arrays_deserialises_to_the_same(name: str, field: str) -> None:
    path = field_path(field)
    values = np.asarray([0.0, 1.0, 1.0, 0.0])
    raw = serialised(TYPES, template(TYPES, name, [path]), {path: values})
    assert np.array_equal(columns(raw, TYPES, name, [path])[0], values)
    read = [field_value(TYPES.deserialize_cdr(data, name), path) for data in raw]
    assert np.array_equal(np.asarray(read, dtype=np.float64), values)


def test_types_that_only_the_bag_defines() -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    text = "string label\nuint16[] codes\nStep[] steps\n" + "=" * 80
    text += "\nMSG: my_msgs/Step\nbool on\nfloat32[2] pair\nfloat64 value\n"
    types.register(get_types_from_msg(text, "my_msgs/msg/Deep"))
    path = field_path("steps[1].value")
    blank = template(types, "my_msgs/msg/Deep", [path], {("label",): "abc"})
    raw = serialised(types, blank, {path: np.asarray([2.5, -1.0])})
    assert columns(raw, types, "my_msgs/msg/Deep", [path])[0].tolist() == [2.5, -1.0]
    deep: Any = types.deserialize_cdr(raw[1], "my_msgs/msg/Deep")
    assert deep.steps[1].value == -1.0


def test_integers_are_rounded_and_kept_in_range() -> None:
    raw = serialised(
        TYPES, template(TYPES, "std_msgs/msg/Int16"), {("data",): np.asarray([1.6, 1e9, -1e9])}
    )
    assert columns(raw, TYPES, "std_msgs/msg/Int16", [("data",)])[0].tolist() == [2, 32767, -32768]


def test_wrong_names_say_what_is_there() -> None:
    with pytest.raises(UserError, match="position, velocity, effort"):
        leaf(TYPES, JOINT, field_path("positon[0]"))
    with pytest.raises(UserError, match="unknown"):
        leaf(TYPES, "my_msgs/msg/Nothing", ())
    with pytest.raises(UserError, match="not a field"):
        field_path("a[b]")
