"""Starting points that a vane's readings give away: steps, gaps, repeats."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.explaining.intervals import interval_of
from wind_sensors.diagnosis.explaining.terms import Term, suggested
from wind_sensors.station.model import Angle
from wind_sensors.station.signals import BoolArray, between_jumps

FloatArray = npt.NDArray[np.float64]

LONGEST_REPEAT = 4.0
"""A vane that repeats one reading for longer [s] in a wind that turns it is taken to be stuck."""

SAME_VALUE = 1e-3
"""Readings so close to each other are the same [deg]."""

NARROWEST_HOLE = 3
"""A hole in a vane's readings is at least so wide [deg]: a degree or two stay empty by chance."""

WIDEST_HOLE = 60
"""And no wider [deg]: in more the wind may not have blown."""

EMPTY = 0.03
"""No degree of a hole has this share of the readings that usual degrees have."""

BESIDE_HOLE = 20
"""A hole lies between so many degrees on either side in which the vane often stands: what has none
on one side is where the wind did not blow from."""

LEAST_BESIDE_HOLE = 0.015
"""These degrees hold this share of all readings, on either side: a quarter of what they would if
the vane stood everywhere alike."""

MANY_BESIDE_EDGE = 3
"""A degree beside a gap with a floating wiper has so many readings more than degrees inside have by
chance."""

RARELY = 4.0
"""And so many standard deviations of chance more."""

BESIDE_EDGE = 3.0
"""So many degrees beside a gap tell how often the vane stands there: farther away it may be another
wind."""

LEAST_BESIDE_EDGE = 15
"""Readings in these degrees, more than chance brings, from which on they tell to
`Parameter.told_to` where the gap begins."""

TELLING_SHARE = 0.004
"""Share of a vane's readings from which on erratic ones suggest a gap with a floating wiper, equal
ones a gap that reads one value."""

NARROWER = (1.0, 0.65, 0.4)
"""Widths to begin with, in widths of the sector where the nose should have been: the reference
does not tell that within some degrees."""

REPEATED = 6.0
"""A reading repeats itself if it comes so many times as often as readings do on average."""

LEAST_REPEATS = 20
"""And so often at least: of fewer, chance or a lull makes some equal."""

FEWEST_STEPS = 3
"""Readings are coarse where so many different ones repeat themselves: with two there is no telling
steps from stops."""

SMOOTHED_READINGS = 101
"""And most of so many readings in a row do."""

SHORTEST_COARSE = 60.0
"""For so long [s]: what is shorter no effect is told by."""

ON_STEPS = 0.9
"""They lie on steps: the mean vector of their remainders is longer, 1 being exactly on them."""

ON_A_STEP = 0.01
"""A single one is on a step if it lies within so much [deg] of it: digits are lost on the way."""

WIDEST_STEP = 45.0
"""Steps are narrower [deg]: on eight points of the compass any few readings lie."""

FEWEST_VISITS = 2.0
"""The vane comes to each of them so often on average: one that sticks stands where it happened
to."""


def vane_guesses(comparison: Comparison, channel: Channel, vane: Angle) -> list[Term]:
    """Effects that the readings of a vane suggest, with starting values.

    Args:
        comparison: The recording.
        channel: The vane's.
        vane: Gives the readings.
    """
    return [
        *_floating(comparison, channel),
        *_reading_guesses(comparison, channel),
        *_repeats(comparison, vane),
    ]


def _repeats(comparison: Comparison, vane: Angle) -> list[Term]:
    """The longest time in which a vane repeats one reading, if it is unusual."""
    readings = comparison.recording.angles[vane.name]
    told = np.isfinite(readings.angle)
    time, angle = comparison.grid.seconds(readings.time[told]), readings.angle[told]
    if time.size < 50:
        return []
    changed = np.flatnonzero(np.abs(np.diff(angle)) > 1e-9) + 1
    starts = np.concatenate(([0], changed))
    stops = np.concatenate((changed, [time.size])) - 1
    lasting = time[stops] - time[starts]
    longest = int(np.argmax(lasting))
    others = np.delete(lasting, longest)
    usual = float(np.quantile(others, 0.98)) if others.size else 0.0
    if lasting[longest] < max(LONGEST_REPEAT, 4.0 * usual):
        return []
    since = comparison.drive.elapsed
    begin, end = float(time[starts[longest]]) + since, float(time[stops[longest]]) + since
    return [
        suggested(
            "stuck_sensor", vane.name,
            # Nothing says that it moved before the first reading or moves after the last one.
            start=begin if starts[longest] > 0 else -1.0,
            stop=end if stops[longest] < time.size - 1 else end + 1.0,
            reading=float(np.degrees(angle[starts[longest]])), known=1.0,
        )
    ]


