"""Dates and times as a station file states them."""

from __future__ import annotations

from datetime import datetime, timezone

REMEDY = "Write it like 2026-01-01T00:00:00Z."
_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_LAST_SECOND = 2**31 - 1
"""Seconds of a ROS stamp have 32 bits: from 1901 to 2038."""


def nanoseconds(text: str) -> int:
    """A moment [ns since 1970].

    Args:
        text: ISO 8601; without an offset it is UTC.

    Raises:
        ValueError: It is no date and time, or none that a ROS stamp can hold; says which.
    """
    try:
        moment = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        raise ValueError(f"'{text}' is not a date and time") from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    since = moment - _EPOCH
    seconds = since.days * 86_400 + since.seconds
    if not -_LAST_SECOND <= seconds <= _LAST_SECOND:
        raise ValueError(f"'{text}' is beyond the times of ROS stamps, 1901 to 2038")
    return (seconds * 1_000_000 + since.microseconds) * 1_000
