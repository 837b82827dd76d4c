"""Intervals of pulses: lost and doubled edges, uneven slots, beats with the wind."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter, uniform_filter1d

from wind_sensors.compiled import compiled
from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.station.model import Cup, Propeller
from wind_sensors.station.signals import Pulses

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

INTERVALS = 6
"""Number of statistics of the pulse intervals."""

LONG = 1.6
SHORT = 0.4
"""Intervals over and under so many times their neighbourhood's mean are long and short."""

NEIGHBOURS = 10
BETWEEN = 1.3
PERHAPS_BETWEEN = 1.7
PERHAPS_LOST = 1.25
USUAL = 0.6
"""Of so many intervals and more around, the median is what usually lies between two edges. Two
intervals that together make less than `BETWEEN` of it are one with a bounce in it; less than
`USUAL` beside a long one belongs to a slot in the wrong place. The median is asked for where the
mean says that two intervals may be one, or that one may be several."""

BOUNCES = 0.003
FEWEST_TO_TELL = 200
"""A contact bounces if this share of so many edges or more lies between two a slot apart."""

MADE_UP_FOR = 0.5
LONGEST_WAIT = 5.0
"""But not if for this share of those that lie too close or more edges are missing elsewhere, in
gaps of no more than so many seconds."""

MISSED_TOGETHER = 3
"""No more pulses in a row are put back: where more are missing the rotor may have stood still."""

MOST_PUT_BACK = 0.07
"""Of more missing edges some hide each other."""

BURST_SECONDS = 1.0
BURST_NEIGHBOURS = 61
FEWEST_IN_BURSTS = 30
"""Bounces are counted in so many seconds and compared with as many such counts around; fewer in all
tell nothing."""

LOST_TURNS = 10.0
"""In a silence of so many turns, as they are before and after it, nobody counts slots."""

MOST_READ = 200_000
BLOCK_TURNS = 64
"""Of more edges only some are read, in blocks of so many turns evenly over the record: they tell as
much as chance lets all of them tell."""

HARDLY_ACROSS = 0.05
"""A wind across the shaft of no more than this share of the slow wind shows no unequal blades."""

SLOW_TURN = 2.5
"""A rotor that takes so many times longer for its turns than the wind asks for is about to stop:
its intervals tell of the wind that it stops in."""


def interval_statistics(
    pulses: Pulses,
    rotor: Cup | Propeller,
    across: ComplexArray,
    speed: FloatArray,
    grid: Grid,
    mask: FloatArray | None = None,
) -> FloatArray:
    """How the pulse intervals are distributed within a revolution, whatever the wind.

    Args:
        pulses: Edges.
        rotor: The rotor.
        across: Wind in the plane of rotation at the bins' centres, relative to the slow wind, as a
            complex number.
        speed: Slow wind speed at the bins [m/s]; what turns far slower does not count.
        grid: Bins of both.
        mask: Weight of the bins; intervals where it is below a half do not count.

    Returns:
        Share of intervals over 1.6 and under 0.4 times their neighbourhood's mean; of the slots'
        mean relative intervals the scatter without, and the amplitude of, the part that swings
        once per revolution; of what departs from those means the amplitudes once and twice per
        revolution locked to the wind across the shaft, if that were as strong as the slow wind,
        whichever way round the rotor turns (0 where the pulses are too few to tell).
    """
    weight = np.ones(grid.n) if mask is None else mask
    usual = 2.0 * np.pi * rotor.calibration_distance / np.maximum(speed, 0.1)
    longest = SLOW_TURN * usual / rotor.pulses_per_revolution
    return _interval_statistics(
        grid.seconds(pulses.time), rotor.pulses_per_revolution, across, longest, weight, grid.dt
    )


def without_bounces(pulses: Pulses, slots: int) -> Pulses | None:
    """Pulses without those that lie between two others that are about one slot apart.

    Args:
        pulses: Edges, each a turn of the disc by one slot.
        slots: Per turn.

    Returns:
        None: the contact does not bounce. A gust may squeeze an edge between two others, and a
        logger that stamps late, in lots, many; but then they are missing before.
    """
    if pulses.turns is not None or pulses.time.size < FEWEST_TO_TELL:
        return None
    time = np.sort(pulses.time, kind="stable")
    bounced = np.asarray(by_slot((time - time[0]) * 1e-9, slots)[1])
    if np.mean(bounced) < BOUNCES:
        return None
    kept = time[~bounced]
    interval = np.diff(kept) * 1e-9
    usual = np.maximum(median_filter(interval, NEIGHBOURS + 1), 1e-9)
    waits = (interval > LONG * usual) & (interval < LONGEST_WAIT)
    if np.sum(interval[waits] / usual[waits] - 1.0) > MADE_UP_FOR * np.count_nonzero(bounced):
        return None
    return Pulses(kept)


