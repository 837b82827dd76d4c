"""Healthy recordings of another station, or the diagnosed one itself, are refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.cli.main import main
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.recordings import write_recording
from wind_sensors.station.model import Platform, RecordingInfo, Station
from wind_sensors.station.sameness import first_difference


def with_cup(**keys: object) -> Station:
    cup, *others = STATION.instruments
    return STATION.model_copy(update={"instruments": (cup.model_copy(update=keys), *others)})


def test_what_a_station_is_made_of_tells_it_from_others() -> None:
    assert first_difference(STATION, STATION) == ""
    assert first_difference(with_cup(distance_constant=9.0), STATION).startswith(
        "cup.distance_constant is 9.0 there and "
    )
    assert "another_cup" in first_difference(with_cup(name="another_cup"), STATION)
    carried = STATION.model_copy(update={"platform": Platform()})
    assert "platform" in first_difference(STATION, carried)
    means = STATION.model_copy(update={"recording": RecordingInfo(averaging_time=600.0)})
    assert "0 s there and 600 s here" in first_difference(STATION, means)


def test_when_it_was_recorded_and_what_is_wrong_do_not_make_another_station() -> None:
    info = RecordingInfo(start="2031-01-01T00:00:00Z")
    assert first_difference(STATION.model_copy(update={"recording": info}), STATION) == ""
    for effect in catalogue().values():
        values = {p.name: 0.6 * p.low + 0.4 * p.high for p in effect.parameters}
        for entry in STATION.instruments:
            if effect.applies(entry, STATION):
                wrong = with_effect(STATION, effect, entry.name, values)
                assert first_difference(wrong, STATION) == "", effect.name


@pytest.mark.parametrize("command", ["diagnose", "compare"])
def test_commands_refuse_what_cannot_be_healthy(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    judged = write_recording(tmp_path / "judged", recorded(STATION, 1, seconds=60.0))
    other = with_cup(pulses_per_revolution=7)
    healthy = write_recording(
        tmp_path / "other", recorded(STATION, 2, described=other, seconds=60.0)
    )
    common = [command, str(judged), "-o", str(tmp_path / "answer")]
    assert main([*common, "--healthy", str(healthy)]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "not the station that is to be judged: cup.pulses_per_revolution" in told
    assert main([*common, "--healthy", str(judged / "bag")]) == 2
    assert "it is the recording that is to be judged" in " ".join(capsys.readouterr().err.split())
    known = tmp_path / "baseline.json"
    known.write_text(baseline().to_json(), encoding="utf-8")
    arguments = [command, str(healthy), "-o", str(tmp_path / "answer"), "--baseline", str(known)]
    assert main(arguments) == 2
    assert "cup.pulses_per_revolution is 7 there" in " ".join(capsys.readouterr().err.split())


def test_no_recording_counts_twice_in_a_baseline(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_recording(tmp_path / "healthy", recorded(STATION, 1, seconds=60.0))
    arguments = ["baseline", str(folder), str(folder / "bag"), "-o", str(tmp_path / "b.json")]
    assert main(arguments) == 2
    assert "it is named twice" in " ".join(capsys.readouterr().err.split())
