"""The effects that means can show, each on one instrument."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect, Parameter

ROTOR_EFFECTS = (
    "wake_shadow", "flow_distortion", "calibration_drift", "calibration_offset",
    "bearing_friction", "torque_asymmetry", "angular_response",
)
"""Effects that leave a trace in a mean speed; the others only shape what the mean hides."""

SINCE_A_MOMENT = ("calibration_drift", "calibration_offset", "vane_offset")
"""Of them, those that are looked for from a moment on, or until one."""

WIDEST_WAKE = 15.0
"""Standard deviation of the widest wake [deg]."""

FRICTION = "bearing_friction"

FEWEST_KNOWN = 0.9
"""Share of the means whose temperature must be known for it to explain anything."""

_NOT_SEEN = {
    "angular_response": ("skewness",),
    "flow_distortion": ("deflection",),
    FRICTION: ("temperature_coefficient", "breakaway"),
}
_AT_REST = {"skewness": 0.0, "deflection": 0.0, "temperature_coefficient": 0.0, "breakaway": 1.0}


def rotor_effects() -> dict[str, Effect]:
    """The catalogue's effects for mean speeds, without parameters that a mean cannot show.

    Each concerns one rotor: on opposite booms the mount does opposite things to them. Friction is
    the same at all temperatures here; see `warming`.
    """
    found = {}
    known = catalogue()
    for name in ROTOR_EFFECTS:
        effect = known[name]
        hidden = _NOT_SEEN.get(name, ())
        rest = {key: _AT_REST[key] for key in hidden}
        templates = tuple(
            t
            for t in effect.templates
            if any(t[p.name] != p.healthy for p in effect.parameters if p.name not in hidden)
            and t.get("width", 0.0) <= WIDEST_WAKE
        )
        parameters = tuple(p for p in effect.parameters if p.name not in hidden)
        if name == "wake_shadow":
            parameters = tuple(_narrow(p) for p in parameters)
        if name == "angular_response":
            parameters = tuple(_physical(p) for p in parameters)
        found[name] = replace(
            effect,
            parameters=parameters,
            templates=tuple({**t, **rest} for t in templates),
            everywhere=False,
        )
    return found


def warming(temperature: npt.NDArray[np.float64]) -> Effect | None:
    """Friction that changes with temperature; None where the record's air does not change enough.

    Args:
        temperature: [deg C]; NaN where unknown.
    """
    effect = catalogue()[FRICTION]
    known = temperature[np.isfinite(temperature)]
    needed = max(p.swing for p in effect.parameters)
    # The range of nearly all means: a single odd reading is no swing.
    if known.size < FEWEST_KNOWN * temperature.size or known.size == 0:
        return None
    swing = float(np.subtract(*np.quantile(known, (0.95, 0.05))))
    if swing < needed:
        return None
    seen = tuple(p for p in effect.parameters if p.name != "breakaway")
    return replace(effect, everywhere=False, parameters=seen)


def _physical(parameter: Parameter) -> Parameter:
    """Between a little worse than the cosine and indifferent to the wind's slope; K14, sec. 6."""
    return replace(parameter, low=-0.8, high=1.2) if parameter.name == "change" else parameter


def _narrow(parameter: Parameter) -> Parameter:
    """A wake between two booms slows down, and ends within some 30 degrees.

    A faster sector of one boom is a slower one of the other; what is wider is flow distortion.
    """
    if parameter.name == "depth":
        return replace(parameter, low=0.0)
    return replace(parameter, high=WIDEST_WAKE) if parameter.name == "width" else parameter
