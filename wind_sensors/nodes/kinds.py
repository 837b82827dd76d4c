"""The estimator nodes: what each one is for and which instruments it expects."""

from __future__ import annotations

from wind_sensors.errors import UserError
from wind_sensors.nodes.estimator_node import NodeKind
from wind_sensors.nodes.station_parameters import Role
from wind_sensors.station.model import Propeller, Station

_CUP = Role("cup", "cup", {"pulses": {"topic": "cup/pulses"}})
_VANE = Role("vane", "vane", {"joint_states": {"topic": "vane/joint_states"}})
_PROPELLER = Role(
    "propeller",
    "propeller",
    {"pulses": {"topic": "propeller/pulses"}, "mounted_on": "vane"},
)
_BIVANE = Role(
    "bivane",
    "bivane",
    {
        "azimuth": {"topic": "bivane/joint_states"},
        "elevation": {"topic": "bivane/joint_states"},
        "speed": "cup",
    },
)


def _fixed_propeller(axis: str, direction: tuple[float, float, float]) -> Role:
    topic = f"propeller_{axis}/pulses"
    return Role(f"propeller_{axis}", "propeller", {"pulses": {"topic": topic}, "axis": direction})


CUP_VANE = NodeKind(
    "cup_vane_node",
    "Corrected wind from the pulses of a cup anemometer and the angle of a vane: the lag of both, "
    "the bias of the mean speed, and the motion of the platform are removed.",
    ("cup", "vane"),
    (_CUP, _VANE),
)

PROPELLER_VANE = NodeKind(
    "propeller_vane_node",
    "Corrected wind from a propeller that a vane turns into the wind: its non-cosine response, "
    "its lag behind the wind's direction, and the motion of the platform are removed.",
    ("propeller", "vane"),
    (_PROPELLER, _VANE),
)

PROPELLER_ARRAY = NodeKind(
    "propeller_array_node",
    "All three components of the wind from propellers on fixed axes, whatever their orientation: "
    "their non-cosine response, friction and lag are removed.",
    ("propeller",),
    (
        _fixed_propeller("x", (1.0, 0.0, 0.0)),
        _fixed_propeller("y", (0.0, 1.0, 0.0)),
        _fixed_propeller("z", (0.0, 0.0, 1.0)),
    ),
)

BIVANE = NodeKind(
    "bivane_node",
    "Wind with its vertical component from a bivane and the instrument that measures the speed: "
    "the bivane's resonance and lag are removed.",
    ("bivane",),
    (_CUP, _BIVANE),
)


def kind_for(station: Station) -> NodeKind:
    """The node that fits a station's instruments.

    Raises:
        UserError: No node does.
    """
    kinds = {instrument.kind for instrument in station.instruments}
    on_a_vane = any(isinstance(i, Propeller) and i.mounted_on for i in station.instruments)
    if "bivane" in kinds:
        return BIVANE
    if on_a_vane:
        return PROPELLER_VANE
    if {"cup", "vane"} <= kinds:
        return CUP_VANE
    if "propeller" in kinds:
        return PROPELLER_ARRAY
    raise UserError(
        f"no estimator fits a station with {', '.join(sorted(kinds))} alone.",
        "instruments",
        "Add a cup and a vane, a propeller on a vane, fixed propellers, or a bivane.",
    )
