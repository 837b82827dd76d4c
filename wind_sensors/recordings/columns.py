"""Tables as loggers write them: names in a header, one row for each instant."""

from __future__ import annotations

import codecs
import csv
import datetime
import gzip
import json
import math
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wind_sensors.errors import UserError
from wind_sensors.recordings.local_time import EPOCH, to_utc
from wind_sensors.recordings.mapping import Mapping
from wind_sensors.station.signals import FloatArray, TimeArray

_GZIP = b"\x1f\x8b"
_TOA5_HEADER = 4

USUAL_FORMATS = (
    "%d.%m.%Y %H:%M",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%y %H:%M",
    "%d.%m.%y %H:%M:%S",
    "%d/%m/%Y %H:%M",
    "%d/%m/%Y %H:%M:%S",
    "%m/%d/%Y %H:%M",
    "%m/%d/%Y %H:%M:%S",
    "%Y/%m/%d %H:%M",
    "%Y/%m/%d %H:%M:%S",
    "%Y%m%d%H%M",
    "%Y%m%d%H%M%S",
)
"""Times as tables have them, for advice."""


@dataclass(frozen=True)
class Table:
    """The wanted columns of one file.

    Attributes:
        time: Stamps as the file has them, in UTC [ns], shape (n,).
        values: Columns by name, NaN where the cell is missing; shape (n,) each.
        faults: What was wrong, with the number of lines.
        notes: Where and what it was at first, and how to mend it.
    """

    time: TimeArray
    values: dict[str, FloatArray]
    faults: Counter[str]
    notes: tuple[str, ...]


def read_text(path: Path) -> str:
    """The text of a file, unpacked where it is gzipped.

    Raises:
        UserError: The file cannot be read.
    """
    try:
        data = path.read_bytes()
        if data.startswith(_GZIP):
            data = gzip.decompress(data)
    except FileNotFoundError:
        raise UserError("there is no such file.", str(path), "Check the path.") from None
    except (OSError, EOFError) as problem:
        said = getattr(problem, "strerror", None) or problem
        raise UserError(f"the file cannot be read ({said}).", str(path)) from None
    wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if wide else "utf-8-sig", errors="replace")


def read_table(path: Path, mapping: Mapping) -> Table:
    """Read the columns that a mapping names.

    Args:
        path: The file; gzip is unpacked.
        mapping: Its format, time column and wanted columns.

    Raises:
        UserError: The file has no such header or no such column.
    """
    lines = read_text(path).splitlines()
    delimiter = mapping.delimiter or ("\t" if mapping.format == "nrg" else ",")
    header, first = _header(lines, mapping, str(path))
    names = [cell.strip() for cell in next(csv.reader([lines[header]], delimiter=delimiter))]
    wanted = sorted({source.column for source in mapping.sources})
    for column in (mapping.time.column, *wanted):
        if column not in names:
            raise UserError(
                f"the table has no column '{column}'.",
                f"{path}:{header + 1}",
                f"Columns: {', '.join(names)}.{_other_delimiter(names, column)}",
            )
    places = [names.index(column) for column in wanted]
    time_place = names.index(mapping.time.column)
    faults: Counter[str] = Counter()
    notes: list[str] = []
    widths: Counter[int] = Counter()
    rows: list[list[str]] = []
    numbers: list[int] = []
    reader = csv.reader(lines[first:], delimiter=delimiter)
    for row in reader:
        if len(row) == len(names):
            rows.append(row)
            numbers.append(first + reader.line_num)
        elif row:
            faults["lines with a wrong number of columns"] += 1
            widths[len(row)] += 1
    if widths:
        width, count = widths.most_common(1)[0]
        notes.append(
            f"{path.name}: {'one line has' if count == 1 else f'{count} lines have'} {width} "
            f"columns and not the {len(names)} of the header"
        )
    elif not rows:
        notes.append(f"{path.name}: the table has no rows")
    local, known = _stamps([row[time_place] for row in rows], mapping.time.format)
    unread = known.count(False)
    if unread:
        faults["lines without a readable time"] += unread
        k = known.index(False)
        notes.append(
            f"{path.name}:{numbers[k]}: the time '{rows[k][time_place]}' cannot be read"
            f"{_time_hint(rows[k][time_place].strip(), mapping.time.format)}"
        )
        rows = [row for row, good in zip(rows, known, strict=True) if good]
        numbers = [number for number, good in zip(numbers, known, strict=True) if good]
    time, told = to_utc(local, mapping.time.zone, path.name, numbers)
    notes += told
    values = {}
    for column, place in zip(wanted, places, strict=True):
        cells = [row[place].strip() for row in rows]
        values[column], bad = _numbers(cells, mapping, column, faults)
        if bad is not None:
            notes.append(
                f"{path.name}:{numbers[bad]}: '{cells[bad]}' in {column} cannot be read"
                f"{_decimal_hint(cells[bad], mapping.decimal)}"
            )
    return Table(time, values, faults, tuple(notes))


