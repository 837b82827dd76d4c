"""What a fit is looked for in: terms over a station, their parameters, what these change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects.definition import PLATFORM, Parameter
from wind_sensors.diagnosis.explaining.terms import Interval, Term, planted, reached_by
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.simulation.drive import Drive
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]


def parameters_of(terms: Sequence[Term]) -> list[tuple[int, Parameter]]:
    """All parameters of all terms, each with the number of its term."""
    return [(k, p) for k, term in enumerate(terms) for p in term.effect.parameters]


def with_values(terms: Sequence[Term], values: FloatArray) -> tuple[Term, ...]:
    """The terms with other values of their parameters.

    Args:
        terms: The terms.
        values: Of all parameters, in the order of `parameters_of`.
    """
    out = []
    place = 0
    for term in terms:
        names = [p.name for p in term.effect.parameters]
        part = values[place : place + len(names)]
        place += len(names)
        fitted = dict(zip(names, part.tolist(), strict=True))
        out.append(replace(term, values={**term.values, **fitted}))
    return tuple(out)


def values_of(terms: Sequence[Term]) -> FloatArray:
    """All parameters of all terms."""
    return np.array([term.values[p.name] for term in terms for p in term.effect.parameters])


@dataclass(frozen=True)
class Point:
    """What there is at some values of the parameters.

    Attributes:
        values: Of all parameters, shape (parameters,).
        cost: Squared length of the white vector; infinite where that is no number.
        vector: White vector, shape (m,).
        simulated: Simulation.
    """

    values: FloatArray
    cost: float
    vector: FloatArray
    simulated: Simulated


class Problem:
    """Terms to be fitted over a station in one recording.

    Args:
        whitener: The null of the recording.
        station: The station as commissioned.
        terms: Effects with starting values.
        rest: Simulation whose other instruments are taken over; None: simulate all.

    Attributes:
        parameters: Of all terms.
        low, high: Their bounds; those that are told or not to be fitted have no room.
        scale: Their differences for derivatives, in units of which steps are counted.
        evaluations: Number of simulations so far.
    """

    def __init__(
        self, whitener: Whitener, station: Station, terms: Sequence[Term], rest: Simulated | None
    ) -> None:
        self._whitener = whitener
        self._station = station
        self._terms = tuple(terms)
        self._rest = rest
        self._only: tuple[str, ...] = ()
        if rest is not None:
            self._only = tuple(sorted(reached_by(whitener.comparison, station, terms)))
        self.parameters = [p for _, p in parameters_of(terms)]
        self.low, self.high = _bounds(whitener, terms)
        self.scale = np.array([p.difference for p in self.parameters])
        self.evaluations = 0

    def simulate(self, values: FloatArray) -> Simulated:
        """Simulation with given parameters."""
        self.evaluations += 1
        return self._whitener.comparison.simulate(self._tried(values), self._only, self._rest)

    def _tried(self, values: FloatArray) -> Station:
        return planted(self._station, with_values(self._terms, values))

    def at(self, values: FloatArray) -> Point | None:
        """What there is at given parameters; None: the station is impossible."""
        simulated = self._possible(values)
        return None if simulated is None else self._seen(values, simulated)

    def start(self, values: FloatArray) -> Point:
        """The point from which a search begins: given parameters, or healthy ones.

        Args:
            values: Within the bounds; where the station is impossible with them, each parameter is
                healthy, or in the middle between its bounds.
        """
        point = self.at(values)
        if point is not None:
            return point
        healthy = np.array(
            [
                p.healthy if p.healthy is not None else 0.5 * (p.low + p.high)
                for p in self.parameters
            ]
        )
        return self._seen(healthy, self.simulate(healthy))

    def _seen(self, values: FloatArray, simulated: Simulated) -> Point:
        vector = self._whitener.of(simulated)
        cost = float(vector @ vector)
        return Point(values, cost if np.isfinite(cost) else np.inf, vector, simulated)

    def slopes(
        self,
        values: FloatArray,
        base: FloatArray,
        carried: FloatArray | None = None,
        steps: FloatArray | None = None,
    ) -> FloatArray:
        """Derivatives of what is compared, shape (l, parameters), in units of `difference`.

        Args:
            values: Where.
            base: What is compared there, shape (l,).
            carried: Those by the first parameters, from elsewhere.
            steps: Distances to where they are taken from; None: `difference` of each parameter.
        """
        low, high = self.low, self.high
        columns = [] if carried is None else list(carried.T)
        first = len(columns)
        for k, (owner, parameter) in list(enumerate(parameters_of(self._terms)))[first:]:
            step = parameter.difference if steps is None else float(steps[k])
            if not low[k] <= values[k] + step <= high[k]:
                step = -step
            moved = values.copy()
            moved[k] = min(max(values[k] + step, low[k]), high[k])
            shift = (moved[k] - values[k]) / parameter.difference
            simulated = self._nearby(moved) if shift != 0.0 else None
            if simulated is None:
                columns.append(np.zeros_like(base))
            else:
                of_platform = self._terms[owner].instrument == PLATFORM
                columns.append(self._slight_change(base, simulated, of_platform) / shift)
        return np.asarray(np.array(columns).T, dtype=np.float64)

    def _possible(self, values: FloatArray) -> Simulated | None:
        """Simulation with given parameters; None where the station is impossible."""
        self.evaluations += 1
        return self._whitener.comparison.possible(self._tried(values), self._only, self._rest)

    def _nearby(self, values: FloatArray) -> Simulated | None:
        """The same, without telling apart what the motion of the mount does."""
        self.evaluations += 1
        return self._whitener.comparison.possible(
            self._tried(values), self._only, self._rest, with_motion=False
        )

    def compared(self, simulated: Simulated) -> FloatArray:
        """What is compared of a simulation, shape (l,)."""
        return simulated.flat(self._whitener.comparison.channels)

    def change(self, before: Simulated, after: Simulated) -> FloatArray:
        """How far what is compared moves, zero where it cannot be told; shape (l,)."""
        return self._change(self.compared(before), after)

    def _change(self, base: FloatArray, moved: Simulated) -> FloatArray:
        return np.asarray(np.nan_to_num(self.compared(moved) - base))

    def _slight_change(
        self, base: FloatArray, moved: Simulated, of_platform: bool
    ) -> FloatArray:
        """How far what is compared moves by a slight change, shape (l,).

        The eddies stay what they are: what a slight change of the platform does, its motion does.
        """
        compared = moved.flat(self._whitener.comparison.channels, with_motion=False)
        change = np.nan_to_num(compared - base[: compared.size])
        by_motion = base.size - compared.size
        known = change[:by_motion] if of_platform else np.zeros(by_motion)
        return np.concatenate((change, known))

    def whitened(self, slopes: FloatArray) -> FloatArray:
        """Derivatives of the white vector, shape (m, parameters)."""
        return np.asarray(-self._whitener.of_changes(slopes.T).T, dtype=np.float64)


def _bounds(whitener: Whitener, terms: Sequence[Term]) -> tuple[FloatArray, FloatArray]:
    """Bounds of all parameters; those that are told or not to be fitted have no room."""
    placed = parameters_of(terms)
    low = np.array([p.low for _, p in placed])
    high = np.array([p.high for _, p in placed])
    drive = whitener.comparison.drive
    swings = [_swing(drive, term.interval) for term in terms]
    for k, (owner, parameter) in enumerate(placed):
        tied = not parameter.is_free(drive)
        if tied and parameter.tied is not None:
            low[k] = high[k] = parameter.tied
        elif (tied or parameter.swing > swings[owner]) and parameter.healthy is not None:
            low[k] = high[k] = parameter.healthy
        elif not terms[owner].fits(parameter):
            low[k] = high[k] = values_of(terms)[k]
    return low, high


def _swing(drive: Drive, interval: Interval) -> float:
    """Range of the air's temperature [K] while an effect holds."""
    if drive.temperature is None:
        return 0.0
    since = drive.elapsed + drive.dt * np.arange(len(drive))
    begin, end = interval
    while_held = drive.temperature[(since >= begin) & (since <= (np.inf if end is None else end))]
    return float(np.ptp(while_held)) if while_held.size else 0.0
