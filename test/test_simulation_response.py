"""The forward model against independent integrations, closed forms and invariances."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from wind_sensors.errors import UserError
from wind_sensors.instruments.dynamics.vane import integrate_vane, small_turn
from wind_sensors.motion import rotations
from wind_sensors.motion.platform_track import Motion
from wind_sensors.simulation import Drive, ResponseState, respond
from wind_sensors.station.model import (
    Bivane,
    Change,
    Cup,
    Downwash,
    FlowDistortion,
    Input,
    Platform,
    Propeller,
    Station,
    Vane,
    WakeShadow,
)
from wind_sensors.station.parameters import vane_parameters
from wind_sensors.station.signals import FloatArray

TOPIC = Input(topic="/x")
START = 1_700_000_000_000_000_000


def cup(**changes: Any) -> Cup:
    constants: dict[str, Any] = dict(
        name="cup", pulses=TOPIC, pulses_per_revolution=4, calibration_distance=0.2,
        distance_constant=1.7, starting_speed=0.25, mu1=0.05, mu2=0.6, a4=0.8,
    )
    return Cup(**{**constants, **changes})


def vane(**changes: Any) -> Vane:
    constants: dict[str, Any] = dict(
        name="vane", joint_states=TOPIC, distance_constant=0.6, damping_ratio=0.3
    )
    return Vane(**{**constants, **changes})


def propeller(**changes: Any) -> Propeller:
    constants: dict[str, Any] = dict(
        name="propeller", pulses=TOPIC, pulses_per_revolution=2, calibration_distance=0.05,
        distance_constant=1.0,
    )
    return Propeller(**{**constants, **changes})


def gusty(
    count: int = 600,
    dt: float = 0.05,
    seed: int = 1,
    mean: npt.ArrayLike = (6.0, 3.0, 0.0),
    size: float = 1.2,
) -> Drive:
    draw = np.random.default_rng(seed)
    noise = draw.normal(size=(count + 40, 3))
    smooth = np.stack([np.convolve(noise[:, k], np.ones(8) / 2.8, "valid") for k in range(3)], 1)
    return Drive(START, dt, np.asarray(mean) + size * smooth[:count])


def steady(
    wind: npt.ArrayLike,
    count: int = 1200,
    dt: float = 0.05,
    motion: Motion | None = None,
    density: FloatArray | None = None,
) -> Drive:
    blowing = np.tile(np.asarray(wind, dtype=float), (count, 1))
    return Drive(START, dt, blowing, motion, density=density)


def at_rest(
    count: int,
    velocity: npt.ArrayLike = (0.0, 0.0, 0.0),
    rate: npt.ArrayLike = (0.0, 0.0, 0.0),
    attitude: FloatArray | None = None,
) -> Motion:
    q = np.tile((0.0, 0.0, 0.0, 1.0), (count, 1)) if attitude is None else attitude
    return Motion(
        q, np.tile(np.asarray(velocity, float), (count, 1)),
        np.tile(np.asarray(rate, float), (count, 1)), np.zeros((count, 3)),
    )


def test_a_cup_in_gusts_follows_its_equation() -> None:
    """K94 (2) with K14 (83) as forcing, written out again and given to SciPy."""
    drive = gusty()
    c = cup()
    h = np.hypot(drive.wind[:, 0], drive.wind[:, 1])
    w = drive.wind[:, 2]
    forcing = h + c.mu1 * w + c.mu2 * (np.sqrt(h * h + w * w) - h) - c.starting_speed
    t = drive.dt * np.arange(len(drive))

    def slope(time: float, state: FloatArray) -> list[float]:
        a = np.interp(time, t, forcing)
        y = state[0]
        return [(a - y) * (c.a4 * a + (1 - c.a4) * y) / c.distance_constant, y / 0.2]

    found = respond(Station(instruments=(c,)), drive).rotors["cup"]
    exact = solve_ivp(
        slope, (0, t[-1]), [forcing[0], 0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.05
    )
    np.testing.assert_allclose(found.y, exact.y[0], atol=3e-5)
    np.testing.assert_allclose(found.psi, exact.y[1], atol=1e-4)
    np.testing.assert_allclose(found.rate, found.y / 0.2)


@given(st.floats(-1.0, 1.0))
@settings(max_examples=200)
def test_a_small_turn_is_exact_whether_by_series_or_by_the_library(angle: float) -> None:
    np.testing.assert_allclose(small_turn(angle), (np.cos(angle), np.sin(angle)), atol=3e-16)


def test_a_vane_on_a_turning_unbalanced_mount_follows_its_equation() -> None:
    drive = gusty(count=400)
    count = len(drive)
    t = drive.dt * np.arange(count)
    turn, lean = 0.4 * np.sin(0.7 * t), 0.15
    yaw = 0.4 / 0.7 * (1.0 - np.cos(0.7 * t))
    attitude = Rotation.from_euler("ZYX", np.stack((yaw, 0 * t, 0 * t), 1))
    rates = np.stack((0 * t, 0 * t, turn), axis=1)
    motion = Motion(attitude.as_quat(), np.zeros((count, 3)), rates, np.zeros((count, 3)))
    v = vane(imbalance=0.8, tilt_deg=(float(np.degrees(lean)), 0.0))
    moving = Drive(START, drive.dt, drive.wind, motion)
    found = respond(Station(instruments=(v,), platform=Platform()), moving).angles["vane"]
    axis = Rotation.from_euler("y", lean)
    felt = axis.inv().apply(attitude.inv().apply(drive.wind))
    spin = axis.inv().apply(rates)[:, 2]
    pull = axis.inv().apply((0.0, 0.0, -9.80665))

    def slope(time: float, state: FloatArray) -> list[float]:
        x, y = np.interp(time, t, felt[:, 0]), np.interp(time, t, felt[:, 1])
        omega = np.interp(time, t, spin)
        left = min(int(time / drive.dt), count - 2)
        omega_dot = (spin[left + 1] - spin[left]) / drive.dt
        pace = np.hypot(x, y) / 0.6
        phi, rate = state
        return [
            rate,
            -2 * 0.3 * pace * (rate + omega)
            - pace**2 * np.sin(phi - np.arctan2(-y, -x))
            - omega_dot
            + 0.8 * (-pull[0] * np.sin(phi) + pull[1] * np.cos(phi)),
        ]

    start = np.arctan2(-felt[0, 1], -felt[0, 0])
    exact = solve_ivp(
        slope, (0, t[-1]), [start, 0.0], t_eval=t, rtol=1e-9, atol=1e-11, max_step=0.05
    )
    error = found.angle - exact.y[0]
    assert np.sqrt(np.mean(error**2)) < 2e-4
    assert np.abs(error).max() < 1e-3


def test_a_bearing_that_catches_holds_the_vane_at_one_heading_only() -> None:
    """The wind turns by 40 degrees in 80 s; friction h_c^2 balances h^2 sin(deviation)."""
    turning = np.radians(np.linspace(-20.0, 20.0, 1600))
    wind = -5.0 * np.stack((np.cos(turning), np.sin(turning), 0.0 * turning), axis=1)
    drive = Drive(START, 0.05, wind)
    caught = vane(catch_speed=1.5, catch_heading_deg=3.0, catch_width_deg=2.0, damping_ratio=0.7)
    free = vane(damping_ratio=0.7)
    angle, expected = (
        np.degrees(respond(Station(instruments=(v,)), drive).angles["vane"].angle)
        for v in (caught, free)
    )
    behind = expected - angle
    held = np.degrees(np.arcsin(1.5**2 / 5.0**2))
    assert behind.max() == pytest.approx(held, rel=0.1)
    far = np.abs(angle - 3.0) > 8.0
    assert np.abs(behind[far]).max() < 0.1


def test_a_fin_that_gives_way_swings_more_slowly_in_strong_wind_only() -> None:
    """Against the period of a free swing, 2 pi l_v / U, and half the force at the yield speed."""
    periods = {}
    for speed in (2.0, 10.0):
        wind = np.tile([-speed, 0.0, 0.0], (4000, 1))
        wind[:200, 1] = 0.2 * speed
        drive = Drive(START, 0.005, wind)
        for fin, soft in (("stiff", {}), ("soft", {"fin_yield_speed": 10.0})):
            swinging = vane(damping_ratio=0.02, **soft)
            angle = respond(Station(instruments=(swinging,)), drive).angles["vane"].angle[200:]
            crossings = np.flatnonzero((angle[:-1] > 0.0) != (angle[1:] > 0.0))
            periods[fin, speed] = 2.0 * 0.005 * np.mean(np.diff(crossings))
        expected = 2.0 * np.pi * vane().distance_constant / speed
        assert periods["stiff", speed] == pytest.approx(expected, rel=0.03)
        share = 1.0 / (1.0 + (speed / 10.0) ** 2)
        slower = periods["soft", speed] / periods["stiff", speed]
        assert slower == pytest.approx(share**-0.5, rel=0.02)


def test_a_cable_pulls_a_vane_back_to_where_it_is_not_wound_up() -> None:
    """Against the balance of torques, in winds of several speeds and after a whole turn."""
    wound = vane(cable_speed=1.0, cable_rest_deg=60.0, damping_ratio=0.7)
    for speed in (3.0, 6.0):
        for end in (0.0, 40.0, 360.0):
            turning = np.radians(np.interp(np.arange(3000), (0, 2000), (0.0, end)))
            wind = -speed * np.stack((np.cos(turning), np.sin(turning), 0.0 * turning), axis=1)
            drive = Drive(START, 0.05, wind)
            angle = respond(Station(instruments=(wound,)), drive).angles["vane"].angle[-1]
            to_wind = speed**2 * np.sin(np.radians(end) - angle)
            assert abs(np.degrees(angle) - end) < 90.0
            assert to_wind == pytest.approx(angle - np.radians(60.0), rel=1e-4)


def test_oil_in_the_bearing_damps_a_vane_by_as_much_in_any_wind() -> None:
    oiled = vane(viscous_damping=4.0, inertia_factor=1.5)
    rate = 4.0 * 2.0 * oiled.damping_ratio * 8.0 / oiled.distance_constant / 1.5
    for speed in (2.0, 12.0):
        natural = speed / oiled.distance_constant
        own = 2.0 * oiled.damping_ratio * natural / 1.5

        def motion(
            t: float, state: FloatArray, natural: float = natural, own: float = own
        ) -> list[float]:
            angle, turning = state
            pull = natural**2 / 1.5 * np.sin(angle - 0.3)
            return [turning, -(own + rate) * turning - pull]

        wind = np.full((401, 3), -speed) * [np.cos(0.3), np.sin(0.3), 0.0]
        wind[0] = (-speed, 0.0, 0.0)
        found = respond(Station(instruments=(oiled,)), Drive(START, 0.01, wind)).angles["vane"]
        expected = solve_ivp(motion, (0.0, 3.99), (0.0, 0.0), rtol=1e-8, dense_output=True)
        at = np.arange(1, 400) * 0.01
        assert expected.sol is not None
        # The wind turns within the first interval.
        assert found.angle[1:400] == pytest.approx(expected.sol(at - 0.005)[0], abs=2e-3)


def test_oil_in_the_bearing_holds_a_vane_against_its_mount() -> None:
    oiled = vane(viscous_damping=3.0)
    n = 400
    angle, _ = integrate_vane(
        vane_parameters(oiled), np.tile((-6.0, 0.0, 0.0), (n, 1)), np.full(n, 0.2),
        np.zeros((n, 2)), np.ones(n), 0.05, 0.0, 0.0,
    )
    # In a wind that turns with the mount only the fin feels the turning, not the oil.
    lag = 2.0 * oiled.damping_ratio * 0.2 * oiled.distance_constant / 6.0
    assert angle[-1] == pytest.approx(-np.arcsin(lag), rel=0.01)


def test_finer_sampling_of_the_same_wind_gives_the_same_movement() -> None:
    coarse = gusty(count=800)
    fine_time = np.arange(799 * 8 + 1) * coarse.dt / 8
    grid = np.arange(800) * coarse.dt
    fine = Drive(
        START,
        coarse.dt / 8,
        np.stack([np.interp(fine_time, grid, coarse.wind[:, k]) for k in range(3)], axis=1),
    )
    station = Station(instruments=(vane(), propeller(mounted_on="vane"), cup()))
    one, other = respond(station, coarse), respond(station, fine)
    at = slice(None, None, 8)
    # The forcing is linear between samples, so refining the wind changes it by the curvature of
    # |wind| only; a shift by half a sample would show as 0.1 m/s.
    assert np.std(one.rotors["cup"].y - other.rotors["cup"].y[at]) < 4e-3
    assert np.std(one.angles["vane"].angle - other.angles["vane"].angle[at]) < 4e-3
    turned = one.rotors["cup"].psi[-1] / other.rotors["cup"].psi[-1]
    assert turned == pytest.approx(1.0, abs=1e-3)


def test_a_step_from_equilibrium_is_exponential_for_a_cup_without_lambda() -> None:
    """K94 (11): Lambda = 0 makes the step exactly 1 - exp(-t/tau0)."""
    drive = steady((8.0, 0.0, 0.0), count=200, dt=0.02)
    wind = drive.wind.copy()
    start = respond(
        Station(instruments=(cup(a4=1.0, starting_speed=0.0),)), steady((4, 0, 0), 10, 0.02)
    ).final
    found = respond(
        Station(instruments=(cup(a4=1.0, starting_speed=0.0),)), drive.with_wind(wind), start
    )
    t = 0.02 * np.arange(200)
    expected = 8.0 - 4.0 * np.exp(-t * 8.0 / 1.7)
    np.testing.assert_allclose(found.rotors["cup"].y, expected, atol=1e-5)


@settings(max_examples=20)
@given(st.floats(1.0, 20.0), st.floats(0.0, 0.9))
def test_a_propeller_with_friction_settles_at_jacksons_steady_rate(
    speed: float, stall: float
) -> None:
    """J80 (6): P omega = U - U_s^2 / U."""
    station = Station(instruments=(vane(), propeller(mounted_on="vane", stall_speed=stall)))
    end = respond(station, steady((-speed, 0, 0))).rotors["propeller"].y[-1]
    assert end == pytest.approx(speed - stall**2 / speed, rel=1e-6)


def test_three_fixed_propellers_with_cosine_response_show_the_wind_vector() -> None:
    axes = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    station = Station(
        instruments=tuple(
            propeller(name=f"p{k}", axis=tuple(float(x) for x in axes[k])) for k in range(3)
        )
    )
    wind = np.array([3.0, -2.0, 1.0])
    rates = [r.y[-1] for r in respond(station, steady(wind, 4000)).rotors.values()]
    np.testing.assert_allclose(axes.T @ np.array(rates), wind, atol=2e-3)
    assert min(rates) < 0.0, "a propeller whose axis faces the other way turns backwards"


@pytest.mark.parametrize(
    "rotor", [propeller(axis=(1.0, 0.0, 0.0), mu2=-0.7), cup(mu1=1.2, a4=1.0), cup(mu1=1.2)]
)
def test_air_from_behind_brakes_a_rotor_and_never_drives_it_on(rotor: Propeller | Cup) -> None:
    """Of which the models say nothing: a multirotor's stuck vane, a cup that falls fast."""
    wind = (-6.0, 2.0, 0.0) if isinstance(rotor, Propeller) else (0.1, 0.0, -12.0)
    turning = ResponseState(rotors={rotor.name: (100.0, 0.0)})
    y = respond(Station(instruments=(rotor,)), steady(wind), turning).rotors[rotor.name].y
    assert y[0] > 0.0
    assert np.all(np.diff(y) <= 0.0)
    assert y[-1] < 0.05 * y[0]


