"""The page of a diagnosis: one self-contained file, readable in a minute."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from html import escape

import numpy as np

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.wording import number_text
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.proving.findings import Finding
from wind_sensors.diagnosis.proving.proof import Proof
from wind_sensors.diagnosis.proving.remainder import REMAINDER_P, REMAINDER_SCORES
from wind_sensors.diagnosis.regions import OF_POWER, Found, Region
from wind_sensors.diagnosis.verdict import Diagnosis
from wind_sensors.report.cuts import CUTS_STYLE, SCROLL_STYLE, in_both_cuts
from wind_sensors.report.diagnosis_figures import (
    activity_figure,
    channel_words,
    residual_figure,
    statistics_figure,
)
from wind_sensors.report.names import names_of, silence_of, words
from wind_sensors.report.sizes import LONG, moment_text, sizes_of, smallest_text
from wind_sensors.station.model import Angle, Propeller, Rotor, Station
from wind_sensors.station.silence import Silent

STYLE = """
:root{--ink:#22303c;--muted:#5d6b77;--line:#e3e8ec;--blue:#1f6fb2;--orange:#b96a1c;--green:#3d7f52}
*{box-sizing:border-box}
body{margin:0;font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:#f6f8f9}
main{max-width:60rem;margin:0 auto;padding:1rem}
section,header{background:#fff;border:1px solid var(--line);border-radius:10px;
padding:1rem 1.25rem;margin:0 0 1rem}
h1{font-size:1.5rem;margin:.2rem 0 .4rem;overflow-wrap:anywhere}
h2{font-size:1.1rem;margin:0 0 .5rem}
p{margin:.3rem 0 .6rem;max-width:65ch}.muted{color:var(--muted)}
.verdict{border-left:8px solid var(--blue)}.none{border-left-color:var(--green)}
.unknown,.ambiguous,.inconclusive{border-left-color:var(--orange)}
code,.eq{font-family:ui-monospace,monospace;font-size:.92em;overflow-wrap:anywhere}
.eq{display:block;background:#f2f5f7;border-radius:6px;padding:.5rem .7rem;margin:.4rem 0}
table{border-collapse:collapse;width:100%;font-size:.95rem}
th,td{text-align:left;padding:.3rem .5rem;border-bottom:1px solid var(--line);vertical-align:top}
th.n,td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.bar{background:var(--line);border-radius:5px;height:14px;overflow:hidden;max-width:26rem}
.bar i{display:block;height:100%;background:var(--blue)}
"""

VERDICTS = {
    "none": "Nothing is wrong that this recording could show",
    "named": "The missing physics has a name",
    "ambiguous": "The data do not tell apart what stands on either side of an \"or\"",
    "unknown": "Something is wrong that no known effect explains",
    "inconclusive": "Too short or too calm to tell",
}


def _headline(diagnosis: Diagnosis) -> str:
    named, silence = names_of(diagnosis.findings), silence_of(diagnosis.silent)
    headline = named or silence or VERDICTS[diagnosis.verdict]
    return headline[0].upper() + headline[1:]


def when_text(term: Term, start: int | None = None) -> str:
    """When an effect holds, for people; nothing where its sizes are its beginning and end.

    Args:
        term: The effect.
        start: Of the recording [ns]: late moments are told as dates. None: in s.
    """
    if term.interval != ALWAYS:
        begin, end = term.interval
        if start is not None and max(begin, end or 0.0) > LONG:
            until = "" if end is None else f" to {moment_text(end, start)}"
            return f"from {moment_text(begin, start)}{until}"
        return f"from {begin:.0f} s" + ("" if end is None else f" to {end:.0f} s")
    return "" if "start" in term.values else "all the time"


def silent_paragraphs(silent: Sequence[Silent]) -> str:
    """What is said of instruments that say nothing."""
    return "".join(f"<p><b>Silent:</b> {escape(each.words)}.</p>" for each in silent)


def _left_over(diagnosis: Diagnosis) -> list[str]:
    """Why no name is given."""
    left = diagnosis.unexplained.description
    return [left] if left and diagnosis.verdict in {"unknown", "inconclusive"} else []


def _summary(diagnosis: Diagnosis) -> str:
    verdict = VERDICTS[diagnosis.verdict]
    lines = [f"<p class='muted'>{escape(verdict)}.</p>"] if diagnosis.findings else []
    lines.append(silent_paragraphs(diagnosis.silent))
    for finding in diagnosis.findings:
        term = finding.term
        text = "; ".join(size.text for size in sizes_of(finding, diagnosis.station))
        when = when_text(term)
        text += f"; {when}" if when else ""
        lines.append(
            f"<p><b>{escape(words(term.effect.name))}</b>, {escape(term.instrument)}: "
            f"{escape(term.effect.meaning)}<br>{escape(text)}.</p>"
        )
    lines += [f"<p>{escape(part)}.</p>" for part in _left_over(diagnosis)]
    if diagnosis.verdict == "unknown":
        nearest = " and ".join(
            f"{words(t.effect.name)} ({t.instrument})" for t in diagnosis.naming.fit.terms
        )
        if nearest and not diagnosis.objection:
            lines.append(
                f"<p class='muted'>What comes nearest, {escape(nearest)}, is not borne out: it "
                f"leaves more than {_usual(diagnosis.calibrated)}, or needs a second effect that "
                "does not show.</p>"
            )
    if not diagnosis.calibrated:
        lines.append(
            "<p><b>The null is not calibrated:</b> no healthy recording of this station was "
            "given, so what is normal was taken from certificate tolerances.</p>"
        )
    return "".join(lines)


def _physics(finding: Finding, station: Station) -> str:
    effect = finding.term.effect
    rows = "".join(
        f"<tr><td>{escape(size.name)}</td><td class='n'>{size.value}</td>"
        f"<td class='n'>{f'{size.low} to {size.high}' if size.low else ''}</td>"
        f"<td>{escape(size.unit)}</td></tr>"
        for size in sizes_of(finding, station)
    )
    region = finding.located.region
    return (
        f"<section><h2>The physics: {escape(words(effect.name))}</h2>"
        f"<span class='eq'>{_equation(effect.equation)}</span>"
        f"<p class='muted'>{escape(effect.source)}. It shows in: {escape(effect.region)}.</p>"
        f"<div class='scroll'><table><tr><th>parameter</th><th class='n'>value</th>"
        f"<th class='n'>95 % interval</th>"
        f"<th>unit</th></tr>{rows}</table></div>"
        f"<p>The mismatch is largest <b>{escape(where_text(region))}</b> "
        f"({escape(channel_words(region.channel))}): {_mismatch(finding.located)}, "
        f"p = {finding.p:.3g} after looking everywhere. On the data that "
        f"it was fitted to the effect removes {100.0 * finding.share:.0f} % of the whole misfit"
        f"{_gain(finding)}.</p>"
        "</section>"
    )


def _equation(text: str) -> str:
    """An equation with its words; what is quoted is a name."""
    return re.sub(r"`([^`]+)`", r"<i>\1</i>", escape(text))


_AT = {
    "time": "in the part of the record from ",
    "speed": "at wind speeds ",
    "direction": "in ",
    "frequency": "at ",
}
"""What goes before the label of a region that is no part of the signals' power."""


def where_text(region: Region) -> str:
    """A region as a part of a sentence."""
    if region.kind == "all":
        return "over the whole record"
    if region.kind == "speed" and region.label[0].isdigit():
        return f"at wind speeds of {region.label}"
    if region.kind == "heading":
        return f"at headings from {region.low:.0f} to {region.high:.0f} deg"
    return _AT.get(region.kind, "in the ") + region.label


def _mismatch(found: Found) -> str:
    """How large the residual is; of what shows in no series, how far it scatters."""
    size = f"{number_text(found.excess)} {escape(found.unit)}"
    if found.region.kind in OF_POWER:
        return f"the residual scatters by {size} in all"
    return f"{size} on average"


def _gain(finding: Finding) -> str:
    """The evidence for the name beyond the place where the mismatch is largest."""
    if finding.gain <= 0.0:
        return ""
    text = f" and lowers minus twice the log-likelihood by {finding.gain:.0f}"
    if finding.p > REMAINDER_P:
        text += ": that names it, for no single region stands out by itself"
    return text


def _excess(found: Found) -> str:
    """The mean residual of a region; nothing of what shows in no series."""
    if found.region.kind in OF_POWER:
        return ""
    return f"{number_text(found.excess)} {escape(found.unit)}; "


def _proof(finding: Finding, calibrated: bool) -> str:
    proof = finding.proof
    if proof is None:
        return ""
    share = float(np.clip(proof.excess_removed, 0.0, 1.0))
    return (
        "<section><h2>The proof, on data that were not fitted</h2>"
        "<p>Every other block of the record was fitted, the blocks between were scored, and the "
        "other way round, with gaps between them. What is removed here counts, not the share of "
        "the fitted data, which any fit makes look good.</p>"
        f"<div class='bar'><i style='width:{100.0 * share:.0f}%'></i></div>"
        f"<p><b>{100.0 * proof.excess_removed:.0f} %</b> of the excess misfit disappears "
        f"(95 % interval {100.0 * proof.low:.0f} to {100.0 * proof.high:.0f} %). Whitened misfit "
        f"{proof.before:.3f} before, {proof.after:.3f} after; {proof.floor:.3f} on the fitted "
        f"blocks; 1 is what {_usual(calibrated)}.</p>{_checks(proof, calibrated)}</section>"
    )


def _checks(proof: Proof, calibrated: bool) -> str:
    rows = [
        ("the next-best explanation removes", proof.placebo_removed),
        ("smooth curves over the wind speed with as many coefficients remove",
         proof.curve_removed),
        ("fitted to the calmer half of the blocks, it removes in the windier half",
         proof.transfer),
        (f"residuals within the band that holds 95 % of what {_usual(calibrated)}",
         proof.coverage),
    ]
    cells = [
        # Nought is added lest a little less than nothing be told as -0 %.
        (text, f"{np.round(100.0 * value) + 0.0:.0f} %")
        for text, value in rows
        if value is not None
    ]
    if proof.wind_correlation is not None:
        before, after = proof.wind_correlation
        cells.append(
            ("largest correlation of the residual with the wind, within 10 s",
             f"{before:.2f} before, {after:.2f} after")
        )
    if not cells:
        return ""
    lines = "".join(f"<tr><td>{escape(text)}</td><td>{value}</td></tr>" for text, value in cells)
    head = "<tr><th>on the same blocks</th><th></th></tr>"
    return f"<div class='scroll'><table>{head}{lines}</table></div>"


def _can_have(station: Station, name: str) -> bool:
    """Whether any part of a station can have an effect."""
    effect = catalogue()[name]
    carrier = station.platform
    on_carrier = carrier is not None and effect.applies(carrier, station)
    return on_carrier or any(effect.applies(entry, station) for entry in station.instruments)


def _next(diagnosis: Diagnosis) -> str:
    lines = []
    for finding in diagnosis.findings:
        effect = finding.term.effect
        others = {name for name, _, _ in finding.alternatives}
        for name, measurement in effect.confusable.items():
            if not _can_have(diagnosis.station, name):
                continue
            mark = " (close here)" if name in others else ""
            lines.append(
                f"<li>against {escape(words(name))}{mark}: {escape(measurement)}</li>"
            )
    if diagnosis.verdict == "unknown" and not diagnosis.silent:
        lines.append(
            "<li>record again when wind speed and direction differ, to see what it follows</li>"
        )
    if not lines:
        return ""
    return (
        "<section><h2>What to measure next</h2><ul>"
        + "".join(dict.fromkeys(lines))
        + "</ul></section>"
    )


def _left(diagnosis: Diagnosis) -> str:
    unexplained = diagnosis.unexplained
    rows = "".join(
        f"<tr><td>{escape(channel_words(f.region.channel))}</td><td>{escape(f.region.label)}</td>"
        f"<td class='n'>{_excess(f).rstrip('; ')}</td><td class='n'>{number_text(f.score)}</td>"
        f"<td class='n'>{REMAINDER_SCORES[f.region.kind]:.0f}</td></tr>"
        for f in unexplained.regions[:4]
    )
    return (
        "<section><h2>What is left</h2>"
        f"<p>p = {unexplained.p:.3g} for the largest remainder. A score is what the fit would gain "
        "if the residual were moved there; up to the last column it is what healthy days"
        f"{'' if diagnosis.calibrated else ' of stations with a baseline'} and simplified forms "
        "leave.</p><div class='scroll'><table>"
        "<tr><th>channel</th><th>where</th><th class='n'>residual</th><th class='n'>score</th>"
        "<th class='n'>usual to</th></tr>"
        f"{rows}</table></div></section>"
    )


def _detectable(diagnosis: Diagnosis) -> str:
    known = catalogue()
    rows = "".join(
        f"<tr><td>{escape(words(name))}</td><td>{escape(smallest_text(size))}</td>"
        f"<td>{escape(known[name].meaning if name in known else '')}</td></tr>"
        for name, size in sorted(diagnosis.smallest_detectable.items())
    )
    return (
        "<section><details><summary>The smallest size of each effect that this recording could "
        "have shown</summary><p>How far the parameter would have to be from its healthy value to "
        "be told from it, if everything else were known. A size that is fitted beside others is "
        "known less well: its interval is wider.</p>"
        "<div class='scroll'><table><tr><th>effect</th><th>size</th>"
        f"<th>meaning</th></tr>{rows}</table></div></details></section>"
    )


def _taken_out(without: Sequence[str]) -> str:
    if not without:
        return ""
    names = escape(", ".join(words(name) for name in without))
    return f"<p><b>Taken out of the catalogue, and so not looked for:</b> {names}.</p>"


def _healthy(baseline: Baseline) -> str:
    """The healthy recordings, and where their instruments differ from the station's file."""
    if not baseline.calibrated:
        return (
            "<p class='muted'>No healthy recording is behind what counts as usual: certificate "
            "tolerances are.</p>"
        )
    names = ", ".join(baseline.recordings)
    out = f"<p class='muted'>Healthy recordings behind the baseline: {escape(names)}.</p>"
    before = {entry.name: entry for entry in baseline.original.instruments}
    shown = []
    for entry in baseline.station.instruments:
        described = before[entry.name]
        if isinstance(entry, Rotor) and isinstance(described, Rotor):
            gain = entry.calibration_gain / described.calibration_gain
            offset = entry.calibration_offset - described.calibration_offset
            differs = f"{escape(entry.name)}: gain {gain:.3f}, offset {offset:+.2f} m/s"
            if isinstance(entry, Propeller):
                inertia = entry.inertia_factor / described.inertia_factor
                differs += f", inertia factor {inertia:.2f}"
            shown.append(differs)
        elif isinstance(entry, Angle) and isinstance(described, Angle):
            turned = entry.offset_deg - described.offset_deg
            shown.append(f"{escape(entry.name)}: offset {turned:+.1f} deg")
    if shown:
        out += (
            "<p class='muted'>What they show beyond the station's file, from which the sizes of "
            f"findings count: {'; '.join(shown)}.</p>"
        )
    return out


def _usual(calibrated: bool) -> str:
    """What is not worth a word, and says who."""
    return "healthy days show" if calibrated else "certificates allow"


def _not_drawn(channels: Sequence[str]) -> str:
    if not channels:
        return ""
    names = "; ".join(channel_words(name) for name in channels)
    return f"<p class='muted'>Compared as well, and not drawn: {escape(names)}.</p>"


def page(diagnosis: Diagnosis, without: Sequence[str] = ()) -> str:
    """The report as one HTML file without outside references.

    Args:
        diagnosis: What is told.
        without: Effects that had been taken out of the catalogue.
    """
    wanted = {f.located.region.channel for f in diagnosis.findings} or {
        f.region.channel for f in diagnosis.unexplained.regions[:1]
    }
    corrected = diagnosis.corrected if diagnosis.findings else None
    comparison, simulated = diagnosis.comparison, diagnosis.simulated
    calibrated = diagnosis.calibrated
    statistics = partial(statistics_figure, calibrated=calibrated)
    figures: list[str] = []
    grey = False
    for channel in comparison.channels:
        if channel.name not in wanted:
            continue
        known = diagnosis.baseline.channels[channel.name]
        shown = (comparison, simulated, corrected, channel)
        beside_healthy = (comparison, known, simulated, corrected, channel)
        drawn = [
            in_both_cuts(partial(draw, *of), f"{what} of {channel_words(channel.name)}")
            for what, draw, of in (
                ("recorded minus simulated", residual_figure, shown),
                ("power of eddies", activity_figure, beside_healthy),
                ("raw signals", statistics, beside_healthy),
            )
        ]
        figures += drawn
        grey = grey or any(drawn[1:])
    body = [
        f"<header class='verdict {diagnosis.verdict}'><div class='muted'>"
        f"{escape(diagnosis.recording)} · wind diagnose</div>"
        f"<h1>{escape(_headline(diagnosis))}</h1>{_summary(diagnosis)}</header>",
        f"<section><h2>{'Before and after' if corrected else 'Recorded minus simulated'}</h2>"
        "<p class='muted'>Orange: recorded minus the simulation of the station as it was "
        f"described. {'Blue: with the named physics. ' if corrected else ''}Bars are two standard "
        f"errors{f'; grey is what {_usual(calibrated)}' if grey else ''}.</p>"
        + _not_drawn([c.name for c in comparison.channels if c.name not in wanted])
        + "".join(figures)
        + "</section>",
        *(_physics(f, diagnosis.station) for f in diagnosis.findings),
        *(_proof(f, calibrated) for f in diagnosis.findings[:1]),
        _next(diagnosis),
        _left(diagnosis),
        _detectable(diagnosis),
        _healthy(diagnosis.baseline),
        _taken_out(without),
    ]
    return document(f"Diagnosis of {diagnosis.recording}", "".join(body))


def document(title: str, body: str) -> str:
    """A page in the house's style."""
    return (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width,initial-scale=1'>"
        f"<title>{escape(title)}</title><style>{STYLE}{CUTS_STYLE}{SCROLL_STYLE}</style></head>"
        f"<body><main>{body}</main></body></html>\n"
    )
