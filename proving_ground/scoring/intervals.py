"""Whether a diagnosis's intervals hold the numbers that were planted.

Only numbers that mean the same on both sides are compared; where the world's law differs from the
catalogue's (friction, wakes, ice), there is no true value of the catalogue's parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Values = dict[str, Any]


@dataclass(frozen=True)
class Coverage:
    """One parameter: its effect and name, the truth, and the interval given for it."""

    effect: str
    parameter: str
    truth: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.truth <= self.high


@dataclass(frozen=True)
class Comparable:
    """A parameter of the catalogue and the true value that follows from an answer."""

    parameter: str
    truth: Callable[[Values], float]
    unsigned: bool = False


def _of(key: str, factor: float = 1.0) -> Callable[[Values], float]:
    return lambda answer: factor * float(answer[key])


COMPARABLE: dict[str, tuple[Comparable, ...]] = {
    "calibration_drift": (Comparable("gain", _of("indicated_over_true")),),
    "calibration_offset": (Comparable("offset", _of("offset"), unsigned=True),),
    "air_density": (Comparable("density_ratio", _of("density_factor")),),
    "rotor_inertia": (Comparable("inertia_factor", _of("factor")),),
    "vane_inertia": (Comparable("inertia_factor", _of("factor")),),
    "vane_offset": (Comparable("offset", _of("offset_deg"), unsigned=True),),
    "quantisation": (Comparable("step", _of("step_deg")),),
    "potentiometer_gap": (Comparable("width", _of("width_deg")),),
    "missed_pulses": (Comparable("dead_time", _of("dead_time_s")),),
    "extra_pulses": (Comparable("bounce_probability", _of("share")),),
    "timestamp_latency": (Comparable("latency", _of("latency_s")),),
    "clock_drift": (Comparable("drift", _of("drift_ppm"), unsigned=True),),
    "low_pass_filter": (Comparable("time_constant", _of("time_constant_s")),),
    "platform_velocity_scale": (Comparable("velocity_scale", _of("reported_over_true")),),
    "lever_arm": (
        Comparable("dx", lambda a: float(a["true_m"][0]) - float(a["sheet_m"][0])),
        Comparable("dy", lambda a: float(a["true_m"][1]) - float(a["sheet_m"][1])),
        Comparable("dz", lambda a: float(a["true_m"][2]) - float(a["sheet_m"][2])),
    ),
    "propeller_translation": (Comparable("distance", _of("sheet_error"), unsigned=True),),
}


def covered(causes: list[Values], diagnosis: Values) -> tuple[Coverage, ...]:
    """The comparable parameters of every effect that was both planted and found."""
    found = []
    for cause in causes:
        effect = str(cause["effect"])
        for finding in diagnosis.get("findings", []):
            if finding.get("effect") != effect:
                continue
            parameters = finding.get("parameters", {})
            for comparable in COMPARABLE.get(effect, ()):
                given = parameters.get(comparable.parameter)
                coverage = _compare(effect, comparable, cause, given)
                if coverage is not None:
                    found.append(coverage)
    return tuple(found)


def _compare(
    effect: str, comparable: Comparable, cause: Values, given: Values | None
) -> Coverage | None:
    if given is None or given.get("low") is None or given.get("high") is None:
        return None
    try:
        truth = comparable.truth(cause)
    except KeyError:
        return None
    low, high = float(given["low"]), float(given["high"])
    if comparable.unsigned:
        truth = abs(truth)
        if low < 0.0 < high:
            low, high = 0.0, max(-low, high)
        elif high <= 0.0:
            low, high = -high, -low
    return Coverage(effect, comparable.parameter, truth, low, high)