def test_a_propeller_that_is_neither_mounted_nor_aimed_is_the_users_error() -> None:
    with pytest.raises(UserError, match="neither `mounted_on` nor `axis`"):
        respond(Station(instruments=(propeller(),)), steady((5, 0, 0), 10))


@given(st.floats(-3.0, 3.0), st.floats(-0.6, 0.6))
@settings(max_examples=20)
def test_a_bivane_settles_on_azimuth_and_elevation_of_the_wind(
    azimuth: float, elevation: float
) -> None:
    b = Bivane(
        name="bivane", azimuth=TOPIC, elevation=TOPIC, distance_constant=2.4, damping_ratio=0.5
    )
    # The nose looks to where the wind comes from; a positive elevation is an upward wind.
    flat = 6.0 * np.cos(elevation)
    wind = (-flat * np.cos(azimuth), -flat * np.sin(azimuth), 6.0 * np.sin(elevation))
    start = respond(Station(instruments=(b,)), steady((-6.0, 0.1, 0.0), 10)).final
    found = respond(Station(instruments=(b,)), steady(wind, 1500), start)
    end = found.angles["bivane"].angle[-1]
    assert np.angle(np.exp(1j * (end - azimuth))) == pytest.approx(0.0, abs=1e-4)
    assert found.angles["bivane/elevation"].angle[-1] == pytest.approx(elevation, abs=1e-4)


