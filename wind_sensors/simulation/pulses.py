"""From a turning rotor to stamped edges: slots, contacts, dead time, losses, clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from wind_sensors.compiled import compiled
from wind_sensors.errors import UserError
from wind_sensors.simulation import random_numbers
from wind_sensors.simulation.clocks import stamps
from wind_sensors.simulation.response import Response
from wind_sensors.station.inputs import resolved
from wind_sensors.station.losses import lost_share
from wind_sensors.station.model import Rotor
from wind_sensors.station.signals import Pulses

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]


LONGEST_BOUNCE = 2.0
"""A contact that bounces closes again at any time up to so many mean delays, each as likely."""

CLOSE = 1e-6
"""A Newton step this small leaves an error of the order of its square, far below a nanosecond."""

UNSURE = 0.03
"""Of a rotor's rate from pulse to pulse [1], where a reference half a metre away tells the wind."""

MOST_SKIPPED = 50
"""Of more edges in a row that a dead time takes nobody needs the exact share."""

MOST_EDGES = 50_000_000
"""Edges of one response, 0.8 GB of them: a rotor at a hundred a second for six days."""

GENTLE = 0.03
"""A cubic whose slope changes by less than this share between its ends is within 1e-9 of its
crossing after one step of third order (Halley's) from a straight line."""


@compiled
def _crossing(
    rise: float, slope_0: float, c_2: float, c_3: float, gentle: bool, level: float
) -> float:
    """Where in [0, 1] the cubic slope_0 u + c_2 u^2 + c_3 u^3 passes a level between 0 and `rise`.

    One step where the cubic is gentle, else Newton's method inside a shrinking bracket.
    """
    u = level / rise
    if gentle:
        per_slope = 1.0 / (slope_0 + u * (2.0 * c_2 + 3.0 * u * c_3))
        step = (u * (slope_0 + u * (c_2 + u * c_3)) - level) * per_slope
        return u - step * (1.0 + step * (c_2 + 3.0 * u * c_3) * per_slope)
    low, high = 0.0, 1.0
    for _ in range(60):
        value = u * (slope_0 + u * (c_2 + u * c_3)) - level
        if (value > 0.0) == (rise > 0.0):
            high = u
        else:
            low = u
        slope = slope_0 + u * (2.0 * c_2 + 3.0 * u * c_3)
        following = u - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low <= following <= high:
            following = 0.5 * (low + high)
        if abs(following - u) < CLOSE:
            return following
        u = following
    return u


