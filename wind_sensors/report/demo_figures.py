"""Figures of the demo's page, each in a wide and a narrow cut."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import welch
from scipy.stats import norm

from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.report.cuts import is_narrow
from wind_sensors.report.demo_results import DemoResults
from wind_sensors.report.style import CORRECTED, INK, MUTED, RAW
from wind_sensors.station.signals import FloatArray

Drawing = Callable[[DemoResults, Figure], None]

_EXCERPT_SECONDS = 16.0
_BAND = float(norm.ppf(0.95))


def gust(results: DemoResults, figure: Figure) -> None:
    """Speed and direction around the sharpest gust: truth, reading, corrected wind."""
    shown = _sharpest_gust(results)
    seconds = results.seconds[shown] - results.seconds[shown][0]
    speed, turn = figure.subplots(2, 1, sharex=True)
    deviation = results.deviation[shown].mean(axis=1)
    corrected = _speed(results.corrected[shown])
    speed.fill_between(
        seconds,
        corrected - _BAND * deviation,
        corrected + _BAND * deviation,
        color=CORRECTED,
        alpha=0.18,
        linewidth=0,
        label="90 % interval",
    )
    speed.plot(seconds, _speed(results.true[shown]), color=INK, lw=1.1, label="true wind")
    speed.plot(seconds, _speed(results.naive[shown]), color=RAW, lw=1.6, label="naive reading")
    speed.plot(seconds, corrected, color=CORRECTED, lw=1.6, label="corrected wind")
    speed.set_ylabel("speed [m/s]")
    handles, labels = speed.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2 if _is_narrow(figure) else 4)
    for wind, colour, width in (
        (results.true, INK, 1.1),
        (results.naive, RAW, 1.6),
        (results.corrected, CORRECTED, 1.6),
    ):
        turn.plot(seconds, direction_from_deg(wind[shown]), color=colour, lw=width)
    turn.set_ylabel("from [°]")
    turn.set_xlabel("time [s]")


def biases(results: DemoResults, figure: Figure) -> None:
    """Bias of the raw mean speed, predicted and found, window by window."""
    axes = figure.subplots()
    windows = results.windows
    place = np.arange(len(windows))
    predicted = np.array([w.predicted_bias for w in windows]) * 100.0
    spread = np.array([w.predicted_uncertainty for w in windows]) * 100.0
    left = np.array([w.corrected_speed / w.true_speed - 1.0 for w in windows]) * 100.0
    found = np.array([w.found_bias for w in windows]) * 100.0
    axes.bar(
        place, predicted, width=0.55, color=RAW, alpha=0.30, yerr=2.0 * spread,
        error_kw={"ecolor": MUTED, "capsize": 3}, label="predicted (± 2σ)",
    )
    axes.plot(place, found, "D", color=RAW, ms=6, label="found in the raw mean")
    axes.plot(place, left, "o", color=CORRECTED, ms=6, label="left after correction")
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set_xticks(place, [f"{w.minutes[0]:.0f}–{w.minutes[1]:.0f}" for w in windows])
    axes.set_xlabel("window [min]")
    axes.set_ylabel("bias of the mean speed [%]")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=1 if _is_narrow(figure) else 3)


def spectra(results: DemoResults, figure: Figure) -> None:
    """Spectra of the wind along its mean: what the cup loses and the filter gives back."""
    axes = figure.subplots()
    mean = results.true.mean(axis=0)
    along = mean / np.hypot(mean[0], mean[1])
    rate = 1.0 / float(np.median(np.diff(results.seconds)))
    for wind, colour, width, label in (
        (results.true, INK, 1.1, "true wind"),
        (results.naive, RAW, 1.6, "naive reading"),
        (results.corrected, CORRECTED, 1.6, "corrected wind"),
    ):
        frequency, density = _smooth_spectrum(wind @ along, rate)
        axes.loglog(frequency, frequency * density, color=colour, lw=width, label=label)
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("f S(f) [m²/s²]")
    axes.legend(loc="lower left")


def _smooth_spectrum(series: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    frequency, density = welch(series, fs=rate, nperseg=min(len(series), round(120.0 * rate)))
    edges = np.geomspace(frequency[1], frequency[-1], 48)
    bins = np.digitize(frequency[1:], edges)
    used = np.unique(bins)
    return (
        np.array([frequency[1:][bins == b].mean() for b in used]),
        np.array([density[1:][bins == b].mean() for b in used]),
    )


def _sharpest_gust(results: DemoResults) -> slice:
    """The stretch with the largest rise of the true speed within five seconds, in its middle."""
    step = float(np.median(np.diff(results.seconds)))
    five, half = round(5.0 / step), round(0.5 * _EXCERPT_SECONDS / step)
    speed = _speed(results.true)
    rise = speed[five:] - speed[:-five]
    centre = int(np.argmax(rise)) + five // 2
    centre = min(max(centre, half), len(speed) - half)
    return slice(centre - half, centre + half)


def _speed(wind: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(wind[:, 0], wind[:, 1]))


def _is_narrow(figure: Figure) -> bool:
    return is_narrow(float(figure.get_size_inches()[0]))
