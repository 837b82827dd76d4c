"""Frames, attitudes and platform motion against independent rotations, geometry and sampling."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from wind_sensors.errors import UserError
from wind_sensors.motion import frames, relative_wind, rotations
from wind_sensors.motion.downwash import (
    hover_induced_velocity,
    rotor_downwash,
    share_on_axis,
)
from wind_sensors.motion.platform_errors import reported_motion, true_motion
from wind_sensors.motion.platform_track import Motion, PlatformTrack, TrackLimits, shifted
from wind_sensors.station.model import Clock, Downwash, HeadingDeviation, Platform
from wind_sensors.station.signals import FloatArray, PlatformStates

angles = st.floats(-3.0, 3.0)
components = st.floats(-20.0, 20.0)
vectors = st.tuples(components, components, components).map(np.array)
attitudes = st.tuples(angles, angles, angles).map(
    lambda v: Rotation.from_rotvec(np.array(v)).as_quat()
)


def motion_at(
    attitude: npt.ArrayLike,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    rate: npt.ArrayLike = (0.0, 0.0, 0.0),
    count: int = 1,
) -> Motion:
    return Motion(
        np.tile(np.asarray(attitude, dtype=float), (count, 1)),
        np.tile(np.asarray(velocity, dtype=float), (count, 1)),
        np.tile(np.asarray(rate, dtype=float), (count, 1)),
        np.zeros((count, 3)),
    )


def swaying_states(count: int = 400, dt: float = 0.05) -> tuple[PlatformStates, FloatArray]:
    """A carrier that turns, rolls and moves; its states by SciPy's rotations."""
    t = np.arange(count) * dt
    rpy = np.stack((0.1 * np.sin(t), 0.05 * np.cos(1.3 * t), 0.2 * t), axis=1)
    attitude = Rotation.from_euler("ZYX", rpy[:, ::-1])
    h = 1e-5
    ahead = Rotation.from_euler(
        "ZYX",
        np.stack((0.2 * (t + h), 0.05 * np.cos(1.3 * (t + h)), 0.1 * np.sin(t + h)), axis=1),
    )
    rate = (attitude.inv() * ahead).as_rotvec() / h
    position = np.stack((2.0 * t, 3.0 * np.sin(0.5 * t), 0.1 * np.sin(2.0 * t)), axis=1)
    in_earth = np.stack(
        (np.full_like(t, 2.0), 1.5 * np.cos(0.5 * t), 0.2 * np.cos(2.0 * t)), axis=1
    )
    states = PlatformStates(
        np.rint(t * 1e9).astype(np.int64),
        attitude.as_quat(),
        attitude.inv().apply(in_earth),
        rate,
        position,
    )
    return states, in_earth


