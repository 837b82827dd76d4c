"""A recording through the watch, in the order of its stamps, as it would have come live."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from wind_sensors.diagnosis.watch.watching import Watch
from wind_sensors.station.signals import FloatArray, Recording, TimeArray

Feed = Callable[[int, int], None]


def _pulses(watch: Watch, name: str, turns: FloatArray | None) -> Feed:
    def feed(i: int, time: int) -> None:
        watch.add_pulse(name, time, None if turns is None else float(turns[i]))

    return feed


def _angles(watch: Watch, name: str, angle: FloatArray) -> Feed:
    return lambda i, time: watch.add_angle(name, time, float(angle[i]))


def _sources(recording: Recording, watch: Watch) -> Iterator[tuple[TimeArray, Feed]]:
    """Stamps of each signal and what to do with its i-th sample."""
    for name, p in recording.pulses.items():
        yield p.time, _pulses(watch, name, p.turns)
    for name, a in recording.angles.items():
        yield a.time, _angles(watch, name, a.angle)
    wind, states, moved = recording.reference, recording.platform, recording.platform_velocity
    if wind is not None:
        yield wind.time, lambda i, t: watch.add_wind(t, wind.velocity[i])
    if states is not None:
        yield states.time, lambda i, t: watch.add_platform(
            t, states.attitude[i], None if moved is not None else states.velocity[i],
            states.angular_rate[i], states.position[i]
        )
    if moved is not None:
        yield moved.time, lambda i, t: watch.add_platform_velocity(t, moved.velocity[i])
    warmth, weight = recording.temperature, recording.pressure
    if warmth is not None:
        yield warmth.time, lambda i, t: watch.add_air(t, temperature=float(warmth.value[i]))
    if weight is not None:
        yield weight.time, lambda i, t: watch.add_air(t, pressure=float(weight.value[i]))


def replay(recording: Recording, watch: Watch) -> None:
    """Feed all signals of a recording, by their stamps."""
    sources = list(_sources(recording, watch))
    times = np.concatenate([time for time, _ in sources])
    which = np.concatenate([np.full(time.size, k) for k, (time, _) in enumerate(sources)])
    index = np.concatenate([np.arange(time.size) for time, _ in sources])
    order = np.argsort(times, kind="stable")
    stamps, numbers, places = times[order].tolist(), which[order].tolist(), index[order].tolist()
    for time, k, i in zip(stamps, numbers, places, strict=True):
        sources[k][1](i, time)
