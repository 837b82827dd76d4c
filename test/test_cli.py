"""The front door, `wind info` and `wind plot`."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wind_sensors.cli import main as front
from wind_sensors.cli import monte_carlo
from wind_sensors.cli.info import duration
from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.recordings import read_recording, write_recording
from wind_sensors.recordings.writing import keep_inputs
from wind_sensors.report import plots
from wind_sensors.station.model import Air, Cup, Input, Propeller, Reference, Station, Vane
from wind_sensors.station.signals import Angles, Pulses, Recording, Series, Winds

START = 1_767_225_600_000_000_000
SLOTS = (0.02, -0.01, 0.0, -0.01)


def steady_recording(speed: float = 8.0, seconds: float = 120.0) -> Recording:
    """A cup with uneven slots in a wind that oscillates slowly around a mean."""
    cup = Cup(
        name="cup",
        pulses=Input(topic="/cup/pulses"),
        pulses_per_revolution=4,
        calibration_distance=0.2,
        distance_constant=1.7,
        starting_speed=0.25,
    )
    vane = Vane(
        name="vane", joint_states=Input(topic="/vane"), distance_constant=0.5, damping_ratio=0.4
    )
    station = Station(
        instruments=(cup, vane), reference=Reference(topic=Input(topic="/reference/wind"))
    )
    rate = (speed - cup.starting_speed) / cup.calibration_distance / (2.0 * np.pi)
    slots = np.arange(int(seconds * rate * 4))
    edges = (slots + np.cumsum([0.0, *SLOTS[:-1]])[slots % 4]) / 4.0 / rate
    time = START + np.rint(edges * 1e9).astype(np.int64)
    grid = START + np.arange(int(seconds * 20), dtype=np.int64) * 50_000_000
    wave = np.sin(2.0 * np.pi * np.arange(len(grid)) / 400.0)
    wind = np.stack([speed + wave, 0.5 * wave, 0.0 * wave], axis=1)
    return Recording(
        "steady", station, START, int(grid[-1]),
        {"cup": Pulses(time)},
        {"vane": Angles(grid, np.pi + 0.1 * wave)},
        Winds(grid, wind),
    )


def test_help_lists_what_is_installed_and_starts_at_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["--help"])
    assert stopped.value.code == 0
    told = capsys.readouterr().out
    for command in ("info", "plot", "import"):
        assert f"  {command}" in told
    assert main([]) == 0
    code = "import sys, wind_sensors.cli.main as m\n"
    code += "try: m.main(['--help'])\nexcept SystemExit: pass\n"
    code += "sys.exit(any(name in sys.modules for name in ('numpy', 'numba', 'matplotlib')))"
    asked = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert asked.returncode == 0, "help must not load the numerical libraries"


def test_a_command_that_is_not_there_is_not_listed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(front.COMMANDS, "levitate", "not yet")
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "levitate" not in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        main(["levitate"])
    assert stopped.value.code == 2


def test_bad_input_is_a_message_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["info", str(tmp_path / "nothing")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("wind info: ") and "Traceback" not in told
    assert main(["info"]) == 2


def test_an_interrupt_while_a_command_loads_is_no_traceback(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(front, "import_module", interrupted)
    assert main(["info", "mast_cup_vane"]) == 130


def test_a_reader_that_has_read_enough_is_no_failure() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "wind_sensors.cli", "info", "mast_cup_vane"]
    asked = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (asked.returncode, asked.stderr) == (0, b"")


@pytest.mark.parametrize(
    "arguments",
    [
        ("process", "{r}", "-o", "{r}"),
        ("process", "{r}", "-o", "{r}/bag"),
        ("process", "{r}", "-o", "{r}/corrected"),
        ("process", "{r}", "-o", "{link}"),
        ("process", "{r}/bag", "--station", "{station}", "-o", "{r}"),
        ("process", "{r}", "--station", "{other}/recording.yaml", "-o", "{other}"),
        ("simulate", "{station}", "--wind", "{r}", "-o", "{r}"),
        ("simulate", "{station}", "--follow", "{r}/bag", "-o", "{r}"),
        ("simulate", "{r}/recording.yaml", "-o", "{r}"),
        ("import", "{r}/bag/metadata.yaml", "--mapping", "nmea_yacht", "-o", "{r}"),
        ("diagnose", "{r}", "--station", "{tmp}/station_corrected.yaml", "-o", "{tmp}"),
        ("compare", "{tmp}/residuals", "-o", "{tmp}"),
    ],
    ids=" ".join,
)
def test_force_never_removes_what_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
) -> None:
    recording = steady_recording(seconds=5.0)
    folder = write_recording(tmp_path / "steady", recording)
    other = write_recording(tmp_path / "other", recording)
    write_recording(tmp_path / "residuals", recording)
    for name in ("station.yaml", "station_corrected.yaml"):
        shutil.copy(folder / "recording.yaml", tmp_path / name)
    (tmp_path / "link").symlink_to(folder)
    names = {
        "r": folder, "other": other, "tmp": tmp_path, "link": tmp_path / "link",
        "station": tmp_path / "station.yaml",
    }
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    assert main([*(text.format(**names) for text in arguments), "--force"]) == 2
    assert "Name another folder with -o." in capsys.readouterr().err
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("name", ["steady_wind", "nested/wind", "ste"])
def test_a_result_may_replace_what_is_not_read(tmp_path: Path, name: str) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording(seconds=5.0))
    read = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    inputs = (folder, folder / "bag", "mast_cup_vane", None)
    keep_inputs(tmp_path / name, inputs)
    with pytest.raises(UserError, match="Name another folder"):
        keep_inputs(folder / name, inputs)
    earlier = write_recording(tmp_path / name, steady_recording(seconds=3.0))
    replaced = read_recording(earlier).stop
    assert main(["process", str(folder), "-o", str(earlier), "--force"]) == 0
    assert read_recording(earlier).stop == read_recording(folder).stop > replaced
    assert {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()} == read


OWN_TYPE = "lake_msgs/msg/Level"


def with_others(folder: Path, *, of_a_type_of_its_own: bool) -> dict[str, list[tuple[int, bytes]]]:
    """Add what a robot records besides to the bag of a recording; returns it by topic."""
    defined = get_typestore(Stores.ROS2_JAZZY)
    defined.register(get_types_from_msg("float64 metres\nstring gauge", OWN_TYPE))
    level = defined.types[OWN_TYPE](metres=1.5, gauge="harbour")
    text = defined.types["std_msgs/msg/String"](data="hello")
    raw = {
        "/talk": ("std_msgs/msg/String", bytes(defined.serialize_cdr(text, "std_msgs/msg/String")))
    }
    if of_a_type_of_its_own:
        raw["/level"] = (OWN_TYPE, bytes(defined.serialize_cdr(level, OWN_TYPE)))
    added: dict[str, list[tuple[int, bytes]]] = {name: [] for name in raw}
    (folder / "bag").rename(folder / "before")
    with Reader(folder / "before") as reader, Writer(folder / "bag", version=9) as writer:
        made = {
            c.id: writer.add_connection(c.topic, c.msgtype, typestore=defined)
            for c in reader.connections
        }
        for connection, time, message in reader.messages():
            writer.write(made[connection.id], time, message)
        for name, (message_type, message) in raw.items():
            connection = writer.add_connection(name, message_type, typestore=defined)
            for k in range(3):
                added[name].append((START + k * 1_500_000_000, message))
                writer.write(connection, *added[name][-1])
    shutil.rmtree(folder / "before")
    return added


def messages_of(bag: Path, topic: str) -> list[tuple[int, bytes]]:
    with Reader(bag) as reader:
        chosen = [c for c in reader.connections if c.topic == topic]
        assert chosen
        return [(time, bytes(raw)) for _, time, raw in reader.messages(connections=chosen)]


@pytest.mark.parametrize("damaged", [False, True])
def test_process_keeps_what_is_not_the_stations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], damaged: bool
) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording(seconds=10.0))
    added = with_others(folder, of_a_type_of_its_own=not damaged)
    if damaged:
        (folder / "bag" / "metadata.yaml").unlink()
    naive = ["--method", "naive", "--window", "5"]
    assert main(["process", str(folder), "-o", str(tmp_path / "wind"), *naive]) == 0
    assert "not copied" not in capsys.readouterr().out
    for name, messages in added.items():
        assert messages_of(tmp_path / "wind" / "bag", name) == messages
    with Reader(tmp_path / "wind" / "bag") as reader:
        times = [time for _, time, _ in reader.messages()]
        assert times == sorted(times)
        definitions = {c.msgtype: c.msgdef.data for c in reader.connections}
    assert damaged or "string gauge" in definitions[OWN_TYPE]
    again = ["process", str(tmp_path / "wind"), "-o", str(tmp_path / "again"), *naive]
    assert main(again) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "this estimate's own topics take their place: /diagnostics, /wind, /wind/ap" in told
    assert "/talk" not in told
    assert messages_of(tmp_path / "again" / "bag", "/talk") == added["/talk"]


def test_process_keeps_the_messages_of_a_signal_that_it_cannot_use(tmp_path: Path) -> None:
    kelvin = steady_recording(seconds=10.0)
    air = Air(temperature=Input(topic="/air/temperature"))
    time = START + np.arange(10, dtype=np.int64) * 1_000_000_000
    kelvin = replace(
        kelvin,
        station=kelvin.station.model_copy(update={"air": air}),
        temperature=Series(time, np.full(10, 288.15)),
    )
    folder = write_recording(tmp_path / "kelvin", kelvin)
    process = ["process", str(folder), "-o", str(tmp_path / "wind"), "--method", "naive"]
    assert main(process) == 0
    topic = "/air/temperature"
    assert messages_of(tmp_path / "wind" / "bag", topic) == messages_of(folder / "bag", topic)


@pytest.mark.parametrize(
    ("option", "value", "limit"),
    [
        ("--duration", "1e9h", "at most 168h"),
        ("--speed", "1e9", "at most 100 m/s"),
        ("--speed", "0", "at least 0.01"),
        ("--temperature", "-400", "least -90 and at most 60 deg C"),
        ("--temperature", "1e5", "least -90 and at most 60 deg C"),
        ("--temperature-amplitude", "nan", "40 K"),
        ("--pressure", "1013", "least 10000 and at most 120000 Pa"),
        ("--stability", "1e6", "least -5 and at most 2,"),
        ("--integral-length", "inf", "10000 m"),
        ("--slow-amplitude", "1e3", "50 m/s"),
        ("--turn-amplitude", "1e3", "180 deg"),
        ("--direction-from", "nan", "360 deg"),
        ("--course", "inf", "360 deg"),
        ("--platform-speed", "-1", "100 m/s"),
        ("--rate", "1e6", "1000 per second"),
    ],
)
def test_a_simulation_stays_on_earth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, value: str, limit: str
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["simulate", "mast_cup_vane", "-o", str(tmp_path / "s"), f"{option}={value}"])
    assert stopped.value.code == 2
    told = " ".join(capsys.readouterr().err.split())
    assert f"argument {option}: " in told and limit in told and f"not {value}" in told.replace(
        "'", ""
    )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("simulate {s} --stability 0.5", "--stability: this has no effect without --surface-layer"),
        ("simulate {s} --surface-layer --intensity 0.2", "--intensity: this has no effect beside"),
        ("simulate {s} --course 3", "--course: this has no effect without --carrier."),
        ("simulate {s} --exact-platform", "no effect on a station without a platform."),
        ("simulate {s} --slow-period 5min", "without --slow-amplitude or --turn-amplitude or"),
        ("simulate {s} --wind {r} --speed 12", "--speed: this has no effect beside --wind."),
        ("simulate {s} --wind {r} --duration 1h", "lasts only 30 s. Leave it out"),
        ("process {r} --bandwidth 3", "--bandwidth: this has no effect without --method inverse."),
    ],
)
def test_an_option_without_effect_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: str, told: str
) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording(seconds=30.0))
    command = arguments.format(s="mast_cup_vane", r=folder).split()
    assert main([*command, "-o", str(tmp_path / "out")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_measured_wind_blows_as_long_as_it_lasts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording(seconds=30.0))
    command = ["simulate", "mast_cup_vane", "--wind", str(folder), "-o", str(tmp_path / "out")]
    assert main(command) == 0
    assert "simulated 30 s" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("process r -o o --window 10", ""),
        ("process r -o o --window 10min", ""),
        ("process r -o o --window 10furlongs", "argument --window: '10furlongs' is not a duration"),
        ("demo --duration soon", "argument --duration: 'soon' is not a duration"),
        ("simulate s -o o --jitter 50", "argument --jitter: '50' has no unit: write 50ms or 50s."),
    ],
)
def test_durations_are_told_the_same_way_everywhere(
    capsys: pytest.CaptureFixture[str], arguments: str, told: str
) -> None:
    if told:
        with pytest.raises(SystemExit):
            main(arguments.split())
    else:
        assert main(arguments.split()) == 2, "there is no such recording"
    error = capsys.readouterr().err.strip()
    assert told in error and "usage:" not in error and len(error.splitlines()) == 1


def test_a_simulation_fits_the_memory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = ["simulate", "mast_cup_vane", "-o", str(tmp_path / "s"), "--duration", "100h"]
    assert main([*long, "--rate", "20"]) == 2
    told = capsys.readouterr().err
    assert "7.2e+06 samples" in told and "at most 55.6h at this rate" in told


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("monte-carlo", "--pairs", "0"), "--pairs: 0 is too few. Give at least 2;"),
        (("monte-carlo", "--seed", "-1"), "--seed: The seed must not be negative. Use"),
        (("process", "{s}", "-o", "{tmp}/new"), "this is a YAML file and no recording. Give a"),
        (("process", "{r}", "--station", "{r}", "-o", "{tmp}/new"), "this is a folder. Name the"),
        (
            ("process", "{r}", "--station", "{tmp}/misspelt", "-o", "{tmp}/new"),
            "no such topic is in the bag: did you mean /cup/pulses?",
        ),
        (("info", "{tmp}/twins.yaml"), "twins.yaml:3: instruments[1].name: two instruments are"),
        (("info", "{tmp}/none.yaml"), "none.yaml:1: instruments: the list is empty. Add at least"),
        (("info", "{tmp}/latin.yaml"), "the station file is not a text in UTF-8. Save it as"),
        (("figures", "k94-99", "-o", "{tmp}"), "there is no figure 'k94-99'. Known: "),
        (("figures", "k94-2", "-o", "{tmp}/file"), "file: this is a file, not a folder. Choose"),
        (("figures", "k94-2", "-o", "{tmp}/file/x"), "x: the result cannot be written (Not a dir"),
        (("plot", "{r}", "-o", "{tmp}/file/x"), "x: the result cannot be written (Not a dir"),
        (
            ("process", "{r}", "-o", "{tmp}/new", "--output-rate", "0"),
            "--output-rate: 0 is out of range. Give a value from 0.1 to 200.",
        ),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_refusals_are_whole_sentences_about_what_was_typed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], told: str
) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording(seconds=5.0))
    (tmp_path / "file").write_text("no folder")
    own = (folder / "recording.yaml").read_text(encoding="utf-8")
    (tmp_path / "misspelt").write_text(own.replace("/cup/pulses", "/cup/puls"))
    vane = "- {name: v, kind: vane, joint_states: /v, distance_constant: 1.0, damping_ratio: 0.3}\n"
    (tmp_path / "twins.yaml").write_text(f"instruments:\n{vane}{vane}")
    (tmp_path / "none.yaml").write_text("instruments: []\n")
    (tmp_path / "latin.yaml").write_bytes(b"# K\xe4lte\n")
    names = {"r": folder, "tmp": tmp_path, "s": folder / "recording.yaml"}
    assert main([text.format(**names) for text in arguments]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize("setting", ["PYTHONIOENCODING=ascii", "LC_ALL=C"])
def test_a_name_that_the_locale_lacks_is_no_traceback(tmp_path: Path, setting: str) -> None:
    folder = write_recording(tmp_path / "März", steady_recording(seconds=20.0))
    key, value = setting.split("=")
    environment = {**os.environ, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", key: value}
    out = tmp_path / "Wind"
    command = [sys.executable, "-m", "wind_sensors.cli", "process", str(folder), "-o", str(out)]
    done = subprocess.run(
        [*command, "--method", "naive"], env=environment, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert b"rz, naive" in done.stdout and b"+-" in done.stdout
    assert read_recording(folder).name == "März"


def test_a_table_that_cannot_be_written_is_no_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(monte_carlo, "run_monte_carlo", lambda *_, **__: [])
    (tmp_path / "file").write_text("no folder")
    assert main(["monte-carlo", "-o", str(tmp_path / "file" / "table.md")]) == 2
    assert "table.md: the result cannot be written (" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [
        ("--rate", "0", "--rate: this must be at least 0.01, not 0. It means: Simulated"),
        ("--mean-speed", "1e9", "--mean-speed: this must be at most 100, not 1e+09."),
        ("--method", "magic", "--method: this is one of "),
    ],
)
def test_compose_names_the_option(
    capsys: pytest.CaptureFixture[str], option: str, value: str, told: str
) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    assert main(["compose", "mast_cup_vane", option, value]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("record --all -o new --duration nan", "--duration: a duration must be positive, not"),
        ("record --all -o new --duration -5", "--duration: a duration must be positive, not '-5'"),
        ("replay nowhere --rate inf", "--rate: give a positive number, not 'inf'"),
        ("replay nowhere --rate 0", "--rate: give a positive number, not '0'"),
        ("replay nowhere --wait-for -3", "--wait-for: give a whole number from 0, not '-3'"),
    ],
)
def test_numbers_that_mean_nothing_are_refused(
    capsys: pytest.CaptureFixture[str], arguments: str, told: str
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(arguments.split())
    assert told in capsys.readouterr().err


def test_info_shows_topics_rates_station_and_notes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = steady_recording()
    folder = write_recording(tmp_path / "steady", recording)
    assert main(["info", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "2026-01-01T00:00:00.000Z" in told
    assert f"{len(recording.pulses['cup'].time)}" in told
    assert "20 Hz" in told and "0.05 s" in told
    assert duration(1.7e6) == "19 d 16 h" and duration(600.0) == "10 min"
    assert "0.2 m/rad" in told and "reading had nothing to note" in told
    (folder / "bag" / "metadata.yaml").unlink()
    assert main(["info", str(folder)]) == 0
    assert "metadata.yaml" in capsys.readouterr().out
    text = (folder / "recording.yaml").read_text(encoding="utf-8")
    corrected = tmp_path / "station_corrected.yaml"
    corrected.write_text(text.replace("distance_constant: 1.7", "distance_constant: 1.7\n"
                                      "  friction_speed: 2.15"), encoding="utf-8")
    assert main(["info", str(corrected)]) == 0
    assert "friction_speed 2.15, starting_speed 0.25" in capsys.readouterr().out
    assert main(["info", "mast_cup_vane"]) == 0
    assert "risoe_cup" in capsys.readouterr().out
    assert main(["info", "--profiles"]) == 0
    assert "mitsuta_bivane" in capsys.readouterr().out


def test_info_finds_the_signals_of_topics_that_are_named_without_a_slash(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = steady_recording()
    cup, *others = recording.station.instruments
    assert isinstance(cup, Cup)
    # Batches: how often one comes is not how often the cup tells an edge.
    batches = Input(topic="/cup/edges", type="std_msgs/msg/Int64MultiArray")
    instruments = (cup.model_copy(update={"pulses": batches}), *others)
    station = recording.station.model_copy(update={"instruments": instruments})
    folder = write_recording(tmp_path / "batches", replace(recording, station=station))
    told = []
    for text in ("/cup/edges", "cup/edges"):
        file = folder / "recording.yaml"
        file.write_text(file.read_text("utf-8").replace("/cup/edges", text), encoding="utf-8")
        assert main(["info", str(folder)]) == 0
        told.append(capsys.readouterr().out)
    assert told[0] == told[1]


def test_info_tells_long_intervals_as_people_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_recording(tmp_path / "mast", mast_of_means())
    assert main(["info", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "every 10 min" in told and "20 d 20 h" in told
    assert "e+06" not in told and "unusual" not in told


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_plot_draws_every_figure_and_keeps_what_is_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording())
    command = ["plot", str(folder), "-o", str(tmp_path / "figures"), "--format", kind]
    assert main(command) == 0
    drawn = {path.stem for path in (tmp_path / "figures").glob(f"*.{kind}")}
    assert drawn == set(plots.FIGURES)
    assert all(path.stat().st_size > 5000 for path in (tmp_path / "figures").iterdir())
    assert main(command) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*command, "--force", "--only", "speed"]) == 0


def test_the_detail_of_a_figure_holds_samples_whatever_their_distance() -> None:
    quick = steady_recording()
    figure = plots.draw("speed", quick, None)
    assert figure is not None
    assert figure.axes[1].get_title(loc="left") == "a minute of it"
    time = START + np.arange(1, 301, dtype=np.int64) * 600_000_000_000
    counts = Pulses(time, np.cumsum(np.full(300, 100.0)))
    slow = replace(quick, pulses={"cup": counts}, stop=int(time[-1]), reference=None)
    figure = plots.draw("speed", slow, None)
    assert figure is not None
    whole, part = figure.axes
    assert part.get_title(loc="left") == "six hours of it"
    assert np.size(part.get_lines()[0].get_xdata()) > 30
    assert whole.get_xlabel().endswith("[d]") and part.get_xlabel().endswith("[h]")
    spectra = plots.draw("spectra", slow, None)
    assert spectra is not None
    assert not spectra.axes[0].texts, "the inertial subrange lies beyond"


def mast_of_means(rows: int = 5000) -> Recording:
    """Six rotors whose topics tell ten-minute means, and a vane that crosses north."""
    quick = steady_recording()
    made = [
        {
            "name": f"cup_{n}0_north_of_the_mast", "kind": "cup", "pulses_per_revolution": 2,
            "pulses": {"topic": f"/cup_{n}", "type": "std_msgs/msg/Float64", "meaning": "value"},
            "calibration_distance": 0.2, "starting_speed": 0.35, "distance_constant": 3.0,
        }
        for n in range(1, 7)
    ]
    vane = {"name": "vane", "kind": "vane", "distance_constant": 1.0, "damping_ratio": 0.4,
            "joint_states": {"topic": "/vane"}}
    station = Station.model_validate({"instruments": [*made, vane]})
    rng = np.random.default_rng(3)
    steps = np.full(rows, 600_000_000_000, dtype=np.int64)
    steps[3000] *= 3000
    time = START + np.cumsum(steps)
    speed = np.maximum(8.0 + 3.0 * rng.standard_normal(rows), 0.0)
    speed[4000:] = 0.0
    turns = np.cumsum(np.maximum(speed - 0.35, 0.0) * 600.0 / (2.0 * np.pi * 0.2))
    heading = np.radians(90.0 + 8.0 * rng.standard_normal(rows))
    return replace(
        quick, station=station, stop=int(time[-1]), reference=None,
        pulses={f"cup_{n}0_north_of_the_mast": Pulses(time, turns) for n in range(1, 7)},
        angles={"vane": Angles(time, heading)},
    )


def test_what_is_told_as_a_speed_is_drawn_as_one_and_gaps_stay_open() -> None:
    recording = mast_of_means()
    figure = plots.draw("speed", recording, None)
    assert figure is not None
    whole = figure.axes[0]
    x, y = (np.asarray(v, dtype=float) for v in whole.get_lines()[0].get_data())
    after = x > (recording.stop - START) * 1e-9 - 300 * 600.0
    assert np.all(y[after] == 0.0), "a rotor that tells 0 m/s stands at 0"
    across = np.flatnonzero(np.diff(x) > 500_000.0)
    assert across.size > 0 and np.isnan(y[across]).all(), "nothing is drawn over the gap"
    assert "2026-01-01 00:00 UTC [d]" in whole.get_xlabel()
    assert whole.get_title(loc="left").endswith("means over an hour")


def test_a_legend_of_long_names_stays_inside_and_covers_nothing() -> None:
    recording = mast_of_means()
    for name in ("speed", "direction"):
        figure = plots.draw(name, recording, None)
        assert figure is not None
        figure.savefig(io.BytesIO())
        (legend,) = figure.legends
        box = legend.get_window_extent()
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0
        for panel in figure.axes:
            assert not box.overlaps(panel.get_window_extent())
            assert panel.get_window_extent().width > 0.8 * figure.bbox.width


def test_a_direction_is_averaged_as_one() -> None:
    figure = plots.draw("direction", mast_of_means(), None)
    assert figure is not None
    (drawn,) = figure.axes[0].get_lines()
    degrees = np.asarray(drawn.get_ydata(), dtype=float)
    away = np.abs((degrees + 180.0) % 360.0 - 180.0)
    assert np.all(away < 25.0), "means of directions about north are about north"


def test_figures_are_the_same_every_time(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "steady", steady_recording())
    texts = []
    for name in ("a", "b"):
        out = tmp_path / name
        command = ["plot", str(folder), "-o", str(out), "--format", "svg"]
        assert main([*command, "--only", "speed"]) == 0
        texts.append((out / "speed.svg").read_text(encoding="utf-8"))
    assert texts[0] == texts[1]


def test_rotor_speed_is_the_calibration() -> None:
    recording = steady_recording(speed=8.0)
    cup = recording.station.instrument("cup")
    assert isinstance(cup, Cup)
    _, speed = plots.rotor_speed(cup, recording.pulses["cup"])
    assert np.allclose(speed, 8.0, rtol=1e-6), "a whole turn averages uneven slots away"
    propeller = Propeller(
        name="p",
        pulses=Input(topic="/p"),
        pulses_per_revolution=1,
        calibration_distance=0.05,
        distance_constant=1.0,
    )
    time = START + np.arange(5, dtype=np.int64) * 1_000_000_000
    counted = Pulses(time, np.asarray([0.0, 10.0, 30.0, 30.0, 20.0]))
    _, speed = plots.rotor_speed(propeller, counted)
    assert np.allclose(speed, 0.05 * 2.0 * np.pi * np.asarray([10.0, 20.0, 0.0, -10.0]))


def test_slot_durations_find_the_planted_slots() -> None:
    recording = steady_recording()
    slots, mean, error = plots.slot_durations(recording.pulses["cup"], 4)
    assert slots.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert np.allclose(mean, SLOTS, atol=1e-6)
    assert (error < 1e-6).all()
