"""Effects in the rotor's calibration and equation of motion."""

from __future__ import annotations

from typing import Any

from wind_sensors.diagnosis.effects.definition import Effect, Parameter, Values
from wind_sensors.instruments.dynamics.rotor import STALL_SLIP
from wind_sensors.station.model import Angle, Cup, Instrument, Platform, Propeller, Rotor, Station

Entry = Instrument | Platform


def _is_rotor(entry: Entry, station: Station) -> bool:
    return isinstance(entry, Rotor)


def _set(*names: str) -> Any:
    """Update that writes parameters into keys of the same name."""

    def update(entry: Entry, values: Values) -> dict[str, Any]:
        return {name: values[name] for name in names}

    return update


def _gain(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    return {"calibration_gain": entry.calibration_gain * values["gain"]}


CALIBRATION_DRIFT = Effect(
    name="calibration_drift",
    meaning="The rotor turns faster or slower than calibrated, by a constant factor.",
    entrance="response",
    equation="l S = gain * U - U0",
    source="K14, eq. (58)",
    region="all speeds, in proportion",
    # Another number of pulses a turn, or knots for m/s, are errors of 0.25 to 4.
    parameters=(Parameter("gain", "1", 0.15, 6.0, healthy=1.0, minimum=0.01, step=0.004),),
    applies=_is_rotor,
    update=_gain,
    exact=True,
    templates=({"gain": 1.01},),
    confusable={
        "calibration_offset": "a speed sweep: a gain grows with speed, an offset does not",
        "air_density": "a temperature or pressure swing",
        "icing": "temperature; look at the cups",
        "angular_response": "a wind with less vertical turbulence",
        "torque_asymmetry": "a steadier wind: overspeeding needs turbulence",
    },
)


def _offset(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    return {"calibration_offset": entry.calibration_offset + values["offset"]}


CALIBRATION_OFFSET = Effect(
    name="calibration_offset",
    meaning="The rotor reads too much or too little by a constant speed.",
    entrance="response",
    equation="l S = U - U0 + offset",
    source="K14, eq. (58)",
    region="all speeds alike, in relative terms at low speed",
    # Too much by a metre and more would be a rotor that turns in a calm.
    parameters=(Parameter("offset", "m/s", -3.0, 1.2, minimum=0.08, step=0.02),),
    applies=_is_rotor,
    update=_offset,
    templates=({"offset": 0.08},),
    confusable={
        "bearing_friction": "a speed sweep: friction fades as 1/U, an offset stays",
        "calibration_drift": "a speed sweep",
    },
)


def _friction(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    return {
        "friction_speed": (entry.friction_speed**2 + values["friction_speed"] ** 2) ** 0.5,
        "friction_temperature_coefficient": values["temperature_coefficient"],
        "friction_breakaway": values.get("breakaway", 1.0),
    }


BEARING_FRICTION = Effect(
    name="bearing_friction",
    meaning="The bearing brakes the rotor with a torque that does not depend on the wind.",
    entrance="response",
    equation="l0 dy/dt = (U - y)(a4 U + (1 - a4) y) - U_s^2 exp(c (T - T0)); "
    "steady y = U - U_s^2/U; towards rest a cup's friction rises to `breakaway` times as much, "
    "as exp(-(y / 1 m/s)^2), and a propeller's torque falls to as small a part, as its blades "
    f"stall at {100.0 * STALL_SLIP:.0f} % slip",
    source="J80, eqs. (5), (6)",
    region="low speeds; the rotor stalls below U_s",
    occasional=True,
    brakes=True,
    parameters=(
        Parameter(
            "friction_speed", "m/s", 0.0, 6.0, minimum=0.3, step=0.1, starts=(0.5, 1.0, 2.0)
        ),
        Parameter(
            "temperature_coefficient", "1/K", -0.4, 0.05, step=0.005, swing=3.0,
            starts=(-0.05, -0.12),
        ),
        Parameter("breakaway", "1", 1.0, 10.0, healthy=1.0, value_from="forms"),
    ),
    applies=_is_rotor,
    update=_friction,
    standing_in_calm=0.8,
    sticks=lambda values: values["breakaway"] > 1.0,
    templates=({"friction_speed": 0.5, "temperature_coefficient": 0.0, "breakaway": 1.0},),
    confusable={
        "calibration_offset": "a speed sweep: friction fades as 1/U, an offset stays",
        "calibration_drift": "a speed sweep",
        "icing": "a run-down test by hand in still air",
    },
)


def _density(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor | Angle)
    return {"reference_density": entry.reference_density / values["density_ratio"]}


AIR_DENSITY = Effect(
    name="air_density",
    meaning="The air is lighter or denser than in the calibration, and the response not corrected.",
    entrance="response",
    equation="l0 = l0_cal / ratio, ratio = rho / rho_cal; friction weighs 1 / ratio as much",
    source="K94, eq. (6)",
    region="with temperature and pressure; response length and low speeds",
    smooths=True,
    parameters=(
        Parameter(
            "density_ratio", "1", 0.2, 2.5, healthy=1.0, minimum=0.1, step=0.04,
            starts=(0.4, 0.6, 0.8, 1.25, 1.6),
        ),
    ),
    applies=lambda entry, station: isinstance(entry, Rotor | Angle),
    update=_density,
    everywhere=True,
    form_error=0.1,
    templates=({"density_ratio": 0.9},),
    confusable={
        "rotor_inertia": "a temperature or pressure swing",
        "calibration_drift": "a temperature or pressure swing",
    },
)


def _inertia(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    return {"inertia_factor": entry.inertia_factor * values["inertia_factor"]}


ROTOR_INERTIA = Effect(
    name="rotor_inertia",
    meaning="The rotor is heavier (or lighter) than calibrated and answers gusts late.",
    entrance="response",
    equation="l0 = factor * l0_cal",
    source="K94, eqs. (6), (8)",
    region="high frequencies; k l0 near and above 1",
    smooths=True,
    parameters=(
        Parameter(
            "inertia_factor", "1", 0.2, 12.0, healthy=1.0, minimum=0.3, step=0.1,
            starts=(1.5, 3.0, 6.0),
        ),
    ),
    applies=_is_rotor,
    update=_inertia,
    form_error=0.15,
    standing_in_calm=0.8,
    templates=({"inertia_factor": 1.3},),
    confusable={
        "timestamp_latency": "a speed sweep: the lag of inertia is a length, of a clock a time",
        "low_pass_filter": "a speed sweep: the lag of inertia is a length, of a filter a time",
        "air_density": "a temperature or pressure swing",
    },
)

TORQUE_ASYMMETRY = Effect(
    name="torque_asymmetry",
    meaning="The rotor speeds up more readily than it slows down, otherwise than assumed.",
    entrance="response",
    equation="l0 dy/dt = (A - y)(a4 A + (1 - a4) y)",
    source="K94, eqs. (1), (2); K14, eq. (76)",
    region="mean speed and skewness in strong turbulence",
    smooths=True,
    shifts=True,
    parameters=(
        Parameter("a4", "1", 0.05, 2.9, healthy=1.0, minimum=0.4, step=0.1, starts=(2.0,)),
    ),
    applies=lambda entry, station: isinstance(entry, Rotor),
    update=_set("a4"),
    form_error=0.15,
    templates=({"a4": 0.6},),
    confusable={"calibration_drift": "a steadier wind: overspeeding needs turbulence"},
)


def _damage(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    return {
        "torque_harmonic": values["torque_harmonic"],
        "calibration_gain": entry.calibration_gain * values["gain"],
    }


DAMAGED_CUP = Effect(
    name="damaged_cup",
    meaning="One cup or blade pulls less than the others.",
    entrance="response",
    equation="torque += e A h cos(psi - alpha), h: wind across the shaft; steady rate times gain",
    source="derived: one unequal cup or blade of three",
    contains=frozenset({"calibration_drift"}),
    region="once per revolution, locked to the wind's direction; a lower calibration",
    standing=0.0,
    # How much of it comes twice per turn depends on the cup's shape and its speed in the wind.
    loose_statistics=frozenset({"beat of the pulses with the wind, twice per turn"}),
    parameters=(
        Parameter("torque_harmonic", "1", 0.0, 1.5, minimum=0.01, step=0.005, starts=(0.05,)),
        # What pulls less makes no rotor faster.
        Parameter("gain", "1", 0.4, 1.0, healthy=1.0, minimum=0.0, step=0.02, starts=(0.97,)),
    ),
    applies=_is_rotor,
    update=_damage,
    templates=({"torque_harmonic": 0.03, "gain": 1.0}, {"torque_harmonic": 0.0, "gain": 0.98}),
    confusable={
        "encoder_slot_error": "turn the rotor by hand: slot errors stay, the torque does not",
        "calibration_drift": "pulse intervals against rotor angle",
    },
)


def _angular(entry: Entry, values: Values) -> dict[str, Any]:
    if isinstance(entry, Cup):
        return {"mu2": entry.mu2 + values["change"], "mu1": entry.mu1 + values["skewness"]}
    assert isinstance(entry, Propeller)
    return {"angular_response_change": entry.angular_response_change + values["change"]}


ANGULAR_RESPONSE = Effect(
    name="angular_response",
    meaning="The rotor's answer to oblique wind is not the one on the certificate.",
    entrance="response",
    equation="cup: g = cos + (mu1 + skewness) sin + (mu2 + change)(1 - cos); "
    "propeller: f + change (1 - cos) cos",
    source="K14, eqs. (83), (84); J80, sec. 3.2",
    region="strong vertical or lateral turbulence",
    parameters=(
        Parameter("change", "1", -3.0, 2.0, minimum=0.4, step=0.1, spare=True),
        Parameter("skewness", "1", -2.0, 2.0, minimum=0.1, step=0.03, spare=True),
    ),
    applies=_is_rotor,
    update=_angular,
    templates=({"change": 0.4, "skewness": 0.0}, {"change": 0.0, "skewness": 0.1}),
    confusable={
        "calibration_drift": "a wind with less turbulence",
        "axis_tilt": "a spirit level on the mount; wind from the opposite side",
    },
)


def _icing(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Rotor)
    return {
        "calibration_gain": entry.calibration_gain * values["gain"],
        "inertia_factor": entry.inertia_factor * values["inertia_factor"],
        "friction_speed": (entry.friction_speed**2 + values.get("friction_speed", 0.0) ** 2) ** 0.5,
    }


ICING = Effect(
    name="icing",
    meaning="Ice (above freezing dirt, salt or insects) makes the rotor heavier and its cups or "
    "blades worse, at the same time, and may brake its bearing; it may grow.",
    entrance="response",
    equation="l S = gain * U - U0 and l0 = factor * l0_cal together, beside a bearing that brakes "
    "by U_s^2; each approaches its size as 1 - exp(-t / growth time)",
    source="K94, eq. (6)",
    region="near and below 0 deg C; all speeds and high frequencies",
    contains=frozenset({"calibration_drift", "rotor_inertia"}),
    standing=0.0,
    smooths=True,
    shifts=True,
    parameters=(
        Parameter("gain", "1", 0.2, 1.0, healthy=1.0, minimum=0.03, step=0.005, starts=(0.9,)),
        Parameter(
            "inertia_factor", "1", 1.0, 12.0, healthy=1.0, minimum=0.4, step=0.1,
            starts=(1.5, 3.0),
        ),
        Parameter("growth_time", "s", 0.0, 600.0, step=10.0, starts=(100.0,), spare=True),
        Parameter("friction_speed", "m/s", 0.0, 3.0, step=0.1, starts=(0.5,), spare=True),
    ),
    applies=_is_rotor,
    update=_icing,
    grows="growth_time",
    templates=({"gain": 0.97, "inertia_factor": 1.3, "growth_time": 0.0, "friction_speed": 0.0},),
    confusable={
        "calibration_drift": "temperature; look at the cups",
        "bearing_friction": "temperature; a run-down test by hand",
    },
    size=lambda v: min(abs(v["gain"] - 1.0) / 0.012, abs(v["inertia_factor"] - 1.0) / 0.3),
)


def _arm(entry: Entry, values: Values) -> dict[str, Any]:
    assert isinstance(entry, Propeller)
    return {"distance_to_vane_axis": entry.distance_to_vane_axis + values["distance"]}


PROPELLER_TRANSLATION = Effect(
    name="propeller_translation",
    meaning="The propeller swings with the vane at another distance from its axis than stated.",
    entrance="response",
    equation="lateral wind at the propeller += distance * d(phi)/dt",
    source="K94, eq. (93)",
    region="while the vane turns fast",
    parameters=(Parameter("distance", "m", -2.0, 2.0, minimum=0.2, step=0.05),),
    applies=lambda entry, station: isinstance(entry, Propeller) and bool(entry.mounted_on),
    update=_arm,
    templates=({"distance": 0.2}, {"distance": 0.6}),
    confusable={"angular_response": "a tape measure; oblique wind in a tunnel"},
)

EFFECTS = (
    CALIBRATION_DRIFT,
    CALIBRATION_OFFSET,
    BEARING_FRICTION,
    AIR_DENSITY,
    ROTOR_INERTIA,
    TORQUE_ASYMMETRY,
    DAMAGED_CUP,
    ANGULAR_RESPONSE,
    ICING,
    PROPELLER_TRANSLATION,
)
