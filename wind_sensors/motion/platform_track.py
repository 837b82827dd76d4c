"""The carrier's motion at any instant: interpolated on the sphere, extrapolated within bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.motion import rotations
from wind_sensors.station.signals import PlatformStates, Velocities

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


TRAVEL_SPAN = 1.0
"""Time [s] over which positions are compared for a velocity."""


@dataclass(frozen=True)
class Motion:
    """Attitude and motion of the carrier at n instants.

    Attributes:
        attitude: Quaternion x, y, z, w that turns platform axes into ENU, shape (n, 4).
        velocity: Of the platform's origin, in platform axes [m/s], shape (n, 3).
        angular_rate: In platform axes [rad/s], shape (n, 3).
        position: ENU [m], shape (n, 3).
        travel: Velocity that the positions' change gives, ENU [m/s], shape (n, 3); None: not asked
            for.
    """

    attitude: FloatArray
    velocity: FloatArray
    angular_rate: FloatArray
    position: FloatArray
    travel: FloatArray | None = None

    @cached_property
    def to_earth(self) -> FloatArray:
        """Matrices that turn platform axes into ENU, shape (n, 3, 3)."""
        return rotations.matrix(self.attitude)

    def __len__(self) -> int:
        return int(self.attitude.shape[0])

    def part(self, start: int, stop: int) -> Motion:
        """The instants `start` to `stop` - 1."""
        here = slice(start, stop)
        return Motion(
            self.attitude[here], self.velocity[here], self.angular_rate[here], self.position[here],
            None if self.travel is None else self.travel[here],
        )


@dataclass(frozen=True)
class TrackSample:
    """Motion at the instants asked for, and how far it can be trusted.

    Attributes:
        motion: The motion.
        attitude_variance: Of each component of the attitude's small rotation [rad^2], (n,).
        velocity_variance: Variance of each velocity component [m^2/s^2], (n,).
        known: False where it would be guesswork, because the nearest state is too far; (n,).
    """

    motion: Motion
    attitude_variance: FloatArray
    velocity_variance: FloatArray
    known: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class TrackLimits:
    """How far states may be stretched, and how uncertain they get.

    Attributes:
        longest_extrapolation: Beyond the last (or before the first) state [s].
        longest_gap: Between two states that are interpolated [s].
        attitude_deviation: Standard deviation of a state's attitude [rad].
        velocity_deviation: Standard deviation of a state's velocity components [m/s].
        angular_acceleration: Typical unmodelled angular acceleration [rad/s^2].
        acceleration: Typical unmodelled acceleration [m/s^2].
    """

    longest_extrapolation: float = 0.5
    longest_gap: float = 2.0
    attitude_deviation: float = 0.0087
    velocity_deviation: float = 0.05
    angular_acceleration: float = 0.5
    acceleration: float = 1.0


@dataclass(frozen=True)
class _Places:
    """Where instants lie among the times at which something was told.

    Attributes:
        left, right: Indices of the neighbours, shape (n,).
        inside: Place between them, 0 to 1, shape (n,).
        beyond: Time since the last one, or (negative) until the first [s], shape (n,).
        span: Between the neighbours [s], shape (n,).
    """

    left: npt.NDArray[np.intp]
    right: npt.NDArray[np.intp]
    inside: FloatArray
    beyond: FloatArray
    span: FloatArray

    @classmethod
    def of(cls, known: TimeArray, wanted: TimeArray) -> _Places:
        """Places of the instants `wanted` among times in order, of which there is one at least."""
        count = known.size
        left = np.clip(np.searchsorted(known, wanted, side="right") - 1, 0, max(count - 2, 0))
        right = np.minimum(left + 1, count - 1)
        span = (known[right] - known[left]).astype(np.float64) * 1e-9
        since = (wanted - known[left]).astype(np.float64) * 1e-9
        fraction = np.divide(since, span, out=np.zeros(wanted.shape), where=span > 0.0)
        beyond = np.where(
            wanted < known[0],
            (wanted - known[0]) * 1e-9,
            np.where(wanted > known[-1], (wanted - known[-1]) * 1e-9, 0.0),
        )
        return cls(left, right, np.clip(fraction, 0.0, 1.0), beyond, span)

    @property
    def bulge(self) -> FloatArray:
        """s (1 - s) T^2 [s^2], shape (n,)."""
        bulge: FloatArray = self.inside * (1.0 - self.inside) * self.span * self.span
        return bulge

    def line(self, values: FloatArray) -> FloatArray:
        """Values (m, k) along straight lines, the ends beyond them; shape (n, k)."""
        weight = self.inside[:, np.newaxis]
        between: FloatArray = (1.0 - weight) * values[self.left] + weight * values[self.right]
        return between

    def within(self, limits: TrackLimits) -> npt.NDArray[np.bool_]:
        """Where reading is no guesswork, shape (n,)."""
        close = np.abs(self.beyond) <= limits.longest_extrapolation
        return np.asarray(close & ((self.span <= limits.longest_gap) | (self.bulge == 0.0)))


def velocity_at(
    told: Velocities, times: TimeArray, limits: TrackLimits | None = None
) -> FloatArray:
    """A velocity that is told apart from the attitude, at any instants [m/s], shape (n, 3).

    Args:
        told: In order of time.
        times: [ns], shape (n,).
        limits: How far it may be stretched; None: as a platform's states.

    Returns:
        Nan where it would be guesswork, as in `TrackSample.known`.
    """
    if told.time.size == 0:
        return np.full((times.size, 3), np.nan)
    places = _Places.of(told.time, times)
    known = places.within(limits if limits is not None else TrackLimits())
    velocity: FloatArray = np.where(known[:, np.newaxis], places.line(told.velocity), np.nan)
    return velocity


class PlatformTrack:
    """A carrier's states as a function of time.

    Between states the attitude follows the great circle and everything else a straight line.
    Beyond them the platform keeps its turning rate and its velocity as long as extrapolation is
    allowed, and the variances grow with the accelerations that may have happened unseen.

    Args:
        states: States in any order; doubles in time are dropped.
        limits: How far they may be stretched.
        with_travel: Give the velocity that follows from the positions, too.
        velocities: Of the platform, in order of time, instead of those of the states: they come
            at times of their own, and the motion is known where both are.

    Raises:
        UserError: There is no usable state.
    """

    def __init__(
        self,
        states: PlatformStates,
        limits: TrackLimits | None = None,
        with_travel: bool = False,
        velocities: Velocities | None = None,
    ) -> None:
        self.limits = limits if limits is not None else TrackLimits()
        self._with_travel = with_travel
        self._apart = velocities
        finite = (
            np.isfinite(states.attitude).all(axis=1)
            & np.isfinite(states.velocity).all(axis=1)
            & np.isfinite(states.angular_rate).all(axis=1)
            & (np.linalg.norm(states.attitude, axis=1) > 0.5)
        )
        times, first = np.unique(states.time[finite], return_index=True)
        if times.size == 0 or (velocities is not None and velocities.time.size == 0):
            raise UserError(
                "The platform has no usable state.",
                "platform",
                "Record its odometry with unit quaternions, or remove `platform` from the station.",
            )
        self._time: TimeArray = times
        self._attitude = rotations.normalise(states.attitude[finite][first])
        self._velocity = states.velocity[finite][first]
        self._rate = states.angular_rate[finite][first]
        self._position = states.position[finite][first]

    @property
    def start(self) -> int:
        """Time of the first state [ns]."""
        return int(self._time[0])

    @property
    def stop(self) -> int:
        """Time of the last state [ns]."""
        return int(self._time[-1])

    def at(self, times: TimeArray) -> TrackSample:
        """The motion at instants [ns], shape (n,)."""
        wanted = np.asarray(times, dtype=np.int64)
        places = _Places.of(self._time, wanted)
        if self._apart is None:
            moved, velocity = places, places.line(self._velocity)
        else:
            moved = _Places.of(self._apart.time, wanted)
            velocity = moved.line(self._apart.velocity)
        motion = Motion(
            attitude=rotations.slerp(
                self._attitude[places.left], self._attitude[places.right], places.inside
            ),
            velocity=velocity,
            angular_rate=places.line(self._rate),
            position=places.line(self._position),
        )
        if self._with_travel:
            motion = replace(motion, travel=self._travel(wanted))
        longest = self.limits.longest_extrapolation
        motion = _carried_on(motion, np.clip(places.beyond, -longest, longest))
        return self._judged(motion, places, moved)

    def _travel(self, wanted: TimeArray) -> FloatArray:
        """Change of the position over a second around each instant [m/s], shape (n, 3)."""
        half = int(0.5e9 * TRAVEL_SPAN)
        early = np.clip(wanted - half, self._time[0], self._time[-1])
        late = np.clip(wanted + half, self._time[0], self._time[-1])
        span = np.maximum((late - early) * 1e-9, 1e-3)
        since = self._time[0]
        moved: FloatArray = np.stack(
            [
                np.interp(late - since, self._time - since, axis)
                - np.interp(early - since, self._time - since, axis)
                for axis in self._position.T
            ],
            axis=1,
        )
        velocity: FloatArray = moved / span[:, np.newaxis]
        return velocity

    def _judged(self, motion: Motion, places: _Places, moved: _Places) -> TrackSample:
        """Variances: an acceleration a unseen for t adds a t^2/2 outside, a s(1-s) T^2/2 inside."""
        limits = self.limits
        unseen = 0.5 * (np.square(places.beyond) + places.bulge)
        return TrackSample(
            motion=motion,
            attitude_variance=limits.attitude_deviation**2
            + np.square(limits.angular_acceleration * unseen),
            velocity_variance=limits.velocity_deviation**2
            + np.square(limits.acceleration * (np.abs(moved.beyond) + np.sqrt(moved.bulge))),
            known=places.within(limits) & moved.within(limits),
        )


def _carried_on(motion: Motion, seconds: FloatArray) -> Motion:
    """The motion continued at constant turning rate and velocity for some seconds, per instant."""
    if not np.any(seconds):
        return motion
    step = seconds[:, np.newaxis]
    attitude = rotations.normalise(
        rotations.multiply(
            motion.attitude, rotations.from_rotation_vector(motion.angular_rate * step)
        )
    )
    travelled = rotations.rotate(motion.attitude, motion.velocity) * step
    return replace(motion, attitude=attitude, position=motion.position + travelled)


def sampled(motion: Motion, dt: float, seconds: FloatArray) -> Motion:
    """A regularly sampled motion, read at any instants.

    Args:
        motion: At instants 0, dt, 2 dt, ...
        dt: Interval [s].
        seconds: Instants wanted [s], shape (m,); beyond the ends the ends are read.
    """
    count = len(motion)
    place = np.clip(np.asarray(seconds, dtype=np.float64) / dt, 0.0, count - 1.0)
    nearest = np.rint(place)
    place = np.where(np.abs(place - nearest) < 1e-7, nearest, place)
    left = np.minimum(place.astype(np.int64), max(count - 2, 0))
    right = np.minimum(left + 1, count - 1)
    fraction = place - left
    weight = fraction[:, np.newaxis]

    def between(values: FloatArray) -> FloatArray:
        line: FloatArray = (1.0 - weight) * values[left] + weight * values[right]
        return line

    return Motion(
        attitude=rotations.slerp(motion.attitude[left], motion.attitude[right], fraction),
        velocity=between(motion.velocity),
        angular_rate=between(motion.angular_rate),
        position=between(motion.position),
        travel=None if motion.travel is None else between(motion.travel),
    )


def shifted(motion: Motion, dt: float, seconds: npt.ArrayLike) -> Motion:
    """A regularly sampled motion, each instant read that many seconds later.

    Args:
        motion: At instants 0, dt, 2 dt, ...
        dt: Interval [s].
        seconds: Shift [s], scalar or shape (n,); beyond the ends the ends are read.
    """
    instants = dt * np.arange(len(motion), dtype=np.float64)
    return sampled(motion, dt, instants + np.asarray(seconds, dtype=np.float64))
