"""Where the slots of a pulse disc are, as the intervals of its pulses tell."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.raw_statistics.pulses import by_slot

FloatArray = npt.NDArray[np.float64]

CUPS = 3
"""So many times per turn, and less often, cups pull more and less."""

HARDLY_TURNS = 0.002
"""In a wind whose direction varies by no more than this [rad^2] nothing tells what is locked to
it."""

FEWEST_IN_A_PART = 3
"""A part of the record with fewer intervals for each slot does not tell how uneven they are."""


@dataclass(frozen=True)
class SlotIntervals:
    """Intervals of pulses by the slot at which they begin.

    Attributes:
        begin: Of each interval [s], ascending, shape (m,).
        slot: Its slot, counted from the first edge, shape (m,).
        deviation: From the mean of the turn around it, relative, shape (m,).
        slots: Per turn.
    """

    begin: FloatArray
    slot: npt.NDArray[np.intp]
    deviation: FloatArray
    slots: int

    def means(self, here: slice = slice(None)) -> FloatArray:
        """Mean deviation at each slot over some of the intervals, shape (slots,)."""
        slot = self.slot[here]
        number = np.maximum(np.bincount(slot, minlength=self.slots), 1)
        return np.asarray(np.bincount(slot, self.deviation[here], self.slots) / number)

    def shown_in(self, cuts: FloatArray) -> FloatArray:
        """How far the unevenness shows in parts of the record, in units of that of the whole.

        Args:
            cuts: Ends of the parts [s], ascending, shape (parts + 1,).

        Returns:
            Shape (parts,); NaN where there are too few intervals.
        """
        whole = self.means()
        pattern = whole - np.mean(whole)
        shown = np.full(cuts.size - 1, np.nan)
        for k, (i, j) in enumerate(itertools.pairwise(np.searchsorted(self.begin, cuts))):
            if j - i >= FEWEST_IN_A_PART * self.slots:
                there = self.means(slice(i, j))
                shown[k] = float(there @ pattern) / max(float(pattern @ pattern), 1e-12)
        return shown

    def left_by(self, begin: float, end: float) -> float:
        """Sum of squares that slots uneven for a part of the record leave.

        Args:
            begin, end: Of the part [s].
        """
        first, last = np.searchsorted(self.begin, (begin, end))
        number = np.bincount(self.slot[first:last], minlength=self.slots)
        told = self.means(slice(first, last))
        return float(self.deviation @ self.deviation - number @ told**2)

    def without_what_turns(self, wind_from: FloatArray) -> tuple[SlotIntervals, float]:
        """Without what is locked to the wind's direction: what cups do to the rate in each turn.

        Slots keep their places on the disc, cups pull by where they are in the wind. The two are
        told apart as far as the wind turns.

        Args:
            wind_from: Direction it comes from at the beginning of each interval [rad], counted as
                the rotor turns, shape (m,).

        Returns:
            The intervals; and the sum of squares that uneven slots and this together leave.
        """
        angle = 2.0 * np.pi / self.slots * self.slot - wind_from
        orders = np.arange(1, min(CUPS, (self.slots - 1) // 2) + 1)
        waves = np.exp(1j * np.outer(orders, angle))
        locked = np.concatenate((waves.real, waves.imag))
        moving = np.array([wave - self._fixed(wave) for wave in locked])
        own = self.deviation - self._fixed(self.deviation)
        square = moving @ moving.T + HARDLY_TURNS * max(own.size, 1) * np.eye(len(moving))
        size = np.linalg.solve(square, moving @ own)
        left = own - size @ moving
        return replace(self, deviation=self.deviation - size @ locked), float(left @ left)

    def _fixed(self, values: FloatArray) -> FloatArray:
        """Of values of each interval what is the same at each slot in every turn."""
        number = np.maximum(np.bincount(self.slot, minlength=self.slots), 1)
        means = np.bincount(self.slot, values, self.slots) / number
        return np.asarray(means[self.slot])

    def displacements(self, begin: float, end: float) -> FloatArray:
        """How far each slot lies from its place in a part of the record, in slot widths.

        Args:
            begin, end: Of the part [s].

        Returns:
            Shape (slots,), with a mean of nought.
        """
        first, last = np.searchsorted(self.begin, (begin, end))
        longer = self.means(slice(first, last))
        displaced = np.cumsum(longer - np.mean(longer))
        # An interval ends where the next slot is.
        displaced = np.roll(displaced, 1)
        return np.asarray(displaced - np.mean(displaced))


def slot_intervals(time: FloatArray, slots: int) -> SlotIntervals:
    """Intervals by slot, of the two ways to number the slots in the one that tells more.

    Args:
        time: Edges [s], ascending.
        slots: Per turn.
    """
    plain, tracked = (
        SlotIntervals(*_deviations(edges, slots), slots)
        for edges in (time, by_slot(time, slots)[0])
    )
    return tracked if np.var(tracked.means()) > np.var(plain.means()) else plain


def _deviations(
    time: FloatArray, slots: int
) -> tuple[FloatArray, npt.NDArray[np.intp], FloatArray]:
    """Begin, slot, and relative deviation from a turn's mean, of each interval that is known."""
    if time.size <= slots + 1:
        return np.zeros(0), np.zeros(0, dtype=np.intp), np.zeros(0)
    begin = slots // 2
    count = time.size - slots
    turn = np.maximum(time[slots:] - time[:count], 1e-9)
    own = time[begin + 1 : begin + 1 + count] - time[begin : begin + count]
    deviation = np.clip(own * slots / turn - 1.0, -0.8, 0.8)
    known = np.isfinite(deviation)
    slot = (np.arange(count) + begin) % slots
    return time[begin : begin + count][known], slot[known], deviation[known]
