"""Foreign files become recordings: units, time zones, pulses, NMEA conventions, bad lines."""

from __future__ import annotations

import gzip
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wind_sensors.cli.import_ import load_mapping
from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.recordings import nmea, read_recording, read_series
from wind_sensors.recordings.importing import Imported, import_files, write_imported
from wind_sensors.recordings.mapping import UNITS, read_mapping
from wind_sensors.recordings.station_files import configuration_folder
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Recording

REAL = Path(__file__).parent.parent.parent / "shared" / "real"
MAPPINGS = sorted((configuration_folder() / "mappings").glob("*.yaml"))


def nanoseconds(moment: str) -> int:
    return int(np.datetime64(moment, "ns").astype(np.int64))


def imported(
    tmp_path: Path, text: str, mapping: str, name: str = "input.txt"
) -> tuple[Imported, Recording]:
    file = tmp_path / name
    data = text.encode("utf-8")
    file.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    mapping_file = load_mapping(mapping)
    result = import_files([file], mapping_file)
    folder = write_imported(tmp_path / "recording", result, mapping_file)
    return result, read_recording(folder)


@pytest.mark.parametrize("file", MAPPINGS, ids=lambda file: file.stem)
def test_shipped_mappings_are_valid(file: Path) -> None:
    found = load_mapping(file.stem)
    assert found.mapping.sources
    assert found.station.instruments


def test_a_topic_that_the_station_calls_otherwise_is_told(tmp_path: Path) -> None:
    mapping = """
format: csv
time: {column: time}
signals:
- {column: angle, direction: from_north, topic: /vane/joint_state, type: sensor_msgs/msg/JointState}
- {column: angle, topic: /vane/angle_deviation}
station:
  instruments:
  - name: vane
    kind: vane
    joint_states: /vane/joint_states
    distance_constant: 1.3
    damping_ratio: 0.3
  reference: {kind: sonic, topic: /reference/wind}
"""
    table = tmp_path / "table.csv"
    table.write_text("time,angle\n2026-01-01T00:00:00,10\n2026-01-01T00:00:01,11\n", "utf-8")
    (note,) = import_files([table], read_mapping(mapping, "map.yaml")).notes
    assert note.startswith("/vane/joint_state:")
    assert "did you mean /vane/joint_states?" in note


def test_units_agree_with_their_definitions() -> None:
    def si(unit: str, value: float) -> float:
        factor, offset = UNITS[unit]
        return factor * value + offset

    assert si("kn", 3600.0) == pytest.approx(1852.0)
    assert si("mph", 1.0) == pytest.approx(1609.344 / 3600.0)
    assert si("degF", 212.0) == pytest.approx(100.0)
    assert si("degF", 32.0) == pytest.approx(0.0, abs=1e-12)
    assert si("K", 273.15) == pytest.approx(0.0, abs=1e-12)
    assert si("deg", 180.0) == pytest.approx(np.pi)
    assert si("hPa", 1013.25) == si("mbar", 1013.25) == pytest.approx(101_325.0)


TOA5 = """\
"TOA5","6843","CR3000","6843","CR3000.Std.22","CPU:x.CR3","24006","ts"
"TIMESTAMP","RECORD","Ux","Uy","Uz","Ts","press"
"TS","RN","m/s","m/s","m/s","C","kPa"
"","","Smp","Smp","Smp","Smp","Smp"
"2012-06-07 12:45:00.05",1,2.5,-1.5,-0.25,27.5,100.2
"2012-06-07 12:45:00.1",2,2.75,-1.25,"NAN",27.5,100.2
half a li
"2012-06-07 12:45:00.15",3,3,-1,0.5,27.5,100.2
"not a time",4,3,-1,0.5,27.5,100.2
"2012-06-07 12:45:00.2",5,abc,-1,0.5,27.5,100.2
"""


def test_toa5_becomes_a_reference_wind(tmp_path: Path) -> None:
    result, recording = imported(tmp_path, TOA5, "toa5_sonic", "x.dat.gz")
    assert recording.reference is not None
    first = nanoseconds("2012-06-07T12:45:00.05")
    assert recording.reference.time.tolist() == [first, first + 100_000_000]
    assert recording.station.recording.start == "2012-06-07T12:45:00.050Z"
    assert recording.reference.velocity.tolist() == [[2.5, -1.5, -0.25], [3.0, -1.0, 0.5]]
    assert recording.pressure is not None
    assert np.allclose(recording.pressure.value, 100_200.0)
    assert result.faults == Counter(
        {
            "lines with a wrong number of columns": 1,
            "lines without a readable time": 1,
            "missing values in Uz": 1,
            "unreadable values in Ux": 1,
        }
    )


