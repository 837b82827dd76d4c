"""The demo's page: one self-contained file."""

from __future__ import annotations

from html import escape
from typing import NamedTuple

from matplotlib.figure import Figure

from wind_sensors.report.cuts import CUTS_STYLE, SCROLL_STYLE, in_both_cuts, is_narrow
from wind_sensors.report.demo_figures import Drawing, biases, gust, spectra
from wind_sensors.report.demo_results import DemoResults, WindowComparison
from wind_sensors.report.live_agreement import Agreement, shortfalls
from wind_sensors.report.style import house


class Circumstances(NamedTuple):
    """What was run.

    Attributes:
        wind: The simulated wind, in words.
        simulated_seconds: Length of the simulation.
        wall_seconds: How long the live graph ran; 0 without one.
        messages: Messages recorded.
        processes: Names of the live processes.
        corner_frequency: Where the cup's response has fallen to one half in variance [Hz].
    """

    wind: str
    simulated_seconds: float
    wall_seconds: float
    messages: int
    processes: tuple[str, ...]
    corner_frequency: float


_STYLE = """
:root{--ink:#22303c;--muted:#5d6b77;--line:#e3e8ec;--raw:#b96a1c;--corrected:#1f6fb2;--ok:#3d7f52}
*{box-sizing:border-box}
body{margin:0;background:#f6f8f9;color:var(--ink);
font:17px/1.55 system-ui,-apple-system,"Segoe UI",sans-serif}
main{max-width:62rem;margin:0 auto;padding:2.5rem 1.25rem 4rem}
h1{font-size:clamp(1.7rem,4.5vw,2.6rem);line-height:1.15;margin:0 0 .6rem;letter-spacing:-.02em}
h2{font-size:1.25rem;margin:0 0 .35rem;letter-spacing:-.01em}
p{margin:0 0 .8rem;max-width:44rem}.lead{font-size:1.1rem;color:var(--muted)}
.numbers{display:grid;gap:.8rem;grid-template-columns:repeat(auto-fit,minmax(13rem,1fr));
margin:1.6rem 0}
.number,section{background:#fff;border:1px solid var(--line);border-radius:14px}
.number{padding:1rem 1.15rem}
.number b{display:block;font-size:1.4rem;line-height:1.2;white-space:nowrap;
letter-spacing:-.02em;font-variant-numeric:tabular-nums}
.number>span{color:var(--muted);font-size:.92rem;line-height:1.35;display:block;margin-top:.25rem}
section{padding:1.4rem 1.4rem 1rem;margin:0 0 1.2rem}
.raw{color:var(--raw)}.corrected{color:var(--corrected)}.ok{color:var(--ok)}
table{border-collapse:collapse;width:100%;font-size:.93rem}
th,td{padding:.4rem .5rem;text-align:right;border-bottom:1px solid var(--line);
font-variant-numeric:tabular-nums;white-space:nowrap}
th{color:var(--muted);font-weight:600}th:first-child,td:first-child{text-align:left;padding-left:0}
footer{color:var(--muted);font-size:.9rem;margin-top:2rem}
code{font:.92em ui-monospace,monospace;background:#eef2f5;border-radius:5px;padding:.1em .35em}
@media(max-width:640px){body{font-size:16px}main{padding:1.5rem .8rem 3rem}
section{padding:1.1rem .9rem .7rem}
.numbers{grid-template-columns:repeat(2,minmax(0,1fr));gap:.5rem}
.number b{font-size:1.05rem}.number{padding:.7rem .6rem}}
"""


def demo_page(results: DemoResults, run: Circumstances) -> str:
    """The page as HTML.

    Args:
        results: From `demo_results`.
        run: What was run.
    """
    factor = results.naive_error / results.corrected_error
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width,initial-scale=1'>"
        "<title>A gusty hour, as the sensors saw it and as it was</title>"
        f"<style>{_STYLE}{CUTS_STYLE}{SCROLL_STYLE}</style></head><body><main>",
        "<h1>A gusty hour, as the sensors saw it and as it was</h1>",
        f"<p class='lead'>{escape(_lead(run))}</p>",
        _numbers(results, factor),
        _section(
            "The sharpest gust of the hour",
            "A cup needs a stretch of wind to speed up, and a vane overshoots when the wind "
            "turns. The <span class='raw'>naive reading</span> applies the calibration and "
            "nothing else. The <span class='corrected'>corrected wind</span> uses the time of "
            "every single pulse, the motion of both instruments and the statistics of "
            "turbulence. The band is to hold the truth nine times out of ten with real "
            "instruments, and allows for what their equations leave out. These simulated ones "
            "follow the equations, so that over the hour it holds the truth in "
            f"{100.0 * results.coverage:.1f} % of cases.",
            _figure(gust, results, 5.2, 5.6),
        ),
        _section(
            "The bias of the mean, predicted and found",
            "In gusts a cup counts too much wind: it runs up faster than it runs down and cannot "
            "tell a change of direction from a change of speed. From the turbulence in each "
            "window the bias is predicted term by term without knowing the truth. The diamonds "
            "show what the raw mean was really off by.",
            _figure(biases, results, 3.8, 4.4) + _window_table(results.windows),
        ),
        _section(
            "What was lost, frequency by frequency",
            f"The cup follows the wind up to about {run.corner_frequency:.1f} Hz (mean speed over "
            "2π distance constants) and then falls behind. The corrected wind keeps to the true "
            "spectrum further up, and fades where the pulses carry no information rather than "
            "invent it.",
            _figure(spectra, results, 3.8, 3.8),
        ),
        _live_section(results.agreement, run),
        "<footer>Wind vectors say where the air goes (east, north, up); directions in the text "
        "say where it comes from. The truth was recorded beside the signals and used for this "
        "page alone. Repeat it with <code>wind demo</code>.</footer>",
        "</main></body></html>",
    ]
    return "\n".join(parts)


