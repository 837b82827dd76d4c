"""Starting points that a rotor's pulses give away: intervals, silences, stalls, friction."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import LONG, SHORT
from wind_sensors.diagnosis.comparing.raw_statistics.slots import SlotIntervals, slot_intervals
from wind_sensors.diagnosis.effects.output import slot_values
from wind_sensors.diagnosis.explaining.intervals import interval_of, window_of
from wind_sensors.diagnosis.explaining.ruled_out import SOONER, comes_sooner
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term, suggested
from wind_sensors.station.losses import LOSS_SPEED
from wind_sensors.station.model import Cup, Rotor, Station

FloatArray = npt.NDArray[np.float64]

LONGEST_SILENCE = 4.0
"""A rotor without a pulse for longer [s], while it should turn fast, is taken to be silent."""

STRAY_BESIDE = 10.0
"""A pulse with more than so many missing before it and after it is a stray one: silence goes on."""

LEAST_SWING = 3.0
"""Change of temperature [K] from which a bearing may be seen to stiffen."""

BRAKES = (0.5, 2.0, 6.0)
"""Squared friction speeds at the mean temperature [m^2/s^2] to begin with, each with each of
`STIFFENINGS`: the two make up for each other, so that a search for one at a time gets lost."""

STIFFENINGS = (-0.03, -0.08, -0.16)
"""Coefficients of its change with the temperature [1/K] to begin with."""

HELD = 0.95
"""Quantile of the winds in which a rotor stands still that is taken for its starting speed: the
strongest of them are gusts that did not last."""

STARTING_SPEEDS = (0.7, 0.8, 0.9, 1.0)
"""Speeds from which a rotor that stands still in the wind starts to turn, relative to `HELD`, to
begin with, each with each of `BREAKAWAYS`: stops and starts make the cost too rough to search."""

BREAKAWAYS = (1.5, 2.2, 3.2, 4.6, 6.8)
"""Friction at rest relative to that of the turning rotor to begin with."""

STANDS_STILL = 0.2
"""Rate [m/s] below which a rotor counts as standing: less than any starting speed."""

LEAST_HELD = 0.02
"""Share of the record for which a bearing that sticks has to hold a rotor: in a lull any stops."""

PARTS_OF_PULSES = 30
"""Parts of the record, at whose ends a counter may begin or cease to lose what follows too soon,
or slots to be uneven."""

PASSING_UNEVENNESS = 1.15
"""Slots are uneven for a part of the record if that explains so many times as much."""

SHORTEST_SHARE = 0.001
"""Share of intervals that are shorter than a dead time all the same: pulses of another cause."""

EDGE = 0.03
"""Intervals are just above or below the shortest within this share of it: as much as a
rotor's rate varies from pulse to pulse."""

SHARP = 6.0
"""A counter's dead time shows if so many times as many intervals lie just above the shortest as
below: a fit of the whole signal would trade it for another gain."""

TELLING_SHARE = 0.004
"""Share of a rotor's intervals from which on those that are too long, too short or missing suggest
an effect of its counter: by that much stations differ from their simulation anyway."""

TELLING_UNEVENNESS = 0.003
"""Unevenness of the slots, as their statistics measure it, from which on the pulses are asked where
each slot is."""

PARTS_OF_LOSSES = 8
"""Parts of the record in each of which pulses that are lost all the time are lost."""

UNSTEADY = 4.0
"""They are not lost all the time if their number in one of these differs from what is expected by
so many times what chance makes."""

UNSTEADY_SHARE = 0.5
"""And by this share of it: how losses go with the rate is known only so well."""

PASSED = 1.3
"""Intervals that should be so many times as long as a dead time pass it, whatever they scatter by:
what is lost of them is lost otherwise."""

LEAST_PASSED = 500
"""Of fewer such intervals nobody knows whether `LOST_BESIDE` is missing: it were one."""

LOST_BESIDE = 0.002
"""Share of them above which pulses are lost beside a dead time."""

APART = 5.0
"""Bounces tell their delay if so many times as many intervals are shorter than three tenths of the
usual one as between that and four tenths: a fit would trade it for another rate."""

GROWS = 4.0
"""Losses grow with the rate if the faster half of the intervals shows more of them than the slower
half by so many standard errors."""

MOST_GROWTH = 4.0
"""Exponent beyond which no search begins."""

_RATE_THAT_TURNS = 1.5
"""Rate [m/s] at which a healthy rotor certainly turns: beyond any starting speed."""


