"""`wind prove` as a user types it."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from proving_ground.__main__ import main as world
from wind_sensors.cli.main import main as wind


def test_a_mistake_is_told_in_one_line_with_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert wind(["prove", "run", str(tmp_path)]) == 2
    assert "not a sealed set" in capsys.readouterr().err
    assert wind(["prove", "open", str(tmp_path), "--key", "abc"]) == 2
    assert "64 hex digits" in capsys.readouterr().err
    assert wind(["prove", "seal", "-o", str(tmp_path / "x"), "--kinds", "AZ"]) == 2
    assert "unknown station kinds" in capsys.readouterr().err
    assert wind(["prove", "demo", "-o", str(tmp_path)]) == 2
    assert "--force" in capsys.readouterr().err


def test_an_effect_that_nobody_knows_cannot_be_taken_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "out"
    assert wind(["diagnose", "nowhere", "-o", str(output), "--without", "gremlins"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "'gremlins'" in said and "wake_shadow" in said and "clock_drift" in said
    assert not output.exists()


def test_sealing_keeps_the_key_apart_and_to_its_owner(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    key = tmp_path / "key"
    folder = tmp_path / "set"
    arguments = ["prove", "seal", "-n", "1", "--healthy", "1", "--kinds", "A"]
    arguments += ["--minutes", "0.3", "--key", str(key), "-o", str(folder)]
    assert wind(arguments) == 0
    printed = capsys.readouterr().out
    secret = key.read_text().strip()
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    assert secret not in printed
    assert all(secret.encode() not in p.read_bytes() for p in folder.rglob("*.*") if p.is_file())
    assert wind(arguments) == 2


def test_the_world_s_own_command_writes_a_recording_and_its_answer_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "one"
    arguments = ["proving_ground", "generate", "--effect", "icing", "--minutes", "0.3"]
    monkeypatch.setattr("sys.argv", [*arguments, "-o", str(target)])
    assert world() == 0
    assert sorted(p.name for p in target.iterdir()) == ["bag", "recording.yaml"]
    assert "icing" in (tmp_path / "one.answer.yaml").read_text()
