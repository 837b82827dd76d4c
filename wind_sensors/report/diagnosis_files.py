"""What `wind diagnose` leaves on disk."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.json_output import as_json
from wind_sensors.diagnosis.verdict import Diagnosis
from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.places import check_writable, refused_in_words
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.recordings.writing import keep_inputs, write_topics
from wind_sensors.report.corrected_station import corrected_station
from wind_sensors.report.diagnosis_page import page

NUMBER = "std_msgs/msg/Float64"

NAMES = ("diagnosis.json", "report.html", "station_corrected.yaml", "residuals")


def make_way(
    folder: Path,
    names: Sequence[str] = NAMES,
    *,
    inputs: Sequence[str | Path | None] = (),
    force: bool,
) -> None:
    """Clear a folder of what a command wrote before.

    Raises:
        UserError: Something is there and `force` is not given, it is not a folder, nothing can be
            written there, or what is there is one of the command's inputs.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError("this is no folder.", str(folder), "Choose another place with -o.")
    check_writable(folder)
    taken = [folder / name for name in names if (folder / name).exists()]
    if taken and not force:
        raise UserError(
            "this exists already.", str(taken[0]), "Choose another place with -o, or add --force."
        )
    for path in taken:
        keep_inputs(path, inputs, may_lie_inside=True)
    for path in taken:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def series_topics(
    comparison: Comparison, series: Mapping[str, Simulated]
) -> list[TopicMessages]:
    """Series of each channel and what is left of the measured one after each simulated one.

    Rotor rates in m/s of wind, vane angles in degrees, every bin at its middle.

    Args:
        comparison: The recording.
        series: `measured` and one or more simulations, by name.
    """
    types = typestore()
    blank = template(types, NUMBER, [("data",)])
    time = comparison.grid.start + np.rint(comparison.grid.centres * 1e9).astype(np.int64)
    out = []
    for channel in comparison.channels:
        columns = {name: of.series[channel.name] for name, of in series.items()}
        if channel.kind == "vane_angle":
            columns = {
                name: np.degrees(values / comparison.speed + comparison.direction)
                for name, values in columns.items()
            }
        for name in [n for n in columns if n != "measured"]:
            columns[f"measured_minus_{name}"] = columns["measured"] - columns[name]
        for name, values in columns.items():
            raw = serialised(types, blank, {("data",): values})
            out.append(TopicMessages(f"/{channel.name}/{name}", NUMBER, time, raw))
    return out


def write(folder: Path, diagnosis: Diagnosis, without: Sequence[str] = ()) -> list[Path]:
    """Write `diagnosis.json`, `report.html`, `station_corrected.yaml` and the residuals' bag.

    Args:
        folder: Where to.
        diagnosis: What to write.
        without: Effects that had been taken out of the catalogue; both files say so.

    Returns:
        What was written.

    Raises:
        UserError: Nothing can be written there.
    """
    with refused_in_words(folder):
        folder.mkdir(parents=True, exist_ok=True)
        station_text = corrected_station(
            diagnosis.recording, diagnosis.verdict, diagnosis.findings, diagnosis.station
        )
        (folder / "diagnosis.json").write_text(
            json.dumps({**as_json(diagnosis), "catalogue_without": list(without)}, indent=1) + "\n",
            encoding="utf-8",
        )
        (folder / "report.html").write_text(page(diagnosis, without), encoding="utf-8")
        (folder / "station_corrected.yaml").write_text(station_text, encoding="utf-8")
        topics = series_topics(
            diagnosis.comparison,
            {
                "measured": diagnosis.comparison.measured,
                "simulated": diagnosis.simulated,
                "corrected": diagnosis.corrected,
            },
        )
        write_topics(folder / "residuals", station_text, topics)
    return [folder / name for name in NAMES]
