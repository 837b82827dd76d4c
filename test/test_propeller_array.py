"""Wind vectors recovered from several propellers."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from wind_sensors.instruments import friction_propeller, propeller_array
from wind_sensors.instruments.friction_propeller import FrictionPropeller
from wind_sensors.station.signals import FloatArray


def measured_response(angle: npt.ArrayLike) -> FloatArray:
    """A response that departs from the cosine by up to 15 %, as Gill propellers do."""
    theta = np.asarray(angle, dtype=float)
    response: FloatArray = np.cos(theta) * (1.0 - 0.15 * np.sin(theta) ** 2)
    return response


ROTOR = FrictionPropeller(0.3 / (2.0 * math.pi), 1.0, 0.2, f=measured_response)


def directions(generator: np.random.Generator, count: int) -> FloatArray:
    vectors = generator.standard_normal((count, 3))
    unit: FloatArray = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


@pytest.mark.parametrize("mounting", ["orthogonal", "tripod", "four"])
def test_steady_winds_from_everywhere_are_recovered(mounting: str) -> None:
    axes = {
        "orthogonal": propeller_array.orthogonal_axes(),
        "tripod": propeller_array.tripod_axes(0.7, 0.1),
        "four": np.vstack([propeller_array.tripod_axes(0.7), [[0.0, 0.0, 1.0]]]),
    }[mounting]
    generator = np.random.default_rng(1)
    wind = directions(generator, 3000) * generator.uniform(1.0, 25.0, (3000, 1))
    readings = propeller_array.steady_readings(axes, ROTOR, wind)
    turning = np.all(readings != 0.0, axis=1)
    estimate = propeller_array.solve(axes, ROTOR, readings)
    assert np.all(estimate.converged[turning])
    error = np.linalg.norm(estimate.velocity - wind, axis=1)
    assert np.max(error[turning]) < 1e-6
    assert np.all(np.any(estimate.near_plane[~turning], axis=1))
    assert np.array_equal(
        estimate.interference[turning],
        propeller_array.wind_angles(axes, wind)[turning] > 0.75 * math.pi,
    )


def test_dynamic_readings_with_friction_are_recovered_inside_the_mounting_s_cone() -> None:
    heading = -2.0
    axes = propeller_array.tripod_axes(heading)
    generator = np.random.default_rng(2)
    along = np.array([math.cos(heading), math.sin(heading), 0.0])
    spread = directions(generator, 4000)
    wind = (along + 0.5 * spread) * generator.uniform(2.0, 20.0, (4000, 1))
    angles = propeller_array.wind_angles(axes, wind)
    assert np.all(np.abs(angles - 0.5 * math.pi) > math.radians(4.0))
    speed = np.linalg.norm(wind, axis=1, keepdims=True)
    steady = propeller_array.steady_readings(axes, ROTOR, wind)
    indicated = steady * generator.uniform(0.7, 1.4, steady.shape)
    p = ROTOR.calibration_distance
    acceleration = p * friction_propeller.angular_acceleration(indicated / p, speed, angles, ROTOR)
    estimate = propeller_array.solve(axes, ROTOR, indicated, acceleration)
    assert np.all(estimate.converged)
    assert np.max(np.linalg.norm(estimate.velocity - wind, axis=1) / speed[:, 0]) < 1e-6


def test_the_tripod_keeps_all_propellers_at_the_same_angle() -> None:
    axes = propeller_array.tripod_axes(0.3, -0.2, 1.1)
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    wind = [math.cos(0.2) * math.cos(0.3), math.cos(0.2) * math.sin(0.3), -math.sin(0.2)]
    angles = np.degrees(propeller_array.wind_angles(axes, wind))
    assert np.allclose(angles, 54.7356, atol=1e-4)


def test_a_cosine_array_needs_no_correction() -> None:
    ideal = FrictionPropeller(0.2, 1.0)
    wind = np.array([[3.0, -4.0, 1.0]])
    axes = propeller_array.orthogonal_axes()
    readings = propeller_array.steady_readings(axes, ideal, wind)
    assert np.allclose(propeller_array.uncorrected_velocity(axes, readings), wind)
    assert np.allclose(propeller_array.solve(axes, ideal, readings).velocity, wind)


def test_calm_and_blind_arrays() -> None:
    axes = propeller_array.orthogonal_axes()
    calm = propeller_array.solve(axes, ROTOR, np.zeros((2, 3)))
    assert np.all(calm.converged) and np.all(calm.velocity == 0.0)
    with pytest.raises(ValueError, match="unseen"):
        propeller_array.solve(axes[:2], ROTOR, np.ones((1, 2)))


def test_what_cannot_be_solved_is_reported() -> None:
    """Readings that no wind produces do not come back as converged."""
    impossible = np.array([[5.0, 0.01, 0.01]])
    acceleration = np.array([[-400.0, 300.0, -250.0]])
    estimate = propeller_array.solve(
        propeller_array.orthogonal_axes(), ROTOR, impossible, acceleration
    )
    residual_free = bool(estimate.converged[0]) and not bool(np.any(estimate.noisy))
    assert not residual_free


def test_a_row_without_a_reading_does_not_spoil_the_others() -> None:
    axes = propeller_array.orthogonal_axes()
    wind = np.array([[4.0, 1.5, 2.0], [5.0, 1.0, 1.0], [3.0, 2.0, -1.0]])
    readings = propeller_array.steady_readings(axes, ROTOR, wind)
    readings[1, 0] = np.nan
    estimate = propeller_array.solve(axes, ROTOR, readings)
    assert estimate.converged.tolist() == [True, False, True]
    assert np.isnan(estimate.velocity[1]).all()
    assert estimate.velocity[[0, 2]] == pytest.approx(wind[[0, 2]], abs=1e-6)
