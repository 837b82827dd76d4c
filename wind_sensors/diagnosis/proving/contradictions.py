"""What contradicts an explanation in its own simulation: effects that undo each other, or vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing import spectra
from wind_sensors.diagnosis.comparing.comparison import COURSE, OF_EDDIES, STATISTICS, Comparison
from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import bursts_of_bounces
from wind_sensors.diagnosis.explaining.explanation import Naming
from wind_sensors.diagnosis.explaining.intervals import cell_signatures, window_of
from wind_sensors.diagnosis.explaining.moments import squares_in_parts
from wind_sensors.diagnosis.explaining.terms import (
    ALWAYS,
    Interval,
    Term,
    of_one_equation,
    planted,
    reached_by,
)
from wind_sensors.diagnosis.healthy.whitening import in_series
from wind_sensors.station.model import Cup, Propeller, Station

FloatArray = npt.NDArray[np.float64]

LEAST_TOGETHER = 0.4
"""Two effects that change a signal must together change it by this share of the sum of what each
does, in squares: if they had nothing to do with each other it were 1."""

LEAST_CHANGE = 30.0
"""Sum of what each of two effects does to a signal, in squares of noise, above which that is asked:
of less, noise tells not much."""

QUARTERS = 4
"""They take each other back if they do so in each of so many parts of the record: a clock that
drifts makes good a filter's delay at one time only."""

PARTS = 8
"""What always holds, in a form that is certain, is the same in each of so many parts of the record,
and in each two and four of them in a row."""

VARIES = 30.0
"""A size of its own in one of them must not drop the cost by more than this: there are many parts
to choose from, and in any of them the wind may have taken another way to the reference."""

VARIES_SHARE = 0.03
"""Nor, of what gains much, by more than this share of the gain: there the simulation's own
inexactness is seen."""

CLOCK_VARIES_SHARE = 0.1
"""A delay's share may be larger: which eddies a reference shares with an instrument changes."""

DELAYS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0)
"""In each part of the record a delay is tried so many times as long. Where it is wrong by half a
second its signature says nothing: quick eddies are out of step."""

DELAY_GROWS = 6.0
"""Delays that grow steadily are tried as a whole, not by their signature: a constant one would be
the worse for it, so that less speaks against it."""

GROWTHS = (-1.0, -0.5, 0.5, 1.0)
"""By so much of itself a delay grows from the middle of the record to its end."""

AT_A_JUMP = 2.0
"""Where a clock's stamps jump, so many seconds say nothing: pulses on either side share a bin."""

GROWS = 12.0
"""A size that grows or shrinks steadily through the record must not drop the cost by more than
this, which is less than `VARIES`, for there is only one way to grow: a clock that drifts is no
delay."""

GROWS_SHARE = 0.02
"""Nor, of what gains much, by more than this share of the gain."""

SPEED_TIME = 5.0
"""Wind is weak or strong as it blows on average over so many seconds: as long as eddies that both
the reference and the instruments feel."""

WITH_SPEED = 14.0
"""An effect has one size in weak wind and in strong wind: one that grows or shrinks with the speed
must not drop the cost by more than this. Otherwise a fin that gives way is taken for a heavy vane,
a cable that pulls for a disc off centre."""

WITH_SPEED_SHARE = 0.02
"""Nor, of what gains much, by more than this share of the gain: the simulated form errs, too."""

WITH_SPEED_EXACT_SHARE = 0.005
"""The same where the form is certain: there only the reference errs."""

WITH_SPEED_FORM = 0.4
"""The same share, in units of the error that its form leaves of a size, of what errs by more."""

WITH_SPEED_FADING = 5.0
"""The same, whatever the gain, of what fades as the wind grows: its law is all that tells it from
others. True imbalances have dropped the cost by up to 1.5, those that were cables or discs off
centre by 5.3 to 15."""

DISCORD = 10.0
"""An effect that reaches several signals has one size on all of them: one of its own on each must
not drop the cost by more than this. A heavier rotor slows its own signal as thin air does, which
would let the vane overshoot as well."""

DISCORD_SHARE = 0.02
"""Nor, of what gains much, by more than this share of the gain."""

IN_EDDIES = 22.0
"""The same of a signal's course and the power of its eddies: of some thirty effects named rightly
on concealed data, of which it is asked, one differs by 15, an offset that an eddy-current brake
made, and a filter beside a delay by 13, the others by 6.5 at most; an imbalance that a sound vane's
eddies on a boat in a lull asked for differed by 35."""

BURSTS = 2.0
"""Bounces come in bursts if their number in a second varies by more than so many times what chance
gives: a radio, or a motor's driver, is taken for the contact. Of eight contacts that bounce none
had more than 1.1 times, of four radios' bursts each had 10 to 21 times."""

