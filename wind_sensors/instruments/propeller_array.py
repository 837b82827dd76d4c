"""Several fixed propellers that together measure the wind vector; Jackson, sec. 4.

Any number of axes of any orientation that span space. An axis points where the wind goes that
turns its propeller forward: theta is the angle between the wind velocity and the axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from wind_sensors.instruments.friction_propeller import (
    AxialInversion,
    FrictionPropeller,
    Response,
    invert_axial,
    steady_oblique,
)

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

INTERFERENCE_ANGLE = 0.75 * math.pi
"""Beyond this angle one propeller stands in another's wake, and f(theta) no longer holds."""
PLANE_MARGIN = math.radians(5.0)
"""Closer to 90 degrees than this, friction and the choice of root leave the component uncertain."""

_LIMIT_ANGLE = 1e-5
_ANGLE_TOLERANCE = 1e-10
_FIXED_POINT_STEPS = 60
_NEWTON_STEPS = 40


class AxialEquation(Protocol):
    """A propeller's equation of motion as `solve` needs it; all arrays have shape (n,)."""

    def component(
        self, indicated: FloatArray, indicated_rate: FloatArray, speed: FloatArray,
        angle: FloatArray,
    ) -> AxialInversion:
        """Roots for the wind along the axis, U cos(theta) [m/s], at a direction.

        Args:
            indicated: P omega [m/s].
            indicated_rate: P domega/dt [m/s^2], or what the equation takes in its place.
            speed: U of the last guess [m/s].
            angle: theta of the last guess [rad].
        """

    def residual(
        self, indicated: FloatArray, indicated_rate: FloatArray, speed: FloatArray,
        angle: FloatArray,
    ) -> FloatArray:
        """The equation at a trial wind [m^2/s^2], zero where it holds."""


@dataclass(frozen=True)
class JacksonEquation:
    """Jackson (5) and its roots (10).

    Attributes:
        propeller: Constants.
    """

    propeller: FrictionPropeller

    def component(
        self, indicated: FloatArray, indicated_rate: FloatArray, speed: FloatArray,
        angle: FloatArray,
    ) -> AxialInversion:
        """X cos(theta)/f(theta) [m/s] from (10), which does not ask for the speed."""
        del speed
        roots = invert_axial(indicated, indicated_rate, angle, self.propeller)
        ratio = cosine_over_response(angle, self.propeller.f)
        return roots._replace(value=roots.value * ratio, other=roots.other * ratio)

    def residual(
        self, indicated: FloatArray, indicated_rate: FloatArray, speed: FloatArray,
        angle: FloatArray,
    ) -> FloatArray:
        """(5) at a trial wind [m^2/s^2]."""
        p = self.propeller
        torque = speed * p.g(angle) * (speed * p.f(angle) - indicated)
        friction = p.stall_speed**2 * np.sign(indicated)
        return np.asarray(torque - p.response_length * indicated_rate - friction)


@dataclass(frozen=True)
class ArrayEstimate:
    """Wind vectors of an array, with what is known about their trustworthiness.

    Attributes:
        velocity: Wind velocity [m/s], shape (n, 3).
        angles: Angle of the wind to each axis [rad], shape (n, m).
        iterations: Steps until convergence, shape (n,).
        converged: Whether the direction settled to 1e-10 rad, shape (n,).
        interference: |theta| > 135 degrees for a propeller, shape (n, m).
        near_plane: Within 5 degrees of the propeller's plane, or stalled, shape (n, m).
        ambiguous: Both roots of (10) turn the propeller the same way, shape (n, m).
        noisy: The bracket of (10) was negative, shape (n, m).
    """

    velocity: FloatArray
    angles: FloatArray
    iterations: npt.NDArray[np.int64]
    converged: BoolArray
    interference: BoolArray
    near_plane: BoolArray
    ambiguous: BoolArray
    noisy: BoolArray


def orthogonal_axes() -> FloatArray:
    """Axes along x, y, z; shape (3, 3), one axis per row."""
    return np.eye(3)


def tripod_axes(wind_heading: float, wind_elevation: float = 0.0, roll: float = 0.0) -> FloatArray:
    """Three orthogonal axes placed evenly around a mean wind direction, one per row.

    Each stands at 54.7 degrees to the mean wind, so that no propeller meets 90 degrees while the
    wind stays within 35.3 degrees of it, nor the wake of another (Jackson, sec. 5).

    Args:
        wind_heading: Where the mean wind goes, counter-clockwise from x [rad].
        wind_elevation: Its angle above the x-y plane [rad].
        roll: Turn of the tripod around the mean wind [rad].
    """
    inclination = math.acos(1.0 / math.sqrt(3.0))
    around = roll + 2.0 * math.pi * np.arange(3) / 3.0
    c, s = math.cos(wind_heading), math.sin(wind_heading)
    ce, se = math.cos(wind_elevation), math.sin(wind_elevation)
    along = np.array([ce * c, ce * s, se])
    side = np.array([-s, c, 0.0])
    above = np.cross(along, side)
    across = np.cos(around)[:, None] * side + np.sin(around)[:, None] * above
    return np.asarray(math.cos(inclination) * along + math.sin(inclination) * across)


