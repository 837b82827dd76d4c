"""The world obeys the laws it is built on, and every cause leaves a trace."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from proving_ground.boat import quaternion, rotation
from proving_ground.concealed.kinds import activity_between
from proving_ground.concealed.registry import CATALOGUED, cause
from proving_ground.concealed.rotor import drag_for_loss
from proving_ground.concealed.strangers import STRANGERS
from proving_ground.drive import SUBSTEPS, turn_vane
from proving_ground.generate import Planted, generate_recording, healthy, with_effect
from proving_ground.inflow import Array, make_eddies
from proving_ground.measure import Signals, run_scene
from proving_ground.minimum_sizes import MINIMUM_SIZES, applicable
from proving_ground.scene import build_scene
from proving_ground.stations import CupRotor, Shaft, Station, random_station
from proving_ground.tunnel import (
    STEP,
    cup_path,
    cup_tracks,
    fin_tracks,
    rotor_sheet,
    steady_rate,
    uniform_flow,
    vane_sheet,
)

MINUTES = 1.5


@pytest.fixture(scope="module")
def stations() -> dict[str, Station]:
    drawn = {kind: random_station(kind, 1) for kind in "ABC"}
    return {
        kind: replace(station, sonic=replace(station.sonic, dropouts=0.0))
        for kind, station in drawn.items()
    }


def signals_of(station: Station, seed: int, *planted: Planted) -> Signals:
    spec = with_effect(station, planted, 0.0, seed, MINUTES)
    scene = build_scene(station, spec.weather, MINUTES, seed)
    for each in spec.planted:
        size = MINIMUM_SIZES[each.effect].value if each.effect in CATALOGUED else 1.0
        activity = activity_between(scene.time, each.begin, each.end)
        cause(each.effect).plant(scene, size * each.size_factor, activity)
    return run_scene(scene)


def apart(one: Signals, other: Signals) -> float:
    """Largest difference between two recordings, in the units of their channels."""
    if one.pulses.size != other.pulses.size:
        return np.inf
    pairs = [
        (one.pulses, other.pulses),
        (np.exp(1j * one.vane), np.exp(1j * other.vane)),
        (one.vane_time, other.vane_time),
        (one.reference, other.reference),
    ]
    if one.odometry is not None and other.odometry is not None:
        pairs += [
            (one.odometry.velocity, other.odometry.velocity),
            (one.odometry.yaw, other.odometry.yaw),
        ]
    return max(float(np.max(np.abs(a - b))) for a, b in pairs)


@pytest.mark.parametrize("effect", [n for n, size in MINIMUM_SIZES.items() if size.graded])
def test_the_largest_size_is_planted_as_large_as_it_says(
    stations: dict[str, Station], effect: str
) -> None:
    largest = MINIMUM_SIZES[effect]
    station = next(s for kind, s in stations.items() if kind in largest.kinds)

    def planted(size: float) -> object:
        # As long as a sealed recording: a signal stands still for a part of it at most.
        scene = build_scene(station, with_effect(station, (), 0.0, 3, 15.0).weather, 15.0, 3)
        return cause(effect).plant(scene, largest.value * size, np.ones(scene.time.size))

    # Steps of a reading divide the turn: the next smaller ones are a good deal smaller.
    less = 0.8 if effect == "quantisation" else 0.97
    assert planted(largest.most) != planted(less * largest.most)


def test_a_frictionless_rotor_turns_in_proportion_to_the_wind(
    stations: dict[str, Station],
) -> None:
    rotor = stations["A"].rotor
    assert isinstance(rotor, CupRotor)
    free = replace(rotor, shaft=Shaft(rotor.shaft.inertia, 0.0, 0.0, 0.0, 0.0))
    ratio = [steady_rate(free, speed) / speed for speed in (3.0, 6.0, 12.0)]
    assert np.ptp(ratio) / ratio[0] < 0.003


def test_a_rotor_with_stuck_bearing_does_not_start_and_then_does(
    stations: dict[str, Station],
) -> None:
    rotor = stations["A"].rotor
    assert isinstance(rotor, CupRotor)
    flow = uniform_flow(2.0, 0.0, 5.0)
    tracks = cup_tracks(rotor, len(flow))
    tracks.static[:] = 10.0
    assert np.ptp(cup_path(rotor, flow, 0.0, tracks)) == 0.0
    assert cup_path(rotor, flow, 0.0)[-1] > 1.0


def test_distance_constant_does_not_depend_on_the_wind_or_its_density_twice(
    stations: dict[str, Station],
) -> None:
    rotor = stations["A"].rotor
    assert isinstance(rotor, CupRotor)
    heavy = replace(rotor, shaft=replace(rotor.shaft, inertia=2.0 * rotor.shaft.inertia))
    assert rotor_sheet(heavy).distance_constant == pytest.approx(
        2.0 * rotor_sheet(rotor).distance_constant, rel=0.06
    )


def test_the_vane_swings_as_thin_fin_theory_says_for_small_angles(
    stations: dict[str, Station],
) -> None:
    vane = stations["A"].vane
    fin = vane.geometry
    distance = np.sqrt(2.0 * vane.shaft.inertia / (1.225 * fin.arm * fin.area * fin.slope))
    sheet = vane_sheet(vane)
    assert sheet.distance_constant == pytest.approx(distance, rel=0.1)
    assert sheet.damping_ratio == pytest.approx(fin.arm / (2.0 * distance), rel=0.25)


@pytest.mark.parametrize("seed", [7, 10_000, 10_031, 10_042])
def test_no_propeller_holds_its_vane_the_wrong_way_round(seed: int) -> None:
    vane = random_station("C", seed).vane
    flow = uniform_flow(5.0, 0.0, 20.0)
    # Blown at from behind, eight degrees off; a wind from the west is headed at pi.
    path = turn_vane(
        flow, vane.geometry, fin_tracks(vane.shaft, len(flow)), np.radians(8.0), 0.0, STEP, SUBSTEPS
    )
    away = np.abs(np.angle(np.exp(1j * (path - np.pi))))
    assert away[0] > np.radians(170.0)
    assert away[-1] < np.radians(5.0)


def test_a_vane_without_friction_does_not_know_that_its_mount_turns() -> None:
    vane = random_station("B", 10_003).vane
    free = replace(vane.shaft, static=0.0, coulomb=0.0, viscous=0.0)
    time = np.arange(int(30.0 / STEP / SUBSTEPS)) * STEP * SUBSTEPS
    yaw = 0.4 * np.sin(2.0 * time) + 0.02 * np.sin(5.0 * time)
    blows_to = 0.6 * np.sin(0.9 * time)

    def heading(mount: Array) -> Array:
        speed = np.array(4.0) + np.sin(0.7 * time)
        flow = np.zeros((len(time), 3))
        flow[:, 0] = speed * np.cos(blows_to - mount)
        flow[:, 1] = speed * np.sin(blows_to - mount)
        tracks = fin_tracks(free, len(time))
        rate = np.gradient(mount, time)
        tracks.mount_rate[:] = rate
        tracks.mount_acceleration[:] = np.gradient(rate, time)
        nose = np.pi - mount[0]
        return mount + turn_vane(
            flow, vane.geometry, tracks, float(nose), float(-rate[0]), STEP, SUBSTEPS
        )

    on_earth = heading(np.zeros_like(time))
    assert np.ptp(on_earth) > 0.5
    assert heading(yaw) == pytest.approx(on_earth, abs=6e-3)


def test_friction_planted_for_a_loss_gives_that_loss(stations: dict[str, Station]) -> None:
    rotor = stations["A"].rotor
    assert isinstance(rotor, CupRotor)
    torque = drag_for_loss(rotor, 5.0, 0.2)
    flow = uniform_flow(5.0, 0.0, 16.0)
    tracks = cup_tracks(rotor, len(flow))
    tracks.coulomb[:] += torque
    tracks.static[:] += torque
    rate = 5.0 / rotor.geometry.cruise
    with_drag = cup_path(rotor, flow, rate, tracks)
    without = cup_path(rotor, flow, rate)
    half = len(with_drag) // 2
    loss = ((without[-1] - without[half]) - (with_drag[-1] - with_drag[half])) / 8.0
    assert loss * rotor.geometry.cruise == pytest.approx(0.2, rel=0.05)


def test_eddies_fall_off_with_the_minus_five_thirds_law_and_part_with_distance() -> None:
    rng = np.random.default_rng(3)
    field = make_eddies(rng, 60_000.0, 10.0, 0.5, 20.0, 400.0)
    wavenumber = 2.0 * np.pi * np.fft.rfftfreq(len(field.reference), field.spacing)
    one = np.fft.rfft(field.reference[:, 0])
    two = np.fft.rfft(field.instrument[:, 0])

    def band(low: float, high: float) -> tuple[float, float]:
        inside = (wavenumber > low) & (wavenumber < high)
        power = float(np.mean(np.abs(one[inside]) ** 2))
        cross = abs(np.mean(one[inside] * np.conj(two[inside])))
        return power, float(cross / np.sqrt(power * np.mean(np.abs(two[inside]) ** 2)))

    low, near = band(1.0, 1.2)
    high, far = band(8.0, 9.6)
    assert np.log(high / low) / np.log(8.0) == pytest.approx(-5.0 / 3.0, abs=0.15)
    assert near == pytest.approx(np.exp(-20.0 * 1.1 * 0.5 / (2.0 * np.pi)), abs=0.06)
    assert far < 0.1


def test_turning_by_quaternion_and_by_matrix_agree() -> None:
    yaw, pitch, roll = np.array([0.7]), np.array([-0.3]), np.array([0.4])
    w, x, y, z = quaternion(yaw, pitch, roll)[0]
    vector = np.array([1.0, -2.0, 0.5])
    axis = np.array([x, y, z])
    turned = vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)
    assert np.allclose(turned, rotation(yaw, pitch, roll)[0] @ vector)


def test_the_same_spec_gives_the_same_recording_to_the_last_byte(
    stations: dict[str, Station], tmp_path: Path
) -> None:
    spec = with_effect(stations["C"], "wake_shadow", 3.0, 11, 0.5)
    first = generate_recording(spec.into(tmp_path / "one"))
    second = generate_recording(spec.into(tmp_path / "two"))
    assert first == second
    one, two = (
        {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        for folder in (tmp_path / "one", tmp_path / "two")
    )
    assert one == two
    assert {"recording.yaml", "metadata.yaml"} <= {path.name for path in one}
    assert any(path.suffix == ".mcap" and len(content) > 100_000 for path, content in one.items())
    assert first[0]["effect"] == "wake_shadow"
    assert "wake" not in (tmp_path / "one" / "recording.yaml").read_text()


@pytest.mark.parametrize("kind", ["A", "B", "C"])
def test_a_healthy_rotor_agrees_with_its_certificate_in_the_mean(
    stations: dict[str, Station], kind: str
) -> None:
    station = stations[kind]
    signals = signals_of(station, 5)
    sheet = rotor_sheet(station.rotor)
    flow = build_scene(station, healthy(station, 5).weather, MINUTES, 5).rotor_flow
    wind_run = float(np.hypot(flow[:, 0], flow[:, 1]).mean()) * MINUTES * 60.0
    turns = signals.pulses.size / station.pulses_per_revolution
    indicated = 2.0 * np.pi * sheet.calibration_distance * turns
    indicated += sheet.starting_speed * MINUTES * 60.0
    assert indicated == pytest.approx(wind_run, rel=0.025)


@pytest.mark.parametrize("kind", ["A", "B", "C"])
def test_every_cause_leaves_a_trace(stations: dict[str, Station], kind: str) -> None:
    station = stations[kind]
    quiet = signals_of(station, 21)
    names = applicable(kind, station.pulses_per_revolution)
    if kind == "A":
        names = [*names, *STRANGERS]
    silent = [n for n in names if apart(quiet, signals_of(station, 21, Planted(n, 3.0))) < 1e-4]
    assert silent == []


def test_a_driver_that_fills_gaps_repeats_the_numbers_to_the_last_digit(
    stations: dict[str, Station],
) -> None:
    held = signals_of(stations["A"], 31, Planted("holding_reference", 3.0)).reference
    repeats = np.all(np.diff(held, axis=0) == 0.0, axis=1)
    assert repeats.mean() > 0.05
    usual = signals_of(stations["A"], 31).reference
    assert np.all(np.diff(usual, axis=0) == 0.0, axis=1).mean() < 0.01


def test_an_effect_that_begins_late_leaves_the_beginning_alone(
    stations: dict[str, Station],
) -> None:
    station = stations["A"]
    quiet = signals_of(station, 31)
    late = signals_of(station, 31, Planted("calibration_drift", 6.0, 60.0, None))
    early = quiet.pulses < 55.0
    assert np.array_equal(late.pulses[: early.sum()], quiet.pulses[early])
    assert late.pulses.size != quiet.pulses.size


def test_what_happens_within_a_turn_is_left_out_where_a_turn_has_too_few_pulses() -> None:
    assert "encoder_slot_error" not in applicable("A", 1)
    assert "encoder_slot_error" in applicable("A", 10)
    assert "lever_arm" not in applicable("A", 10)
