"""All three components of the wind: propeller arrays and bivanes, end to end."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy import signal

from wind_sensors.errors import UserError
from wind_sensors.estimation import (
    EstimatorSettings,
    HealthLevel,
    Method,
    ProcessedRecording,
    make_estimator,
    process,
)
from wind_sensors.estimation.array_equation import FamilyEquation
from wind_sensors.instruments.dynamics.rotor import rotor_acceleration, rotor_forcing
from wind_sensors.instruments.propeller_array import orthogonal_axes, solve, tripod_axes
from wind_sensors.recordings import load_station
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Propeller, Station
from wind_sensors.station.parameters import rotor_parameters
from wind_sensors.station.signals import Recording, Winds
from wind_sensors.turbulence.synthesis import isotropic_spec, surface_layer_spec

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import propeller_array as benchmark

FloatArray = npt.NDArray[np.float64]

DIRECTION = 0.6


def truth_at(recording: Recording, time: npt.NDArray[np.int64]) -> FloatArray:
    truth = recording.truth
    assert truth is not None
    at = (time - truth.time[0]) * 1e-9
    seconds = (truth.time - truth.time[0]) * 1e-9
    return np.stack([np.interp(at, seconds, truth.velocity[:, k]) for k in range(3)], axis=1)


def errors_of(result: ProcessedRecording, skip: float = 30.0) -> tuple[FloatArray, FloatArray]:
    """Errors and their stated standard deviations after the first seconds [m/s]."""
    used = result.time > result.time[0] + round(skip * 1e9)
    error = (result.velocity - truth_at(result.recording, result.time))[used]
    return error, np.sqrt(np.diagonal(result.covariance[used], axis1=1, axis2=2))


def health(result: ProcessedRecording) -> dict[str, HealthLevel]:
    return {item.name: item.level for item in result.health}


def gusts(axes: FloatArray, turbulence_seed: int = 5, direction: float = DIRECTION) -> Recording:
    wind = isotropic_spec(8.0, 0.12, 60.0, direction, turbulence_seed)
    return simulate(benchmark.station(axes), Scenario(wind=wind, duration=120.0, seed=1))


@pytest.mark.parametrize("name", ["propeller_array", "bivane", "mast_propeller_vane"])
def test_a_shipped_station_gives_the_truth_back_within_its_intervals(name: str) -> None:
    station = load_station(name)
    wind = surface_layer_spec(8.0, 10.0, 0.03, 0.0, direction=DIRECTION, seed=3)
    recording = simulate(station, Scenario(wind=wind, duration=240.0, seed=1))
    result = process(recording, EstimatorSettings())
    error, deviation = errors_of(result)
    measured = [0, 1] if name == "mast_propeller_vane" else [0, 1, 2]
    inside = np.mean(np.abs(error) < 1.645 * deviation, axis=0)
    assert np.all(inside[measured] > 0.85)
    assert np.all(np.sqrt(np.mean(error**2, axis=0))[measured] < [0.25, 0.25, 0.4][: len(measured)])
    (window,) = result.windows
    true_mean = truth_at(recording, result.time).mean(axis=0)
    spread = np.sqrt(np.diag(window.vector_mean_covariance))
    assert np.all(np.abs(window.vector_mean - true_mean)[measured] < 3.0 * spread[measured])
    assert np.all(spread[measured] < 0.05)


@pytest.mark.parametrize("elevation", [0.0, 0.4])
def test_a_tripod_sees_every_component_whatever_its_orientation(elevation: float) -> None:
    axes = tripod_axes(DIRECTION, elevation, roll=0.7)
    result = process(gusts(axes), EstimatorSettings())
    error, deviation = errors_of(result)
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 0.12)
    assert np.all(np.mean(np.abs(error) < 1.645 * deviation, axis=0) > 0.85)
    assert {level for name, level in health(result).items() if name.endswith("angle")} == {
        HealthLevel.OK
    }


def test_an_array_comes_close_to_the_information_in_its_signals() -> None:
    result = benchmark.compare(tripod_axes(benchmark.DIRECTION), duration=100.0)
    assert np.all(result.found < 1.25 * result.bound)
    assert np.all(result.found > 0.9 * result.bound)
    assert np.all(result.found < result.inverse)
    assert np.all(result.inverse < result.naive)


FORMS: dict[str, list[dict[str, object]]] = {
    "K94, less in oblique wind": [{"mu2": -0.1, "a4": 0.0}] * 3,
    "K94, more in oblique wind": [{"mu2": 0.3, "a4": 0.0}] * 3,
    "K94, a4, gain and offset": [{"mu2": 0.2, "a4": 0.5, "calibration_gain": 1.1,
                                  "calibration_offset": 0.3}] * 3,
    "Jackson, a4": [{"a4": 0.5}] * 3,
    "three unlike ones": [{}, {"angular_response_change": -0.3}, {"mu2": 0.2, "a4": 0.2}],
}


@pytest.mark.parametrize("form", list(FORMS))
def test_each_propellers_own_equation_is_solved(form: str) -> None:
    """Winds that the equation of motion of the simulation answered with these accelerations."""
    axes = tripod_axes(DIRECTION, roll=0.7)
    propellers = [
        Propeller.model_validate({**i.model_dump(), **more})
        for i, more in zip(benchmark.station(axes).instruments, FORMS[form], strict=True)
    ]
    generator = np.random.default_rng(1)
    mean = 8.0 * np.array([np.cos(DIRECTION), np.sin(DIRECTION), 0.0])
    wind = mean + generator.standard_normal((200, 3))
    along = wind @ axes.T
    across = np.sqrt(np.sum(wind**2, axis=1)[:, None] - along**2)
    y = along * generator.uniform(0.8, 1.2, along.shape)
    push = np.empty_like(y)
    equations = []
    for k, propeller in enumerate(propellers):
        p = rotor_parameters(propeller)._replace(friction=0.0)
        equations.append(FamilyEquation(p))
        for n in range(len(wind)):
            torque = rotor_forcing(p, along[n, k], across[n, k])
            rate = rotor_acceleration(p, y[n, k], 0.0, *torque, (0.0, 0.0), 1.0, 15.0)
            push[n, k] = p.distance_constant * rate
    found = solve(axes, equations, y, push)
    assert np.all(found.converged)
    assert not np.any(found.noisy)
    assert found.velocity == pytest.approx(wind, abs=1e-6)


def test_the_inverse_method_takes_each_propellers_own_constants() -> None:
    axes = tripod_axes(DIRECTION, roll=0.7)
    one, two, three = benchmark.station(axes).instruments
    unlike = Station(instruments=(
        one.model_copy(update={"mu2": 0.2, "a4": 0.0}),
        two.model_copy(update={"angular_response_change": -0.3}),
        three,
    ))
    wind = isotropic_spec(8.0, 0.05, 60.0, DIRECTION, 5)
    recording = simulate(unlike, Scenario(wind=wind, duration=60.0, seed=1))
    result = process(recording, EstimatorSettings(method="inverse", window=60.0, bandwidth=2.0))
    error, _ = errors_of(result)
    assert np.all(np.abs(error.mean(axis=0)) < 0.03)


def test_the_wind_run_of_an_array_is_counted_with_its_gains_and_offsets() -> None:
    known: tuple[dict[str, float], ...] = (
        {"calibration_offset": 0.5, "calibration_gain": 1.2}, {"calibration_offset": -0.3}, {},
    )
    axes = tripod_axes(DIRECTION)
    off = Station(instruments=tuple(
        i.model_copy(update=more)
        for i, more in zip(benchmark.station(axes).instruments, known, strict=True)
    ))
    t = np.arange(1201) * 0.05
    wind = np.tile([8.0 * np.cos(DIRECTION), 8.0 * np.sin(DIRECTION), 0.0], (t.size, 1))
    recording = simulate(
        off, Scenario(wind=Winds((t * 1e9).round().astype(np.int64), wind), duration=60.0)
    )
    (window,) = process(recording, EstimatorSettings(window=60.0)).windows
    # What the cosine leaves: stall speed and response table, the same without the deviations.
    plain = replace(recording, station=benchmark.station(axes))
    (unaware,) = process(plain, EstimatorSettings(window=60.0)).windows
    healthy = simulate(
        benchmark.station(axes),
        Scenario(wind=Winds((t * 1e9).round().astype(np.int64), wind), duration=60.0),
    )
    (expected,) = process(healthy, EstimatorSettings(window=60.0)).windows
    assert window.wind_run_mean == pytest.approx(expected.wind_run_mean, abs=0.03)
    assert window.raw_scalar_mean == pytest.approx(expected.raw_scalar_mean, abs=0.03)
    assert np.abs(unaware.wind_run_mean - expected.wind_run_mean).max() > 0.3


def test_wakes_and_planes_of_rotation_are_told() -> None:
    level = process(gusts(orthogonal_axes()), EstimatorSettings())
    assert health(level)["propeller_2 angle"] == HealthLevel.WARN
    assert health(level)["propeller_0 angle"] == HealthLevel.OK
    behind = process(gusts(orthogonal_axes(), direction=np.pi + 0.1), EstimatorSettings())
    item = next(i for i in behind.health if i.name == "propeller_0 angle")
    assert item.level == HealthLevel.WARN
    assert "135 deg" in item.message
    error, deviation = errors_of(behind)
    assert np.all(np.mean(np.abs(error) < 1.645 * deviation, axis=0) > 0.85)


def test_lulls_in_which_two_winds_fit_are_told() -> None:
    """Jackson's Fig. 4: 10 m/s plus a sinusoid of 8 m/s once in 16 m; the lulls cross y/2."""
    t = np.arange(1201) * 0.05
    speed = 10.0 + 8.0 * np.sin(2.0 * np.pi * t / 1.6)
    wind = speed[:, None] * np.array([np.cos(DIRECTION), np.sin(DIRECTION), 0.0])
    blown = Winds((t * 1e9).round().astype(np.int64), wind)
    station = benchmark.station(tripod_axes(DIRECTION))
    recording = simulate(station, Scenario(wind=blown, duration=60.0, seed=1))
    result = process(recording, EstimatorSettings())
    doubt = [i for i in result.health if i.name.endswith("angle") and "two winds" in i.message]
    assert doubt
    assert all(i.level == HealthLevel.WARN for i in doubt)