def rotor_guesses(
    comparison: Comparison, station: Station, rotor: Rotor, rate: FloatArray
) -> list[Term]:
    """Effects that the pulses of a rotor suggest, with starting values.

    Args:
        comparison: The recording.
        station: As commissioned.
        rotor: Gives the pulses.
        rate: That of the healthy rotor [m/s], at the bins.
    """
    return [
        *_frictions(comparison, rotor),
        *_sticking(comparison, rotor, rate),
        *_pulse_guesses(comparison, station, rotor),
        *_silence(comparison, rotor, rate),
    ]


def _frictions(comparison: Comparison, rotor: Rotor) -> list[Term]:
    """Bearings that brake alike at the record's mean temperature and change with it differently."""
    temperature = comparison.drive.temperature
    if temperature is None or float(np.ptp(temperature)) < LEAST_SWING:
        return []
    away = float(np.mean(temperature)) - rotor.reference_temperature
    return [
        suggested(
            "bearing_friction", rotor.name,
            friction_speed=float(np.sqrt(brake * np.exp(-coefficient * away))),
            temperature_coefficient=coefficient,
            breakaway=1.0,
        )
        for brake in BRAKES
        for coefficient in STIFFENINGS
    ]


def _sticking(comparison: Comparison, rotor: Rotor, rate: FloatArray) -> list[Term]:
    """Bearings that hold a rotor where it should turn, and let it go late.

    Args:
        comparison: The recording.
        rotor: Gives the pulses.
        rate: That of the healthy rotor [m/s], at the bins.
    """
    measured = comparison.measured.series[f"{rotor.name}/rotor_rate"]
    held = (measured < STANDS_STILL) & (rate > _RATE_THAT_TURNS)
    if np.mean(held) < LEAST_HELD:
        return []
    fast = float(np.quantile(rate[held], HELD))
    return [
        suggested(
            "bearing_friction", rotor.name, friction_speed=share * fast / breakaway**0.5,
            temperature_coefficient=0.0, breakaway=breakaway,
        )
        for share in STARTING_SPEEDS
        for breakaway in BREAKAWAYS
    ]


def _pulse_guesses(comparison: Comparison, station: Station, rotor: Rotor) -> list[Term]:
    time = comparison.grid.seconds(comparison.recording.pulses[rotor.name].time)
    expected, _ = comparison.signals(station, (rotor.name,))
    expected_time = comparison.grid.seconds(expected[rotor.name].time)
    if time.size < 100 or expected_time.size < 100:
        return []
    interval, usual = np.diff(time), np.diff(expected_time)
    local = np.interp(time[1:], expected_time[1:], np.convolve(usual, np.ones(9) / 9.0, "same"))
    relative = interval / np.maximum(local, 1e-9)
    out = []
    long = float(np.mean(relative > LONG))
    short = float(np.mean(relative < SHORT))
    usual_long = float(np.mean(usual[1:] > LONG * usual[:-1]))
    dead = _dead_times(comparison, rotor, (time[1:], interval), (expected_time[1:], usual))
    dead = [_without_chance(term, relative > LONG, local, usual_long) for term in dead]
    if long > TELLING_SHARE + 2.0 * usual_long and not any(term.held for term in dead):
        per_turn = 2.0 * np.pi * rotor.calibration_distance / rotor.pulses_per_revolution
        speed = per_turn / np.maximum(local, 1e-9)
        out.append(_losses_by_chance(rotor, relative > LONG, speed))
    out.extend(dead)
    if short > TELLING_SHARE:
        delay = float(np.mean(interval[relative < SHORT]))
        bounce = suggested(
            "extra_pulses", rotor.name,
            bounce_probability=min(short / (1.0 - short), 0.9),
            bounce_delay=float(np.clip(delay, 0.0002, 0.1)),
        )
        shorter = float(np.mean(relative < 0.3))
        told = shorter > APART * (short - shorter)
        out.append(replace(bounce, held=frozenset({"bounce_delay"}) if told else frozenset()))
    scatter, once = comparison.measured.statistics[f"{rotor.name}/rotor_rate"][
        BANDS + 2 : BANDS + 4
    ]
    slots = rotor.pulses_per_revolution
    if slots > 2 and max(scatter, once) > TELLING_UNEVENNESS:
        seen = slot_intervals(time, slots)
        holds = _uneven_span(comparison, seen)
        if isinstance(rotor, Cup):
            wind_from = np.interp(seen.begin, comparison.grid.centres, comparison.wind_from)
            aside, left = seen.without_what_turns(wind_from)
            if left < seen.left_by(*window_of(comparison, holds)):
                seen, holds = aside, _uneven_span(comparison, aside)
        told = seen.displacements(*window_of(comparison, holds)).tolist()
        uneven = suggested("encoder_slot_error", rotor.name, **slot_values(told))
        out.append(replace(uneven, interval=holds))
    return out


