"""When in the record an effect gains: all the time that it holds, or in one event."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.stats import ttest_1samp

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.activity import segments_of
from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.search import Searcher
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term

FloatArray = npt.NDArray[np.float64]

MOMENTS = 24
"""Parts of the record."""

EVENT = 3
"""So many in a row may hold a single event; one, of an effect that passes anyway."""

STEADY_TIME = 15.0
STEADY_P = 0.05
"""What begins or ends inside the record gains again and again while it holds: the mean gain of
parts of so many seconds differs from nought by Student's test at this level. A gust that the
reference missed brings as much, at once."""

FEW_GUSTS = 2
GAINS_AGAIN = 40.0
"""Or it brings so much without so many of its best parts: in a gusty wind gains are gusty, too."""

OF_COURSE = 0.1
"""What brings less than this share of its gain by the course of the signals shows in the statistics
of the whole record: when it gains, parts do not tell."""

LONGEST_MOMENT = 0.25
OF_A_MOMENT = 0.7
"""An effect of which more than the second share shows in a part of the record that is no longer
than the first has its moment there."""


def needs_to_be_steady(term: Term) -> bool:
    """Whether a term begins or ends inside the record and acts again and again in between.

    A sector the wind may cross but once; in weak wind a vane out of balance swings in each lull.
    """
    effect = term.effect
    seldom = effect.legible or effect.noisy or (effect.occasional and effect.sector != "")
    return term.interval != ALWAYS and not seldom


def is_steady(comparison: Comparison, before: Fit, after: Fit) -> bool:
    """Whether the newest term gains again and again while it holds, if it should.

    Args:
        comparison: The recording.
        before, after: Two explanations in the same null.
    """
    newest = after.terms[-1]
    if not needs_to_be_steady(newest):
        return True
    width = round(STEADY_TIME / comparison.grid.dt)
    gains = gain_in_parts(comparison, before, after, width)
    if float(gains.sum()) < OF_COURSE * (before.cost - after.cost):
        return True
    middle = (np.arange(gains.size) + 0.5) * width * comparison.grid.dt
    at = middle + comparison.drive.elapsed
    begin, end = newest.interval
    inside = gains[(at > begin) & (at < (np.inf if end is None else end))]
    if inside.size < 2:
        return False
    again = float(np.sort(inside)[:-FEW_GUSTS].sum())
    usual = float(ttest_1samp(inside, 0.0, alternative="greater").pvalue)
    return usual < STEADY_P or again > GAINS_AGAIN


def gain_in_parts(comparison: Comparison, before: Fit, after: Fit, width: int) -> FloatArray:
    """How much of a gain each part of the record brings, statistics of the whole aside.

    Args:
        comparison: The recording.
        before, after: Two explanations in the same null.
        width: Of a part, in bins.
    """
    gain = squares_in_parts(comparison, before.vector, width)
    gain -= squares_in_parts(comparison, after.vector, width)
    parts = gain.size
    counted = comparison.measured.counted.size
    number = segments_of(comparison.grid)
    of_activity = sum(comparison.measured.levels[c.name].size for c in comparison.channels)
    if of_activity:
        drop = before.vector[-of_activity:] ** 2 - after.vector[-of_activity:] ** 2
        each = drop.reshape(-1, counted).sum(axis=0) / np.bincount(number)
        gain += each[number][: parts * width].reshape(parts, width).sum(axis=1)
    return gain


def squares_in_parts(comparison: Comparison, vector: FloatArray, width: int) -> FloatArray:
    """Sum of the squares of white series in each part of the record.

    Args:
        comparison: The recording.
        vector: White vector, shape (m,).
        width: Of a part, in bins.
    """
    n = comparison.coefficients
    parts = comparison.grid.n // width
    squares = np.zeros(parts)
    for k in range(len(comparison.channels)):
        white = np.zeros(comparison.grid.n)
        white[:n] = vector[k * n : (k + 1) * n]
        at = spectra.from_cosine(white)[: parts * width] ** 2
        squares += at.reshape(parts, width).sum(axis=1)
    return squares


DELAYED_AGAIN = 12.0
"""What comes late does so in every gust: without its best moment a delay still brings so much. One
swing of the wind may have taken another way to the reference."""


def is_late_again(comparison: Comparison, before: Fit, after: Fit) -> bool:
    """Whether the newest term, if it is a delay, gains outside its best moment, too.

    Args:
        comparison: The recording.
        before, after: Two explanations in the same null.
    """
    newest = after.terms[-1]
    if newest.effect.entrance != "clock" or newest.is_told:
        return True
    gain = gain_in_parts(comparison, before, after, comparison.grid.n // MOMENTS)[:MOMENTS]
    best = int(np.argmax(np.convolve(gain, np.ones(EVENT), "same")))
    elsewhere = np.abs(np.arange(gain.size) - best) > EVENT // 2
    return float(gain[elsewhere].sum()) >= DELAYED_AGAIN


BY_CHANCE = 2.0
"""One moment is always the best: noise alone lets it bring so much more than the second best."""


def single_event(comparison: Comparison, before: Fit, after: Fit) -> float:
    """How much more of a gain the best moment of the record brings than the second best.

    One gust that the reference missed, one swing of a vane can make any effect look better that
    moves the signals a little; if it always holds, it does so again and again. What acts in a
    sector or in a lull may show once, and what changes little elsewhere (a counter's dead time
    below the strongest wind) gains in each moment as it acts there.

    Args:
        comparison: The recording.
        before, after: Two explanations in the same null.
    """
    newest = after.terms[-1]
    passing = newest.interval != ALWAYS
    if newest.effect.occasional and not passing:
        return 0.0
    width = comparison.grid.n // MOMENTS
    gain = gain_in_parts(comparison, before, after, width)[:MOMENTS]
    together = 1 if passing else EVENT
    around = np.convolve(gain, np.ones(together), "same")
    best = int(np.argmax(around))
    elsewhere = np.abs(np.arange(gain.size) - best) >= together
    acting = squares_in_parts(comparison, after.vector - before.vector, width)[:MOMENTS]
    # What acts in statistics alone changes no part of the record.
    everywhere = max(float(acting.sum()), 1e-12)
    acts_then = float(np.convolve(acting, np.ones(together), "same")[best]) / everywhere
    expected = max(np.max(around[elsewhere]), acts_then * float(gain.sum()), 0.0)
    more = float(around[best] - expected)
    return more if more > BY_CHANCE else 0.0


def is_its_moment(searcher: Searcher, current: Fit, further: Term) -> bool:
    """Whether a passing effect holds just while the effects so far show.

    What a vane reads in a gap, or a rotor in a wake, need not be what is simulated there.
    """
    if further.interval == ALWAYS:
        return False
    comparison = searcher.comparison
    at = comparison.grid.centres + comparison.drive.elapsed
    begin, end = further.interval
    inside = (at >= begin) & (at < (np.inf if end is None else end))
    if np.mean(inside) > LONGEST_MOMENT:
        return False
    shown = sum(
        (current.simulated.series[c.name] - searcher.bank.without.series[c.name]) ** 2
        for c in comparison.channels
        if c.instrument in comparison.affected(searcher.station, further.instrument)
    )
    return float(np.sum(shown * inside)) > OF_A_MOMENT * float(np.sum(shown))
