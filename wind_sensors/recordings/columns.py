"""Tables as loggers write them: names in a header, one row for each instant."""

from __future__ import annotations

import csv
import datetime
import gzip
import re
import zoneinfo
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wind_sensors.errors import UserError
from wind_sensors.recordings.mapping import Mapping, TimeColumn
from wind_sensors.station.signals import FloatArray, TimeArray

_GZIP = b"\x1f\x8b"
_TOA5_HEADER = 4
_MINUTE = 60_000_000_000
_EPOCH = datetime.datetime(1970, 1, 1)


@dataclass(frozen=True)
class Table:
    """The wanted columns of one file.

    Attributes:
        time: Stamps as the file has them, in UTC [ns], shape (n,).
        values: Columns by name, NaN where the cell is missing; shape (n,) each.
        faults: What was wrong, with the number of lines.
    """

    time: TimeArray
    values: dict[str, FloatArray]
    faults: Counter[str]


def read_text(path: Path) -> str:
    """The text of a file, unpacked where it is gzipped.

    Raises:
        UserError: The file cannot be read.
    """
    try:
        data = path.read_bytes()
        if data.startswith(_GZIP):
            data = gzip.decompress(data)
    except (OSError, EOFError) as problem:
        raise UserError(f"the file cannot be read ({problem}).", str(path)) from None
    return data.decode("utf-8-sig", errors="replace")


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
                f"Columns: {', '.join(names)}.",
            )
    places = [names.index(column) for column in wanted]
    time_place = names.index(mapping.time.column)
    faults: Counter[str] = Counter()
    rows: list[list[str]] = []
    for row in csv.reader(lines[first:], delimiter=delimiter):
        if len(row) == len(names):
            rows.append(row)
        elif row:
            faults["lines with a wrong number of columns"] += 1
    time, known = _times([row[time_place] for row in rows], mapping.time, faults)
    rows = [row for row, good in zip(rows, known, strict=True) if good]
    missing = frozenset(mapping.missing)
    values = {
        column: _numbers([row[place].strip() for row in rows], missing, column, faults)
        for column, place in zip(wanted, places, strict=True)
    }
    return Table(time, values, faults)


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


def _times(
    texts: list[str], column: TimeColumn, faults: Counter[str]
) -> tuple[TimeArray, list[bool]]:
    """Stamps in UTC and which rows have one."""
    try:
        if column.format:
            raise ValueError
        plain = [text.strip().removesuffix("Z") for text in texts]
        local = np.asarray(plain, dtype="datetime64[ns]").astype(np.int64)
        known = [True] * len(texts)
    except ValueError:
        stamps = [_stamp(text.strip(), column.format) for text in texts]
        known = [stamp is not None for stamp in stamps]
        local = np.asarray([stamp for stamp in stamps if stamp is not None], dtype=np.int64)
        bad = known.count(False)
        if bad:
            faults["lines without a readable time"] += bad
    return local - _offsets(local, column.zone), known


def _stamp(text: str, form: str) -> int | None:
    try:
        if form:
            since = datetime.datetime.strptime(text, form).replace(tzinfo=None) - _EPOCH
            whole = since.days * 86_400 + since.seconds
            return whole * 1_000_000_000 + since.microseconds * 1000
        return int(np.datetime64(text.removesuffix("Z"), "ns").astype(np.int64))
    except ValueError:
        return None


def _offsets(local: TimeArray, zone: str) -> TimeArray | int:
    """Local time minus UTC [ns]."""
    if zone in {"UTC", "Z"}:
        return 0
    match = re.fullmatch(r"([+-])(\d{1,2}):?(\d{2})", zone)
    if match is not None:
        minutes = int(match[2]) * 60 + int(match[3])
        return minutes * _MINUTE * (-1 if match[1] == "-" else 1)
    try:
        region = zoneinfo.ZoneInfo(zone)
    except (zoneinfo.ZoneInfoNotFoundError, ValueError):
        raise UserError(
            f"'{zone}' is not a time zone.", "zone", "Write UTC, +01:00 or Europe/Berlin."
        ) from None
    hours, inverse = np.unique(local // (60 * _MINUTE), return_inverse=True)
    offsets = []
    for hour in hours.tolist():
        naive = _EPOCH + datetime.timedelta(hours=hour)
        shift = naive.replace(tzinfo=region).utcoffset()
        offsets.append(int(shift.total_seconds()) * 1_000_000_000 if shift is not None else 0)
    return np.asarray(offsets, dtype=np.int64)[inverse]


def _numbers(
    cells: list[str], missing: frozenset[str], column: str, faults: Counter[str]
) -> FloatArray:
    values = np.full(len(cells), np.nan)
    for index, cell in enumerate(cells):
        if cell in missing:
            faults[f"missing values in {column}"] += 1
            continue
        try:
            values[index] = float(cell)
        except ValueError:
            faults[f"unreadable values in {column}"] += 1
    return values
