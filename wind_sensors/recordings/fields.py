"""Numeric fields of many serialised messages at once.

A message in CDR has its field at a place that depends only on the lengths of the strings and
sequences before it. The definition is walked once for the first message; every message in which
the same length words stand at the same places has the field at the same place, so that one strided
view reads them all. Messages that differ start a new group.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from wind_sensors.errors import UserError
from wind_sensors.station.inputs import LATEST, FieldPath
from wind_sensors.station.signals import FloatArray, TimeArray

_CODES = {
    "bool": "u1", "byte": "u1", "char": "u1", "octet": "u1", "int8": "i1", "uint8": "u1",
    "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4",
    "int64": "i8", "uint64": "u8", "float64": "f8",
}
_ENCAPSULATION = 4
"""Bytes before the first field; the second one tells the byte order."""


class _FieldAbsent(Exception):
    """The message ends before the field, or its array is shorter than the index."""


class Place(NamedTuple):
    """Where a field lies: byte offset, NumPy type code, number of items of an array."""

    offset: int
    code: str
    items: int


@dataclass
class _Walk:
    """A message while its definition is followed.

    Attributes:
        lengths: Place and value of every length word met so far.
    """

    types: Typestore
    data: bytes
    order: str
    position: int = _ENCAPSULATION
    lengths: list[tuple[int, int]] = field(default_factory=list)

    def find(self, node: Any, path: FieldPath) -> Place:
        """Place of the field at `path` below `node`, which starts at the position."""
        kind, detail = node
        if kind == Nodetype.BASE:
            code = _CODES[detail[0]]
            self._align(code)
            return Place(self.position, code, 1)
        if kind == Nodetype.NAME:
            for name, child in self.types.fielddefs[detail][1]:
                if name == path[0]:
                    return self.find(child, path[1:])
                self.skip(child)
            raise _FieldAbsent
        child, size = detail
        count = size if kind == Nodetype.ARRAY else self.length()
        if not path:
            code = _CODES[child[1][0]]
            if count:
                self._align(code)
            return Place(self.position, code, count)
        index = int(path[0])
        if index >= count:
            raise _FieldAbsent
        self._skip_items(child, index)
        return self.find(child, path[1:])

    def _align(self, code: str) -> None:
        size = int(code[1])
        self.position += -(self.position - _ENCAPSULATION) % size

    def length(self) -> int:
        """The length word at the position, which moves behind it."""
        self._align("u4")
        try:
            (value,) = struct.unpack_from(f"{self.order}I", self.data, self.position)
        except struct.error:
            raise _FieldAbsent from None
        self.lengths.append((self.position, value))
        self.position += 4
        return int(value)

    def skip(self, node: Any) -> None:
        """Move behind what stands at the position."""
        kind, detail = node
        if kind == Nodetype.BASE:
            if detail[0] in {"string", "wstring"}:
                size = self.length()
                self.position += size
            else:
                self._align(_CODES[detail[0]])
                self.position += int(_CODES[detail[0]][1])
        elif kind == Nodetype.NAME:
            for _, child in self.types.fielddefs[detail][1]:
                self.skip(child)
        else:
            child, size = detail
            self._skip_items(child, size if kind == Nodetype.ARRAY else self.length())

    def _skip_items(self, node: Any, count: int) -> None:
        kind, detail = node
        if kind == Nodetype.BASE and detail[0] in _CODES:
            code = _CODES[detail[0]]
            if count:
                self._align(code)
            self.position += int(code[1]) * count
            return
        for _ in range(min(count, len(self.data))):
            self.skip(node)


def leaf(types: Typestore, message_type: str, path: FieldPath) -> str:
    """What stands at a path: the name of a primitive or message type, `[]` behind for an array.

    Raises:
        UserError: The type is unknown or has no such field.
    """
    if message_type not in types.fielddefs:
        raise UserError(
            f"The message type '{message_type}' is unknown.",
            remedy="Write `package/msg/Name` as in `ros2 topic info`.",
        )
    node: Any = (Nodetype.NAME, message_type)
    for step in path:
        kind, detail = node
        if isinstance(step, int) and kind in {Nodetype.ARRAY, Nodetype.SEQUENCE}:
            node = detail[0]
            continue
        fields = dict(types.fielddefs[detail][1]) if kind == Nodetype.NAME else {}
        if step not in fields:
            shown = ".".join(str(s) for s in path)
            names = ", ".join(str(name) for name in fields) or "none"
            raise UserError(
                f"{message_type} has no field '{shown}' (nothing called '{step}').",
                remedy=f"Fields there: {names}.",
            )
        node = fields[step]
    kind, detail = node
    if kind == Nodetype.BASE:
        return str(detail[0])
    if kind == Nodetype.NAME:
        return str(detail)
    return f"{detail[0][1][0] if detail[0][0] == Nodetype.BASE else detail[0][1]}[]"


def place_of(data: bytes, types: Typestore, message_type: str, path: FieldPath) -> Place | None:
    """Where a field lies in one serialised message; None where the message has no such field."""
    try:
        return _Walk(types, data, _order(data)).find((Nodetype.NAME, message_type), path)
    except _FieldAbsent:
        return None


def columns(
    raw: Sequence[bytes], types: Typestore, message_type: str, paths: Sequence[FieldPath]
) -> list[FloatArray]:
    """Numeric fields of all the messages.

    Args:
        raw: Serialised messages of one type.
        types: Definitions.
        message_type: Their type.
        paths: Fields, each leading to a number.

    Returns:
        One array of shape (n,) for each path; NaN where a message has no such field.
    """
    out = [np.full(len(raw), np.nan) for _ in paths]
    for members, matrix in _by_size(raw):
        for column, path in zip(out, paths, strict=True):
            _fill(column, members, matrix, types, message_type, path)
    return out


def stamps(
    raw: Sequence[bytes], types: Typestore, message_type: str, path: FieldPath
) -> TimeArray:
    """A `builtin_interfaces/Time` field of all the messages [ns], shape (n,); 0 where absent."""
    seconds, nanoseconds = columns(
        raw, types, message_type, [(*path, "sec"), (*path, "nanosec")]
    )
    present = np.isfinite(seconds) & np.isfinite(nanoseconds)
    whole = np.where(present, seconds, 0.0).astype(np.int64)
    return whole * 1_000_000_000 + np.where(present, nanoseconds, 0.0).astype(np.int64)


def batches(
    raw: Sequence[bytes], types: Typestore, message_type: str, path: FieldPath
) -> tuple[list[TimeArray], int]:
    """An array field of times of every message, e.g. edges in an Int64MultiArray [ns].

    Returns:
        The times, message by message, and how many elements were left out because they are no
        times: not a number, infinite, or beyond what 64 bits hold.
    """
    found: list[TimeArray] = []
    lost = 0
    for data in raw:
        order = _order(data)
        walk = _Walk(types, data, order)
        try:
            place = walk.find((Nodetype.NAME, message_type), path)
            items = np.frombuffer(
                data, np.dtype(order + place.code), count=place.items, offset=place.offset
            )
        except (_FieldAbsent, ValueError):
            items = np.empty(0)
        if items.dtype.kind == "f":
            times = items[np.abs(items) < LATEST]
            lost += len(items) - len(times)
            items = times
        found.append(items.astype(np.int64))
    return found, lost


def texts(data: bytes, types: Typestore, message_type: str, field_name: str) -> list[str]:
    """The strings of one message's array of strings; none where the message ends before it."""
    if len(data) <= _ENCAPSULATION:
        return []
    walk = _Walk(types, data, _order(data))
    found = []
    try:
        for name, node in types.fielddefs[message_type][1]:
            if name == field_name:
                break
            walk.skip(node)
        for _ in range(walk.length()):
            size = walk.length()
            text = data[walk.position : walk.position + size]
            found.append(text.rstrip(b"\0").decode("utf-8", "replace"))
            walk.position += size
    except _FieldAbsent:
        return []
    return found


