"""Local time of loggers to UTC, with the clock changes of summer time."""

from __future__ import annotations

import datetime
import re
import zoneinfo
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.errors import UserError
from wind_sensors.station.signals import TimeArray

SECOND = 1_000_000_000
_MINUTE = 60 * SECOND
_QUARTER = 15 * _MINUTE
"""Clock changes come at whole quarters of an hour, and shift the clock by such."""
_DAY = 24 * 60 * _MINUTE
EPOCH = datetime.datetime(1970, 1, 1)

ZONE_REMEDY = "write UTC, an offset as +01:00, or a name as Europe/Berlin"


@dataclass(frozen=True)
class _Offsets:
    """Local time minus UTC [ns], before and after a jump of the clock; alike far from one.

    Attributes:
        first, second: Shape (n,).
    """

    first: TimeArray
    second: TimeArray

    @property
    def skipped(self) -> npt.NDArray[np.bool_]:
        """Local times that the clock jumps over, shape (n,)."""
        return np.asarray(self.second > self.first)

    @property
    def repeated(self) -> npt.NDArray[np.bool_]:
        """Local times that come twice, shape (n,)."""
        return np.asarray(self.second < self.first)


def zone_fault(zone: str) -> str:
    """What is wrong with a time zone of a mapping file; empty: nothing."""
    if _fixed(zone) is None:
        try:
            zoneinfo.ZoneInfo(zone)
        except (zoneinfo.ZoneInfoNotFoundError, ValueError, OSError):
            return f"'{zone}' is not a time zone: {ZONE_REMEDY}"
    return ""


def to_utc(
    local: TimeArray, zone: str, file: str, lines: Sequence[int]
) -> tuple[TimeArray, list[str]]:
    """Stamps in UTC [ns] and what people should know of them.

    A local time that a clock change repeats is of the second time from where the stamps of a file
    step back on.

    Args:
        local: Stamps in the order of the file, as nanoseconds since 1970 of the local clock; (n,).
        zone: UTC, an offset, or a name.
        file: Name for messages.
        lines: Where the stamps stand in it, one for each.

    Raises:
        UserError: Stamps lie where the zone's clock jumps ahead: such a logger does not follow it.
    """
    fixed = _fixed(zone)
    if fixed is not None:
        return local - fixed, []
    region = zoneinfo.ZoneInfo(zone)
    change = _changes(local, region)
    # The jump's first moment is one of the clock that has yet to jump: the end of an interval.
    inside = change.skipped & _changes(local - 1, region).skipped
    if inside.any():
        first = int(np.flatnonzero(inside)[0])
        raise UserError(
            f"{np.count_nonzero(inside)} times do not exist in {zone}, the first is "
            f"{_told(local[first])}: this logger does not follow summer time.",
            f"{file}:{lines[first]}",
            f"Write `zone: {_as_offset(int(change.first[first]))}`.",
        )
    offsets = change.first.copy()
    notes = []
    for day in np.unique(local[change.repeated] // _DAY):
        where = np.flatnonzero(change.repeated & (local // _DAY == day))
        second = _second_time(local, where, int((change.first - change.second)[where[0]]))
        offsets[where[second]] = change.second[where[second]]
        span = f"{_told(local[where].min())} to {_told(local[where].max())}"
        if second.any():
            notes.append(f"{file}: the clock of {zone} was set back: {span} comes twice")
        else:
            notes.append(
                f"{file}: the clock of {zone} was set back, but {span} comes once and was taken "
                "for the first time; if this logger does not follow summer time, write `zone: "
                f"{_as_offset(int(change.second[where[0]]))}`"
            )
    return local - offsets, notes


def _fixed(zone: str) -> int | None:
    """The offset that a zone states [ns]; None: it is a name."""
    if zone in {"UTC", "Z"}:
        return 0
    match = re.fullmatch(r"([+-])(\d{1,2}):?(\d{2})", zone)
    if match is None:
        return None
    minutes = int(match[2]) * 60 + int(match[3])
    return minutes * _MINUTE * (-1 if match[1] == "-" else 1)


def _changes(local: TimeArray, region: zoneinfo.ZoneInfo) -> _Offsets:
    quarters, inverse = np.unique(local // _QUARTER, return_inverse=True)
    found = np.empty((2, quarters.size), dtype=np.int64)
    for k, quarter in enumerate(quarters.tolist()):
        naive = EPOCH + datetime.timedelta(minutes=15 * quarter)
        for fold in (0, 1):
            shift = naive.replace(tzinfo=region, fold=fold).utcoffset()
            assert shift is not None
            found[fold, k] = round(shift.total_seconds()) * SECOND
    return _Offsets(*found[:, inverse.reshape(-1)])


def _second_time(
    local: TimeArray, where: npt.NDArray[np.intp], length: int
) -> npt.NDArray[np.bool_]:
    """Which of the stamps that could be of either time are of the second, shape of `where`.

    The clock went back by `length` [ns] between two rows: their stamps by that less a row's
    distance. Tables may also run backwards.
    """
    steps = np.diff(local)
    backwards = steps.size > 0 and float(np.median(steps)) < 0.0
    usual = min(float(np.median(np.abs(steps))), length) if steps.size else 0.0
    stamps = local[where][::-1] if backwards else local[where]
    back = np.flatnonzero(np.diff(stamps) <= -0.5 * (length - usual))
    second = np.zeros(stamps.size, dtype=np.bool_)
    if back.size:
        second[back[0] + 1 :] = True
    return second[::-1] if backwards else second


def _told(local: int) -> str:
    moment = EPOCH + datetime.timedelta(microseconds=int(local) // 1000)
    return moment.strftime("%Y-%m-%d %H:%M")


def _as_offset(offset: int) -> str:
    minutes = abs(offset) // _MINUTE
    return f"{'-' if offset < 0 else '+'}{minutes // 60:02d}:{minutes % 60:02d}"
