"""Nonlinear fits of effects: the compiled simulation inside a damped least-squares search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.effects.definition import PLATFORM, STATION, Parameter
from wind_sensors.diagnosis.explaining.terms import Interval, Term, planted
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.simulation.drive import Drive
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

_LARGEST_DAMPING = 1e5

_LEAST_INFORMATION = 1e-4

WIDEST = 4.0
"""Differences for covariances go up to so many smallest sizes."""

EXACT = 0.02
"""Drop of the cost that moves the parameters by a seventh of their standard deviations."""

ROUGHLY = 0.3
"""The same where explanations are only compared with each other."""

_ROUNDING = 1e-5
"""Share of the cost that a step may gain by chance."""

_FAR_OFF = 2e-4
"""The same of what the cost has above that of noise: where much is left, pulses that fall on one
side of a bin's border or the other make the cost rough."""

_NEARLY_LINEAR = 0.9
"""Derivatives are carried along after a step that gained this share of what they promised."""

_OVER_THE_ROUGH = 4.0
"""Where no step keeps what the derivatives promise, they are taken over so many times as far, of
what turns or carries the whole wind: a vane that turns round the other way leaves hollows in its
cost."""

_SLOW = 0.3
"""Steps with derivatives that hold gain no more than this share of what the step before gained."""


@dataclass(frozen=True)
class Fit:
    """Terms fitted to a recording.

    Attributes:
        terms: With the fitted values.
        cost: Squared length of the white vector (minus twice the log-likelihood).
        vector: White vector at the fit.
        simulated: Simulation at the fit.
        covariance: Of all parameters, in the order of the terms and their parameters; infinite
            variance where the recording cannot see one.
        evaluations: Number of simulations it took.
        active: Number of parameters that the recording can see.
        slopes: Derivatives of what is compared (`Simulated.flat`) by the parameters in units of
            their steps, shape (l, parameters); None: not known. They hold in any null.
    """

    terms: tuple[Term, ...]
    cost: float
    vector: FloatArray
    simulated: Simulated
    covariance: FloatArray
    evaluations: int
    active: int = 0
    slopes: FloatArray | None = None


def without_term(known: Fit, left_out: int) -> Fit:
    """A fit's other terms where they are, with their derivatives; not fitted again."""
    owners = [k for k, _ in parameters_of(known.terms)]
    kept = [place for place, owner in enumerate(owners) if owner != left_out]
    return replace(
        known,
        terms=tuple(t for k, t in enumerate(known.terms) if k != left_out),
        slopes=None if known.slopes is None else known.slopes[:, kept],
    )


def parameters_of(terms: Sequence[Term]) -> list[tuple[int, Parameter]]:
    """All parameters of all terms, each with the number of its term."""
    return [(k, p) for k, term in enumerate(terms) for p in term.effect.parameters]


def _with_values(terms: Sequence[Term], values: FloatArray) -> tuple[Term, ...]:
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


