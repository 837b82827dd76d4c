"""The signals of a station as plain arrays, whatever they came from.

Times are nanoseconds of the recording's clock as integers, so that live and offline processing
see the same numbers; differences become seconds as floats where they enter an equation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

ERRATIC_STEP = np.radians(100.0)
"""No vane turns this far [rad] between two readings that are `ERRATIC_INTERVAL` apart."""

ERRATIC_INTERVAL = 120_000_000
"""Readings further apart [ns] are not judged by their steps."""

FLOATING_STEP = (np.radians(3.0), np.radians(30.0))
TIMES_USUAL_STEP = 4.0
"""Of readings that are known to jump about at times, steps are jumps, too, that are so many times
as large as all but a hundredth of the others, within these bounds [rad]."""

MANY_RETURNS = (12.0, 24.0)
"""A vane comes back to a number that stands for no direction this often: less than the first it is
none, from the second on it is one; and by the same ratio more often than to any other number."""

_FEW_RETURNS = 4.0
_SAME_NUMBER = np.radians(0.001)
_NOISY_NUMBER = np.radians(0.1)
_NOISY_CELLS = 2

_ERRATIC_REACH = 150_000_000
_ERRATIC_TOGETHER = 300_000_000
_ERRATIC_PAUSE = 1_000_000_000


@dataclass(frozen=True)
class Pulses:
    """Edges of one rotor.

    Attributes:
        time: Edge times in the order of arrival [ns], shape (n,).
        turns: Revolutions the rotor had made at each edge, where the source tells (a counter, an
            angle); None where every edge is one slot. Shape (n,).
    """

    time: TimeArray
    turns: FloatArray | None = None


@dataclass(frozen=True)
class Angles:
    """Readings of one vane: heading of the nose, counter-clockwise from x [rad]; shape (n,)."""

    time: TimeArray
    angle: FloatArray

    @cached_property
    def erratic(self) -> BoolArray:
        """Readings that jump about, see `erratic_readings`; shape (n,).

        By `ERRATIC_STEP`, or by `floating_step` where some do by as much: numbers drawn by chance
        that pass for good ones have more power than all eddies.
        """
        wrong = erratic_readings(self)
        return erratic_readings(self, self.floating_step) if wrong.any() else wrong

    @cached_property
    def floating_step(self) -> float:
        """Step between two readings that counts as a jump where some jump about [rad]."""
        wrong = erratic_readings(self)
        steps = _steps(self)[~(wrong[1:] | wrong[:-1])]
        steps = steps[np.isfinite(steps)]
        usual = float(np.quantile(steps, 0.99)) if steps.size else np.inf
        return float(np.clip(TIMES_USUAL_STEP * usual, *FLOATING_STEP))

    @cached_property
    def at_one_number(self) -> FloatArray:
        """How far readings are one number again and again, see `at_one_number`; shape (n,)."""
        return at_one_number(self)


def at_one_number(angles: Angles) -> FloatArray:
    """How far each reading is the number that a vane shows where it has no reading; 0 to 1, (n,).

    A potentiometer's gap may read one end of its track. The vane comes back to that number again
    and again, and far less often to any other; one that sticks rests here and there, and coarse
    readings share their returns. It is the same to the last digit, or within a converter's noise.

    Args:
        angles: Readings.
    """
    told = np.where(np.isfinite(angles.angle), angles.angle, np.inf)
    found = _returns_to_one(told, _SAME_NUMBER, 0)
    return found if found.any() else _returns_to_one(told, _NOISY_NUMBER, _NOISY_CELLS)


def _returns_to_one(angle: FloatArray, cell: float, beside: int) -> FloatArray:
    """How far each reading is the number to which they return most often, shape (n,).

    Args:
        angle: Readings [rad], infinite where there is none.
        cell: Width in which they count as one number [rad].
        beside: Cells to either side that belong to the number as well.
    """
    number = np.rint(angle / cell)
    stays = np.flatnonzero(np.isfinite(number[1:]) & (number[1:] == number[:-1]))
    if stays.size < MANY_RETURNS[0]:
        return np.zeros(number.size)
    begins = stays[np.diff(stays, prepend=-2) > 1]
    numbers, returns = np.unique(number[begins], return_counts=True)
    most = int(np.argmax(returns))
    apart = np.abs(numbers - numbers[most]) > beside
    other = max(float(np.max(returns[apart], initial=0)), _FEW_RETURNS)
    least, sure = (count / _FEW_RETURNS for count in MANY_RETURNS)
    share = np.clip((returns[most] / other - least) / (sure - least), 0.0, 1.0)
    return np.where(np.abs(number - numbers[most]) <= beside, float(share), 0.0)


def erratic_readings(angles: Angles, least: float = ERRATIC_STEP) -> BoolArray:
    """Readings that jump about as an open potentiometer's do, and those close to them; shape (n,).

    A number drawn by chance may lie near the truth, so that readings within 0.15 s of a jump go
    with it, and those between two jumps that are less than a second away on either side.

    Args:
        angles: Readings.
        least: Step between two readings that counts as a jump [rad].
    """
    time = angles.time
    jump = _jumps(angles, least)
    if jump.size == 0:
        return np.zeros(time.size, dtype=np.bool_)
    at = np.sort(np.concatenate((time[jump], time[jump + 1])))
    following = np.searchsorted(at, time)
    before = time - at[np.maximum(following - 1, 0)]
    after = at[np.minimum(following, at.size - 1)] - time
    before, after = np.abs(before), np.abs(after)
    close = np.minimum(before, after) <= _ERRATIC_REACH
    between = (following > 0) & (following < at.size) & (
        np.maximum(before, after) <= _ERRATIC_PAUSE
    )
    return np.asarray(close | between, dtype=np.bool_)


def between_jumps(angles: Angles) -> BoolArray:
    """Readings between jumps that follow each other within 0.3 s; shape (n,).

    They tell the edges of a gap in which the wiper floats: the last good reading before them and
    the first after them are none of them, though they are `erratic`. Now and then a number drawn by
    chance at their beginning or end lies close to the truth, and is not among them either.

    Args:
        angles: Readings.
    """
    out = np.zeros(angles.time.size, dtype=np.bool_)
    jump = _jumps(angles, angles.floating_step)
    if jump.size < 2:
        return out
    parted = np.flatnonzero(np.diff(angles.time[jump]) > _ERRATIC_TOGETHER)
    first = jump[np.concatenate(([0], parted + 1))]
    last = jump[np.concatenate((parted, [jump.size - 1]))]
    for begin, end in zip(first, last, strict=True):
        out[begin + 1 : end + 1] = True
    return out


def _jumps(angles: Angles, least: float) -> npt.NDArray[np.intp]:
    """Numbers of the readings after which the next one is a step of more than `least` away."""
    return np.flatnonzero((_steps(angles) > least) & (np.diff(angles.time) <= ERRATIC_INTERVAL))


def _steps(angles: Angles) -> FloatArray:
    """Angles between successive readings, the shorter way round [rad]; shape (n - 1,)."""
    step = np.diff(angles.angle)
    return np.abs(step - 2.0 * np.pi * np.rint(step / (2.0 * np.pi)))


@dataclass(frozen=True)
class Winds:
    """Wind velocity of a reference: east, north, up [m/s], shape (n, 3)."""

    time: TimeArray
    velocity: FloatArray


@dataclass(frozen=True)
class PlatformStates:
    """Attitude and motion of the carrier.

    Attributes:
        time: [ns], shape (n,).
        attitude: Quaternion x, y, z, w that turns platform axes into ENU, shape (n, 4).
        velocity: Of the platform's origin, in platform axes [m/s], shape (n, 3); nan where it comes
            apart from the attitude and is not known then.
        angular_rate: In platform axes [rad/s], shape (n, 3).
        position: ENU [m], shape (n, 3).
    """

    time: TimeArray
    attitude: FloatArray
    velocity: FloatArray
    angular_rate: FloatArray
    position: FloatArray


@dataclass(frozen=True)
class Velocities:
    """Velocity of the carrier where it is told apart from the attitude, in the axes that the
    station states [m/s], shape (n, 3)."""

    time: TimeArray
    velocity: FloatArray


@dataclass(frozen=True)
class Series:
    """A scalar over time (temperature in deg C, pressure in Pa); shape (n,)."""

    time: TimeArray
    value: FloatArray


@dataclass(frozen=True)
class Recording:
    """A station and all its signals.

    Attributes:
        name: For messages and files.
        station: The station.
        start, stop: First and last time of the recording [ns].
        pulses: By rotor name.
        angles: By vane name; a bivane has `<name>` (azimuth) and `<name>/elevation`.
        reference: Reference wind, if any.
        platform: Carrier, if any.
        platform_velocity: Its velocities as they came, where they come apart from the attitudes.
        temperature, pressure: Air, if any.
        truth: True wind at the sensor, if a simulator wrote it.
        truth_topic: Where it was read from; empty where it was not.
        notes: What reading the recording had to say (bad lines, truncated bag, ...).
    """

    name: str
    station: Station
    start: int
    stop: int
    pulses: dict[str, Pulses] = field(default_factory=dict)
    angles: dict[str, Angles] = field(default_factory=dict)
    reference: Winds | None = None
    platform: PlatformStates | None = None
    platform_velocity: Velocities | None = None
    temperature: Series | None = None
    pressure: Series | None = None
    truth: Winds | None = None
    truth_topic: str = ""
    notes: tuple[str, ...] = ()
