"""Station files: what is accepted, what is refused and in which words, and what is written back."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wind_sensors.errors import UserError
from wind_sensors.recordings.mapping import mapping_markdown
from wind_sensors.recordings.station_files import (
    configuration_folder,
    load_station,
    shipped_profiles,
)
from wind_sensors.simulation.run import recording_start
from wind_sensors.station.inputs import resolved
from wind_sensors.station.model import Cup, Input, Propeller, Station
from wind_sensors.station.reading import read_station
from wind_sensors.station.reference import schema_markdown
from wind_sensors.station.schema import KINDS
from wind_sensors.station.writing import station_to_yaml

CUP = """\
instruments:
- name: cup
  kind: cup
  pulses: /cup/pulses
  pulses_per_revolution: 4
  calibration_distance: 0.14
  distance_constant: 1.7
"""


def refusal(text: str) -> str:
    with pytest.raises(UserError) as caught:
        read_station(text, "station.yaml", shipped_profiles())
    return str(caught.value)


def test_a_bare_topic_is_an_input_with_defaults() -> None:
    station = read_station(CUP, "station.yaml", {})
    cup = station.instrument("cup")
    assert isinstance(cup, Cup)
    assert cup.pulses == Input(topic="/cup/pulses")
    full = resolved(cup.pulses, "pulses")
    assert (full.type, full.field, full.meaning) == ("std_msgs/msg/Header", "stamp", "edge")


@pytest.mark.parametrize(
    ("wrong", "line", "words"),
    [
        ("calibration_distance: 0.14|calibration_distanse: 0.14", 6, "`calibration_distance`"),
        ("  distance_constant: 1.7\n|", 2, "Wind run"),
        ("distance_constant: 1.7|distance_constant: -1.7", 7, "above 0"),
        ("calibration_distance: 0.14|calibration_distance: 139.9", 6, "millimetres"),
        ("kind: cup|kind: cop", 2, "Did you mean 'cup'"),
        ("pulses_per_revolution: 4|pulses_per_revolution: four", 5, "whole number"),
        ("pulses: /cup/pulses|pulses: {topic: /a, fild: data}", 4, "`field`"),
        ("pulses: /cup/pulses|pulses: cup pulses//", 4, "it has a space in it. Write letters"),
        ("pulses: /cup/pulses|pulses: {topic: 7/cup}", 4, "pulses.topic: '7/cup' is not a ROS 2"),
        ("calibration_distance: 0.14|calibration_distance: 1e-30", 6, "smaller than any"),
        ("calibration_distance: 0.14|calibration_distance: 1.0e-8", 6, "Wind run per radian"),
        ("distance_constant: 1.7|distance_constant: 0.0001", 7, "follows the wind"),
        ("distance_constant: 1.7|distance_constant: 1.7\n  inertia_factor: 1e-9", 8, "smaller"),
        ("distance_constant: 1.7|distance_constant: 1.7\n  calibration_gain: 1e9", 8, "larger"),
        ("pulses_per_revolution: 4|pulses_per_revolution: 1000000000", 5, "larger than any"),
        ("instruments:|recording: {start: yesterday}\ninstruments:", 1, "2026-01-01T00:00:00Z"),
        ("instruments:|recording: {start: 2050-01-01}\ninstruments:", 1, "1901 to 2038"),
        ("distance_constant: 1.7|distance_constant: 1.7\n  profile: riso_cup", 8, "risoe_cup"),
        ("kind: cup|kind: cup\n  profile: fast_vane", 4, "profile of a vane"),
    ],
)
def test_each_fault_is_told_with_line_key_and_remedy(wrong: str, line: int, words: str) -> None:
    old, new = wrong.split("|")
    message = refusal(CUP.replace(old, new))
    assert f"station.yaml:{line}: " in message
    if words != "Wind run":
        assert words in message
    else:
        assert "distance_constant: missing" in message


def test_all_faults_are_told_at_once_in_the_order_of_lines() -> None:
    text = CUP.replace("0.14", "-1").replace("1.7", "many") + "air: {temprature: /t}\n"
    message = refusal(text)
    lines = [int(part.split(":")[1]) for part in message.splitlines()[1:]]
    assert lines == [6, 7, 8]


def test_broken_yaml_names_the_line() -> None:
    text = "instruments:\n- name: a\n  kind: [cup\nx: 1\n"
    assert "station.yaml:4: not valid YAML" in refusal(text)
    assert "no keys" in refusal("just text")


def test_a_missing_constant_says_what_is_known_about_it() -> None:
    text = "instruments:\n- {name: v, profile: fast_vane, joint_states: /v}\n"
    message = refusal(text)
    assert "damping_ratio: missing" in message
    assert shipped_profiles()["fast_vane"].missing["damping_ratio"] in message


def test_keys_beside_a_profile_win() -> None:
    text = (
        "instruments:\n- {name: c, profile: risoe_cup, pulses: /p, pulses_per_revolution: 2, "
        "distance_constant: 1.5}\n"
    )
    cup = read_station(text, "s", shipped_profiles()).instrument("c")
    assert isinstance(cup, Cup)
    assert (cup.calibration_distance, cup.distance_constant) == (0.2, 1.5)


def test_a_change_is_held_to_the_same_limits() -> None:
    text = CUP + "changes:\n- instrument: cup\n  set:\n    calibration_distance: 1e-30\n"
    assert "station.yaml:11: changes[0].set.calibration_distance" in refusal(text)


@pytest.mark.parametrize(
    ("stated", "start"),
    [
        ("2026-01-01T00:00:00Z", 1_767_225_600_000_000_000),
        ("2026-01-01T01:00:00.5+01:00", 1_767_225_600_500_000_000),
        ("2026-01-01", 1_767_225_600_000_000_000),
    ],
)
def test_the_start_is_a_date_a_time_or_both(stated: str, start: int) -> None:
    for text in (stated, f'"{stated}"'):
        station = read_station(f"recording: {{start: {text}}}\n{CUP}", "station.yaml", {})
        assert recording_start(station) == start


def test_changes_are_validated_like_the_entry_they_change() -> None:
    text = CUP + "changes:\n- instrument: cup\n  set:\n    friction_speed: -1\n    speed: 2\n"
    message = refusal(text)
    assert "station.yaml:11: changes[0].set.friction_speed" in message
    assert "station.yaml:12: changes[0].set.speed" in message
    assert "not in the station" in refusal(text.replace("instrument: cup", "instrument: cap"))


@pytest.mark.parametrize(
    "file", sorted(configuration_folder().glob("*.yaml")), ids=lambda file: file.stem
)
def test_shipped_configurations_are_valid_and_read_back(file: Path) -> None:
    station = load_station(file)
    again = read_station(station_to_yaml(station), "again.yaml", shipped_profiles())
    assert again == station
    assert load_station(file.stem) == station


def test_shipped_profiles_have_sources_and_either_give_or_explain_each_constant() -> None:
    required = {
        "cup": {"pulses_per_revolution", "calibration_distance", "distance_constant"},
        "propeller": {"pulses_per_revolution", "calibration_distance", "distance_constant"},
        "vane": {"distance_constant", "damping_ratio"},
        "bivane": {"distance_constant", "damping_ratio"},
    }
    profiles = shipped_profiles()
    assert len(profiles) >= 16
    for profile in profiles.values():
        assert any(year in profile.source for year in ("19", "20"))
        assert required[profile.kind] <= {*profile.constants, *profile.missing}
        assert not set(profile.constants) & set(profile.missing)


def test_an_unknown_station_file_lists_what_ships() -> None:
    with pytest.raises(UserError, match="mast_cup_vane"):
        load_station("no_such_mast")


def test_the_printed_reference_documents_every_key() -> None:
    text = schema_markdown()
    for model in KINDS.values():
        for name, field in model.model_fields.items():
            assert f"| `{name}` |" in text
            assert field.description, f"{model.__name__}.{name} has no description"
    docs = Path(__file__).parent.parent / "docs"
    for name, current in (("station", text), ("mapping", mapping_markdown())):
        shipped = (docs / f"{name}_file.md").read_text(encoding="utf-8")
        assert shipped == current, f"run: wind info --schema {name} > docs/{name}_file.md"


finite = st.floats(0.01, 3.0, allow_nan=False)


@st.composite
def stations(draw: st.DrawFn) -> Station:
    cup = Cup(
        name=draw(st.sampled_from(["cup", "no", "1", "a: b", "#x"])),
        profile=draw(st.sampled_from(["", "risoe_cup"])),
        pulses=Input(
            topic="/cup",
            type=draw(st.sampled_from(["", "std_msgs/msg/Int32"])),
            modulus=draw(st.sampled_from([None, 65536.0])),
            scale=draw(finite),
        ),
        pulses_per_revolution=draw(st.integers(1, 40)),
        calibration_distance=draw(finite),
        distance_constant=draw(finite),
        starting_speed=draw(st.sampled_from([0.0, 0.3])),
    )
    propeller = Propeller(
        name="propeller",
        pulses=Input(topic="/propeller"),
        pulses_per_revolution=1,
        calibration_distance=draw(finite),
        distance_constant=draw(finite),
        axis=draw(st.sampled_from([None, (1.0, 0.0, 0.0)])),
        angular_response_deg=(0.0, 90.0),
        angular_response=(1.0, draw(finite)),
    )
    return Station(instruments=(cup, propeller), sensor_heading_deg=draw(finite))


@settings(max_examples=60)
@given(stations())
def test_what_is_written_reads_back_as_the_same_station(station: Station) -> None:
    profiles = shipped_profiles()
    assert read_station(station_to_yaml(station, profiles), "s", profiles) == station
