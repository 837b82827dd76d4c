"""What `wind diagnose` leaves on disk."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np

from wind_sensors.diagnosis.verdict import Diagnosis, as_json
from wind_sensors.errors import UserError
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.recordings.writing import write_topics
from wind_sensors.report.diagnosis_page import page
from wind_sensors.station.writing import station_to_yaml

NUMBER = "std_msgs/msg/Float64"

NAMES = ("diagnosis.json", "report.html", "station_corrected.yaml", "residuals")


def make_way(folder: Path, *, force: bool) -> None:
    """Clear a folder of an earlier diagnosis.

    Raises:
        UserError: Something is there and `force` is not given, or it is not a diagnosis.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError("this is no folder.", str(folder), "Choose another place with -o.")
    taken = [folder / name for name in NAMES if (folder / name).exists()]
    if taken and not force:
        raise UserError(
            "this exists already.", str(taken[0]), "Choose another place with -o, or add --force."
        )
    for path in taken:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def residual_topics(diagnosis: Diagnosis) -> list[TopicMessages]:
    """Measured, simulated and corrected series of each channel, and what is left of them.

    Rotor rates in m/s of wind, vane angles in degrees, every bin at its middle.
    """
    types = typestore()
    blank = template(types, NUMBER, [("data",)])
    comparison = diagnosis.comparison
    time = comparison.grid.start + np.rint(comparison.grid.centres * 1e9).astype(np.int64)
    out = []
    for channel in comparison.channels:
        series = {
            "measured": comparison.measured.series[channel.name],
            "simulated": diagnosis.simulated.series[channel.name],
            "corrected": diagnosis.corrected.series[channel.name],
        }
        if channel.kind == "vane_angle":
            series = {
                name: np.degrees(values / comparison.speed + comparison.direction)
                for name, values in series.items()
            }
        series["residual_before"] = series["measured"] - series["simulated"]
        series["residual_after"] = series["measured"] - series["corrected"]
        for name, values in series.items():
            raw = serialised(types, blank, {("data",): values})
            out.append(TopicMessages(f"/{channel.name}/{name}", NUMBER, time, raw))
    return out


def write(folder: Path, diagnosis: Diagnosis) -> list[Path]:
    """Write `diagnosis.json`, `report.html`, `station_corrected.yaml` and the residuals' bag.

    Returns:
        What was written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    station_text = station_to_yaml(diagnosis.station, shipped_profiles())
    (folder / "diagnosis.json").write_text(
        json.dumps(as_json(diagnosis), indent=1) + "\n", encoding="utf-8"
    )
    (folder / "report.html").write_text(page(diagnosis), encoding="utf-8")
    (folder / "station_corrected.yaml").write_text(station_text, encoding="utf-8")
    write_topics(folder / "residuals", station_text, residual_topics(diagnosis))
    return [folder / name for name in NAMES]