def _other_delimiter(names: list[str], wanted: str) -> str:
    """Advice where a header looks as if something else stood between its columns."""
    for other in (";", "\t", "|", ","):
        parts = [part.strip().strip('"') for name in names for part in name.split(other)]
        if len(parts) > len(names) and wanted in parts:
            return f" Write `delimiter: {json.dumps(other)}` in the mapping."
    return ""


def _time_hint(text: str, given: str) -> str:
    if given:
        return f" with `time.format: {json.dumps(given)}`"
    for form in USUAL_FORMATS:
        if _stamp(text, form) is not None:
            return f"; write `format: {json.dumps(form)}` under `time` in the mapping"
    return ""


def _decimal_hint(cell: str, decimal: str) -> str:
    if decimal == "." and re.fullmatch(r"[+-]?\d+,\d+", cell):
        return """; write `decimal: ","` in the mapping"""
    return ""


def _header(lines: list[str], mapping: Mapping, where: str) -> tuple[int, int]:
    """Indices of the line with the names and of the first row."""
    if mapping.format == "toa5":
        if not lines or "TOA5" not in lines[0] or len(lines) < _TOA5_HEADER:
            raise UserError("this is not a TOA5 file.", where, "Its first line begins with TOA5.")
        return 1, _TOA5_HEADER
    if mapping.format == "nrg":
        for index, line in enumerate(lines[:-1]):
            if line.strip() == "Data":
                return index + 1, index + 2
        raise UserError("this is not an NRG export: there is no line `Data`.", where)
    if not lines:
        raise UserError("the table is empty.", where)
    return 0, 1


def _stamps(texts: list[str], form: str) -> tuple[TimeArray, list[bool]]:
    """Stamps of the local clock [ns], and which texts have one."""
    try:
        if form:
            raise ValueError
        plain = np.asarray([text.strip().removesuffix("Z") for text in texts], dtype=np.str_)
        moments = plain.astype("datetime64[ns]")
        if np.isnat(moments).any():
            raise ValueError
        return moments.astype(np.int64), [True] * len(texts)
    except ValueError:
        stamps = [_stamp(text.strip(), form) for text in texts]
        known = [stamp is not None for stamp in stamps]
        return np.asarray([s for s in stamps if s is not None], dtype=np.int64), known


def _stamp(text: str, form: str) -> int | None:
    try:
        if form:
            since = datetime.datetime.strptime(text, form).replace(tzinfo=None) - EPOCH
            whole = since.days * 86_400 + since.seconds
            return whole * 1_000_000_000 + since.microseconds * 1000
        moment = np.datetime64(text.removesuffix("Z"), "ns")
        return None if np.isnat(moment) else int(moment.astype(np.int64))
    except ValueError:
        return None


def _numbers(
    cells: list[str], mapping: Mapping, column: str, faults: Counter[str]
) -> tuple[FloatArray, int | None]:
    """Numbers, NaN where there is none, and the first cell that cannot be read."""
    missing = frozenset(mapping.missing)
    values = np.full(len(cells), np.nan)
    bad = None
    for index, cell in enumerate(cells):
        if cell in missing:
            faults[f"missing values in {column}"] += 1
            continue
        try:
            number = float(cell.replace(",", ".") if mapping.decimal == "," else cell)
        except ValueError:
            faults[f"unreadable values in {column}"] += 1
            bad = index if bad is None else bad
            continue
        if math.isfinite(number):
            values[index] = number
        else:
            faults[f"values in {column} that are not finite"] += 1
    return values, bad
