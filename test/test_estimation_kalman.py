"""The filter's algebra against dense matrices, its turbulence against the inertial range."""

from __future__ import annotations

import numpy as np
import pytest
from estimation_cases import blown, feed, mast, messages, truth_at

from wind_sensors.estimation import EstimatorSettings, HealthLevel, make_estimator, process
from wind_sensors.estimation import turbulence_process as turbulence
from wind_sensors.estimation.constants import instruments_of
from wind_sensors.estimation.filter_state import OUTPUT
from wind_sensors.estimation.forward import CIRCUMSTANCES, advance_station, advance_with_jacobian
from wind_sensors.estimation.kalman import KalmanCore
from wind_sensors.estimation.prediction_kernel import overspeeding
from wind_sensors.estimation.wind_state import component
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Winds

W = turbulence.WIND_STATES


def test_the_sum_of_processes_has_the_inertial_structure_function() -> None:
    time = np.geomspace(0.1, 10.0, 30)
    total = 2.0 * turbulence.UNRESOLVED_VARIANCE + turbulence.WANDERING * time
    for tau, variance in zip(turbulence.TIME_CONSTANTS, turbulence.VARIANCES, strict=True):
        total = total + 2.0 * variance * (1.0 - np.exp(-time / tau))
    assert np.all(np.abs(total / time ** (2.0 / 3.0) - 1.0) < 0.1)


def calm_circumstances() -> np.ndarray:
    c = np.zeros(CIRCUMSTANCES)
    c[3] = c[7] = c[11] = 1.0
    c[15], c[16] = 1.225, 15.0
    return c


def test_the_jacobian_agrees_with_richardson_differences() -> None:
    station = mast()
    s, c = instruments_of(station), calm_circumstances()
    state = np.array([7.5, 0.3, np.pi + 0.2, 0.4])
    wind_0, wind_1 = np.array([7.0, 2.0, 0.3]), np.array([7.2, 1.9, 0.2])
    out = np.empty(4)
    by_0, by_1, by_state = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 4))
    advance_with_jacobian(
        s, wind_0, wind_1, c, c, state, 0.05, np.full(3, 1e-3), out, by_0, by_1, by_state
    )

    def moved(argument: int, index: int, step: float) -> np.ndarray:
        values = [wind_0.copy(), wind_1.copy(), state.copy()]
        values[argument][index] += step
        result = np.empty(4)
        advance_station(s, values[0], values[1], c, c, values[2], 0.05, result)
        return result

    for argument, found in enumerate((by_0, by_1, by_state)):
        for index in range(found.shape[1]):
            coarse = (moved(argument, index, 0.02) - moved(argument, index, -0.02)) / 0.04
            fine = (moved(argument, index, 0.01) - moved(argument, index, -0.01)) / 0.02
            assert np.allclose(found[:, index], (4.0 * fine - coarse) / 3.0, atol=2e-4)


def test_a_bearing_that_catches_is_left_out_of_the_filters_smooth_vane() -> None:
    catching = {"catch_speed": 6.0, "catch_heading_deg": 0.0, "catch_width_deg": 6.0}
    s, without = instruments_of(mast(vane=catching)), instruments_of(mast())
    assert not np.array_equal(s.vane, without.vane)
    c, wind = calm_circumstances(), np.array([-6.0, 0.0, 0.0])
    for heading in np.radians([-3.0, -1.0, 0.0, 2.0]):
        after, free = np.empty(4), np.empty(4)
        state = np.array([6.0, 0.0, heading, 0.3])
        advance_station(s, wind, wind, c, c, state, 0.05, after)
        advance_station(without, wind, wind, c, c, state, 0.05, free)
        assert np.array_equal(after, free)


