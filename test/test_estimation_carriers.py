"""Effects that begin and end, and those of a carrier: the mean wind comes back."""

from __future__ import annotations

import pytest
from effect_cases import DISTORTION, METHODS, Case, Keys, change, check, wake

from wind_sensors.estimation import Method
from wind_sensors.simulation.trajectories import boat, multirotor

SAILING: Keys = {"trajectory": boat(), "platform_noise": False}
CHANGING: dict[str, Case] = {
    "gain": Case(changes=(change("cup", calibration_gain=0.8),), speed=0.05),
    "wake": Case(changes=(change("cup", stop=None, **wake(203.0, 0.3, 20.0)),), speed=0.1),
    "vane offset": Case(changes=(change("vane", offset_deg=15.0),), turn=4.0),
    "latency": Case(changes=(change("vane", stop=None, clock={"latency": 1.0}),), rms=1.5),
    "low pass": Case(changes=(change("vane", stop=None, filter_time_constant=1.0),), rms=1.3),
    "dead time": Case(
        changes=(change("cup", electronics={"dead_time": 0.03}),), speed=0.2, found_out=True
    ),
    "speed of the boat": Case(
        changes=(change("platform", velocity_scale=1.5),), platform={}, scenario=SAILING, turn=1.0
    ),
    "clock of the boat": Case(
        changes=(change("platform", stop=None, clock={"latency": 2.0}),), platform={},
        scenario=SAILING, turn=0.7,
    ),
}

AFLOAT: dict[str, Case] = {
    "scale": Case(platform={"velocity_scale": 1.3}, scenario=SAILING, turn=1.0),
    "turned velocity": Case(platform={"velocity_turn_deg": 30.0}, scenario=SAILING, speed=0.05),
    "share": Case(platform={"velocity_share": 0.0}, scenario=SAILING, turn=3.0),
    "deviation": Case(
        platform={"heading_deviation": {"constant_deg": 5.0, "sine_deg": 10.0, "cosine_deg": 4.0}},
        scenario=SAILING, turn=1.5,
    ),
    "rotation": Case(platform={"sensor_rotation_deg": (0, 0, 12.0)}, scenario=SAILING, turn=7.0),
    "lever arm": Case(platform={"sensor_position": (0.3, 0, 8.0)}, scenario=SAILING, rms=2.0),
    "late odometry": Case(platform={"clock": {"latency": 1.5}}, scenario=SAILING, rms=2.0),
    "drifting odometry": Case(platform={"clock": {"drift": 0.02}}, scenario=SAILING, rms=1.5),
    "magnetic": Case(
        platform={"heading_reference": "magnetic", "magnetic_declination_deg": 12.0},
        scenario=SAILING, turn=9.0,
    ),
    "north, east, down": Case(platform={"frame": "ned"}, scenario=SAILING, turn=20.0),
    "velocity along earth axes": Case(
        platform={"velocity_axes": "earth"}, scenario=SAILING, turn=3.0
    ),
    "inflow": Case(
        platform={"downwash": {"induced_velocity": 4.0, "wake_skew": 0.15}},
        scenario={"trajectory": multirotor(), "platform_noise": False}, speed=0.05,
    ),
    "wake": Case(cup=wake(-150.0, 0.4, 40.0), platform={}, scenario=SAILING, speed=0.02),
    "distortion": Case(
        both={"flow_distortion": DISTORTION}, platform={}, scenario=SAILING, turn=1.5
    ),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", sorted(CHANGING))
def test_what_begins_and_ends_is_undone(name: str, method: Method) -> None:
    check(CHANGING[name], method)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", sorted(AFLOAT))
def test_what_a_carrier_does_is_undone(name: str, method: Method) -> None:
    check(AFLOAT[name], method)
