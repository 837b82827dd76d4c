"""The catalogue: every effect enters the station by keys that it knows."""

from __future__ import annotations

import pytest

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import Effect, entry_of, touched, with_effect
from wind_sensors.diagnosis.explaining.signatures import entries
from wind_sensors.station.model import Station

IDENTIFIERS = {
    "wake_shadow", "flow_distortion", "axis_tilt", "platform_velocity", "platform_velocity_scale",
    "lever_arm", "heading_deviation", "frame_error", "rotor_downwash", "calibration_drift",
    "calibration_offset", "bearing_friction", "air_density", "rotor_inertia", "torque_asymmetry",
    "damaged_cup", "angular_response", "icing", "propeller_translation", "vane_friction",
    "vane_inertia", "vane_damping", "vane_imbalance", "missed_pulses", "extra_pulses",
    "encoder_slot_error", "vane_offset", "vane_eccentricity", "potentiometer_gap", "quantisation",
    "low_pass_filter", "stuck_sensor", "sensor_swap", "timestamp_latency", "clock_drift",
}

STATION = Station.model_validate(
    {
        "instruments": [
            {
                "name": "cup", "kind": "cup", "pulses": {"topic": "/cup"},
                "pulses_per_revolution": 6, "calibration_distance": 0.14,
                "distance_constant": 1.8,
            },
            {
                "name": "vane", "kind": "vane", "joint_states": {"topic": "/vane"},
                "distance_constant": 0.5, "damping_ratio": 0.25,
            },
            {
                "name": "propeller", "kind": "propeller", "pulses": {"topic": "/propeller"},
                "pulses_per_revolution": 4, "calibration_distance": 0.05,
                "distance_constant": 1.0, "mounted_on": "vane",
            },
        ],
        "platform": {"odometry": {"topic": "/odom"}},
    }
)


def _placed() -> list[tuple[Effect, str]]:
    out = []
    for effect in catalogue().values():
        for name in entries(STATION):
            if effect.everywhere != (name == "station"):
                continue
            if any(
                effect.applies(entry_of(STATION, one), STATION)
                for one in touched(STATION, effect, name)
            ):
                out.append((effect, name))
    return out


def test_the_catalogue_has_every_identifier() -> None:
    assert set(catalogue()) >= IDENTIFIERS


def test_a_sector_lies_where_parameters_say() -> None:
    sectored = {name: effect for name, effect in catalogue().items() if effect.sector}
    assert {"wake_shadow", "potentiometer_gap"} <= set(sectored)
    for effect in sectored.values():
        assert {effect.sector, "width"} <= {p.name for p in effect.parameters}


def test_every_effect_has_a_place_in_a_station_with_everything() -> None:
    assert {effect.name for effect, _ in _placed()} >= IDENTIFIERS


@pytest.mark.parametrize(("effect", "name"), _placed(), ids=lambda v: getattr(v, "name", v))
def test_what_an_effect_writes_is_a_valid_station(effect: Effect, name: str) -> None:
    templates = effect.templates or ({"start": 10.0, "stop": 40.0},)
    planted_stations = [with_effect(STATION, effect, name, values) for values in templates]
    assert any(planted != STATION for planted in planted_stations)
    for values, planted in zip(templates, planted_stations, strict=True):
        again = Station.model_validate(planted.model_dump())
        assert again == planted
        passing = with_effect(STATION, effect, name, values, (100.0, None))
        assert len(passing.changes) == len(touched(STATION, effect, name))


@pytest.mark.parametrize("effect", catalogue().values(), ids=lambda e: e.name)
def test_starts_and_templates_lie_within_the_bounds(effect: Effect) -> None:
    by_name = {p.name: p for p in effect.parameters}
    for template in effect.templates:
        assert set(template) == set(by_name)
        for key, value in template.items():
            assert by_name[key].low <= value <= by_name[key].high
    for parameter in effect.parameters:
        for start in parameter.starts:
            assert parameter.low <= start <= parameter.high
        if parameter.healthy is not None:
            assert parameter.low <= parameter.healthy <= parameter.high


@pytest.mark.parametrize("effect", catalogue().values(), ids=lambda e: e.name)
def test_every_confusable_partner_is_known(effect: Effect) -> None:
    assert set(effect.confusable) <= set(catalogue())
    assert effect.meaning.endswith(".")
    assert effect.source