def _reading_guesses(comparison: Comparison, channel: Channel) -> list[Term]:
    vane = channel.instrument
    delivered = comparison.recording.angles[vane].angle
    readings = delivered[np.isfinite(delivered)]
    if readings.size < 200:
        return []
    out = []
    degrees = np.degrees(readings)
    values, counts = np.unique(np.round(degrees, 4), return_counts=True)
    steps = np.diff(values)
    steps = steps[steps > 0.02]
    if values.size < 0.25 * readings.size and steps.size > 1:
        step = float(np.median(steps[steps < 1.5 * np.quantile(steps, 0.2) + 1e-9]))
        coarse = np.sum(counts) / values.size > 8.0 and step > 0.3
        if coarse and _are_steps(values, step):
            turns = np.exp(2j * np.pi * values / step)
            origin = float(np.angle(np.mean(turns))) * step / (2.0 * np.pi)
            out.append(suggested("quantisation", vane, step=step, origin=origin))
    if not out:
        out.extend(_coarse_for_a_while(comparison, vane))
    common = values[counts > max(TELLING_SHARE * readings.size, LEAST_REPEATS)]
    hole = hole_between(degrees)
    if hole is not None:
        out.append(_gap(vane, *hole))
    at_one = comparison.recording.angles[vane].at_one_number > 0.0
    if at_one.any() and not 1 <= common.size <= 3:
        # A converter's noise spreads the number.
        common = np.median(np.degrees(delivered[at_one]), keepdims=True)
    if 1 <= common.size <= 3:
        low, high = float(common.min()), float(common.max())
        if common.size == 1:
            beside = [(low + 5.0 * side, 10.0) for side in (-1.0, 1.0)]
            there = at_one | (np.abs(np.degrees(delivered) - low) < SAME_VALUE)
            told = _told_gap(comparison, channel, there, reading=low)
            if told:
                return [*(t for t in out if t.effect.name != "potentiometer_gap"), *told]
            sectors = [_sector(comparison, channel, there), *([hole] if hole else beside)]
            out.extend(_gap(vane, *sector, 1, low) for sector in sectors)
            out.extend(_gap(vane, *sector) for sector in sectors)
        else:
            width = high - low
            centre = 0.5 * (low + high)
            if width > 180.0:
                width, centre = 360.0 - width, centre + 180.0
            if width < 90.0:
                out.append(_gap(vane, centre, width))
    return out


def _told_gap(
    comparison: Comparison,
    channel: Channel,
    there: BoolArray,
    by_chance: float = 0.0,
    reading: float | None = None,
) -> list[Term]:
    """A gap in which the vane reads something else, for as long as it reads nothing in it.

    Args:
        comparison: The recording.
        channel: The vane's.
        there: Readings that are made in the gap, shape (n,).
        by_chance: Number of readings to a degree that only seem to be made outside.
        reading: What the vane reads there [deg]; None: anything.

    Returns:
        Nothing where none is made in it, or the readings beside it are too few in that time to tell
        its edges.
    """
    vane = channel.instrument
    readings = comparison.recording.angles[vane]
    degrees, time = np.degrees(readings.angle), comparison.grid.seconds(readings.time)
    other = np.isfinite(degrees) & ~there
    (inside,) = np.nonzero(there)
    if inside.size == 0:
        return []
    begin, end = inside[0], inside[-1]
    nose = np.degrees(headings(comparison, channel))[there]
    sector = _around(degrees[begin : end + 1][other[begin : end + 1]], nose, by_chance)
    if sector is None:
        return []
    centre, width = sector
    away = np.mod(degrees - centre + 180.0, 360.0) - 180.0
    (good,) = np.nonzero(other & (np.abs(away) < 0.5 * width - 1.0))
    begins = float(time[begin]) if np.any(good < begin) else 0.0
    ends = float(time[end]) if np.any(good > end) else np.inf
    if reading is None:
        gap = replace(_gap(vane, *sector, 2), held=frozenset({"centre", "width"}))
    else:
        gap = _gap(vane, *sector, 1, reading)
        gap = replace(gap, held=frozenset({"centre", "width", "reading"}))
    return [replace(gap, interval=interval_of(comparison, begins, ends))]