def test_edges_alone_do_not_tell_the_sense_of_rotation() -> None:
    single_edges = tuple(
        i.model_copy(update={"pulses": i.pulses.model_copy(update={"type": ""})})
        for i in benchmark.station(tripod_axes(DIRECTION)).instruments
        if isinstance(i, Propeller)
    )
    wind = isotropic_spec(8.0, 0.1, 60.0, DIRECTION, 2)
    recording = simulate(Station(instruments=single_edges), Scenario(wind=wind, duration=60.0))
    result = process(recording, EstimatorSettings())
    item = next(i for i in result.health if i.name == "propeller_0 angle")
    assert item.values["sense of rotation"] == "forward, assumed"
    assert item.level == HealthLevel.WARN
    error, _ = errors_of(result)
    assert np.all(np.sqrt(np.mean(error**2, axis=0)) < 0.15)


def test_a_shipped_propeller_is_followed_after_a_calm() -> None:
    """The rotor that makes the signals starts by itself, as one on a mast does."""
    station = load_station("mast_propeller_vane")
    t = np.arange(2401) * 0.05
    speed = np.interp(t, [0.0, 30.0, 40.0, 70.0, 80.0, 120.0], [6.0, 6.0, 0.05, 0.05, 6.0, 6.0])
    wind = speed[:, None] * np.array([np.cos(DIRECTION), np.sin(DIRECTION), 0.0])
    real = tuple(
        i.model_copy(update={"a4": 0.33}) if isinstance(i, Propeller) else i
        for i in station.instruments
    )
    blown = Winds((t * 1e9).round().astype(np.int64), wind)
    recording = simulate(
        station.model_copy(update={"instruments": real}), Scenario(wind=blown, duration=119.0)
    )
    result = process(replace(recording, station=station), EstimatorSettings(window=120.0))
    error, _ = errors_of(result, skip=85.0)
    assert np.all(np.abs(error[:, :2]).mean(axis=0) < 0.1)