class Problem:
    """Terms to be fitted over a station in one recording.

    Args:
        whitener: The null of the recording.
        station: The station as commissioned.
        terms: Effects with starting values.
        rest: Simulation whose other instruments are taken over; None: simulate all.
    """

    def __init__(
        self, whitener: Whitener, station: Station, terms: Sequence[Term], rest: Simulated | None
    ) -> None:
        self._whitener = whitener
        self._station = station
        self._terms = tuple(terms)
        self._rest = rest
        comparison = whitener.comparison
        self._only: tuple[str, ...] = ()
        if rest is not None:
            touched = {
                name for term in terms for name in comparison.affected(station, term.instrument)
            }
            self._only = tuple(sorted(touched))
        self.evaluations = 0

    def simulate(self, values: FloatArray) -> Simulated:
        """Simulation with given parameters."""
        self.evaluations += 1
        return self._whitener.comparison.simulate(self._tried(values), self._only, self._rest)

    def _tried(self, values: FloatArray) -> Station:
        return planted(self._station, _with_values(self._terms, values))

    def vector(self, values: FloatArray) -> tuple[FloatArray, Simulated]:
        """White vector and simulation."""
        simulated = self.simulate(values)
        return self._whitener.of(simulated), simulated

    def trial(self, values: FloatArray) -> tuple[float, FloatArray, Simulated | None]:
        """Cost, white vector and simulation; an infinite cost where the station is impossible."""
        simulated = self._possible(values)
        if simulated is None:
            return np.inf, np.zeros(0), None
        vector = self._whitener.of(simulated)
        cost = float(vector @ vector)
        return (cost if np.isfinite(cost) else np.inf), vector, simulated

    def slopes(
        self,
        values: FloatArray,
        base: FloatArray,
        low: FloatArray,
        high: FloatArray,
        carried: FloatArray | None = None,
        steps: FloatArray | None = None,
    ) -> FloatArray:
        """Derivatives of what is compared, shape (l, parameters), in units of `difference`.

        Args:
            values: Where.
            base: What is compared there, shape (l,).
            low, high: Bounds.
            carried: Those by the first parameters, from elsewhere.
            steps: Distances to where they are taken from; None: `difference` of each parameter.
        """
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


