"""Effects between the shaft and the stamp: pulses, outages, clocks."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

from wind_sensors.diagnosis.effects.definition import Effect, Parameter, Values
from wind_sensors.station.losses import LOSS_SPEED
from wind_sensors.station.model import (
    Angle,
    Clock,
    Electronics,
    Instrument,
    Outage,
    Platform,
    Rotor,
    Station,
)

Entry = Instrument | Platform


def _is_rotor(entry: Entry, station: Station) -> bool:
    return isinstance(entry, Rotor)


def _is_sensor(entry: Entry, station: Station) -> bool:
    return isinstance(entry, Rotor | Angle)


def _electronics(entry: Entry, **keys: Any) -> dict[str, Electronics]:
    assert isinstance(entry, Rotor)
    return {"electronics": entry.electronics.model_copy(update=keys)}


def _missed(entry: Entry, values: Values) -> dict[str, Any]:
    return _electronics(
        entry,
        dead_time=values["dead_time"],
        loss_probability=values["loss_probability"],
        loss_growth=values["loss_growth"],
    )


def _missed_size(values: Values) -> float:
    in_wind = values["loss_probability"] * (10.0 / LOSS_SPEED) ** values["loss_growth"]
    return float(max(values["dead_time"] / 0.001, in_wind / 0.01))


MISSED_PULSES = Effect(
    name="missed_pulses",
    meaning="Pulses are lost: those that follow too soon on the last one, or some at random, "
    "with a weak pick-up the more the faster the rotor turns.",
    entrance="output",
    equation="an edge is lost if it comes within the dead time of the last accepted one, "
    "or with the loss probability (indicated speed / 5 m/s)^loss_growth",
    source="counter with a non-paralysable dead time",
    region="high rotor rates; doubled pulse intervals",
    standing=0.0,
    parameters=(
        Parameter("dead_time", "s", 0.0, 0.5, minimum=0.001, step=0.0005, spare=True),
        Parameter("loss_probability", "1", 0.0, 0.9, minimum=0.01, step=0.003, spare=True),
        Parameter("loss_growth", "1", 0.0, 4.0, step=0.2, spare=True),
    ),
    applies=_is_rotor,
    update=_missed,
    noisy=True,
    # Which pulses of a turn come within a dead time hangs on hundredths of a millisecond.
    loose_statistics=frozenset(
        {
            "beat of the pulses with the wind, once per turn",
            "beat of the pulses with the wind, twice per turn",
        }
    ),
    templates=(
        {"dead_time": 0.0, "loss_probability": 0.01, "loss_growth": 0.0},
    ),
    confusable={
        "calibration_drift": "pulse intervals: lost pulses double some of them",
        "encoder_slot_error": "pulse intervals against rotor angle",
    },
    size=_missed_size,
)


def _extra(entry: Entry, values: Values) -> dict[str, Any]:
    return _electronics(
        entry,
        bounce_probability=values["bounce_probability"],
        bounce_delay=values["bounce_delay"],
    )


EXTRA_PULSES = Effect(
    name="extra_pulses",
    meaning="A bouncing contact adds false pulses shortly after true ones.",
    entrance="output",
    equation="with the bounce probability a second edge follows, at any time up to twice the "
    "bounce delay",
    source="contact bounce of a reed switch",
    region="very short pulse intervals, all speeds",
    standing=0.0,
    parameters=(
        Parameter("bounce_probability", "1", 0.0, 1.0, minimum=0.01, step=0.003, starts=(0.02,)),
        Parameter("bounce_delay", "s", 0.0002, 0.1, healthy=None, step=0.0005),
    ),
    applies=_is_rotor,
    update=_extra,
    noisy=True,
    one_by_one=True,
    form_error=0.1,
    templates=({"bounce_probability": 0.01, "bounce_delay": 0.003},),
    confusable={"calibration_drift": "pulse intervals: bounce makes some very short"},
)


_GOLDEN = 0.6180339887
_NO_PATTERN = 1e-6


def _in_and_besides(displacements: Sequence[float]) -> tuple[complex, list[complex], list[float]]:
    """The swing of the slots' displacements once per turn, its waves, and what is left."""
    n = len(displacements)
    waves = [cmath.exp(2j * math.pi * k / n) for k in range(n)]
    middle = sum(displacements) / n
    swing = 2.0 * sum((d - middle) * w for d, w in zip(displacements, waves, strict=True)) / n
    besides = [
        d - middle - (swing * w.conjugate()).real
        for d, w in zip(displacements, waves, strict=True)
    ]
    return swing, waves, besides


def slot_values(displacements: Sequence[float]) -> dict[str, float]:
    """Values of `encoder_slot_error` for slots whose places the pulses tell.

    Args:
        displacements: Of each slot from its place, in slot widths.
    """
    swing, _, besides = _in_and_besides(displacements)
    return {
        "scatter": math.sqrt(sum(d * d for d in besides) / len(besides)),
        "once_per_turn": abs(swing),
        **{f"slot_{k}": float(d) for k, d in enumerate(displacements)},
    }


