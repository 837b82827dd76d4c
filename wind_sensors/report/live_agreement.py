"""Live messages against the offline results of their own recording, bit by bit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wind_sensors.estimation.outputs import ProcessedRecording
from wind_sensors.recordings.bag import BagContent, read_bag
from wind_sensors.recordings.estimate_topics import DIAGNOSTICS
from wind_sensors.recordings.fields import columns, stamps
from wind_sensors.recordings.reading import BAG_FOLDER
from wind_sensors.station.inputs import FieldPath
from wind_sensors.station.signals import FloatArray, TimeArray

_VECTOR: list[FieldPath] = [("twist", "twist", "linear", axis) for axis in "xyz"]
_COVARIANCE: list[FieldPath] = [
    ("twist", "covariance", 6 * row + column) for row in range(3) for column in range(3)
]


@dataclass(frozen=True)
class Agreement:
    """Live messages against offline results.

    Attributes:
        compared: Live estimates, each compared with the offline one of its time.
        lost: Estimates that were due and of which no live message was recorded.
        only_offline: Estimates that were not final when the live run ended.
        largest_difference: Of any component of velocity or covariance; 0 means to the last bit,
            infinite that a live estimate has no offline one.
        windows_compared: Averaging windows, live.
        windows_lost: Averaging windows that were due and were not recorded.
        largest_window_difference: Of their vector means [m/s] and those means' covariances.
        restarts: How often the live estimates step back in time.
        unheard: Raw messages that were recorded but did not reach the live estimator.
        late: Raw messages that reached it too late to be used.
    """

    compared: int
    lost: int
    only_offline: int
    largest_difference: float
    windows_compared: int
    windows_lost: int
    largest_window_difference: float
    restarts: int = 0
    unheard: int = 0
    late: int = 0

    @property
    def is_exact(self) -> bool:
        """Not one bit differs in what arrived."""
        return self.largest_difference == 0.0 and self.largest_window_difference == 0.0

    @property
    def is_complete(self) -> bool:
        """Nothing is missing that was due."""
        return not self.lost and not self.windows_lost


def live_agreement(folder: Path, offline: ProcessedRecording, due: int) -> Agreement:
    """The `wind` and `wind/mean` messages of a live recording against offline results.

    Args:
        folder: The live recording.
        offline: What the same estimator makes of its signals.
        due: Time until which estimates and windows must have come live [ns]; those after it may
            not have been final when the run ended.
    """
    bag = read_bag(folder / BAG_FOLDER)
    flat = offline.covariance.reshape(len(offline.time), 9)
    values = np.hstack((offline.velocity, flat))
    live_time, live = _twists(bag, "/wind")
    stops = np.array([window.stop for window in offline.windows], dtype=np.int64)
    means = np.array(
        [np.append(w.vector_mean, w.vector_mean_covariance.ravel()) for w in offline.windows]
    )
    mean_time, mean = _twists(bag, "/wind/mean")
    without_partner = offline.time[~np.isin(offline.time, live_time)]
    lost = int(np.count_nonzero(without_partner <= due))
    received, late = _heard(bag)
    recorded = sum(bag.topics[topic].count for topic in received if topic in bag.topics)
    return Agreement(
        compared=len(live_time),
        lost=lost,
        only_offline=len(without_partner) - lost,
        largest_difference=_difference(live_time, live, offline.time, values),
        windows_compared=len(mean_time),
        windows_lost=int(np.count_nonzero(~np.isin(stops, mean_time) & (stops <= due))),
        largest_window_difference=_difference(mean_time, mean, stops, means),
        restarts=int(np.count_nonzero(np.diff(live_time) < 0)),
        unheard=max(recorded - sum(received.values()), 0) if received else 0,
        late=late,
    )


def shortfalls(agreement: Agreement, rate: float) -> list[str]:
    """What the live run owes, in sentences for people; empty if nothing.

    Args:
        agreement: From `live_agreement`.
        rate: The speed that was asked for, in times real time.
    """
    found = []
    if not agreement.is_complete:
        found.append(
            f"{agreement.lost} of {agreement.lost + agreement.compared} live estimates and "
            f"{agreement.windows_lost} of {agreement.windows_lost + agreement.windows_compared} "
            "window means did not arrive: the live nodes stopped answering for a minute, or this "
            "machine dropped their messages. Live and offline were compared in what arrived."
        )
    if not agreement.is_exact and agreement.compared:
        found.append(f"Live and offline differ{_reason(agreement)}.")
    if found:
        found.append(
            "Run it again when the machine is less busy, or slower: "
            f"wind demo --rate {max(rate / 4.0, 1.0):g}"
        )
    return found


def _reason(agreement: Agreement) -> str:
    """What the live estimator missed, as the end of a sentence."""
    reasons = [
        f"{number} {what}"
        for number, what in (
            (agreement.unheard, "raw messages never reached the live estimator"),
            (agreement.late, "reached it too late to be used"),
            (agreement.restarts, "restarts after late messages, taken for a clock that jumps back"),
        )
        if number
    ]
    return f": {', '.join(reasons)}" if reasons else ", although it had the same messages"


def _twists(bag: BagContent, topic: str) -> tuple[TimeArray, FloatArray]:
    """Stamps [ns] (n,) and velocity with covariance (n, 12) of a topic; n = 0 if it is absent."""
    data = bag.topics.get(topic)
    if data is None or not data.raw:
        return np.empty(0, dtype=np.int64), np.empty((0, 12))
    time = stamps(data.raw, bag.types, data.message_type, ("header", "stamp"))
    values = columns(data.raw, bag.types, data.message_type, [*_VECTOR, *_COVARIANCE])
    return time, np.stack(values, axis=1)


def _heard(bag: BagContent) -> tuple[dict[str, int], int]:
    """Raw messages by topic and late ones, as the live estimator told last on /diagnostics."""
    received: dict[str, int] = {}
    late: dict[str, int] = {}
    data = bag.topics.get("/diagnostics")
    for raw in data.raw if data is not None else []:
        array: Any = bag.types.deserialize_cdr(raw, DIAGNOSTICS)
        for status in array.status:
            values = {pair.key: pair.value for pair in status.values}
            _, _, name = status.name.partition(": ")
            if name.startswith("topic ") and "received" in values:
                received[name.removeprefix("topic ")] = int(values["received"])
            if "late" in values:
                late[name] = int(values["late"])
    return received, sum(late.values())


def _difference(
    live_time: TimeArray, live: FloatArray, time: TimeArray, values: FloatArray
) -> float:
    """Largest difference of live messages; inf without any, or where a stamp has no partner."""
    places = np.searchsorted(time, live_time)
    paired = places < len(time)
    if not len(live_time) or not paired.all() or (time[places] != live_time).any():
        return float("inf")
    return float(np.max(np.abs(live - values[places])))
