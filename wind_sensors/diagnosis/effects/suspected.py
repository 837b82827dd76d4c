"""Faults that have no identifier in the catalogue.

They are never named. Where one of them explains a recording better than the effect that would be
named, that name is withdrawn, and the unknown is described by it. What each can be mistaken for
stands in its `confusable`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from wind_sensors.diagnosis.effects.definition import Effect, Parameter, Values
from wind_sensors.diagnosis.effects.vane import is_vane
from wind_sensors.station.model import (
    Angle,
    Instrument,
    Platform,
    Rotor,
    Station,
    Vane,
    WakeShadow,
)

Entry = Instrument | Platform


def _play(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    return {"play_deg": entry.play_deg + values["play"]}


PLAY = Effect(
    name="play",
    meaning="play between vane and sensor",
    entrance="output",
    equation="the reading rests until the vane has turned back by the play",
    source="hysteresis of a coupling with a free angle",
    region="whenever the vane turns back, in any wind",
    parameters=(Parameter("play", "deg", 0.0, 40.0, minimum=1.0, step=0.3),),
    applies=is_vane,
    update=_play,
    noisy=True,
    smooths=True,
    templates=({"play": 1.0}, {"play": 3.0}, {"play": 8.0}, {"play": 20.0}),
    confusable={
        "vane_friction": "strong wind: friction fades, play stays",
        "vane_damping": "turn the vane to and fro by hand",
        "vane_inertia": "turn the vane to and fro by hand",
        "low_pass_filter": "turn the vane to and fro by hand, slowly",
        "timestamp_latency": "turn the vane to and fro by hand, slowly",
    },
)


def _slew_limit(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    return {"slew_limit_deg_s": values["fastest"]}


SLEW_LIMIT = Effect(
    name="slew_limit",
    meaning="a reading that may only turn so fast",
    entrance="output",
    equation="|d reading/dt| <= fastest",
    source="a logger or a driver that refuses jumps",
    region="quick turns; slow ones pass",
    parameters=(Parameter("fastest", "deg/s", 1.0, 400.0, healthy=None, step=1.0),),
    applies=is_vane,
    update=_slew_limit,
    noisy=True,
    smooths=True,
    templates=({"fastest": 6.0}, {"fastest": 15.0}, {"fastest": 40.0}),
    confusable={
        "low_pass_filter": "a jump of the vane by hand: a straight ramp, not a bend",
        "vane_damping": "a jump of the vane by hand",
        "vane_inertia": "a jump of the vane by hand",
        "vane_friction": "a jump of the vane by hand",
    },
)


def _catch(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Vane)
    return {
        "catch_speed": values["catch_speed"],
        "catch_heading_deg": values["heading"],
        "catch_width_deg": values["width"],
    }


def _turns_about_the_vertical(entry: Entry, station: Station) -> bool:
    return isinstance(entry, Vane)


CATCH = Effect(
    name="catch",
    meaning="a bearing that catches at one heading",
    entrance="response",
    equation="friction h_f^2 + h_c^2 exp(-x^2/2), x = (phi - heading)/width",
    source="a dent or dirt in the race of the vane's bearing",
    region="about one heading of the vane, in weak wind",
    parameters=(
        Parameter("catch_speed", "m/s", 0.0, 8.0, minimum=0.5, step=0.1),
        Parameter("heading", "deg", -180.0, 180.0, healthy=None, step=1.0, wraps=360.0),
        Parameter("width", "deg", 1.0, 20.0, healthy=None, step=0.5),
    ),
    applies=_turns_about_the_vertical,
    update=_catch,
    smooths=True,
    templates=tuple(
        {"catch_speed": speed, "heading": heading, "width": width}
        for speed in (1.5, 3.0)
        for width in (8.0, 16.0)
        for heading in np.arange(-180.0, 180.0, 20.0).tolist()
    ),
    confusable={
        "vane_friction": "turn the vane by hand: it catches at one heading only",
    },
)


def _soft_fin(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Vane)
    return {"fin_yield_speed": values["yield_speed"]}


SOFT_FIN = Effect(
    name="soft_fin",
    meaning="a fin that gives way to the wind",
    entrance="response",
    equation="stiffness and damping / (1 + U^2/U_y^2)",
    source="deflection of an elastic fin under the dynamic pressure, first order",
    region="near the vane's resonance in strong wind; in weak wind nothing",
    parameters=(Parameter("yield_speed", "m/s", 1.5, 40.0, healthy=None, step=0.2),),
    applies=_turns_about_the_vertical,
    update=_soft_fin,
    smooths=True,
    templates=({"yield_speed": 4.0}, {"yield_speed": 8.0}, {"yield_speed": 15.0}),
    confusable={
        "vane_inertia": "a release test in weak wind and in strong wind",
        "vane_damping": "a release test in weak wind and in strong wind",
        "low_pass_filter": "bend the fin by hand; a release test in weak wind",
        "air_density": "a barometer; a release test in weak wind",
    },
)


def _cable(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Vane)
    return {"cable_speed": values["speed"], "cable_rest_deg": values["rest"]}


CABLE = Effect(
    name="cable",
    meaning="a cable that the vane winds up",
    entrance="response",
    equation="torque -(h_k/l_v)^2 (phi - phi_k)",
    source="torsion of a cable or of a spring, linear in the angle",
    region="headings far from the one at rest, in weak wind",
    parameters=(
        Parameter("speed", "m/s", 0.0, 8.0, minimum=0.9, step=0.1),
        Parameter("rest", "deg", -1080.0, 1080.0, healthy=None, step=3.0),
    ),
    applies=_turns_about_the_vertical,
    update=_cable,
    templates=tuple(
        {"speed": speed, "rest": rest}
        for speed in (0.7, 1.2, 2.0)
        for rest in np.arange(-180.0, 180.0, 30.0).tolist()
    ),
    confusable={
        "vane_imbalance": "lean the mast the other way: gravity follows, the cable does not",
        "vane_eccentricity": "turn the vane by hand and let go of it in still air",
        "vane_offset": "turn the vane by hand and let go of it in still air",
        "heading_deviation": "turn the vane by hand and let go of it in still air",
    },
)

ARMS = 3
"""Of a sonic's head, evenly spaced."""