def wind_angles(axes: npt.ArrayLike, wind: npt.ArrayLike) -> FloatArray:
    """Angle of the wind to each axis [rad, 0..pi], shape (..., m); pi/2 in a calm."""
    unit = np.asarray(axes, dtype=np.float64)
    u = np.asarray(wind, dtype=np.float64)
    along = u @ unit.T
    speed = np.linalg.norm(u, axis=-1, keepdims=True)
    across2 = np.maximum(speed * speed - along * along, 0.0)
    # atan2 keeps angles near 0 and pi exact, where arccos loses half the digits.
    across = np.where(np.abs(along) > 0.9 * speed, _across(unit, u), np.sqrt(across2))
    return np.asarray(np.arctan2(across, along))


def steady_readings(
    axes: npt.ArrayLike, propeller: FrictionPropeller, wind: npt.ArrayLike
) -> FloatArray:
    """P omega of each propeller in a steady wind [m/s], shape (..., m); Jackson (5), (7).

    Args:
        axes: Unit vectors, shape (m, 3).
        propeller: Constants, the same for all axes.
        wind: Wind velocity [m/s], shape (..., 3).
    """
    u = np.asarray(wind, dtype=np.float64)
    speed = np.linalg.norm(u, axis=-1, keepdims=True)
    return steady_oblique(speed, wind_angles(axes, u), propeller)


def uncorrected_velocity(axes: npt.ArrayLike, indicated: npt.ArrayLike) -> FloatArray:
    """Wind velocity [m/s] if every propeller had a cosine response and no inertia or friction."""
    inverse = np.linalg.pinv(np.asarray(axes, dtype=np.float64))
    return np.asarray(np.asarray(indicated, dtype=np.float64) @ inverse.T)


def solve(
    axes: npt.ArrayLike,
    propellers: FrictionPropeller | Sequence[AxialEquation],
    indicated: npt.ArrayLike,
    indicated_rate: npt.ArrayLike | None = None,
) -> ArrayEstimate:
    """Wind vectors from the rates (and accelerations) of all propellers.

    Fixed-point iteration of Jackson, sec. 4; samples that it does not settle go on with Newton's
    method on the same equations. What still does not settle is reported, not hidden.

    Args:
        axes: Unit vectors, shape (m, 3), m >= 3, spanning space.
        propellers: Constants, the same for all axes, or one equation for each axis.
        indicated: P omega [m/s], shape (n, m); a row with a NaN gives NaN, not converged.
        indicated_rate: P domega/dt [m/s^2], shape (n, m); zero (steady) if not given. Take it
            before decimating.

    Raises:
        ValueError: If the axes do not span space.
    """
    unit = np.asarray(axes, dtype=np.float64)
    if np.linalg.matrix_rank(unit) < 3:
        raise ValueError("the axes of the array do not span space: one wind component is unseen")
    y = np.atleast_2d(np.asarray(indicated, dtype=np.float64))
    if indicated_rate is None:
        rate = np.zeros_like(y)
    else:
        rate = np.atleast_2d(np.asarray(indicated_rate, dtype=np.float64))
    equations: Sequence[AxialEquation] = (
        [JacksonEquation(propellers)] * unit.shape[0]
        if isinstance(propellers, FrictionPropeller) else propellers
    )
    inverse = np.linalg.pinv(unit)
    velocity = y @ inverse.T
    iterations = np.zeros(y.shape[0], dtype=np.int64)
    converged = np.all(y == 0.0, axis=1)
    unread = ~(np.isfinite(y).all(axis=1) & np.isfinite(rate).all(axis=1))
    velocity[unread] = np.nan
    for step in range(_FIXED_POINT_STEPS):
        active = np.flatnonzero(~converged & ~unread)
        if active.size == 0:
            break
        updated = _roots(unit, equations, y[active], rate[active], velocity[active]).value
        updated = updated @ inverse.T
        settled = _turn(velocity[active], updated) < _ANGLE_TOLERANCE
        velocity[active] = updated
        iterations[active] = step + 1
        converged[active] = settled
    left = np.flatnonzero(~converged & ~unread)
    if left.size:
        velocity[left], settled = _newton(unit, equations, y[left], rate[left], velocity[left])
        iterations[left] += _NEWTON_STEPS
        converged[left] = settled
    angles = wind_angles(unit, velocity)
    roots = _roots(unit, equations, y, rate, velocity)
    return ArrayEstimate(
        velocity=velocity,
        angles=angles,
        iterations=iterations,
        converged=converged,
        interference=angles > INTERFERENCE_ANGLE,
        near_plane=(np.abs(angles - 0.5 * math.pi) < PLANE_MARGIN) | (y == 0.0),
        ambiguous=roots.ambiguous,
        noisy=roots.noisy,
    )