def _coarse_for_a_while(comparison: Comparison, vane: str) -> list[Term]:
    """Quantisation in the longest part of the record in which readings repeat a few values."""
    readings = comparison.recording.angles[vane]
    told = np.isfinite(readings.angle)
    degrees = np.round(np.degrees(readings.angle[told]), 4)
    time = comparison.grid.seconds(readings.time[told])
    values, place, counts = np.unique(degrees, return_inverse=True, return_counts=True)
    repeated = counts > max(REPEATED * degrees.size / values.size, LEAST_REPEATS)
    if np.count_nonzero(repeated) < FEWEST_STEPS:
        return []
    # A wiper that floats in a gap interrupts no steps.
    steady = ~readings.erratic[told]
    degrees, time, coarse = degrees[steady], time[steady], repeated[place][steady]
    begin, end = _longest_run(coarse)
    inside = np.unique(degrees[begin:end][coarse[begin:end]])
    if inside.size < FEWEST_STEPS or time[end - 1] - time[begin] < SHORTEST_COARSE:
        return []
    step = float(np.median(np.diff(inside)))
    visits = np.count_nonzero(np.diff(degrees[begin:end])) + 1
    if not _are_steps(inside, step) or visits < FEWEST_VISITS * inside.size:
        return []
    turns = np.exp(2j * np.pi * inside / step)
    origin = float(np.angle(np.mean(turns))) * step / (2.0 * np.pi)
    # Headings that the vane seldom has repeat seldom, but lie on steps like the others.
    beside = np.mod(degrees - origin + 0.5 * step, step) - 0.5 * step
    begin, end = _longest_run(np.abs(beside) < ON_A_STEP)
    holds = interval_of(comparison, float(time[begin]), float(time[end - 1]))
    return [replace(suggested("quantisation", vane, step=step, origin=origin), interval=holds)]


def _longest_run(holds: BoolArray) -> tuple[int, int]:
    """Beginning and end of the longest stretch of readings of which most are so; (0, 0): none."""
    usual = uniform_filter1d(holds.astype(np.float64), SMOOTHED_READINGS) > 0.5
    edges = np.flatnonzero(np.diff(np.concatenate(([False], usual, [False])).astype(np.int8)))
    runs = [(0, 0), *zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)]
    return max(runs, key=lambda run: run[1] - run[0])


def _are_steps(values: npt.NDArray[np.floating[Any]], step: float) -> bool:
    """Whether values [deg] are so many steps apart, and not where a vane happened to stick."""
    on_steps = np.abs(np.mean(np.exp(2j * np.pi * values / step)))
    return bool(on_steps > ON_STEPS and step < WIDEST_STEP)


def _gap(
    vane: str, centre: float, width: float, form: int = 0, reading: float = 0.0
) -> Term:
    return suggested(
        "potentiometer_gap", vane, centre=centre, width=width, reading=reading, form=float(form)
    )


def _floating(comparison: Comparison, channel: Channel) -> list[Term]:
    """A gap where readings jump about, in the sector in which they do."""
    wrong = comparison.recording.angles[channel.instrument].erratic
    if not wrong.any() or np.mean(wrong) < TELLING_SHARE:
        return []
    vane = channel.instrument
    centre, width = _sector(comparison, channel, wrong)
    loose = between_jumps(comparison.recording.angles[vane])
    # As often as a step is no jump, the first and the last number of a visit lie that close to the
    # truth, on either side: of each visit 1/180 to a degree, however large a jump has to be.
    by_chance = np.count_nonzero(np.diff(loose.astype(np.int8)) > 0) / 180.0
    told = _told_gap(comparison, channel, loose, by_chance)
    if told:
        return told
    sectors = [(centre, share * width) for share in NARROWER]
    return [
        _gap(vane, *sector, 2)
        for sector in (*_mostly(comparison, channel, wrong, centre), *sectors)
    ]


def _around(
    degrees: FloatArray, inside: FloatArray, by_chance: float
) -> tuple[float, float] | None:
    """Centre and width of the sector without good readings [deg].

    Args:
        degrees: Good readings.
        inside: Where the nose should have been at those in the sector, within some degrees.
        by_chance: Number of readings to a degree that only seem good.

    Returns:
        None: there are not many readings on either side.
    """
    least = MANY_BESIDE_EDGE + by_chance + RARELY * np.sqrt(by_chance)
    counts, _ = np.histogram(np.mod(degrees, 360.0), np.arange(361.0))
    if not np.any(counts >= least):
        return None
    first = int(np.argmax(counts >= least))
    few = np.append(np.roll(counts, -first) < least, False)
    edges = np.diff(few.astype(np.int8))
    begins, ends = np.flatnonzero(edges > 0) + 1, np.flatnonzero(edges < 0) + 1
    expected, _ = np.histogram(np.mod(inside - first, 360.0), np.arange(361.0))
    held = [int(np.sum(expected[begin:end])) for begin, end in zip(begins, ends, strict=True)]
    if not any(held):
        return None
    begin, end = begins[np.argmax(held)], ends[np.argmax(held)]
    away = np.mod(degrees - first, 360.0)
    before, after = begin - away, np.mod(away - end + 180.0, 360.0) - 180.0
    for beside in (before, after):
        near = np.count_nonzero((beside >= 0.0) & (beside < BESIDE_EDGE))
        if near < LEAST_BESIDE_EDGE + BESIDE_EDGE * by_chance:
            return None
    low, high = begin - _edge(before, by_chance), end + _edge(after, by_chance)
    if high - low > WIDEST_HOLE:
        return None
    return float((first + 0.5 * (low + high)) % 360.0), float(high - low)


