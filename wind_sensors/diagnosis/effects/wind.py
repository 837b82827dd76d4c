"""Effects on the wind at the sensor: what stands in the way of the air."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect, Parameter, Values
from wind_sensors.station.model import (
    Angle,
    FlowDistortion,
    Instrument,
    Platform,
    Rotor,
    Station,
    WakeShadow,
)

Entry = Instrument | Platform


def _is_rotor(entry: Entry, station: Station) -> bool:
    return isinstance(entry, Rotor)


def _shadow(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Instrument)
    shadow = WakeShadow.model_construct(
        bearing_from_deg=values["bearing_from"],
        depth=values["depth"],
        width_deg=values["width"],
        flank=values["flank"],
    )
    return {"wake_shadows": (*entry.wake_shadows, shadow)}


WIDEST_WAKE = 25.0
"""Bound of a wake's width [deg]: a lobe of a flow past a mast, which comes twice in a circle, is as
wide as this or wider."""

WAKE_SHADOW = Effect(
    name="wake_shadow",
    meaning="The wind from one bearing reaches the rotor through the wake of an obstacle.",
    entrance="wind",
    equation="U' = U (1 - depth exp(-x^2 / 2) + flank exp(-(|x| - 2.8)^2 / 2)), "
    "x = (D - D0) / width",
    source="Gaussian wake profile; IEC 61400-12-1, annex on mast influence",
    region="a sector of wind directions, all speeds",
    standing=0.06,
    occasional=True,
    sector="bearing_from",
    stirs=True,
    parameters=(
        Parameter("bearing_from", "deg", -720.0, 720.0, healthy=None, step=1.0, wraps=360.0),
        Parameter("depth", "1", 0.0, 0.95, minimum=0.05),
        Parameter("width", "deg", 3.0, WIDEST_WAKE, healthy=None, step=0.5),
        Parameter("flank", "1", -0.1, 0.3, step=0.01),
    ),
    applies=_is_rotor,
    update=_shadow,
    templates=tuple(
        {"bearing_from": float(bearing), "depth": 0.05, "width": width, "flank": 0.0}
        for width, step in ((8.0, 10), (20.0, 20))
        for bearing in range(0, 360, step)
    ),
    confusable={
        "flow_distortion": "wind from the neighbouring sectors: a wake ends within some 30 degrees",
        "calibration_drift": "wind from other directions: a changed calibration shows in all",
    },
    needs=("a wind that turns through the sector",),
)


def _distortion(entry: Entry, values: Values) -> dict[str, Any]:
    return {
        "flow_distortion": FlowDistortion.model_construct(
            cosine_1=values["cosine_1"],
            sine_1=values["sine_1"],
            cosine_2=values["cosine_2"],
            sine_2=values["sine_2"],
            deflection=values["deflection"],
        )
    }


_DIRECTIONS = np.radians(np.arange(0.0, 360.0, 5.0))


SMALLEST_DISTORTION = 0.02
"""Change of the speed in some direction that is worth reporting."""


def _distortion_size(values: Values) -> float:
    change = (
        values["cosine_1"] * np.cos(_DIRECTIONS)
        + values["sine_1"] * np.sin(_DIRECTIONS)
        + values["cosine_2"] * np.cos(2.0 * _DIRECTIONS)
        + values["sine_2"] * np.sin(2.0 * _DIRECTIONS)
    )
    return float(np.abs(change).max()) / SMALLEST_DISTORTION


_HARMONICS = ("cosine_1", "sine_1", "cosine_2", "sine_2")

FLOW_DISTORTION = Effect(
    name="flow_distortion",
    meaning="The mount speeds the flow up, slows it down and turns it, smoothly with direction.",
    entrance="wind",
    equation="U' = U (1 + c1 cos T + s1 sin T + c2 cos 2T + s2 sin 2T), T the direction from; "
    "turned by -d (c1 sin T - s1 cos T + c2 sin 2T - s2 cos 2T)",
    source="Fourier series of the potential flow around a cylinder",
    region="all directions, smoothly",
    standing=0.06,
    parameters=(
        *(Parameter(name, "1", -0.3, 0.3, minimum=SMALLEST_DISTORTION) for name in _HARMONICS),
        Parameter("deflection", "1", -1.5, 1.5, healthy=None, step=0.2, starts=(0.0,)),
    ),
    applies=lambda entry, station: isinstance(entry, Rotor | Angle),
    update=_distortion,
    goes_with_direction=True,
    everywhere=True,
    templates=tuple(
        {**{other: 0.02 if other == name else 0.0 for other in _HARMONICS}, "deflection": 1.0}
        for name in _HARMONICS
    ),
    confusable={
        "wake_shadow": "wind from the neighbouring sectors: a distortion does not end",
        "calibration_drift": "wind from other directions: a changed calibration shows in all",
        "axis_tilt": "a spirit level on the mount; stronger vertical wind",
    },
    needs=("a wind that turns by some 60 degrees",),
    size=_distortion_size,
    # Potential flow past a cylinder, one radius off its surface, changes the speed by a quarter.
    # What a narrow sector shows may ask for more in directions that no wind came from.
    largest=0.3 / SMALLEST_DISTORTION,
)


def _tilt(entry: Entry, values: Values) -> dict[str, Any]:
    return {"tilt_deg": (values["tilt_x"], values["tilt_y"])}


def _tilt_size(values: Values) -> float:
    return math.hypot(values["tilt_x"], values["tilt_y"]) / 3.0


AXIS_TILT = Effect(
    name="axis_tilt",
    meaning="The rotor's axis leans, so that vertical wind and the cosine of the lean enter.",
    entrance="wind",
    equation="wind in rotor axes = R(tilt) wind; the angular response does the rest",
    source="K94, eq. (2); K14, eqs. (83), (84)",
    region="with the vertical wind, opposite for wind from opposite sides",
    parameters=(
        Parameter("tilt_x", "deg", -60.0, 60.0, minimum=3.0, step=0.5),
        Parameter("tilt_y", "deg", -60.0, 60.0, minimum=3.0, step=0.5),
    ),
    applies=lambda entry, station: (
        isinstance(entry, Rotor | Angle) and not getattr(entry, "mounted_on", "")
    ),
    update=_tilt,
    everywhere=True,
    even=True,
    templates=({"tilt_x": 3.0, "tilt_y": 0.0}, {"tilt_x": 0.0, "tilt_y": 3.0}),
    confusable={
        "flow_distortion": "a spirit level on the mount",
        "angular_response": "a spirit level on the mount; wind from the opposite side",
    },
    size=_tilt_size,
)


EFFECTS = (WAKE_SHADOW, FLOW_DISTORTION, AXIS_TILT)