def _across(unit: FloatArray, u: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(np.cross(u[..., None, :], unit), axis=-1))


def cosine_over_response(angles: FloatArray, f: Response) -> FloatArray:
    """cos(theta)/f(theta) [1], by its limit close to 90 degrees where both vanish.

    Args:
        angles: theta [rad].
        f: Angular response.
    """
    offset = angles - 0.5 * math.pi
    shifted = 0.5 * math.pi + np.where(offset >= 0.0, _LIMIT_ANGLE, -_LIMIT_ANGLE)
    theta = np.where(np.abs(offset) < _LIMIT_ANGLE, shifted, angles)
    response = np.asarray(f(theta), dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.cos(theta) / response
    # A table whose zero lies a little off 90 degrees must not blow the component up.
    return np.clip(np.nan_to_num(ratio, nan=1.0), 0.25, 4.0)


def _turn(before: FloatArray, after: FloatArray) -> FloatArray:
    """Relative change of the vector, which bounds the change of every angle [rad]."""
    change = np.linalg.norm(after - before, axis=1)
    return np.asarray(change / np.maximum(np.linalg.norm(after, axis=1), 1e-12))


def _by_propeller(
    unit: FloatArray,
    equations: Sequence[AxialEquation],
    y: FloatArray,
    rate: FloatArray,
    velocity: FloatArray,
) -> Iterator[tuple[AxialEquation, tuple[FloatArray, FloatArray, FloatArray, FloatArray]]]:
    """Each propeller's equation, and y, its rate, the speed and the angle of a guess, (n,) each."""
    speed = np.asarray(np.linalg.norm(velocity, axis=1))
    angles = wind_angles(unit, velocity)
    for k, equation in enumerate(equations):
        yield equation, (y[:, k], rate[:, k], speed, angles[:, k])


def _roots(
    unit: FloatArray,
    equations: Sequence[AxialEquation],
    y: FloatArray,
    rate: FloatArray,
    velocity: FloatArray,
) -> AxialInversion:
    """Components of all propellers at the directions of a guess, shape (n, m) each."""
    each = [e.component(*at) for e, at in _by_propeller(unit, equations, y, rate, velocity)]
    return AxialInversion(*(np.stack(columns, axis=1) for columns in zip(*each, strict=True)))


def _residual(
    unit: FloatArray,
    equations: Sequence[AxialEquation],
    y: FloatArray,
    rate: FloatArray,
    velocity: FloatArray,
) -> FloatArray:
    """All propellers' equations at a trial wind [m^2/s^2], shape (n, m)."""
    columns = [e.residual(*at) for e, at in _by_propeller(unit, equations, y, rate, velocity)]
    return np.stack(columns, axis=1)


def _newton(
    unit: FloatArray,
    equations: Sequence[AxialEquation],
    y: FloatArray,
    rate: FloatArray,
    start: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    velocity = start.copy()
    misfit = _residual(unit, equations, y, rate, velocity)
    settled = np.zeros(y.shape[0], dtype=bool)
    for _ in range(_NEWTON_STEPS):
        scale = np.maximum(np.linalg.norm(velocity, axis=1), 0.1)
        jacobian = np.empty((*y.shape, 3))
        for axis in range(3):
            nudge = np.zeros_like(velocity)
            nudge[:, axis] = 1e-6 * scale
            above = _residual(unit, equations, y, rate, velocity + nudge)
            below = _residual(unit, equations, y, rate, velocity - nudge)
            jacobian[:, :, axis] = (above - below) / (2e-6 * scale)[:, None]
        change = -np.einsum("nij,nj->ni", np.linalg.pinv(jacobian), misfit)
        length = np.linalg.norm(change, axis=1)
        change *= np.minimum(1.0, 0.5 * scale / np.maximum(length, 1e-300))[:, None]
        size = np.linalg.norm(misfit, axis=1)
        shrink = np.ones(y.shape[0])
        for _ in range(12):
            trial = velocity + shrink[:, None] * change
            trial_misfit = _residual(unit, equations, y, rate, trial)
            worse = np.linalg.norm(trial_misfit, axis=1) > size
            if not np.any(worse):
                break
            shrink = np.where(worse, 0.5 * shrink, shrink)
        velocity, misfit = trial, trial_misfit
        settled = np.linalg.norm(misfit, axis=1) < 1e-9 * scale**2
        if np.all(settled):
            break
    return velocity, settled
