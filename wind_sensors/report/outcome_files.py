"""What a diagnosis without a measured reference leaves on disk."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from wind_sensors.diagnosis.outcome import Outcome, outcome_json
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.serialising import TopicMessages, serialised, template
from wind_sensors.recordings.writing import write_topics
from wind_sensors.report.corrected_station import corrected_station
from wind_sensors.report.diagnosis_files import NAMES, NUMBER
from wind_sensors.report.outcome_page import outcome_page


def _residual_topics(outcome: Outcome) -> list[TopicMessages]:
    """Binned residuals over time, before and after, of every panel that runs over days."""
    types = typestore()
    blank = template(types, NUMBER, [("data",)])
    out = []
    for panel in outcome.panels:
        if panel.axis != "day" or not panel.at.size:
            continue
        time = np.rint(panel.at * 86400.0 * 1e9).astype(np.int64)
        name = "".join(c if c.isalnum() else "_" for c in panel.title)
        for when, values in (("before", panel.before), ("after", panel.after)):
            raw = serialised(types, blank, {("data",): values})
            out.append(TopicMessages(f"/{name}/residual_{when}", NUMBER, time, raw))
    return out


def write_outcome(folder: Path, outcome: Outcome) -> list[Path]:
    """Write `diagnosis.json`, `report.html`, `station_corrected.yaml` and the residuals' bag.

    Returns:
        What was written.

    Raises:
        UserError: Nothing can be written there.
    """
    station_text = corrected_station(
        outcome.recording, outcome.verdict, outcome.findings, outcome.station, outcome.start
    )
    text, page = json.dumps(outcome_json(outcome), indent=1) + "\n", outcome_page(outcome)
    topics = _residual_topics(outcome)
    with refused_in_words(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "diagnosis.json").write_text(text, encoding="utf-8")
        (folder / "report.html").write_text(page, encoding="utf-8")
        (folder / "station_corrected.yaml").write_text(station_text, encoding="utf-8")
        if not topics:
            return [folder / name for name in NAMES[:3]]
        write_topics(folder / "residuals", station_text, topics)
    return [folder / name for name in NAMES]
