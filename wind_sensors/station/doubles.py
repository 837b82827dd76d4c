"""Messages that came twice: a stamp counts once."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from wind_sensors.station.signals import (
    Angles,
    PlatformStates,
    Pulses,
    Recording,
    Series,
    TimeArray,
    Velocities,
    Winds,
)

Signal = TypeVar("Signal", Pulses, Angles, Winds, Series, PlatformStates, Velocities)


def without_doubles(recording: Recording) -> Recording:
    """A recording in which no signal has a stamp twice.

    A bridge or a second recorder that delivers every message twice makes no second edge and no
    second reading, and intervals of nought between them mean nothing. The first of them stays, in
    the order of arrival. The notes tell of them already.
    """
    return replace(
        recording,
        pulses={name: _once(pulses) for name, pulses in recording.pulses.items()},
        angles={name: _once(angles) for name, angles in recording.angles.items()},
        reference=None if recording.reference is None else _once(recording.reference),
        platform=None if recording.platform is None else _once(recording.platform),
        platform_velocity=(
            None if recording.platform_velocity is None else _once(recording.platform_velocity)
        ),
        temperature=None if recording.temperature is None else _once(recording.temperature),
        pressure=None if recording.pressure is None else _once(recording.pressure),
    )


def _once(signal: Signal) -> Signal:
    """The signal without what has the stamp of something before it; itself if there is none."""
    kept = _first(signal.time)
    if kept is None:
        return signal
    columns = {f.name: getattr(signal, f.name) for f in fields(signal)}
    chosen: dict[str, Any] = {n: v if v is None else v[kept] for n, v in columns.items()}
    return replace(signal, **chosen)


def _first(time: TimeArray) -> TimeArray | None:
    """Indices of stamps that come for the first time; None: all do."""
    if bool(np.all(time[1:] > time[:-1])):
        return None
    first = np.unique(time, return_index=True)[1]
    return None if first.size == time.size else np.sort(first)
