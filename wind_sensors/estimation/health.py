"""Health of inputs and clock from what the intake counted."""

from __future__ import annotations

import math

from wind_sensors.estimation.intake import (
    PLATFORM,
    PRESSURE,
    PULSES,
    READINGS,
    TEMPERATURE,
    InputRecord,
    Intake,
)
from wind_sensors.estimation.outputs import HealthItem, HealthLevel, WindowStatistics
from wind_sensors.estimation.settings import EstimatorSettings
from wind_sensors.motion.frames import direction_from_deg
from wind_sensors.station.model import Station

_NEEDED = (PULSES, READINGS, PLATFORM)
_LATE_SHARE = 0.001


def _values(record: InputRecord, age: float) -> dict[str, str]:
    return {
        "rate": f"{record.rate:.2f} Hz",
        "age": f"{age:.2f} s" if record.last else "never heard",
        "messages": str(record.accepted),
        "doubled": str(record.doubled),
        "late": str(record.late),
        "not a number": str(record.invalid),
        "gaps": str(record.gaps),
        "longest gap": f"{record.longest_gap:.2f} s",
    }


def _judged(
    name: str, record: InputRecord, age: float, settings: EstimatorSettings
) -> tuple[HealthLevel, str]:
    if not record.last:
        if record.kind in _NEEDED:
            return HealthLevel.STALE, f"Nothing was heard of {name}."
        return HealthLevel.OK, "Not measured."
    if record.kind == PULSES and age > settings.stop_time:
        return HealthLevel.WARN, f"The rotor has stopped: no edge for {age:.1f} s."
    if record.kind in (READINGS, PLATFORM) and age > settings.gap_time:
        return HealthLevel.STALE, f"Silent for {age:.1f} s."
    if record.invalid:
        return HealthLevel.WARN, f"{record.invalid} messages were not numbers."
    if record.kind in (READINGS, PLATFORM) and record.gaps:
        return (
            HealthLevel.WARN,
            f"{record.gaps} gaps, the longest {record.longest_gap:.1f} s.",
        )
    if record.late > _LATE_SHARE * record.accepted:
        return HealthLevel.WARN, f"{record.late} messages came too late to be used."
    if record.doubled:
        return HealthLevel.OK, f"Heard; {record.doubled} messages came twice."
    return HealthLevel.OK, "Heard."


def input_health(
    intake: Intake, station: Station, settings: EstimatorSettings
) -> list[HealthItem]:
    """One item for each input of the station.

    Args:
        intake: Its counts.
        station: Tells which air inputs there are.
        settings: Limits.
    """
    items = []
    for name, record in intake.records.items():
        if record.kind == TEMPERATURE and station.air.temperature is None:
            continue
        if record.kind == PRESSURE and station.air.pressure is None:
            continue
        age = max(0.0, (intake.watermark - record.last) * 1e-9) if record.last else 0.0
        level, message = _judged(name, record, age, settings)
        items.append(HealthItem(name, level, message, _values(record, age)))
    return items


def clock_health(intake: Intake, unknown: dict[str, int]) -> HealthItem:
    """Jumps of the clock, implausible stamps, messages of unknown instruments."""
    values = {
        "jumps": str(intake.jumps),
        "implausible stamps": str(intake.far_ahead),
        "messages of unknown instruments": str(sum(unknown.values())),
    }
    if intake.jumps:
        return HealthItem(
            "clock",
            HealthLevel.WARN,
            f"The clock has jumped {intake.jumps} times; the estimate began anew.",
            values,
        )
    if intake.far_ahead:
        return HealthItem(
            "clock",
            HealthLevel.WARN,
            f"{intake.far_ahead} stamps were implausible and left out.",
            values,
        )
    if unknown:
        names = ", ".join(sorted(unknown))
        return HealthItem(
            "clock", HealthLevel.WARN, f"Messages of unknown instruments: {names}.", values
        )
    return HealthItem("clock", HealthLevel.OK, "Stamps run forward.", values)


def motion_health(refused: int, refusing: bool) -> HealthItem:
    """Whether the carrier's motion is known well enough for a wind in the earth frame.

    Args:
        refused: Estimates that would have been guesswork.
        refusing: Whether the latest was one of them.
    """
    values = {"refused estimates": str(refused)}
    if refusing:
        return HealthItem(
            "motion",
            HealthLevel.ERROR,
            "The platform's motion is not known: no wind is published until it is heard of again.",
            values,
        )
    if refused:
        return HealthItem(
            "motion",
            HealthLevel.WARN,
            f"{refused} estimates were left out: the platform had not been heard of around them.",
            values,
        )
    return HealthItem("motion", HealthLevel.OK, "The platform's motion is known.", values)


def window_health(window: WindowStatistics) -> HealthItem:
    """What the numbers of the latest window's topics are worth, one key for each topic."""
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
    return HealthItem("window", HealthLevel.OK, "Means with their standard uncertainty.", values)


def bias_health(window: WindowStatistics) -> HealthItem:
    """The biases of the latest window, one key each, relative to the mean speed."""
    values = {
        name: f"{100.0 * term.value:+.3f} +- {100.0 * term.uncertainty:.3f} %"
        for name, term in window.bias_terms.items()
    }
    return HealthItem(
        "bias", HealthLevel.OK, f"Removed from the mean of {window.instrument}.", values
    )
