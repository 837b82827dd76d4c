"""From accepted terms to findings with their place, their intervals and their proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.smallest_size import SmallestSize
from wind_sensors.diagnosis.effects.wording import (
    BEARING,
    clockwise,
    counted_from,
    parameter_text,
)
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.means.averages import Averages
from wind_sensors.diagnosis.means.bench import Bench, FloatArray, block_sums, halves, huber
from wind_sensors.diagnosis.means.detectable import smallest_size
from wind_sensors.diagnosis.means.fits import fit, intervals
from wind_sensors.diagnosis.means.pair import SLOWEST, SPEED_CLASSES, Pair, cells, table_of
from wind_sensors.diagnosis.means.pair_effects import rotor_effects
from wind_sensors.diagnosis.means.proofs import proof_of, share_removed
from wind_sensors.diagnosis.means.search import Explained, Named
from wind_sensors.diagnosis.means.silences import COLD, WARM, Ice, Silence
from wind_sensors.diagnosis.means.vanes import VaneBench, VaneStanding
from wind_sensors.diagnosis.proving.findings import Estimate, Finding, Unexplained
from wind_sensors.diagnosis.regions import Found, Region
from wind_sensors.station.model import Station

UNTOLD = float("nan")
"""Stands for a number that nobody computed."""

SMALLEST_REMAINDER = 0.02
"""A remainder smaller than this share of the wind (rms over all means) is not worth a word."""

WANDERING = 3.0
"""A vane's change must exceed so many weekly deviations of what is normal."""

CALM = SPEED_CLASSES[1]
"""Friction and offsets show below this wind [m/s]."""


@dataclass(frozen=True)
class PairWork:
    """A pair with everything that was found about it.

    `terms` are those of `explained`, on the rotors that the other heights point at.
    """

    pair: Pair
    bench: Bench
    explained: Explained
    named: tuple[Named, ...]
    terms: tuple[Term, ...]
    limits: list[dict[str, tuple[float, float]]]

    def floor(self) -> FloatArray:
        """Held-out cost of each block that no function of direction and speed can remove."""
        pair, bench = self.pair, self.bench
        speed = pair.wind(bench.station)
        residual = bench.residual(bench.station, bench.everything)
        cost = np.zeros(bench.blocks)
        sides = halves(bench)
        for k in (0, 1):
            own, other = sides[k], sides[1 - k]
            table = table_of(residual[own] / speed[own], speed[own], pair.heading[own])
            sector, level = cells(speed[other], pair.heading[other])
            left = (residual[other] - table[sector, level] * speed[other]) / bench.noise[other]
            cost += block_sums(huber(left), bench.block[other], bench.blocks)
        return cost

    def smallest(self) -> dict[str, SmallestSize]:
        """Gain and offset that this pair would have shown, by effect and pair."""
        bench = self.bench
        base = planted(bench.station, self.explained.terms)
        change = bench.change(base)
        effects = rotor_effects()
        found = {}
        for name in ("calibration_drift", "calibration_offset"):
            term = Term(effects[name], self.pair.second, effects[name].templates[0])
            found[f"{name}/{self.pair.name}"] = smallest_size(
                bench, base, term, change(term.planted(base))
            )
        return found


def last_set(findings: Sequence[Finding]) -> int:
    """Number of the last ambiguous set; 0 where there is none."""
    return max((f.set_number for f in findings), default=0)


def _estimates(term: Term, limits: dict[str, tuple[float, float]]) -> dict[str, Estimate]:
    out = {}
    for p in term.effect.parameters:
        low, high = limits.get(p.name, (UNTOLD, UNTOLD))
        out[p.name] = Estimate(term.values[p.name], low, high, p.unit)
    return out


def _span(averages: Averages, begin: float, end: float) -> str:
    """From one moment to another [s since the start of the recording], for people."""
    return f"from {averages.date(begin)} to {averages.date(end)}"


def _place(work: PairWork, term: Term, before: FloatArray) -> Found:
    """Where a term of a pair acts, and how large the mismatch is there."""
    pair = work.pair
    channel = f"{term.instrument}/mean_speed"
    speed = pair.wind(work.bench.station)
    sign = 1.0 if term.instrument == pair.second else -1.0
    if BEARING in term.values:
        station = work.bench.station
        centre = clockwise(term.values[BEARING], station)
        width = 2.0 * term.values["width"]
        away = np.degrees(pair.heading) - term.values[BEARING]
        inside = np.abs((away + 180.0) % 360.0 - 180.0) < width
        low, high = (centre - width) % 360.0, (centre + width) % 360.0
        region = Region(
            channel, "direction", low, high,
            f"wind from {low:.0f} to {high:.0f} deg {counted_from(station)}",
        )
    elif term.interval != ALWAYS:
        begin, end = term.interval
        inside = work.pair.averages.elapsed >= begin
        if end is not None:
            inside &= work.pair.averages.elapsed < end
        last = float(pair.averages.elapsed[-1]) if end is None else end
        region = Region(
            channel, "time", begin, last, _span(pair.averages, begin, last)
        )
    elif term.effect.name in {"bearing_friction", "calibration_offset"}:
        inside = speed < CALM
        region = Region(
            channel, "speed", SLOWEST, CALM, f"wind from {SLOWEST:g} to {CALM:g} m/s"
        )
    else:
        inside = np.ones(speed.size, dtype=bool)
        region = Region(channel, "all", 0.0, float(speed.max()), "all winds")
    excess = sign * float(np.mean(before[inside])) if inside.any() else 0.0
    return Found(region, float(np.sum(before[inside] ** 2)), excess, "m/s")