def test_in_still_air_a_vane_keeps_its_heading_while_the_mount_turns() -> None:
    count, dt = 400, 0.05
    t = dt * np.arange(count)
    yaw = 0.3 * (1.0 - np.cos(t))
    attitude = Rotation.from_euler("z", yaw[:, None]).as_quat()
    rates = np.stack((0 * t, 0 * t, 0.3 * np.sin(t)), axis=1)
    motion = Motion(attitude, np.zeros((count, 3)), rates, np.zeros((count, 3)))
    drive = Drive(START, dt, np.full((count, 3), 1e-9), motion)
    station = Station(instruments=(vane(),), platform=Platform())
    angle = respond(station, drive).angles["vane"].angle
    np.testing.assert_allclose(angle + yaw, angle[0], atol=1e-3)


def test_a_leaning_cup_reads_its_angular_response() -> None:
    """The wind in cup axes by SciPy's rotation; forcing K14 (83)."""
    c = cup(tilt_deg=(6.0, -9.0), starting_speed=0.0)
    wind = np.array([5.0, 2.0, 0.0])
    lean = Rotation.from_rotvec(np.radians([9.0, 6.0, 0.0]))
    top = lean.apply((0.0, 0.0, 1.0))
    assert top[0] > 0 > top[1], "a positive tilt leans towards x, a negative one away from y"
    x, y, w = lean.inv().apply(wind)
    h = np.hypot(x, y)
    expected = h + c.mu1 * w + c.mu2 * (np.sqrt(h * h + w * w) - h)
    end = respond(Station(instruments=(c,)), steady(wind)).rotors["cup"].y[-1]
    assert end == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(("from_deg", "factor"), [(40.0, 0.8), (50.0, 1 - 0.2 * np.exp(-0.5))])
