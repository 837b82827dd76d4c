"""Which of two rotors changed: the other heights decide, where they can."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explaining.terms import ALWAYS
from wind_sensors.diagnosis.means.averages import BLOWING, Averages, BoolArray, blocks_of
from wind_sensors.diagnosis.means.healthy import Healthy
from wind_sensors.diagnosis.means.search import Named

FloatArray = npt.NDArray[np.float64]

DECISIVE = 3.0
"""The other heights decide between two rotors when the log-likelihoods differ by so much."""

_FEWEST = 300
_FEWEST_BLOCKS = 6
"""So many means and blocks are needed on either side of a change, that its error is known."""


def _columns(averages: Averages, others: list[str], own: list[str]) -> tuple[FloatArray, BoolArray]:
    """Regressors of a height's log speed: those of the other heights, and turbulence."""
    logs = np.log(np.maximum(np.array([averages.speed[o] for o in others]), 0.1))
    good = np.isfinite(logs).all(axis=0)
    for name in own:
        good &= np.isfinite(averages.speed[name]) & (averages.speed[name] > BLOWING)
    intensity = np.minimum.reduce([averages.intensity(o) for o in others])
    columns = np.vstack([np.ones(len(averages)), logs, intensity, intensity**2])
    return columns.T, good


def likelihood_of_first(
    before: Averages,
    after: Averages,
    first: str,
    second: str,
    others: list[str],
    inside: tuple[BoolArray, BoolArray],
) -> float | None:
    """Log-likelihood of a change at `first` minus that of the opposite change at `second`.

    The other heights predict what both should read; the changed one departs from the prediction,
    the other does not.

    Args:
        before, after: Means in which the change is absent and present.
        first, second: The pair.
        others: Rotors of other heights that did not change.
        inside: Rows of `before` and `after` to be used.

    Returns:
        None where the other heights cannot tell.
    """
    if not others:
        return None
    x, good = _columns(before, others, [first, second])
    z, usable = _columns(after, others, [first, second])
    good, usable = good & inside[0], usable & inside[1]
    if good.sum() < _FEWEST or usable.sum() < _FEWEST:
        return None
    shifts = {}
    for name in (first, second):
        y = np.log(np.maximum(before.speed[name], 0.1))
        weights = np.linalg.lstsq(x[good], y[good], rcond=None)[0]
        rest_before = y[good] - x[good] @ weights
        rest = np.log(np.maximum(after.speed[name][usable], 0.1)) - z[usable] @ weights
        shifts[name] = (
            rest, rest_before, blocks_of(after)[usable], blocks_of(before)[good],
        )
    move, error = {}, 0.0
    for name, (rest, rest_before, block, block_before) in shifts.items():
        now = [np.median(rest[block == b]) for b in np.unique(block)]
        then = [np.median(rest_before[block_before == b]) for b in np.unique(block_before)]
        if min(len(now), len(then)) < _FEWEST_BLOCKS:
            return None
        move[name] = float(np.mean(now) - np.mean(then))
        # Neighbouring blocks share their weather: half of them count.
        error = max(
            error,
            float(np.sqrt(2.0 * (np.var(now) / len(now) + np.var(then) / len(then)))),
        )
    return (move[first] ** 2 - move[second] ** 2) / (2.0 * error**2)


def attributed(
    named: Named,
    healthy: Healthy | None,
    averages: Averages,
    pair: tuple[str, str],
    others: list[str],
) -> Named:
    """The same finding on the rotor that the other heights point at, if they do.

    Args:
        named: A finding of the pair.
        healthy: What is normal; None: nobody knows.
        averages: Means of the recording.
        pair: The two rotors.
        others: Rotors of other heights.
    """
    effect = named.term.effect.name
    if effect not in {"calibration_drift", "calibration_offset"}:
        return named
    mirror = [
        (t, b) for t, b in named.equal
        if t.effect.name == effect and t.instrument != named.term.instrument
        and (t.interval == ALWAYS) == (named.term.interval == ALWAYS)
    ]
    if not mirror:
        return named
    first, second = pair
    begin, end = named.term.interval
    inside = averages.elapsed >= begin
    if end is not None:
        inside &= averages.elapsed < end
    everything = np.ones(len(averages), dtype=bool)
    if named.term.interval != ALWAYS:
        before, rows = averages, (~inside, inside)
    elif healthy is not None:
        before, rows = healthy.averages, (np.ones(len(healthy.averages), dtype=bool), everything)
    else:
        return named
    evidence = likelihood_of_first(before, averages, first, second, others, rows)
    if evidence is None or abs(evidence) < DECISIVE:
        return named
    guilty = first if evidence > 0.0 else second
    rest = tuple((t, b) for t, b in named.equal if t.instrument == guilty)
    lost = tuple((t, b + abs(evidence)) for t, b in named.equal if t.instrument != guilty)
    if guilty == named.term.instrument:
        return replace(named, equal=rest, others=(*lost, *named.others))
    other = mirror[0][0]
    keep = tuple((t, b) for t, b in rest if t is not other)
    return replace(
        named, term=other, equal=keep, others=((named.term, abs(evidence)), *lost, *named.others)
    )