def _edge(away: FloatArray, by_chance: float) -> float:
    """The least of many values where those below are few [deg].

    Where a Poisson process changes its rate, by maximum likelihood.

    Args:
        away: Values, the degree from 0 on has many.
        by_chance: Number of those to a degree that are few.
    """
    near = np.sort(away[(away >= -1.0) & (away < BESIDE_EDGE)])
    few = max(by_chance, 0.5)
    before = np.arange(near.size)
    many = near.size - before
    among = np.maximum(BESIDE_EDGE - near, 1e-3)
    likely = before * np.log(few) - few * (near + 1.0) + many * np.log(many / among) - many
    return float(near[np.argmax(np.where(near < 1.0, likely, -np.inf))])


def _mostly(
    comparison: Comparison, channel: Channel, where: BoolArray, inside: float
) -> list[tuple[float, float]]:
    """Centre and width of the sector in which some readings outnumber others [deg]."""
    away = np.degrees(headings(comparison, channel)) - inside
    away = np.mod(away + 180.0, 360.0) - 180.0
    bins = np.arange(-180.0, 181.0)
    some, _ = np.histogram(away[where], bins)
    every, _ = np.histogram(away, bins)
    most = 2 * some > every
    if not most[180]:
        return []
    # No reading says nothing of a degree; the last ones that speak for the sector bound it.
    others = np.flatnonzero((every > 0) & ~most)
    low, high = others[others < 180].max(initial=-1) + 1, others[others > 180].min(initial=360)
    spoken = low + np.flatnonzero(most[low:high])
    low, high = int(spoken[0]), int(spoken[-1]) + 1
    return [(inside + 0.5 * (low + high) - 180.0, float(high - low))]


def headings(comparison: Comparison, channel: Channel) -> FloatArray:
    """Where the nose should be at each reading [rad]."""
    time = comparison.recording.angles[channel.instrument].time
    heading = comparison.direction + comparison.expected.get(channel.name, 0.0)
    return np.interp(comparison.grid.seconds(time), comparison.grid.centres, heading)


def _sector(comparison: Comparison, channel: Channel, where: BoolArray) -> tuple[float, float]:
    """Centre and width of the sector in which the nose should be at some readings [deg]."""
    at = headings(comparison, channel)[where]
    centre = float(np.angle(np.mean(np.exp(1j * at))))
    away = np.angle(np.exp(1j * (at - centre)))
    low, middle, high = np.degrees(np.quantile(away, (0.1, 0.5, 0.9)))
    return float(np.degrees(centre) + middle), float(np.clip(high - low, 3.0, 90.0))


def hole_between(degrees: FloatArray) -> tuple[float, float] | None:
    """Centre and width of a sector without readings between sectors with many [deg]."""
    if degrees.size == 0:
        return None
    counts, _ = np.histogram(np.mod(degrees, 360.0), bins=360, range=(0.0, 360.0))
    # A reading that comes again and again is no wind.
    usual = np.median(counts[counts > 0])
    counts = np.minimum(counts, 5.0 * usual)
    least = LEAST_BESIDE_HOLE * np.sum(counts)
    round_twice = np.concatenate((counts, counts))
    edges = np.diff(np.concatenate(([False], round_twice < EMPTY * usual, [False])).astype(int))
    found: tuple[float, float] | None = None
    for begin, end in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
        beside = (np.arange(begin - BESIDE_HOLE, begin), np.arange(end, end + BESIDE_HOLE))
        peopled = all(np.sum(counts[np.mod(at, 360)]) > least for at in beside)
        if peopled and NARROWEST_HOLE <= end - begin <= WIDEST_HOLE:
            away = np.mod(degrees - 0.5 * (begin + end) + 180.0, 360.0) - 180.0
            # Readings in whole degrees lie on the borders of bins, but for their last digits.
            half = 0.5 * (end - begin) - SAME_VALUE
            low, high = float(away[away < -half].max()), float(away[away >= half].min())
            if not found or high - low > found[1]:
                found = float((0.5 * (begin + end + low + high)) % 360.0), high - low
    return found