def test_a_wake_slows_the_wind_that_comes_through_it(from_deg: float, factor: float) -> None:
    c = cup(
        starting_speed=0.0,
        wake_shadows=(WakeShadow(bearing_from_deg=40.0, depth=0.2, width_deg=10.0),),
    )
    a = np.radians(from_deg)
    end = respond(Station(instruments=(c,)), steady((-7 * np.cos(a), -7 * np.sin(a), 0)))
    assert end.rotors["cup"].y[-1] == pytest.approx(7.0 * factor, rel=1e-7)


def test_the_wake_stands_still_on_the_mount_while_the_mount_turns() -> None:
    shadow = WakeShadow(bearing_from_deg=90.0, depth=0.3, width_deg=10.0)
    station = Station(
        instruments=(cup(starting_speed=0.0, wake_shadows=(shadow,)),), platform=Platform()
    )
    for yaw in (0.0, 1.0, 4.0):
        from_left = yaw + 0.5 * np.pi
        wind = (-5 * np.cos(from_left), -5 * np.sin(from_left), 0.0)
        q = np.tile(Rotation.from_euler("z", yaw).as_quat(), (1200, 1))
        end = respond(station, steady(wind, motion=at_rest(1200, attitude=q)))
        assert end.rotors["cup"].y[-1] == pytest.approx(3.5, rel=1e-6)


