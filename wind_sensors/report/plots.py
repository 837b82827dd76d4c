"""Figures of a recording: speed, direction, spectra, and the rotor's turn slot by slot."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.signal import welch

from wind_sensors.diagnosis.effects.wording import date_text
from wind_sensors.motion.frames import compass_from_yaw, direction_from_deg, heading_of
from wind_sensors.report import style
from wind_sensors.station.model import Cup, Propeller
from wind_sensors.station.signals import FloatArray, Pulses, Recording, TimeArray

_ZOOM = 60.0
"""Length of the detail in time series [s], where samples come at least every second."""
_ZOOM_SAMPLES = 20.0
"""And in samples, where they come more slowly."""
_ROUND_SPANS = (60.0, 600.0, 3600.0, 21_600.0, 86_400.0, 604_800.0)
"""Lengths that the detail may have [s]."""
_SPAN_WORDS = ("a minute", "ten minutes", "an hour", "six hours", "a day", "a week")
_MOST_POINTS = 3000.0
"""Of a line over the whole recording: means over one of the round spans are drawn of more."""
_GAP = 3.0
"""No line is drawn over an interval so many times as long as all but one in a hundred."""
_UNITS = ((2.0 * 86_400.0, 86_400.0, "d"), (3.0 * 3600.0, 3600.0, "h"), (0.0, 1.0, "s"))
"""Axes longer than the first [s] are in units of the second [s], called so."""
_SLOPE_SPAN = (0.05, 2.0)
"""Where the inertial subrange's slope is drawn [Hz], as far as there are spectra."""
_RATE = 10.0
"""Of the grid for spectra [Hz]."""
_NINETY_PERCENT = 1.6449
_HANDLE, _CHARACTER = 0.6, 0.085
"""Widths of a legend's handle with what is around it, and of a character of its names [inch]."""


class Estimates(NamedTuple):
    """Corrected wind from a processed recording.

    Attributes:
        time: [ns], shape (n,).
        velocity: East, north, up [m/s], shape (n, 3).
        variance: Of each component [m^2/s^2], shape (n, 3).
    """

    time: TimeArray
    velocity: FloatArray
    variance: FloatArray


def rotor_speed(rotor: Cup | Propeller, pulses: Pulses) -> tuple[TimeArray, FloatArray]:
    """Speed by the calibration alone, revolution by revolution.

    Returns:
        Middle of each revolution [ns] and the speed [m/s]; where the source counts, of each
        interval between counts. Where it tells speeds, a rotor at rest tells 0.
    """
    time = np.sort(pulses.time)
    if pulses.turns is None:
        time = time[:: rotor.pulses_per_revolution]
        turns = np.ones(max(len(time) - 1, 0))
    else:
        order = np.argsort(pulses.time, kind="stable")
        turns = np.diff(pulses.turns[order])
    seconds = np.diff(time) * 1e-9
    good = seconds > 0.0
    rate = 2.0 * np.pi * turns[good] / seconds[good]
    offset = rotor.starting_speed if isinstance(rotor, Cup) else 0.0
    middle = time[:-1][good] + np.diff(time)[good] // 2
    speed = rotor.calibration_distance * rate + offset
    if rotor.pulses.meaning == "value":
        speed = np.where(rate == 0.0, 0.0, speed)
    return middle, speed


