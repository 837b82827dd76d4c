"""NMEA 0183 logs: sentences with checksums, and the clock hidden in them."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wind_sensors.recordings.mapping import Source
from wind_sensors.station.signals import FloatArray, TimeArray

_TIME_FIELDS = {"RMC": 1, "GLL": 5, "GGA": 1, "ZDA": 1}
"""Sentences that tell the time of day, and where."""
_STATUS_FIELDS = {"RMC": 2, "GLL": 6}
_LONGEST_CYCLE = 5_000_000_000
"""Sentences between two fixes this close are spread evenly between them [ns]."""
_DAY = 86_400_000_000_000


class Sentence(NamedTuple):
    """One valid sentence: talker, three-letter name, and the fields; field 0 is the address."""

    talker: str
    name: str
    fields: tuple[str, ...]


@dataclass(frozen=True)
class NmeaLog:
    """The valid sentences of a log with their times.

    Attributes:
        sentences: In order.
        time: Of each sentence, from the fixes around it [ns], shape (n,).
        faults: What was left out and why, with the number of lines.
    """

    sentences: tuple[Sentence, ...]
    time: TimeArray
    faults: Counter[str]


def checksum(body: str) -> int:
    """Exclusive or of the characters between `$` and `*`."""
    total = 0
    for byte in body.encode("latin-1", errors="replace"):
        total ^= byte
    return total


def with_checksum(body: str) -> str:
    """The sentence of a body: `$BODY*HH`."""
    return f"${body}*{checksum(body):02X}"


def read_sentence(line: str) -> Sentence | str:
    """One line of a log.

    Returns:
        The sentence, or why it is left out.
    """
    start = line.find("$")
    if start < 0:
        return "lines that are no sentence"
    body, star, digits = line[start + 1 :].strip().partition("*")
    if not star:
        return "sentences without a checksum"
    try:
        stated = int(digits[:2], 16)
    except ValueError:
        return "sentences with a broken checksum"
    if stated != checksum(body):
        return "sentences whose checksum fails"
    fields = tuple(body.split(","))
    if len(fields[0]) < 5:
        return "proprietary sentences"
    return Sentence(fields[0][:-3], fields[0][-3:], fields)


def read_log(lines: Iterable[str], talkers: tuple[str, ...] = ()) -> NmeaLog:
    """Read a log.

    Every sentence gets a time: RMC, GLL, GGA and ZDA tell it, RMC and ZDA with the date; the
    sentences between two fixes at most 5 s apart are spread evenly between them, in longer gaps
    they keep the time of the fix before. Sentences before the first fix have no time and are left
    out.

    Args:
        lines: The log.
        talkers: Talkers to take; empty: all.
    """
    faults: Counter[str] = Counter()
    found: list[Sentence] = []
    for line in lines:
        if not line.strip():
            continue
        sentence = read_sentence(line)
        if isinstance(sentence, str):
            faults[sentence] += 1
        elif talkers and sentence.talker not in talkers:
            faults[f"sentences of talker {sentence.talker}"] += 1
        else:
            found.append(sentence)
    fixes, first = _fixes(found)
    if first:
        faults["sentences before the first fix"] += first
    if not fixes:
        return NmeaLog((), np.empty(0, dtype=np.int64), faults)
    kept = tuple(found[first:])
    return NmeaLog(kept, _spread(fixes, first, len(kept)), faults)


def samples(log: NmeaLog, source: Source) -> tuple[TimeArray, FloatArray, int]:
    """The numbers that a source names.

    Returns:
        Times [ns], values in the log's unit, and how many fitting sentences had no number there.
    """
    times: list[int] = []
    values: list[float] = []
    empty = 0
    for sentence, time in zip(log.sentences, log.time.tolist(), strict=True):
        if sentence.name != source.sentence:
            continue
        fields = sentence.fields
        if any(k >= len(fields) or fields[k] != text for k, text in source.where.items()):
            continue
        value = _number(fields, source.value)
        if value is None:
            empty += 1
        else:
            times.append(time)
            values.append(value)
    return np.asarray(times, dtype=np.int64), np.asarray(values), empty


def _number(fields: tuple[str, ...], place: int) -> float | None:
    """A number; degrees and minutes with a hemisphere behind become signed degrees."""
    if place >= len(fields):
        return None
    try:
        value = float(fields[place])
    except ValueError:
        return None
    hemisphere = fields[place + 1] if place + 1 < len(fields) else ""
    if hemisphere in {"N", "S", "E", "W"} and "." in fields[place] and value >= 100.0:
        degrees = float(int(value / 100.0))
        value = degrees + (value - 100.0 * degrees) / 60.0
        return -value if hemisphere in {"S", "W"} else value
    return value


def _fixes(sentences: list[Sentence]) -> tuple[list[tuple[int, int]], int]:
    """(index, time) of the sentences that tell the time, and the index of the first one."""
    date: int | None = None
    fixes: list[tuple[int, int]] = []
    for index, sentence in enumerate(sentences):
        place = _TIME_FIELDS.get(sentence.name)
        if place is None or place >= len(sentence.fields):
            continue
        status = _STATUS_FIELDS.get(sentence.name)
        if status is not None and sentence.fields[status : status + 1] != ("A",):
            continue
        clock = _time_of_day(sentence.fields[place])
        date = _date(sentence) or date
        if clock is None or date is None:
            continue
        moment = date + clock
        if sentence.name in {"GLL", "GGA"} and fixes:
            # Without a date of its own it may already be past midnight.
            moment += _DAY * round((fixes[-1][1] - moment) / _DAY)
        fixes.append((index, moment))
    return fixes, fixes[0][0] if fixes else len(sentences)


def _time_of_day(text: str) -> int | None:
    try:
        seconds = int(text[:2]) * 3600 + int(text[2:4]) * 60
        return seconds * 1_000_000_000 + round(float(text[4:]) * 1e9)
    except ValueError:
        return None


def _date(sentence: Sentence) -> int | None:
    """Midnight of the date in a sentence [ns]."""
    fields = sentence.fields
    try:
        if sentence.name == "RMC":
            day, month, year = int(fields[9][:2]), int(fields[9][2:4]), int(fields[9][4:6])
            year += 1900 if year >= 80 else 2000
        elif sentence.name == "ZDA":
            day, month, year = int(fields[2]), int(fields[3]), int(fields[4])
        else:
            return None
        moment = datetime.datetime(year, month, day, tzinfo=datetime.timezone.utc)
        return int(moment.timestamp()) * 1_000_000_000
    except (ValueError, IndexError):
        return None


def _spread(fixes: list[tuple[int, int]], first: int, count: int) -> TimeArray:
    """Time of each sentence from the first fix on."""
    index = np.arange(first, first + count)
    places = np.asarray([place for place, _ in fixes])
    moments = np.asarray([moment for _, moment in fixes], dtype=np.int64)
    left = np.searchsorted(places, index, side="right") - 1
    right = np.minimum(left + 1, len(places) - 1)
    step = moments[right] - moments[left]
    smooth = (step > 0) & (step <= _LONGEST_CYCLE)
    share = (index - places[left]) / np.maximum(places[right] - places[left], 1)
    return moments[left] + np.where(smooth, np.rint(share * step), 0.0).astype(np.int64)