def test_flow_distortion_is_a_fourier_series_of_the_direction_in_the_sensor_frame() -> None:
    d = FlowDistortion(cosine_1=0.05, sine_1=-0.03, cosine_2=0.02, sine_2=0.04)
    station = Station(
        instruments=(cup(starting_speed=0.0, flow_distortion=d),), sensor_heading_deg=25.0
    )
    theta = 0.8
    earth = theta + np.radians(25.0)
    wind = (-6 * np.cos(earth), -6 * np.sin(earth), 0.0)
    factor = (
        1 + 0.05 * np.cos(theta) - 0.03 * np.sin(theta) + 0.02 * np.cos(2 * theta)
        + 0.04 * np.sin(2 * theta)
    )
    end = respond(station, steady(wind)).rotors["cup"].y[-1]
    assert end == pytest.approx(6.0 * factor, rel=1e-7)


@given(st.floats(-3.0, 3.0))
@settings(max_examples=10)
def test_turning_wind_and_platform_together_turns_nothing(turn: float) -> None:
    drive = gusty(count=300)
    station = Station(
        instruments=(vane(), cup(tilt_deg=(3.0, 2.0))),
        platform=Platform(sensor_position=(0.2, 0.1, 2.0)),
    )
    rate = (0.05, -0.03, 0.2)
    still = np.tile(Rotation.from_euler("ZYX", (0.4, 0.1, -0.1)).as_quat(), (300, 1))
    moving = at_rest(300, (3.0, 0.2, 0.0), rate, still)
    world = Rotation.from_euler("z", turn)
    turned = at_rest(300, (3.0, 0.2, 0.0), rate, rotations.turned_about_up(still, turn))
    one = respond(station, Drive(START, 0.05, drive.wind, moving))
    other = respond(station, Drive(START, 0.05, world.apply(drive.wind), turned))
    np.testing.assert_allclose(other.rotors["cup"].psi, one.rotors["cup"].psi, atol=1e-7)
    difference = other.angles["vane"].angle - one.angles["vane"].angle
    np.testing.assert_allclose(np.angle(np.exp(1j * difference)), 0.0, atol=1e-7)


