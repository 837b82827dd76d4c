"""Starting points that the raw signals give away: steps, gaps, repeats, pulse intervals."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from wind_sensors.diagnosis.comparing.comparison import Comparison
from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import unevenness_in_parts
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION
from wind_sensors.diagnosis.effects.platform import dead_log
from wind_sensors.diagnosis.explaining.fitting import ALWAYS, Interval, Term
from wind_sensors.diagnosis.explaining.intervals import interval_of
from wind_sensors.diagnosis.explaining.jumps import late_stamps
from wind_sensors.station.model import Angle, Rotor, Station
from wind_sensors.station.signals import Angles, BoolArray, Pulses, erratic

FloatArray = npt.NDArray[np.float64]
Guesses = dict[tuple[str, str], list[Term]]

LONGEST_REPEAT = 4.0
"""A vane that repeats one reading for longer [s] in a wind that turns it is taken to be stuck."""

LONGEST_SILENCE = 4.0
"""A rotor without a pulse for longer [s], while it should turn fast, is taken to be silent."""

STRAY_BESIDE = 10.0
"""A pulse with more than so many missing before it and after it is a stray one: silence goes on."""

LEAN = 15.0
"""Lean of the axis [deg] from which its fit begins: what it does to a rotor grows with its square,
so that a small lean shows no way."""

LEAST_SWING = 3.0
"""Change of temperature [K] from which a bearing may be seen to stiffen."""

BRAKES = (0.5, 2.0, 6.0)
STIFFENINGS = (-0.03, -0.08, -0.16)
"""Squared friction speeds at the mean temperature [m^2/s^2] and coefficients [1/K] to begin with:
the two make up for each other, so that a search for one at a time gets lost."""

HOLDING_FRICTIONS = (1.2, 1.6, 2.0, 2.4)
BREAKAWAYS = (1.5, 2.2, 3.2, 4.6)
"""Friction speeds [m/s], and friction at rest relative to that of the turning rotor, to begin with
where a rotor stands still in the wind: its stops and starts make the cost too rough to search."""

STANDS_STILL = 0.2
LEAST_HELD = 0.02
"""Rate [m/s] below which a rotor counts as standing, and share of the record for which a bearing
that sticks has to hold it."""

JET = 2.5
JET_SPREADS = ((0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25))
"""Induced velocity [m/s] of rotors and shares of it that blow forward and to the left, to begin
with: a small jet from above moves nothing that turns about an upright axis."""

BLIND_EFFECTS = frozenset({"axis_tilt", "clock_drift", "bearing_friction", "rotor_downwash"})
"""Effects that are tried whether or not the screening sees them."""

BLIND_IN_PARTS = (BLIND_EFFECTS - {"clock_drift"}) | {"potentiometer_gap"}
"""Effects that are tried in the minutes in which others are seen: the blind ones but a clock that
drifted, which stays wrong, and a gap that the wind crosses on its way through other directions."""

DRIFTS = (-4000.0, -2000.0, -1000.0, 1000.0, 2000.0, 4000.0)
"""Drifts of a clock [ppm] to begin with: past a lag of a second or two the signals have lost each
other, and nothing shows the way."""

PARTS_OF_PULSES = 30
"""Parts of the record, at whose ends a counter may begin or cease to lose what follows too soon,
or slots to be uneven."""

PASSING_UNEVENNESS = 1.15
"""Slots are uneven for a part of the record if that explains so many times as much."""

SHORTEST_SHARE = 0.001
"""Share of intervals that are shorter than a dead time all the same: pulses of another cause."""

EDGE = 0.03
SHARP = 6.0
"""A counter's dead time shows if so many times as many intervals lie just above the shortest,
within this share of it, as below: a fit of the whole signal would trade it for another gain."""

LEAST_ERRATIC = 0.004
"""Share of erratic readings from which a gap with a floating wiper is considered."""

NARROWER = (1.0, 0.65, 0.4)
"""Widths to begin with, in widths of the sector where the nose should have been: the reference
does not tell that within some degrees."""

REPEATED = 6.0
LEAST_REPEATS = 20
FEWEST_STEPS = 3
SMOOTHED_READINGS = 101
SHORTEST_COARSE = 60.0
"""Readings that come so many times as often as others, and so often, are coarse: at least three
different ones, most of so many readings in a row, for so long [s]."""

_RATE_THAT_TURNS = 1.5


def _term(effect: str, instrument: str, **values: float) -> Term:
    return Term(catalogue()[effect], instrument, values)


def guesses_of(comparison: Comparison, station: Station) -> Guesses:
    """Effects that the raw signals suggest, with starting values, by effect and instrument."""
    out: Guesses = {}
    silent = dead_log(comparison.drive)
    if silent is not None:
        still = _term("platform_velocity", PLATFORM, velocity_share=1.0, position_share=1.0)
        out[still.key] = [replace(still, interval=interval_of(comparison, *silent))]
    leans = [
        _term("axis_tilt", STATION, tilt_x=LEAN * np.cos(towards), tilt_y=LEAN * np.sin(towards))
        for towards in np.arange(8) * np.pi / 4.0
    ]
    out[leans[0].key] = leans
    if station.platform is not None:
        jets = [
            _term(
                "rotor_downwash", PLATFORM,
                induced_velocity=JET, wake_skew=0.0, forward=forward, leftward=leftward,
            )
            for forward, leftward in JET_SPREADS
        ]  # fmt: skip
        out[jets[0].key] = jets
    clocks = [channel.instrument for channel in comparison.channels]
    for instrument in [*clocks, STATION]:
        drifts = [_term("clock_drift", instrument, drift=drift) for drift in DRIFTS]
        out[drifts[0].key] = drifts
    simulated = comparison.simulate(station)
    for channel in comparison.channels:
        entry = station.instrument(channel.instrument)
        stamps: Pulses | Angles
        if isinstance(entry, Rotor):
            stamps = comparison.recording.pulses[entry.name]
            rate = simulated.series[channel.name]
            terms = [
                *_frictions(comparison, entry),
                *_sticking(comparison, entry, rate),
                *_pulse_guesses(comparison, station, entry),
                *_silence(comparison, entry, rate),
            ]
        else:
            assert isinstance(entry, Angle)
            stamps = comparison.recording.angles[entry.name]
            terms = [
                *_floating(comparison, channel),
                *_reading_guesses(comparison, channel),
                *_repeats(comparison, entry),
            ]
        terms += late_stamps(comparison, entry.name, comparison.grid.seconds(stamps.time))
        for term in terms:
            out.setdefault(term.key, []).append(term)
    return out


def _frictions(comparison: Comparison, rotor: Rotor) -> list[Term]:
    """Bearings that brake alike at the record's mean temperature and change with it differently."""
    temperature = comparison.drive.temperature
    if temperature is None or float(np.ptp(temperature)) < LEAST_SWING:
        return []
    away = float(np.mean(temperature)) - rotor.reference_temperature
    return [
        _term(
            "bearing_friction", rotor.name,
            friction_speed=float(np.sqrt(brake * np.exp(-coefficient * away))),
            temperature_coefficient=coefficient,
            breakaway=1.0,
        )
        for brake in BRAKES
        for coefficient in STIFFENINGS
    ]  # fmt: skip


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
    return [
        _term(
            "bearing_friction", rotor.name, friction_speed=speed, temperature_coefficient=0.0,
            breakaway=breakaway,
        )
        for speed in HOLDING_FRICTIONS
        for breakaway in BREAKAWAYS
    ]  # fmt: skip


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
    long = float(np.mean(relative > 1.6))
    short = float(np.mean(relative < 0.4))
    usual_long = float(np.mean(usual[1:] > 1.6 * usual[:-1]))
    dead = _dead_times(comparison, rotor, (time[1:], interval), (expected_time[1:], usual))
    if long > 0.004 + 2.0 * usual_long and not any(term.held for term in dead):
        out.append(
            _term("missed_pulses", rotor.name, dead_time=0.0, loss_probability=min(long, 0.6))
        )
    out.extend(dead)
    if short > 0.004:
        delay = float(np.median(interval[relative < 0.4]))
        out.append(
            _term(
                "extra_pulses", rotor.name,
                bounce_probability=min(2.0 * short, 0.9),
                bounce_delay=float(np.clip(delay, 0.0002, 0.1)),
            )
        )  # fmt: skip
    scatter, once = comparison.measured.statistics[f"{rotor.name}/rotor_rate"][
        BANDS + 2 : BANDS + 4
    ]
    slots = rotor.pulses_per_revolution
    if slots > 2 and max(scatter, once) > 0.01:
        # An interval is the difference of two slots' displacements.
        holds, larger = _uneven_span(comparison, time, slots)
        uneven = _term(
            "encoder_slot_error", rotor.name,
            scatter=larger * float(scatter) / np.sqrt(2.0),
            once_per_turn=larger * float(once) / (2.0 * np.sin(np.pi / slots)),
        )  # fmt: skip
        out.append(replace(uneven, interval=holds))
    return out