def _lead(run: Circumstances) -> str:
    minutes = run.simulated_seconds / 60.0
    return (
        f"{minutes:.0f} minutes of {run.wind}, measured by the simulated cup anemometer and vane "
        "of a mast, and the wind that wind_sensors makes of their pulses and angles."
    )


def _numbers(results: DemoResults, factor: float) -> str:
    found = sum(abs(w.found_bias) for w in results.windows) / max(len(results.windows), 1)
    left = sum(abs(w.corrected_speed / w.true_speed - 1.0) for w in results.windows)
    left /= max(len(results.windows), 1)
    cards = [
        (
            f"<span class='raw'>{results.naive_error:.2f}</span> → "
            f"<span class='corrected'>{results.corrected_error:.2f}</span> m/s",
            f"rms error of the wind vector at each instant: {factor:.1f} times closer",
        ),
        (
            f"<span class='raw'>{100.0 * found:.1f}</span> → "
            f"<span class='corrected'>{100.0 * left:.2f}</span> %",
            "bias of the ten-minute mean speed, raw and corrected",
        ),
        (f"{100.0 * results.coverage:.0f} %", "of the errors inside the stated 90 % interval"),
    ]
    agreement = results.agreement
    if agreement is not None:
        cards.append(
            (
                f"<span class='ok'>{agreement.compared:,}</span>".replace(",", "\u2009"),
                "live estimates equal to the offline ones, to the last bit"
                if agreement.is_exact
                else f"live estimates; largest difference {agreement.largest_difference:.2g}",
            )
        )
    text = "".join(f"<div class='number'><b>{b}</b><span>{s}</span></div>" for b, s in cards)
    return f"<div class='numbers'>{text}</div>"


def _section(title: str, text: str, content: str) -> str:
    return f"<section><h2>{escape(title)}</h2><p>{text}</p>{content}</section>"


def _figure(drawing: Drawing, results: DemoResults, wide: float, narrow: float) -> str:
    def draw(width: float) -> Figure:
        height = narrow if is_narrow(width) else wide
        with house():
            figure = Figure(figsize=(width, height), layout="constrained")
            drawing(results, figure)
        return figure

    return in_both_cuts(draw, (drawing.__doc__ or "").splitlines()[0])


def _window_table(windows: tuple[WindowComparison, ...]) -> str:
    rows = "".join(
        f"<tr><td>{w.minutes[0]:.0f}–{w.minutes[1]:.0f} min</td><td>{w.true_speed:.3f}</td>"
        f"<td class='raw'>{w.raw_speed:.3f}</td>"
        f"<td class='corrected'>{w.corrected_speed:.3f} ± {w.uncertainty:.3f}</td>"
        f"<td>{100.0 * w.predicted_bias:+.2f} ± {100.0 * w.predicted_uncertainty:.2f}</td>"
        f"<td>{100.0 * w.found_bias:+.2f}</td>"
        f"<td>{w.true_direction_deg:.1f} / {w.corrected_direction_deg:.1f}</td></tr>"
        for w in windows
    )
    return (
        "<div class='scroll'><table><thead><tr><th>window</th><th>true [m/s]</th>"
        "<th>raw</th><th>corrected</th><th>bias predicted [%]</th><th>found [%]</th>"
        "<th>from [°]: true / corr.</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )


def _live_section(agreement: Agreement | None, run: Circumstances) -> str:
    if agreement is None:
        return _section(
            "Live and offline",
            "There is no rclpy on this machine, so the hour was simulated and processed offline "
            "alone. With ROS 2 the same demo runs the nodes live and compares bit by bit.",
            "",
        )
    speed = run.simulated_seconds / max(run.wall_seconds, 1e-9)
    names = " and ".join(f"<code>{escape(name)}</code>" for name in run.processes)
    verdict = (
        "Not one bit differs"
        if agreement.is_exact
        else f"The largest difference is {agreement.largest_difference:.3g}"
    )
    same = agreement.is_exact and agreement.is_complete
    return _section(
        "Live and offline are the same numbers" if same else "Live and offline",
        f"{names} ran as separate processes and talked over DDS, {speed:.0f} times as fast as "
        f"real time; {run.messages:,} messages were recorded. Then the bag was processed "
        f"offline. {verdict} in {agreement.compared:,} estimates with their covariances and "
        f"{agreement.windows_compared} window means. {agreement.only_offline} further estimates "
        "were not final yet when the live run ended.",
        "".join(f"<p class='raw'>{escape(s)}</p>" for s in shortfalls(agreement, speed)),
    )
