"""Signals as messages that arrive: late, lost, doubled, out of order, with a clock that jumps.

Transport never changes what was measured, only what reaches the receiver and when. Each decision
belongs to the message's source and number, so that a live stream and an offline run suffer alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from wind_sensors.simulation import random_numbers
from wind_sensors.simulation.blocks import SignalBlock
from wind_sensors.simulation.run import SignalStream
from wind_sensors.simulation.scenario import TransportFaults
from wind_sensors.station.model import Rotor
from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    TimeArray,
    Winds,
)

FloatArray = npt.NDArray[np.float64]


class Event(NamedTuple):
    """A message that arrives.

    Attributes:
        arrival: When, on the receiver's clock [ns].
        source: `pulses/<rotor>`, `angles/<vane>` (`angles/<bivane>/elevation`), `reference`,
            `platform`, `temperature`, `pressure`, `truth`.
        stamp: The message's time stamp [ns].
        values: Nothing for an edge, revolutions where the source tells a shaft's angle; a vane's
            angle [rad]; wind east, north, up [m/s]; attitude (x, y, z, w), velocity, angular rate
            and position of the platform; a temperature [deg C] or pressure [Pa].
        number: Running number of the message from its source, from 0; one less than what a pulse
            counter shows, wrapped where the faults say so.
    """

    arrival: int
    source: str
    stamp: int
    values: tuple[float, ...]
    number: int


class Transport:
    """The way from the sensors to a receiver.

    Args:
        faults: What happens on it.
        start: Start of the recording [ns].
    """

    def __init__(self, faults: TransportFaults, start: int) -> None:
        self._faults = faults
        self._start = start
        self._sent: dict[str, int] = {}
        self._under_way: list[Event] = []

    def events(self, block: SignalBlock, closed: int | None = None) -> list[Event]:
        """Messages that arrive, in order of arrival.

        Args:
            block: Signals that follow those of the last call.
            closed: Time before which no further signal will be stamped [ns]; messages that arrive
                later wait for the next call. None: nothing follows, all arrive.
        """
        for source, stamps, values in _sources(block):
            self._under_way += self._sent_from(source, stamps, values)
        self._under_way.sort(key=lambda event: (event.arrival, event.source, event.number))
        if closed is None:
            arrived, self._under_way = self._under_way, []
            return arrived
        limit = closed + round(self._faults.delay * 1e9)
        position = 0
        while position < len(self._under_way) and self._under_way[position].arrival < limit:
            position += 1
        arrived = self._under_way[:position]
        self._under_way = self._under_way[position:]
        return arrived

    def _draw(self, source: str, fault: str, numbers: npt.NDArray[np.int64]) -> FloatArray:
        return random_numbers.uniform(self._faults.seed, f"transport/{source}/{fault}", numbers)

    def _sent_from(self, source: str, stamps: TimeArray, values: FloatArray) -> list[Event]:
        # The truth is nobody's message: it stays whole, so that results can be judged by it.
        faults = self._faults if source != "truth" else TransportFaults(delay=self._faults.delay)
        first = self._sent.get(source, 0)
        numbers = first + np.arange(stamps.size, dtype=np.int64)
        self._sent[source] = first + int(stamps.size)
        arrival = stamps + round(faults.delay * 1e9)
        if faults.jitter > 0.0:
            arrival = arrival + _nanoseconds(faults.jitter * self._draw(source, "jitter", numbers))
        if faults.holding > 0.0:
            held = self._draw(source, "holding", numbers) < faults.holding
            arrival = arrival + held * round(faults.holding_time * 1e9)
        if faults.not_a_number > 0.0 and source.startswith("angles/"):
            broken = self._draw(source, "nan", numbers) < faults.not_a_number
            values = np.where(broken[:, np.newaxis], np.nan, values)
        copies = np.ones(stamps.size, dtype=np.int64)
        if faults.doubling > 0.0:
            copies += self._draw(source, "doubling", numbers) < faults.doubling
        if faults.loss > 0.0:
            copies[self._draw(source, "loss", numbers) < faults.loss] = 0
        shown = stamps
        if faults.clock_jump_at is not None:
            jumped = stamps >= self._start + round(faults.clock_jump_at * 1e9)
            shown = stamps + jumped * round(faults.clock_jump * 1e9)
        counts = numbers
        if faults.counter_modulus is not None:
            counts = numbers % faults.counter_modulus
        kept = np.repeat(np.arange(stamps.size), copies)
        columns = zip(
            arrival[kept].tolist(), shown[kept].tolist(), values[kept].tolist(),
            counts[kept].tolist(), strict=True,
        )
        return [Event(a, source, s, tuple(v), c) for a, s, v, c in columns]


def _nanoseconds(seconds: FloatArray) -> TimeArray:
    return np.rint(seconds * 1e9).astype(np.int64)


def _platform_values(states: PlatformStates) -> FloatArray:
    return np.hstack((states.attitude, states.velocity, states.angular_rate, states.position))


def _sources(block: SignalBlock) -> Iterator[tuple[str, TimeArray, FloatArray]]:
    for name, pulses in block.pulses.items():
        told = np.empty((pulses.time.size, 0))
        if pulses.turns is not None:
            told = pulses.turns[:, np.newaxis]
        yield f"pulses/{name}", pulses.time, told
    for name, angles in block.angles.items():
        yield f"angles/{name}", angles.time, angles.angle[:, np.newaxis]
    if block.reference is not None:
        yield "reference", block.reference.time, block.reference.velocity
    if block.platform is not None:
        yield "platform", block.platform.time, _platform_values(block.platform)
    if block.temperature is not None:
        yield "temperature", block.temperature.time, block.temperature.value[:, np.newaxis]
    if block.pressure is not None:
        yield "pressure", block.pressure.time, block.pressure.value[:, np.newaxis]
    if block.truth is not None:
        yield "truth", block.truth.time, block.truth.velocity


def live_events(stream: SignalStream, step: float = 1.0) -> Iterator[Event]:
    """Messages of an endless stream in order of arrival, with the scenario's faults.

    Args:
        stream: The signals.
        step: How much is computed ahead at a time [s].
    """
    transport = Transport(stream.scenario.faults, stream.start)
    until = stream.start
    while True:
        until += round(step * 1e9)
        yield from transport.events(stream.read(until), closed=until)


def events_of(recording: Recording, faults: TransportFaults | None = None) -> list[Event]:
    """All messages of a recording in order of arrival, with faults on the way.

    Args:
        recording: Signals; its truth must be there or the list has none.
        faults: What happens on the way; None: nothing.
    """
    block = SignalBlock(
        start=recording.start,
        stop=recording.stop,
        pulses=recording.pulses,
        angles=recording.angles,
        reference=recording.reference,
        platform=recording.platform,
        temperature=recording.temperature,
        pressure=recording.pressure,
        truth=recording.truth,
    )
    return Transport(faults or TransportFaults(), recording.start).events(block)


def received(recording: Recording, faults: TransportFaults) -> Recording:
    """The recording that a logger behind a faulty transport would have made.

    Signals stand in the order of their arrival. Rotors with a counter keep the count of the edges
    that the sensor saw.
    """
    by_source: dict[str, list[Event]] = {}
    for event in events_of(recording, faults):
        by_source.setdefault(event.source, []).append(event)

    def columns(source: str, width: int) -> tuple[TimeArray, FloatArray]:
        events = by_source.get(source, [])
        values = np.array([e.values for e in events], dtype=np.float64).reshape(-1, width)
        return _stamps_of(events), values

    def winds(source: str, original: Winds | None) -> Winds | None:
        return None if original is None else Winds(*columns(source, 3))

    def series(source: str, original: Series | None) -> Series | None:
        if original is None:
            return None
        time, values = columns(source, 1)
        return Series(time, values[:, 0])

    pulses = {}
    for name in recording.pulses:
        events = by_source.get(f"pulses/{name}", [])
        rotor = recording.station.instrument(name)
        turns = None
        if recording.pulses[name].turns is not None:
            turns = columns(f"pulses/{name}", 1)[1][:, 0]
        elif isinstance(rotor, Rotor) and rotor.pulses.meaning == "count":
            numbers = np.array([e.number for e in events], dtype=np.float64)
            turns = (numbers + 1.0) / rotor.pulses_per_revolution
        pulses[name] = Pulses(_stamps_of(events), turns)
    angles = {}
    for name in recording.angles:
        time, values = columns(f"angles/{name}", 1)
        angles[name] = Angles(time, values[:, 0])
    platform = None
    if recording.platform is not None:
        time, values = columns("platform", 13)
        platform = PlatformStates(
            time, values[:, :4], values[:, 4:7], values[:, 7:10], values[:, 10:]
        )
    return replace(
        recording,
        pulses=pulses,
        angles=angles,
        reference=winds("reference", recording.reference),
        platform=platform,
        temperature=series("temperature", recording.temperature),
        pressure=series("pressure", recording.pressure),
        truth=winds("truth", recording.truth),
    )


def _stamps_of(events: Sequence[Event]) -> TimeArray:
    return np.array([event.stamp for event in events], dtype=np.int64)
