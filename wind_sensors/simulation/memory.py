"""Results that need not be computed twice: flows and movements of instruments in one drive.

Stations that are tried one after the other differ in little. What the difference does not reach
(the wind at another instrument, the turning of a rotor whose logger is in question) is taken from
here, to the bit as if it had been computed again.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

from wind_sensors.simulation.drive import Drive

_Result = TypeVar("_Result")

FLOWS = 8
MOVEMENTS = 16
"""How many are kept: those of the station tried last, and of some before."""


class Memory:
    """The results used last, by what they depend on.

    Args:
        most: How many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._results: OrderedDict[Hashable, Any] = OrderedDict()

    def of(self, key: Hashable, compute: Callable[[], _Result]) -> _Result:
        """The result of a key, computed if it is not known. It must not be changed."""
        if key in self._results:
            self._results.move_to_end(key)
        else:
            self._results[key] = compute()
            if len(self._results) > self._most:
                self._results.popitem(last=False)
        found: _Result = self._results[key]
        return found


class DriveMemory:
    """What instruments did in one drive.

    Args:
        drive: The drive.
    """

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self.flows = Memory(FLOWS)
        self.movements = Memory(MOVEMENTS)