def _secant(slopes: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """The smallest change of the derivatives that agrees with the last step (Broyden).

    Args:
        slopes: Shape (l, parameters).
        step: Of the parameters, shape (parameters,).
        change: Of what is compared, shape (l,).
    """
    missed = change - slopes @ step
    return np.asarray(slopes + np.outer(missed, step) / max(float(step @ step), 1e-12))


def fit(
    whitener: Whitener,
    station: Station,
    terms: Sequence[Term],
    rest: Simulated | None = None,
    iterations: int = 8,
    known: Fit | None = None,
    least: float = EXACT,
) -> Fit:
    """Fit terms by damped least squares within their bounds.

    Derivatives are taken by differences at the start, and anew after a step that gained less than
    those carried along promised.

    Args:
        whitener: The null of the recording.
        station: The station as commissioned.
        terms: Effects with starting values.
        rest: Simulation of the station whose untouched instruments are reused.
        iterations: Largest number of Gauss-Newton steps.
        known: Fit of the same effects, or of the first ones, near the same values, in whatever
            null, from which the derivatives are carried along.
        least: Drop of the cost that is worth another step, beside a share of the cost.

    Returns:
        The fit; without terms, what there is without any effect.
    """
    problem = Problem(whitener, station, terms, rest)
    parameters = [p for _, p in parameters_of(terms)]
    low, high = _bounds(whitener, terms)
    scale = np.array([p.difference for p in parameters])
    values = np.clip(values_of(terms), low, high)
    cost, vector, first = problem.trial(values)
    if first is None:
        values = np.array([p.healthy if p.healthy is not None else 0.5 * (p.low + p.high)
                           for p in parameters])
        vector, first = problem.vector(values)
        cost = float(vector @ vector)
    simulated = first
    if not parameters:
        return Fit(tuple(terms), cost, vector, simulated, np.zeros((0, 0)), problem.evaluations)
    damping = 1e-2
    slopes = None
    if known is not None and known.slopes is not None:
        slopes = problem.slopes(
            values, problem.compared(simulated), low, high, carried=known.slopes
        )
    normal = np.eye(len(values))
    exact = stale = rough = False
    hollows = any(term.instrument in (STATION, PLATFORM) for term in terms)
    before = np.inf
    for _ in range(iterations):
        if slopes is None or stale:
            steps = _OVER_THE_ROUGH * scale if rough else None
            slopes = problem.slopes(values, problem.compared(simulated), low, high, steps=steps)
            exact, stale, before = True, False, np.inf
        jacobian = problem.whitened(slopes)
        normal = jacobian.T @ jacobian
        gradient = jacobian.T @ vector
        worthwhile = least + _ROUNDING * cost + _FAR_OFF * max(cost - vector.size, 0.0)
        gained = promised = 0.0
        misled = False
        while damping < _LARGEST_DAMPING:
            weighted = normal + damping * np.diag(np.diag(normal) + 1e-9)
            step = -np.linalg.solve(weighted, gradient) * scale
            trial = np.clip(values + step, low, high)
            moved = (trial - values) / scale
            expected = vector + jacobian @ moved
            promised = cost - float(expected @ expected)
            if promised < worthwhile:
                break
            trial_cost, trial_vector, trial_simulated = problem.trial(trial)
            if trial_simulated is not None and trial_cost < cost:
                gained = cost - trial_cost
                missed = promised - gained
                stale = missed > max((1.0 - _NEARLY_LINEAR) * promised, worthwhile)
                stale = stale or gained > max(_SLOW * before, worthwhile)
                before = gained
                slopes = _secant(slopes, moved, problem.change(simulated, trial_simulated))
                values, vector, simulated, cost = (
                    trial, trial_vector, trial_simulated, trial_cost,
                )  # fmt: skip
                damping = max(damping * 0.2, 1e-6)
                break
            if not exact:
                stale = True
                break
            damping *= 8.0
            misled = True
        if misled and gained == 0.0 and hollows and not rough:
            # Small steps promise to go down and all go up: the slope is that of a hollow.
            rough = stale = True
            damping = 1e-2
        elif gained < worthwhile and (exact or promised < worthwhile):
            break
        exact = False
    seen = np.diag(normal) > _LEAST_INFORMATION
    covariance = _covariance(normal, parameters)
    fitted = _with_values(terms, values)
    active = int(np.count_nonzero(seen))
    return Fit(
        fitted, cost, vector, simulated, covariance, problem.evaluations, active, slopes
    )


def _covariance(normal: FloatArray, parameters: Sequence[Parameter]) -> FloatArray:
    """Covariance of parameters, infinite for those that are not seen.

    Args:
        normal: Products of the white derivatives, in units of `difference`.
        parameters: What they are by.
    """
    seen = np.diag(normal) > _LEAST_INFORMATION
    covariance = np.diag(np.where(seen, 0.0, np.inf))
    width = np.array([p.high - p.low for p in parameters])
    scale = np.array([p.difference for p in parameters])
    information = normal / np.outer(scale, scale) + np.diag(1e-9 / width**2)
    covariance[np.ix_(seen, seen)] = np.linalg.pinv(information[np.ix_(seen, seen)])
    return covariance


def cost_of(whitener: Whitener, station: Station, terms: Sequence[Term]) -> float:
    """Cost of terms as they are; infinite where the station is impossible.

    Args:
        whitener: The null.
        station: The station as commissioned.
        terms: Effects with their values.
    """
    simulated = whitener.comparison.possible(planted(station, terms))
    if simulated is None:
        return np.inf
    vector = whitener.of(simulated)
    return float(vector @ vector)


def covariance_of(whitener: Whitener, station: Station, explanation: Fit) -> FloatArray:
    """Covariance of the parameters of a fit in a null, from differences that matter.

    What a small difference changes is in part on which side of a bin's border a pulse falls: it
    looks like information and is none. So they are taken over the smallest size worth reporting
    and more, towards health.

    Args:
        whitener: The null.
        station: The station as commissioned.
        explanation: The fit.
    """
    problem = Problem(whitener, station, explanation.terms, explanation.simulated)
    parameters = [p for _, p in parameters_of(explanation.terms)]
    low, high = _bounds(whitener, explanation.terms)
    values = np.clip(values_of(explanation.terms), low, high)
    steps = []
    for value, parameter in zip(values, parameters, strict=True):
        departure = 0.0 if parameter.healthy is None else value - parameter.healthy
        size = np.clip(0.5 * abs(departure), parameter.minimum, WIDEST * parameter.minimum)
        back = -1.0 if departure > 0.0 else 1.0
        steps.append(back * max(float(size), parameter.difference))
    base = problem.compared(problem.simulate(values))
    jacobian = problem.whitened(
        problem.slopes(values, base, low, high, steps=np.array(steps))
    )
    return _covariance(jacobian.T @ jacobian, parameters)


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
