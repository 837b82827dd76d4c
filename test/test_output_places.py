"""Results that cannot be written are refused in words, before anything is computed."""

from __future__ import annotations

from pathlib import Path

import pytest

from wind_sensors.cli import baseline, compare, diagnose, plot
from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.recordings.places import check_writable, refused_in_words


@pytest.fixture
def no_folder(tmp_path: Path) -> Path:
    """A place that nobody can write to, whoever runs this."""
    (tmp_path / "file").write_text("precious")
    return tmp_path / "file" / "answer"


@pytest.mark.parametrize(
    ("command", "module"),
    [("diagnose", diagnose), ("compare", compare), ("baseline", baseline), ("plot", plot)],
)
def test_a_place_that_cannot_be_written_is_refused_before_the_recording_is_read(
    command: str,
    module: object,
    no_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def computed(*_: object) -> None:
        pytest.fail("the place was not tried first")

    monkeypatch.setattr(module, "read_recording", computed)
    where = no_folder / "b.json" if command == "baseline" else no_folder
    assert main([command, "recording", "-o", str(where)]) == 2
    told = capsys.readouterr().err
    assert "cannot be written (Not a directory)" in told
    assert "Choose another place with -o." in told


def test_a_folder_is_no_place_for_a_baseline(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["baseline", "recording", "-o", str(tmp_path), "--force"]) == 2
    assert "this is a folder" in capsys.readouterr().err


def test_trying_a_place_leaves_nothing_behind(tmp_path: Path) -> None:
    check_writable(tmp_path / "some" / "where")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "kept").mkdir()
    check_writable(tmp_path / "kept")
    assert (tmp_path / "kept").is_dir()


def test_what_fails_while_it_is_written_is_told_in_words(tmp_path: Path) -> None:
    place = tmp_path / "full"
    with (
        pytest.raises(UserError, match=r"full: the figure cannot be written \(No space left"),
        refused_in_words(place, "figure"),
    ):
        raise OSError(28, "No space left on device")
