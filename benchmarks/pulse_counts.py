"""Statistics of the pulses in equal intervals: what whole numbers show without a reference.

A counter that is read every second cuts a rotor's turn wherever the second ends. While the phase
of the cut is as good as random, the count of n.x pulses is n or n + 1, the error of one count is
triangular with a variance of 1/6, and what one second gets too much the next one gets too little:
the errors of neighbours have the covariance -1/12 and their sum stays bounded.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from wind_sensors.errors import UserError
from wind_sensors.station.model import Cup, Propeller, Rotor
from wind_sensors.station.signals import Recording

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

COUNT_VARIANCE = 1.0 / 6.0
"""Variance of the count of an interval with a random phase [pulses^2]."""

_FEWEST = 120
_COMMON = 20


class CountStatistics(NamedTuple):
    """What the counts of one rotor show.

    Attributes:
        seconds: Number of intervals.
        mean, deviation: Of the counts [pulses].
        still: Share of the intervals without a pulse.
        pulse_speed: Wind that one pulse per interval stands for [m/s].
        quantisation: Standard deviation that the counting alone adds to a one-interval speed [m/s].
        rapid: Standard deviation of the indicated speed between neighbouring intervals, beyond
            counting [m/s]; 0 where counting explains all of it.
        even: Share of even counts.
        even_p: Probability of a parity so uneven, given the distribution's smooth neighbours; NaN
            where too few different counts occur.
        missing: Counts that should have occurred often and never did.
    """

    seconds: int
    mean: float
    deviation: float
    still: float
    pulse_speed: float
    quantisation: float
    rapid: float
    even: float
    even_p: float
    missing: tuple[int, ...]


class PairCounts(NamedTuple):
    """Two rotors of one calibration, compared in means over some intervals.

    Attributes:
        blocks: Number of means.
        difference: Mean difference, second minus first [m/s].
        difference_error: Its standard error, from the scatter of blocks [m/s].
        slope: Change of the difference per m/s of wind [1].
        slope_error: Its standard error.
        misfit: Sum of squares that remains with a constant, a proportional and a 1/U difference:
            offset, gain and friction [(m/s)^2].
    """

    blocks: int
    difference: float
    difference_error: float
    slope: float
    slope_error: float
    misfit: dict[str, float]


def counts_of(recording: Recording, rotor: str) -> tuple[FloatArray, IntArray]:
    """Pulses in each interval of a rotor whose counter was read regularly.

    Returns:
        Length of the intervals [s] and whole numbers of pulses, shape (n,) each.

    Raises:
        UserError: The rotor has no counter, or too few readings.
    """
    instrument = recording.station.instrument(rotor)
    pulses = recording.pulses.get(rotor)
    if not isinstance(instrument, Rotor) or pulses is None or pulses.turns is None:
        raise UserError(
            f"'{rotor}' has no counter.", recording.name, "Only counters have counts to look at."
        )
    if pulses.time.size < _FEWEST:
        raise UserError(
            f"'{rotor}' has {pulses.time.size} readings.", recording.name, f"{_FEWEST} are needed."
        )
    exact = np.diff(pulses.turns) * instrument.pulses_per_revolution
    return np.diff(pulses.time) * 1e-9, np.rint(exact).astype(np.int64)


def count_statistics(recording: Recording, rotor: str) -> CountStatistics:
    """Statistics of a rotor's counts.

    Raises:
        UserError: As `counts_of`.
    """
    instrument = recording.station.instrument(rotor)
    assert isinstance(instrument, Cup | Propeller)
    seconds, counts = counts_of(recording, rotor)
    run = 2.0 * np.pi * instrument.calibration_distance / instrument.pulses_per_revolution
    step = run / float(np.median(seconds))
    # Neighbours differ by turbulence and by counting; the error of a difference of two counts has
    # the variance 2/6 + 2/12.
    jump = np.diff(counts)
    beyond = float(np.var(jump)) - 2.0 * COUNT_VARIANCE - 1.0 / 6.0
    size = int(counts.max()) + 1
    histogram = np.bincount(counts, minlength=size).astype(np.float64)
    smooth = np.convolve(histogram, np.array([0.25, 0.5, 0.25]), mode="same")
    inner = np.arange(2, size - 2)
    odd = inner % 2 == 1
    expected = smooth[inner]
    even_p = float("nan")
    if inner.size >= 6 and histogram[inner].sum() >= _FEWEST:
        share = float(expected[~odd].sum() / expected.sum())
        observed = int(histogram[inner][~odd].sum())
        even_p = float(
            stats.binomtest(observed, int(histogram[inner].sum()), min(share, 1.0)).pvalue
        )
    missing = tuple(
        int(k)
        for k in inner
        if histogram[k] == 0 and min(histogram[k - 1], histogram[k + 1]) > _COMMON
    )
    return CountStatistics(
        seconds=int(counts.size),
        mean=float(counts.mean()),
        deviation=float(counts.std()),
        still=float(np.mean(counts == 0)),
        pulse_speed=step,
        quantisation=step * float(np.sqrt(COUNT_VARIANCE)),
        rapid=step * float(np.sqrt(max(beyond, 0.0) / 2.0)),
        even=float(np.mean(counts % 2 == 0)),
        even_p=even_p,
        missing=missing,
    )


def compare_pair(
    recording: Recording, first: str, second: str, width: int = 30, block: int = 4
) -> PairCounts:
    """Compare two rotors in means over `width` intervals, in which counting hardly matters.

    Args:
        recording: With counters of both, read at the same instants.
        first, second: Names.
        width: Intervals in a mean.
        block: Means in a block; blocks are taken as independent.

    Raises:
        UserError: As `counts_of`, or the readings do not match.
    """
    columns = []
    for name in (first, second):
        rotor = recording.station.instrument(name)
        assert isinstance(rotor, Cup | Propeller)
        seconds, counts = counts_of(recording, name)
        run = 2.0 * np.pi * rotor.calibration_distance / rotor.pulses_per_revolution
        start = rotor.starting_speed if isinstance(rotor, Cup) else 0.0
        usable = counts.size // width * width
        rate = counts[:usable].reshape(-1, width).sum(axis=1)
        columns.append(run * rate / seconds[:usable].reshape(-1, width).sum(axis=1) + start)
    one, two = columns
    if one.size != two.size:
        raise UserError("the counters were not read together.", recording.name)
    wind = 0.5 * (one + two)
    difference = two - one
    number = np.arange(one.size) // block

    def slope_of(rows: IntArray) -> tuple[float, float]:
        x = wind[rows] - wind[rows].mean()
        return float(difference[rows].mean()), float((x @ difference[rows]) / (x @ x))

    everything = np.arange(one.size)
    middle, slope = slope_of(everything)
    count = int(number.max()) + 1
    left_out = np.array([slope_of(everything[number != b]) for b in range(count)])
    errors = np.sqrt((count - 1) * np.var(left_out, axis=0))
    shapes = {"offset": np.ones_like(wind), "gain": wind, "friction": 1.0 / wind}
    misfit = {
        name: float(np.sum((difference - (g @ difference) / (g @ g) * g) ** 2))
        for name, g in shapes.items()
    }
    return PairCounts(
        int(one.size), middle, float(errors[0]), slope, float(errors[1]), misfit
    )
