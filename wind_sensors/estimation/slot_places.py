"""Where the slots of a pulse disc are, from the errors that a station file states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from wind_sensors.station.model import Rotor

FloatArray = npt.NDArray[np.float64]
TimeArray = npt.NDArray[np.int64]

_TURNS_TO_PLACE = 4
"""After so many turns it is clear which of the recorded edges comes from which slot."""


class SlotPlaces:
    """Displacement of each counted edge by the slot that it comes from."""

    def __init__(self) -> None:
        self._errors: tuple[float, ...] = ()
        self._placed: FloatArray | None = None
        self._times: TimeArray = np.empty(0, dtype=np.int64)
        self._first = 0

    def displaced(self, rotor: Rotor, time: TimeArray, number: FloatArray) -> FloatArray:
        """Displacements [slots]; nought until the slots are known from the edges.

        Args:
            rotor: As it is now.
            time: Edges that follow the last ones [ns], shape (n,).
            number: Slots counted up to each, shape (n,).
        """
        errors = rotor.electronics.slot_errors
        if errors != self._errors:
            self._errors, self._placed = errors, None
            self._times = np.empty(0, dtype=np.int64)
        if not errors or not time.size:
            return np.zeros(time.size)
        if self._placed is None:
            if not self._times.size:
                self._first = round(float(number[0]))
            self._times = np.concatenate((self._times, time))
            enough = _TURNS_TO_PLACE * len(errors)
            if self._times.size < enough:
                return np.zeros(time.size)
            self._placed = slots_in_place(errors, self._times)
        place = np.rint(number).astype(np.int64) - self._first + 1
        return self._placed[np.mod(place, len(errors))]


def slots_in_place(stated: Sequence[float], times: TimeArray) -> FloatArray:
    """Errors of the slots without their mean, turned so that the first recorded edge is slot 1.

    The file counts slots from a mark on the disc, the recording from its first edge: of all turns
    the one stands for which the rotor's rate changes least from edge to edge.

    Args:
        stated: Error of each slot [slots], n of them.
        times: First edges [ns], shape (m,).
    """
    errors: FloatArray = np.asarray(stated, dtype=np.float64) - np.mean(stated)
    if times.size < errors.size + 2:
        return errors
    taken = np.log(np.diff(times).astype(np.float64))
    number = np.arange(1, times.size)
    best, least = errors, np.inf
    for turn in range(errors.size):
        turned = np.roll(errors, turn)
        width = 1.0 + turned[(number + 1) % errors.size] - turned[number % errors.size]
        change = float(np.sum(np.square(np.diff(taken - np.log(width)))))
        if change < least:
            best, least = turned, change
    return best
