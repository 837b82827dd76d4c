"""Where the stamps of an instrument jump: a clock began to be late, or ceased to be."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.intervals import NEAR_AN_END
from wind_sensors.diagnosis.explaining.terms import Interval, Term

FloatArray = npt.NDArray[np.float64]

AROUND = 21
"""The median of so many intervals is the usual one."""

LEAST_JUMP = 0.08
LARGEST_JUMP = 5.0
MANY_TIMES = 5.0
"""A gap longer [s] than the usual interval by the first, at most the second, and so many times as
long as usual may be a jump of the stamps."""

MOST_GAPS = 3
"""More of them are messages that were lost."""

FEWEST_TWICE = 4.0
TWICE = 1.7
"""Where stamps jump back, so many times as many as usual lie within the jump; fewer than the first
do not tell."""


def late_stamps(comparison: Comparison, instrument: str, time: FloatArray) -> list[Term]:
    """Delays that begin where the stamps leave a gap, and end where they come twice as close.

    Args:
        comparison: The recording.
        instrument: Whose stamps they are.
        time: Of its pulses or readings [s since the first bin], ascending, shape (n,).

    Returns:
        With the delay and its beginning as the gap tells them; none where no gap stands out.
    """
    if time.size < 4 * AROUND:
        return []
    interval = np.diff(time)
    usual = median_filter(interval, AROUND, mode="nearest")
    length = comparison.grid.n * comparison.grid.dt
    inside = (time[:-1] > NEAR_AN_END) & (time[:-1] < length - NEAR_AN_END)
    more = interval - usual
    gaps = np.flatnonzero(
        (more > LEAST_JUMP) & (more < LARGEST_JUMP) & (interval > MANY_TIMES * usual) & inside
    )
    if gaps.size > MOST_GAPS:
        return []
    since = comparison.drive.elapsed
    effect = catalogue()["timestamp_latency"]
    terms = []
    for gap in gaps.tolist():
        late = float(more[gap])
        begin = float(time[gap] + 0.5 * usual[gap]) + since
        ends = [None, *(e + since for e in _back_again(time, usual, gap, late) if e < length)]
        spans: list[Interval] = [(begin, end) for end in ends]
        terms += [
            Term(effect, instrument, {"latency": late}, span, frozenset({"latency"}))
            for span in spans
        ]
    return terms


def _back_again(time: FloatArray, usual: FloatArray, gap: int, late: float) -> list[float]:
    """Where stamps after a gap jump back by as much, if they do [s since the first bin]."""
    first = gap + AROUND
    begins = time[first:-1]
    within = np.searchsorted(time, begins + late) - np.arange(first, time.size - 1)
    # In a long crowd the median is that of the crowd.
    before = np.maximum(np.arange(first, time.size - 1) - round(late / usual[gap]) - AROUND, 0)
    expected = late / np.maximum(usual[first:], usual[before])
    twice = np.where(expected > FEWEST_TWICE, within / expected, 0.0)
    if twice.size == 0:
        return []
    best = int(np.argmax(twice))
    return [float(begins[best])] if twice[best] > TWICE else []