@compiled
def _edges_of(
    psi: FloatArray,
    rate: FloatArray,
    dt: float,
    slot_angles: FloatArray,
    start: int,
    before: float,
) -> tuple[TimeArray, npt.NDArray[np.int64]]:
    """Times at which slots pass the sensor, and the running number of each slot.

    Args:
        psi, rate: Rotor angle [rad] and rate [rad/s] every dt, shape (m,).
        dt: [s].
        slot_angles: Angle of each slot within a turn [rad], shape (slots,).
        start: Time from which `before` counts [ns].
        before: When the first sample is [s].

    Returns:
        Times [ns], numbers (slot + slots * turn); in order of time.
    """
    slots = slot_angles.shape[0]
    width = 2.0 * math.pi / slots
    room = 16
    for i in range(psi.shape[0] - 1):
        room += int(abs(psi[i + 1] - psi[i]) / width) + 3
    times = np.empty(room, dtype=np.int64)
    numbers = np.empty(room, dtype=np.int64)
    count = 0
    known = False
    ahead = 0
    slot = 0
    turned = 0.0
    ahead_level = 0.0
    for i in range(psi.shape[0] - 1):
        a, b = psi[i], psi[i + 1]
        if a == b:
            continue
        rise = b - a
        slope_0, slope_1 = rate[i] * dt, rate[i + 1] * dt
        c_2 = 3.0 * rise - 2.0 * slope_0 - slope_1
        c_3 = slope_0 + slope_1 - 2.0 * rise
        gentle = abs(c_2) + 3.0 * abs(c_3) < GENTLE * min(abs(slope_0), abs(slope_1))
        if b > a:
            # Rotors seldom turn back: the next slot ahead is remembered.
            if not known:
                ahead = math.floor(a / width) - 2
                while True:
                    turn = ahead // slots
                    slot = ahead - turn * slots
                    turned = 2.0 * math.pi * turn
                    ahead_level = turned + slot_angles[slot]
                    if ahead_level > a:
                        break
                    ahead += 1
                known = True
            while ahead_level <= b:
                u = _crossing(rise, slope_0, c_2, c_3, gentle, ahead_level - a)
                times[count] = start + int(np.rint(((i + u) * dt + before) * 1e9))
                numbers[count] = ahead
                count += 1
                ahead += 1
                slot += 1
                if slot == slots:
                    slot = 0
                    turned = 2.0 * math.pi * (ahead // slots)
                ahead_level = turned + slot_angles[slot]
            continue
        known = False
        number = math.floor(a / width) + 2
        while True:
            turn = number // slots
            level = 2.0 * math.pi * turn + slot_angles[number - turn * slots]
            if level < b:
                break
            if level < a:
                u = _crossing(rise, slope_0, c_2, c_3, gentle, level - a)
                times[count] = start + int(np.rint(((i + u) * dt + before) * 1e9))
                numbers[count] = number
                count += 1
            number -= 1
    return times[:count], numbers[:count]


@compiled
def _after_dead_time(times: TimeArray, dead_time: int, last: int) -> npt.NDArray[np.bool_]:
    """Which edges a circuit accepts that is blind for a while after each accepted one [ns]."""
    accepted = np.empty(times.shape[0], dtype=np.bool_)
    for i in range(times.shape[0]):
        accepted[i] = times[i] - last >= dead_time
        if accepted[i]:
            last = times[i]
    return accepted


def share_in_time(times: TimeArray, dead_time: float) -> FloatArray:
    """Share of the edges that a circuit accepts which is blind for a while after each of them.

    Of edges that come at even intervals T it takes one in ceil(dead_time / T). Which of them hangs
    on hundredths of a millisecond, and when the first is lost on the last per cent of the rate:
    intervals are taken to scatter by `UNSURE`, and the share is the mean over that.

    Args:
        times: Of the edges [ns], ascending, shape (n,).
        dead_time: [s].

    Returns:
        In (0, 1], shape (n,).
    """
    share = np.ones(times.size)
    if dead_time <= 0.0 or times.size < 2:
        return share
    interval = np.diff(times, prepend=2 * times[0] - times[1]) * 1e-9
    taken = dead_time / np.maximum(interval, 1e-9)
    for k in range(1, MOST_SKIPPED):
        near = np.flatnonzero(taken > k * (1.0 - 4.0 * UNSURE))
        if near.size == 0:
            break
        beyond = ndtr(np.log(taken[near] / k) / UNSURE)
        share[near] -= (1.0 / k - 1.0 / (k + 1.0)) * beyond
    return share


LONG_AGO = -(2**62)
"""Before any edge [ns]."""


def slot_angles(rotor: Rotor) -> FloatArray:
    """Angle of each slot within a turn [rad], shape (pulses_per_revolution,).

    Raises:
        UserError: The slot errors do not fit the number of slots or change their order.
    """
    slots = rotor.pulses_per_revolution
    errors = np.zeros(slots)
    given = rotor.electronics.slot_errors
    if given:
        if len(given) != slots:
            raise UserError(
                f"'{rotor.name}' has {slots} pulses per revolution but {len(given)} slot errors.",
                f"instruments.{rotor.name}.electronics.slot_errors",
                "Give one value for each slot.",
            )
        errors = np.asarray(given, dtype=np.float64)
        if np.any(np.diff(errors, append=errors[0]) <= -1.0) or np.abs(errors).max() >= 1.0:
            raise UserError(
                f"The slot errors of '{rotor.name}' exchange neighbouring slots.",
                f"instruments.{rotor.name}.electronics.slot_errors",
                "Give displacements as fractions of the slot width, below one.",
            )
    angles: FloatArray = (np.arange(slots) + errors) * (2.0 * np.pi / slots)
    return angles


def _refuse_what_fills_the_memory(rotor: Rotor, psi: FloatArray) -> None:
    """Raises UserError for a rotor that turns so often that its edges find no room."""
    edges = float(np.abs(np.diff(psi)).sum()) * rotor.pulses_per_revolution / (2.0 * np.pi)
    if not edges <= MOST_EDGES:
        raise UserError(
            f"'{rotor.name}' gives {edges:.2g} edges in one go, more than {MOST_EDGES:.2g}.",
            f"instruments.{rotor.name}",
            "Look at `calibration_distance` [m/rad], `pulses_per_revolution` and the wind.",
        )


@dataclass(frozen=True)
class PassedSlots:
    """Slots that passed the sensor while the rotor did not change.

    Attributes:
        rotor: As it was.
        times: When they passed [ns].
        numbers: slot + slots * turn of each.
        end: Of that time [ns].
        rate: Of the rotor at the nodes [rad/s].
        begin: Time of the first node [ns].
        dt: Between nodes [s].
    """

    rotor: Rotor
    times: TimeArray
    numbers: npt.NDArray[np.int64]
    end: int
    rate: FloatArray
    begin: int
    dt: float

    def lost(self) -> FloatArray:
        """Share of the edges that are lost where each is, shape of `times`; (1,) if all alike."""
        electronics = self.rotor.electronics
        if electronics.loss_growth == 0.0:
            return np.array([electronics.loss_probability])
        nodes = (self.times - self.begin) * (1e-9 / self.dt)
        rate = np.interp(nodes, np.arange(self.rate.size), np.abs(self.rate))
        return lost_share(electronics, rate * self.rotor.calibration_distance)


def passed_slots(response: Response, name: str) -> list[PassedSlots]:
    """The slots of one rotor that passed its sensor, by the stretches of a response."""
    movement = response.rotors[name]
    drive = response.drive
    out: list[PassedSlots] = []
    for stretch in response.stretches:
        rotor = stretch.segment.station.instrument(name)
        assert isinstance(rotor, Rotor)
        here = slice(stretch.first * movement.nodes, stretch.last * movement.nodes + 1)
        _refuse_what_fills_the_memory(rotor, movement.psi[here])
        times, numbers = _edges_of(
            movement.psi[here], movement.rate[here], movement.dt, slot_angles(rotor),
            drive.start_ns, stretch.first * drive.dt,
        )
        end = drive.start_ns + round(stretch.last * drive.dt * 1e9)
        begin = drive.start_ns + round(stretch.first * drive.dt * 1e9)
        rate = movement.rate[here]
        out.append(PassedSlots(rotor, times, numbers, end, rate, begin, movement.dt))
    return out


class PulseCircuit:
    """Sensor, contact and logger of one rotor; keeps its state between responses.

    Args:
        name: Name of the rotor.
        origin: Start of the recording [ns].
        seed: Of the random losses and bounces.
    """

    def __init__(self, name: str, origin: int, seed: int) -> None:
        self._name = name
        self._origin = origin
        self._seed = seed
        self._last = LONG_AGO
        self._waiting: TimeArray = np.empty(0, dtype=np.int64)

    def edges(self, slots: Sequence[PassedSlots]) -> TimeArray:
        """Stamps of the edges that the logger records of slots [ns], in order of time."""
        parts = [self._recorded(passed) for passed in slots]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def signals(self, slots: Sequence[PassedSlots]) -> Pulses:
        """What the logger records: edges, or the shaft's angle whenever it passes a slot.

        Only a shaft angle tells which way the rotor turns. Its source knows neither dead time nor
        bounces; messages can be lost.
        """
        if resolved(slots[0].rotor.pulses, "pulses").meaning != "angle":
            return Pulses(self.edges(slots))
        time, turns = [], []
        for passed in slots:
            now, times, numbers = passed.rotor, passed.times, passed.numbers
            kept = ~self._silent(now, times)
            if now.electronics.loss_probability > 0.0:
                kept &= self._drawn("loss", numbers) >= passed.lost()
            time.append(stamps(now.clock, times[kept], self._origin))
            turns.append(numbers[kept] / now.pulses_per_revolution)
        return Pulses(np.concatenate(time), np.concatenate(turns))

    def expected(
        self, slots: Sequence[PassedSlots], bounces: bool = True, losses: bool = True
    ) -> Pulses:
        """What the logger records on average: every edge, for as many as chance makes of it.

        Args:
            slots: Those that passed.
            bounces: Whether edges that bounce count more than once.
            losses: Whether edges that chance takes are missing.
        """
        time, weights = [], []
        for passed in slots:
            rotor = passed.rotor
            electronics = rotor.electronics
            sure = {"bounce_probability": 0.0, "loss_probability": 0.0, "dead_time": 0.0}
            certain = rotor.model_copy(
                update={"electronics": electronics.model_copy(update=sure)}
            )
            part = self._recorded(replace(passed, rotor=certain))
            longest = LONGEST_BOUNCE * electronics.bounce_delay
            heard = max(1.0 - electronics.dead_time / longest, 0.0)
            bounced = electronics.bounce_probability * heard if bounces else 0.0
            lost = passed.lost() if losses else np.zeros(1)
            if losses and electronics.loss_growth > 0.0 and passed.times.size:
                # Those that an outage takes leave fewer edges than passed.
                lost = np.interp(part, stamps(rotor.clock, passed.times, self._origin), lost)
            in_time = share_in_time(part, electronics.dead_time)
            time.append(part)
            weights.append(
                np.full(part.size, (1.0 - lost + bounced) / rotor.pulses_per_revolution) * in_time
            )
        return Pulses(np.concatenate(time), np.cumsum(np.concatenate(weights)))

    def _silent(self, rotor: Rotor, times: TimeArray) -> npt.NDArray[np.bool_]:
        """Which times lie in an outage."""
        since = (times - self._origin) * 1e-9
        silent = np.zeros(times.size, dtype=np.bool_)
        for outage in rotor.outages:
            silent |= (since >= outage.start) & (since < outage.stop)
        return silent

    def _drawn(self, purpose: str, numbers: npt.NDArray[np.int64]) -> FloatArray:
        return random_numbers.uniform(self._seed, f"{self._name}/{purpose}", numbers)

    def _recorded(self, passed: PassedSlots) -> TimeArray:
        rotor, times, numbers, end = passed.rotor, passed.times, passed.numbers, passed.end
        electronics = rotor.electronics
        bounces: TimeArray = np.empty(0, dtype=np.int64)
        if electronics.bounce_probability > 0.0:
            bouncing = self._drawn("bounce", numbers) < electronics.bounce_probability
            share = self._drawn("bounce delay", numbers[bouncing])
            delay = LONGEST_BOUNCE * electronics.bounce_delay * share
            bounces = times[bouncing] + np.rint(delay * 1e9).astype(np.int64)
        if electronics.loss_probability > 0.0:
            times = times[self._drawn("loss", numbers) >= passed.lost()]
        if bounces.size or self._waiting.size:
            times = np.sort(np.concatenate((times, bounces, self._waiting)), kind="stable")
            self._waiting = times[times > end]
            times = times[times <= end]
        if electronics.dead_time > 0.0:
            times = times[_after_dead_time(times, round(electronics.dead_time * 1e9), self._last)]
        if times.size:
            self._last = int(times[-1])
        if rotor.outages:
            times = times[~self._silent(rotor, times)]
        return stamps(rotor.clock, times, self._origin)


def edge_times(response: Response, name: str, seed: int = 0) -> TimeArray:
    """Stamps of the edges of one rotor in a response that begins a recording's interval.

    Args:
        response: From `respond`; the recording starts `drive.elapsed` before its first instant.
        name: Name of the rotor.
        seed: Of random losses and bounces.

    Returns:
        [ns], in order of the edges' true times.
    """
    return PulseCircuit(name, _origin(response), seed).edges(passed_slots(response, name))


def rotor_signals(response: Response, name: str, seed: int = 0) -> Pulses:
    """`PulseCircuit.signals` of one rotor in a response that begins a recording's interval."""
    return PulseCircuit(name, _origin(response), seed).signals(passed_slots(response, name))


def expected_signals(response: Response, name: str, bounces: bool = True) -> Pulses:
    """`PulseCircuit.expected` of one rotor in a response that begins a recording's interval."""
    slots = passed_slots(response, name)
    return PulseCircuit(name, _origin(response), 0).expected(slots, bounces)


def signals_and_expected(
    response: Response, name: str, bounces: bool = True, losses: bool = True
) -> tuple[Pulses, Pulses]:
    """`rotor_signals` and `expected_signals`, for hardly more than one of them takes."""
    slots, origin = passed_slots(response, name), _origin(response)
    drawn = PulseCircuit(name, origin, 0).signals(slots)
    return drawn, PulseCircuit(name, origin, 0).expected(slots, bounces, losses)


def _origin(response: Response) -> int:
    return response.drive.start_ns - round(response.drive.elapsed * 1e9)