def _shaded_reference(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    # The instruments are simulated in the reference's wind: where that reads low, they turn faster.
    gains = tuple(
        WakeShadow.model_construct(
            bearing_from_deg=values["bearing_from"] + 360.0 / ARMS * i,
            depth=-values["depth"],
            width_deg=values["width"],
        )
        for i in range(ARMS)
    )
    return {"wake_shadows": (*entry.wake_shadows, *gains)}


REFERENCE_SHADOW = Effect(
    name="reference_shadow",
    meaning="a reference in the shadow of its own three arms",
    entrance="wind",
    equation="U_ref = U / (1 + depth sum exp(-(D - D_i)^2 / (2 width^2))), D_i 120 deg apart",
    source="transducer shadows of sonic anemometers, as Gaussian wakes; IEC 61400-12-1, annex on "
    "mast influence",
    region="three sectors of wind directions, all speeds",
    standing=0.06,
    parameters=(
        Parameter("bearing_from", "deg", -720.0, 720.0, healthy=None, step=1.0, wraps=120.0),
        Parameter("depth", "1", 0.0, 0.4, minimum=0.02),
        Parameter("width", "deg", 5.0, 25.0, healthy=None, step=0.5),
    ),
    applies=lambda entry, station: isinstance(entry, Rotor),
    update=_shaded_reference,
    everywhere=True,
    templates=tuple(
        {"bearing_from": bearing, "depth": 0.05, "width": 15.0}
        for bearing in np.arange(0.0, 120.0, 15.0).tolist()
    ),
    confusable={
        "flow_distortion": "turn the reference on its mount: the sectors turn with it",
        "wake_shadow": "turn the reference on its mount: the sectors turn with it",
        "calibration_drift": "turn the reference on its mount",
        "calibration_offset": "turn the reference on its mount",
    },
)

SUSPECTS = (PLAY, SLEW_LIMIT, CATCH, SOFT_FIN, CABLE, REFERENCE_SHADOW)
"""All of them, in the order in which they are tried."""
