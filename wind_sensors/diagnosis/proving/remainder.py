"""What an explanation leaves: in regions of the data, and in the noise."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.explaining.acceptance import LOUDEST_FACTOR
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.intervals import window_of
from wind_sensors.diagnosis.explaining.terms import reached_by, simulated_with
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.noise_level import Excess
from wind_sensors.diagnosis.regions import Region, RegionBank
from wind_sensors.station.model import Propeller, Station

FloatArray = npt.NDArray[np.float64]

REMAINDER_SCORES = {
    "frequency": 60.0,
    "statistic": 45.0,
    "spectrum": 30.0,
    "activity": 30.0,
    "time": 30.0,
    "direction": 30.0,
    "heading": 30.0,
    "speed": 16.0,
    "all": 30.0,
}
"""Scores beyond which a remainder counts as structure, by kind of region. Gusts that come and go
raise the power of a band on healthy days, too; a named effect leaves less than this where its form
may differ from the simulation's."""

STIRRED_KINDS = frozenset({"frequency", "spectrum", "activity"})
"""Of these an effect that brings eddies of its own leaves more than the simulation knows."""

STIRRED_TIMES = 5.0
"""So many times more. A mast that sways leaves many times that in one band."""

REMAINDER_SCORE = 0.8
"""Part of the score at which a remainder is structure without a name from which it may count
against a name: what fits leaves less than what nothing explains."""

REMAINDER_P = 0.05
"""A remainder does not count that a healthy day shows with more probability."""

CHANGED = 30.0
"""An effect changes a signal if it does so by this much, in squares of noise: a vane that is turned
a little carries its propeller along, which is next to nothing."""

CHANGED_SHARE = 0.05
"""Or by this share of what it changes in all signals: of a small effect there may be no more."""

NOISY = 6.0
"""Noise beyond this many standard deviations of healthy days is physics that a name left out: of
few healthy days nobody knows their scatter well."""

VERY_NOISY = 8.0
"""The same without any name, where the reference of that day may err more."""

STIRRED = 0.01
"""Where an effect with eddies of its own changes a signal by more than this share of its largest
change, a residual's noise says nothing."""

STIRRED_TIME = 5.0
"""Nor for twice as many seconds [s] before and after: eddies travel on, and instruments answer
late."""

LEAST_UNSTIRRED = 0.15
"""Share of the record that must be left for its noise to be judged."""

@dataclass(frozen=True)
class Remainder:
    """What an explanation leaves in the region where it leaves most.

    Attributes:
        score: Relative to the limit for a region of its kind.
        p: Probability of it on a healthy day.
        share: Of the whole misfit.
    """

    score: float
    p: float
    share: float

    @property
    def is_structure(self) -> bool:
        """Whether there is more than healthy days show."""
        return self.score > 1.0 and self.p < REMAINDER_P


def located(
    naming: Naming, bank: RegionBank, comparison: Comparison, baseline: Baseline
) -> Remainder:
    """What the recording shows before anything is named."""
    score, relative = _largest(bank.scores(naming.nothing), bank, comparison, baseline)
    return Remainder(relative, bank.p_value(score), 1.0)


def remainder_of(
    naming: Naming, bank: RegionBank, comparison: Comparison, baseline: Baseline
) -> Remainder:
    """What is left in the channels that the named effects reach.

    What another instrument shows beside them says nothing against the names, unless it carries the
    one that they change (a vane off the wind takes its propeller along) and stands out by itself;
    nor does what a healthy day shows as loudly, nor some more power of eddies if they bring eddies
    of their own, or of the statistics in which their form is not certain.
    """
    scores = bank.scores(naming.adequate.of(naming.fit.simulated))
    if naming.fit.terms:
        changed = _changed(naming)
        channels = changed | carriers_of(comparison, changed)
        stirred = any(term.effect.stirs for term in naming.fit.terms)
        loose = {name for term in naming.fit.terms for name in term.effect.loose_statistics}
        own = [(stirred and r.kind in STIRRED_KINDS) or r.label in loose for r in bank.regions]
        untouched = [r.channel not in changed or _is_outside(r, naming) for r in bank.regions]
        scores = np.where([r.channel in channels for r in bank.regions], scores, 0.0)
        scores *= np.where(untouched, REMAINDER_SCORE, 1.0) / np.where(own, STIRRED_TIMES, 1.0)
    score, relative = _largest(scores, bank, comparison, baseline)
    share = score / (score + max(naming.gain, 0.0)) if naming.fit.terms else 1.0
    return Remainder(relative, bank.p_value(score), share)


