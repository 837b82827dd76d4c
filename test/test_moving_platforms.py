"""Wind from carriers that turn, sway and drive: circles, gaps, slow odometry, covariances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wind_sensors.estimation import (
    EstimatorSettings,
    HealthLevel,
    ProcessedRecording,
    make_estimator,
    process,
)
from wind_sensors.estimation.circumstances import CircumstanceSource, with_mount_covariance
from wind_sensors.estimation.intake import Block, Series
from wind_sensors.motion import earth_wind_covariance, frames, sensor_rotation
from wind_sensors.motion.platform_track import PlatformTrack, TrackLimits
from wind_sensors.recordings.station_files import configuration_folder, load_station
from wind_sensors.simulation import Scenario, Trajectory, simulate
from wind_sensors.simulation.trajectories import CARRIERS, boat
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Angles, PlatformStates, Pulses, Recording, Velocities
from wind_sensors.turbulence.synthesis import isotropic_spec

DIRECTION = 0.6


def moving_station(**platform: Any) -> Station:
    """Cup and vane on a boat."""
    return Station.model_validate(
        {
            "instruments": [
                {
                    "kind": "vane",
                    "name": "vane",
                    "joint_states": {"topic": "/vane"},
                    "distance_constant": 0.5,
                    "damping_ratio": 0.35,
                    "noise_deg": 0.3,
                },
                {
                    "kind": "cup",
                    "name": "cup",
                    "pulses": {"topic": "/cup"},
                    "pulses_per_revolution": 8,
                    "calibration_distance": 0.2,
                    "distance_constant": 1.7,
                    "mu2": 0.8,
                },
            ],
            "platform": {
                "odometry": {"topic": "/odometry"},
                "sensor_position": (0.3, 0.0, 1.5),
                **platform,
            },
        }
    )


def sailed(
    station: Station,
    trajectory: Trajectory,
    speed: float = 7.0,
    intensity: float = 0.1,
    duration: float = 120.0,
    **more: Any,
) -> Recording:
    """A simulated recording with its truth."""
    wind = isotropic_spec(speed, intensity, 60.0, direction=DIRECTION, seed=5)
    return simulate(station, Scenario(wind, duration=duration, trajectory=trajectory, **more))


def true_wind(recording: Recording, time: np.ndarray) -> np.ndarray:
    """East, north [m/s] at times [ns], shape (n, 2)."""
    truth = recording.truth
    assert truth is not None
    known = (truth.time - recording.start) * 1e-9
    at = (time - recording.start) * 1e-9
    return np.stack([np.interp(at, known, truth.velocity[:, k]) for k in range(2)], axis=1)


def health(found: ProcessedRecording, name: str) -> tuple[HealthLevel, str]:
    """Level and message of one item."""
    item = next(h for h in found.health if h.name == name)
    return item.level, item.message


@pytest.mark.parametrize("method", ["kalman", "inverse"])
def test_a_full_circle_in_a_constant_wind_gives_one_wind_in_all_headings(method: Any) -> None:
    """On a boat at 3 m/s each eighth of the circle says the same."""
    station = moving_station(attitude_noise_deg=0.5, velocity_noise=0.05)
    circle = Trajectory("circle", speed=3.0, turn_seconds=160.0)
    recording = sailed(station, circle, intensity=1e-4, duration=170.0, platform_noise=False)
    found = process(recording, EstimatorSettings(method=method))
    seconds = (found.time - recording.start) * 1e-9
    settled = (seconds > 5.0) & (seconds <= 165.0)
    velocity, covariance = found.velocity[settled], found.covariance[settled]
    heading = np.mod(2.0 * np.pi * seconds[settled] / 160.0, 2.0 * np.pi)
    expected = 7.0 * np.array([np.cos(DIRECTION), np.sin(DIRECTION)])
    means = []
    for sector in range(8):
        here = np.floor(heading / (np.pi / 4.0)) == sector
        assert np.count_nonzero(here) > 300
        mean = velocity[here, :2].mean(axis=0)
        spread = covariance[here, :2, :2].mean(axis=0)
        off = mean - expected
        # The 99 % ellipse of two components; errors inside a sector share one cause.
        assert off @ np.linalg.solve(spread, off) < 9.21
        means.append(mean)
    # The motion was 6 m/s from heading to heading; what remains of it is less than 1 %.
    assert np.ptp(means, axis=0).max() < 0.06


def test_without_odometry_no_wind_is_published_and_it_comes_back() -> None:
    recording = sailed(moving_station(), boat(), duration=120.0)
    states = recording.platform
    assert states is not None
    since = (states.time - recording.start) * 1e-9
    kept = (since < 50.0) | (since > 70.0)
    gone = replace(
        recording,
        platform=PlatformStates(
            states.time[kept], states.attitude[kept], states.velocity[kept],
            states.angular_rate[kept], states.position[kept],
        ),
    )
    found = process(gone)
    seconds = (found.time - recording.start) * 1e-9
    assert not np.any((seconds > 50.6) & (seconds < 69.4))
    assert np.isfinite(found.covariance).all()
    level, message = health(found, "motion")
    assert level == HealthLevel.WARN
    assert "left out" in message
    after = (seconds > 75.0) & (seconds < 118.0)
    off = found.velocity[after, :2] - true_wind(recording, found.time[after])
    deviation = np.sqrt(found.covariance[after][:, [0, 1], [0, 1]])
    assert np.mean(np.abs(off) < 3.0 * deviation) > 0.95
    # Beyond the last state the covariance grows before the estimate is refused.
    last = np.sqrt(found.covariance[seconds < 50.6, 0, 0])
    assert last[-1] > 1.5 * last[-40]


def test_a_platform_that_falls_silent_is_an_error_of_its_own() -> None:
    recording = sailed(moving_station(), boat(), duration=40.0)
    states = recording.platform
    assert states is not None
    early = (states.time - recording.start) * 1e-9 < 25.0
    silent = replace(
        recording,
        platform=PlatformStates(
            states.time[early], states.attitude[early], states.velocity[early],
            states.angular_rate[early], states.position[early],
        ),
    )
    level, message = health(process(silent), "motion")
    assert level == HealthLevel.ERROR
    assert "no wind is published" in message


def test_odometry_once_a_second_is_waited_for_and_interpolated() -> None:
    station = moving_station(angular_rate_noise_deg=0.0)
    calm_sea = Trajectory("circle", speed=3.0, turn_seconds=60.0)
    recording = sailed(station, calm_sea, platform_rate=1.0, platform_noise=False)
    found = process(recording)
    motion = next(h for h in found.health if h.name == "motion")
    # Only the half second after the very last state is guesswork.
    assert motion.level == HealthLevel.WARN
    assert int(motion.values["refused estimates"]) <= 11
    seconds = (found.time - recording.start) * 1e-9
    assert np.all((seconds[0] < 2.5, seconds[-1] > 119.0))
    inside = (seconds > 5.0) & (seconds < 115.0)
    off = found.velocity[inside, :2] - true_wind(recording, found.time[inside])
    assert np.sqrt(np.mean(np.square(off))) < 0.35


def test_slow_odometry_gives_the_same_bits_in_any_pieces() -> None:
    recording = sailed(moving_station(), boat(), platform_rate=2.0, duration=60.0)
    whole = process(recording, EstimatorSettings(smoother_lag=1.0))
    # Two recordings whose messages reach the estimator in another order within the window.
    pulses = {
        name: replace(p, time=p.time[_neighbours(p.time)]) for name, p in recording.pulses.items()
    }
    shuffled = replace(recording, pulses=pulses)
    again = process(shuffled, EstimatorSettings(smoother_lag=1.0))
    np.testing.assert_array_equal(whole.time, again.time)
    np.testing.assert_array_equal(whole.velocity, again.velocity)


def _neighbours(time: np.ndarray) -> np.ndarray:
    """Indices with every pair of neighbours exchanged."""
    index = np.arange(time.size)
    pairs = time.size // 2 * 2
    index[:pairs] = index[:pairs].reshape(-1, 2)[:, ::-1].ravel()
    return index


@pytest.mark.parametrize("axes", ["platform", "earth"])
def test_attitude_velocity_and_mounting_enter_the_covariance_as_the_kinematics_say(
    axes: str,
) -> None:
    station = moving_station(
        attitude_noise_deg=1.0, velocity_noise=0.1, mounting_noise_deg=2.0, velocity_axes=axes,
        sensor_rotation_deg=(0.0, 0.0, 30.0),
    )
    platform = station.platform
    assert platform is not None
    time = np.arange(0, 1_000_000_000, 50_000_000, dtype=np.int64)
    count = time.size
    yaw = 0.4
    states = PlatformStates(
        time=time,
        attitude=np.tile((0.0, 0.0, np.sin(0.5 * yaw), np.cos(0.5 * yaw)), (count, 1)),
        velocity=np.tile((3.0, 0.5, 0.0), (count, 1)),
        angular_rate=np.zeros((count, 3)),
        position=np.zeros((count, 3)),
    )
    value = np.hstack(
        (states.attitude, states.velocity, states.angular_rate, states.position)
    )
    nothing = Series(np.empty(0, dtype=np.int64), np.empty((0, 1)))
    source = CircumstanceSource(station, use_air=False)
    source.take(Block(0, 10**9, {}, {}, Series(time, value), nothing, nothing))
    wind = np.array([[5.0, -2.0, 0.0]])
    rows = source.at(time[:1], wind[0])
    found = with_mount_covariance(np.zeros((1, 3, 3)), wind, rows)
    limits = TrackLimits(attitude_deviation=np.radians(1.0), velocity_deviation=0.1)
    motion = PlatformTrack(states, limits).at(time[:1]).motion
    if axes == "earth":
        motion = replace(
            motion, velocity=np.einsum("nji,nj->ni", motion.to_earth, motion.velocity)
        )
    rotation = sensor_rotation(platform)
    in_platform = np.einsum("nji,nj->ni", motion.to_earth, wind) - motion.velocity
    expected = earth_wind_covariance(
        in_platform @ rotation,
        np.zeros((1, 3, 3)),
        motion,
        np.zeros(3),
        rotation,
        attitude_variance=np.radians(1.0) ** 2,
        velocity_variance=0.1**2,
        mounting_variance=np.radians(2.0) ** 2,
        velocity_in_earth=axes == "earth",
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_wind_is_kept_when_the_boat_outruns_it(seed: int) -> None:
    """At 5 m/s in a wind of 6.5 m/s the apparent wind falls to 1-2 m/s on every circle."""
    station = moving_station()
    downwind = replace(
        boat(speed=5.0, seed=seed), roll=np.radians(5.0), pitch=np.radians(2.5), turn_seconds=120.0
    )
    recording = sailed(station, downwind, speed=6.5, intensity=0.12, duration=300.0, seed=seed)
    found = process(recording)
    felt = np.hypot(found.apparent[:, 0], found.apparent[:, 1])
    assert felt.min() < 1.5
    inside = slice(200, -100)
    off = found.velocity[inside, :2] - true_wind(recording, found.time[inside])
    assert np.sqrt(np.mean(np.square(off))) < 0.6
    assert np.hypot(*off.mean(axis=0)) < 0.02 * felt.mean()
    estimate = next(h for h in found.health if h.name == "estimate")
    assert estimate.values["restarts"] == "0"


def test_a_multirotor_at_5_m_s_with_5_degrees_of_sway_keeps_the_mean_wind() -> None:
    """The error of the mean stays below 2 % of the apparent wind; 0.3 % over twelve minutes."""
    sway = np.radians(5.0)
    legs = replace(CARRIERS["multirotor"](speed=5.0, seed=1), roll=sway, pitch=sway)
    recording = sailed(moving_station(), legs, intensity=0.12, duration=240.0)
    found = process(recording)
    inside = slice(200, -100)
    mean = found.velocity[inside, :2].mean(axis=0)
    truth = true_wind(recording, found.time[inside]).mean(axis=0)
    felt = np.hypot(found.apparent[inside, 0], found.apparent[inside, 1]).mean()
    assert np.hypot(*(mean - truth)) < 0.02 * felt


@pytest.mark.parametrize(
    ("name", "carrier"), [("rover", "rover"), ("usv", "boat"), ("multirotor", "multirotor")]
)
def test_ready_configurations_give_the_wind_their_carrier_moves_in(name: str, carrier: str) -> None:
    station = load_station(Path(configuration_folder()) / f"{name}.yaml")
    recording = sailed(station, CARRIERS[carrier](speed=2.0, seed=4), speed=6.0, duration=180.0)
    found = process(recording)
    inside = slice(200, -100)
    truth = true_wind(recording, found.time[inside]).mean(axis=0)
    mean = found.velocity[inside, :2].mean(axis=0)
    felt = np.hypot(found.apparent[inside, 0], found.apparent[inside, 1]).mean()
    assert np.hypot(*(mean - truth)) < 0.02 * felt
    turned = frames.wrap(np.arctan2(*mean[::-1]) - np.arctan2(*truth[::-1]))
    assert abs(np.degrees(turned)) < 1.5


def test_a_platform_that_was_never_heard_of_is_said_so_and_no_wind_is_made_up() -> None:
    recording = replace(sailed(moving_station(), boat(), duration=40.0), platform=None)
    found = process(recording)
    assert found.time.size == 0
    assert health(found, "motion")[0] == HealthLevel.ERROR
    assert health(found, "platform")[0] == HealthLevel.STALE


def _told_apart(recording: Recording, keep: Callable[[Any], Any], step: int = 1) -> Recording:
    """The recording with its velocities at times of their own, of which some are kept.

    Args:
        keep: Tells of seconds since the start which velocities there are.
        step: Every so many states there is one.
    """
    states = recording.platform
    assert states is not None
    since = (states.time[::step] - recording.start) * 1e-9
    kept = keep(since)
    moved = Velocities(states.time[::step][kept], states.velocity[::step][kept])
    unknown = np.full_like(states.velocity, np.nan)
    return replace(
        recording, platform=replace(states, velocity=unknown), platform_velocity=moved
    )


def imu_station(**platform: Any) -> Station:
    """The boat with an Imu and a velocity of its own instead of odometry."""
    return moving_station(
        odometry=None, imu={"topic": "/imu"}, twist={"topic": "/velocity"}, **platform
    )


@pytest.mark.parametrize("method", ["kalman", "inverse", "naive"])
def test_without_a_velocity_no_wind_is_made_up_and_it_comes_back(method: Any) -> None:
    recording = sailed(imu_station(), boat(), duration=120.0)
    gone = _told_apart(recording, lambda s: (s < 50.0) | (s > 70.0))
    found = process(gone, EstimatorSettings(method=method))
    seconds = (found.time - recording.start) * 1e-9
    assert np.any(seconds < 50.0) and np.any(seconds > 75.0)
    assert not np.any((seconds > 50.6) & (seconds < 69.4))
    level, message = health(found, "motion")
    assert level == HealthLevel.WARN
    assert "attitude or velocity had not been heard of" in message


@pytest.mark.parametrize("never", [True, False])
def test_a_velocity_that_dies_or_never_comes_is_an_error_of_the_motion(never: bool) -> None:
    recording = sailed(imu_station(), boat(), duration=40.0)
    found = process(_told_apart(recording, lambda s: s < (0.0 if never else 25.0)))
    assert (found.time.size == 0) == never
    assert np.all((found.time - recording.start) * 1e-9 < 25.6)
    level, message = health(found, "motion")
    assert level == HealthLevel.ERROR
    assert ("heard of platform velocity" if never else "motion is not known") in message


def test_a_velocity_beside_every_attitude_gives_the_wind_of_odometry() -> None:
    recording = sailed(imu_station(), boat(), duration=60.0)
    with_odometry = replace(recording, station=moving_station())
    told_apart = _told_apart(recording, lambda s: s >= 0.0)
    bits = [process(r).velocity for r in (with_odometry, recording, told_apart)]
    np.testing.assert_array_equal(bits[1], bits[2])
    np.testing.assert_allclose(bits[0], bits[1], rtol=0, atol=1e-9)


def test_a_velocity_once_a_second_is_waited_for_and_alarms_nobody() -> None:
    station = imu_station()
    recording = sailed(station, Trajectory("circle", speed=3.0, turn_seconds=60.0), duration=90.0)
    slow = _told_apart(recording, lambda s: s >= 0.0, step=20)
    # A smoother that waits longer than the velocity would hide whether it is waited for.
    estimator = make_estimator(station, EstimatorSettings(smoother_lag=0.3))
    assert slow.platform is not None and slow.platform_velocity is not None
    calls: list[tuple[int, Callable[[], None]]] = [
        (time, partial(estimator.add_pulse, "cup", time))
        for time in recording.pulses["cup"].time.tolist()
    ]
    angles = recording.angles["vane"]
    for time, angle in zip(angles.time.tolist(), angles.angle.tolist(), strict=True):
        calls.append((time, partial(estimator.add_angle, "vane", time, angle)))
    states = slow.platform
    for i, time in enumerate(states.time.tolist()):
        told = states.attitude[i], None, states.angular_rate[i], states.position[i]
        calls.append((time, partial(estimator.add_platform, time, *told)))
    moved = slow.platform_velocity
    for time, velocity in zip(moved.time.tolist(), moved.velocity, strict=True):
        calls.append((time, partial(estimator.add_platform_velocity, time, velocity)))
    alarms, refused = set(), set()
    for time, call in sorted(calls, key=lambda item: item[0]):
        call()
        if estimator.take_estimates() and time > recording.start + 20e9:
            items = {item.name: item for item in estimator.health()}
            for name in ("cup", "vane", "platform", "platform velocity", "clock"):
                if items[name].level != HealthLevel.OK:
                    alarms.add((name, items[name].message))
            refused.add(items["motion"].values["refused estimates"])
    assert not alarms
    # How slow it is was learnt within those 20 s.
    assert len(refused) == 1
    found = process(slow)
    off = found.velocity[:, :2] - true_wind(recording, found.time)
    assert np.sqrt(np.mean(np.square(off[200:-100]))) < 0.35


def test_a_clock_that_jumps_back_does_not_end_the_wind_of_an_imu_with_a_velocity() -> None:
    recording = _told_apart(sailed(imu_station(), boat(), duration=40.0), lambda s: s >= 0.0)
    states, moved = recording.platform, recording.platform_velocity
    assert states is not None and moved is not None

    def again(*signals: Any) -> list[Any]:
        return [np.concatenate((signal, signal)) for signal in signals]

    pulses, angles = recording.pulses["cup"], recording.angles["vane"]
    twice = replace(
        recording,
        pulses={"cup": Pulses(*again(pulses.time))},
        angles={"vane": Angles(*again(angles.time, angles.angle))},
        platform=PlatformStates(
            *again(
                states.time, states.attitude, states.velocity, states.angular_rate, states.position
            )
        ),
        platform_velocity=Velocities(*again(moved.time, moved.velocity)),
    )
    once, found = process(recording), process(twice)
    np.testing.assert_array_equal(found.time[-300:], once.time[-300:])
    np.testing.assert_array_equal(found.velocity[-300:], once.velocity[-300:])
    assert found.time.size > 1.9 * once.time.size


@pytest.mark.parametrize("late", [False, True])
def test_what_is_left_out_until_the_platform_is_heard_of_alarms_only_if_it_lasts(
    late: bool,
) -> None:
    recording = sailed(moving_station(), boat(), duration=40.0)
    states = recording.platform
    assert states is not None
    heard = (states.time - recording.start) * 1e-9 > (20.0 if late else 1.0)
    found = process(
        replace(
            recording,
            platform=PlatformStates(
                states.time[heard], states.attitude[heard], states.velocity[heard],
                states.angular_rate[heard], states.position[heard],
            ),
        )
    )
    assert found.time[0] > recording.start + (19.0 if late else 0.4) * 1e9
    assert health(found, "motion")[0] == (HealthLevel.WARN if late else HealthLevel.OK)


def test_an_unsure_mounting_makes_the_mean_direction_as_unsure_and_hardly_the_speed() -> None:
    """A sensor that may be turned by 3 degrees may have turned the felt wind by 3 degrees."""
    straight = Trajectory("hold", speed=0.0)
    known, unsure = (
        process(
            sailed(moving_station(mounting_noise_deg=degrees), straight, duration=100.0),
            EstimatorSettings(window=100.0),
        ).windows[0]
        for degrees in (0.0, 3.0)
    )
    added = np.sqrt(unsure.direction_uncertainty**2 - known.direction_uncertainty**2)
    assert np.degrees(added) == pytest.approx(3.0, rel=0.03)
    # Roll and pitch are unsure too, but they only lift the horizontal wind.
    along = np.array([np.cos(unsure.direction), np.sin(unsure.direction), 0.0])
    grown = unsure.vector_mean_covariance - known.vector_mean_covariance
    assert along @ grown @ along < 0.02 * np.trace(grown[:2, :2])
