"""Damped least squares (Levenberg 1944, Marquardt 1963) with derivatives that are carried along.

Derivatives are taken by differences, which cost a simulation for each parameter, and after each
step made to agree with it (Broyden 1965). A step that gained less than they promised, or more than
small steps do, makes them be taken anew.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.explaining.problem import Point, Problem

FloatArray = npt.NDArray[np.float64]

_LARGEST_DAMPING = 1e5
"""With more damping no step is worth its simulation."""

_FIRST_DAMPING = 1e-2
"""Share of the derivatives' squares that is added to them to begin with."""

_LEAST_DAMPING = 1e-6
"""With less damping a step is no longer than with this."""

_LESS_DAMPED = 0.2
"""After a step that went down, the damping is so many times as large."""

_MORE_DAMPED = 8.0
"""The same after one that went up."""

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
class State:
    """Where a search stands between two steps.

    Attributes:
        point: The best so far.
        slopes: Derivatives of what is compared there, in units of the parameters' differences,
            shape (l, parameters); None: not known.
        normal: Products of the white derivatives at the last step, shape (parameters, parameters).
        damping: Of the next step.
        gained: Drop of the cost by the last step; infinite where derivatives were taken anew.
        stale: Whether derivatives have to be taken anew.
        rough: Whether they are taken from farther away, over the hollows of the cost.
        done: Whether no further step is worthwhile.
    """

    point: Point
    slopes: FloatArray | None
    normal: FloatArray
    damping: float = _FIRST_DAMPING
    gained: float = np.inf
    stale: bool = False
    rough: bool = False
    done: bool = False


@dataclass(frozen=True)
class _Step:
    """The last step that was tried from a point.

    Attributes:
        reached: Where it led; None: not down.
        moved: It, in units of the parameters' differences.
        promised: Drop of the cost that the derivatives promised.
        gained: Drop of the cost.
        damping: For the next step from there, had it not gone down.
        failed: Number of steps, it among them, that promised to go down and did not though the
            derivatives were taken there.
    """

    reached: Point | None
    moved: FloatArray
    promised: float
    gained: float
    damping: float
    failed: int


def descended(
    problem: Problem,
    start: Point,
    slopes: FloatArray | None,
    iterations: int,
    least: float,
    hollow: bool,
) -> State:
    """Go down from a point for as long as that is worthwhile.

    Args:
        problem: What is to be fitted.
        start: Where to begin.
        slopes: Derivatives there, carried along from elsewhere; None: not known.
        iterations: Largest number of steps.
        least: Drop of the cost that is worth another step, beside a share of the cost.
        hollow: Whether the cost has hollows in which small steps stay.
    """
    state = State(start, slopes, np.eye(len(start.values)))
    for _ in range(iterations):
        state = _after_a_step(problem, state, least, hollow)
        if state.done:
            break
    return state


def _after_a_step(problem: Problem, state: State, least: float, hollow: bool) -> State:
    """The state after one step, or after finding that the derivatives do not hold.

    Args:
        problem: What is to be fitted.
        state: Before.
        least: Drop of the cost that is worth another step.
        hollow: Whether the cost has hollows.
    """
    exact = state.slopes is None or state.stale
    slopes = state.slopes
    if slopes is None or state.stale:
        slopes = _slopes_at(problem, state)
        state = replace(state, slopes=slopes, stale=False, gained=np.inf)
    point = state.point
    jacobian = problem.whitened(slopes)
    state = replace(state, normal=jacobian.T @ jacobian)
    excess = max(point.cost - point.vector.size, 0.0)
    worthwhile = least + _ROUNDING * point.cost + _FAR_OFF * excess
    step = _best_step(problem, state, jacobian, worthwhile, exact)
    if step.failed and step.reached is None and hollow and not state.rough:
        # Small steps promise to go down and all go up: the slope is that of a hollow.
        return replace(state, rough=True, stale=True, damping=_FIRST_DAMPING)
    done = step.gained < worthwhile and (exact or step.promised < worthwhile)
    if step.reached is None:
        return replace(state, stale=not exact, damping=step.damping, done=done)
    missed = step.promised - step.gained
    stale = missed > max((1.0 - _NEARLY_LINEAR) * step.promised, worthwhile)
    stale = stale or step.gained > max(_SLOW * state.gained, worthwhile)
    change = problem.change(point.simulated, step.reached.simulated)
    return replace(
        state,
        point=step.reached,
        slopes=_secant(slopes, step.moved, change),
        damping=max(_LESS_DAMPED * step.damping, _LEAST_DAMPING),
        gained=step.gained,
        stale=stale,
        done=done,
    )


def _slopes_at(problem: Problem, state: State) -> FloatArray:
    """Derivatives by differences, where the search stands."""
    steps = _OVER_THE_ROUGH * problem.scale if state.rough else None
    point = state.point
    return problem.slopes(point.values, problem.compared(point.simulated), steps=steps)


def _best_step(
    problem: Problem, state: State, jacobian: FloatArray, worthwhile: float, exact: bool
) -> _Step:
    """The longest step that goes down, damped until it does.

    Derivatives that were carried along get one trial: where it fails, they do not hold.

    Args:
        problem: What is to be fitted.
        state: Where the search stands.
        jacobian: Derivatives of the white vector there, shape (m, parameters).
        worthwhile: Drop of the cost that is worth a trial.
        exact: Whether derivatives were taken at this point.
    """
    point, damping, failed = state.point, state.damping, 0
    gradient = jacobian.T @ point.vector
    moved, promised = np.zeros_like(point.values), 0.0
    while damping < _LARGEST_DAMPING:
        weighted = state.normal + damping * np.diag(np.diag(state.normal) + 1e-9)
        step = -np.linalg.solve(weighted, gradient) * problem.scale
        trial = np.clip(point.values + step, problem.low, problem.high)
        moved = (trial - point.values) / problem.scale
        expected = point.vector + jacobian @ moved
        promised = point.cost - float(expected @ expected)
        if promised < worthwhile:
            break
        reached = problem.at(trial)
        if reached is not None and reached.cost < point.cost:
            gained = point.cost - reached.cost
            return _Step(reached, moved, promised, gained, damping, failed)
        if not exact:
            break
        damping *= _MORE_DAMPED
        failed += 1
    return _Step(None, moved, promised, 0.0, damping, failed)


def _secant(slopes: FloatArray, step: FloatArray, change: FloatArray) -> FloatArray:
    """The smallest change of the derivatives that agrees with the last step (Broyden).

    Args:
        slopes: Shape (l, parameters).
        step: Of the parameters, shape (parameters,).
        change: Of what is compared, shape (l,).
    """
    missed = change - slopes @ step
    return np.asarray(slopes + np.outer(missed, step) / max(float(step @ step), 1e-12))
