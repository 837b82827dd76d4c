"""Every effect of a mast that a station file can carry is undone: the mean wind comes back."""

from __future__ import annotations

import pytest
from effect_cases import DISTORTION, METHODS, Case, check, wake

from wind_sensors.estimation import Method

SHALLOW = {"cosine_1": 0.08, "sine_2": 0.05}

MAST: dict[str, Case] = {
    "wake": Case(cup=wake(203.0, 0.25, 20.0), speed=0.15),
    "wake with flanks": Case(
        cup={
            "wake_shadows": [
                {"bearing_from_deg": 165.0, "depth": 0.25, "width_deg": 14.0, "flank": 0.08}
            ]
        },
        speed=0.03,
    ),
    "narrow wake of both": Case(both=wake(200.0, 0.25, 8.0), speed=0.1),
    "flow distortion": Case(both={"flow_distortion": SHALLOW}, speed=0.02),
    "flow distortion with deflection": Case(both={"flow_distortion": DISTORTION}, turn=0.7),
    "gain": Case(cup={"calibration_gain": 0.93}, speed=0.05),
    "offset": Case(cup={"calibration_offset": -0.4}, speed=0.03),
    "friction": Case(cup={"friction_speed": 1.5}, speed=0.02),
    "friction that sticks": Case(
        cup={"friction_speed": 1.5, "friction_breakaway": 2.5}, speed=0.02
    ),
    "friction in the cold": Case(
        cup={"friction_speed": 1.2, "friction_temperature_coefficient": -0.05},
        scenario={"temperature": -5.0}, speed=0.02,
    ),
    "inertia": Case(cup={"inertia_factor": 6.0}, rms=1.5),
    "slots": Case(cup={"electronics": {"slot_errors": (0.1, -0.1, 0.05, -0.05)}}),
    "torque once a turn": Case(cup={"torque_harmonic": 0.1}),
    "dead time": Case(cup={"electronics": {"dead_time": 0.035}}, speed=0.3),
    "lost pulses": Case(cup={"electronics": {"loss_probability": 0.15}}),
    "pulses lost as it races": Case(
        cup={"electronics": {"loss_probability": 0.08, "loss_growth": 2.0}}
    ),
    "bounces": Case(cup={"electronics": {"bounce_probability": 0.2, "bounce_delay": 0.004}}),
    "late pulses": Case(cup={"clock": {"latency": 0.6}}, rms=1.5),
    "early pulses": Case(cup={"clock": {"latency": -3.0}}, rms=1.5),
    "drifting pulses": Case(cup={"clock": {"drift": 0.02}}, speed=0.006),
    "vane offset": Case(vane={"offset_deg": 8.0}, turn=7.0),
    "reversed vane": Case(vane={"reversed": True, "offset_deg": -20.0}, turn=7.0),
    "eccentricity": Case(
        vane={"eccentricity_deg": 6.0, "eccentricity_phase_deg": 60.0}, turn=2.0
    ),
    "vane inertia": Case(vane={"inertia_factor": 4.0}, rms=1.3),
    "vane damping": Case(vane={"damping_factor": 0.3}),
    "oil in a vane's bearing": Case(vane={"viscous_damping": 4.0}, rms=1.3),
    "vane friction": Case(vane={"friction_speed": 1.5}),
    "late readings": Case(vane={"clock": {"latency": 0.7}}, rms=1.5),
    "drifting readings": Case(vane={"clock": {"drift": 0.02}}, rms=1.5),
    "low pass": Case(vane={"filter_time_constant": 0.8}, rms=1.3),
    "gap": Case(vane={"gap_centre_deg": 220.0, "gap_width_deg": 24.0}, rms=1.02),
    "gap with a reading": Case(
        vane={"gap_centre_deg": 205.0, "gap_width_deg": 15.0, "gap_reading_deg": 0.0}, turn=20.0
    ),
    "gap with a loose wiper": Case(
        vane={"gap_centre_deg": 205.0, "gap_width_deg": 15.0, "gap_reading_deg": "floating"},
        rms=1.1,
    ),
    "quantisation": Case(vane={"quantisation_deg": 8.0}),
    "imbalance on a leaning axis": Case(
        vane={"imbalance": 5.0, "tilt_deg": (4.0, -4.0)}, turn=0.8
    ),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", sorted(MAST))
def test_a_stated_effect_is_undone(name: str, method: Method) -> None:
    check(MAST[name], method)
