"""The page of a diagnosis without a measured reference."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from html import escape
from math import isfinite

import numpy as np
from matplotlib.figure import Figure

from wind_sensors.diagnosis.effects.wording import date_text, number_text
from wind_sensors.diagnosis.outcome import Outcome, Panel
from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.report import style
from wind_sensors.report.cuts import in_both_cuts, title_for
from wind_sensors.report.diagnosis_page import VERDICTS, document, silent_paragraphs
from wind_sensors.report.names import names_of, silence_of, words
from wind_sensors.report.removed import removed_text
from wind_sensors.report.sizes import sizes_of, smallest_text


def panel_figure(panels: list[Panel], start: int, width: float) -> Figure:
    """Residuals before and after: one panel below the other.

    Args:
        panels: What is drawn.
        start: Of the recording [ns], from which days count.
        width: Of the figure [inch].
    """
    with style.house():
        figure = Figure(figsize=(width, 2.3 * len(panels)), layout="constrained")
        axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axis, panel in zip(axes, panels, strict=True):
            axis.axhline(0.0, color="0.6", linewidth=0.8)
            axis.errorbar(
                panel.at, panel.before, 2.0 * panel.error, fmt=".-", color="#b96a1c",
                linewidth=0.8, markersize=4, label="before",
            )
            if not np.array_equal(panel.before, panel.after, equal_nan=True):
                axis.plot(
                    panel.at, panel.after, ".-", color="#1f6fb2", linewidth=0.8, label="after",
                    zorder=3,
                )
            since = f" since {date_text(start)}" if panel.axis == "day" else ""
            axis.set_xlabel(f"{panel.axis}{since}")
            axis.set_ylabel(panel.unit)
            axis.set_title(title_for(width, panel.title), fontsize=10)
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=2, fontsize=8)
    return figure


def _effects(outcome: Outcome) -> str:
    """One section for each effect, with all the instruments it was found on."""
    groups: dict[str, list[Finding]] = {}
    for finding in outcome.findings:
        groups.setdefault(finding.term.effect.name, []).append(finding)
    return "".join(_effect(group, outcome) for group in groups.values())


def _effect(findings: Sequence[Finding], outcome: Outcome) -> str:
    effect = findings[0].term.effect
    rivals = {name for f in findings for name, _, _ in f.alternatives}
    others = "".join(
        f"<li>against {escape(words(name))}: {escape(measure)}</li>"
        for name, measure in effect.confusable.items()
        if name in rivals
    )
    return (
        f"<section><h2>{escape(words(effect.name))}</h2><p>{escape(effect.meaning)}</p>"
        f"<span class='eq'>{escape(effect.equation)}</span>"
        f"<p class='muted'>{escape(effect.source)}</p>"
        + "".join(_finding(f, outcome) for f in findings)
        + (f"<p>What would tell more:</p><ul>{others}</ul>" if others else "")
        + "</section>"
    )


def _finding(finding: Finding, outcome: Outcome) -> str:
    together = (
        f" (one of set {finding.set_number}: the data do not say which)"
        if finding.set_number
        else ""
    )
    located = finding.located
    mismatch = (
        f"; mismatch there {number_text(located.excess)} {escape(located.unit)}"
        if located.excess
        else ""
    )
    chance = f"; p = {finding.p:.3g}" if isfinite(finding.p) else ""
    sizes = "; ".join(size.text for size in sizes_of(finding, outcome.station, outcome.start))
    proof = ""
    if finding.proof is not None:
        removed = escape(removed_text(finding.proof))
        proof = f"<br>On blocks that were not fitted it removes {removed}."
    return (
        f"<p><b>{escape(finding.term.instrument)}</b>{together}: {escape(sizes)}.<br>"
        f"Where: {escape(located.region.label)}{mismatch}{chance}.{proof}</p>"
    )


def _headline(outcome: Outcome) -> str:
    """The named effects, each with its instruments; without any, what is not told apart."""
    instruments: dict[str, dict[str, None]] = {}
    for finding in outcome.findings:
        if finding.set_number == 0:
            name = words(finding.term.effect.name)
            instruments.setdefault(name, {})[finding.term.instrument] = None
    named = "; ".join(f"{name} ({', '.join(on)})" for name, on in instruments.items())
    headline = named or names_of(outcome.findings) or silence_of(outcome.silent)
    headline = headline or VERDICTS[outcome.verdict]
    return headline[0].upper() + headline[1:]


def _list(title: str, lines: tuple[str, ...]) -> str:
    if not lines:
        return ""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<section><h2>{escape(title)}</h2><ul>{items}</ul></section>"


def outcome_page(outcome: Outcome) -> str:
    """The report as one HTML file without outside references."""
    titles = list(dict.fromkeys(p.title for p in outcome.panels))
    figures = "".join(
        in_both_cuts(
            partial(panel_figure, [p for p in outcome.panels if p.title == title], outcome.start),
            title,
        )
        for title in titles
    )
    calibrated = (
        f"Healthy recordings: {', '.join(outcome.healthy)}."
        if outcome.calibrated
        else "The null is not calibrated: no healthy recording was given."
    )
    left = outcome.left_over or (
        "Nothing of what was looked for. What the figures still show is the scatter of the wind "
        "and of the instruments, gusts above all."
    )
    headline = _headline(outcome)
    verdict = "" if headline == VERDICTS[outcome.verdict] else f"{VERDICTS[outcome.verdict]}. "
    detectable = tuple(
        f"{words(name)}: {smallest_text(size)}"
        for name, size in sorted(outcome.smallest_detectable.items())
    )
    body = [
        f"<header class='verdict {outcome.verdict}'><div class='muted'>"
        f"{escape(outcome.recording)} · wind diagnose</div>"
        f"<h1>{escape(headline)}</h1>"
        f"<p class='muted'>{escape(verdict)}Reference: "
        f"{escape(outcome.reference)}. {escape(calibrated)}</p>"
        f"{silent_paragraphs(outcome.silent)}</header>",
        _effects(outcome),
        f"<section><h2>Before and after</h2><p class='muted'>Orange: recorded minus simulated as "
        f"described; bars are two standard errors. Blue: with all that was fitted, also what is "
        f"too small or too ambiguous for the corrected station.</p>{figures}"
        "</section>" if figures else "",
        _list("Seen, and not claimed", outcome.declined),
        f"<section><h2>What is left</h2><p>{escape(left)}</p></section>",
        _list("The smallest sizes that this recording would have shown", detectable),
    ]
    return document(f"Diagnosis of {outcome.recording}", "".join(body))
