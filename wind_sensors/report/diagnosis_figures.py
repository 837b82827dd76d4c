"""Figures of a diagnosis."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observation import NORMALISED_BANDS, Channel
from wind_sensors.diagnosis.comparing.observing import BANDS, Simulated
from wind_sensors.diagnosis.comparing.raw_statistics import STATISTICS
from wind_sensors.diagnosis.healthy.baseline import ChannelBaseline
from wind_sensors.diagnosis.regions import clockwise_from, eddies
from wind_sensors.report import style
from wind_sensors.report.cuts import WIDE, is_narrow, label_for, title_for

FloatArray = npt.NDArray[np.float64]

_SMOOTHING = 15.0
_LEAST_BINS = 40

_USUAL = 2.0
"""Healthy days stay within so many standard deviations."""

_TELLING = 4.0
"""Statistics are drawn if one of them departs further than this."""

_LEVEL_PARTS = 4
_TELLING_LEVELS = 3.5
"""Levels of quick eddies are drawn if the mean over so many of them departs further than this, in
its own standard deviations."""

_HIGHEST_RATIO = 3.0
"""Ratios of power beyond it are drawn as triangles at the edge."""

_FURTHEST = 40.0
"""Beyond so many standard deviations a point is drawn at the edge, with its number."""


def channel_words(name: str) -> str:
    """A channel for people."""
    return name.replace("/", ", ").replace("_", " ")


def _series(
    comparison: Comparison, simulated: Simulated, corrected: Simulated | None, channel: Channel
) -> tuple[FloatArray, FloatArray, str]:
    """Residuals before and after, and their unit."""
    measured = comparison.measured.series[channel.name]
    before = measured - simulated.series[channel.name]
    after = measured - (corrected or simulated).series[channel.name]
    if channel.kind == "vane_angle":
        return np.degrees(before / comparison.speed), np.degrees(after / comparison.speed), "deg"
    return before, after, "m/s"


def _smooth(values: FloatArray, width: int) -> FloatArray:
    return np.convolve(values, np.full(width, 1.0 / width), mode="valid")


def _binned(
    of: FloatArray, values: FloatArray, edges: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bin middles, means and standard errors (of quarter-minute means)."""
    middles, means, errors = [], [], []
    for low, high in itertools.pairwise(edges):
        inside = (of >= low) & (of < high)
        if np.count_nonzero(inside) < _LEAST_BINS:
            continue
        chosen = values[inside]
        middles.append(0.5 * (low + high))
        means.append(float(np.mean(chosen)))
        errors.append(float(np.std(chosen)) / np.sqrt(max(chosen.size / 50.0, 1.0)))
    return np.array(middles), np.array(means), np.array(errors)


def residual_figure(
    comparison: Comparison,
    simulated: Simulated,
    corrected: Simulated | None,
    channel: Channel,
    width: float = WIDE,
) -> Figure:
    """Residual of a channel over time, direction, speed and frequency, before and after.

    Args:
        comparison: The recording.
        simulated: Simulation of the station as it is described.
        corrected: With the named physics; None: nothing is named.
        channel: What is shown.
        width: Of the figure [inch].
    """
    before, after, unit = _series(comparison, simulated, corrected, channel)
    smoothed = max(int(_SMOOTHING / comparison.grid.dt), 1)
    at = comparison.grid.centres
    on_platform = comparison.drive.motion is not None
    clockwise = clockwise_from(comparison)
    with style.house():
        stacked = is_narrow(width)
        made = Figure(figsize=(width, 10.4 if stacked else 6.6), layout="constrained")
        grid = made.add_gridspec(4, 1) if stacked else made.add_gridspec(2, 3)
        over_time = made.add_subplot(grid[0, :])
        by_direction, by_speed, by_frequency = (
            made.add_subplot(grid[1 + k, 0] if stacked else grid[1, k]) for k in range(3)
        )
        cut = at[smoothed - 1 :] - 0.5 * (smoothed - 1) * comparison.grid.dt
        over_time.plot(cut, _smooth(before, smoothed), color=style.RAW, label="before")
        if corrected is not None:
            over_time.plot(cut, _smooth(after, smoothed), color=style.CORRECTED, label="with it")
            if stacked:
                # Its title may take two lines, so that there is no room beside it.
                made.legend(loc="outside upper right", ncols=2)
            else:
                over_time.legend(loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0))
        over_time.axhline(0.0, color=style.MUTED, linewidth=0.8)
        over_time.set_title(
            title_for(width, f"Recorded minus simulated, {channel_words(channel.name)}")
        )
        over_time.set_xlabel(f"time in s ({_SMOOTHING:.0f} s means)")
        over_time.set_ylabel(unit)
        speeds = np.quantile(comparison.speed, np.linspace(0.0, 1.0, 9))
        for axes, of, edges, label in (
            (by_direction, clockwise, np.arange(0.0, 361.0, 10.0),
             "wind from, deg " + ("from the bow" if on_platform else "from north")),
            (by_speed, comparison.speed, speeds, "wind speed in m/s"),
        ):
            pairs = [(before, style.RAW)]
            if corrected is not None:
                pairs.append((after, style.CORRECTED))
            for values, colour in pairs:
                x, y, e = _binned(of, values, edges)
                axes.errorbar(x, y, 2.0 * e, fmt="o", color=colour, markersize=3.5, linewidth=1.0)
            axes.axhline(0.0, color=style.MUTED, linewidth=0.8)
            axes.set_xlabel(label)
        by_direction.set_ylabel(unit)
        if stacked:
            by_speed.set_ylabel(unit)
        _spectra(comparison, simulated, corrected, channel, by_frequency)
    return made


