"""A block of made-up signals: the monitor's kernels are compiled before real ones arrive."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from wind_sensors.compiled import is_kept
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import by_slot
from wind_sensors.diagnosis.watch import Watch, WatchSettings
from wind_sensors.nodes.rehearsal import SPEED, START, STEP, made_up_signals
from wind_sensors.station.model import Station

_SHORTEST_BLOCK = 60.0
_GUSTS = 0.1
_PERIOD = 7.3
"""Of the gusts [s]."""
_LONGEST_ESTIMATE = 6.0
"""So long after a block the watch's own estimator has told all of its wind [s]."""


def watch_must_compile() -> bool:
    """Whether the first block waits for about a minute, as once after an installation."""
    return not is_kept(by_slot)


def warm_up_watch(station: Station, settings: WatchSettings) -> bool:
    """Run a throwaway watch through its first block.

    Args:
        station: As the real watch's.
        settings: As the real watch's.

    Returns:
        Whether a block was compared.

    Raises:
        UserError: The settings do not fit the station.
    """
    shortest = replace(settings, block=_SHORTEST_BLOCK, wait=0.0)
    watch = Watch(station, shortest)
    seconds = shortest.lead_in + shortest.block + _LONGEST_ESTIMATE
    calls = made_up_signals(station, watch, seconds)
    blow = partial(_blow, watch)
    calls += [(START + k * STEP, blow) for k in range(round(seconds * 1e9) // STEP)]
    for time, call in sorted(calls, key=lambda item: item[0]):
        call(time)
        if watch.blocks or watch.skipped:
            break
    return watch.blocks > 0


def _blow(watch: Watch, time: int) -> None:
    # A reference that repeats itself is not compared with.
    gust = 1.0 + _GUSTS * math.sin(2.0 * math.pi * time * 1e-9 / _PERIOD)
    watch.add_wind(time, np.array([-SPEED * gust, 0.0, 0.0]))