def nrg_export(counts: list[int], directions: list[float]) -> str:
    names = "Timestamp Ch12_Samples_Deg Ch13_Samples_hPa Ch14_Samples_deg_C Ch101_Samples_m/s "
    names += "Ch102_Samples_deg Ch401_Samples_m/s Ch402_Samples_m/s Ch403_Samples_m/s "
    names += "Ch404_Samples_m/s"
    lines = ["NRG Systems Data Logger", "Time Zone:\t-5", "", "Data", "\t".join(names.split())]
    for second, (count, direction) in enumerate(zip(counts, directions, strict=True)):
        speed = 0.0935 * count + 0.139
        cells = [f"2024-01-11T13:00:{second:02d}Z", f"{direction:.4f}", "993.5", "0.5", "2.0"]
        cells += ["270.0", f"{speed:.4f}", "1.1150", "0.3500", f"{0.098 * count:.4f}"]
        lines.append("\t".join(cells))
    return "\n".join(lines) + "\n"


def test_logger_speeds_become_the_pulses_they_were(tmp_path: Path) -> None:
    counts, directions = [20, 18, 0, 7], [0.0, 90.0, 180.0, 350.0]
    result, recording = imported(tmp_path, nrg_export(counts, directions), "nrg_roof_1hz")
    assert not result.faults
    turns = recording.pulses["s1"].turns
    assert turns is not None
    assert np.allclose(np.diff(turns) * 10, counts[1:])
    slow = recording.pulses["c40"].turns
    assert slow is not None and not slow.any()
    headings = np.degrees(recording.angles["vane"].angle)
    assert np.allclose(headings, [90.0, 0.0, -90.0, 100.0])
    assert recording.reference is not None
    assert np.allclose(recording.reference.velocity, [2.0, 0.0, 0.0], atol=1e-12)
    wrong = nrg_export(counts, directions).replace("0.3500", "0.7000")
    file = tmp_path / "wrong.dat"
    file.write_text(wrong)
    result = import_files([file], load_mapping("nrg_roof_1hz"))
    assert result.faults["values of Ch403_Samples_m/s that are no whole number of pulses"] == 4


MAST_NAMES = """\
Timestamp Spd80mN Spd80mS Spd60mN Spd60mS Spd40mN Spd40mS Spd80mNStd Spd80mSStd
Spd60mNStd Spd60mSStd Spd40mNStd Spd40mSStd Spd80mNMax Spd80mSMax Spd60mNMax Spd60mSMax Spd40mNMax
Spd40mSMax Dir78mS Dir78mSStd Dir58mS Dir58mSStd Dir38mS Dir38mSStd T2m RH2m P2m"""


def test_means_keep_their_averaging_time_and_get_the_end_of_their_interval(tmp_path: Path) -> None:
    names = MAST_NAMES.split()
    rows = [f"2016-01-09 15:{minute}:00" + ",8.0" * (len(names) - 1) for minute in (30, 40)]
    text = "\ufeff" + ",".join(names) + "\n" + "\n".join(rows) + "\n"
    _, recording = imported(tmp_path, text, "mast_10min", "mast.csv.gz")
    assert recording.station.recording.averaging_time == 600.0
    assert recording.start == nanoseconds("2016-01-09T15:40")
    deviation = read_series(tmp_path / "recording", "/cup_80_north/speed_deviation")
    assert deviation.value.tolist() == [8.0, 8.0]
    assert np.allclose(np.degrees(recording.angles["vane_78"].angle), 82.0)
    cup = recording.station.instrument("cup_80_north")
    assert isinstance(cup, Cup)
    turns = recording.pulses["cup_80_north"].turns
    assert turns is not None
    run = turns[-1] * 2.0 * np.pi * cup.calibration_distance
    assert run / 600.0 + 0.35 == pytest.approx(8.0)


STATION = """
station:
  instruments:
  - {name: vane, kind: vane, joint_states: /v, distance_constant: 1, damping_ratio: 0.4}
"""