def statistics_figure(
    comparison: Comparison,
    known: ChannelBaseline,
    simulated: Simulated,
    corrected: Simulated | None,
    channel: Channel,
    width: float = WIDE,
    *,
    calibrated: bool,
) -> Figure | None:
    """How far spectra and statistics of the raw signals lie from the simulation's; before, after.

    Pulses that are lost, readings in steps or a vane that sticks move no mean: they show here.

    Args:
        comparison: The recording.
        known: What they do on healthy days.
        simulated: Simulation of the station as it is described.
        corrected: With the named physics; None: nothing is named.
        channel: What is shown.
        width: Of the figure [inch].
        calibrated: Whether healthy days stand behind `known`, or certificates alone.

    Returns:
        None if nothing departs from healthy days.
    """

    deviation = known.statistics_deviation_in(float(np.mean(comparison.speed)))

    def departures(expected: Simulated) -> FloatArray:
        away = comparison.measured.statistics[channel.name] - expected.statistics[channel.name]
        return np.asarray((away - known.statistics_mean) / deviation)

    before = departures(simulated)
    shown = np.flatnonzero(np.isfinite(before) & np.isfinite(deviation))
    if not np.any(np.abs(before[shown]) > _TELLING):
        return None
    after = before if corrected is None else departures(corrected)
    bands = [eddies(channel, NORMALISED_BANDS[k : k + 2]) for k in range(BANDS)]
    labels = [label_for(width, label) for label in (*bands, *STATISTICS[channel.kind])]
    lines = max(labels[k].count("\n") + 1 for k in shown)
    with style.house():
        row_height = 0.11 + 0.16 * lines
        made = Figure(figsize=(width, 1.4 + row_height * shown.size), layout="constrained")
        axes = made.add_subplot()
        axes.axvspan(-_USUAL, _USUAL, color=style.GRID, zorder=0)
        rows = np.arange(shown.size)
        for values, colour, label in (
            (before, style.RAW, "before"), (after, style.CORRECTED, "with it")
        ):
            if label == "with it" and corrected is None:
                continue
            drawn = np.clip(np.nan_to_num(values[shown]), -_FURTHEST, _FURTHEST)
            axes.plot(drawn, rows, "o", color=colour, markersize=5.0, label=label)
            for row, value in zip(rows, values[shown], strict=True):
                if abs(value) > _FURTHEST:
                    side = "right" if value > 0.0 else "left"
                    axes.annotate(
                        f"{value:.0f}", (float(np.clip(value, -_FURTHEST, _FURTHEST)), row),
                        xytext=(-8 if value > 0.0 else 8, 0), textcoords="offset points",
                        ha=side, va="center", color=colour,
                    )
        axes.axvline(0.0, color=style.MUTED, linewidth=0.8)
        axes.set_yticks(rows, [labels[k] for k in shown])
        axes.invert_yaxis()
        made.suptitle(
            f"Raw signals, {channel_words(channel.name)}",
            x=0.01, ha="left", fontsize=11, fontweight="bold", color=style.INK,
        )
        usual = "of healthy days" if calibrated else "that certificates allow"
        scale = f"recorded minus simulated,\nin standard deviations {usual}"
        axes.set_xlabel(scale if is_narrow(width) else scale.replace("\n", " "))
        if corrected is not None:
            made.legend(loc="outside lower left", ncols=2)
    return made


