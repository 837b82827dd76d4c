"""Instruments of a station that say nothing in a whole recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wind_sensors.station.inputs import angle_inputs
from wind_sensors.station.model import Angle, Rotor, Station
from wind_sensors.station.signals import Angles, Recording

FEWEST_READINGS = 16
"""With fewer readings in a whole recording a vane says nothing: no spectrum can be taken."""


@dataclass(frozen=True)
class Silent:
    """An instrument without anything usable in a recording.

    Attributes:
        instrument: Its name.
        topic: On which its signal should have come.
        signal: What is missing: `pulses` or `readings`.
    """

    instrument: str
    topic: str
    signal: str

    @property
    def words(self) -> str:
        """For people, with what to do."""
        return (
            f"{self.instrument}: no {self.signal} at all on {self.topic}, so nothing can be said "
            "of it: look at its cable, its driver, the topic"
        )


def told_first(silent: Sequence[Silent], words: str) -> str:
    """What is said of instruments that say nothing, and then of the others, for people.

    Args:
        silent: The former; may be none.
        words: Of the latter; may be empty.
    """
    return "; ".join(part for part in (*(each.words for each in silent), words) if part)


def tells(readings: Angles | None) -> bool:
    """Whether a vane has readings enough that are numbers."""
    if readings is None:
        return False
    return int(np.count_nonzero(np.isfinite(readings.angle))) >= FEWEST_READINGS


def silent_instruments(recording: Recording, station: Station) -> tuple[Silent, ...]:
    """Instruments of a station that say nothing in a recording, in the station's order.

    Args:
        recording: The signals.
        station: Whose instruments should have spoken.
    """
    found = []
    for entry in station.instruments:
        if isinstance(entry, Rotor):
            # A counter that stands still speaks; whether the rotor should turn the wind tells.
            if entry.name not in recording.pulses:
                found.append(Silent(entry.name, entry.pulses.topic, "pulses"))
        elif isinstance(entry, Angle) and not tells(recording.angles.get(entry.name)):
            topic = angle_inputs(entry)[entry.name].topic
            found.append(Silent(entry.name, topic, "readings"))
    return tuple(found)