def test_a_boat_in_a_circle_feels_one_constant_wind() -> None:
    """Speed and direction that rotor and vane show, brought back to earth, stay the same."""
    count, dt, period, speed = 6000, 0.05, 300.0, 2.5
    t = dt * np.arange(count)
    yaw = 2 * np.pi * t / period
    rate = np.tile((0.0, 0.0, 2 * np.pi / period), (count, 1))
    forward = np.tile((speed, 0.0, 0.0), (count, 1))
    q = Rotation.from_euler("z", yaw[:, None])
    motion = Motion(q.as_quat(), forward, rate, np.zeros((count, 3)))
    station = Station(
        instruments=(vane(), cup(starting_speed=0.0, mu2=0.0, mu1=0.0)),
        platform=Platform(sensor_position=(0.5, 0.0, 1.5)),
    )
    found = respond(station, steady((5.0, -3.0, 0.0), count, dt, motion))
    reading, nose = found.rotors["cup"].y, found.angles["vane"].angle
    apparent = -reading[:, None] * np.stack((np.cos(nose), np.sin(nose), 0 * nose), axis=1)
    sensor = forward + np.cross(rate, (0.5, 0.0, 1.5))
    earth = q.apply(apparent + sensor)[200:]
    assert np.abs(earth - (5.0, -3.0, 0.0)).max() < 0.05
    np.testing.assert_allclose(earth.mean(axis=0), (5.0, -3.0, 0.0), atol=0.01)


def test_signals_with_the_motion_already_removed_show_the_wind_alone() -> None:
    station = Station(instruments=(cup(starting_speed=0.0),), platform=Platform(velocity_share=0.0))
    end = respond(station, steady((6, 0, 0), motion=at_rest(1200, (-4.0, 0.0, 0.0))))
    assert end.rotors["cup"].y[-1] == pytest.approx(6.0, rel=1e-7)


def test_downwash_of_a_hovering_multirotor_is_a_vertical_wind() -> None:
    c = cup(starting_speed=0.0, mu1=0.0, mu2=1.0)
    station = Station(instruments=(c,), platform=Platform(downwash=Downwash(induced_velocity=3.0)))
    end = respond(station, steady((0.001, 0, 0), 4000, motion=at_rest(4000)))
    assert end.rotors["cup"].y[-1] == pytest.approx(3.0, rel=1e-3)


