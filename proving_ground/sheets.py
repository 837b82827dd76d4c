"""The station file that goes with a recording: what a certificate and a drawing say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from proving_ground.stations import CupRotor, Propeller, Station
from proving_ground.tunnel import (
    TABLE_DEG,
    cup_angular_response,
    oblique_table,
    propeller_sheet,
    rotor_sheet,
    vane_sheet,
)


def station_sheet(station: Station) -> dict[str, Any]:
    """The contents of `recording.yaml` for a station, from its own wind tunnel."""
    rotor = (
        _cup(station, station.rotor)
        if isinstance(station.rotor, CupRotor)
        else _propeller(station, station.rotor)
    )
    swing = vane_sheet(station.vane)
    errors = dict(station.sheet_errors)
    for key in ("calibration_distance", "distance_constant"):
        rotor[key] = round(rotor[key] * errors.get(key, 1.0), 5)
    vane = {
        "name": "vane",
        "kind": "vane",
        "joint_states": "/vane/joint_states",
        "distance_constant": round(
            swing.distance_constant * errors.get("vane_distance_constant", 1.0), 4
        ),
        "damping_ratio": round(swing.damping_ratio, 4),
    }
    sheet: dict[str, Any] = {
        "recording": {
            "start": "2026-01-01T00:00:00Z",
            "frame": "enu",
            "measuring_height": station.height,
        },
        "instruments": [vane, rotor] if station.kind == "C" else [rotor, vane],
        "reference": {
            "kind": "sonic",
            "topic": "/reference/wind",
            "separation": station.sonic.separation,
            "path_length": station.sonic.path_length,
        },
        "air": {"temperature": "/air/temperature", "pressure": "/air/pressure"},
    }
    if station.boat is not None:
        sheet["platform"] = {
            "odometry": "/platform/odom",
            "sensor_position": list(station.boat.sensor_position),
        }
    return sheet


def _cup(station: Station, rotor: CupRotor) -> dict[str, Any]:
    line = rotor_sheet(rotor)
    mu1, mu2 = cup_angular_response(rotor)
    return {
        "name": "cup",
        "kind": "cup",
        "pulses": "/cup/pulses",
        "pulses_per_revolution": station.pulses_per_revolution,
        "calibration_distance": round(line.calibration_distance, 5),
        "starting_speed": round(max(line.starting_speed, 0.0), 5),
        "distance_constant": round(line.distance_constant, 5),
        "mu1": round(mu1, 5),
        "mu2": round(mu2, 5),
        "arm_radius": round(rotor.geometry.arm, 4),
    }


def _propeller(station: Station, propeller: Propeller) -> dict[str, Any]:
    line = propeller_sheet(propeller)
    return {
        "name": "propeller",
        "kind": "propeller",
        "pulses": "/propeller/pulses",
        "pulses_per_revolution": station.pulses_per_revolution,
        "mounted_on": "vane",
        "distance_to_vane_axis": round(station.vane.geometry.propeller_distance, 3),
        "calibration_distance": round(line.calibration_distance, 5),
        "stall_speed": round(line.starting_speed, 5),
        "distance_constant": round(line.distance_constant, 5),
        "angular_response_deg": [int(a) for a in TABLE_DEG],
        "angular_response": list(oblique_table(propeller)),
    }


def write_sheet(path: Path, station: Station) -> None:
    """Write the station file of a recording."""
    YAML().dump(station_sheet(station), path)