def _without_chance(
    term: Term, long: npt.NDArray[np.bool_], usual: FloatArray, usual_long: float
) -> Term:
    """A told dead time alone, where no pulses are lost at rates that it lets pass.

    Beside another effect a thousandth of losses that are not there follows the steps that pulses
    make of the cost, and the other effect stops short of its size.

    Args:
        term: A dead time.
        long: Which intervals are too long for their time.
        usual: What they should be [s].
        usual_long: Share of long ones where none is lost.
    """
    passed = long[usual > PASSED * term.values["dead_time"]]
    if not term.held or passed.size < LEAST_PASSED:
        return term
    if passed.mean() > LOST_BESIDE + 2.0 * usual_long:
        return term
    return replace(term, held=term.held | {"loss_probability", "loss_growth"})


def _losses_by_chance(rotor: Rotor, long: npt.NDArray[np.bool_], speed: FloatArray) -> Term:
    """Random losses, as often as intervals are long; growing with the rate where these do.

    How they grow the intervals tell if pulses are lost all the time.

    Args:
        rotor: Gives the pulses.
        long: Which intervals are too long for their time.
        speed: That the healthy rotor indicates then [m/s].
    """
    share, growth = float(long.mean()), 0.0
    fast = speed > np.median(speed)
    # In a wind that never changes no interval is faster than the median.
    often, seldom = (float(np.mean(long[k])) if k.any() else 0.0 for k in (fast, ~fast))
    error = np.sqrt(2.0 * share * (1.0 - share) / (0.5 * long.size))
    if seldom > 0.0 and often - seldom > GROWS * error:
        faster = float(speed[fast].mean() / speed[~fast].mean())
        growth = min(float(np.log(often / seldom) / np.log(faster)), MOST_GROWTH)
    lost = (speed / LOSS_SPEED) ** growth
    grown = float(np.mean(lost))
    found = suggested(
        "missed_pulses", rotor.name,
        dead_time=0.0, loss_probability=min(share / grown, 0.6), loss_growth=growth,
    )
    steady = _is_steady(long, lost * share / grown)
    return replace(found, held=frozenset({"loss_growth"}) if steady else frozenset())


def _is_steady(long: npt.NDArray[np.bool_], expected: FloatArray) -> bool:
    """Whether pulses are lost about as often as expected in each part of the record.

    Args:
        long: Which intervals are too long for their time.
        expected: Chance of each that it is.
    """
    for seen, chance in zip(
        np.array_split(long, PARTS_OF_LOSSES), np.array_split(expected, PARTS_OF_LOSSES),
        strict=True,
    ):
        wanted, away = float(chance.sum()), float(seen.sum() - chance.sum())
        if abs(away) > max(UNSTEADY * np.sqrt(wanted + 1.0), UNSTEADY_SHARE * wanted):
            return False
    return True


def _uneven_span(comparison: Comparison, seen: SlotIntervals) -> Interval:
    """When slots are uneven."""
    length = comparison.grid.n * comparison.grid.dt
    cuts = np.linspace(0.0, length, PARTS_OF_PULSES + 1)
    shown = seen.shown_in(cuts)
    told = np.isfinite(shown)
    if not told.any():
        return ALWAYS
    number = np.concatenate(([0.0], np.cumsum(told)))
    total = np.concatenate(([0.0], np.cumsum(np.where(told, shown, 0.0))))
    begin, end = np.triu_indices(cuts.size, 1)
    within, parts = total[end] - total[begin], np.maximum(number[end] - number[begin], 1.0)
    # Drop of the sum of squares by one level within a span and nought outside it.
    drop = within**2 / parts
    best = int(np.argmax(drop))
    if drop[best] < PASSING_UNEVENNESS * total[-1] ** 2 / number[-1]:
        return ALWAYS
    return interval_of(comparison, float(cuts[begin[best]]), float(cuts[end[best]]))


