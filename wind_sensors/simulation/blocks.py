"""Signals of a stretch of time, joined and split without changing a number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from wind_sensors.station.signals import Angles, PlatformStates, Pulses, Series, Winds

_Signal = TypeVar("_Signal", Pulses, Angles, Winds, PlatformStates, Series)


@dataclass(frozen=True)
class SignalBlock:
    """Signals measured between two times; stamps may lie a clock error outside.

    Attributes:
        start, stop: First and past-the-last time of measurement [ns].
        pulses, angles, reference, platform, temperature, pressure, truth: As in `Recording`.
    """

    start: int
    stop: int
    pulses: dict[str, Pulses]
    angles: dict[str, Angles]
    reference: Winds | None
    platform: PlatformStates | None
    temperature: Series | None
    pressure: Series | None
    truth: Winds | None


def _together(parts: Sequence[_Signal]) -> _Signal:
    first = parts[0]
    if len(parts) == 1:
        return first
    arrays = {
        f.name: np.concatenate([getattr(p, f.name) for p in parts])
        for f in fields(first)
        if getattr(first, f.name) is not None
    }
    return type(first)(**arrays)


def _perhaps_together(parts: Sequence[_Signal | None]) -> _Signal | None:
    present = [p for p in parts if p is not None]
    return _together(present) if present else None


def joined(blocks: Sequence[SignalBlock]) -> SignalBlock:
    """Consecutive blocks as one."""
    return SignalBlock(
        start=blocks[0].start,
        stop=blocks[-1].stop,
        pulses={n: _together([b.pulses[n] for b in blocks]) for n in blocks[0].pulses},
        angles={n: _together([b.angles[n] for b in blocks]) for n in blocks[0].angles},
        reference=_perhaps_together([b.reference for b in blocks]),
        platform=_perhaps_together([b.platform for b in blocks]),
        temperature=_perhaps_together([b.temperature for b in blocks]),
        pressure=_perhaps_together([b.pressure for b in blocks]),
        truth=_perhaps_together([b.truth for b in blocks]),
    )


def _parted(signal: _Signal, time: int) -> tuple[_Signal, _Signal]:
    early = signal.time < time
    halves = []
    for chosen in (early, ~early):
        arrays = {
            f.name: getattr(signal, f.name)[chosen]
            for f in fields(signal)
            if getattr(signal, f.name) is not None
        }
        halves.append(type(signal)(**arrays))
    return halves[0], halves[1]


def _perhaps_parted(signal: _Signal | None, time: int) -> tuple[_Signal | None, _Signal | None]:
    return (None, None) if signal is None else _parted(signal, time)


def split(block: SignalBlock, time: int) -> tuple[SignalBlock, SignalBlock]:
    """What is stamped before a time [ns], and the rest."""
    pulses = {n: _parted(s, time) for n, s in block.pulses.items()}
    angles = {n: _parted(s, time) for n, s in block.angles.items()}
    reference = _perhaps_parted(block.reference, time)
    platform = _perhaps_parted(block.platform, time)
    temperature = _perhaps_parted(block.temperature, time)
    pressure = _perhaps_parted(block.pressure, time)
    truth = _perhaps_parted(block.truth, time)
    middle = min(max(time, block.start), block.stop)
    early, late = (
        SignalBlock(
            start=(block.start, middle)[k],
            stop=(middle, block.stop)[k],
            pulses={n: s[k] for n, s in pulses.items()},
            angles={n: s[k] for n, s in angles.items()},
            reference=reference[k],
            platform=platform[k],
            temperature=temperature[k],
            pressure=pressure[k],
            truth=truth[k],
        )
        for k in (0, 1)
    )
    return early, late
