"""What a left-out piece of physics is, for the diagnosis and for users who add their own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from wind_sensors.simulation.drive import Drive
from wind_sensors.station.model import Change, Instrument, Platform, Station

PLATFORM = "platform"
"""Name under which the carrier appears among the instruments."""

STATION = "station"
"""Name under which everything at once appears: the mount, the air."""

Entrance = Literal["wind", "response", "output", "clock"]
Values = Mapping[str, float]


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    Attributes:
        name: As in the verdict, e.g. `friction_speed`.
        unit: For people, e.g. `m/s`.
        low, high: Bounds of the search.
        healthy: Value at which the effect is absent; None for a parameter that only places or
            shapes the effect (a bearing, a width).
        minimum: Smallest departure from `healthy` worth reporting.
        starts: Values from which the search begins (besides the screening's estimate).
        step: Size of a finite difference; 0: a tenth of `minimum`, or of the bounds' distance.
        wraps: Period of an angle, 0 for none.
        free: Whether what drives the recording lets it be fitted; None: always.
        tied: Value at which it is held where `free` says no; None: the healthy one.
        swing: Smallest change of the air's temperature, while the effect holds, that the parameter
            needs [K]; with less it keeps its healthy value.
        limited: Whether nothing reaches its bounds, though no smallest size is its own: what asks
            for so much is something else.
        spare: Whether the effect is often there without it: it keeps its healthy value where the
            recording does not ask for another.
        value_from: The `fit`; the `signals`, which tell it better than a fit can; or several
            `forms` of the effect, each of which is tried as it is.
        told_to: Standard error where the signals tell it.
        sense: What a positive value means, for people; empty where the name says it.
    """

    name: str
    unit: str
    low: float
    high: float
    healthy: float | None = 0.0
    minimum: float = 0.0
    starts: tuple[float, ...] = ()
    step: float = 0.0
    wraps: float = 0.0
    swing: float = 0.0
    limited: bool = False
    spare: bool = False
    free: Callable[[Drive], bool] | None = None
    tied: float | None = None
    value_from: Literal["fit", "signals", "forms"] = "fit"
    told_to: float = 0.0
    sense: str = ""

    def is_free(self, drive: Drive) -> bool:
        """Whether what drives a recording lets it be fitted."""
        return self.free is None or self.free(drive)

    @property
    def difference(self) -> float:
        """Step of a finite difference."""
        if self.step:
            return self.step
        return 0.1 * self.minimum if self.minimum else 0.02 * (self.high - self.low)

    @property
    def graded(self) -> bool:
        """Whether it comes in sizes between health and worse."""
        return self.healthy is not None and self.value_from != "forms"