def findings_of_pair(
    work: PairWork, number: int
) -> tuple[list[Finding], list[str], Unexplained]:
    """Findings of a pair, what was declined, and what is left.

    Args:
        work: The pair.
        number: Of the last ambiguous set; those of the pair are numbered from the next one on.
    """
    bench, explained = work.bench, work.explained
    floor = np.minimum(work.floor(), explained.cost[-1])
    rows = bench.noise.size
    out: list[Finding] = []
    notes: list[str] = []
    for k, named in enumerate(work.named):
        term, limits = work.terms[k], work.limits[k]
        before = bench.residual(
            planted(bench.station, [t for j, t in enumerate(explained.terms) if j != k]),
            bench.everything,
        )
        if term.relative_size < 1.0:
            notes.append(f"{work.pair.name}: {too_small(term, bench.station)}")
            continue
        equal = [
            (t, b) for t, b in named.equal
            if t.key != term.key
            and (t.relative_size >= 1.0 or t.effect.name == term.effect.name)
        ]
        distinct = {t.key: (t, b) for t, b in reversed(equal)}
        others = tuple((t.effect.name, t.instrument, b) for t, b in named.others[:6])
        others = tuple((t.effect.name, t.instrument, b) for t, b in distinct.values()) + others
        place = _place(work, term, before)
        share = share_removed(named.gain, explained.cost[0], floor)
        proof = proof_of(named.gain, explained.cost[k], rows, named.runner_up, floor)
        set_number = 0
        if distinct:
            number += 1
            set_number = number
        out.append(
            Finding(
                term, _estimates(term, limits), place, float(np.clip(share, 0.0, 1.0)),
                named.p, others, proof, set_number,
            )
        )
        rest = [t for j, t in enumerate(explained.terms) if j != k]
        for twin, behind in distinct.values():
            (other,) = fit(bench, rest, (twin,), bench.everything)
            out.append(
                Finding(
                    other, _estimates(other, {}), _place(work, other, before), out[-1].share,
                    named.p, ((term.effect.name, term.instrument, -behind),), None, set_number,
                )
            )
    return out, notes, _left(work, floor)


def _left(work: PairWork, floor: FloatArray) -> Unexplained:
    """What follows direction and speed on held-out blocks and has no name."""
    bench, explained = work.bench, work.explained
    station = planted(bench.station, explained.terms)
    speed = work.pair.wind(station)
    relative = bench.residual(station, bench.everything) / speed
    table = table_of(relative, speed, work.pair.heading)
    sector, level = cells(speed, work.pair.heading)
    size = float(np.sqrt(np.mean(table[sector, level] ** 2)))
    gain = explained.cost[-1] - floor
    p = float(stats.ttest_1samp(gain, 0.0, alternative="greater").pvalue) if gain.any() else 1.0
    excess = float((explained.cost[0] - floor).sum())
    share = float(gain.sum()) / excess if excess > 0.0 else 0.0
    if size < SMALLEST_REMAINDER or p > 0.01:
        return Unexplained(p, 0.0, (), "")
    text = (
        f"{work.pair.name}: {100.0 * size:.1f} % of the wind (rms) follows direction and speed "
        "in a way that the named effects do not"
    )
    return Unexplained(p, share, (), text)


def too_small(term: Term, station: Station) -> str:
    """Why a term that explains held-out blocks is not named, for people."""
    values = ", ".join(
        parameter_text(p, term.values[p.name], station) for p in term.effect.parameters
    )
    return (
        f"{term.effect.name.replace('_', ' ')} of {term.instrument} ({values}) improves held-out "
        "blocks, but is smaller than what is worth reporting."
    )