def speed_figure(recording: Recording, estimates: Estimates | None) -> Figure | None:
    """Wind speed over time: whole recording and a minute of it."""
    lines: list[tuple[str, TimeArray, FloatArray, str]] = []
    for index, (name, pulses) in enumerate(recording.pulses.items()):
        rotor = recording.station.instrument(name)
        if isinstance(rotor, (Cup, Propeller)) and len(pulses.time) > 2:
            time, speed = rotor_speed(rotor, pulses)
            colour = style.SERIES[(index + 1) % len(style.SERIES)]
            lines.append((name, time, speed, colour))
    if recording.reference is not None:
        winds = recording.reference
        speed = np.hypot(winds.velocity[:, 0], winds.velocity[:, 1])
        lines.insert(0, ("reference", winds.time, speed, style.REFERENCE))
    if not lines and estimates is None:
        return None
    made, axes = style.figure(2)
    apparent = recording.station.platform is not None
    for panel, span in zip(axes, _spans(recording, [time for _, time, _, _ in lines]), strict=True):
        step = _step(span)
        for label, time, value, colour in lines:
            seconds = _since(recording, time)
            x, y = _thinned(seconds, value, span, step)
            if _is_sampled(recording, label):
                x, y = _with_gaps(x, y, seconds, step)
            faint = label == "reference"
            panel.plot(x, y, color=colour, lw=1.0 if faint else 1.2, label=label)
        if estimates is not None:
            _speed_band(panel, recording, estimates, span, step)
        panel.set_ylabel("speed [m/s]")
        panel.set_ylim(bottom=0.0)
        _time_axis(recording, panel, span)
    of_rotors = " (rotors by their calibration alone)"
    if apparent:
        of_rotors = " (rotors by their calibration alone, relative to the moving platform)"
    _finish(made, axes, "Wind speed" + (of_rotors if recording.pulses else ""))
    return made


def _is_sampled(recording: Recording, label: str) -> bool:
    """Whether silence is a gap in a line's source; between edges it is a slow rotor."""
    pulses = recording.pulses.get(label)
    return pulses is None or pulses.turns is not None


def direction_figure(recording: Recording, estimates: Estimates | None) -> Figure | None:
    """Direction the wind comes from over time; a vane on a platform is turned by its attitude."""
    lines: list[tuple[str, TimeArray, FloatArray, str]] = []
    if recording.reference is not None:
        winds = recording.reference
        degrees = direction_from_deg(winds.velocity)
        lines.append(("reference", winds.time, degrees, style.REFERENCE))
    for index, (name, angles) in enumerate(recording.angles.items()):
        if name.endswith("/elevation") or not len(angles.time):
            continue
        heading = angles.angle + _sensor_heading(recording, angles.time)
        degrees = compass_from_yaw(heading)
        colour = style.SERIES[(index + 1) % len(style.SERIES)]
        lines.append((name, angles.time, degrees, colour))
    if estimates is not None:
        degrees = direction_from_deg(estimates.velocity)
        lines.append(("corrected", estimates.time, degrees, style.CORRECTED))
    if not lines:
        return None
    middle = _circular_mean(lines[0][2])
    made, axes = style.figure(2)
    for panel, span in zip(axes, _spans(recording, [time for _, time, _, _ in lines]), strict=True):
        step = _step(span)
        for label, time, value, colour in lines:
            seconds = _since(recording, time)
            x, north = _thinned(seconds, np.cos(np.radians(value)), span, step)
            _, east = _thinned(seconds, np.sin(np.radians(value)), span, step)
            degrees = np.degrees(np.arctan2(east, north))
            around = middle + np.mod(degrees - middle + 180.0, 360.0) - 180.0
            if step > 1.0 and panel is axes[0]:
                panel.plot(x, around, ".", color=colour, ms=2.0, label=label)
                continue
            x, around = _with_gaps(x, around, seconds, step)
            # A direction that passes the end of the axis comes in at the other one.
            around[1:][np.abs(np.diff(around)) > 180.0] = np.nan
            panel.plot(x, around, color=colour, lw=1.0, label=label)
        panel.yaxis.set_major_formatter(lambda degrees, _: f"{degrees % 360.0:.0f}\N{DEGREE SIGN}")
        panel.set_ylabel("from, clockwise from north")
        _time_axis(recording, panel, span)
    _finish(made, axes, "Direction the wind comes from (vanes as read)")
    return made