@pytest.mark.parametrize(
    ("zone", "stamp", "utc"),
    [
        ("UTC", "2024-07-01 12:00:00", "2024-07-01T12:00"),
        ("+05:30", "2024-07-01 12:00:00", "2024-07-01T06:30"),
        ("-08:00", "2024-07-01 20:00:00", "2024-07-02T04:00"),
        ("Europe/Berlin", "2024-07-01 12:00:00", "2024-07-01T10:00"),
        ("Europe/Berlin", "2024-01-01 12:00:00", "2024-01-01T11:00"),
    ],
)
def test_time_zones(tmp_path: Path, zone: str, stamp: str, utc: str) -> None:
    signal = "{column: d, direction: from_north, topic: /v, type: sensor_msgs/msg/JointState}"
    mapping = f"format: csv\ntime: {{column: t, zone: {zone}}}\nsignals:\n- {signal}{STATION}"
    (tmp_path / "map.yaml").write_text(mapping)
    _, recording = imported(tmp_path, f"t,d\n{stamp},45\n", str(tmp_path / "map.yaml"))
    assert recording.start == nanoseconds(utc)


def test_times_in_a_stated_format(tmp_path: Path) -> None:
    signal = "{column: d, unit: deg, topic: /v, type: sensor_msgs/msg/JointState}"
    mapping = "format: csv\ndelimiter: ';'\ntime: {column: t, format: '%d.%m.%Y %H:%M:%S.%f'}\n"
    (tmp_path / "map.yaml").write_text(f"{mapping}signals:\n- {signal}{STATION}")
    text = "t;d\n09.01.2016 15:30:00.25;45\nnonsense;3\n"
    result, recording = imported(tmp_path, text, str(tmp_path / "map.yaml"))
    assert recording.start == nanoseconds("2016-01-09T15:30:00.25")
    assert result.faults["lines without a readable time"] == 1


def test_mapping_faults_name_the_line() -> None:
    text = "format: csv\nsignals:\n- {column: a, unit: furlong, topic: /a}\n- {topic: /b}\n"
    with pytest.raises(UserError) as caught:
        read_mapping(text + STATION, "map.yaml")
    message = str(caught.value)
    assert "map.yaml:3" in message and "furlong" in message
    assert "map.yaml:4" in message and "column" in message
    with pytest.raises(UserError, match=r"map\.yaml:5"):
        read_mapping("format: csv\n" + STATION.replace("vane, kind", "vane, kid"), "map.yaml")
    with pytest.raises(UserError, match="no `station`"):
        read_mapping("format: csv\n", "map.yaml")


def test_a_missing_column_lists_the_columns(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"'Ux'.*TIMESTAMP, RECORD, Vx"):
        imported(tmp_path, TOA5.replace('"Ux"', '"Vx"'), "toa5_sonic")


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="*$!")))
def test_checksums_detect_any_changed_character(body: str) -> None:
    line = nmea.with_checksum("IIMWV," + body)
    assert not isinstance(nmea.read_sentence(line), str)
    broken = line[:7] + chr(ord(line[7]) ^ 1) + line[8:]
    assert isinstance(nmea.read_sentence(broken), str)


def test_known_sentences_have_the_checksums_that_instruments_gave_them() -> None:
    for line in ("$IIMWV,168,R,03.5,N,A*1A", "$IIHDG,062,,,,*53", "$IIVHW,,,062,M,00.0,N,,*60"):
        assert not isinstance(nmea.read_sentence(line), str)
        assert nmea.with_checksum(line[1:].split("*", maxsplit=1)[0]) == line


