"""What the raw signals rule out, however well it would fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.fitting import ALWAYS, Interval, Term, planted
from wind_sensors.diagnosis.explaining.vane_guesses import headings
from wind_sensors.station.model import Angle, Station

FloatArray = npt.NDArray[np.float64]

SOONER = 0.97
FEWEST_SOONER = 5
"""A counter that stops being deaf shows so many intervals shorter than this share of its dead
time."""

FLOATS = 2.0
"""Form of a gap in which the reading may be anything."""

INSIDE = 0.5
"""The middle of a gap: this share of its width."""

FEWEST_EXPECTED = 50
READ_INSIDE = 0.6
"""A vane that shows this share of the readings that a healthy one would have in the middle of a
sector, and so many would have been there, has no gap there."""

ONE_VALUE = np.radians(0.5)
"""Readings so close to the one value of a gap are that value [rad]."""


def ruled_out(comparison: Comparison, station: Station, terms: Sequence[Term]) -> bool:
    """Whether the raw signals show what one of the effects of an explanation forbids.

    Args:
        comparison: The recording.
        station: As commissioned.
        terms: The explanation.
    """
    return any(
        _reads_in_its_gap(comparison, station, term, terms) or _goes_on(comparison, term)
        for term in terms
    )


def _goes_on(comparison: Comparison, term: Term) -> bool:
    """Whether a counter is said to be deaf for a while, though its pulses never come sooner.

    Args:
        comparison: The recording.
        term: Any effect; only a dead time that the pulses tell is asked.
    """
    if "dead_time" not in term.held or term.interval == ALWAYS:
        return False
    time = comparison.grid.seconds(comparison.recording.pulses[term.instrument].time)
    since = time[1:] + comparison.drive.elapsed
    return not comes_sooner(since, np.diff(time), term.values["dead_time"], term.interval)


def comes_sooner(
    since: FloatArray, intervals: FloatArray, dead_time: float, interval: Interval
) -> bool:
    """Whether pulses come sooner than a dead time allows, outside the time in which it holds.

    Args:
        since: End of each interval between pulses [s since the start of the recording].
        intervals: Their lengths [s].
        dead_time: [s]
        interval: In which it is said to hold.
    """
    begin, end = interval
    outside = (since < begin) | (since > (np.inf if end is None else end))
    return bool(np.count_nonzero(outside & (intervals < SOONER * dead_time)) >= FEWEST_SOONER)


def _reads_in_its_gap(
    comparison: Comparison, station: Station, term: Term, terms: Sequence[Term]
) -> bool:
    """Whether a vane shows directions that a gap, as it is said to be, cannot show.

    Args:
        comparison: The recording.
        station: As commissioned.
        term: Any effect; only a gap that does not float is asked.
        terms: All effects: a vane that counts the other way shows its gap on the other side.
    """
    if term.effect.name != "potentiometer_gap" or term.values["form"] == FLOATS:
        return False
    (channel,) = (c for c in comparison.channels if c.instrument == term.instrument)
    readings = comparison.recording.angles[term.instrument]
    turned = _counts_backwards(station, term.instrument) != _counts_backwards(
        planted(station, terms), term.instrument
    )
    angle = -readings.angle if turned else readings.angle
    since = comparison.grid.seconds(readings.time) + comparison.drive.elapsed
    begin, end = term.interval
    holds = (since >= begin) & (since <= (np.inf if end is None else end))
    centre = np.radians(term.values["centre"])
    reach = 0.5 * INSIDE * np.radians(term.values["width"])
    shown = np.abs(np.angle(np.exp(1j * (angle - centre)))) < reach
    if term.values["form"] != 0.0:
        away = angle - np.radians(term.values["reading"])
        shown &= np.abs(np.angle(np.exp(1j * away))) > ONE_VALUE
    should = np.abs(np.angle(np.exp(1j * (headings(comparison, channel) - centre)))) < reach
    expected = np.count_nonzero(should & holds)
    if expected < FEWEST_EXPECTED:
        return False
    return bool(np.count_nonzero(shown & holds) > READ_INSIDE * expected)


def _counts_backwards(station: Station, vane: str) -> bool:
    entry = station.instrument(vane)
    return isinstance(entry, Angle) and entry.reversed