def spectra_figure(recording: Recording, estimates: Estimates | None) -> Figure | None:
    """Frequency times spectral density of the speed, with the inertial subrange's slope."""
    series: list[tuple[str, TimeArray, FloatArray, str]] = []
    if recording.reference is not None:
        winds = recording.reference
        speed = np.hypot(winds.velocity[:, 0], winds.velocity[:, 1])
        series.append(("reference", winds.time, speed, style.REFERENCE))
    for index, (name, pulses) in enumerate(recording.pulses.items()):
        rotor = recording.station.instrument(name)
        if isinstance(rotor, (Cup, Propeller)) and len(pulses.time) > 100:
            colour = style.SERIES[(index + 1) % len(style.SERIES)]
            series.append((name, *rotor_speed(rotor, pulses), colour))
    if estimates is not None:
        speed = np.hypot(estimates.velocity[:, 0], estimates.velocity[:, 1])
        series.append(("corrected", estimates.time, speed, style.CORRECTED))
    made, (panel,) = style.figure(1, 4.4)
    drawn = 0
    top, ends = 0.0, [np.inf, 0.0]
    for label, time, value, colour in series:
        if len(time) < 64 or int(time[-1]) - int(time[0]) < 60_000_000_000:
            continue
        interval = max(1.0 / _RATE, float(np.median(np.diff(time))) * 1e-9)
        frequency, density = _spectrum(time, value, interval)
        panel.loglog(frequency, frequency * density, color=colour, label=label)
        top = max(top, float(np.max(frequency * density)))
        ends = [min(ends[0], float(frequency[0])), max(ends[1], float(frequency[-1]))]
        drawn += 1
    if not drawn:
        return None
    line = np.clip(np.asarray(_SLOPE_SPAN), ends[0], ends[1])
    if line[1] > 4.0 * line[0]:
        level = 1.6 * top * (line / line[0]) ** (-2.0 / 3.0)
        panel.loglog(line, level, color=style.MUTED, ls="--", lw=1.0)
        panel.annotate("slope -2/3", np.exp(np.log((line, level)).mean(axis=1)), (4, 5),
                       color=style.MUTED, textcoords="offset points")
    panel.set_ylim(top * 1e-4, top * 3.0)
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("frequency x spectral density [m\u00b2/s\u00b2]")
    panel.set_title("Spectra of the speed")
    panel.legend(loc="lower left")
    return made


def phase_figure(recording: Recording) -> Figure | None:
    """Duration of each slot of the rotor relative to its own revolution."""
    rotors: list[tuple[str, Cup | Propeller, Pulses]] = []
    for name, pulses in recording.pulses.items():
        rotor = recording.station.instrument(name)
        if not isinstance(rotor, (Cup, Propeller)) or rotor.pulses_per_revolution < 2:
            continue
        if pulses.turns is None and len(pulses.time) > 200:
            rotors.append((name, rotor, pulses))
    if not rotors:
        return None
    made, axes = style.figure(len(rotors), 3.0)
    for panel, (name, rotor, pulses) in zip(axes, rotors, strict=True):
        slots, mean, error = slot_durations(pulses, rotor.pulses_per_revolution)
        panel.axhline(0.0, color=style.MUTED, lw=1.0)
        panel.errorbar(slots + 1, 100.0 * mean, 100.0 * _NINETY_PERCENT * error, fmt="o",
                       color=style.CORRECTED, ms=5, capsize=3)
        panel.set_xticks(slots + 1)
        panel.set_xlabel("slot of the turn")
        panel.set_ylabel("longer than average [%]")
        panel.set_title(f"{name}: slot by slot, with 90 % intervals")
        reach = max(1.0, 1.3 * float(np.max(np.abs(100.0 * mean) + 100.0 * 2.0 * error)))
        panel.set_ylim(-reach, reach)
    return made


