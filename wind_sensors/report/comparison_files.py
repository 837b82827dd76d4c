"""What `wind compare` leaves on disk."""

from __future__ import annotations

import json
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observation import channels_of
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.json_output import silent_json
from wind_sensors.diagnosis.regions import Found
from wind_sensors.recordings.places import refused_in_words
from wind_sensors.recordings.serialising import TopicMessages
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.recordings.writing import write_topics
from wind_sensors.report.cuts import in_both_cuts
from wind_sensors.report.diagnosis_figures import channel_words, residual_figure
from wind_sensors.report.diagnosis_files import series_topics
from wind_sensors.report.diagnosis_page import document
from wind_sensors.station.silence import silent_instruments
from wind_sensors.station.writing import station_to_yaml

NAMES = ("comparison.json", "comparison.html", "residuals")

NO_READINGS = "no readings"
"""What stands in the place of the residual of an instrument that says nothing."""


def unread(comparison: Comparison) -> list[str]:
    """Channels of the station of which the recording has no readings."""
    seen = {channel.name for channel in comparison.channels}
    return [c.name for c in channels_of(comparison.station) if c.name not in seen]


def channel_summary(comparison: Comparison, simulated: Simulated) -> list[dict[str, Any]]:
    """Mean and scatter of each channel's recorded minus simulated series, and their coherence.

    On a mount that moves the coherence is that of what the wind does beyond the known motion.
    """
    out = []
    for channel in comparison.channels:
        residual = (
            comparison.measured.series[channel.name] - simulated.series[channel.name]
        )
        unit = "m/s"
        if channel.kind == "vane_angle":
            residual, unit = np.degrees(residual / comparison.speed), "deg"
        coherence = comparison.coherence(simulated, channel)
        edges = coherence.edges
        residual_power = spectra.band_means(
            (comparison.measured.cosine[channel.name] - simulated.cosine[channel.name]) ** 2, edges
        )
        out.append(
            {
                "channel": channel.name,
                "unit": unit,
                "mean": float(np.mean(residual)),
                "rms": float(np.sqrt(np.mean(residual**2))),
                "frequency_hz": coherence.frequency.tolist(),
                "squared_coherence": coherence.squared.tolist(),
                "recorded_over_simulated_power": (
                    coherence.measured / np.maximum(coherence.simulated, 1e-12)
                ).tolist(),
                "residual_power": residual_power.tolist(),
            }
        )
    return out


def write(
    folder: Path, comparison: Comparison, simulated: Simulated, found: list[Found], p: float
) -> list[Path]:
    """Write the comparison.

    Args:
        folder: Where to.
        comparison: The recording.
        simulated: Simulation of the station.
        found: Regions where the residual stands out most.
        p: Probability of the largest on a healthy day.

    Raises:
        UserError: Nothing can be written there.
    """
    summary = channel_summary(comparison, simulated)
    regions = [
        {
            "channel": f.region.channel, "kind": f.region.kind, "where": f.region.label,
            "low": f.region.low, "high": f.region.high,
            "residual": f.excess, "unit": f.unit, "score": f.score,
        }
        for f in found
    ]
    silent = silent_instruments(comparison.recording, comparison.station)
    content = {"recording": comparison.recording.name, "channels": summary,
               "silent": silent_json(silent), "notes": list(comparison.recording.notes),
               "regions": regions, "p": p}
    rows = "".join(
        f"<tr><td>{escape(channel_words(f.region.channel))}</td><td>{escape(f.region.label)}</td>"
        f"<td class='n'>{f.excess:.3g} {escape(f.unit)}</td><td class='n'>{f.score:.1f}</td></tr>"
        for f in found
    )
    means = "".join(
        f"<tr><td>{escape(channel_words(c['channel']))}</td>"
        f"<td class='n'>{c['mean']:.3g} {c['unit']}</td>"
        f"<td class='n'>{c['rms']:.3g} {c['unit']}</td></tr>"
        for c in summary
    )
    means += "".join(
        f"<tr><td>{escape(channel_words(name))}</td><td class='n'>{NO_READINGS}</td>"
        f"<td class='n'>{NO_READINGS}</td></tr>"
        for name in unread(comparison)
    )
    figures = "".join(
        in_both_cuts(
            partial(residual_figure, comparison, simulated, None, channel),
            f"recorded minus simulated of {channel_words(channel.name)}",
        )
        for channel in comparison.channels
    )
    told = "".join(f"<p><b>{escape(s.words)}.</b></p>" for s in silent)
    body = (
        f"<header><div class='muted'>{escape(comparison.recording.name)} · wind compare</div>"
        "<h1>Recorded minus simulated</h1><div class='scroll'><table><tr><th>channel</th>"
        f"<th class='n'>mean</th><th class='n'>rms</th></tr>{means}</table></div>{told}</header>"
        f"<section>{figures}</section><section><h2>Where it stands out</h2>"
        f"<p>p = {p:.3g} for the largest, after looking everywhere.</p><div class='scroll'>"
        "<table><tr><th>channel</th><th>where</th>"
        "<th class='n'>residual</th><th class='n'>score</th></tr>"
        f"{rows}</table></div></section>"
    )
    topics: list[TopicMessages] = series_topics(
        comparison, {"measured": comparison.measured, "simulated": simulated}
    )
    station = station_to_yaml(comparison.recording.station, shipped_profiles())
    page = document(f"Comparison of {comparison.recording.name}", body)
    with refused_in_words(folder):
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(content, indent=1) + "\n"
        (folder / "comparison.json").write_text(text, encoding="utf-8")
        (folder / "comparison.html").write_text(page, encoding="utf-8")
        write_topics(folder / "residuals", station, topics)
    return [folder / name for name in NAMES]