@given(attitudes, attitudes, vectors)
def test_rotations_agree_with_scipy(
    first: FloatArray, second: FloatArray, vector: FloatArray
) -> None:
    a, b = Rotation.from_quat(first), Rotation.from_quat(second)
    np.testing.assert_allclose(rotations.rotate(first, vector), a.apply(vector), atol=1e-12)
    np.testing.assert_allclose(rotations.matrix(first), a.as_matrix(), atol=1e-12)
    both = rotations.multiply(first, second)
    np.testing.assert_allclose(rotations.matrix(both), (a * b).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(
        rotations.rotate_back(first, vector), a.inv().apply(vector), atol=1e-12
    )


@given(attitudes, attitudes, st.floats(0.0, 1.0))
def test_slerp_follows_the_great_circle(
    first: FloatArray, second: FloatArray, fraction: float
) -> None:
    expected = Slerp([0.0, 1.0], Rotation.from_quat([first, second]))(fraction)
    found = Rotation.from_quat(rotations.slerp(first, second, np.asarray(fraction)))
    assert (expected.inv() * found).magnitude() < 1e-6


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_roll_pitch_yaw_are_turns_about_z_then_y_then_x(
    roll: float, pitch: float, yaw: float
) -> None:
    q = rotations.from_roll_pitch_yaw(roll, pitch, yaw)
    expected = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    np.testing.assert_allclose(rotations.matrix(q), expected, atol=1e-12)
    np.testing.assert_allclose(
        rotations.matrix(rotations.from_roll_pitch_yaw(*rotations.to_roll_pitch_yaw(q))),
        expected,
        atol=1e-7,
    )


@pytest.mark.parametrize(
    ("velocity", "from_deg"),
    [((0, -5, 0), 0.0), ((-5, 0, 0), 90.0), ((0, 5, 0), 180.0), ((5, 0, 0), 270.0)],
)
def test_a_north_wind_blows_southwards(velocity: tuple[int, int, int], from_deg: float) -> None:
    assert float(frames.direction_from_deg(velocity)) == pytest.approx(from_deg)
    np.testing.assert_allclose(frames.velocity_from_direction(5.0, from_deg), velocity, atol=1e-12)


def test_compass_headings_count_clockwise_from_the_north_they_name() -> None:
    np.testing.assert_allclose(frames.yaw_from_compass([0.0, 90.0]), [np.pi / 2, 0.0], atol=1e-12)
    # Magnetic north lies 10 degrees east of true north: a magnetic heading of 350 is true north.
    assert float(frames.yaw_from_compass(350.0, 10.0)) == pytest.approx(np.pi / 2)
    assert float(frames.compass_from_yaw(np.pi / 2, 10.0)) == pytest.approx(350.0)


@given(attitudes, vectors)
def test_ned_and_enu_describe_the_same_rotation(attitude: FloatArray, vector: FloatArray) -> None:
    in_ned = frames.attitude_ned_from_enu(attitude)
    through_ned = frames.swap_enu_ned(rotations.rotate(in_ned, frames.swap_flu_frd(vector)))
    np.testing.assert_allclose(through_ned, rotations.rotate(attitude, vector), atol=1e-12)
    back = frames.attitude_enu_from_ned(in_ned)
    assert abs(float(np.dot(back, attitude))) == pytest.approx(1.0)


def test_level_and_facing_north_is_no_rotation_in_ned() -> None:
    facing_north = rotations.from_roll_pitch_yaw(0.0, 0.0, np.pi / 2)
    in_ned = frames.attitude_ned_from_enu(facing_north)
    np.testing.assert_allclose(np.abs(in_ned), [0, 0, 0, 1], atol=1e-12)


def test_a_steadily_turning_platform_is_interpolated_on_the_sphere() -> None:
    rate = np.array([0.3, -0.2, 0.5])
    t = np.arange(0.0, 10.0, 0.5)
    attitude = Rotation.from_rotvec(np.outer(t, rate)).as_quat()
    zero = np.zeros((t.size, 3))
    track = PlatformTrack(
        PlatformStates(np.rint(t * 1e9).astype(np.int64), attitude, zero, zero + rate, zero)
    )
    wanted = np.linspace(0.0, 9.4, 57)
    found = track.at(np.rint(wanted * 1e9).astype(np.int64)).motion.attitude
    expected = Rotation.from_rotvec(np.outer(wanted, rate))
    assert (expected.inv() * Rotation.from_quat(found)).magnitude().max() < 1e-8


def test_beyond_the_last_state_the_platform_carries_on_and_certainty_falls() -> None:
    states, _ = swaying_states()
    track = PlatformTrack(states, TrackLimits(longest_extrapolation=0.5))
    last = int(states.time[-1])
    ahead = track.at(np.array([last, last + 200_000_000, last + 400_000_000, last + 600_000_000]))
    assert ahead.known.tolist() == [True, True, True, False]
    assert np.all(np.diff(ahead.attitude_variance) > 0.0)
    assert np.all(np.diff(ahead.velocity_variance) > 0.0)
    turned = Rotation.from_quat(states.attitude[-1]) * Rotation.from_rotvec(
        0.2 * states.angular_rate[-1]
    )
    assert (turned.inv() * Rotation.from_quat(ahead.motion.attitude[1])).magnitude() < 1e-9


def test_a_long_gap_is_guesswork_and_its_edges_are_not() -> None:
    states, _ = swaying_states(count=200)
    keep = np.r_[0:50, 150:200]
    track = PlatformTrack(
        PlatformStates(
            states.time[keep], states.attitude[keep], states.velocity[keep],
            states.angular_rate[keep], states.position[keep],
        )
    )
    sample = track.at(states.time[[40, 49, 100, 150]])
    assert sample.known.tolist() == [True, True, False, True]


def test_unordered_doubled_and_broken_states_do_no_harm() -> None:
    states, _ = swaying_states(count=100)
    order = np.random.default_rng(1).permutation(np.r_[0:100, 10:20])
    attitude = states.attitude[order].copy()
    broken = np.flatnonzero(order == 55)
    attitude[broken] = np.nan
    mixed = PlatformStates(
        states.time[order], attitude, states.velocity[order], states.angular_rate[order],
        states.position[order],
    )
    wanted = states.time[[12, 54, 55, 56]]
    clean = PlatformTrack(states).at(wanted).motion
    found = PlatformTrack(mixed).at(wanted).motion
    np.testing.assert_allclose(found.velocity[[0, 1, 3]], clean.velocity[[0, 1, 3]], rtol=1e-12)
    np.testing.assert_allclose(found.velocity, clean.velocity, atol=2e-3)


def test_a_platform_without_a_usable_state_is_the_users_error() -> None:
    nothing = np.full((3, 3), np.nan)
    with pytest.raises(UserError, match="no usable state"):
        PlatformTrack(PlatformStates(np.arange(3), np.zeros((3, 4)), nothing, nothing, nothing))


def test_apparent_wind_is_the_wind_minus_the_way_the_sensor_goes() -> None:
    """The sensor's velocity from the difference of its positions, not from omega x r."""
    states, _ = swaying_states(count=4000, dt=0.005)
    arm = np.array([0.3, -0.2, 4.0])
    sensor_rotation = relative_wind.sensor_rotation(Platform(sensor_rotation_deg=(3.0, -5.0, 20.0)))
    wind = np.array([4.0, -3.0, 0.5])
    attitude = Rotation.from_quat(states.attitude)
    place = states.position + attitude.apply(arm)
    velocity = np.gradient(place, 0.005, axis=0)
    mount = Rotation.from_euler("ZYX", [20.0, -5.0, 3.0], degrees=True)
    expected = mount.inv().apply(attitude.inv().apply(wind - velocity))
    motion = Motion(states.attitude, states.velocity, states.angular_rate, states.position)
    found = relative_wind.apparent_wind(np.tile(wind, (4000, 1)), motion, arm, sensor_rotation)
    np.testing.assert_allclose(found[5:-5], expected[5:-5], atol=2e-4)
    back = relative_wind.earth_wind(found, motion, arm, sensor_rotation)
    np.testing.assert_allclose(back, np.tile(wind, (4000, 1)), atol=1e-9)


@given(vectors, vectors, vectors, attitudes, st.floats(-3.0, 3.0))
def test_turning_the_whole_world_changes_nothing_a_sensor_feels(
    wind: FloatArray, velocity: FloatArray, rate: FloatArray, q: FloatArray, turn: float
) -> None:
    arm, mount = (0.1, 0.2, 3.0), np.eye(3)
    before = relative_wind.apparent_wind(wind[None], motion_at(q, velocity, rate), arm, mount)
    world = Rotation.from_euler("z", turn)
    turned = motion_at(rotations.turned_about_up(q, turn), velocity, rate)
    after = relative_wind.apparent_wind(world.apply(wind)[None], turned, arm, mount)
    np.testing.assert_allclose(after, before, atol=1e-9)


@given(vectors, vectors, vectors, attitudes)
def test_only_the_difference_of_wind_and_platform_velocity_is_felt(
    wind: FloatArray, velocity: FloatArray, shift: FloatArray, q: FloatArray
) -> None:
    arm, mount = (0.0, 0.0, 2.0), np.eye(3)
    still = relative_wind.apparent_wind(wind[None], motion_at(q, velocity), arm, mount)
    carried = motion_at(q, velocity + Rotation.from_quat(q).inv().apply(shift))
    moving = relative_wind.apparent_wind((wind + shift)[None], carried, arm, mount)
    np.testing.assert_allclose(moving, still, atol=1e-9)


@pytest.mark.parametrize("velocity_in_earth", [False, True])
def test_the_winds_covariance_is_that_of_a_sample_of_errors(velocity_in_earth: bool) -> None:
    draw = np.random.default_rng(5)
    count = 200_000
    attitude = Rotation.from_euler("ZYX", [0.7, 0.1, -0.2])
    velocity, rate = np.array([5.0, 1.0, -0.5]), np.array([0.3, 0.2, 0.5])
    arm = np.array([0.5, 0.2, 3.0])
    mount = relative_wind.sensor_rotation(Platform(sensor_rotation_deg=(0.0, 10.0, 30.0)))
    apparent = np.array([-6.0, 2.0, 0.3])
    spread = np.diag([0.04, 0.09, 0.01])
    predicted = relative_wind.earth_wind_covariance(
        apparent[None], spread, motion_at(attitude.as_quat(), velocity, rate), arm, mount,
        attitude_variance=4e-4, velocity_variance=0.01, mounting_variance=1e-4,
        rate_variance=2.5e-3, velocity_in_earth=velocity_in_earth,
    )[0]
    shown = attitude * Rotation.from_rotvec(0.02 * draw.normal(size=(count, 3)))
    turned = Rotation.from_matrix(mount) * Rotation.from_rotvec(0.01 * draw.normal(size=(count, 3)))
    flow = turned.apply(apparent + draw.normal(size=(count, 3)) * np.sqrt(np.diag(spread)))
    swing = np.cross(rate + 0.05 * draw.normal(size=(count, 3)), arm)
    noise = 0.1 * draw.normal(size=(count, 3))
    if velocity_in_earth:
        wind = shown.apply(flow + swing) + attitude.apply(velocity) + noise
    else:
        wind = shown.apply(flow + swing + velocity + noise)
    found = np.cov(wind.T)
    np.testing.assert_allclose(predicted, found, atol=0.02 * np.abs(found).max())


@settings(max_examples=50)
@given(
    st.floats(-20.0, 20.0), st.floats(-15.0, 15.0), st.floats(-15.0, 15.0),
    st.floats(-6.0, 6.0), st.floats(-6.0, 6.0), st.floats(0.7, 1.4),
    st.sampled_from(["enu", "ned"]), st.sampled_from(["platform", "earth"]),
    st.floats(-30.0, 30.0),
)
def test_what_a_platform_reports_leads_back_to_what_it_did(
    a: float,
    b: float,
    c: float,
    d: float,
    e: float,
    scale: float,
    frame: Literal["enu", "ned"],
    axes: Literal["platform", "earth"],
    north: float,
) -> None:
    platform = Platform(
        heading_deviation=HeadingDeviation(
            constant_deg=a, sine_deg=b, cosine_deg=c, sine_2_deg=d, cosine_2_deg=e
        ),
        velocity_scale=scale, frame=frame, velocity_axes=axes, heading_reference="magnetic",
        magnetic_declination_deg=north,
    )
    states, _ = swaying_states(count=100)
    motion = Motion(states.attitude, states.velocity, states.angular_rate, states.position)
    back = true_motion(platform, reported_motion(platform, motion), 0.05)
    same = Rotation.from_quat(back.attitude).inv() * Rotation.from_quat(motion.attitude)
    assert same.magnitude().max() < 1e-7
    np.testing.assert_allclose(back.velocity, motion.velocity, atol=1e-6)
    np.testing.assert_allclose(back.angular_rate, motion.angular_rate, atol=1e-12)
    np.testing.assert_allclose(back.position, motion.position, atol=1e-9)


def test_a_compass_shows_its_deviation_on_top_of_the_magnetic_heading() -> None:
    platform = Platform(
        heading_deviation=HeadingDeviation(
            constant_deg=2.0, sine_deg=5.0, cosine_deg=-3.0, sine_2_deg=1.5, cosine_2_deg=-0.8
        ),
        heading_reference="magnetic", magnetic_declination_deg=8.0,
    )
    headings = np.arange(0.0, 360.0, 30.0)
    yaw = frames.yaw_from_compass(headings)
    motion = Motion(
        rotations.from_roll_pitch_yaw(0.1, -0.05, yaw), *(np.zeros((12, 3)) for _ in range(3))
    )
    shown = frames.compass_from_yaw(frames.heading_of(reported_motion(platform, motion).attitude))
    magnetic = np.radians(headings - 8.0)
    expected = headings - 8.0 + 2.0 + 5.0 * np.sin(magnetic) - 3.0 * np.cos(magnetic)
    expected += 1.5 * np.sin(2.0 * magnetic) - 0.8 * np.cos(2.0 * magnetic)
    assert np.abs((shown - expected + 180.0) % 360.0 - 180.0).max() < 1e-9


def test_a_late_clock_shows_an_earlier_state() -> None:
    states, _ = swaying_states(count=400)
    motion = Motion(states.attitude, states.velocity, states.angular_rate, states.position)
    late = shifted(motion, 0.05, -0.2)
    found = true_motion(Platform(clock=Clock(latency=0.2)), late, 0.05)
    np.testing.assert_allclose(found.position[10:-10], motion.position[10:-10], atol=1e-9)
    np.testing.assert_allclose(found.velocity[10:-10], motion.velocity[10:-10], atol=1e-9)


@given(st.floats(0.5, 10.0), st.floats(0.0, 20.0))
def test_downwash_obeys_momentum_theory(hover: float, airspeed: float) -> None:
    added = rotor_downwash(
        Downwash(induced_velocity=hover, wake_skew=0.5), np.array([[-airspeed, 0.0, 0.0]])
    )[0]
    induced = -added[2]
    assert induced * np.hypot(airspeed, induced) == pytest.approx(hover**2, rel=1e-6)
    assert added[0] == pytest.approx(-0.5 * induced * airspeed / hover)


def test_a_jet_beside_its_rotor_blows_outwards_with_the_platform() -> None:
    apparent = np.array([[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]])
    added = rotor_downwash(Downwash(induced_velocity=2.0, spread=(0.3, -0.1)), apparent)
    np.testing.assert_allclose(added[:, 0], -0.3 * added[:, 2])
    np.testing.assert_allclose(added[:, 1], 0.1 * added[:, 2])
    assert added[0, 2] == pytest.approx(-2.0)


@given(st.floats(1.0, 100.0), st.floats(0.05, 2.0), st.floats(0.4, 0.9), st.floats(0.05, 1.0))
def test_thrust_and_the_power_it_takes_give_the_same_inflow(
    thrust: float, area: float, merit: float, share: float
) -> None:
    by_thrust = hover_induced_velocity(
        Downwash(thrust=thrust, disc_area=area, sensor_share=share)
    )
    # Momentum through the discs: T = rho A v (2 v), and the power is T v over the merit.
    in_disc = by_thrust / share
    assert 2.0 * 1.225 * area * in_disc**2 == pytest.approx(thrust)
    by_power = hover_induced_velocity(
        Downwash(
            hover_power=thrust * in_disc / merit,
            figure_of_merit=merit,
            disc_area=area,
            sensor_share=share,
        )
    )
    assert by_power == pytest.approx(by_thrust)


def test_a_column_of_ring_vortices_draws_air_as_biot_and_savart_say() -> None:
    radius, height = 0.3, 0.25
    below = np.linspace(0.0, 400.0, 4_000_001)
    ring = radius**2 / (2.0 * (radius**2 + (height + below) ** 2) ** 1.5)
    in_disc = radius**2 / (2.0 * (radius**2 + below**2) ** 1.5)
    expected = np.trapezoid(ring, below) / np.trapezoid(in_disc, below)
    assert share_on_axis(height, radius) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    "wrong", [{"thrust": 10.0}, {"thrust": 10.0, "hover_power": 50.0, "disc_area": 1.0}]
)
def test_an_inflow_without_its_rotors_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"disc_area|not both"):
        Downwash(**wrong)