def _dead_times(
    comparison: Comparison,
    rotor: Rotor,
    recorded: tuple[FloatArray, FloatArray],
    expected: tuple[FloatArray, FloatArray],
) -> list[Term]:
    """Dead times without which there would be shorter intervals, all the time or in a part of it.

    Args:
        comparison: The recording.
        rotor: Gives the pulses.
        recorded, expected: End [s since the first bin] and length [s] of each interval.
    """
    length = comparison.grid.n * comparison.grid.dt
    cuts = np.linspace(0.0, length, PARTS_OF_PULSES + 1)
    found = [_sorted_between(cuts, *recorded), _sorted_between(cuts, *expected)]
    shortest_few = [
        cell[: int(SHORTEST_SHARE * recorded[1].size) + 1] for cell in found[0]
    ]
    best: tuple[int, float, Interval] | None = None
    # The whole record comes first, then what begins or ends in it: a part of it must miss more.
    for begin, end in sorted(
        itertools.combinations(range(PARTS_OF_PULSES + 1), 2),
        key=lambda span: (span[0] > 0) + (span[1] < PARTS_OF_PULSES),
    ):
        intervals = sum(cell.size for cell in found[0][begin:end])
        usual = sum(cell.size for cell in found[1][begin:end])
        if intervals < 100 or usual < 100:
            continue
        few = np.concatenate(shortest_few[begin:end])
        rank = int(SHORTEST_SHARE * intervals)
        shortest = float(np.partition(few, rank)[rank])
        least = SOONER * shortest
        missing = sum(int(np.searchsorted(cell, least)) for cell in found[1][begin:end])
        if missing > TELLING_SHARE * usual and (best is None or missing > best[0]):
            best = missing, shortest, interval_of(comparison, cuts[begin], cuts[end])
    if best is None:
        return []
    _, shortest, holds = best
    told = _is_sharp(np.concatenate(found[0]), shortest)
    since = recorded[0] + comparison.drive.elapsed
    if told and not comes_sooner(since, recorded[1], shortest, holds):
        # In a lull nothing comes soon: that the counter hears again there is not seen.
        holds = ALWAYS
    return [
        replace(
            suggested(
                "missed_pulses",
                rotor.name,
                dead_time=share * shortest,
                loss_probability=0.0,
                loss_growth=0.0,
            ),
            interval=holds,
            held=frozenset({"dead_time"}) if told else frozenset(),
        )
        for share in ((1.0,) if told else (1.0, 0.9))
    ]


def _is_sharp(intervals: FloatArray, shortest: float) -> bool:
    """Whether many intervals are a little longer than the shortest, and hardly any a little less.

    The end of a distribution that the wind makes thins out; a counter cuts it off.
    """
    near = np.abs(intervals / shortest - 1.0) < EDGE
    above = np.count_nonzero(near & (intervals > shortest))
    return bool(above > SHARP * np.count_nonzero(near & (intervals <= shortest)))


def _sorted_between(cuts: FloatArray, at: FloatArray, values: FloatArray) -> list[FloatArray]:
    """Values between neighbouring cuts, each lot ascending; `at` ascends."""
    places = np.searchsorted(at, cuts)
    return [np.sort(values[i:j]) for i, j in itertools.pairwise(places)]


def _run(holds: npt.NDArray[np.bool_], place: int) -> tuple[int, int]:
    """First and last place of the run without a break around a place, which counts in any case."""
    breaks = np.flatnonzero(~holds)
    before, after = breaks[breaks < place], breaks[breaks > place]
    first = int(before[-1]) + 1 if before.size else 0
    last = int(after[0]) - 1 if after.size else holds.size - 1
    return first, last


def _silence(comparison: Comparison, rotor: Rotor, rate: FloatArray) -> list[Term]:
    time = comparison.grid.seconds(comparison.recording.pulses[rotor.name].time)
    length = comparison.grid.n * comparison.grid.dt
    edges = np.concatenate(([0.0], np.clip(time, 0.0, length), [length]))
    gaps = np.diff(edges)
    longest = int(np.argmax(gaps))
    turned = np.concatenate(([0.0], np.cumsum(rate) * comparison.grid.dt))
    turned /= 2.0 * np.pi * rotor.calibration_distance
    missed = np.diff(np.interp(edges, comparison.grid.edges, turned)) * rotor.pulses_per_revolution
    first, last = _run(missed > STRAY_BESIDE, longest)
    begin, end = float(edges[first]), float(edges[last + 1])
    if end - begin < LONGEST_SILENCE:
        return []
    inside = rate[int(begin / comparison.grid.dt) : int(end / comparison.grid.dt)]
    if inside.size == 0 or np.median(inside) < _RATE_THAT_TURNS:
        return []
    since = comparison.drive.elapsed
    return [
        suggested(
            "stuck_sensor", rotor.name,
            start=begin + since, stop=end + since, reading=0.0, known=0.0,
        )
    ]
