"""Health of inputs and clock from what the intake counted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from wind_sensors.estimation.intake import (
    PLATFORM,
    PRESSURE,
    PULSES,
    READINGS,
    TEMPERATURE,
    VELOCITY,
    InputRecord,
    Intake,
)
from wind_sensors.estimation.outputs import HealthItem, HealthLevel, WindowStatistics
from wind_sensors.estimation.presence import Presence
from wind_sensors.estimation.recent import MEMORY, Tally
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.station.model import Station

_MOTION = (PLATFORM, VELOCITY)
_NEEDED = (PULSES, READINGS, *_MOTION)
_STEADY = (READINGS, *_MOTION)
"""Inputs that send whatever happens."""
_LATE_SHARE = 0.001
_FEW = 5
"""So few messages that do not fit may be mere strays."""
_DAY = 86_400.0
_LONGEST_WINDOW = 10.0
"""No reordering window may be larger [s]."""


def _values(record: InputRecord, age: float) -> dict[str, str]:
    return {
        "rate": f"{record.rate:.2f} Hz",
        "age": f"{age:.2f} s" if record.last else "never heard",
        "messages": str(record.accepted.total),
        "doubled": str(record.doubled.total),
        "late": str(record.late.total),
        "ahead": str(record.ahead.total),
        "not a number": str(record.invalid.total),
        "gaps": str(record.gaps.total),
        "longest gap": f"{record.longest_gap:.2f} s",
    }


class _Span(NamedTuple):
    """What counts are judged by.

    Attributes:
        now: The intake's clock [ns].
        whole: Everything since the start; else the last minute.
    """

    now: int
    whole: bool

    def count(self, tally: Tally) -> int:
        """How often it happened."""
        return tally.total if self.whole else tally.recent(self.now)

    @property
    def text(self) -> str:
        """As the end of a sentence."""
        return "" if self.whole else f" within the last {MEMORY} s"


def _offset_text(offset: float) -> str:
    """A difference of clocks [s] for people."""
    size = abs(offset)
    return f"{size:.1f} s" if size < _DAY else f"{size / _DAY:.0f} days"


def _off_the_clock(name: str, record: InputRecord, span: _Span) -> str:
    """What to say of an input most of whose messages do not fit the others' stamps, else nothing.

    Which of two clocks is wrong cannot be known from their difference.
    """
    late, ahead = span.count(record.late), span.count(record.ahead)
    used = span.count(record.accepted)
    if late + ahead <= max(used, _FEW) or not record.offsets:
        return ""
    offset = float(np.median(np.array(record.offsets, dtype=np.float64))) * 1e-9
    way = "behind" if offset < 0.0 else "ahead of"
    remedy = "Set the clocks in step"
    if abs(offset) < _DAY:
        remedy += ", or state `clock.latency` in the station file"
    if -_LONGEST_WINDOW < offset < 0.0:
        remedy += ", or let `reordering_window` be larger"
    return (
        f"{late + ahead} of {late + ahead + used} messages of {name} are stamped "
        f"{_offset_text(offset)} {way} the others and were left out{span.text}. {remedy}."
    )


def _judged(
    name: str,
    record: InputRecord,
    age: float,
    settings: EstimatorSettings,
    presence: Presence | None,
    span: _Span,
) -> tuple[HealthLevel, str]:
    off = _off_the_clock(name, record, span)
    if off:
        return HealthLevel.ERROR, off
    if not record.last:
        if record.kind in _NEEDED:
            return HealthLevel.STALE, f"Nothing was heard of {name}."
        return HealthLevel.OK, "Not measured."
    if record.kind == PULSES and presence is not None and presence.silence(name) > 0.0:
        return _silent_rotor(name, age, presence)
    limit = settings.gap_time
    if record.kind == READINGS and presence is not None:
        limit = max(limit, presence.limit(name))
    if record.kind in _STEADY and age > limit:
        return HealthLevel.STALE, f"Silent for {age:.1f} s."
    invalid, gaps, late = (span.count(t) for t in (record.invalid, record.gaps, record.late))
    if invalid:
        return HealthLevel.WARN, f"{invalid} messages were not numbers{span.text}."
    if record.kind in _STEADY and gaps:
        longest = f", the longest {record.longest_gap:.1f} s" if span.whole else span.text
        return HealthLevel.WARN, f"{gaps} gaps{longest}."
    if late > _LATE_SHARE * span.count(record.accepted):
        return HealthLevel.WARN, f"{late} messages came too late to be used{span.text}."
    doubled = span.count(record.doubled)
    if doubled:
        return HealthLevel.OK, f"Heard; {doubled} messages came twice{span.text}."
    return HealthLevel.OK, "Heard."


def _silent_rotor(name: str, age: float, presence: Presence) -> tuple[HealthLevel, str]:
    if presence.is_silent:
        return (
            HealthLevel.STALE,
            f"No edge for {age:.1f} s: the rotor has stopped, or its driver is dead.",
        )
    if presence.is_lost(name):
        return (
            HealthLevel.ERROR,
            f"No edge for {age:.1f} s, and no rotor stops so fast in the wind: its driver is dead, "
            "or something holds it.",
        )
    return HealthLevel.WARN, f"The rotor has stopped: no edge for {age:.1f} s."


def input_health(
    intake: Intake,
    station: Station,
    settings: EstimatorSettings,
    presence: Presence | None,
    whole: bool,
) -> list[HealthItem]:
    """One item for each input of the station.

    Args:
        intake: Its counts.
        station: Tells which air inputs there are.
        settings: Limits.
        presence: Tells what silence means; None before the first block.
        whole: Judge by everything since the start, else by the last minute.
    """
    span = _Span(intake.watermark, whole)
    items = []
    for name, record in intake.records.items():
        if record.kind == TEMPERATURE and station.air.temperature is None:
            continue
        if record.kind == PRESSURE and station.air.pressure is None:
            continue
        # A block that waits for a slow platform makes none of the others silent.
        heard = record.newest if record.kind in _STEADY and record.newest else record.last
        age = max(0.0, (intake.watermark - heard) * 1e-9) if heard else 0.0
        level, message = _judged(name, record, age, settings, presence, span)
        items.append(HealthItem(name, level, message, _values(record, age)))
    return items


def clock_health(intake: Intake, unknown: Mapping[str, Tally], whole: bool) -> HealthItem:
    """Jumps of the clock, stamps that do not fit, messages of unknown instruments.

    Args:
        intake: Its counts.
        unknown: Messages by the name of an instrument that the station does not have.
        whole: Judge by everything since the start, else by the last minute.
    """
    span = _Span(intake.watermark, whole)
    records = intake.records
    values = {
        "jumps": str(intake.jumps.total),
        "implausible stamps": str(sum(r.ahead.total for r in records.values())),
        "messages of unknown instruments": str(sum(t.total for t in unknown.values())),
    }
    off = [text for n, r in records.items() if (text := _off_the_clock(n, r, span))]
    jumps, ahead = span.count(intake.jumps), {n: span.count(r.ahead) for n, r in records.items()}
    names = sorted(name for name, tally in unknown.items() if span.count(tally))
    if off:
        return HealthItem("clock", HealthLevel.ERROR, " ".join(off), values)
    if jumps:
        text = _jumps_text(jumps, span.count(intake.pauses), intake.longest_pause * 1e-9, span)
    elif any(ahead.values()):
        guilty = ", ".join(f"{count} of {name}" for name, count in ahead.items() if count)
        text = f"Implausible stamps, ahead of all others, were left out{span.text}: {guilty}."
    elif names:
        text = f"Messages of unknown instruments{span.text}: {', '.join(names)}."
    else:
        return HealthItem("clock", HealthLevel.OK, "Stamps run forward.", values)
    return HealthItem("clock", HealthLevel.WARN, text, values)


def _jumps_text(jumps: int, pauses: int, longest: float, span: _Span) -> str:
    """What to say of steps of the clock, those ahead among them, which a pause makes as well."""
    said = []
    if jumps > pauses:
        said.append(f"the clock jumped back {_times(jumps - pauses)}{span.text}")
    if pauses:
        length = f" for {_offset_text(longest)}" if pauses == 1 else (
            f" {_times(pauses)}, for {_offset_text(longest)} at the longest"
        )
        said.append(f"no input was heard{length}{span.text}, or the clock jumped ahead")
    text = f"{'; '.join(said)}; the estimate began anew."
    return text[0].upper() + text[1:]


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def motion_health(intake: Intake, refused: Tally, refusing: bool, whole: bool) -> HealthItem:
    """Whether the carrier's motion is known well enough for a wind in the earth frame.

    Args:
        intake: Tells what was heard of the carrier, and the time.
        refused: Estimates that would have been guesswork.
        refusing: Whether the latest was one of them.
        whole: Judge by everything since the start, else by the last minute.
    """
    values = {"refused estimates": str(refused.total)}
    span = _Span(intake.watermark, whole)
    unheard = [n for n, r in intake.records.items() if r.kind in _MOTION and not r.last]
    if unheard:
        return HealthItem(
            "motion",
            HealthLevel.ERROR if refusing else HealthLevel.STALE,
            f"Nothing usable was heard of {' and '.join(unheard)}: no wind is published until it "
            "is.",
            values,
        )
    if refusing:
        return HealthItem(
            "motion",
            HealthLevel.ERROR,
            "The platform's motion is not known: no wind is published until it is heard of again.",
            values,
        )
    if span.count(refused):
        return HealthItem(
            "motion",
            HealthLevel.WARN,
            f"{span.count(refused)} estimates were left out{span.text}: {_around(intake)} had not "
            "been heard of around them.",
            values,
        )
    return HealthItem("motion", HealthLevel.OK, "The platform's motion is known.", values)


def _around(intake: Intake) -> str:
    """What has to be heard of for the motion to be known."""
    apart = any(record.kind == VELOCITY for record in intake.records.values())
    return "the platform's attitude or velocity" if apart else "the platform"


def estimate_health(
    intake: Intake, presence: Presence | None, delivered: bool
) -> HealthItem | None:
    """Item `estimate` where there is no wind or it is not measured now, else None.

    Args:
        intake: Tells which inputs were never heard.
        presence: Tells who speaks; None before the first block.
        delivered: Whether there was an estimate.
    """
    silent = [n for n, r in intake.records.items() if r.kind in _NEEDED and not r.last]
    if not delivered and silent:
        text = f"No wind yet: nothing usable came from {' and '.join(silent)}."
        return HealthItem("estimate", HealthLevel.STALE, text)
    return None if presence is None else presence.health()


_NOT_NOW = "Of the last window in which anything was measured."


def _too_little(window: WindowStatistics) -> str:
    return f"Only {100.0 * window.complete:.0f} % of the window was measured: no means."


def window_health(window: WindowStatistics, is_old: bool) -> HealthItem:
    """What the numbers of the latest window's topics are worth, one key for each topic.

    Args:
        window: The latest.
        is_old: Whether the windows after it had no wind at all.
    """
    comes_from = float(direction_from_deg(window.vector_mean))
    turn = math.degrees(window.direction_uncertainty)
    values = {
        "speed": f"{window.scalar_mean:.3f} +- {window.scalar_mean_uncertainty:.3f} m/s",
        "direction_from": f"{comes_from:.2f} +- {turn:.2f} deg",
        "direction_variance": (
            f"{window.corrected_direction_variance:.3g} +- "
            f"{window.direction_variance_uncertainty:.2g} rad^2"
        ),
        "data": f"{100.0 * window.complete:.0f} % of the window",
    }
    if is_old:
        return HealthItem("window", HealthLevel.STALE, _NOT_NOW, values)
    if not math.isfinite(window.scalar_mean):
        return HealthItem("window", HealthLevel.WARN, _too_little(window), values)
    return HealthItem("window", HealthLevel.OK, "Means with their standard uncertainty.", values)


def bias_health(window: WindowStatistics, is_old: bool) -> HealthItem:
    """The biases of the latest window, one key each.

    Args:
        window: The latest.
        is_old: Whether the windows after it had no wind at all.
    """
    values = {
        name: f"{100.0 * term.value:+.3f} +- {100.0 * term.uncertainty:.3f} % of the "
        f"{term.relative_to}"
        for name, term in window.bias_terms.items()
    }
    level, text = HealthLevel.OK, f"Removed from the mean of {window.instrument}."
    if is_old:
        level, text = HealthLevel.STALE, _NOT_NOW
    elif not math.isfinite(window.scalar_mean):
        level, text = HealthLevel.WARN, _too_little(window)
    elif not math.isfinite(window.raw_scalar_mean):
        text = f"Not known: {window.instrument}, or its vane, was silent for most of the window."
        level = HealthLevel.WARN
    return HealthItem("bias", level, text, values)