def test_thin_air_lets_friction_win_and_changes_nothing_else() -> None:
    free, stiff = cup(starting_speed=0.0), cup(starting_speed=0.0, friction_speed=1.0)
    thin = np.full(1200, 0.6125)
    unhurt = respond(Station(instruments=(free,)), steady((5, 0, 0), density=thin)).rotors["cup"]
    assert unhurt.y[-1] == pytest.approx(5.0, rel=1e-7)
    # (5 - y) (0.8 * 5 + 0.2 y) = U_s^2 rho0 / rho, solved by hand.
    b, c = 4.0 - 0.2 * 5.0, 2.0 - 20.0
    expected = (-b + np.sqrt(b * b - 4 * 0.2 * c)) / 0.4
    slowed = respond(Station(instruments=(stiff,)), steady((5, 0, 0), density=thin)).rotors["cup"]
    assert slowed.y[-1] == pytest.approx(expected, rel=1e-6)


def test_a_bearing_that_sticks_lets_go_later_than_it_stops() -> None:
    """A wind of 3.8 m/s does not start a rotor that it keeps going; Stribeck's curve by hand."""
    sticky = cup(starting_speed=0.0, friction_speed=2.0, friction_breakaway=3.0)
    count = 2400
    speed = np.repeat((2.5, 3.8, 4.2, 3.8), count)
    wind = np.stack((speed, 0.0 * speed, 0.0 * speed), axis=1)
    y = respond(Station(instruments=(sticky,)), Drive(START, 0.05, wind)).rotors["cup"].y
    stopped, held, started, kept = y[count - 1 :: count]
    # At rest the air pushes with a4 U^2 = 11.6 against 3 U_s^2 = 12.
    assert stopped == held == 0.0
    for turning, blows in ((started, 4.2), (kept, 3.8)):
        push = (blows - turning) * (0.8 * blows + 0.2 * turning)
        assert turning > 2.0
        assert push == pytest.approx(4.0 * (1.0 + 2.0 * np.exp(-(turning**2))), rel=1e-3)


def test_a_braked_propeller_stalls_at_once_and_starts_in_a_far_stronger_wind() -> None:
    """A wind that keeps it going slowly does not start it; the torque of stalled blades by hand."""
    braked = propeller(axis=(1.0, 0.0, 0.0), friction_speed=2.0, friction_breakaway=4.0)
    count = 2400
    speed = np.repeat((2.5, 3.9, 4.2, 3.9, 3.0), count)
    wind = np.stack((speed, 0.0 * speed, 0.0 * speed), axis=1)
    y = respond(Station(instruments=(braked,)), Drive(START, 0.05, wind)).rotors["propeller"].y
    stopped, held, started, kept, stalled = y[count - 1 :: count]
    # At rest the air pushes with U^2 / 4: 3.8 at 3.9 m/s, against U_s^2 = 4.
    assert stopped == held == stalled == 0.0
    for turning, blows in ((started, 4.2), (kept, 3.9)):
        slip = 1.0 - turning / blows
        gone = 1.0 / (1.0 + np.exp((0.36 - slip) / 0.05))
        assert blows**2 * ((1.0 - gone) * slip + gone / 4.0) == pytest.approx(4.0, rel=1e-3)
        assert turning > 0.6 * blows
    # Blades that do not stall would turn it at 3 m/s, if slowly: (U - y) U = U_s^2.
    smooth = respond(
        Station(instruments=(braked.model_copy(update={"friction_breakaway": 1.0}),)),
        Drive(START, 0.05, wind),
    )
    assert smooth.rotors["propeller"].y[-1] == pytest.approx(3.0 - 4.0 / 3.0, rel=1e-3)


