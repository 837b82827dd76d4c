"""Which texts are accepted as names of topics."""

from __future__ import annotations

import argparse

import pytest

from wind_sensors.cli import record
from wind_sensors.errors import UserError
from wind_sensors.station.topic_names import topic_name_fault

NAMES = (
    "cup", "/cup", "cup/pulses", "/a/b_1/c", "_hidden/cup", "~", "~/pulses", "{ns}/cup",
    "{node}/cup", "cup_{node}", "a__b",
)

FAULTS = {
    "": "is empty",
    "cup pulses": "a space",
    "cup-pulses": "'-'",
    "cup/": "ends with a slash",
    "/": "ends with a slash",
    "/cup//pulses": "two slashes",
    "/{ns}/cup": "two slashes",
    "/1/cup": "begins with a digit ('1')",
    "~/2": "begins with a digit ('2')",
    "~cup": "'~'",
    "/~/cup": "'~'",
    "{name}/cup": "'{'",
    "a" * 300: "300 characters",
}


@pytest.mark.parametrize("name", NAMES)
def test_names_of_every_sort_are_accepted(name: str) -> None:
    assert topic_name_fault(name) == ""


@pytest.mark.parametrize(("name", "fault"), FAULTS.items())
def test_what_no_node_could_use_is_refused_with_the_reason(name: str, fault: str) -> None:
    assert fault in topic_name_fault(name)


@pytest.mark.parametrize("name", [*NAMES, *FAULTS])
def test_ros_agrees(name: str) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from rclpy.exceptions import InvalidTopicNameException
    from rclpy.expand_topic_name import expand_topic_name
    from rclpy.validate_full_topic_name import validate_full_topic_name

    if name == "~cup":
        pytest.skip("rclpy lets it through; its documentation asks for a slash after the tilde")
    try:
        validate_full_topic_name(expand_topic_name(name, "node", "/space"))
    except (InvalidTopicNameException, ValueError):
        assert topic_name_fault(name)
    else:
        assert not topic_name_fault(name)


def test_record_refuses_such_a_topic_before_it_starts() -> None:
    given = argparse.Namespace(station=None, topics=["/cup", "bad name//"], all=False)
    with pytest.raises(UserError, match="--topics: 'bad name//' is not a ROS 2 topic name"):
        record.run(given)