def test_the_smoother_equals_dense_conditioning_on_the_innovations() -> None:
    recording = blown(mast(), duration=6.0)
    settings = EstimatorSettings(smoother_lag=50.0)
    estimator = make_estimator(mast(), settings)
    feed(estimator, messages(recording))
    (block,) = estimator._intake.blocks(finish=True)
    core = KalmanCore(mast(), settings, block.stop - block.start, block.start)
    core._waiting = [block]
    core._start([block])
    core._run(block)
    ring, steps = core._ring, int(core.filter.clock[2])
    delivered = core.finish()
    unresolved = core.filter.levels[[0, 2]].mean() * turbulence.UNRESOLVED_VARIANCE
    n = core.filter.mean.size
    total = np.array([[float(component(k) == a) for k in range(W)] + [0.0] * (n - W)
                      for a in range(3)])
    outputs = [k for k in range(steps) if ring.kind[k] == OUTPUT]
    for first in outputs[10:100:15]:
        # Innovations are white: each depends on the state at `first` through the chain of
        # transitions and corrections, and adds its share to what is known of it.
        chain, rows, values, weights = np.eye(n), [], [], []
        for k in range(first + 1, steps):
            if ring.moved[k]:
                step = np.zeros((n, n))
                step[:W, :W] = np.diag(ring.decay[k])
                step[W:] = ring.transition[k]
                chain = step @ chain
            j = ring.measured[k]
            if j >= 0:
                rows.append(chain[j].copy())
                values.append(ring.innovation[k])
                weights.append(1.0 / ring.variance[k])
                chain = chain - np.outer(ring.gain[k], chain[j])
        a, w = np.array(rows), np.array(weights)
        p = ring.covariance[first]
        mean = total @ (ring.mean[first] + p @ (a.T * w) @ np.array(values))
        spread = total @ (p - p @ (a.T * w) @ a @ p) @ total.T
        at = int(np.searchsorted(delivered.time, ring.time[first]))
        assert np.allclose(delivered.velocity[at], mean, atol=1e-8)
        found = delivered.covariance[at][:2, :2] - unresolved * np.eye(2)
        assert np.allclose(found, spread[:2, :2], atol=1e-8)


@pytest.mark.parametrize("a4", [0.0, 0.6])
def test_the_second_order_mean_of_a_propeller_that_is_lifted_is_that_of_random_winds(
    a4: float,
) -> None:
    """K94 (30), generalised by a4, averaged over a million winds and rates."""
    mu2, length, y, unresolved = -0.7, 1.3, 7.8, 0.05
    propeller = {
        "kind": "propeller", "name": "p", "pulses": {"topic": "p"}, "pulses_per_revolution": 2,
        "calibration_distance": 0.05, "distance_constant": length, "mu2": mu2, "a4": a4,
        "axis": [1.0, 0.0, 0.0],
    }
    station = Station.model_validate({"instruments": [propeller]})
    wind = np.array([7.5, 2.0, 0.4])
    e, n = wind[:2] / np.hypot(wind[0], wind[1])
    along = np.array([[e, -n, 0.0], [n, e, 0.0], [0.0, 0.0, 1.0]])
    spread = along @ np.diag([0.6, 0.4, 0.3]) @ along.T
    with_rate, rate_variance = np.array([0.2, 0.05, 0.0]), 0.3
    both = np.block([[spread, with_rate[:, None]], [with_rate[None, :], np.full((1, 1), 0.3)]])
    both[:3, :3] += unresolved * np.eye(3)
    generator = np.random.default_rng(4)
    drawn = generator.multivariate_normal(np.append(wind, y), both, size=500_000)
    drawn = np.concatenate((drawn, 2.0 * np.append(wind, y) - drawn))

    def acceleration(u: np.ndarray, v: np.ndarray, w: np.ndarray, rate: np.ndarray) -> np.ndarray:
        slip = (u - rate) * (a4 * np.abs(u) + (1.0 - a4) * rate)
        return np.asarray((slip + 0.5 * mu2 * (v * v + w * w)) / length)

    excess = acceleration(*drawn.T) - acceleration(wind[0], wind[1], wind[2], np.float64(y))
    found, _ = overspeeding(
        instruments_of(station), 0, wind, spread, with_rate, rate_variance, y,
        calm_circumstances(), 0.0, 0.0, unresolved,
    )
    pairs = excess.reshape(2, -1).mean(axis=0)
    error = pairs.std() / np.sqrt(pairs.size)
    assert found == pytest.approx(excess.mean(), abs=4.0 * error)
    assert error < 0.001


