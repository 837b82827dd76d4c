"""The effects that means can show, each on one instrument."""

from __future__ import annotations

from dataclasses import replace

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect

ROTOR_EFFECTS = (
    "wake_shadow", "flow_distortion", "calibration_drift", "calibration_offset",
    "bearing_friction", "torque_asymmetry", "angular_response",
)  # fmt: skip
"""Effects that leave a trace in a mean speed; the others only shape what the mean hides."""

SINCE_A_MOMENT = ("calibration_drift", "calibration_offset")
"""Of them, those that are looked for from a moment on, or until one."""

_NOT_SEEN = {
    "angular_response": ("skewness",),
    "flow_distortion": ("deflection",),
}
_AT_REST = {"skewness": 0.0, "deflection": 0.0}


def rotor_effects() -> dict[str, Effect]:
    """The catalogue's effects for mean speeds, without parameters that a mean cannot show.

    Each concerns one rotor: on opposite booms the mount does opposite things to them.
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
        )
        parameters = tuple(p for p in effect.parameters if p.name not in hidden)
        if name == "wake_shadow":
            # With a reference as close as the other boom, a faster sector here is a wake there.
            parameters = tuple(replace(p, low=0.0) if p.name == "depth" else p for p in parameters)
        found[name] = replace(
            effect,
            parameters=parameters,
            templates=tuple({**t, **rest} for t in templates),
            everywhere=False,
        )
    return found