def slot_durations(
    pulses: Pulses, pulses_per_revolution: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How much longer each slot lasts than the average of the turn around it.

    Returns:
        Slot numbers, mean relative excess and its standard error, shape (slots,) each. The first
        slot is the one that the first edge opens; a lost edge shifts the numbers from there on.
    """
    count = pulses_per_revolution
    duration = np.diff(np.sort(pulses.time)).astype(np.float64) * 1e-9
    turn = np.convolve(duration, np.ones(count), mode="valid") / count
    first = (count - 1) // 2
    inside = duration[first : first + len(turn)]
    usable = turn > 0.0
    excess = np.where(usable, inside / np.where(usable, turn, 1.0) - 1.0, 0.0)
    slot = (np.arange(len(turn)) + first) % count
    calm = usable & (np.abs(excess) < 0.5)
    mean, error = np.zeros(count), np.zeros(count)
    for number in range(count):
        mine = excess[calm & (slot == number)]
        if len(mine) > 1:
            mean[number] = mine.mean()
            error[number] = mine.std(ddof=1) / np.sqrt(len(mine))
    return np.arange(count, dtype=np.float64), mean, error


FIGURES: dict[str, Callable[[Recording, Estimates | None], Figure | None]] = {
    "speed": speed_figure,
    "direction": direction_figure,
    "spectra": spectra_figure,
    "phase": lambda recording, estimates: phase_figure(recording),
}
"""Every figure by name."""


def draw(name: str, recording: Recording, estimates: Estimates | None) -> Figure | None:
    """One of `FIGURES`; None where the recording has nothing for it."""
    with style.house():
        return FIGURES[name](recording, estimates)


def _sensor_heading(recording: Recording, time: TimeArray) -> FloatArray | float:
    """Heading of the sensor's x axis, counter-clockwise from east [rad]."""
    if recording.platform is None:
        return float(np.radians(recording.station.sensor_heading_deg))
    states = recording.platform
    yaw = np.unwrap(heading_of(states.attitude))
    return np.interp(time - recording.start, states.time - recording.start, yaw)


def _since(recording: Recording, time: TimeArray) -> FloatArray:
    """Seconds since the start of the recording."""
    return np.asarray((time - recording.start) * 1e-9, dtype=np.float64)


def _spans(recording: Recording, times: list[TimeArray]) -> list[tuple[float, float]]:
    """The whole recording and a part in its middle that holds enough of the samples [s]."""
    length = (recording.stop - recording.start) * 1e-9
    between = [float(np.median(np.diff(time))) * 1e-9 for time in times if len(time) > 1]
    wanted = max(_ZOOM, _ZOOM_SAMPLES * max(between, default=0.0))
    zoom = next((span for span in _ROUND_SPANS if span >= wanted), _ROUND_SPANS[-1])
    start = max(0.5 * (length - zoom), 0.0)
    return [(0.0, length), (start, min(start + zoom, length))]


def _step(span: tuple[float, float]) -> float:
    """Over how long means are drawn [s]; 0: samples are."""
    length = span[1] - span[0]
    if length <= 5.0 * _ZOOM:
        return 0.0
    return next(
        (s for s in (1.0, 10.0, *_ROUND_SPANS) if length <= _MOST_POINTS * s), _ROUND_SPANS[-1]
    )


def _with_gaps(
    x: FloatArray, y: FloatArray, seconds: FloatArray, step: float
) -> tuple[FloatArray, FloatArray]:
    """A line that is open where its source was silent.

    Args:
        x, y: What is drawn.
        seconds: Times of all the samples of the source [s].
        step: Over how long means are drawn [s].
    """
    if len(seconds) < 3:
        return x, y
    usual = float(np.quantile(np.diff(np.sort(seconds)), 0.99))
    open_at = np.flatnonzero(np.diff(x) > _GAP * max(usual, step)) + 1
    return np.insert(x, open_at, x[open_at - 1]), np.insert(y, open_at, np.nan)


def _time_axis(recording: Recording, panel: Axes, span: tuple[float, float]) -> None:
    """Limits and label of an axis whose data are in seconds, in a unit that fits its length."""
    unit, name = next((u, n) for least, u, n in _UNITS if span[1] - span[0] >= least)
    panel.set_xlim(span)
    since = "the start"
    if unit != 1.0:
        since = date_text(recording.start)
        panel.xaxis.set_major_locator(_InUnits(unit))
        panel.xaxis.set_major_formatter(lambda seconds, _: f"{seconds / unit:g}")
    panel.set_xlabel(f"time since {since} [{name}]")


class _InUnits(MaxNLocator):
    """Ticks at round numbers of a unit [s]."""

    def __init__(self, unit: float) -> None:
        super().__init__(nbins=9, steps=[1, 2, 3, 5, 6, 10])
        self._unit = unit

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        ticks = super().tick_values(vmin / self._unit, vmax / self._unit)
        return [float(tick) * self._unit for tick in ticks]


def _thinned(
    x: FloatArray, y: FloatArray, span: tuple[float, float], step: float
) -> tuple[FloatArray, FloatArray]:
    """The part in the span; with a step, means over it."""
    inside = (x >= span[0]) & (x <= span[1])
    x, y = x[inside], y[inside]
    if step <= 0.0 or len(x) < 2:
        return x, y
    bins = ((x - span[0]) / step).astype(np.int64)
    count = np.bincount(bins)
    used = count > 0
    middle = np.asarray(span[0] + (np.flatnonzero(used) + 0.5) * step, dtype=np.float64)
    return middle, np.bincount(bins, weights=y)[used] / count[used]


def _speed_band(
    panel: Axes,
    recording: Recording,
    estimates: Estimates,
    span: tuple[float, float],
    step: float,
) -> None:
    speed = np.hypot(estimates.velocity[:, 0], estimates.velocity[:, 1])
    safe = np.maximum(speed, 1e-6)
    unit = estimates.velocity[:, :2] / safe[:, None]
    deviation = np.sqrt(np.sum(unit**2 * estimates.variance[:, :2], axis=1))
    seconds = _since(recording, estimates.time)
    x, middle = _thinned(seconds, speed, span, step)
    panel.plot(
        *_with_gaps(x, middle, seconds, step), color=style.CORRECTED, label="corrected"
    )
    if step <= 0.0:
        _, half = _thinned(seconds, _NINETY_PERCENT * deviation, span, step)
        at, low = _with_gaps(x, middle - half, seconds, step)
        _, high = _with_gaps(x, middle + half, seconds, step)
        panel.fill_between(at, low, high, color=style.CORRECTED, alpha=0.2, lw=0,
                           label="90 % interval")


def _finish(made: Figure, axes: list[Axes], title: str) -> None:
    low, high = axes[0].get_xlim()
    means = [
        w for s, w in zip(_ROUND_SPANS, _SPAN_WORDS, strict=True) if s == _step((low, high))
    ]
    axes[0].set_title(title + (f", means over {means[0]}" if means else ""))
    low, high = axes[1].get_xlim()
    shown = [w for s, w in zip(_ROUND_SPANS, _SPAN_WORDS, strict=True) if np.isclose(s, high - low)]
    part = f"{shown[0]} of it" if shown else ""
    axes[1].set_title(part, fontsize=9.5, fontweight="normal")
    handles, labels = axes[1].get_legend_handles_labels()
    column = _HANDLE + _CHARACTER * max(len(label) for label in labels)
    rows = math.ceil(len(labels) / max(1, int(made.get_figwidth() / column)))
    columns = math.ceil(len(labels) / rows)
    legend = made.legend(handles, labels, loc="outside lower center", ncols=columns)
    for line in legend.get_lines():
        line.set_markersize(8.0)


def _spectrum(time: TimeArray, value: FloatArray, interval: float) -> tuple[FloatArray, FloatArray]:
    """Welch spectrum, averaged in bins of equal width on the logarithmic axis."""
    seconds = (time - time[0]) * 1e-9
    grid = np.arange(0.0, seconds[-1], interval)
    order = np.argsort(seconds, kind="stable")
    even = np.interp(grid, seconds[order], value[order])
    segment = int(min(len(even), max(256, len(even) // 4)))
    frequency, density = welch(even, 1.0 / interval, nperseg=segment)
    frequency, density = frequency[1:], density[1:]
    bins = np.floor(np.log10(frequency / frequency[0]) * 12.0).astype(np.int64)
    count = np.bincount(bins)
    used = count > 0
    smooth = [np.bincount(bins, weights=part)[used] / count[used] for part in (frequency, density)]
    return smooth[0], smooth[1]


def _circular_mean(degrees: FloatArray) -> float:
    radians = np.radians(degrees[np.isfinite(degrees)])
    return float(np.degrees(np.arctan2(np.sin(radians).mean(), np.cos(radians).mean())))
