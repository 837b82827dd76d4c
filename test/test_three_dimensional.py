"""Rotors and vanes on tilted and moving axes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wind_sensors.instruments import cup, three_dimensional


def test_tilt_matrix_is_a_rotation_that_leans_the_axis() -> None:
    matrix = three_dimensional.tilt_matrix(0.2, 0.7)
    assert np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    axis = matrix @ np.array([0.0, 0.0, 1.0])
    expected = [math.sin(0.2) * math.cos(0.7), math.sin(0.2) * math.sin(0.7), math.cos(0.2)]
    assert np.allclose(axis, expected)


def test_a_tilted_cup_reads_its_angular_response() -> None:
    rotor = cup.CupConstants(0.2, 1.7, 0.06, 0.05, 0.8)
    for tilt, azimuth in ((0.1, 0.0), (0.1, math.pi), (0.15, 1.0)):
        axis = three_dimensional.tilt_matrix(tilt, azimuth)[:, 2]
        reading = float(three_dimensional.cup_steady_speed([6.0, 0.0, 0.0], rotor, axis))
        elevation = math.asin(math.sin(tilt) * math.cos(azimuth))
        assert reading / 6.0 == pytest.approx(float(cup.steady_response(elevation, rotor)))
        predicted = three_dimensional.tilt_bias(tilt, azimuth, 0.05, 0.8)
        assert reading / 6.0 - 1.0 == pytest.approx(predicted, abs=2.0 * tilt**3)


def test_a_propeller_on_a_tilted_axis() -> None:
    axis = [math.cos(0.3), 0.0, math.sin(0.3)]
    along = three_dimensional.rotor_wind([5.0, 1.0, 0.0], axis)
    assert float(along.axial) == pytest.approx(5.0 * math.cos(0.3))
    assert float(along.axial**2 + along.transverse**2) == pytest.approx(26.0)
    reading = float(three_dimensional.propeller_steady_speed([5.0, 0.0, 0.0], axis, 0.0))
    assert reading == pytest.approx(5.0 * math.cos(0.3))


def test_vane_error_by_tilt() -> None:
    """First order in the wind's elevation, second order in level wind."""
    assert three_dimensional.tilted_vane_error(0.05, 0.0, 0.1) == pytest.approx(0.0, abs=1e-12)
    small = three_dimensional.tilted_vane_error(1e-3, 0.5 * math.pi, 1e-3)
    assert abs(small) == pytest.approx(1e-6, rel=1e-3)
    level = three_dimensional.tilted_vane_error(0.05, 0.25 * math.pi, 0.0)
    assert abs(level) == pytest.approx(0.25 * 0.05**2, rel=0.01)
    first = three_dimensional.tilted_vane_error(0.01, 0.8, 0.1)
    assert first == pytest.approx(-0.1 * 0.01 * math.sin(0.8), rel=0.05)
    assert float(
        three_dimensional.vane_stiffness_ratio([1.0, 0.0, 0.0], [math.sin(0.4), 0.0, math.cos(0.4)])
    ) == pytest.approx(math.cos(0.4))


def test_moving_sensor_sees_wind_minus_motion() -> None:
    """A mast top swinging about the deck: velocity plus omega x arm, then into the mount."""
    rotation = three_dimensional.tilt_matrix(0.3, -1.2)
    arm = np.array([0.0, 0.0, 8.0])
    omega = np.array([0.1, -0.2, 0.05])
    velocity = np.array([3.0, 1.0, 0.0])
    wind = np.array([-2.0, 6.0, 0.3])
    apparent = three_dimensional.relative_wind(wind, velocity, omega, arm, rotation)
    h = 1e-6
    moved = arm + h * np.cross(omega, arm)
    top_velocity = velocity + (moved - arm) / h
    assert np.allclose(rotation @ apparent, wind - top_velocity, atol=1e-9)
