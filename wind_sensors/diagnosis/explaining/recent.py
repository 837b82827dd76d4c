"""Results that are asked for more than once, by the very objects that they depend on."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

_Result = TypeVar("_Result")


class Recent(Generic[_Result]):
    """The last results of a computation on objects that are never changed.

    Arrays have no hash, and comparing them would take longer than it saves: an equal object is
    another one.

    Args:
        most: How many are kept.
    """

    def __init__(self, most: int) -> None:
        self._kept: deque[tuple[tuple[object, ...], Hashable, _Result]] = deque(maxlen=most)

    def find(self, objects: tuple[object, ...], how: Hashable = None) -> _Result | None:
        """The result for these objects; None: it is not kept.

        Args:
            objects: What it depends on.
            how: What else it depends on, compared by value.
        """
        for known, manner, result in self._kept:
            if manner == how and all(a is b for a, b in zip(known, objects, strict=True)):
                return result
        return None

    def keep(self, objects: tuple[object, ...], result: _Result, how: Hashable = None) -> None:
        """Keep a result, and let go the oldest if there are too many."""
        self._kept.append((objects, how, result))

    def of(self, objects: tuple[object, ...], compute: Callable[[], _Result]) -> _Result:
        """The result for these objects, computed if it is not kept."""
        found = self.find(objects)
        if found is None:
            found = compute()
            self.keep(objects, found)
        return found
