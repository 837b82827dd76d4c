"""Every effect of a mast that a station file can carry is undone: the mean wind comes back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import (
    DISTORTION,
    METHODS,
    SETTLED,
    SPEED_LIMIT,
    TURN_LIMIT,
    Case,
    blown,
    check,
    errors,
    settings,
    wake,
)
from estimation_cases import truth_at

from wind_sensors.estimation import Method, ProcessedRecording, process
from wind_sensors.station.signals import Recording

SHALLOW = {"cosine_1": 0.08, "sine_2": 0.05}
SLOW = {"calibration_distance": 0.5}
"""A cup that turns two or three times a second: what goes round with it is inside the band."""
SLOWER = {"calibration_distance": 1.0}

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
    "slots": Case(
        cup={"electronics": {"slot_errors": (0.2, 0.1, -0.2, -0.1)}}, rotor=SLOW, rms=1.2
    ),
    "dead time": Case(cup={"electronics": {"dead_time": 0.035}}, speed=0.3),
    "lost pulses": Case(
        cup={"electronics": {"loss_probability": 0.15}}, speed=0.12, found_out=True
    ),
    "pulses lost as it races": Case(
        cup={"electronics": {"loss_probability": 0.08, "loss_growth": 2.0}},
        speed=0.15, found_out=True,
    ),
    "bounces": Case(
        cup={"electronics": {"bounce_probability": 0.2, "bounce_delay": 0.004}},
        speed=0.12, found_out=True,
    ),
    "late pulses": Case(cup={"clock": {"latency": 0.6}}, rms=1.5),
    "early pulses": Case(cup={"clock": {"latency": -3.0}}, rms=1.5),
    "drifting pulses": Case(cup={"clock": {"drift": 0.02}}, speed=0.006),
    "vane offset": Case(vane={"offset_deg": 8.0}, turn=7.0),
    "reversed vane": Case(vane={"reversed": True, "offset_deg": -20.0}, turn=7.0),
    "eccentricity": Case(
        vane={"eccentricity_deg": 6.0, "eccentricity_phase_deg": 60.0}, turn=2.0
    ),
    "vane inertia": Case(vane={"inertia_factor": 4.0}, rms=1.3),
    "vane damping": Case(vane={"damping_factor": 0.1}, rms=1.15),
    "oil in a vane's bearing": Case(vane={"viscous_damping": 4.0}, rms=1.3),
    "vane friction": Case(vane={"friction_speed": 1.5}, rms=1.05),
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
    "imbalance on a leaning axis": Case(
        vane={"imbalance": 5.0, "tilt_deg": (4.0, -4.0)}, turn=0.8
    ),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", sorted(MAST))
def test_a_stated_effect_is_undone(name: str, method: Method) -> None:
    check(MAST[name], method)


def test_a_torque_once_a_turn_is_undone_by_the_filter() -> None:
    """The inverse method has no rotor angle to take it off at; see docs/corrected_wind.md."""
    check(Case(cup={"torque_harmonic": 0.3}, rotor=SLOWER, speed=0.01, rms=1.2), "kalman")


def deviation(found: ProcessedRecording) -> float:
    """Usual standard deviation of a horizontal component [m/s] by its covariance."""
    return float(np.sqrt(np.mean(found.covariance[:, [0, 1], [0, 1]])))


def covered(found: ProcessedRecording, recording: Recording) -> float:
    """Share of instants at which the true horizontal wind is inside the 95 % ellipse."""
    late = found.time > recording.start + SETTLED
    off = (found.velocity - truth_at(recording, found.time))[late, :2]
    precision = np.linalg.inv(found.covariance[late, :2, :2])
    distance = np.einsum("ni,nij,nj->n", off, precision, off)
    return float(np.mean(distance < -2.0 * np.log(0.05)))


@pytest.mark.parametrize("method", METHODS)
def test_the_steps_of_a_coarse_code_cost_certainty_not_the_mean(method: Method) -> None:
    """What a reading rounds off is gone: eight degrees of step are 2.3 degrees of scatter."""
    fine = process(blown(Case()), settings(method))
    recording = blown(Case(vane={"quantisation_deg": 8.0}))
    coarse = process(recording, settings(method))
    speed, turn, _ = errors(coarse, recording)
    assert abs(speed) < SPEED_LIMIT
    assert abs(turn) < TURN_LIMIT
    assert deviation(coarse) > 1.04 * deviation(fine)
    assert covered(coarse, recording) > 0.95


@pytest.mark.parametrize("method", METHODS)
def test_a_stated_friction_says_how_uncertain_a_vane_is_that_sticks(method: Method) -> None:
    case = Case(vane={"friction_speed": 2.0})
    recording = blown(case)
    stated = process(recording, settings(method))
    unaware = process(replace(recording, station=case.station(wrong=False)), settings(method))
    assert covered(stated, recording) > 0.88
    assert covered(unaware, recording) < covered(stated, recording) - 0.05
    assert deviation(stated) > 1.05 * deviation(unaware)
