"""What the raw signals rule out, however well it would fit."""

from __future__ import annotations

import numpy as np

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.fitting import Term
from wind_sensors.diagnosis.explaining.vane_guesses import headings

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


def reads_in_its_gap(comparison: Comparison, term: Term) -> bool:
    """Whether a vane shows directions that a gap, as it is said to be, cannot show.

    Args:
        comparison: The recording.
        term: Any effect; only a gap that does not float is asked.
    """
    if term.effect.name != "potentiometer_gap" or term.values["form"] == FLOATS:
        return False
    (channel,) = (c for c in comparison.channels if c.instrument == term.instrument)
    readings = comparison.recording.angles[term.instrument]
    since = comparison.grid.seconds(readings.time) + comparison.drive.elapsed
    begin, end = term.interval
    holds = (since >= begin) & (since <= (np.inf if end is None else end))
    centre = np.radians(term.values["centre"])
    reach = 0.5 * INSIDE * np.radians(term.values["width"])
    shown = np.abs(np.angle(np.exp(1j * (readings.angle - centre)))) < reach
    if term.values["form"] != 0.0:
        away = readings.angle - np.radians(term.values["reading"])
        shown &= np.abs(np.angle(np.exp(1j * away))) > ONE_VALUE
    should = np.abs(np.angle(np.exp(1j * (headings(comparison, channel) - centre)))) < reach
    expected = np.count_nonzero(should & holds)
    if expected < FEWEST_EXPECTED:
        return False
    return bool(np.count_nonzero(shown & holds) > READ_INSIDE * expected)
