"""Tables from loggers of other habits: clock changes, decimal commas, and advice that helps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wind_sensors.errors import UserError
from wind_sensors.recordings.columns import Table, read_table
from wind_sensors.recordings.importing import import_files
from wind_sensors.recordings.mapping import Mapping, Signal, TimeColumn, read_mapping

STATION = """
station:
  instruments:
  - {name: cup, kind: cup, pulses: {topic: /cup, type: std_msgs/msg/Float64, meaning: value},
     pulses_per_revolution: 2, calibration_distance: 0.2, distance_constant: 2}
  - {name: vane, kind: vane, joint_states: /v, distance_constant: 1, damping_ratio: 0.4}
  reference: {topic: /wind}
"""


def mapping_with(keys: str = "", signals: str = "", zone: str = "UTC") -> str:
    standing = "- {column: D, direction: from_north, topic: /v, type: sensor_msgs/msg/JointState}"
    time = f"time: {{column: t, zone: {zone}}}"
    return f"format: csv\n{time}\n{keys}\nsignals:\n{signals or standing}{STATION}"


def refused(tmp_path: Path, table: str, mapping: str) -> str:
    file = tmp_path / "ok.csv"
    file.write_text(table, "utf-8")
    with pytest.raises(UserError) as caught:
        import_files([file], read_mapping(mapping, "map.yaml"))
    return str(caught.value)


def local(tmp_path: Path, stamps: list[str], zone: str) -> Table:
    file = tmp_path / "clock.csv"
    file.write_text("t,V\n" + "".join(f"{stamp},8\n" for stamp in stamps), "utf-8")
    signals = (Signal(column="V", topic="/cup"),)
    time = TimeColumn(column="t", zone=zone)
    return read_table(file, Mapping(format="csv", time=time, signals=signals))


def clock(hours: list[int], minutes: list[int], day: str) -> list[str]:
    return [f"{day} {hour:02d}:{minute:02d}" for hour in hours for minute in minutes]


@pytest.mark.parametrize("minutes", [[0], [0, 30], [0, 10, 20, 30, 40, 50]])
@pytest.mark.parametrize("backwards", [False, True])
def test_the_hour_that_comes_twice_is_told_by_the_order_of_the_rows(
    tmp_path: Path, minutes: list[int], backwards: bool
) -> None:
    stamps = clock([0, 1, 2, 2, 3, 4], minutes, "2024-10-27")
    table = local(tmp_path, stamps[::-1] if backwards else stamps, "Europe/Berlin")
    time = table.time[::-1] if backwards else table.time
    first = np.datetime64("2024-10-26T22:00", "ns").astype(np.int64)
    step = 3_600_000_000_000 // len(minutes)
    assert time.tolist() == [first + k * step for k in range(len(stamps))]
    (note,) = table.notes
    assert "2024-10-27 02:00" in note and "comes twice" in note


def test_an_hour_that_should_come_twice_and_does_not_is_told(tmp_path: Path) -> None:
    table = local(tmp_path, clock([1, 2, 3], [0, 30], "2024-10-27"), "Europe/Berlin")
    (note,) = table.notes
    assert "comes once" in note and "write `zone: +01:00`" in note


def test_a_logger_that_stays_on_winter_time_is_told_its_zone(tmp_path: Path) -> None:
    stamps = clock([1, 2, 3], [0, 10, 20, 30, 40, 50], "2024-03-31")
    with pytest.raises(UserError) as caught:
        local(tmp_path, stamps, "Europe/Berlin")
    told = str(caught.value)
    assert "clock.csv:9: 5 times do not exist in Europe/Berlin" in told
    assert "2024-03-31 02:10" in told and "Write `zone: +01:00`." in told
    assert np.all(np.diff(local(tmp_path, stamps, "+01:00").time) == 600_000_000_000)


def test_the_end_of_the_last_interval_of_winter_time_exists(tmp_path: Path) -> None:
    stamps = ["2024-03-31 01:50", "2024-03-31 02:00", "2024-03-31 03:10"]
    table = local(tmp_path, stamps, "Europe/Berlin")
    assert np.all(np.diff(table.time) == 600_000_000_000)
    assert table.notes == ()


def test_a_decimal_comma_is_read_where_it_is_stated_and_advised_where_not(tmp_path: Path) -> None:
    table = "t;D\n2024-06-01T00:00:00;45,5\n2024-06-01T00:00:01;46,25\n"
    told = refused(tmp_path, table, mapping_with("delimiter: ';'"))
    assert "2 unreadable values in D" in told
    assert "ok.csv:2: '45,5' in D cannot be read; write `decimal: \",\"` in the mapping" in told
    mapping = read_mapping(mapping_with("delimiter: ';'\ndecimal: ','"), "map.yaml").mapping
    assert read_table(tmp_path / "ok.csv", mapping).values["D"].tolist() == [45.5, 46.25]


def test_what_cannot_be_read_is_shown_with_its_line_and_a_remedy(tmp_path: Path) -> None:
    told = refused(tmp_path, "t,D\n01.06.2024 00:00,45\n", mapping_with())
    assert "ok.csv:2: the time '01.06.2024 00:00' cannot be read" in told
    assert 'write `format: "%d.%m.%Y %H:%M"` under `time`' in told
    told = refused(tmp_path, "t;D\n2024-06-01T00:00:00;45\n", mapping_with())
    assert 'Write `delimiter: ";"` in the mapping.' in told
    assert "the table has no rows" in refused(tmp_path, "t,D\n", mapping_with())
    assert "Left out" not in refused(tmp_path, "t,D\n", mapping_with())
    assert "1 lines without a readable time" in refused(tmp_path, "t,D\n,45\n", mapping_with())


def test_rows_of_another_width_are_no_missing_rows(tmp_path: Path) -> None:
    told = refused(tmp_path, "t,D,extra\n" + "2024-06-01T00:00:00,45\n" * 600, mapping_with())
    assert "600 lines have 2 columns and not the 3 of the header" in told
    assert "no rows" not in told


def test_a_missing_file_is_told_in_words(tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        import_files([tmp_path / "none.csv"], read_mapping(mapping_with(), "map.yaml"))
    assert "there is no such file" in str(caught.value) and "Errno" not in str(caught.value)


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("format: csv", "fromat: csv", "unknown key. Did you mean `format`?"),
        ("format: csv", "fromat: csv", "format: missing. Add `format: ...`."),
        ("topic: /", "topik: /", "Did you mean `topic`?"),
        ("direction: from_north", "direction: from_nord",
         "'from_nord' is not one of the choices. Choose 'from_north' or 'from_bow'. Did you mean "
         "'from_north'?"),
    ],
)
def test_slips_in_a_mapping_are_told_as_those_in_a_station_file(
    right: str, wrong: str, told: str
) -> None:
    signals = "- {column: D, direction: from_north, topic: /v}"
    mapping = mapping_with(signals=signals)
    assert right in mapping
    with pytest.raises(UserError) as caught:
        read_mapping(mapping.replace(right, wrong, 1), "map.yaml")
    assert told in str(caught.value)
    assert "Input should be" not in str(caught.value)


def test_sixteen_bit_text_is_read(tmp_path: Path) -> None:
    file = tmp_path / "wide.csv"
    file.write_bytes("t,D\n2024-06-01T00:00:00,45\n".encode("utf-16"))
    mapping = read_mapping(mapping_with(), "map.yaml").mapping
    assert read_table(file, mapping).values["D"].tolist() == [45.0]


def test_what_no_wind_can_be_is_left_out_and_counted(tmp_path: Path) -> None:
    file = tmp_path / "odd.csv"
    rows = ["8,45", "inf,50", "8,725", "-3,50"]
    lines = [f"2024-06-01T00:00:0{k},{row}" for k, row in enumerate(rows)]
    file.write_text("\n".join(["t,V,D", *lines, ""]), "utf-8")
    keys = "vectors:\n- {topic: /wind, speed: {column: V}, direction_from: {column: D, unit: deg}}"
    result = import_files([file], read_mapping(mapping_with(keys), "map.yaml"))
    assert result.faults["values in V that are not finite"] == 1
    assert result.faults["speeds below nought in V"] == 1
    assert result.faults["directions of more than a turn in D"] == 2, "of the wind and of the vane"
    assert {t.topic: len(t.raw) for t in result.topics} == {"/v": 3, "/wind": 1}


@pytest.mark.parametrize(
    ("mapping", "told"),
    [
        (mapping_with(zone="MEZ"), "map.yaml:2: time.zone"),
        (mapping_with(zone="+1"), "'1' is not a time zone"),
        (
            mapping_with(signals="- {column: V, unit: degC, topic: /cup}"),
            "map.yaml:5: signals[0].unit",
        ),
        (
            mapping_with("vectors: [{topic: /wind, speed: {column: V, unit: hPa}, "
                         "direction_from: {column: D, unit: deg}}]"),
            "'hPa' is no unit of a speed",
        ),
    ],
)
def test_zones_and_units_are_judged_with_the_mapping(mapping: str, told: str) -> None:
    with pytest.raises(UserError) as caught:
        read_mapping(mapping, "map.yaml")
    assert told in str(caught.value)
    assert "one problem" in str(caught.value)