def activity_figure(
    comparison: Comparison,
    known: ChannelBaseline,
    simulated: Simulated,
    corrected: Simulated | None,
    channel: Channel,
    width: float = WIDE,
) -> Figure | None:
    """Power of quick eddies over the simulation's, from half-minute to half-minute.

    What begins inside a record and damps or hastens a signal moves no mean: it shows here.

    Args:
        comparison: The recording.
        known: What it does on healthy days.
        simulated: Simulation of the station as it is described.
        corrected: With the named physics; None: nothing is named.
        channel: What is shown, in the band of eddies that departs most.
        width: Of the figure [inch].

    Returns:
        None if no band departs from healthy days for minutes.
    """
    counted = comparison.measured.counted
    mean_speed = float(np.mean(comparison.speed))
    deviation = known.activity_deviation(
        activity.sampling_variance(channel, mean_speed, comparison.grid)
    )

    def contrasts(expected: Simulated) -> FloatArray:
        away = comparison.measured.levels[channel.name] - expected.levels[channel.name]
        return activity.contrasts(away, counted)

    before = contrasts(simulated)
    together = before[:, : before.shape[1] // _LEVEL_PARTS * _LEVEL_PARTS]
    parts = together.reshape(activity.BANDS, -1, _LEVEL_PARTS).mean(axis=2)
    if parts.shape[1] == 0:
        return None
    farthest = np.abs(parts).max(axis=1) / deviation * np.sqrt(_LEVEL_PARTS)
    band = int(np.argmax(farthest))
    if farthest[band] < _TELLING_LEVELS:
        return None
    at = (np.arange(counted.size) + 0.5) * activity.SEGMENT
    with style.house():
        made = Figure(figsize=(width, 2.6), layout="constrained")
        axes = made.add_subplot()
        usual = np.exp(_USUAL * float(deviation[band]))
        axes.axhspan(1.0 / usual, usual, color=style.GRID, zorder=0)
        axes.axhline(1.0, color=style.MUTED, linewidth=0.8)
        drawn = [(before, style.RAW, "before")]
        if corrected is not None:
            drawn.append((contrasts(corrected), style.CORRECTED, "with it"))
        for values, colour, label in drawn:
            ratio = np.exp(values[band][counted])
            axes.plot(at[counted], ratio, "o-", color=colour, markersize=4.0, label=label)
        axes.set_yscale("log", base=2)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("time in s (means over half a minute)")
        axes.set_ylabel("recorded / simulated power,\nmean of the record: 1")
        words = eddies(channel, activity.EDGES[band : band + 2])
        title = f"{words[0].upper()}{words[1:]}, {channel_words(channel.name)}"
        axes.set_title(title_for(width, title))
        if corrected is not None:
            axes.legend(loc="best", ncols=2)
    return made


def _spectra(
    comparison: Comparison,
    simulated: Simulated,
    corrected: Simulated | None,
    channel: Channel,
    axes: Axes,
) -> None:
    """Ratio of recorded to simulated power."""
    measured = comparison.measured.cosine[channel.name]
    edges = spectra.band_edges(measured.size)
    frequency = 0.5 * (edges[:-1] + edges[1:]) / (2.0 * comparison.grid.n * comparison.grid.dt)
    power = spectra.band_means(measured**2, edges)
    pairs = [(simulated, style.RAW)]
    if corrected is not None:
        pairs.append((corrected, style.CORRECTED))
    for expected, colour in pairs:
        other = spectra.band_means(expected.cosine[channel.name] ** 2, edges)
        ratio = power / np.maximum(other, 1e-12)
        axes.semilogx(frequency, ratio, "o-", color=colour, ms=3.0)
        above = ratio > _HIGHEST_RATIO
        edge = np.full(np.count_nonzero(above), 0.98 * _HIGHEST_RATIO)
        axes.plot(frequency[above], edge, "^", color=colour, ms=5.0)
    axes.axhline(1.0, color=style.MUTED, linewidth=0.8)
    axes.set_ylim(0.0, _HIGHEST_RATIO)
    axes.set_xlabel("frequency in Hz")
    axes.set_ylabel("recorded / simulated power")