def with_missed(pulses: Pulses, slots: int) -> Pulses | None:
    """Pulses with those put back that are missing one by one, where they should have come.

    A missing edge came midway between those a turn before and after it, so that slots in the wrong
    places stay there, or midway between its neighbours where one of these is missing, too.

    Args:
        pulses: Edges, each a turn of the disc by one slot.
        slots: Per turn.

    Returns:
        None: nobody can tell, for the edges are few, some bounce as well, or more are missing than
        leave their neighbours in place.
    """
    if pulses.turns is not None or pulses.time.size < FEWEST_TO_TELL:
        return None
    time = np.sort(pulses.time, kind="stable")
    tracked, bounced = by_slot((time - time[0]) * 1e-9, slots)
    missed = np.isnan(tracked)
    label = np.cumsum(np.diff(missed.astype(np.int8), prepend=np.int8(0)) != 0)
    alone = np.bincount(label)[label] <= MISSED_TOGETHER
    if np.mean(bounced) > BOUNCES or np.mean(missed & alone) > MOST_PUT_BACK:
        return None
    place = np.arange(tracked.size)
    whole = np.interp(place, place[~missed], tracked[~missed])
    a_turn = 0.5 * (tracked[: -2 * slots] + tracked[2 * slots :])
    inner = slice(slots, -slots)
    whole[inner] = np.where(missed[inner] & np.isfinite(a_turn), a_turn, whole[inner])
    kept = whole[~missed | alone]
    return Pulses(time[0] + np.rint(np.maximum.accumulate(kept) * 1e9).astype(np.int64))


def bursts_of_bounces(pulses: Pulses, slots: int, begin: int, end: int) -> tuple[float, float]:
    """How much more unevenly bounces come than chance would have them.

    Args:
        pulses: Edges.
        slots: Per turn.
        begin, end: Of the time looked at [ns].

    Returns:
        Variance of the number in a second over what chance gives a contact of which so many of the
        edges around bounce (1: chance), and the variance beyond chance in squares of that number.
        (1, 0) where the edges are not known one by one, or the bounces are too few.
    """
    inside = pulses.time[(pulses.time >= begin) & (pulses.time <= end)]
    if pulses.turns is not None or inside.size < FEWEST_TO_TELL:
        return 1.0, 0.0
    seconds = np.asarray((np.sort(inside, kind="stable") - begin) * 1e-9, dtype=np.float64)
    bounced = np.asarray(by_slot(seconds, slots)[1])
    if np.count_nonzero(bounced) < FEWEST_IN_BURSTS:
        return 1.0, 0.0
    place = (seconds / BURST_SECONDS).astype(np.int64)
    true, false = np.bincount(place, ~bounced), np.bincount(place, bounced)
    around_true, around_false = (
        uniform_filter1d(counts, BURST_NEIGHBOURS, mode="nearest") for counts in (true, false)
    )
    expected = true * around_false / np.maximum(around_true, 1e-9)
    beyond = float(np.sum((false - expected) ** 2 - expected))
    return 1.0 + beyond / float(expected.sum()), beyond / float(np.sum(expected**2))


def chance_of_intervals(one: FloatArray, other: FloatArray, edges: int) -> FloatArray:
    """How far `interval_statistics` of two records may differ by which edges chance has hit.

    Of n edges of which chance doubles or drops the share p, p is known to sqrt(p (1 - p) / n), and
    an interval that is one too short or too long moves the mean of its slot by as much. Only what
    both records have is chance: intervals that one of them alone has are a difference.

    Args:
        one, other: Of the two.
        edges: Of each.

    Returns:
        Standard deviation of each difference.
    """
    hit = min(float(np.minimum(one[:2], other[:2]).sum()), 1.0)
    read = edges / _every(edges)
    deviation = math.sqrt(2.0 * hit * (1.0 - hit) / max(read, 1.0))
    return np.full(INTERVALS, deviation)