@pytest.mark.parametrize("speed", [4.0, 9.0])
def test_simulated_wind_lies_inside_the_stated_intervals(speed: float) -> None:
    recording = blown(mast(), speed=speed, duration=240.0, seed=11, sample_rate=100.0)
    found = process(recording, EstimatorSettings(window=240.0))
    late = found.time > recording.start + 60_000_000_000
    error = (found.velocity - truth_at(recording, found.time))[late, :2]
    deviation = np.sqrt(np.stack((found.covariance[late, 0, 0], found.covariance[late, 1, 1]), 1))
    inside = np.mean(np.abs(error) <= 1.645 * deviation)
    assert 0.85 < inside < 0.96
    naive = process(recording, EstimatorSettings(method="naive", window=240.0))
    settled = naive.time > recording.start + 60_000_000_000
    naive_error = (naive.velocity - truth_at(recording, naive.time))[settled, :2]
    assert np.sqrt(np.mean(error**2)) < 0.6 * np.sqrt(np.mean(naive_error**2))
    true_mean = truth_at(recording, found.time)[late].mean(axis=0)
    assert np.hypot(*(found.velocity[late].mean(axis=0) - true_mean)[:2]) < 0.004 * speed


def test_a_longer_lag_helps_until_the_instruments_have_forgotten() -> None:
    recording = blown(mast(), speed=6.0, duration=90.0)
    errors = []
    for lag in (0.1, 0.8, 10.0):
        found = process(recording, EstimatorSettings(smoother_lag=lag, window=90.0))
        inner = (found.time > recording.start + 20e9) & (found.time < recording.stop - 12e9)
        error = (found.velocity - truth_at(recording, found.time))[inner, :2]
        errors.append(np.sqrt(np.mean(error**2)))
    assert errors[0] > 1.05 * errors[1]
    assert errors[2] < 1.06 * errors[1]


def test_a_lull_in_which_a_cup_tells_two_winds_is_no_certain_one() -> None:
    """The wind falls below half the cup's speed within its response and stays there."""
    t = np.arange(1601) * 0.05
    speed = np.interp(t, [0.0, 30.0, 31.0, 60.0, 61.0, 80.0], [5.0, 5.0, 0.5, 0.5, 5.0, 5.0])
    speed = speed * (1.0 + 0.05 * np.sin(0.9 * t) + 0.03 * np.sin(2.3 * t))
    blowing = np.stack((speed, np.zeros_like(t), np.zeros_like(t)), axis=1)
    station = mast({"pulses_per_revolution": 12, "mu2": 0.0})
    recording = simulate(
        station, Scenario(wind=Winds(np.rint(t * 1e9).astype(np.int64), blowing), duration=80.0)
    )
    found = process(recording, EstimatorSettings(window=80.0))
    error = (found.velocity - truth_at(recording, found.time))[:, 0]
    deviation = np.sqrt(found.covariance[:, 0, 0])
    since = (found.time - recording.start) * 1e-9
    lull = (since > 30.5) & (since < 34.0)
    assert np.abs(error[lull]).max() > 1.0
    assert np.mean(np.abs(error[lull]) < 2.0 * deviation[lull]) > 0.75
    steady = ((since > 10.0) & (since < 29.0)) | (since > 66.0)
    assert deviation[steady].max() < 0.2
    item = next(i for i in found.health if i.name == "cup lulls")
    assert item.level == HealthLevel.WARN


def test_slot_errors_are_learnt_without_being_told() -> None:
    planted = np.array([0.12, -0.08, 0.05, -0.09])
    recording = blown(mast({"electronics": {"slot_errors": list(planted)}}), duration=120.0)
    estimator = make_estimator(mast(), EstimatorSettings(window=100.0))
    feed(estimator, messages(recording))
    core = estimator._core
    assert isinstance(core, KalmanCore)
    learnt = core.filter.slot_error[0, :4]
    # The filter does not know which slot came first.
    turned = [np.roll(planted - planted.mean(), k) for k in range(4)]
    assert min(np.abs(learnt - t).max() for t in turned) < 0.02