def _changed(naming: Naming) -> set[str]:
    """Channels that the named effects change, by more than next to nothing."""
    comparison = naming.adequate.comparison
    nothing = naming.adequate.noise_whitened(comparison.simulate(comparison.station))
    change = naming.adequate.noise_whitened(naming.fit.simulated) - nothing
    squares = np.bincount(comparison.channel_of_each, change**2)
    least = min(CHANGED, CHANGED_SHARE * float(squares.sum()))
    return {c.name for c, moved in zip(comparison.channels, squares, strict=True) if moved > least}


def carriers_of(comparison: Comparison, channels: Collection[str]) -> set[str]:
    """Channels of the vanes that carry the propellers of some channels."""
    carried = [
        comparison.station.instrument(c.instrument)
        for c in comparison.channels
        if c.name in channels
    ]
    vanes = {i.mounted_on for i in carried if isinstance(i, Propeller)}
    return {c.name for c in comparison.channels if c.instrument in vanes}


def _is_outside(region: Region, naming: Naming) -> bool:
    """Whether a part of the record lies where none of the named effects holds.

    What is left there was there before they began: it has to stand out by itself.
    """
    if region.kind != "time":
        return False
    windows = [window_of(naming.whitener.comparison, t.interval) for t in naming.fit.terms]
    return all(region.high <= begin or region.low >= end for begin, end in windows)


def _largest(
    scores: FloatArray, bank: RegionBank, comparison: Comparison, baseline: Baseline
) -> tuple[float, float]:
    """The score that exceeds its limit most, and how many times it does."""
    loudest = {
        c.name: LOUDEST_FACTOR * baseline.loudness(c.instrument) for c in comparison.channels
    }
    limits = np.array([max(REMAINDER_SCORES[r.kind], loudest[r.channel]) for r in bank.regions])
    worst = int(np.argmax(scores / limits))
    return float(scores[worst]), float(scores[worst] / limits[worst])


def with_own_noise(naming: Naming) -> frozenset[str]:
    """Instruments whose named effects leave noise of their own."""
    comparison = naming.whitener.comparison
    noisy = [term for term in naming.fit.terms if term.leaves_noise]
    return reached_by(comparison, comparison.station, noisy)


def unstirred(naming: Naming, station: Station) -> Comparison | None:
    """The comparison without the seconds in which named effects bring eddies of their own.

    Args:
        naming: The explanation.
        station: As commissioned.

    Returns:
        None: too little of the record is left.
    """
    comparison = naming.whitener.comparison
    stirring = [t for t in naming.fit.terms if t.effect.stirs]
    if not stirring:
        return comparison
    others = [t for t in naming.fit.terms if not t.effect.stirs]
    without = simulated_with(comparison, station, others)
    acts = np.zeros(comparison.grid.n, dtype=np.bool_)
    for channel in comparison.channels:
        change = np.abs(naming.fit.simulated.series[channel.name] - without.series[channel.name])
        acts |= change > STIRRED * max(float(change.max()), 1e-9)
    width = round(2.0 * STIRRED_TIME / comparison.grid.dt)
    calm = 1.0 - maximum_filter1d(acts.astype(float), 2 * width)
    outside = uniform_filter1d(calm, width)
    return comparison.within(outside) if np.mean(outside) > LEAST_UNSTIRRED else None


def is_noisy(naming: Naming, excess: Excess) -> bool:
    """Whether more noise is left than any healthy day leaves."""
    return excess.score > (NOISY if naming.fit.terms else VERY_NOISY)
