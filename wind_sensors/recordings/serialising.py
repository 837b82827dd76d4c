"""Many messages of one type at once: a template whose numeric fields are filled from arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from wind_sensors.errors import UserError
from wind_sensors.recordings.fields import leaf, place_of
from wind_sensors.station.inputs import FieldPath
from wind_sensors.station.signals import TimeArray


class TopicMessages(NamedTuple):
    """Serialised messages for one topic.

    Attributes:
        topic: Name.
        message_type: E.g. `std_msgs/msg/Header`.
        time: Time of recording of each message [ns].
        raw: The messages in CDR.
    """

    topic: str
    message_type: str
    time: TimeArray
    raw: Sequence[bytes]


def template(
    types: Typestore,
    message_type: str,
    paths: Sequence[FieldPath] = (),
    texts: Mapping[FieldPath, str] | None = None,
) -> Any:
    """A message with zeros and empty texts.

    Args:
        types: Definitions.
        message_type: Type.
        paths: Fields that will be filled; arrays are made long enough for their indices.
        texts: Values of string fields.

    Raises:
        UserError: The type is unknown.
    """
    leaf(types, message_type, ())
    texts = texts or {}
    wanted = [*paths, *texts]
    return _blank(types, (Nodetype.NAME, message_type), wanted, texts, ())


def _blank(
    types: Typestore,
    node: Any,
    wanted: Sequence[FieldPath],
    texts: Mapping[FieldPath, str],
    here: FieldPath,
) -> Any:
    kind, detail = node
    if kind == Nodetype.BASE:
        if detail[0] in {"string", "wstring"}:
            return texts.get(here, "")
        return False if detail[0] == "bool" else 0.0 if "float" in detail[0] else 0
    if kind == Nodetype.NAME:
        values = {
            name: _blank(types, child, wanted, texts, (*here, name))
            for name, child in types.fielddefs[detail][1]
        }
        return types.types[detail](**values)
    child, size = detail
    indices = [int(p[len(here)]) for p in wanted if len(p) > len(here) and p[: len(here)] == here]
    count = size if kind == Nodetype.ARRAY else max(indices, default=-1) + 1
    items = [_blank(types, child, wanted, texts, (*here, index)) for index in range(count)]
    if child[0] == Nodetype.BASE and child[1][0] not in {"string", "wstring"}:
        return np.asarray(items, dtype=_DTYPES.get(child[1][0], child[1][0]))
    return items


_DTYPES = {"byte": "uint8", "char": "uint8", "octet": "uint8"}


def serialised(
    types: Typestore,
    message: Any,
    columns: Mapping[FieldPath, npt.NDArray[Any]],
) -> list[bytes]:
    """Copies of a message with numeric fields from arrays.

    Args:
        types: Definitions.
        message: The template, with its texts and array lengths as they will be.
        columns: Values by field; a column of shape (n, k) fills an array of k numbers. A field that
            leads to a `builtin_interfaces/Time` takes nanoseconds.

    Returns:
        n serialised messages; integer fields hold the nearest integer.
    """
    name = message.__msgtype__
    data = bytes(types.serialize_cdr(message, name))
    count = len(next(iter(columns.values())))
    matrix = np.tile(np.frombuffer(data, np.uint8), (count, 1))
    for path, values in columns.items():
        if leaf(types, name, path) == "builtin_interfaces/msg/Time":
            seconds, rest = np.divmod(values, 1_000_000_000)
            _put(matrix, types, data, name, (*path, "sec"), seconds)
            _put(matrix, types, data, name, (*path, "nanosec"), rest)
        else:
            _put(matrix, types, data, name, path, values)
    joined = matrix.tobytes()
    size = len(data)
    return [joined[start : start + size] for start in range(0, count * size, size)]


def _put(
    matrix: npt.NDArray[np.uint8],
    types: Typestore,
    data: bytes,
    name: str,
    path: FieldPath,
    values: npt.NDArray[Any],
) -> None:
    place = place_of(data, types, name, path)
    if place is None:
        raise UserError(f"{name} has no room for '{'.'.join(map(str, path))}'.")
    dtype = np.dtype(("<" if data[1] & 1 else ">") + place.code)
    if dtype.kind in "iu" and values.dtype.kind == "f":
        limits = np.iinfo(dtype)
        values = np.clip(np.rint(values), float(limits.min), float(limits.max))
    block = np.ascontiguousarray(values.astype(dtype)).view(np.uint8)
    width = dtype.itemsize * place.items
    matrix[:, place.offset : place.offset + width] = block.reshape(len(matrix), width)