def _order(data: bytes) -> str:
    return "<" if data[1] & 1 else ">"


def _by_size(raw: Sequence[bytes]) -> list[tuple[npt.NDArray[np.int64], npt.NDArray[np.uint8]]]:
    """Messages of equal size and byte order as rows of a matrix, with their indices."""
    groups: dict[tuple[int, bytes], list[int]] = defaultdict(list)
    for index, data in enumerate(raw):
        groups[len(data), data[1:2]].append(index)
    found = []
    for (size, _), members in groups.items():
        if size <= _ENCAPSULATION:
            continue
        joined = b"".join([raw[index] for index in members])
        matrix = np.frombuffer(joined, np.uint8).reshape(len(members), size)
        found.append((np.asarray(members, dtype=np.int64), matrix))
    return found


def _fill(
    column: FloatArray,
    members: npt.NDArray[np.int64],
    matrix: npt.NDArray[np.uint8],
    types: Typestore,
    message_type: str,
    path: FieldPath,
) -> None:
    """Write the field of the messages in `matrix` into `column`, layout by layout."""
    while len(members):
        first = matrix[0].tobytes()
        walk = _Walk(types, first, _order(first))
        try:
            place: Place | None = walk.find((Nodetype.NAME, message_type), path)
        except _FieldAbsent:
            place = None
        same = np.ones(len(members), dtype=bool)
        for position, value in walk.lengths:
            same &= _numbers(matrix, position, walk.order + "u4") == value
        if place is not None and place.offset + int(place.code[1]) <= matrix.shape[1]:
            values = _numbers(matrix[same], place.offset, walk.order + place.code)
            column[members[same]] = values
        members, matrix = members[~same], matrix[~same]


def _numbers(matrix: npt.NDArray[np.uint8], position: int, code: str) -> npt.NDArray[Any]:
    width = int(code[-1])
    block = np.ascontiguousarray(matrix[:, position : position + width])
    return block.view(np.dtype(code))[:, 0]