def test_felt_gravity_is_the_plumb_line_of_a_swing() -> None:
    """A body in free fall feels nothing; one at rest and leaning feels g along its own axes."""
    t = np.arange(100) * 0.05
    fall = np.zeros((100, 3))
    fall[:, 2] = -relative_wind.STANDARD_GRAVITY * t
    level = np.tile((0.0, 0.0, 0.0, 1.0), (100, 1))
    falling = Motion(level, fall, np.zeros((100, 3)), np.zeros((100, 3)))
    np.testing.assert_allclose(relative_wind.felt_gravity(falling, (0, 0, 0), 0.05), 0.0, atol=1e-9)
    lean = motion_at(Rotation.from_euler("y", 0.2).as_quat(), count=5)
    felt = relative_wind.felt_gravity(lean, (0.0, 0.0, 1.0), 0.05)
    g = relative_wind.STANDARD_GRAVITY
    np.testing.assert_allclose(
        felt, np.tile((g * np.sin(0.2), 0.0, -g * np.cos(0.2)), (5, 1)), atol=1e-9
    )


@given(vectors, attitudes, angles)
def test_the_wind_along_the_platforms_axes_is_the_felt_wind_and_the_motion(
    wind: FloatArray, q: FloatArray, yaw: float
) -> None:
    """R^T wind = S apparent + velocity, whichever way the sensor is mounted."""
    platform = Platform(sensor_rotation_deg=(3.0, -2.0, float(np.degrees(yaw))))
    rotation = relative_wind.sensor_rotation(platform)
    motion = motion_at(q, velocity=(4.0, -1.0, 0.3))
    felt = relative_wind.apparent_wind(wind[np.newaxis], motion, np.zeros(3), rotation)
    spread = np.diag((1.0, 2.0, 3.0))
    along, covariance = relative_wind.wind_in_platform(
        wind, spread, motion.to_earth[0] @ rotation, rotation
    )
    np.testing.assert_allclose(along, rotation @ felt[0] + (4.0, -1.0, 0.3), atol=1e-9)
    assert along @ covariance @ along == pytest.approx(wind @ spread @ wind, rel=1e-6, abs=1e-6)


def test_angles_at_the_seam_stay_within_their_turn() -> None:
    above, below = np.nextafter(np.pi, 9.0), np.nextafter(-np.pi, -9.0)
    wrapped = frames.wrap([np.nextafter(np.pi, 0.0), np.pi, above, -np.pi, below])
    assert np.all((wrapped >= -np.pi) & (wrapped < np.pi))
    assert np.abs(np.exp(1j * wrapped) + 1.0).max() < 1e-15
    assert float(frames.direction_from_deg((1e-17, -1.0))) == 0.0
    assert float(frames.compass_from_yaw(np.nextafter(0.5 * np.pi, 9.0))) < 360.0


def test_variances_of_three_instants_are_told_apart_from_those_of_three_axes() -> None:
    still = Motion(np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)), *[np.zeros((3, 3))] * 3)
    found = relative_wind.earth_wind_covariance(
        np.tile([10.0, 0.0, 0.0], (3, 1)), np.zeros((3, 3)), still, (0.0, 0.0, 0.0), np.eye(3),
        attitude_variance=0.0, velocity_variance=[1.0, 2.0, 3.0],
    )
    assert found == pytest.approx(np.arange(1.0, 4.0)[:, None, None] * np.eye(3))
