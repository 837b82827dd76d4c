"""Effects in the vane's equation of motion and in its angle encoder."""

from __future__ import annotations

import math
from typing import Any

from wind_sensors.diagnosis.effects.definition import Effect, Parameter, Values
from wind_sensors.simulation.drive import Drive
from wind_sensors.station.model import Angle, Instrument, Platform, Station

Entry = Instrument | Platform


def is_vane(entry: Entry, station: Station) -> bool:
    """Whether an entry has a nose that the wind turns."""
    return isinstance(entry, Angle)


def _friction(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    return {"friction_speed": math.hypot(entry.friction_speed, values["friction_speed"])}


VANE_FRICTION = Effect(
    name="vane_friction",
    meaning="The vane's bearing sticks, so that small deviations of the wind do not turn it.",
    entrance="response",
    equation="phi'' = ... - (h_f/l_v)^2 sgn(phi'); at rest while h^2 |sin(phi - alpha)| < h_f^2",
    source="K94, eq. (36), with dry friction",
    region="low speeds, small deviations",
    smooths=True,
    parameters=(
        Parameter(
            "friction_speed", "m/s", 0.0, 6.0, minimum=0.5, step=0.1, starts=(0.5, 1.0, 1.5, 2.2)
        ),
    ),
    applies=is_vane,
    update=_friction,
    noisy=True,
    templates=({"friction_speed": 0.5}, {"friction_speed": 1.2}),
    confusable={
        "stuck_sensor": "turn the vane by hand",
        "vane_damping": "low wind: friction holds the vane still, damping does not",
        "quantisation": "the steps of the reading in strong wind",
    },
)


def _inertia(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    return {"inertia_factor": entry.inertia_factor * values["inertia_factor"]}


VANE_INERTIA = Effect(
    name="vane_inertia",
    meaning="The vane is heavier (or lighter) than calibrated and swings more slowly.",
    entrance="response",
    equation="l_v^2 = factor * l_v,cal^2, damping ratio / sqrt(factor)",
    source="K94, eqs. (36) to (39)",
    region="near and above the vane's resonance, U/(2 pi l_v)",
    smooths=True,
    parameters=(
        Parameter(
            "inertia_factor", "1", 0.2, 20.0, healthy=1.0, minimum=0.4, step=0.1,
            starts=(2.0, 4.0, 8.0),
        ),
    ),
    applies=is_vane,
    update=_inertia,
    form_error=0.1,
    constant_of="swing of a vane",
    templates=({"inertia_factor": 1.4}, {"inertia_factor": 3.0}),
    confusable={
        "vane_damping": "a release test from 10 degrees",
        "low_pass_filter": "a speed sweep: the resonance moves with the wind, a filter does not",
        "timestamp_latency": "a speed sweep",
    },
)


def _damping(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    factor = values["damping_factor"]
    if values.get("viscous", 0.0) == 0.0 or factor < 1.0:
        return {"damping_factor": entry.damping_factor * factor}
    return {"viscous_damping": entry.viscous_damping + factor - 1.0}


VANE_DAMPING = Effect(
    name="vane_damping",
    meaning="The vane's swing dies out faster or more slowly than calibrated.",
    entrance="response",
    equation="zeta = factor * zeta_cal, or with an oil in the bearing, which damps by as much in "
    "any wind, zeta = zeta_cal * (1 + (factor - 1) * 8 m/s / U)",
    source="K94, eq. (40)",
    region="near the vane's resonance, U/(2 pi l_v)",
    smooths=True,
    parameters=(
        Parameter(
            "damping_factor", "1", 0.05, 20.0, healthy=1.0, minimum=0.4, step=0.1,
            starts=(0.5, 2.0, 4.0, 10.0),
        ),
        Parameter("viscous", "1", 0.0, 1.0, starts=(0.0, 1.0), value_from="forms"),
    ),
    applies=is_vane,
    update=_damping,
    form_error=0.15,
    own_law=True,
    constant_of="swing of a vane",
    templates=(
        {"damping_factor": 1.4, "viscous": 0.0},
        {"damping_factor": 0.6, "viscous": 0.0},
        {"damping_factor": 1.4, "viscous": 1.0},
    ),
    confusable={
        "vane_inertia": "a release test from 10 degrees",
        "vane_friction": "low wind: friction holds the vane still, damping does not",
        "low_pass_filter": "a speed sweep",
    },
)


def _imbalance(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    return {
        "imbalance": entry.imbalance + values["imbalance"],
        "tilt_deg": (entry.tilt_deg[0] + values["tilt_x"], entry.tilt_deg[1] + values["tilt_y"]),
    }


MOST_IMBALANCE = 20.0
"""[1/m]. The moment of mass over the moment of inertia is at most one over the radius of gyration,
for the centre of mass lies no farther out; that of the smallest vanes is five centimetres."""

SMALLEST_IMBALANCE = 0.15
"""Worth reporting on a carrier that rolls or accelerates [1/m]."""

MOST_LEAN_DEG = 6.0
"""In each direction: gravity turns a vane on a mast that looks upright. More would deflect the flow
along the vane, which is another effect."""

USUAL_IMBALANCE = 15.0
"""[1/m]. On a mast that looks upright only the product with its lean is seen: with that of a small
vane without its counterweight, leans that look upright reach as far as gravity does."""

TEMPLATE_IMBALANCE = 0.3
"""[1/m]. With leans of 3 degrees: a healthy vane's own lean is among what stands in it."""

SMALLEST_PULL = 0.45
"""Imbalance times lean worth reporting [deg/m]: the smallest imbalance at a lean of 3 degrees."""


def _has_no_attitude(drive: Drive) -> bool:
    """Whether nothing tells how the mount leans: a carrier reports it."""
    return drive.motion is None


def _has_attitude(drive: Drive) -> bool:
    return not _has_no_attitude(drive)


def _pull_of_leans(values: Values) -> dict[str, float]:
    share = TEMPLATE_IMBALANCE / USUAL_IMBALANCE
    leans = {name: share * values[name] for name in ("tilt_x", "tilt_y")}
    return {"imbalance": USUAL_IMBALANCE, **leans}


def _imbalance_size(values: Values) -> float:
    lean = math.hypot(values["tilt_x"], values["tilt_y"])
    if lean == 0.0:
        return abs(values["imbalance"]) / SMALLEST_IMBALANCE
    return abs(values["imbalance"]) * lean / SMALLEST_PULL


VANE_IMBALANCE = Effect(
    name="vane_imbalance",
    meaning="The vane's centre of mass lies off its axis, so that tilt and acceleration turn it.",
    entrance="response",
    equation="phi'' += b (-g_x sin(phi) + g_y cos(phi)); on a mast at rest only b times the lean "
    "is seen, and b is set to 15 1/m",
    source="derived: pendulum term of a vane on a leaning axis",
    region="low speeds, on a mount that leans or accelerates",
    occasional=True,
    own_days=True,
    fades=True,
    parameters=(
        Parameter(
            "imbalance", "1/m", -MOST_IMBALANCE, MOST_IMBALANCE, minimum=SMALLEST_IMBALANCE,
            step=0.05, starts=(0.5, -0.5, 2.5, -2.5), free=_has_attitude, tied=USUAL_IMBALANCE,
        ),
        Parameter(
            "tilt_x", "deg", -MOST_LEAN_DEG, MOST_LEAN_DEG, step=0.04, starts=(0.8, -0.8),
            limited=True, free=_has_no_attitude,
        ),
        Parameter(
            "tilt_y", "deg", -MOST_LEAN_DEG, MOST_LEAN_DEG, step=0.04, starts=(0.8, -0.8),
            limited=True, free=_has_no_attitude,
        ),
    ),
    applies=is_vane,
    update=_imbalance,
    templates=(
        {"imbalance": TEMPLATE_IMBALANCE, "tilt_x": 3.0, "tilt_y": 0.0},
        {"imbalance": TEMPLATE_IMBALANCE, "tilt_x": 0.0, "tilt_y": 3.0},
        {"imbalance": TEMPLATE_IMBALANCE, "tilt_x": 0.0, "tilt_y": 0.0},
    ),
    confusable={
        "vane_eccentricity": "strong wind: imbalance fades as 1/U^2, eccentricity stays",
        "vane_friction": "level the mount; balance the vane on its pivot",
    },
    tie=_pull_of_leans,
    size=_imbalance_size,
)


def _offset(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Angle)
    return {"offset_deg": entry.offset_deg + values["offset"]}


VANE_OFFSET = Effect(
    name="vane_offset",
    meaning="The vane is mounted turned, or its fin is bent: a constant angle.",
    entrance="output",
    equation="reading = phi + offset",
    source="definition",
    region="all directions and speeds alike",
    parameters=(
        Parameter(
            "offset", "deg", -200.0, 200.0, minimum=1.0, step=0.3, starts=(90.0, -90.0, 180.0),
            sense="counter-clockwise positive",
        ),
    ),
    applies=is_vane,
    update=_offset,
    exact=True,
    templates=({"offset": 1.0},),
    confusable={
        "frame_error": "sight the vane's mark along the keel; turning the mount",
        "heading_deviation": "a full circle: a compass error changes with the heading",
        "vane_eccentricity": "wind from other directions",
    },
)


def _eccentricity(entry: Entry, values: Values) -> dict[str, Any]:
    amplitude = math.hypot(values["sine"], values["cosine"])
    phase = math.degrees(math.atan2(-values["cosine"], values["sine"]))
    return {"eccentricity_deg": amplitude, "eccentricity_phase_deg": phase}


def _eccentricity_size(values: Values) -> float:
    return math.hypot(values["sine"], values["cosine"]) / 1.0


VANE_ECCENTRICITY = Effect(
    name="vane_eccentricity",
    meaning="The encoder's disc is off centre: a reading error once per turn of the vane.",
    entrance="output",
    equation="reading = phi + s sin(phi) + c cos(phi)",
    source="geometry of an eccentric disc, first order",
    region="with the vane's heading",
    parameters=(
        Parameter("sine", "deg", -30.0, 30.0, minimum=1.0, step=0.3),
        Parameter("cosine", "deg", -30.0, 30.0, minimum=1.0, step=0.3),
    ),
    applies=is_vane,
    update=_eccentricity,
    templates=({"sine": 1.0, "cosine": 0.0}, {"sine": 0.0, "cosine": 1.0}),
    confusable={
        "vane_offset": "wind from other directions",
        "heading_deviation": "turning the mount under a steady wind",
        "vane_imbalance": "strong wind",
    },
    goes_with_direction=True,
    needs=("a vane that turns by some 60 degrees",),
    size=_eccentricity_size,
)


def _gap(entry: Entry, values: Values) -> dict[str, Any]:
    return {
        "gap_centre_deg": values["centre"],
        "gap_width_deg": values["width"],
        "gap_reading_deg": (None, values["reading"], "floating")[round(values["form"])],
    }


POTENTIOMETER_GAP = Effect(
    name="potentiometer_gap",
    meaning="The potentiometer has a dead gap: there the reading stays at the gap's edge, falls "
    "to one value, or floats.",
    entrance="output",
    equation="reading = nearest edge, one value or any while |phi - centre| < width/2",
    source="construction of a potentiometer",
    region="one narrow sector of headings",
    standing=0.0,
    occasional=True,
    sector="centre",
    parameters=(
        Parameter("centre", "deg", -540.0, 540.0, healthy=None, step=0.5, wraps=360.0),
        Parameter(
            "width", "deg", 0.0, 90.0, minimum=4.0, step=1.0, starts=(10.0, 20.0), told_to=0.3
        ),
        Parameter("reading", "deg", -540.0, 540.0, healthy=None, step=2.0, wraps=360.0),
        Parameter("form", "1", 0.0, 2.0, healthy=None, value_from="forms"),
    ),
    applies=is_vane,
    update=_gap,
    noisy=True,
    templates=tuple(
        {"centre": float(c), "width": 12.0, "reading": 0.0, "form": 0.0}
        for c in range(-180, 180, 10)
    ),
    confusable={"stuck_sensor": "wind from other directions", "vane_friction": "strong wind"},
    needs=("a vane that crosses the gap",),
)


def _quantisation(entry: Entry, values: Values) -> dict[str, Any]:
    return {"quantisation_deg": values["step"], "quantisation_origin_deg": values["origin"]}


QUANTISATION = Effect(
    name="quantisation",
    meaning="The reading comes in steps.",
    entrance="output",
    equation="reading = origin + step * round((phi - origin) / step)",
    source="definition",
    region="all, in the histogram of the readings",
    standing=0.0,
    parameters=(
        Parameter("step", "deg", 0.0, 95.0, minimum=2.0, step=0.5, value_from="signals"),
        Parameter("origin", "deg", -360.0, 360.0, healthy=None, value_from="signals"),
    ),
    applies=is_vane,
    update=_quantisation,
    exact=True,
    noisy=True,
    unmistakable=True,
    templates=({"step": 5.0, "origin": 0.0}, {"step": 22.5, "origin": 0.0}),
    confusable={"vane_friction": "strong wind: friction fades, steps stay"},
)


def _low_pass(entry: Entry, values: Values) -> dict[str, Any]:
    return {"filter_time_constant": values["time_constant"]}


LOW_PASS_FILTER = Effect(
    name="low_pass_filter",
    meaning="A filter in the electronics smooths and delays the angle.",
    entrance="output",
    equation="tau d(reading)/dt + reading = phi",
    source="first-order filter",
    region="high frequencies, the same at all wind speeds",
    smooths=True,
    parameters=(
        Parameter("time_constant", "s", 0.0, 20.0, minimum=0.1, step=0.05, starts=(0.3, 1.0, 3.0)),
    ),
    applies=is_vane,
    update=_low_pass,
    form_error=0.1,
    templates=({"time_constant": 0.1}, {"time_constant": 0.5}),
    confusable={
        "timestamp_latency": "amplitudes: a filter damps what a delay only shifts",
        "vane_inertia": "a speed sweep: the lag of inertia is a length, of a filter a time",
        "vane_damping": "a speed sweep",
    },
)


def _reversed(entry: Entry, values: Values) -> dict[str, Any]:
    return {"reversed": values["reversed"] > 0.5}


SENSOR_SWAP = Effect(
    name="sensor_swap",
    meaning="Wires are exchanged: the angle counts the wrong way round.",
    entrance="output",
    equation="reading = -phi",
    source="definition",
    region="all directions",
    standing=0.0,
    parameters=(Parameter("reversed", "1", 0.0, 1.0, minimum=0.6, value_from="forms"),),
    applies=is_vane,
    update=_reversed,
    exact=True,
    templates=({"reversed": 1.0},),
    confusable={"vane_offset": "turn the vane by hand and watch the reading"},
)

EFFECTS = (
    VANE_FRICTION,
    VANE_INERTIA,
    VANE_DAMPING,
    VANE_IMBALANCE,
    VANE_OFFSET,
    VANE_ECCENTRICITY,
    POTENTIOMETER_GAP,
    QUANTISATION,
    LOW_PASS_FILTER,
    SENSOR_SWAP,
)