@dataclass(frozen=True)
class Effect:
    """A piece of physics that a station may lack.

    Attributes:
        name: Identifier in the verdict.
        meaning: One sentence.
        entrance: Where it enters: the wind at the sensor, the equation of motion, the output or
            the clock.
        equation: In plain text.
        source: Where the equation comes from.
        region: Where it shows, in words.
        parameters: In the order of the fit.
        applies: Whether an entry of the station (an instrument or the platform) can have it.
        update: From the entry and the values, the keys of the entry that change.
        templates: Starting points of the screening; each gives every parameter a value. The
            screening uses one signature per template.
        confusable: Effects it can be mistaken for, with the measurement that separates them.
        everywhere: It concerns all the instruments it applies to at once (the mount, the air).
        shared: It may concern one instrument or all of them (the logger's clock).
        standing: Share of the smallest size worth reporting at which it is taken to be present on
            any healthy day, whatever healthy recordings say; 0 for what is there or is not.
        standing_in_calm: The same in winds below those of calibrations and healthy recordings,
            where the straight calibration line is continued.
        contains: Effects of the same instrument that it can stand in for exactly; the two are
            never named together.
        includes: Effects of other entries that it is in some of its values: a frame of the carrier
            that leans is an axis that leans.
        occasional: It acts in one sector, one lull or one part of the record; others show again
            and again.
        sector: Name of the parameter with the middle of the one sector [deg] outside of which it
            does nothing, whose width is the parameter `width`; empty: it acts in wind from
            anywhere.
        silences: It holds a signal still, or stops it, whatever the wind does.
        brakes: It may hold a rotor that the wind hardly turns, so that it seems silent.
        smooths: It damps or delays what the wind does. Errors of the reference that come and go
            look like that, so a beginning or an end inside the record needs more evidence.
        shifts: Of those that smooth: it moves the mean of the signal as well.
        exact: Its form is certain (geometry, electronics, arithmetic); what others leave beside
            them may be their own form.
        form_error: Standard error of a size, relative to it, that the simulation's form leaves.
        noisy: What it does is drawn at random or hangs on the last digit (whether a vane sticks
            or slips), so that its simulation adds noise of its own.
        own_days: What a healthy day promises of it has reasons of its own, and is no measure of
            other effects.
        even: Most of what it does is the same for either sign, so that fits begin at both.
        sticks: From the values, whether it holds and lets go: when it does so hangs on the last
            digit, so that it leaves noise of its own as what is `noisy` does.
        unmistakable: The signals that tell its values tell that it is this effect, too. Silence
            they tell, but not whether the sensor or its bearing is stuck; uneven intervals, but not
            whether the disc or a cup makes them.
        own_law: How it changes with the wind's speed differs from one cause to another: a stiff
            grease damps a vane less and less against the wind's own damping as the wind grows.
        fades: What it does falls with the square of the wind's speed, which tells it from others
            that do as much with the direction.
        constant_of: The linear equation of which it is one of the constants; empty: of none. Two of
            them may take each other back in one property, as mass and damping do in the power at
            the resonance, and the equation tells both.
        goes_with_direction: It is another one in wind from elsewhere, and has to show that.
        one_by_one: It hits one pulse here and one there, by chance, whatever became of those
            before: what comes in bursts is something else.
        loose_statistics: Statistics of the raw signals, by their labels, in which its form is not
            certain: what it leaves there says little against it.
        stirs: It brings eddies of its own where it acts, of which the reference knows nothing.
        grows: Name of the parameter that says with which time constant it approaches its size;
            empty: it is there at once.
        needs: Data without which it cannot be seen.
        tie: From values in proportion to the templates', those that act alike where what may be
            `tied` is; None: nothing may be.
        largest: Size, in those units, that nothing of the kind exceeds: what does is something
            else.
        size: From the values, size in units of the smallest size worth reporting; None takes
            the largest departure over the parameters' `minimum`.
    """

    name: str
    meaning: str
    entrance: Entrance
    equation: str
    source: str
    region: str
    parameters: tuple[Parameter, ...]
    applies: Callable[[Instrument | Platform, Station], bool]
    update: Callable[[Instrument | Platform, Values], dict[str, Any]]
    templates: tuple[dict[str, float], ...]
    confusable: Mapping[str, str] = field(default_factory=dict)
    everywhere: bool = False
    shared: bool = False
    contains: frozenset[str] = frozenset()
    includes: frozenset[str] = frozenset()
    occasional: bool = False
    sector: str = ""
    silences: bool = False
    brakes: bool = False
    smooths: bool = False
    shifts: bool = False
    exact: bool = False
    form_error: float = 0.025
    noisy: bool = False
    own_days: bool = False
    even: bool = False
    sticks: Callable[[Values], bool] | None = None
    unmistakable: bool = False
    stirs: bool = False
    own_law: bool = False
    fades: bool = False
    constant_of: str = ""
    goes_with_direction: bool = False
    one_by_one: bool = False
    loose_statistics: frozenset[str] = frozenset()
    standing: float = 0.1
    standing_in_calm: float = 0.0
    grows: str = ""
    needs: tuple[str, ...] = ()
    tie: Callable[[Values], dict[str, float]] | None = None
    size: Callable[[Values], float] | None = None
    largest: float = math.inf

    def __reduce__(self) -> tuple[Callable[[str], Effect], tuple[str]]:
        """Effects travel between processes by their name."""
        return _named, (self.name,)

    @property
    def legible(self) -> bool:
        """Whether the signals themselves tell that it is there, when it begins and when it ends.

        A beginning or an end is then neither searched for nor paid for.
        """
        return any(p.value_from == "signals" for p in self.parameters)

    def begun(self, values: Values, drive: Drive) -> dict[str, float]:
        """Values of about the size of the templates', from which a fit can begin.

        Args:
            values: Departures from health in proportion to those of the templates.
            drive: What drives the recording.
        """
        return self.tie(values) if self.tie is not None and self.is_tied(drive) else dict(values)

    def is_tied(self, drive: Drive) -> bool:
        """Whether a parameter is held at a value of its own, for only products are seen.

        Args:
            drive: What drives the recording.
        """
        return any(p.tied is not None and not p.is_free(drive) for p in self.parameters)

    def scaled(self, values: Values, factor: float) -> dict[str, float]:
        """Values with their departure from health multiplied, within their bounds."""
        out = dict(values)
        for p in self.parameters:
            if p.healthy is not None:
                moved = p.healthy + factor * (values[p.name] - p.healthy)
                out[p.name] = min(max(moved, p.low), p.high)
        return out

    def either_sign(self, values: Values) -> list[dict[str, float]]:
        """Values, and those with the opposite departure from health where that does much the same.

        Args:
            values: Parameters.
        """
        same = dict(values)
        return [same, self.scaled(values, -1.0)] if self.even else [same]

    @property
    def is_quick(self) -> bool:
        """Whether it only damps, hastens or delays what the wind does, and moves no mean."""
        return (self.smooths or self.entrance == "clock") and not self.shifts

    def is_confusable_with(self, other: Effect) -> bool:
        """Whether either can be mistaken for the other."""
        return other.name in self.confusable or self.name in other.confusable

    def growth(self, values: Values) -> float:
        """Time constant [s] with which it approaches its size, 0 where it has it at once."""
        constant = values.get(self.grows, 0.0)
        return constant if constant >= SHORTEST_GROWTH else 0.0

    def relative_size(self, values: Values) -> float:
        """Size of the effect in units of the smallest size worth reporting."""
        if self.size is not None:
            return self.size(values)
        sizes = [
            abs(values[p.name] - p.healthy) / p.minimum
            for p in self.parameters
            if p.healthy is not None and p.minimum > 0.0
        ]
        return max(sizes, default=0.0)


