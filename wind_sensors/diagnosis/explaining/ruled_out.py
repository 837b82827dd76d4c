"""What the raw signals rule out, however well it would fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.effects.platform import log_is_dead, log_lives
from wind_sensors.diagnosis.explaining.intervals import window_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term, planted
from wind_sensors.diagnosis.explaining.vane_guesses import headings
from wind_sensors.station.model import Angle, Station

FloatArray = npt.NDArray[np.float64]

SOONER = 0.97
"""An interval shorter than this share of a counter's dead time is none that it lets pass, whatever
is uncertain of stamps."""

FEWEST_SOONER = 5
"""A counter that stops being deaf shows so many of them: fewer may be pulses of another cause."""

TOO_SOON = 0.9
"""An interval shorter than this share of a dead time that a fit told, less surely than pulses tell
it, should not be there while the counter is deaf."""

MOST_TOO_SOON = 0.02
"""Share of the intervals that may be, all the same."""

BY_CHANCE = 1e-6
"""Pulses lost one by one do not leave a silence of which the probability is less."""

SHORTEST_SILENCE = 5.0
"""In a shorter one [s] a rotor may have stood still in a lull."""

FEWEST_DUE = 50
"""As in one in which fewer pulses are due."""

FLOATS = 2.0
"""Form of a gap in which the reading may be anything."""

INSIDE = 0.5
"""The middle of a gap: this share of its width."""

FEWEST_EXPECTED = 50
"""Readings say nothing of a gap in whose middle a healthy vane would have fewer."""

READ_INSIDE = 0.6
"""A vane that shows this share of those has no gap there."""

FROM_POSITIONS = 0.5
"""A platform's velocity is that of its positions from this share on."""

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
        _reads_in_its_gap(comparison, station, term, terms)
        or _goes_on(comparison, term)
        or _hears_too_soon(comparison, term)
        or _is_silent(comparison, station, term, terms)
        or _reports(comparison, term)
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


def _hears_too_soon(comparison: Comparison, term: Term) -> bool:
    """Whether pulses come sooner than a dead time allows while it is said to hold.

    Args:
        comparison: The recording.
        term: Any effect; only one with a dead time is asked.
    """
    if term.values.get("dead_time", 0.0) <= 0.0:
        return False
    intervals, _ = _while_it_holds(comparison, term)
    too_soon = np.count_nonzero(intervals < TOO_SOON * term.values["dead_time"])
    return bool(too_soon > max(MOST_TOO_SOON * intervals.size, FEWEST_SOONER))


def _is_silent(
    comparison: Comparison, station: Station, term: Term, terms: Sequence[Term]
) -> bool:
    """Whether pulses are said to be lost one by one, where for long there is none at all.

    Args:
        comparison: The recording.
        station: As commissioned.
        term: Any effect; only pulses lost by chance are asked.
        terms: All effects: another one on the same rotor may be what silences it.
    """
    alone = sum(t.instrument == term.instrument for t in terms) == 1
    if "loss_probability" not in term.values or not alone:
        return False
    intervals, ends = _while_it_holds(comparison, term)
    if not intervals.size or intervals.max() < SHORTEST_SILENCE:
        return False
    longest = int(np.argmax(intervals))
    expected, _ = comparison.signals(station, (term.instrument,))
    due = comparison.grid.seconds(expected[term.instrument].time)
    due = due[(due > ends[longest] - intervals[longest]) & (due < ends[longest])]
    # Of pulses that come sooner than the dead time at least one is heard in each such time.
    heard = np.floor(due / max(term.values["dead_time"], 1e-9))
    heard = np.unique(heard) if term.values["dead_time"] > 0.0 else due
    lost = max(term.values["loss_probability"], 1e-12)
    return bool(heard.size >= FEWEST_DUE and heard.size * np.log(lost) < np.log(BY_CHANCE))


def _reports(comparison: Comparison, term: Term) -> bool:
    """Whether a log is said to be dead while it reports how fast the platform moves.

    Positions tell as much of the velocity where the log lives, so that nothing else speaks against
    it.

    Args:
        comparison: The recording.
        term: Any effect; only a velocity taken from the positions is asked.
    """
    if term.values.get("position_share", 0.0) < FROM_POSITIONS:
        return False
    if not log_is_dead(comparison.drive):
        return False
    return log_lives(comparison.drive, *window_of(comparison, term.interval))


def _while_it_holds(comparison: Comparison, term: Term) -> tuple[FloatArray, FloatArray]:
    """Intervals between the pulses of a rotor that lie in a term's interval, and their ends [s]."""
    time = comparison.grid.seconds(comparison.recording.pulses[term.instrument].time)
    since = time + comparison.drive.elapsed
    begin, end = term.interval
    holds = (since[:-1] >= begin) & (since[1:] <= (np.inf if end is None else end))
    return np.diff(time)[holds], time[1:][holds]


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
