"""Whole simulations: same bits however they are read, motion that fits together, faults."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.recordings import read_recording, write_recording
from wind_sensors.simulation import (
    CARRIERS,
    Scenario,
    SignalStream,
    Trajectory,
    TransportFaults,
    angle_readings,
    drive_from_recording,
    edge_times,
    respond,
    simulate,
)
from wind_sensors.simulation.blocks import SignalBlock
from wind_sensors.simulation.transport import events_of, live_events, received
from wind_sensors.station.model import (
    Air,
    Bivane,
    Change,
    Clock,
    Cup,
    Electronics,
    HeadingDeviation,
    Input,
    Platform,
    Reference,
    Station,
    Vane,
)
from wind_sensors.station.signals import Recording
from wind_sensors.turbulence import von_karman
from wind_sensors.turbulence.synthesis import isotropic_spec


def station(moving: bool = False, **keys: Any) -> Station:
    instruments = (
        Vane(
            name="vane", joint_states=Input(topic="/vane"), distance_constant=0.5,
            damping_ratio=0.3, noise_deg=0.2,
        ),
        Cup(
            name="cup", pulses=Input(topic="/cup"), pulses_per_revolution=4,
            calibration_distance=0.2, distance_constant=1.7,
            electronics=Electronics(loss_probability=0.05, bounce_probability=0.02),
        ),
    )
    if moving:
        keys.setdefault(
            "platform",
            Platform(odometry=Input(topic="/odom"), sensor_position=(0.3, 0.0, 2.0)),
        )
    return Station(
        instruments=keys.pop("instruments", instruments),
        reference=Reference(topic=Input(topic="/sonic"), separation=0.5, path_length=0.1),
        air=Air(temperature=Input(topic="/t"), pressure=Input(topic="/p")),
        **keys,
    )


def scenario(**changes: Any) -> Scenario:
    wind = isotropic_spec(7.0, 0.15, 40.0, direction=0.8, seed=changes.get("seed", 0))
    return replace(Scenario(wind, duration=35.0), **changes)


def arrays(recording: Recording | SignalBlock) -> dict[str, np.ndarray]:
    out: dict[str, np.ndarray] = {f"p/{n}": p.time for n, p in recording.pulses.items()}
    for n, a in recording.angles.items():
        out |= {f"a/{n}/t": a.time, f"a/{n}": a.angle}
    for name in ("reference", "truth"):
        out[name] = getattr(recording, name).velocity
    assert recording.temperature is not None
    out["temperature"] = recording.temperature.value
    if recording.platform is not None:
        out |= {"q": recording.platform.attitude, "v": recording.platform.velocity}
    return out


def joined_blocks(blocks: Iterable[SignalBlock]) -> dict[str, np.ndarray]:
    parts = [arrays(b) for b in blocks]
    return {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}


@pytest.mark.parametrize("carrier", [None, "boat", "multirotor"])
@pytest.mark.parametrize("step", [0.37, 4.0, 31.0])
def test_a_stream_read_in_any_steps_gives_the_bits_of_the_whole(
    carrier: str | None, step: float
) -> None:
    trajectory = None if carrier is None else CARRIERS[carrier](seed=2)
    s = station(
        moving=carrier is not None,
        changes=(Change(start=12.3, instrument="vane", set={"offset_deg": 20.0}),),
    )
    whole = arrays(simulate(s, scenario(trajectory=trajectory)))
    stream = SignalStream(s, scenario(trajectory=trajectory))
    stops = [*np.arange(step, 35.0, step), 35.0]
    pieces = joined_blocks([stream.read(stream.start + round(t * 1e9)) for t in stops])
    for name, values in whole.items():
        np.testing.assert_array_equal(pieces[name], values, err_msg=name)


def test_the_seed_decides_everything_and_another_seed_another_thing() -> None:
    one, same = arrays(simulate(station(), scenario())), arrays(simulate(station(), scenario()))
    other = arrays(simulate(station(), scenario(seed=1)))
    for name, values in one.items():
        np.testing.assert_array_equal(values, same[name])
    for name in ("p/cup", "a/vane", "reference", "truth"):
        assert not np.array_equal(one[name], other[name]), name


def test_rates_and_ends_are_those_asked_for() -> None:
    recording = simulate(
        station(), scenario(duration=33.3, vane_rate=8.0, reference_rate=10.0, air_rate=0.5)
    )
    assert recording.stop - recording.start == 33_300_000_000
    vane = recording.angles["vane"].time
    np.testing.assert_allclose(np.diff(vane) * 1e-9, 0.125, atol=2e-9)
    assert recording.reference is not None and recording.temperature is not None
    assert len(vane) == 267 and len(recording.reference.time) == 333
    assert len(recording.temperature.time) == 17
    assert recording.pulses["cup"].time.max() < recording.stop


def test_the_reference_differs_from_the_sensors_wind_by_the_structure_function() -> None:
    """0.5 m across an isotropic field: increments of variance D_L to D_T of that distance."""
    s = station().model_copy(
        update={"reference": Reference(topic=Input(topic="/r"), separation=0.5, noise=0.0)}
    )
    found = simulate(s, scenario(duration=600.0))
    assert found.reference is not None and found.truth is not None
    spread = np.var(found.reference.velocity - found.truth.velocity, axis=0).mean()
    sigma, q = 0.15 * 7.0, von_karman.wavenumber_from_integral_length(40.0)
    along = float(von_karman.longitudinal_structure_function(0.5, sigma**2, q))
    across = float(von_karman.transverse_structure_function(0.5, sigma**2, q))
    assert 0.6 * along < spread < 1.4 * across
    np.testing.assert_allclose(
        found.reference.velocity.var(axis=0), found.truth.velocity.var(axis=0), rtol=0.1
    )


@pytest.mark.parametrize("towards", [0.0, np.pi])
def test_a_robot_meets_gusts_at_its_speed_through_the_air(towards: float) -> None:
    """Taylor in the earth frame: increments over 0.2 s are those over |U - V| 0.2 s."""
    drive = Trajectory(speed=4.0, course=0.8 + towards)
    found = simulate(station(moving=True), scenario(duration=600.0, trajectory=drive))
    assert found.truth is not None
    steps = found.truth.velocity[4:] - found.truth.velocity[:-4]
    pace = 7.0 - 4.0 * np.cos(towards)
    sigma, q = 0.15 * 7.0, von_karman.wavenumber_from_integral_length(40.0)
    distance = pace * 0.2
    along = float(von_karman.longitudinal_structure_function(distance, sigma**2, q))
    across = float(von_karman.transverse_structure_function(distance, sigma**2, q))
    assert np.sum(steps**2, axis=1).mean() == pytest.approx(along + 2 * across, rel=0.1)


@pytest.mark.parametrize("carrier", sorted(CARRIERS))
def test_attitude_rates_velocity_and_position_of_a_carrier_fit_together(carrier: str) -> None:
    trajectory = CARRIERS[carrier](seed=5)
    found = simulate(
        station(moving=True),
        scenario(trajectory=trajectory, platform_noise=False, sample_rate=100.0,
                 platform_rate=100.0, duration=130.0),
    ).platform
    assert found is not None
    q = Rotation.from_quat(found.attitude)
    turned = (q[:-2].inv() * q[2:]).as_rotvec() / 0.02
    assert np.abs(turned - found.angular_rate[1:-1]).max() < 2e-2
    assert np.sqrt(np.mean((turned - found.angular_rate[1:-1]) ** 2)) < 2e-3
    moved = (found.position[2:] - found.position[:-2]) / 0.02
    earth = q.apply(found.velocity)[1:-1]
    np.testing.assert_allclose(moved, earth, atol=5e-3)
    if carrier == "fixed-wing":
        assert np.linalg.norm(found.velocity, axis=1).mean() == pytest.approx(16.0, abs=0.5)


ERRORS = Platform(
    odometry=Input(topic="/odom"), sensor_position=(0.3, 0.0, 2.0), frame="ned",
    velocity_axes="earth", velocity_scale=1.1, heading_reference="magnetic",
    magnetic_declination_deg=12.0, heading_deviation=HeadingDeviation(sine_deg=6.0),
)


@pytest.mark.parametrize("platform", [None, ERRORS])
def test_the_recorded_motion_drives_the_same_pulses_again(platform: Platform | None) -> None:
    keys = {} if platform is None else {"platform": platform}
    s = station(moving=True, **keys)
    found = simulate(
        s, scenario(trajectory=CARRIERS["boat"](), platform_noise=False, duration=60.0)
    )
    again = respond(s, drive_from_recording(found, wind=found.truth))
    edges = edge_times(again, "cup")
    recorded = found.pulses["cup"].time
    both = min(len(edges), len(recorded))
    assert np.abs(edges[:both] - recorded[:both]).max() < 20_000


def test_a_platform_clock_that_is_late_is_undone() -> None:
    late = Platform(odometry=Input(topic="/odom"), clock=Clock(latency=0.4))
    s = station(moving=True, platform=late)
    found = simulate(
        s, scenario(trajectory=CARRIERS["boat"](), platform_noise=False, duration=60.0)
    )
    on_time = s.model_copy(update={"platform": Platform(odometry=Input(topic="/odom"))})
    drive = drive_from_recording(found, wind=found.truth)
    seen = found.angles["vane"]
    error = {}
    for name, believed in (("late", s), ("on time", on_time)):
        again = angle_readings(respond(believed, drive), "vane", seen.time)
        error[name] = np.std(np.angle(np.exp(1j * (again - seen.angle)))[200:-200])
    assert error["late"] == pytest.approx(np.radians(0.2), rel=0.1), "the noise is left"
    assert error["on time"] > 3.0 * error["late"]


def test_a_measured_wind_blows_again() -> None:
    first = simulate(station(), scenario(duration=40.0))
    assert first.truth is not None
    again = simulate(station(), Scenario(first.truth, duration=39.0))
    known = first.pulses["cup"].time
    found = again.pulses["cup"].time
    np.testing.assert_allclose(found, known[: len(found)], atol=50_000)
    with pytest.raises(UserError, match="lasts"):
        simulate(station(), Scenario(first.truth, duration=60.0))


def test_following_a_track_moves_as_it_did_and_ends_where_it_ends() -> None:
    s = station(moving=True)
    first = simulate(s, scenario(trajectory=CARRIERS["rover"](), platform_noise=False))
    again = simulate(s, scenario(trajectory=first.platform, platform_noise=False, duration=30.0))
    assert first.platform is not None and again.platform is not None
    count = len(again.platform.time)
    np.testing.assert_allclose(again.platform.velocity, first.platform.velocity[:count], atol=1e-9)
    with pytest.raises(UserError, match="ends after"):
        simulate(s, scenario(trajectory=first.platform, duration=60.0))


@pytest.mark.parametrize("clock", [Clock(), Clock(latency=-0.3), Clock(latency=0.3, drift=1e-3)])
def test_live_messages_are_those_of_the_recording_in_the_same_order(clock: Clock) -> None:
    s = station()
    s = s.model_copy(
        update={"instruments": tuple(i.model_copy(update={"clock": clock}) for i in s.instruments)}
    )
    faults = TransportFaults(
        delay=0.02, jitter=0.05, loss=0.1, doubling=0.1, holding=0.05, not_a_number=0.05, seed=3
    )
    offline = events_of(simulate(s, scenario(faults=faults)), faults)
    count = next(
        k for k, e in enumerate(offline) if e.arrival > offline[0].arrival + 30_000_000_000
    )
    live = list(islice(live_events(SignalStream(s, scenario(faults=faults)), 0.7), count))
    for a, b in zip(live, offline[:count], strict=True):
        assert a[:3] == b[:3] and a.number == b.number
        np.testing.assert_array_equal(a.values, b.values)


def test_faults_have_their_stated_shares_and_touch_nothing_else() -> None:
    whole = simulate(station(), scenario(duration=300.0))
    plain = {(e.source, e.number): e for e in events_of(whole)}
    faults = TransportFaults(loss=0.1, doubling=0.2, jitter=0.05, not_a_number=0.1)
    found = events_of(whole, faults)
    assert [e.arrival for e in found] == sorted(e.arrival for e in found)
    of_vane = [e for e in found if e.source == "angles/vane"]
    sent = whole.angles["vane"].time.size
    assert len(of_vane) / sent == pytest.approx(0.9 * 1.2, abs=0.03)
    assert len({e.number for e in of_vane}) / sent == pytest.approx(0.9, abs=0.02)
    broken = np.mean([np.isnan(e.values[0]) for e in of_vane])
    assert broken == pytest.approx(0.1, abs=0.02)
    for e in found:
        original = plain[e.source, e.number]
        assert e.stamp == original.stamp
        assert 0 <= e.arrival - e.stamp <= 50_000_000
        if not np.isnan(e.values).any():
            assert e.values == original.values
    truth = [e for e in found if e.source == "truth"]
    assert whole.truth is not None
    assert len(truth) == len(whole.truth.time)


def test_a_clock_jumps_once_and_a_counter_wraps() -> None:
    whole = simulate(station(), scenario())
    faults = TransportFaults(clock_jump_at=20.0, clock_jump=-5.0, counter_modulus=16)
    found = [e for e in events_of(whole, faults) if e.source == "pulses/cup"]
    stamps = np.array([e.stamp for e in found])
    shift = stamps - whole.pulses["cup"].time
    late = whole.pulses["cup"].time >= whole.start + 20_000_000_000
    np.testing.assert_array_equal(shift, np.where(late, -5_000_000_000, 0))
    assert [e.number for e in found] == [k % 16 for k in range(len(found))]


def test_a_logger_behind_faults_keeps_the_counts_of_its_counter() -> None:
    s = station()
    counting = s.instrument("cup").model_copy(
        update={"pulses": Input(topic="/cup", meaning="count"), "electronics": Electronics()}
    )
    s = s.model_copy(update={"instruments": (s.instrument("vane"), counting)})
    whole = simulate(s, scenario())
    found = received(whole, TransportFaults(loss=0.3)).pulses["cup"]
    assert len(found.time) < len(whole.pulses["cup"].time)
    numbers = np.searchsorted(whole.pulses["cup"].time, found.time)
    assert found.turns is not None
    np.testing.assert_allclose(found.turns, (numbers + 1) / 4)


def test_a_scenario_that_does_not_fit_the_station_is_the_users_error() -> None:
    with pytest.raises(UserError, match="mast"):
        simulate(station(), scenario(trajectory=Trajectory()))
    with pytest.raises(UserError, match="wind cannot be made"):
        simulate(station(), Scenario(isotropic_spec(-1.0, 0.1, 50.0)))


def test_a_bivane_signals_both_angles() -> None:
    b = Bivane(
        name="bivane", azimuth=Input(topic="/az"), elevation=Input(topic="/el"),
        distance_constant=2.4, damping_ratio=0.3,
    )
    found = simulate(station(instruments=(b,)), scenario(duration=120.0))
    elevation = found.angles["bivane/elevation"].angle
    assert found.truth is not None
    w_over_h = found.truth.velocity[:, 2] / np.hypot(*found.truth.velocity[:, :2].T)
    assert np.corrcoef(elevation, w_over_h)[0, 1] > 0.5
    assert found.angles["bivane"].time.size == elevation.size


def test_the_command_writes_what_was_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "simulated"
    command = ["simulate", "mast_cup_vane", "-o", str(out), "--duration", "20s", "--seed", "4"]
    assert main([*command, "--direction-from", "200", "--surface-layer"]) == 0
    assert "times real time" in capsys.readouterr().out
    found = read_recording(out)
    assert found.truth is not None and found.pulses and found.angles
    mean = found.truth.velocity.mean(axis=0)
    assert np.degrees(np.arctan2(-mean[0], -mean[1])) % 360.0 == pytest.approx(200.0, abs=10.0)
    assert main(command) == 2, "what is there is not overwritten"
    assert "--force" in capsys.readouterr().err
    assert main([*command, "--carrier", "boat", "--force"]) == 2, "a mast does not sail"


def test_what_the_command_writes_can_be_compared(tmp_path: Path) -> None:
    first, again, blown = (str(tmp_path / name) for name in ("first", "again", "blown"))
    duration = ["--duration", "20s"]
    assert main(["simulate", "mast_cup_vane", "-o", first, *duration]) == 0
    found = read_recording(first)
    assert found.reference is not None and found.truth is not None
    assert np.array_equal(found.reference.velocity, found.truth.velocity)
    assert len(drive_from_recording(found)) == 400
    assert main(["simulate", f"{first}/recording.yaml", "-o", again, *duration]) == 0
    repeated = read_recording(again)
    assert np.array_equal(repeated.pulses["cup"].time, found.pulses["cup"].time)
    bare = replace(found, station=found.station.model_copy(update={"reference": None}))
    write_recording(first, bare, force=True)
    with pytest.raises(UserError, match=r"Add `reference: {kind: truth, topic: /truth/wind}`"):
        drive_from_recording(read_recording(first))
    assert main(["simulate", "mast_cup_vane", "--wind", first, "-o", blown]) == 0


def test_a_rate_that_would_fill_the_memory_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["simulate", "mast_cup_vane", "-o", str(tmp_path / "s"), "--duration", "20s"]
    with pytest.raises(SystemExit) as stopped:
        main([*command, "--rate", "1e7"])
    assert stopped.value.code == 2
    assert "at most 1000 per second" in capsys.readouterr().err