def _slots(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    n = entry.pulses_per_revolution
    told = "slot_0" in values
    # Small errors act alike, wherever they are; of large ones and passing ones the slots matter.
    swing, waves, besides = _in_and_besides(
        [values[f"slot_{k}"] for k in range(n)]
        if told
        else [math.cos(2.0 * math.pi * (_GOLDEN * k * k + 0.1)) for k in range(n)]
    )
    size = math.sqrt(sum(d * d for d in besides) / n)
    scatter = values["scatter"] / size if size > _NO_PATTERN else 0.0
    towards = swing / abs(swing) if told and abs(swing) > _NO_PATTERN else 1.0
    errors = tuple(
        scatter * d + values["once_per_turn"] * (w * towards.conjugate()).real
        for d, w in zip(besides, waves, strict=True)
    )
    return _electronics(entry, slot_errors=errors)


def _slots_size(values: Values) -> float:
    return math.hypot(values["scatter"], values["once_per_turn"] / math.sqrt(2.0)) / 0.012


ENCODER_SLOT_ERROR = Effect(
    name="encoder_slot_error",
    meaning="The slots of the pulse disc are not evenly spaced, or the disc is off centre.",
    entrance="output",
    equation="edge of slot k at (k + error_k) 2 pi / n; error_k: rms `scatter`, besides "
    "once_per_turn cos(2 pi k / n)",
    source="geometry of the disc",
    region="pulse intervals against rotor angle, all speeds alike",
    standing=0.0,
    parameters=(
        Parameter("scatter", "1", 0.0, 0.5, minimum=0.012, step=0.004, value_from="signals"),
        Parameter("once_per_turn", "1", 0.0, 0.5, minimum=0.017, step=0.004, value_from="signals"),
    ),
    applies=lambda entry, station: isinstance(entry, Rotor) and entry.pulses_per_revolution > 2,
    update=_slots,
    templates=({"scatter": 0.02, "once_per_turn": 0.0}, {"scatter": 0.0, "once_per_turn": 0.02}),
    confusable={
        "damaged_cup": "turn the rotor by hand: slot errors stay, the torque does not; wind from "
        "other directions",
        "missed_pulses": "pulse intervals against rotor angle",
    },
    size=_slots_size,
)


def _outage(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Instrument)
    known = values.get("known", 0.0) > 0.5
    outage = Outage.model_construct(
        start=values["start"],
        stop=values["stop"],
        reading_deg=values["reading"] if known else None,
    )
    return {"outages": (*entry.outages, outage)}


STUCK_SENSOR = Effect(
    name="stuck_sensor",
    meaning="The sensor repeats its last value, or falls silent, for a while.",
    entrance="output",
    equation="reading(t) = const for start < t < stop",
    source="definition",
    region="one interval of time",
    standing=0.0,
    occasional=True,
    silences=True,
    parameters=(
        Parameter("start", "s", -1.0, 1e6, healthy=None, step=0.2, value_from="signals"),
        Parameter("stop", "s", 0.0, 1e6, healthy=None, step=0.2, value_from="signals"),
        Parameter("reading", "deg", -540.0, 540.0, healthy=None, value_from="signals"),
        Parameter("known", "1", 0.0, 1.0, healthy=None, value_from="signals"),
    ),
    applies=_is_sensor,
    update=_outage,
    exact=True,
    templates=(),
    confusable={
        "vane_friction": "turn the vane by hand",
        "bearing_friction": "turn the rotor by hand",
    },
    size=lambda values: max(values["stop"] - values["start"], 0.0) / 10.0,
)


def _clock(entry: Entry, **keys: float) -> dict[str, Any]:
    assert isinstance(entry, Instrument | Platform)
    return {"clock": entry.clock.model_copy(update=keys)}


def _latency(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Instrument | Platform)
    return {
        "clock": Clock.model_construct(
            latency=entry.clock.latency + values["latency"], drift=entry.clock.drift
        )
    }


TIMESTAMP_LATENCY = Effect(
    name="timestamp_latency",
    meaning="Stamps come late by a constant time.",
    entrance="clock",
    own_days=True,
    equation="stamp = time of measurement + latency",
    source="definition",
    region="phase of the cross-spectrum, in proportion to frequency",
    smooths=True,
    parameters=(
        Parameter("latency", "s", -60.0, 60.0, minimum=0.1, step=0.05, starts=(0.3, 1.0, -0.5)),
    ),
    applies=_is_sensor,
    update=_latency,
    exact=True,
    templates=({"latency": 0.15}, {"latency": 0.6}),
    confusable={
        "rotor_inertia": "a speed sweep: the lag of inertia is a length, of a clock a time",
        "vane_inertia": "a speed sweep",
        "low_pass_filter": "amplitudes: a filter damps what a delay only shifts",
        "clock_drift": "a longer record: the lag of a drift grows",
    },
)


def _drift(entry: Entry, values: Values) -> dict[str, Any]:
    return _clock(entry, drift=values["drift"] * 1e-6)


CLOCK_DRIFT = Effect(
    name="clock_drift",
    meaning="The clock that stamps the signals runs fast or slow.",
    entrance="clock",
    own_days=True,
    equation="stamp = time of measurement * (1 + drift)",
    source="definition",
    region="a lag that grows with the length of the record",
    smooths=True,
    parameters=(
        Parameter(
            "drift", "ppm", -20000.0, 20000.0, minimum=300.0, step=50.0,
            starts=(1000.0, -1000.0, 3000.0, -3000.0),
        ),
    ),
    applies=_is_sensor,
    update=_drift,
    shared=True,
    exact=True,
    templates=({"drift": 500.0},),
    confusable={"timestamp_latency": "a longer record: the lag of a drift grows"},
)

EFFECTS = (
    MISSED_PULSES,
    EXTRA_PULSES,
    ENCODER_SLOT_ERROR,
    STUCK_SENSOR,
    TIMESTAMP_LATENCY,
    CLOCK_DRIFT,
)
