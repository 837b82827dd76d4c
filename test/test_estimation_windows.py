"""Window statistics against direct sums, and the inverse equations against the forward ones."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from estimation_cases import blown, mast, truth_at
from scipy.stats import norm

from wind_sensors.estimation import EstimatorSettings, Method, process
from wind_sensors.estimation.core import SmallScales
from wind_sensors.estimation.inverse_kernel import (
    forcing_from_motion,
    local_parabola,
    wind_heading_from_motion,
)
from wind_sensors.estimation.unresolved import excess_speed
from wind_sensors.instruments.cup_vane import vector_wind_run
from wind_sensors.instruments.dynamics.rotor import rotor_acceleration, rotor_forcing
from wind_sensors.instruments.dynamics.vane import vane_acceleration
from wind_sensors.instruments.pulses import mean_speed
from wind_sensors.station.model import Cup, Propeller, Vane
from wind_sensors.station.parameters import rotor_parameters, vane_parameters


def test_raw_means_are_those_of_the_pulse_formulas() -> None:
    station = mast({"starting_speed": 0.0})
    recording = blown(station, duration=100.0)
    window = process(recording, EstimatorSettings(window=200.0)).windows[0]
    edges = (recording.pulses["cup"].time - recording.start) * 1e-9
    direct = mean_speed(np.diff(edges[::4]), 0.14)
    assert window.raw_scalar_mean == pytest.approx(direct.count_mean, rel=0.004)
    ratio = direct.arithmetic_mean / direct.count_mean - 1.0
    assert window.bias_terms["arithmetic_mean"].value == pytest.approx(ratio, rel=0.05)
    vane = recording.angles["vane"]
    heading = np.interp(edges, (vane.time - recording.start) * 1e-9, np.unwrap(vane.angle))
    duration = (window.stop - window.start) * 1e-9
    run = vector_wind_run(heading + np.pi, duration, 0.14, 4.0)
    assert np.hypot(*window.wind_run_mean) == pytest.approx(run.speed, rel=0.002)
    assert np.arctan2(*window.wind_run_mean[::-1]) == pytest.approx(run.heading, abs=1e-3)


@pytest.mark.parametrize("displaced", [0.0, 0.1])
def test_slots_of_unequal_width_are_no_gusts(displaced: float) -> None:
    """In a constant wind the mean over turns is that over time: K94 (28) without a variance."""
    quiet = blown(mast(), duration=60.0, intensity=0.0)
    turn = 2.0 * np.pi * 0.14 / 8.0
    slots = np.array([0.0, 0.25 + 0.25 * displaced, 0.5, 0.75])
    edges = (np.arange(int(60.0 / turn))[:, np.newaxis] + slots).ravel() * turn
    pulses = replace(quiet.pulses["cup"], time=quiet.start + np.rint(edges * 1e9).astype(np.int64))
    recording = replace(quiet, pulses={"cup": pulses})
    window = process(recording, EstimatorSettings(window=60.0, method="naive")).windows[0]
    assert abs(window.bias_terms["arithmetic_mean"].value) < 1e-5


def test_the_corrected_mean_is_closer_to_the_truth_than_the_raw_one() -> None:
    station = mast({"mu2": 0.0, "distance_constant": 5.0})
    recording = blown(station, speed=6.0, duration=300.0, intensity=0.25, seed=5)
    found = process(recording, EstimatorSettings(window=300.0))
    window = found.windows[0]
    inside = (found.time > window.start) & (found.time < window.stop)
    truth = truth_at(recording, found.time)[inside]
    true_speed = float(np.hypot(truth[:, 0], truth[:, 1]).mean())
    raw = window.raw_scalar_mean / true_speed - 1.0
    corrected = window.scalar_mean / true_speed - 1.0
    assert raw > 0.005
    assert abs(corrected) < 0.5 * raw
    assert abs(window.scalar_mean - true_speed) < 3.0 * window.scalar_mean_uncertainty
    predicted = window.bias_terms["u"].value
    assert raw == pytest.approx(predicted, abs=0.6 * raw)


@pytest.mark.parametrize(("speed", "pulses"), [(4.0, 4), (8.0, 12)])
def test_the_overspeeding_told_is_what_the_true_wind_does_to_the_rotor(
    speed: float, pulses: int
) -> None:
    """K14 (75) with the moments of the true wind and of a rotor that turns in it."""
    length = 1.7
    station = mast({"mu2": 0.0, "pulses_per_revolution": pulses, "starting_speed": 0.0})
    recording = blown(station, speed=speed, duration=300.0, intensity=0.1, sample_rate=100.0)
    (window,) = process(recording, EstimatorSettings(window=300.0)).windows
    truth = recording.truth
    assert truth is not None
    step = float(np.diff(truth.time)[0]) * 1e-9
    wind = np.hypot(truth.velocity[:, 0], truth.velocity[:, 1])
    rate = wind.copy()
    for k, (before, after) in enumerate(pairwise(wind.tolist())):
        # The exact solution for a wind that rises evenly, at its mean pace.
        time = 2.0 * length / (before + after)
        slope = (after - before) / step * time
        rate[k + 1] = after - slope + (rate[k] - before + slope) * np.exp(-step / time)
    expected = np.cov(wind - rate, wind)[0, 1] / wind.mean() ** 2
    told = window.bias_terms["u"]
    assert expected > 1e-4
    assert told.value == pytest.approx(expected, rel=0.15)
    assert told.uncertainty < 0.25 * told.value


def test_the_wind_run_is_counted_with_what_is_known_of_the_count_and_the_calibration() -> None:
    wrong = {"calibration_gain": 0.9, "electronics": {"dead_time": 0.035}}
    recording = blown(mast(wrong), duration=60.0)
    stated = process(recording, EstimatorSettings(window=100.0)).windows[0]
    unaware = replace(recording, station=mast())
    plain = process(unaware, EstimatorSettings(window=100.0)).windows[0]
    true = np.hypot(*truth_at(recording, recording.angles["vane"].time)[:, :2].T).mean()
    assert stated.raw_scalar_mean == pytest.approx(true, rel=0.03)
    assert np.hypot(*stated.wind_run_mean) == pytest.approx(true, rel=0.03)
    assert plain.raw_scalar_mean < 0.6 * true


def test_what_the_vertical_wind_may_be_is_no_uncertainty_of_the_horizontal_mean() -> None:
    found = process(blown(mast({"mu2": 0.0}), duration=60.0), EstimatorSettings(window=60.0))
    (window,) = found.windows
    used = (found.time >= window.start) & (found.time < window.stop)
    averaged = found.covariance[used].mean(axis=0) / 60.0
    assert averaged[2, 2] > 4.0 * averaged[0, 0]
    # Beside the estimates' own errors: 0.2 % of calibration and a quarter of the correction.
    told_terms = (abs(window.bias_terms[k].value) for k in ("u", "w", "vane_lag", "translation"))
    correction = max(
        np.hypot(*window.bias[:2]), abs(window.raw_scalar_mean - window.scalar_mean),
        window.scalar_mean * sum(told_terms),
    )
    common = (0.002 * window.scalar_mean) ** 2 + (0.25 * correction) ** 2
    told = window.vector_mean_covariance[:2, :2]
    assert told == pytest.approx(averaged[:2, :2] + common * np.eye(2), rel=1e-6, abs=1e-9)


def test_an_oblique_response_is_uncertain_by_the_vertical_variance_that_nobody_measured() -> None:
    """Isotropic turbulence: its vertical variance is not that of a neutral surface layer."""
    recording = blown(mast({"mu2": 1.3}), duration=200.0, intensity=0.15, sample_rate=50.0)
    found = process(recording, EstimatorSettings(window=200.0))
    (window,) = found.windows
    inside = (found.time >= window.start) & (found.time < window.stop)
    truth = truth_at(recording, found.time)[inside].mean(axis=0)[:2]
    along = truth / np.hypot(*truth)
    error = along @ (window.vector_mean[:2] - truth)
    variance = along @ window.vector_mean_covariance[:2, :2] @ along
    told = (window.bias_terms["w"].uncertainty * window.scalar_mean) ** 2
    assert error > 3.0 * np.sqrt(variance - told)
    assert error < 3.0 * np.sqrt(variance)
    across = np.array([-along[1], along[0]])
    assert across @ window.bias_covariance[:2, :2] @ across < told
    assert along @ window.bias_covariance[:2, :2] @ along > told


@pytest.mark.parametrize("bandwidth", [0.5, 1.0])
def test_the_inverse_method_takes_off_what_smoothed_gusts_add_to_the_speed(
    bandwidth: float,
) -> None:
    cup = {"mu2": 0.0, "distance_constant": 3.0}
    recording = blown(mast(cup), duration=150.0, intensity=0.2, sample_rate=50.0)
    found = process(
        recording, EstimatorSettings(method="inverse", window=150.0, bandwidth=bandwidth)
    )
    (window,) = found.windows
    inside = (found.time >= window.start) & (found.time < window.stop)
    truth = truth_at(recording, found.time)[inside].mean(axis=0)[:2]
    along = truth / np.hypot(*truth)
    overspeeding = window.bias_terms["u"].value * window.scalar_mean
    assert overspeeding > 0.03
    assert abs(along @ (window.vector_mean[:2] - truth)) < 0.4 * overspeeding
    assert along @ window.bias[:2] > 0.5 * overspeeding
    assert np.sqrt(along @ window.bias_covariance[:2, :2] @ along) > 0.2 * overspeeding


@pytest.mark.parametrize("length", [0.3, 1.7, 20.0])
def test_the_excess_of_smoothed_gusts_is_that_of_a_sum_of_gusts(length: float) -> None:
    """Every gust of a spectrum by itself: smoothed by a Gaussian, followed by the rotor."""
    cup = mast({"mu2": 0.7, "a4": 0.8, "distance_constant": length}).instruments[0]
    assert isinstance(cup, Cup)
    speed, bandwidth, height = 6.0, 1.5, 0.2
    frequency = np.linspace(0.001, 400.0, 2_000_001)
    # D(t) = 2 int (1 - cos 2 pi f t) S df is 1 t^(2/3) for this one-sided S.
    spectrum = frequency ** (-5.0 / 3.0) / 13.68
    kept = np.exp2(-np.square(frequency / bandwidth))
    lag = np.square(2.0 * np.pi * frequency * length / speed)
    step = frequency[1] - frequency[0]
    along = np.sum(spectrum * (1.0 - kept) * lag / (1.0 + lag)) * step
    across = 4.0 / 3.0 * np.sum(spectrum * (1.0 - kept)) * step
    expected = (0.8 * along + 0.5 * across + 0.5 * 0.7 * height) / speed
    found = excess_speed(cup, SmallScales(1.0, 4.0 / 3.0), bandwidth, height, np.array([speed]))
    assert found[0] == pytest.approx(expected, rel=0.02)


def test_an_error_of_a_wake_does_not_average_out() -> None:
    shadow = {"bearing_from_deg": 203.0, "depth": 0.25, "width_deg": 30.0}
    healthy, wake = (
        process(blown(mast(cup), duration=60.0), EstimatorSettings(window=100.0))
        for cup in ({}, {"wake_shadows": [shadow]})
    )
    speed = np.hypot(*wake.windows[0].vector_mean[:2])
    # A fifth of the deficit, relative to the speed that is left of it.
    expected = (0.2 * 0.25 / 0.75 * speed) ** 2
    spread = [p.covariance[300:, :2, :2].mean(axis=0) for p in (healthy, wake)]
    gained = np.trace(spread[1] - spread[0])
    assert gained == pytest.approx(expected, rel=0.25)
    means = [np.trace(p.windows[0].vector_mean_covariance[:2, :2]) for p in (healthy, wake)]
    assert means[1] - means[0] > 0.7 * expected


def test_direction_variance_is_corrected_towards_the_truth() -> None:
    vane = {"distance_constant": 1.5, "damping_ratio": 1.2, "noise_deg": 0.0}
    recording = blown(mast(vane=vane), speed=6.0, duration=200.0, seed=8)
    processed = process(recording, EstimatorSettings(window=200.0))
    window = processed.windows[0]
    truth = truth_at(recording, np.arange(window.start, window.stop, 50_000_000))
    unit = truth[:, :2] / np.hypot(truth[:, 0], truth[:, 1])[:, np.newaxis]
    true = 1.0 - float(np.sum(np.square(unit.mean(axis=0))))
    assert window.direction_variance < 0.9 * true
    assert abs(window.corrected_direction_variance - true) < 0.5 * (
        true - window.direction_variance
    )
    told = next(i for i in processed.health if i.name == "window").values["direction_variance"]
    value, _, uncertainty = told.removesuffix(" rad^2").split()
    assert float(value) == pytest.approx(window.corrected_direction_variance, rel=0.01)
    assert float(uncertainty) == pytest.approx(window.direction_variance_uncertainty, rel=0.1)


def test_a_wide_spread_of_directions_is_not_told_too_small() -> None:
    """1 - R^2 of a normal distribution is 1 - exp(-sigma^2): 15 % too small at 33 degrees."""
    quiet = blown(mast(), duration=120.0, intensity=0.0)
    vane, cup = quiet.angles["vane"], quiet.pulses["cup"]
    wanted = ((np.arange(vane.angle.size) + 0.5) * 0.6180339887) % 1.0
    heading = 0.4 + np.pi + 0.57 * norm.ppf(wanted)
    edges = quiet.start + np.arange(0, 120_000_000_000, 27_000_000, dtype=np.int64)
    recording = replace(
        quiet, angles={"vane": replace(vane, angle=heading)},
        pulses={"cup": replace(cup, time=edges)},
    )
    (window,) = process(recording, EstimatorSettings(window=120.0, method="naive")).windows
    at_edges = np.interp(edges, vane.time, heading)
    assert window.direction_variance == pytest.approx(1.0 - np.exp(-at_edges.var()), rel=0.03)
    assert window.corrected_direction_variance == pytest.approx(at_edges.var(), rel=0.03)


RUBBING_CUP = mast({"a4": 0.8, "friction_speed": 0.4, "mu2": 0.0}).instruments[0]
assert isinstance(RUBBING_CUP, Cup)
CUP = rotor_parameters(RUBBING_CUP)
PROPELLER = rotor_parameters(
    Propeller.model_validate(
        {
            "name": "p",
            "pulses": {"topic": "p"},
            "pulses_per_revolution": 2,
            "calibration_distance": 0.05,
            "distance_constant": 0.9,
            "stall_speed": 0.2,
        }
    )
)


@pytest.mark.parametrize("speed", [1.5, 4.0, 12.0])
@pytest.mark.parametrize("ratio", [0.8, 1.0, 1.1])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_the_inverse_rotor_equation_gives_the_wind_back(
    speed: float, ratio: float, angle: float
) -> None:
    y = ratio * speed
    forcing, slope, lift = rotor_forcing(CUP, 0.0, speed)
    rate = rotor_acceleration(CUP, y, 0.0, forcing, slope, lift, (0.0, 0.0), 1.04, 5.0)
    assert forcing_from_motion(CUP, y, rate, 0.0, 1.04, 5.0) == pytest.approx(speed, rel=1e-9)
    axial, transverse = speed * np.cos(angle), speed * np.sin(angle)
    forcing, slope, lift = rotor_forcing(PROPELLER, axial, transverse)
    rate = rotor_acceleration(PROPELLER, y, 0.0, forcing, slope, lift, (0.0, 0.0), 0.97, 5.0)
    found = forcing_from_motion(PROPELLER, y, rate, angle, 0.97, 5.0)
    assert found == pytest.approx(speed, rel=1e-9)


@pytest.mark.parametrize("a4", [0.0, 0.4, 1.0, 1.5])
@pytest.mark.parametrize("y", [3.0, 5.2, 6.5])
def test_gain_offset_and_slope_of_a_propeller_are_undone_with_its_motion(
    a4: float, y: float
) -> None:
    p = PROPELLER._replace(calibration_offset=0.5, calibration_gain=1.3, a4=a4)
    forcing, slope, lift = rotor_forcing(p, 4.0 * np.cos(0.3), 4.0 * np.sin(0.3))
    rate = rotor_acceleration(p, y, 0.0, forcing, slope, lift, (0.0, 0.0), 0.97, 5.0)
    assert forcing_from_motion(p, y, rate, 0.3, 0.97, 5.0) == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize("cable", [{}, {"cable_speed": 1.5, "cable_rest_deg": -130.0}])
def test_the_inverse_vane_equation_gives_the_direction_back(cable: dict[str, float]) -> None:
    vane = mast(vane={"inertia_factor": 1.4, **cable}).instruments[1]
    assert isinstance(vane, Vane)
    p = vane_parameters(vane)
    x, y = -6.0 * np.cos(0.8), -6.0 * np.sin(0.8)
    acceleration = vane_acceleration(p, 1.1, 0.5, x, y, 0.2, 0.0, 0.0, 0.0, 1.02)
    found = wind_heading_from_motion(
        p, 1.1, 0.5, acceleration, 6.0, 0.2, (0.0, 0.0, -9.8), 1.02
    )
    assert found == pytest.approx(0.8, abs=1e-9)


@pytest.mark.parametrize("method", ["kalman", "inverse"])
def test_the_pull_of_a_cable_that_is_known_is_undone(method: Method) -> None:
    wound = {"cable_speed": 1.5, "cable_rest_deg": 150.0}
    recording = blown(mast(vane=wound), speed=5.0, duration=90.0)
    turned = {}
    for known in (wound, {}):
        found = process(
            replace(recording, station=mast(vane=known)),
            EstimatorSettings(method=method, window=90.0),
        )
        inner = (found.time > recording.start + 20e9) & (found.time < recording.stop - 5e9)
        true = truth_at(recording, found.time)[inner].mean(axis=0)
        seen = found.velocity[inner].mean(axis=0)
        across = seen[1] * true[0] - seen[0] * true[1]
        turned[len(known)] = abs(np.degrees(np.arctan2(across, seen[:2] @ true[:2])))
    assert turned[0] > 5.0
    assert turned[2] < 0.5


@pytest.mark.parametrize("method", ["kalman", "inverse"])
def test_without_the_air_each_instrument_stands_in_that_of_its_own_calibration(
    method: Method,
) -> None:
    recording = blown(mast(vane={"damping_ratio": 1.2}), duration=20.0)
    settings = EstimatorSettings(method=method, window=20.0, use_air=False)
    thin = mast({"reference_density": 1.0}, {"reference_density": 1.3, "damping_ratio": 1.2})
    found = process(replace(recording, station=thin), settings)
    expected = process(recording, settings)
    assert np.array_equal(found.velocity, expected.velocity)


def test_without_a_thermometer_friction_is_that_of_the_calibration() -> None:
    cold = {
        "friction_speed": 1.0, "friction_temperature_coefficient": -0.05,
        "reference_temperature": -10.0,
    }
    recording = blown(mast(cold), speed=5.0, duration=60.0, temperature=-10.0)
    assert recording.temperature is None
    found = process(recording, EstimatorSettings(method="inverse", window=60.0, bandwidth=2.0))
    error = (found.velocity - truth_at(recording, found.time))[200:-100, :2].mean(axis=0)
    assert np.hypot(*error) < 0.05


def test_the_local_parabola_is_exact_for_a_parabola() -> None:
    time = np.sort(np.random.default_rng(1).integers(0, 2_000_000_000, 80))
    x = (time - 900_000_000).astype(np.float64) * 1e-9
    value, rate, second, *_ = local_parabola(
        time, 3.0 - 2.0 * x + 5.0 * x * x, np.empty(0), 900_000_000, 0.13
    )
    assert (value, rate, second) == pytest.approx((3.0, -2.0, 10.0), rel=1e-5)


def test_the_inverse_method_lies_between_naive_and_kalman() -> None:
    recording = blown(mast(), speed=7.0, duration=90.0)
    assert isinstance(recording.station.instruments[0], Cup)
    rms = {}
    cases: tuple[tuple[Method, float], ...] = (
        ("kalman", 1.0), ("inverse", 1.0), ("inverse", 3.0), ("naive", 1.0),
    )
    for method, bandwidth in cases:
        found = process(
            recording, EstimatorSettings(method=method, bandwidth=bandwidth, window=90.0)
        )
        inner = (found.time > recording.start + 20e9) & (found.time < recording.stop - 5e9)
        error = (found.velocity - truth_at(recording, found.time))[inner, :2]
        rms[method, bandwidth] = float(np.sqrt(np.mean(error**2)))
    assert rms["kalman", 1.0] < 1.05 * rms["inverse", 3.0]
    assert rms["kalman", 1.0] < 0.7 * rms["inverse", 1.0]
    assert rms["inverse", 3.0] < 0.5 * rms["naive", 1.0]