def yacht_log(headings: list[float], wind_from: float, wind_speed: float, boat: float) -> str:
    """A boat that sails each heading [deg true and magnetic] for ten seconds in a steady wind."""
    bodies: list[str] = ["IIHDG,010,,,,"]
    for second in range(10 * len(headings)):
        heading = headings[second // 10]
        wind = -wind_speed * np.exp(1j * np.radians(90.0 - wind_from))
        motion = boat * np.exp(1j * np.radians(90.0 - heading))
        apparent = wind - motion
        bow = np.degrees(np.angle(-apparent * np.exp(-1j * np.radians(90.0 - heading))))
        angle, knots = -bow % 360.0, abs(apparent) * 3600.0 / 1852.0
        clock = f"2359{50 + second:02d}" if second < 10 else f"0000{second - 10:02d}"
        date = "310813" if second < 10 else "010913"
        speed = boat * 3600.0 / 1852.0
        position = f"5450.{267 + second:03d},N,00931.381,E"
        bodies += [
            f"IIRMC,{clock},A,{position},{speed:06.3f},{heading:05.1f},{date},,,A",
            f"IIHDG,{heading:05.1f},,,,",
            f"IIMWV,{angle:06.2f},R,{knots:06.3f},N,A",
            f"IIMWV,{angle:06.2f},T,99.9,N,A",
            f"GPMWV,{angle:06.2f},R,55.5,N,A",
            f"IIMWV,{angle:06.2f},R,{knots:06.3f},N,V",
        ]
    lines = [nmea.with_checksum(body) for body in bodies]
    lines[10] = lines[10].replace("IIMWV", "IIMWW")
    return "\r\n".join([*lines, "garbage", "$IIMWV,1,R*", ""])


def test_a_yacht_log_gives_back_the_wind_it_sailed_in(tmp_path: Path) -> None:
    log = yacht_log([0.0, 90.0, 200.0], wind_from=300.0, wind_speed=8.0, boat=3.0)
    result, recording = imported(tmp_path, log, "nmea_yacht")
    assert recording.platform is not None
    first = nanoseconds("2013-08-31T23:59:50")
    assert recording.platform.time[0] == first
    assert recording.platform.time[-1] == first + 29_000_000_000, "midnight passes"
    assert result.faults["sentences before the first fix"] == 1
    assert result.faults["sentences of talker GP"] == 30
    assert result.faults["sentences whose checksum fails"] == 1
    assert result.faults["lines that are no sentence"] == 1
    platform = recording.platform
    yaw = 2.0 * np.arctan2(platform.attitude[:, 2], platform.attitude[:, 3])
    velocity = platform.velocity[:, 0] + 1j * platform.velocity[:, 1]
    assert np.allclose(velocity, 3.0 * np.exp(1j * yaw), atol=0.01), "it sails where it heads"
    assert np.allclose(np.diff(platform.position[:, 1]), 1852.0 * 0.001, rtol=0.01)
    vane = recording.angles["vane"]
    speed = read_series(tmp_path / "recording", "/masthead/speed")
    assert np.array_equal(speed.time, vane.time)
    steady = np.asarray([0, 1, 2, 3, 4, 5, 6, 10, 11, 12, 13, 14, 15, 16, 20, 21, 22, 23, 24, 25])
    for time, angle, magnitude in zip(vane.time, vane.angle, speed.value, strict=True):
        at = int(np.searchsorted(platform.time, time, side="right")) - 1
        if at not in steady:
            continue
        apparent = -magnitude * np.exp(1j * (angle + yaw[at]))
        wind = apparent + velocity[at]
        blows_from = (90.0 - np.degrees(np.angle(-wind))) % 360.0
        assert abs(wind) == pytest.approx(8.0, abs=0.02)
        assert blows_from == pytest.approx(300.0, abs=0.2)


def test_sentences_between_fixes_are_spread_and_gaps_are_not_filled() -> None:
    def fix(clock: str) -> str:
        return nmea.with_checksum(f"IIRMC,{clock},A,5450.0,N,00931.0,E,0,0,030813,,,A")

    other = nmea.with_checksum("IIHDG,10,,,,")
    log = nmea.read_log([fix("100000"), other, other, other, fix("100001"), other, fix("101000")])
    seconds = (log.time - log.time[0]) * 1e-9
    assert np.allclose(seconds, [0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 600.0])


def test_nothing_that_fits_is_an_error_with_the_reasons(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="2 lines that are no sentence"):
        imported(tmp_path, "hello\nworld\n", "nmea_yacht")


def test_the_command_reports_and_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "x.dat"
    file.write_text(TOA5)
    command = ["import", str(file), "--mapping", "toa5_sonic", "-o", str(tmp_path / "r")]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "/reference/wind: 2 messages" in told
    assert "left out: 1 lines without a readable time" in told
    assert main(command) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*command, "--force"]) == 0
    assert main(["import", str(file), "--mapping", "nothing", "-o", "x"]) == 2
    assert "nmea_yacht" in capsys.readouterr().err


@pytest.mark.skipif(not REAL.exists(), reason="shared material absent")
@pytest.mark.parametrize(
    ("folder", "mapping"),
    [("sonic_20hz", "toa5_sonic"), ("roof_1hz", "nrg_roof_1hz"), ("yacht_nmea", "nmea_yacht")],
)
def test_published_files_import(tmp_path: Path, folder: str, mapping: str) -> None:
    mapping_file = load_mapping(mapping)
    files = sorted((REAL / folder).glob("*.gz"))
    if folder == "yacht_nmea":
        files = files[-1:]
    result = import_files(files, mapping_file)
    recording = read_recording(write_imported(tmp_path / "r", result, mapping_file))
    if folder == "sonic_20hz":
        assert recording.reference is not None
        assert len(recording.reference.time) == 36_000
        assert not result.faults
    elif folder == "roof_1hz":
        assert not result.faults, "every speed is a whole number of pulses"
        assert {len(p.time) for p in recording.pulses.values()} == {2485}
    else:
        assert recording.platform is not None
        assert len(recording.platform.time) > 6000
        assert not any("checksum" in fault for fault in result.faults)
