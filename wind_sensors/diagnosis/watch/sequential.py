"""A sequential test for each signature: has its amplitude left the normal since some block?

Page's cumulative sum of log-likelihood ratios, one for each signature and direction, for a change
by `SHIFT` times the smallest size worth reporting. A sum that starts afresh whenever it falls
below zero exceeds h by chance at most once in e^h blocks on average (Lorden (1971)), so that h
follows from the number of sums, the blocks in a day and the false alarms that are accepted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

SHIFT = 2.0
"""Change the sums look for, in smallest sizes worth reporting."""

LARGEST_STEP = 4.0
"""One block adds at most this to a sum: an alarm needs several."""

_FINEST = 2.5
"""The wander of an amplitude is never taken to be smaller than the change over this."""

_WANDER_PRIOR = 0.35
"""Wander of an amplitude from block to block, expected before any, in smallest sizes."""

_WANDER_BLOCKS = 5.0
_SETTLED_PRIOR = 0.5

LARGEST_STANDING = 1.0
"""A departure from the session's first block on is accepted up to so many smallest sizes."""

_TELLING = 0.3
_LARGEST_EXCESS = 2.0


@dataclass
class SequentialTest:
    """Cumulative sums over a growing list of signatures.

    Attributes:
        false_alarms_per_day: Accepted.
        blocks_per_day: Of data.
        bounded: The session's first blocks may differ from normal by `LARGEST_STANDING` and no
            more; else they are normal by definition.
        up, down: The sums, shape (k,).
        since_up, since_down: Number of the block after which each sum last was zero, shape (k,).
        wander, wander_weight: Sums for the variance of the amplitudes beyond noise, in smallest
            sizes, shape (k,).
        settled, settled_weight: Sums for the amplitudes with which this session began, shape (k,).
        last: Amplitudes of the block before, nan where unseen, shape (k,).
        leapt: Whether the newest block added as much to a sum as one block may.
    """

    false_alarms_per_day: float
    blocks_per_day: float
    bounded: bool = False
    up: FloatArray = field(default_factory=lambda: np.zeros(0))
    down: FloatArray = field(default_factory=lambda: np.zeros(0))
    since_up: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    since_down: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    wander: FloatArray = field(default_factory=lambda: np.zeros(0))
    wander_weight: FloatArray = field(default_factory=lambda: np.zeros(0))
    settled: FloatArray = field(default_factory=lambda: np.zeros(0))
    settled_weight: FloatArray = field(default_factory=lambda: np.zeros(0))
    last: FloatArray = field(default_factory=lambda: np.zeros(0))
    leapt: bool = False

    @property
    def threshold(self) -> float:
        """h: no sum passes it by chance more often than accepted."""
        sums = max(2 * self.up.size, 2)
        return math.log(sums * self.blocks_per_day / self.false_alarms_per_day)

    @property
    def largest(self) -> float:
        """Largest sum relative to the threshold."""
        if self.up.size == 0:
            return 0.0
        return float(max(self.up.max(), self.down.max()) / self.threshold)

    def resize(self, size: int) -> None:
        """Make room for signatures that were met for the first time."""
        more = size - self.up.size
        if more <= 0:
            return
        self.up = np.append(self.up, np.zeros(more))
        self.down = np.append(self.down, np.zeros(more))
        self.since_up = np.append(self.since_up, np.zeros(more, np.int64))
        self.since_down = np.append(self.since_down, np.zeros(more, np.int64))
        self.wander = np.append(self.wander, np.full(more, _WANDER_BLOCKS * _WANDER_PRIOR**2))
        self.settled = np.append(self.settled, np.zeros(more))
        self.settled_weight = np.append(self.settled_weight, np.zeros(more))
        self.last = np.append(self.last, np.full(more, np.nan))
        self.wander_weight = np.append(self.wander_weight, np.full(more, _WANDER_BLOCKS))

    def add(
        self, block: int, departure: FloatArray, precision: FloatArray
    ) -> None:
        """One block.

        Args:
            block: Its number.
            departure: Amplitudes beyond the normal ones, in smallest sizes; 0 where unseen.
            precision: One over their noise variance; 0 where unseen.
        """
        usual = self.settled / (self.settled_weight + _SETTLED_PRIOR)
        largest = LARGEST_STANDING if self.bounded else np.inf
        beyond = departure - np.clip(usual, -largest, largest)
        variance = 1.0 / np.maximum(precision, 1e-9) + self.wander / self.wander_weight
        variance = np.maximum(variance, (SHIFT / _FINEST) ** 2)
        self.leapt = False
        for sums, since, sign in (
            (self.up, self.since_up, 1.0),
            (self.down, self.since_down, -1.0),
        ):
            step = SHIFT * (sign * beyond - 0.5 * SHIFT) / variance
            step = np.where(precision > 0.0, np.minimum(step, LARGEST_STEP), 0.0)
            self.leapt = self.leapt or bool(np.any(step >= LARGEST_STEP))
            # The ceiling lets a sum come down within a few blocks when the change is over.
            sums[:] = np.clip(sums + step, 0.0, self.threshold + 3.0 * LARGEST_STEP)
            since[sums == 0.0] = block

    def learn(self, departure: FloatArray, precision: FloatArray) -> None:
        """Let a block enter the wander: steps between blocks, which no lasting change makes."""
        seen = precision > _TELLING
        change = departure - self.last
        usable = seen & np.isfinite(change)
        excess = np.maximum(0.5 * change**2 - 1.0 / np.maximum(precision, 1e-9), 0.0)
        self.wander += np.where(usable, np.minimum(excess, _LARGEST_EXCESS), 0.0)
        self.wander_weight += usable
        self.last = np.where(seen, departure, self.last)

    def settle(self, departure: FloatArray, precision: FloatArray) -> None:
        """Let a block of the session's beginning enter its standing amplitudes."""
        telling = precision / (precision + 1.0)
        self.settled += telling * departure
        self.settled_weight += telling

    def onset(self) -> int | None:
        """Number of the first block of the change, when a sum has passed the threshold."""
        if self.up.size == 0:
            return None
        k, j = int(np.argmax(self.up)), int(np.argmax(self.down))
        if max(self.up[k], self.down[j]) < self.threshold:
            return None
        since = self.since_up[k] if self.up[k] >= self.down[j] else self.since_down[j]
        return int(since) + 1