BURSTS_SHARE = 1.0
"""And if what it varies by beyond chance is more than so many squares of that number: a share of
bounces that goes with the rate varies, too. The bursts of those radios had 2.9 to 13 squares."""


def undo_each_other(naming: Naming, station: Station) -> bool:
    """Whether two effects take back on some instrument, all the time, most of what each does there.

    Unless the statistics of its raw signals show, un-undone, that something is done, or they are
    constants of one equation.

    Args:
        naming: The explanation.
        station: As commissioned.
    """
    if len(naming.fit.terms) < 2 or of_one_equation(naming.fit.terms):
        return False
    comparison = naming.whitener.comparison
    trust = naming.whitener.trust
    without = comparison.simulate(station).flat(comparison.channels)

    first, second = naming.fit.terms
    squares: list[FloatArray] = []
    in_quarters: list[FloatArray] = []
    for terms in ((first,), (second,), naming.fit.terms):
        moved = comparison.possible(planted(station, terms))
        if moved is None:
            return False
        change = np.nan_to_num(moved.flat(comparison.channels) - without)
        change = comparison.whitened_changes(change, trust)
        squares.append(np.bincount(comparison.part_of_each, change**2).astype(np.float64))
        in_quarters.append(_squares_in_quarters(comparison, change))
    changed, undone = _undone(squares, LEAST_CHANGE)
    acts, undone_there = _undone(in_quarters, LEAST_CHANGE / QUARTERS)
    channels = len(comparison.channels)
    always = np.all(undone_there | ~acts, axis=1)
    # Pulses that bounce and a slow rotor undo each other in the mean; the bounces are seen.
    seen = (changed & ~undone)[STATISTICS * channels : (STATISTICS + 1) * channels]
    return bool(np.any(undone[:channels] & always & ~seen))


