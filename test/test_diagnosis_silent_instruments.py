"""Instruments that say nothing in a whole recording: no reader may take them for healthy."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.cli.main import main
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.explaining.vane_guesses import vane_guesses
from wind_sensors.diagnosis.healthy.learning import complete, learn
from wind_sensors.diagnosis.json_output import as_json
from wind_sensors.diagnosis.outcome import Outcome, outcome_json, with_silent
from wind_sensors.diagnosis.proving.findings import Unexplained
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.errors import UserError
from wind_sensors.recordings import write_recording
from wind_sensors.report.diagnosis_page import page
from wind_sensors.report.outcome_page import outcome_page
from wind_sensors.station.model import Vane
from wind_sensors.station.signals import Angles, Recording
from wind_sensors.station.silence import FEWEST_READINGS, silent_instruments

NOTE = "/vane/joint_states: no messages (the angle of 'vane')"


def without_vane(seed: int = 58) -> Recording:
    return replace(recorded(STATION, seed), angles={}, notes=(NOTE,))


def with_dead_vane(seed: int = 58) -> Recording:
    whole = recorded(STATION, seed)
    time = whole.angles["vane"].time
    return replace(whole, angles={"vane": Angles(time, np.full(time.size, np.nan))})


def without_pulses(turned: float) -> Recording:
    planted = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": turned})
    return replace(recorded(planted, 58), pulses={})


@lru_cache(maxsize=1)
def of_novane() -> Diagnosis:
    return diagnose(without_vane(), baseline())


def test_few_readings_are_as_good_as_none() -> None:
    whole = recorded(STATION, 58)
    angles = whole.angles["vane"]
    for count, silent in ((FEWEST_READINGS - 1, True), (FEWEST_READINGS, False)):
        few = Angles(angles.time[:count], angles.angle[:count])
        found = silent_instruments(replace(whole, angles={"vane": few}), STATION)
        assert [s.instrument for s in found] == (["vane"] if silent else [])
    assert silent_instruments(whole, STATION) == ()


def test_a_vane_that_says_nothing_is_not_well() -> None:
    found = of_novane()
    assert found.verdict == "unknown"
    (silent,) = found.silent
    assert (silent.instrument, silent.topic) == ("vane", "/vane/joint_states")
    said = "vane: no readings at all on /vane/joint_states, so nothing can be said of it"
    assert said not in found.unexplained.description
    content = as_json(found)
    assert content["silent"][0]["instrument"] == "vane"
    assert said in content["unexplained"]["description"]
    assert content["notes"] == [NOTE]
    text = page(found)
    assert "<h1>Vane says nothing at all</h1>" in text
    assert said in text
    assert "Nothing is wrong" not in text


def test_readings_that_are_not_numbers_are_none() -> None:
    comparison = prepare(with_dead_vane())
    assert [c.name for c in comparison.channels] == ["cup/rotor_rate"]
    assert not any(instrument == "vane" for _, instrument in guesses_of(comparison, STATION))
    found = diagnose(with_dead_vane(), baseline())
    assert found.verdict == "unknown"
    assert [s.instrument for s in found.silent] == ["vane"]


def test_guesses_of_a_vane_without_readings_are_none() -> None:
    comparison = prepare(recorded(STATION, 58))
    (vane,) = (c for c in comparison.channels if c.kind == "vane_angle")
    empty = Angles(np.empty(0, dtype=np.int64), np.empty(0))
    silent = replace(comparison.recording, angles={"vane": empty})
    entry = STATION.instrument("vane")
    assert isinstance(entry, Vane)
    assert vane_guesses(replace(comparison, recording=silent), vane, entry) == []


def test_a_cup_that_says_nothing_is_told_beside_a_name() -> None:
    found = diagnose(without_pulses(turned=6.0), baseline())
    assert found.verdict == "named"
    assert [f.term.effect.name for f in found.findings] == ["vane_offset"]
    assert [s.instrument for s in found.silent] == ["cup"]
    assert "cup: no pulses at all on /cup/pulses" in page(found)
    assert as_json(found)["unexplained"]["description"].startswith("cup: no pulses at all")


@pytest.mark.parametrize("dead", [without_vane, with_dead_vane])
def test_no_baseline_is_learnt_from_what_says_nothing(dead: Callable[[], Recording]) -> None:
    with pytest.raises(UserError, match=r"'vane' has no readings.*not healthy"):
        learn([dead()])
    # Beside recordings in which all speak it is left out.
    whole = recorded(STATION, 57)
    assert complete([whole, dead()]) == [whole]


def test_other_diagnoses_tell_of_what_says_nothing() -> None:
    nothing = Unexplained(1.0, 0.0, (), "")
    well = Outcome("r", "none", True, (), nothing, {}, STATION, 0, 400.0, "latent")
    assert with_silent(well, ()) is well
    told = with_silent(well, silent_instruments(without_vane(), STATION))
    assert told.verdict == "unknown"
    assert told.unexplained.description == ""
    assert outcome_json(told)["unexplained"]["description"] == told.silent[0].words
    assert outcome_json(told)["silent"][0]["instrument"] == "vane"
    assert "<h1>Vane says nothing at all</h1>" in outcome_page(told)
    assert "<b>Silent:</b> vane: no readings at all" in outcome_page(told)
    assert with_silent(replace(well, verdict="named"), told.silent).verdict == "named"


def test_commands_tell_of_what_says_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = str(write_recording(tmp_path / "dead", with_dead_vane()))
    known = tmp_path / "baseline.json"
    known.write_text(baseline().to_json(), encoding="utf-8")
    common = ["--baseline", str(known), "-o"]
    assert main(["compare", folder, *common, str(tmp_path / "compared")]) == 0
    told = capsys.readouterr().out
    (row,) = (line for line in told.splitlines() if "vane/vane_angle" in line)
    assert row.count("no readings") == 2
    content = json.loads((tmp_path / "compared" / "comparison.json").read_text())
    assert [s["instrument"] for s in content["silent"]] == ["vane"]
    assert "no readings" in (tmp_path / "compared" / "comparison.html").read_text()
    assert main(["diagnose", folder, *common, str(tmp_path / "answer")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "silent vane: no readings at all on /vane/joint_states" in told
    assert "are not numbers and were left out" in told
    assert main(["baseline", folder, "-o", str(tmp_path / "learnt.json")]) == 2
    assert not (tmp_path / "learnt.json").exists()