def test_a_change_in_the_middle_is_the_healthy_run_and_then_the_changed_one() -> None:
    drive = gusty(count=500)
    changed = Station(
        instruments=(vane(), cup()),
        changes=(
            Change(start=10.0, stop=18.0, instrument="cup", set={"calibration_gain": 0.9}),
            Change(start=12.0, instrument="vane", set={"damping_factor": 3.0}),
        ),
    )
    whole = respond(changed, drive)
    pieces, state = [], None
    for first, last, gain, damping in (
        (0, 200, 1.0, 1.0), (200, 240, 0.9, 1.0), (240, 360, 0.9, 3.0), (360, 499, 1.0, 3.0),
    ):
        station = Station(instruments=(vane(damping_factor=damping), cup(calibration_gain=gain)))
        part = Drive(START, drive.dt, drive.wind[first : last + 1])
        piece = respond(station, part, state)
        state = piece.final
        pieces.append(piece)
    y = np.concatenate([pieces[0].rotors["cup"].y, *(p.rotors["cup"].y[1:] for p in pieces[1:])])
    phi = np.concatenate(
        [pieces[0].angles["vane"].angle, *(p.angles["vane"].angle[1:] for p in pieces[1:])]
    )
    np.testing.assert_array_equal(whole.rotors["cup"].y, y)
    np.testing.assert_array_equal(whole.angles["vane"].angle, phi)


def test_a_change_of_a_key_that_does_not_exist_is_the_users_error() -> None:
    station = Station(
        instruments=(cup(),), changes=(Change(start=0.0, instrument="cup", set={"gian": 1.0}),)
    )
    with pytest.raises(UserError, match="gian"):
        respond(station, steady((5, 0, 0), 10))


def test_an_unequal_rotor_pulses_once_per_turn_and_its_mean_speed_stays() -> None:
    plain = respond(Station(instruments=(cup(starting_speed=0.0),)), steady((6, 0, 0)))
    uneven = respond(
        Station(instruments=(cup(starting_speed=0.0, torque_harmonic=0.1),)), steady((6, 0, 0))
    ).rotors["cup"]
    assert uneven.nodes > 1
    np.testing.assert_allclose(np.diff(uneven.psi[-2000:]).min() >= 0.0, True)
    late = uneven.y[uneven.y.size // 2 :]
    turns = uneven.psi[uneven.psi.size // 2 :]
    # Linearised: amplitude e A^2 / sqrt(A^2 + (l0 omega)^2), with omega = y / l.
    expected = 0.1 * 36 / np.hypot(6.0, 1.7 * 6.0 / 0.2)
    half_swing = 0.5 * (late.max() - late.min())
    assert half_swing == pytest.approx(expected, rel=0.02)
    fitted = np.polyfit(np.arange(late.size), turns, 1)[0] / uneven.dt * 0.2
    assert fitted == pytest.approx(plain.rotors["cup"].y[-1], rel=2e-3)


def test_a_weak_blade_beats_with_what_blows_across_the_shaft() -> None:
    # Three blades in a plane, each pulling as the rotor equation says of all of them, in the wind
    # that its own way meets: A - y - h l/r cos. The first pulls less by a third.
    forcing, across, length, distance, radius, weak = 6.0, 0.6, 0.08, 1.2, 0.08, 1.0 / 3.0
    share = np.array([1.0 - weak, 1.0, 1.0]) / 3.0
    places = 2.0 * np.pi / 3.0 * np.arange(3)

    def turn(_: float, state: FloatArray) -> FloatArray:
        y, psi = state
        slip = forcing - y + across * length / radius * np.cos(psi + places)
        return np.array([share @ slip * forcing / distance, y / length])

    time = np.arange(0.0, 12.0, 0.002)
    blades = solve_ivp(
        turn, (0.0, 12.0), [forcing, 0.0], t_eval=time, max_step=0.002, rtol=1e-9, atol=1e-9
    ).y
    axis = np.array([1.0, 0.0, 0.0])
    station = Station(
        instruments=(
            propeller(
                axis=tuple(axis), mounted_on="", calibration_distance=length, a4=1.0,
                distance_constant=distance, torque_harmonic=weak / 3.0,
            ),
        )
    )
    ours = respond(station, steady((forcing, across, 0.0))).rotors["propeller"]

    def beat(y: FloatArray, psi: FloatArray) -> float:
        late = slice(y.size // 2, None)
        return float(2.0 * abs(np.mean((y - y[late].mean())[late] * np.exp(1j * psi[late]))))

    expected = weak / 3.0 * forcing * across / (distance * forcing / length)
    assert beat(*blades) == pytest.approx(expected, rel=0.03)
    assert beat(ours.y, ours.psi) == pytest.approx(beat(*blades), rel=0.05)