def _named(name: str) -> Effect:
    from wind_sensors.diagnosis.effects import catalogue
    from wind_sensors.diagnosis.effects.suspected import SUSPECTS

    known = {effect.name: effect for effect in SUSPECTS} | catalogue()
    return known[name]


def entry_of(station: Station, instrument: str) -> Instrument | Platform:
    """The instrument or the platform of that name.

    Raises:
        KeyError: The station has no such entry.
    """
    if instrument == PLATFORM:
        if station.platform is None:
            raise KeyError(instrument)
        return station.platform
    return station.instrument(instrument)


def with_keys(station: Station, instrument: str, keys: Mapping[str, Any]) -> Station:
    """The station with keys of one entry changed, without validation (values come from a fit)."""
    if instrument == PLATFORM:
        assert station.platform is not None
        return station.model_copy(update={"platform": station.platform.model_copy(update=keys)})
    return station.model_copy(
        update={
            "instruments": tuple(
                entry.model_copy(update=keys) if entry.name == instrument else entry
                for entry in station.instruments
            )
        }
    )


def touched(station: Station, effect: Effect, instrument: str) -> tuple[str, ...]:
    """Names of the entries that an effect of an instrument changes."""
    if not effect.everywhere and instrument != STATION:
        return (instrument,)
    return tuple(e.name for e in station.instruments if effect.applies(e, station))


SHORTEST_GROWTH = 20.0
"""What reaches its size within so few seconds was there before: ice takes minutes, and what a rotor
does in a record's first moments hangs on the wind before it."""

_STAGES = (0.0, 0.2, 0.45, 0.75, 1.15, 1.7, 2.6)
"""Times [time constants] at which what grows takes another size."""


def _stages(
    begin: float, end: float | None, constant: float
) -> Iterator[tuple[float, float | None, float]]:
    """Beginning and end [s] of each stage of a growth, and its mean share of the full size."""
    for early, late in zip(_STAGES, (*_STAGES[1:], math.inf), strict=True):
        start = begin + early * constant
        if end is not None and start >= end:
            return
        if math.isinf(late):
            yield start, end, 1.0
            return
        stop = begin + late * constant
        share = 1.0 - (math.exp(-early) - math.exp(-late)) / (late - early)
        yield start, stop if end is None else min(stop, end), share


def with_effect(
    station: Station,
    effect: Effect,
    instrument: str,
    values: Values,
    interval: tuple[float, float | None] | None = None,
) -> Station:
    """The station with an effect, for good or within an interval [s since the start].

    What grows becomes several changes, whether or not it has an interval.
    """
    begin, end = (0.0, None) if interval is None else interval
    growth = effect.growth(values)
    changes: list[Change] = []
    for name in touched(station, effect, instrument):
        if growth > 0.0:
            changes.extend(
                Change(
                    start=start, stop=stop, instrument=name,
                    set=effect.update(entry_of(station, name), effect.scaled(values, share)),
                )
                for start, stop, share in _stages(begin, end, growth)
            )
            continue
        keys = effect.update(entry_of(station, name), values)
        if begin <= 0.0 and end is None:
            station = with_keys(station, name, keys)
        else:
            changes.append(Change(start=begin, stop=end, instrument=name, set=keys))
    if not changes:
        return station
    return station.model_copy(update={"changes": (*station.changes, *changes)})