def test_propellers_along_one_line_are_no_array() -> None:
    one = benchmark.station(np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    assert all(isinstance(i, Propeller) for i in one.instruments)
    with pytest.raises(UserError, match="different axes"):
        make_estimator(one)


def bivane_in_wind(rate: float) -> Recording:
    wind = surface_layer_spec(5.3, 10.0, 0.03, 0.0, direction=DIRECTION, seed=3)
    scenario = Scenario(wind=wind, duration=300.0, seed=1, vane_rate=rate)
    return simulate(load_station("bivane"), scenario)


@pytest.mark.parametrize("method", ["kalman", "inverse"])
def test_the_bivanes_resonance_is_removed(method: Method) -> None:
    """Power of the vertical wind around the free period of 15 m/5.3 m/s, found over true."""
    recording = bivane_in_wind(20.0)

    def power_at_resonance(chosen: Method) -> float:
        result = process(recording, EstimatorSettings(method=chosen))
        used = result.time > result.time[0] + 30_000_000_000
        true = truth_at(recording, result.time)[used, 2]
        frequency, found = signal.welch(result.velocity[used, 2], 20.0, nperseg=512)
        _, wind = signal.welch(true, 20.0, nperseg=512)
        near = np.abs(frequency * 15.0 / 5.3 - 1.0) < 0.25
        return float(found[near].sum() / wind[near].sum())

    assert power_at_resonance(method) == pytest.approx(1.0, abs=0.1)
    assert power_at_resonance("naive") > 4.0


def test_a_bivane_that_is_read_too_seldom_is_told() -> None:
    fast = process(bivane_in_wind(20.0), EstimatorSettings())
    assert health(fast)["bivane sampling"] == HealthLevel.OK
    slow = process(bivane_in_wind(1.0), EstimatorSettings())
    item = next(i for i in slow.health if i.name == "bivane sampling")
    assert item.level == HealthLevel.WARN
    assert item.values["samples per free period"].startswith("2.")
    assert "Hz" in item.message
    mitsuta = process(bivane_in_wind(2.0), EstimatorSettings(method="inverse"))
    assert health(mitsuta)["bivane sampling"] == HealthLevel.WARN