@compiled
def _every(edges: int) -> int:
    """One of so many blocks of a record's edges is read."""
    return max((edges + MOST_READ - 1) // MOST_READ, 1)


@compiled
def _interval_statistics(
    time: FloatArray,
    slots: int,
    across: ComplexArray,
    longest: FloatArray,
    weight: FloatArray,
    dt: float,
) -> FloatArray:
    out = np.zeros(INTERVALS)
    edges = time.size
    if edges < 200:
        return out
    window = max(5, 2 * (slots // 2) + 1) if slots > 1 else 5
    half = window // 2
    long = 0
    short = 0
    counted = 0
    bins_per_second = 1.0 / dt
    last_bin = weight.size - 1
    block = BLOCK_TURNS * slots
    for begin in range(window, edges - 1 - window, _every(edges) * block):
        for i in range(begin, min(begin + block, edges - 1 - window)):
            place = min(max(int(time[i] * bins_per_second), 0), last_bin)
            if weight[place] <= 0.5:
                continue
            around = time[i + half + 1] - time[i - half]
            if around > longest[place] * window:
                continue
            interval = (time[i + 1] - time[i]) * window
            counted += 1
            if interval > LONG * around:
                long += 1
            elif interval < SHORT * around:
                short += 1
    if counted < 100:
        return out
    out[0] = long / counted
    out[1] = short / counted
    if slots < 3:
        return out
    time = _without_a_silence(time, slots)
    out[2:] = _slot_statistics(time, slots, across, longest, weight, dt)
    tracked, _ = by_slot(time, slots)
    if tracked.size != time.size or np.any(np.isnan(tracked)):
        # Of two ways to number the slots, the wrong one makes them look more alike.
        other = _slot_statistics(tracked, slots, across, longest, weight, dt)
        if other[0] ** 2 + 0.5 * other[1] ** 2 > out[2] ** 2 + 0.5 * out[3] ** 2:
            out[2:] = other
    return out


@compiled
def _without_a_silence(time: FloatArray, slots: int) -> FloatArray:
    """The longest stretch of edges in which no pulses are missing for many turns.

    Nobody knows which slot goes on after a silence.

    Args:
        time: Edges [s], shape (n,).
        slots: Per turn.
    """
    begin = best_begin = best_end = 0
    last = time.size - 1
    for i in range(time.size):
        end = i == last
        if not end:
            # A rotor that comes to rest has slow turns before and after.
            gap = time[i + 1] - time[i]
            end = gap > LOST_TURNS * (time[i] - time[max(i - slots, begin)])
            if end:
                end = gap > LOST_TURNS * (time[min(i + 1 + slots, last)] - time[i + 1])
        if end and i > begin:
            if i - begin > best_end - best_begin:
                best_begin, best_end = begin, i
            begin = i + 1
    return time[best_begin : best_end + 1]


@compiled
def _usual(time: FloatArray, first: int, end: int) -> float:
    """Median of the intervals from one edge to another."""
    return max(float(np.median(np.diff(time[first : end + 1]))), 1e-9)


@compiled
def _is_usual_longer(time: FloatArray, first: int, end: int, limit: float) -> bool:
    """Whether the median of the intervals from one edge to another is longer than a limit.

    It lies on the side of most of them, and to count takes a tenth of the time to find it.
    """
    longer = 0
    for i in range(first, end):
        longer += time[i + 1] - time[i] > limit
    if 2 * longer == end - first:
        return _usual(time, first, end) > limit
    return 2 * longer > end - first


@compiled
def by_slot(time: FloatArray, slots: int) -> tuple[FloatArray, BoolArray]:
    """Edges in the order of the disc's slots: without bounces, NaN where one was missed.

    An edge between two others that are about one slot apart bounced; where two are about a whole
    number of slots apart, with usual ones before and after, the others were missed. A slot that
    sits in the wrong place makes a short interval and a long one, which are neither.

    Args:
        time: Edges [s], shape (n,).
        slots: Per turn.

    Returns:
        Times of the slots, shape (m,), and which of the edges bounced, shape (n,).
    """
    edges = time.size
    half = max(NEIGHBOURS, slots) // 2 + 1
    found = np.empty(2 * edges)
    bounced = np.zeros(edges, dtype=np.bool_)
    found[0] = time[0]
    place = 0
    last = 0
    before = 1.0
    around = min(2 * half, edges - 1)
    between, lost = PERHAPS_BETWEEN / around, PERHAPS_LOST / around
    for i in range(1, edges - 1):
        first = max(min(i - half, edges - 1 - around), 0)
        end = first + around
        several = max(time[end] - time[first], 1e-9 * around)
        step = 1
        both = time[i + 1] - time[last]
        own = time[i] - time[last]
        if both < between * several or own > lost * several:
            # A mean is wrong where several edges bounced or were missed; a median is not.
            if _is_usual_longer(time, first, end, both / BETWEEN):
                bounced[i] = True
                continue
            if not _is_usual_longer(time, first, end, own / LONG):
                usual = _usual(time, first, end)
                after = both - own
                if i + 2 < edges and time[i + 2] - time[i] < BETWEEN * usual:
                    after = time[i + 2] - time[i]
                if after > USUAL * usual and before > USUAL * usual:
                    step = round(own / usual)
        if place + step >= found.size - 1:
            break
        for missed in range(1, step):
            found[place + missed] = np.nan
        place += step
        found[place] = time[i]
        last = i
        before = own
    found[place + 1] = time[edges - 1]
    return found[: place + 2], bounced


@compiled
def _slot_statistics(
    time: FloatArray,
    slots: int,
    across: ComplexArray,
    longest: FloatArray,
    weight: FloatArray,
    dt: float,
) -> FloatArray:
    """Unevenness of the slots, and beats with the wind; NaN stands for an edge that is missing."""
    out = np.zeros(INTERVALS - 2)
    edges = time.size
    bins_per_second = 1.0 / dt
    last_bin = weight.size - 1
    # By slot: number, deviation, and both times the wind across once and twice per turn.
    number = np.zeros((slots, 5))
    total = np.zeros((slots, 5))
    squares = 0.0
    wind = np.empty((weight.size, 4))
    wind[:, 0], wind[:, 1] = across.real, across.imag
    wind[:, 2], wind[:, 3] = (across**2).real, (across**2).imag
    power = np.zeros(2)
    first = slots // 2
    kept = 0
    block = BLOCK_TURNS * slots
    for begin in range(0, edges - slots, _every(edges) * block):
        slot = (begin + first - 1) % slots
        for j in range(begin, min(begin + block, edges - slots)):
            i = j + first
            slot = 0 if slot + 1 == slots else slot + 1
            if np.isnan(time[i] + time[i + 1] + time[j] + time[j + slots]):
                continue
            place = min(max(int(time[i] * bins_per_second), 0), last_bin)
            if weight[place] <= 0.5:
                continue
            revolution = max(time[j + slots] - time[j], 1e-9)
            if revolution > longest[place] * slots:
                continue
            deviation = (time[i + 1] - time[i]) * slots / revolution - 1.0
            deviation = min(max(deviation, -0.8), 0.8)
            squares += deviation * deviation
            kept += 1
            number[slot, 0] += 1.0
            total[slot, 0] += deviation
            power[0] += wind[place, 0] ** 2 + wind[place, 1] ** 2
            power[1] += wind[place, 2] ** 2 + wind[place, 3] ** 2
            for m in range(4):
                number[slot, m + 1] += wind[place, m]
                total[slot, m + 1] += deviation * wind[place, m]
    if kept < 100:
        return out
    means = total[:, 0] / np.maximum(number[:, 0], 1.0)
    angle = 2.0 * math.pi / slots * np.arange(slots)
    slot_cos, slot_sin = np.cos(angle), np.sin(angle)
    error = max(squares / kept - np.mean(means**2), 0.0) / kept
    once = (2.0 * np.sum(means * slot_cos) / slots) ** 2
    once += (2.0 * np.sum(means * slot_sin) / slots) ** 2
    once = max(once - 4.0 * error, 0.0)
    out[0] = math.sqrt(max(np.var(means) - 0.5 * once - error * slots, 0.0))
    out[1] = math.sqrt(once)
    for m in range(2 if slots > 4 else 1):
        if m == 1:
            slot_cos, slot_sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
        # What is fixed to the disc says nothing about the wind's direction.
        x = total[:, 2 * m + 1] - means * number[:, 2 * m + 1]
        y = total[:, 2 * m + 2] - means * number[:, 2 * m + 2]
        one_way = math.hypot(
            np.sum(slot_cos * x + slot_sin * y), np.sum(slot_sin * x - slot_cos * y)
        )
        other_way = math.hypot(
            np.sum(slot_cos * x - slot_sin * y), np.sum(slot_sin * x + slot_cos * y)
        )
        out[2 + m] = 2.0 * max(one_way, other_way) / (power[m] + kept * HARDLY_ACROSS**2)
    return out
