"""What cannot be: single stamps far from all others, winds that never blew."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from wind_sensors.station.signals import FloatArray, TimeArray

Mask = npt.NDArray[np.bool_]

STRONGEST_WIND = 150.0
"""No component of a wind is larger [m/s]: the strongest gust ever measured was 113 m/s."""

FEWEST_STAMPS = 10
"""Of fewer stamps nobody knows which of them is wrong."""

LARGEST_STRAY_SHARE = 1e-3
"""One stamp, or this share of a topic's, may be strays; more are a clock that was set."""

SHORTEST_EXILE = 3_600_000_000_000
"""Strays lie this far from the rest [ns], and further than the rest is long."""


DROPPED_FROM = 3.0
"""No rotor stops from a wind like this [m/s] and is back in one ..."""

LONGEST_DROPOUT = 10_000_000_000
"""... within so long [ns]."""

COUNTER_SIZES = tuple(2**bits for bits in (8, 10, 12, 15, 16, 24, 31, 32))
"""Where counters of so many bits begin again."""


def strays(time: TimeArray) -> Mask:
    """Single stamps before or after all others, further away than those last; shape (n,).

    A driver that writes one stamp from an unset clock, or one flipped bit, would make a recording
    of a quarter of an hour one of years.

    Args:
        time: Stamps of one topic in any order [ns], shape (n,).
    """
    if time.size < FEWEST_STAMPS or int(time.max()) - int(time.min()) <= SHORTEST_EXILE:
        return np.zeros(time.size, dtype=np.bool_)
    most = max(1, int(LARGEST_STRAY_SHARE * time.size))
    ordered = np.sort(time)
    first, last = int(ordered[most]), int(ordered[-most - 1])
    limit = max(SHORTEST_EXILE, last - first)
    begin, end = first, last
    for k in range(most - 1, -1, -1):
        if begin - int(ordered[k]) > limit:
            break
        begin = int(ordered[k])
    for k in range(time.size - most, time.size):
        if int(ordered[k]) - end > limit:
            break
        end = int(ordered[k])
    return np.asarray((time < begin) | (time > end), dtype=np.bool_)


def dropouts(time: TimeArray, speed: FloatArray) -> Mask:
    """Readings of 0 between two of a fair wind, faster than a rotor stops and starts; shape (n,).

    Args:
        time: Stamps [ns], shape (n,).
        speed: Indicated speeds [m/s], shape (n,).
    """
    order = np.argsort(time, kind="stable")
    zero = speed[order] == 0.0
    blowing = np.flatnonzero(~zero)
    found = np.zeros(time.size, dtype=np.bool_)
    if not zero.any() or blowing.size < 2:
        return found
    after = np.searchsorted(blowing, np.flatnonzero(zero))
    inside = (after > 0) & (after < blowing.size)
    at = np.flatnonzero(zero)[inside]
    before, after = blowing[after[inside] - 1], blowing[after[inside]]
    least = np.minimum(speed[order][before], speed[order][after])
    soon = time[order][after] - time[order][before] < LONGEST_DROPOUT
    found[order[at[(least > DROPPED_FROM) & soon]]] = True
    return found


def impossible(velocity: FloatArray) -> Mask:
    """Winds that never blew; what is not a number is none of them; shape (n,).

    Args:
        velocity: East, north, up [m/s], shape (n, 3).
    """
    return np.asarray(np.any(np.abs(velocity) > STRONGEST_WIND, axis=-1), dtype=np.bool_)


def stray_note(topic: str, time: TimeArray, stray: Mask) -> str:
    """What is said of strays that were left out."""
    usual = int(np.median(time[~stray]))
    far = int(time[stray][np.argmax(np.abs(time[stray] - usual))]) - usual
    days = abs(far) * 1e-9 / 86400.0
    text = f"{days:.1f} days" if days >= 1.0 else f"{24.0 * days:.1f} hours"
    return (
        f"{topic}: {int(np.count_nonzero(stray))} of {time.size} stamps lie far from all others "
        f"(by {text}) and were left out"
    )


def dropout_note(topic: str, dropped: Mask) -> str:
    """What is said of readings that dropped to 0; they are used as they are."""
    return (
        f"{topic}: {int(np.count_nonzero(dropped))} of {dropped.size} readings are 0 for a moment "
        f"between two of more than {DROPPED_FROM:g} m/s, which no rotor does; they count as wind"
    )


def restart_note(topic: str, raw: FloatArray, restarts: int) -> str:
    """What is said of a counter without a stated modulus that began again.

    Args:
        topic: Its topic.
        raw: What it told, shape (n,).
        restarts: How often it went back.
    """
    text = f"{topic}: the counter restarted {'once' if restarts == 1 else f'{restarts} times'}"
    known = raw[np.isfinite(raw)]
    steps = np.diff(known)
    back = np.flatnonzero(steps < 0.0)
    usual = float(np.max(steps, initial=0.0))
    for size in COUNTER_SIZES:
        over = size + steps[back]
        if back.size and np.all((known[back] < size) & (over >= 0.0) & (over <= 2.0 * usual)):
            return f"{text}, as one that wraps at {size} does: then write `modulus: {size}`"
    return f"{text}; if it wraps, state `modulus`"


def impossible_note(topic: str, wrong: Mask) -> str:
    """What is said of impossible winds that were left out."""
    return (
        f"{topic}: {int(np.count_nonzero(wrong))} of {wrong.size} winds are faster than "
        f"{STRONGEST_WIND:g} m/s and were left out"
    )