def _undone(
    squares: list[FloatArray], least: float
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Where two effects change more than the least, and where they take most of it back.

    Args:
        squares: Of the changes by the first, by the second, by both.
        least: Sum of the first two that counts.
    """
    one, other, together = squares
    changed = one + other > least
    return changed, changed & (together < LEAST_TOGETHER * (one + other))


def _squares_in_quarters(comparison: Comparison, change: FloatArray) -> FloatArray:
    """Squares of white changes of each channel's series in parts of the record, (channels, 4)."""
    n = comparison.coefficients
    white = np.zeros((len(comparison.channels), comparison.grid.n))
    white[:, :n] = change[: n * len(comparison.channels)].reshape(-1, n)
    squares = [spectra.from_cosine(each) ** 2 for each in white]
    return np.array(
        [[part.sum() for part in np.array_split(each, QUARTERS)] for each in squares]
    )


def varies(naming: Naming, station: Station) -> bool:
    """Whether an effect that should hold throughout has another size in a part of the record.

    Only a form that is certain can be held to that: others depend on the wind in ways of their own,
    and what they leave on the same signals is nothing against it.

    Args:
        naming: The explanation.
        station: As commissioned.
    """
    null = naming.adequate
    comparison = null.comparison
    left = null.of(naming.fit.simulated)
    share = VARIES_SHARE * naming.gain
    uncertain = [term for term in naming.fit.terms if not term.effect.exact]
    inexact = reached_by(comparison, comparison.station, uncertain)
    for term in naming.fit.terms:
        alike = inexact & reached_by(comparison, comparison.station, [term])
        if term.effect.noisy or not term.effect.exact or alike:
            continue
        without = _without(naming, station, term)
        if without is None:
            continue
        begin, end = window_of(comparison, term.interval)
        large = share
        if term.effect.entrance == "clock":
            large = CLOCK_VARIES_SHARE * naming.gain
            own, steady = drop_by_own_delays(naming, station, term)
            most_steadily = max(DELAY_GROWS, GROWS_SHARE * naming.gain)
            if own > max(VARIES, large) or steady > most_steadily:
                return True
            begin, end = begin + AT_A_JUMP, end - AT_A_JUMP
        cuts = np.linspace(begin, end, PARTS + 1)
        cells = cell_signatures(comparison, without, naming.fit.simulated, null.trust, cuts)
        cells = null.through_standing(in_series(comparison, cells))
        for length in (1, 2, 4):
            parts = cells.reshape(PARTS // length, length, -1).sum(axis=1)
            power = np.maximum(np.einsum("ij,ij->i", parts, parts), 1.0)
            if np.any((parts @ left) ** 2 / power > max(VARIES, large)):
                return True
        if _drop_by_growth(cells, left) > max(GROWS, GROWS_SHARE * naming.gain):
            return True
    return False


def drop_by_own_delays(naming: Naming, station: Station, term: Term) -> tuple[float, float]:
    """Drop of the cost if each part of the record had a delay of its own, nought among them.

    Also where it is said not to hold: a clock that drifts is a delay that begins in the middle.

    Args:
        naming: The explanation.
        station: As commissioned.
        term: A delay, one of its effects.

    Returns:
        With any delays, and with delays that grow or shrink steadily through the record.
    """
    comparison = naming.adequate.comparison
    times = [1.0]
    costs = [_costs_in_parts(naming, naming.fit.simulated)]
    for longer in DELAYS:
        other = replace(term, values=term.effect.scaled(term.values, longer), interval=ALWAYS)
        terms = [other if t is term else t for t in naming.fit.terms]
        simulated = comparison.possible(planted(station, terms))
        if simulated is not None:
            times.append(longer)
            costs.append(_costs_in_parts(naming, simulated))
    whole = np.asarray(costs)
    each = float(np.sum(whole[0] - np.min(whole, axis=0)))
    order = np.argsort(times[1:])
    tried, table = np.asarray(times[1:])[order], whole[1:][order]
    if tried.size < 2:
        return each, 0.0
    middles = 2.0 * (np.arange(PARTS) + 0.5) / PARTS - 1.0
    growing = [
        sum(np.interp(1.0 + growth * x, tried, table[:, k]) for k, x in enumerate(middles))
        for growth in GROWTHS
    ]
    return each, float(np.sum(whole[0]) - min(growing))


def _costs_in_parts(naming: Naming, simulated: Simulated) -> FloatArray:
    """Cost of the series in each part of the record, shape (parts,)."""
    comparison = naming.adequate.comparison
    width = comparison.grid.n // PARTS
    return squares_in_parts(comparison, naming.adequate.of(simulated), width)[:PARTS]


def _drop_by_growth(cells: FloatArray, left: FloatArray) -> float:
    """Drop of the cost if an effect's size went along a straight line in time.

    Args:
        cells: White signatures of neighbouring parts of equal length, shape (parts, m).
        left: White vector of what is left, shape (m,).
    """
    whole = cells.sum(axis=0)
    growing = (np.arange(len(cells)) - 0.5 * (len(cells) - 1)) @ cells
    growing = growing - float(growing @ whole) / max(float(whole @ whole), 1e-9) * whole
    return float(growing @ left) ** 2 / max(float(growing @ growing), 1.0)


def dependence_on_speed(naming: Naming, station: Station, term: Term) -> float:
    """Drop of the cost if an effect had another size in strong wind than in weak wind.

    Args:
        naming: The explanation.
        station: As commissioned.
        term: One of its effects.
    """
    comparison = naming.adequate.comparison
    without = _without(naming, station, term)
    if without is None:
        return 0.0
    width = round(SPEED_TIME / comparison.grid.dt)
    strong = _ranks(uniform_filter1d(comparison.speed, width, mode="nearest"))
    halves = np.zeros((2, comparison.coefficients * len(comparison.channels)))
    for k in range(len(comparison.channels)):
        for half, part in zip(halves, (1.0 - strong, strong), strict=True):
            _put(half, naming, without, k, part)
    return _drop_by_own_sizes(naming, halves)


def discord(naming: Naming, station: Station, term: Term) -> float:
    """Drop of the cost if an effect had a size of its own on each signal that it reaches.

    Args:
        naming: The explanation.
        station: As commissioned.
        term: One of its effects.
    """
    comparison = naming.adequate.comparison
    # What a vane does to a propeller that it turns away from the wind is not its own size.
    if any(c.instrument == term.instrument for c in comparison.channels):
        return 0.0
    channel = comparison.channel_of_each
    on_each = [channel == k for k in range(len(comparison.channels))]
    return _drop_by_sizes_on(naming, station, term, on_each)


def is_discordant(naming: Naming, station: Station) -> bool:
    """Whether an effect has another size on one of the signals that it reaches than on another."""
    most = max(DISCORD, DISCORD_SHARE * naming.gain)
    return any(discord(naming, station, term) > most for term in naming.fit.terms)


def is_otherwise_in_eddies(naming: Naming, station: Station) -> bool:
    """Whether an effect has another size in the power of eddies than in the course of signals.

    Not asked of delays, which leave the power as it is, of damping and of what sticks or is drawn
    at random, whose jumps come when they like, nor of what the signals tell by themselves.
    """
    kind = naming.adequate.comparison.kind_of_each
    places = [kind == COURSE, np.isin(kind, OF_EDDIES)]
    most = max(IN_EDDIES, DISCORD_SHARE * naming.gain)
    for term in naming.fit.terms:
        effect = term.effect
        own_way = effect.own_law or effect.entrance == "clock" or term.leaves_noise
        if own_way or effect.legible or term.is_told:
            continue
        if _drop_by_sizes_on(naming, station, term, places) > most:
            return True
    return False


def comes_in_bursts(naming: Naming) -> bool:
    """Whether what should hit pulses one by one hits many at once, and then none for a while."""
    comparison = naming.whitener.comparison
    return any(
        term.effect.one_by_one and false_in_bursts(comparison, term.instrument, term.interval)
        for term in naming.fit.terms
    )


def false_in_bursts(comparison: Comparison, rotor: str, interval: Interval = ALWAYS) -> bool:
    """Whether a rotor's false pulses come in bursts.

    Args:
        comparison: The recording.
        rotor: Name.
        interval: What is looked at.
    """
    instrument = comparison.station.instrument(rotor)
    assert isinstance(instrument, Cup | Propeller)
    start = comparison.grid.start
    begin, end = (start + int(1e9 * edge) for edge in window_of(comparison, interval))
    uneven, squares = bursts_of_bounces(
        comparison.recording.pulses[rotor], instrument.pulses_per_revolution, begin, end
    )
    return uneven > BURSTS and squares > BURSTS_SHARE


def _without(naming: Naming, station: Station, term: Term) -> Simulated | None:
    """The simulation with the other effects only; None: it is not possible."""
    others = [t for t in naming.fit.terms if t is not term]
    return naming.adequate.comparison.possible(planted(station, others))


def _drop_by_sizes_on(
    naming: Naming, station: Station, term: Term, places: Sequence[npt.NDArray[np.bool_]]
) -> float:
    """Drop of the cost if an effect had a size of its own on each part of what is compared.

    Args:
        naming: The explanation.
        station: As commissioned.
        term: One of its effects.
        places: Which of what is compared belong to each part, each of shape (l,).
    """
    null = naming.adequate
    channels = null.comparison.channels
    without = _without(naming, station, term)
    if without is None:
        return 0.0
    change = naming.fit.simulated.flat(channels) - without.flat(channels)
    change = null.comparison.whitened_changes(np.nan_to_num(change), null.trust)
    each = np.array([np.where(place, change, 0.0) for place in places])
    return _drop_by_own_sizes(naming, each[np.any(each, axis=1)])


def _put(part: FloatArray, naming: Naming, without: Simulated, k: int, weight: FloatArray) -> None:
    """Write what an effect changes on one channel, weighted in time, into a part of it."""
    null = naming.adequate
    comparison = null.comparison
    n = comparison.coefficients
    part[k * n : (k + 1) * n] = comparison.whitened_while(
        comparison.channels[k], without, naming.fit.simulated, null.trust, weight
    )


def _drop_by_own_sizes(naming: Naming, parts: FloatArray) -> float:
    """Drop of the cost if each part of an effect had a size of its own instead of a common one."""
    if len(parts) < 2:
        return 0.0
    null = naming.adequate
    left = null.of(naming.fit.simulated)
    padded = np.pad(parts, ((0, 0), (0, left.size - parts.shape[1])))
    white = null.through_standing(padded)
    power = np.maximum(np.einsum("ij,ij->i", white, white), 1e-9)
    sizes = white @ left / power
    common = float(power @ sizes / power.sum())
    return float(power @ (sizes - common) ** 2)


def _ranks(series: FloatArray) -> FloatArray:
    """From nought at the smallest value to one at the largest, shape (n,)."""
    return np.asarray(np.argsort(np.argsort(series)) / max(series.size - 1, 1))


def goes_with_speed(naming: Naming, station: Station) -> bool:
    """Whether an effect has another size in strong wind than in weak wind.

    Not asked of friction, damping and of what sticks, slips or is drawn at random, whose own laws
    of the speed differ from bearing to bearing, nor of delays: the wind's way to the reference is
    one.
    """
    return any(
        dependence_on_speed(naming, station, term) > _most_with_speed(term, naming.gain)
        for term in naming.fit.terms
        if _is_asked_about_speed(term)
    )


def _is_asked_about_speed(term: Term) -> bool:
    effect = term.effect
    own_law = effect.own_law or effect.noisy or effect.occasional or effect.entrance == "clock"
    return effect.fades or not (own_law or effect.legible or term.is_told)


def _most_with_speed(term: Term, gain: float) -> float:
    """How much a size that goes with the speed may drop the cost."""
    effect = term.effect
    if effect.fades:
        return WITH_SPEED_FADING
    share = max(WITH_SPEED_SHARE, WITH_SPEED_FORM * effect.form_error)
    return max(WITH_SPEED, (WITH_SPEED_EXACT_SHARE if effect.exact else share) * gain)