def _uneven_span(
    comparison: Comparison, time: FloatArray, slots: int
) -> tuple[Interval, float]:
    """When slots are uneven, and how much more so then than in the mean of the whole record."""
    length = comparison.grid.n * comparison.grid.dt
    cuts = np.linspace(0.0, length, PARTS_OF_PULSES + 1)
    shown = unevenness_in_parts(time, slots, cuts)
    told = np.isfinite(shown)
    if not told.any():
        return ALWAYS, 1.0
    number = np.concatenate(([0.0], np.cumsum(told)))
    total = np.concatenate(([0.0], np.cumsum(np.where(told, shown, 0.0))))
    begin, end = np.triu_indices(cuts.size, 1)
    within, parts = total[end] - total[begin], np.maximum(number[end] - number[begin], 1.0)
    # Drop of the sum of squares by one level within a span and nought outside it.
    drop = within**2 / parts
    best = int(np.argmax(drop))
    if drop[best] < PASSING_UNEVENNESS * total[-1] ** 2 / number[-1]:
        return ALWAYS, 1.0
    holds = interval_of(comparison, float(cuts[begin[best]]), float(cuts[end[best]]))
    return holds, float(within[best] / parts[best] / (total[-1] / number[-1]))


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
    ]  # fmt: skip
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
        missing = sum(int(np.searchsorted(cell, 0.97 * shortest)) for cell in found[1][begin:end])
        if missing > 0.004 * usual and (best is None or missing > best[0]):
            best = missing, shortest, interval_of(comparison, cuts[begin], cuts[end])
    if best is None:
        return []
    _, shortest, holds = best
    told = _is_sharp(np.concatenate(found[0]), shortest)
    return [
        replace(
            _term("missed_pulses", rotor.name, dead_time=share * shortest, loss_probability=0.0),
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
        _term(
            "stuck_sensor", rotor.name,
            start=begin + since, stop=end + since, reading=0.0, known=0.0,
        )
    ]  # fmt: skip


def _repeats(comparison: Comparison, vane: Angle) -> list[Term]:
    readings = comparison.recording.angles[vane.name]
    time = comparison.grid.seconds(readings.time)
    if time.size < 50:
        return []
    changed = np.flatnonzero(np.abs(np.diff(readings.angle)) > 1e-9) + 1
    starts = np.concatenate(([0], changed))
    stops = np.concatenate((changed, [time.size])) - 1
    lasting = time[stops] - time[starts]
    longest = int(np.argmax(lasting))
    usual = float(np.quantile(lasting, 0.98))
    if lasting[longest] < max(LONGEST_REPEAT, 4.0 * usual):
        return []
    since = comparison.drive.elapsed
    return [
        _term(
            "stuck_sensor", vane.name,
            start=float(time[starts[longest]]) + since, stop=float(time[stops[longest]]) + since,
            reading=float(np.degrees(readings.angle[starts[longest]])), known=1.0,
        )
    ]  # fmt: skip


def _reading_guesses(comparison: Comparison, channel: Channel) -> list[Term]:
    vane = channel.instrument
    delivered = comparison.recording.angles[vane].angle
    readings = delivered[np.isfinite(delivered)]
    if readings.size < 200:
        return []
    out = []
    degrees = np.degrees(readings)
    values, counts = np.unique(np.round(degrees, 4), return_counts=True)
    steps = np.diff(values)
    steps = steps[steps > 0.02]
    if values.size < 0.25 * readings.size and steps.size > 1:
        step = float(np.median(steps[steps < 1.5 * np.quantile(steps, 0.2) + 1e-9]))
        if np.sum(counts) / values.size > 8.0 and step > 0.3:
            turns = np.exp(2j * np.pi * values / step)
            origin = float(np.angle(np.mean(turns))) * step / (2.0 * np.pi)
            out.append(_term("quantisation", vane, step=step, origin=origin))
    if not out:
        out.extend(_coarse_for_a_while(comparison, vane))
    common = values[counts > max(0.004 * readings.size, 20)]
    hole = _hole(degrees)
    if hole is not None:
        out.append(_gap(vane, *hole))
    if 1 <= common.size <= 3:
        low, high = float(common.min()), float(common.max())
        if common.size == 1:
            beside = [(low + 5.0 * side, 10.0) for side in (-1.0, 1.0)]
            there = np.abs(np.degrees(delivered) - low) < 1e-3
            sectors = [_sector(comparison, channel, there), *([hole] if hole else beside)]
            out.extend(_gap(vane, *sector, 1, low) for sector in sectors)
            out.extend(_gap(vane, *sector) for sector in sectors)
        else:
            width = high - low
            centre = 0.5 * (low + high)
            if width > 180.0:
                width, centre = 360.0 - width, centre + 180.0
            if width < 90.0:
                out.append(_gap(vane, centre, width))
    return out


def _coarse_for_a_while(comparison: Comparison, vane: str) -> list[Term]:
    """Quantisation in the longest part of the record in which readings repeat a few values."""
    readings = comparison.recording.angles[vane]
    told = np.isfinite(readings.angle)
    degrees = np.round(np.degrees(readings.angle[told]), 4)
    time = comparison.grid.seconds(readings.time[told])
    values, place, counts = np.unique(degrees, return_inverse=True, return_counts=True)
    repeated = counts > max(REPEATED * degrees.size / values.size, LEAST_REPEATS)
    if np.count_nonzero(repeated) < FEWEST_STEPS:
        return []
    coarse = repeated[place]
    usual = uniform_filter1d(coarse.astype(np.float64), SMOOTHED_READINGS) > 0.5
    edges = np.flatnonzero(np.diff(np.concatenate(([False], usual, [False])).astype(np.int8)))
    begin, end = max(
        zip(edges[::2], edges[1::2], strict=True), key=lambda run: float(run[1] - run[0])
    )
    inside = np.unique(degrees[begin:end][coarse[begin:end]])
    if inside.size < FEWEST_STEPS or time[end - 1] - time[begin] < SHORTEST_COARSE:
        return []
    step = float(np.median(np.diff(inside)))
    turns = np.exp(2j * np.pi * inside / step)
    origin = float(np.angle(np.mean(turns))) * step / (2.0 * np.pi)
    holds = interval_of(comparison, float(time[begin]), float(time[end - 1]))
    return [replace(_term("quantisation", vane, step=step, origin=origin), interval=holds)]


def _gap(
    vane: str, centre: float, width: float, form: int = 0, reading: float = 0.0
) -> Term:
    return _term(
        "potentiometer_gap", vane, centre=centre, width=width, reading=reading, form=float(form)
    )


def _floating(comparison: Comparison, channel: Channel) -> list[Term]:
    """A gap where readings jump about, in the sector in which they do."""
    wrong = erratic(comparison.recording.angles[channel.instrument])
    if np.mean(wrong) < LEAST_ERRATIC:
        return []
    centre, width = _sector(comparison, channel, wrong)
    sectors = [(centre, share * width) for share in NARROWER]
    return [
        _gap(channel.instrument, *sector, 2)
        for sector in (*_mostly(comparison, channel, wrong, centre), *sectors)
    ]


def _mostly(
    comparison: Comparison, channel: Channel, where: BoolArray, inside: float
) -> list[tuple[float, float]]:
    """Centre and width of the sector in which some readings outnumber others [deg]."""
    away = np.degrees(headings(comparison, channel)) - inside
    away = np.mod(away + 180.0, 360.0) - 180.0
    bins = np.arange(-180.0, 181.0)
    some, _ = np.histogram(away[where], bins)
    every, _ = np.histogram(away, bins)
    most = 2 * some > every
    if not most[180]:
        return []
    # No reading says nothing of a degree; the last ones that speak for the sector bound it.
    others = np.flatnonzero((every > 0) & ~most)
    low, high = others[others < 180].max(initial=-1) + 1, others[others > 180].min(initial=360)
    spoken = low + np.flatnonzero(most[low:high])
    low, high = int(spoken[0]), int(spoken[-1]) + 1
    return [(inside + 0.5 * (low + high) - 180.0, float(high - low))]


def headings(comparison: Comparison, channel: Channel) -> FloatArray:
    """Where the nose should be at each reading [rad]."""
    time = comparison.recording.angles[channel.instrument].time
    heading = comparison.direction + comparison.expected.get(channel.name, 0.0)
    return np.interp(comparison.grid.seconds(time), comparison.grid.centres, heading)


def _sector(comparison: Comparison, channel: Channel, where: BoolArray) -> tuple[float, float]:
    """Centre and width of the sector in which the nose should be at some readings [deg]."""
    at = headings(comparison, channel)[where]
    centre = float(np.angle(np.mean(np.exp(1j * at))))
    away = np.angle(np.exp(1j * (at - centre)))
    low, middle, high = np.degrees(np.quantile(away, (0.1, 0.5, 0.9)))
    return float(np.degrees(centre) + middle), float(np.clip(high - low, 3.0, 90.0))


def _hole(degrees: FloatArray) -> tuple[float, float] | None:
    """Centre and width of a sector without readings between sectors with many [deg]."""
    counts, _ = np.histogram(np.mod(degrees, 360.0), bins=360, range=(0.0, 360.0))
    # A reading that comes again and again is no wind.
    counts = np.minimum(counts, 5.0 * np.median(counts[counts > 0]))
    beside = np.convolve(np.concatenate((counts[-20:], counts, counts[:20])), np.ones(20), "valid")
    below, above = beside[:360], beside[21:381]
    least = 0.015 * np.sum(counts)
    empty = (counts < 0.03 * (below + above) / 40.0) & (below > least) & (above > least)
    if not empty.any():
        return None
    doubled = np.concatenate((empty, empty))
    best, run, at = 0, 0, 0
    for k, is_empty in enumerate(doubled):
        run = run + 1 if is_empty else 0
        if run > best:
            best, at = run, k
    if best < 3 or best > 60:
        return None
    return float((at - 0.5 * best + 0.5) % 360.0), float(best)