def finding_of_silence(averages: Averages, silence: Silence) -> Finding:
    """A sensor that repeats one value."""
    last = min(silence.last + 1, len(averages) - 1)
    begin = float(averages.elapsed[silence.first])
    end = float(averages.elapsed[last])
    term = Term(catalogue()["stuck_sensor"], silence.sensor, {"start": begin, "stop": end})
    is_rotor = silence.sensor in averages.speed
    shown = f"{silence.value:.3g} m/s" if is_rotor else (
        f"{clockwise(np.degrees(silence.value), averages.station):.1f} deg "
        f"{counted_from(averages.station)}"
    )
    region = Region(
        f"{silence.sensor}/{'mean_speed' if is_rotor else 'mean_direction'}", "time", begin, end,
        f"{shown} {_span(averages, begin - averages.interval, end)}, "
        f"{silence.rows} means of it in wind",
    )
    unit = "m/s" if is_rotor else "deg"
    step = averages.interval
    return Finding(
        term,
        {
            "start": Estimate(begin, begin - step, begin, "s"),
            "stop": Estimate(end, end - step, end, "s"),
        },
        Found(region, float(silence.rows), 0.0, unit),
        UNTOLD,
        UNTOLD,
        (),
        None,
    )


def finding_of_ice(averages: Averages, ice: Ice) -> Finding:
    """Episodes of a rotor that lags in the cold."""
    first = float(averages.elapsed[ice.episodes[0][0]])
    last = float(averages.elapsed[ice.episodes[-1][1]])
    values = {"gain": max(ice.ratio, 0.2), "inertia_factor": 1.0}
    term = Term(catalogue()["icing"], ice.rotor, values, (first, last))
    hours = averages.interval / 3600.0
    region = Region(
        f"{ice.rotor}/mean_speed", "temperature", -40.0, COLD,
        f"{len(ice.episodes)} episodes, {ice.rows * hours:.1f} h of {ice.cold_rows * hours:.0f} h "
        f"of wind below {COLD:g} degC; {ice.warm_slow * hours:.1f} h of "
        f"{ice.warm_rows * hours:.0f} h above {WARM:g} degC; in them it turned at "
        f"{100.0 * ice.ratio:.0f} % of the speed that {ice.partner} leads to expect (median)"
        f"{', that is, stood still for most of the time' if ice.ratio == 0.0 else ''}",
    )
    there = np.concatenate([averages.speed[ice.partner][a : b + 1] for a, b in ice.episodes])
    missing = float(np.nanmean(there)) * (ice.ratio - 1.0)
    return Finding(
        term,
        {"gain": Estimate(ice.ratio, *ice.ratios, "1")},
        Found(region, float(ice.rows), missing, "m/s"),
        UNTOLD,
        ice.p,
        (),
        None,
    )


def findings_of_vane(
    averages: Averages,
    found: VaneBench,
    explained: Explained,
    standing: VaneStanding | None,
    number: int | None,
) -> tuple[list[Finding], list[str]]:
    """Findings of a vane against the others, and what was declined.

    What a vane is compared with includes the wind's own turning with height, and nobody knows how
    much of the misfit that is: the share that a finding removes is of all of it.

    Args:
        averages: Means of the recording.
        found: The vane.
        explained: What the search says.
        standing: What healthy recordings show of it, if there are any.
        number: With one other vane, which may be the one that turned: of the last ambiguous set.
            What the search of either finds first belongs to the set with the next number, and so
            on. None: several others tell which one turned.
    """
    bench = found.bench
    out: list[Finding] = []
    notes: list[str] = []
    middle = np.degrees(np.median(found.difference))
    block = bench.block
    left = bench.residual(planted(bench.station, explained.terms), bench.everything)
    weekly = np.array([np.median(left[block == b]) for b in range(bench.blocks)])
    spread = np.degrees(standing.spread if standing is not None else float(np.std(weekly)))
    if standing is None:
        notes.append(
            f"{found.vane}: stands {middle:+.1f} deg from the other vanes (counter-clockwise "
            f"positive; weekly deviation {spread:.1f} deg). The wind turns with height by as "
            "much, so that this is no vane offset without a healthy recording or a sighting."
        )
    limits = intervals(bench, explained.terms)
    given = len(explained.terms) - len(explained.named)
    for k, named in enumerate(explained.named):
        term = explained.terms[given + k]
        size = abs(term.values.get("offset", term.relative_size))
        if term.relative_size < 1.0 or size < WANDERING * spread:
            notes.append(
                f"{found.vane}: a change of {size:.1f} deg explains held-out blocks, but the "
                f"wind's own turning with height varies by {spread:.1f} deg from week to week."
            )
            continue
        begin, end = term.interval
        last = float(bench.elapsed[-1]) if end is None else end
        region = Region(
            f"{found.vane}/mean_direction", "time", begin, last,
            _span(averages, begin, last),
        )
        out.append(
            Finding(
                term, _estimates(term, limits[given + k]),
                Found(region, float(named.gain.sum()), float(middle), "deg"),
                float(named.gain.sum() / explained.cost[0].sum()), named.p,
                tuple((t.effect.name, t.instrument, b) for t, b in named.others[:4]),
                proof_of(named.gain, explained.cost[k], bench.noise.size, named.runner_up),
                0 if number is None else number + 1 + k,
            )
        )
    return out, notes
