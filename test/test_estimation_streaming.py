"""Streams: order, doubles, delays, gaps and clocks do not change what the stamps say."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
import pytest
from estimation_cases import Message, blown, feed, mast, messages, truth_at

from wind_sensors.errors import UserError
from wind_sensors.estimation import (
    EstimatorSettings,
    HealthItem,
    HealthLevel,
    Method,
    StreamingEstimator,
    make_estimator,
    process,
)
from wind_sensors.estimation.core import Estimates
from wind_sensors.estimation.kalman import KalmanCore
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Angles, Pulses, Recording, Winds

SETTINGS = EstimatorSettings(window=20.0)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return blown(mast(), duration=50.0)


def run(
    stream: list[Message], settings: EstimatorSettings = SETTINGS
) -> tuple[StreamingEstimator, Estimates]:
    estimator = make_estimator(mast(), settings)
    feed(estimator, stream)
    estimator.flush()
    return estimator, estimator.take_estimate_arrays()


def same(a: Estimates, b: Estimates) -> bool:
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))


def delayed(stream: list[Message], longest: float, seed: int) -> list[Message]:
    """The stream in the order of arrival when every message is late by up to `longest` seconds."""
    chance = random.Random(seed)
    return sorted(stream, key=lambda m: m[2] + chance.random() * longest * 1e9)


def item(estimator: StreamingEstimator, name: str) -> HealthItem:
    return next(i for i in estimator.health() if i.name == name)


@pytest.mark.parametrize("method", ["kalman", "inverse", "naive"])
def test_order_of_arrival_and_doubles_do_not_change_a_bit(
    recording: Recording, method: Method
) -> None:
    settings = EstimatorSettings(method=method, window=20.0)
    stream = messages(recording)
    _, straight = run(stream, settings)
    mixed = delayed(stream + stream[100:400], 0.15, 5)
    estimator, shuffled = run(mixed, settings)
    assert straight.time.size > 900
    assert same(straight, shuffled)
    doubled = [int(item(estimator, n).values["doubled"]) for n in ("cup", "vane")]
    assert sum(doubled) == 300


def in_bursts(stream: list[Message], longest: float) -> list[Message]:
    """The stream as a listener that fell behind takes it: input by input, a stretch at a time."""
    return sorted(stream, key=lambda m: (m[2] // round(longest * 1e9), m[1], m[2]))


def test_bursts_of_one_input_within_the_reordering_window_do_not_change_a_bit(
    recording: Recording,
) -> None:
    settings = EstimatorSettings(window=20.0, reordering_window=1.0)
    stream = messages(recording)
    _, straight = run(stream, settings)
    estimator, burst = run(in_bursts(stream, 1.0), settings)
    assert same(straight, burst)
    assert all(item(estimator, name).values["late"] == "0" for name in ("cup", "vane"))
    # Longer ones look like a clock that jumps: what a simulation that waits must not let happen.
    estimator, torn = run(in_bursts(stream, 5.0), settings)
    assert not same(straight, torn)
    assert int(item(estimator, "clock").values["jumps"]) > 0


def test_a_stream_taken_piece_by_piece_equals_the_recording_at_once(recording: Recording) -> None:
    estimator = make_estimator(mast(), SETTINGS)
    estimates, windows = [], []
    for message in messages(recording):
        feed(estimator, [message])
        estimates += estimator.take_estimates()
        windows += estimator.take_windows()
    assert estimates[-1].time < recording.stop - 8e8
    estimator.flush()
    estimates += estimator.take_estimates()
    windows += estimator.take_windows()
    at_once = process(recording, SETTINGS)
    assert np.array_equal([e.time for e in estimates], at_once.time)
    assert np.array_equal([e.velocity for e in estimates], at_once.velocity)
    assert np.array_equal([e.covariance for e in estimates], at_once.covariance)
    assert len(windows) == len(at_once.windows) == 3
    for a, b in zip(windows, at_once.windows, strict=True):
        assert np.array_equal(a.vector_mean, b.vector_mean)
        assert a.bias_terms == b.bias_terms


def test_memory_does_not_grow_with_the_record() -> None:
    estimator = make_estimator(mast(), SETTINGS)
    sizes = []
    for part in range(3):
        piece = blown(mast(), duration=40.0, seed=7)
        shift = part * 40_000_000_000
        feed(estimator, [(k, n, t + shift, v) for k, n, t, v in messages(piece)])
        estimator.take_estimates()
        core = estimator._core
        assert isinstance(core, KalmanCore)
        waiting = sum(len(r.times) for r in estimator._intake.records.values())
        sizes.append((core._ring.time.size, waiting < 400))
    assert sizes[1] == sizes[2]


def test_late_messages_are_counted_and_left_out(recording: Recording) -> None:
    stream = messages(recording)
    early = stream[200]
    estimator, _ = run([*stream[:1500], early, *stream[1500:]])
    assert int(item(estimator, early[1]).values["late"]) == 1


def test_readings_that_are_no_numbers_are_skipped(recording: Recording) -> None:
    stream = messages(recording)
    broken = [
        (k, n, t, float("nan") if k == "angle" and i % 50 == 0 else v)
        for i, (k, n, t, v) in enumerate(stream)
    ]
    estimator, found = run(broken)
    assert np.isfinite(found.velocity).all()
    vane = item(estimator, "vane")
    assert int(vane.values["not a number"]) > 10
    assert vane.level == HealthLevel.WARN


def test_a_clock_that_jumps_back_starts_the_estimate_anew(recording: Recording) -> None:
    stream = messages(recording)
    _, once = run(stream)
    estimator, twice = run(stream + stream)
    assert item(estimator, "clock").level == HealthLevel.WARN
    assert estimator._intake.jumps.total == 1
    assert np.array_equal(twice.velocity[: once.time.size], once.velocity)
    assert np.array_equal(twice.velocity[once.time.size :], once.velocity)


def test_a_pause_of_all_signals_is_told_as_one_and_keeps_the_windows(recording: Recording) -> None:
    stream = messages(recording)
    pause = 95_000_000_000
    middle = recording.start + 27_000_000_000
    moved = [(k, n, t + pause * (t > middle), v) for k, n, t, v in stream]
    estimator = make_estimator(mast(), SETTINGS)
    feed(estimator, moved)
    estimator.flush()
    clock = next(i for i in estimator.health(whole=True) if i.name == "clock")
    assert clock.message.startswith("No input was heard for 95.")
    assert "or the clock jumped ahead; the estimate began anew" in clock.message
    windows = estimator.take_windows()
    begin = windows[0].start
    seconds = [round((w.start - begin) * 1e-9) for w in windows]
    ends = [round((w.stop - begin) * 1e-9) for w in windows]
    # 27 s and a pause of 95 s: after it the windows go on where they would have been.
    assert seconds[:4] == [0, 20, 122, 140] and ends[2] == 140
    assert [w.complete > 0.9 for w in windows[2:4]] == [True, True]
    # What is counted after the pause is what is estimated then.
    assert windows[2].raw_scalar_mean == pytest.approx(windows[2].scalar_mean, rel=0.1)
    assert windows[3].raw_scalar_mean == pytest.approx(windows[3].scalar_mean, rel=0.1)
    estimator, _ = run(stream + stream)
    assert item(estimator, "clock").message.startswith("The clock jumped back once")


def test_one_stray_stamp_does_not_move_the_clock(recording: Recording) -> None:
    stream = messages(recording)
    _, straight = run(stream)
    stray = ("angle", "vane", stream[700][2] + 3_600_000_000_000, 0.3)
    estimator, found = run([*stream[:700], stray, *stream[700:]])
    assert same(straight, found)
    assert item(estimator, "clock").values["implausible stamps"] == "1"


def test_a_gap_widens_the_covariance_and_is_reported(recording: Recording) -> None:
    start = recording.start
    stream = [m for m in messages(recording) if not 25e9 < m[2] - start < 30e9]
    estimator = make_estimator(mast(), SETTINGS)
    feed(estimator, stream)
    estimator.flush()
    found = estimator.take_estimate_arrays()
    since = (found.time - start) * 1e-9
    inside = (since > 27.0) & (since < 28.0)
    outside = (since > 15.0) & (since < 24.0)
    width = np.sqrt(found.covariance[:, 0, 0])
    assert width[inside].mean() > 2.5 * width[outside].mean()
    error = np.abs(found.velocity - truth_at(recording, found.time))[inside, 0]
    assert error.mean() < 2.0 * width[inside].mean()
    assert int(item(estimator, "vane").values["gaps"]) == 1


def dying_wind(station: Station, speed: float, time_constant: float, duration: float) -> Recording:
    """A wind that dies away exponentially."""
    time = np.arange(0, round(duration * 20.0)) * 50_000_000
    size = speed * np.exp(-time * 1e-9 / time_constant)
    velocity = np.stack((0.9 * size, 0.436 * size, 0.0 * size), axis=1)
    return simulate(station, Scenario(wind=Winds(time, velocity), duration=duration, seed=1))


def test_a_rotor_that_comes_to_rest_is_noticed_and_the_wind_is_small() -> None:
    station = mast({"friction_speed": 0.15})
    recording = dying_wind(station, 5.0, 10.0, 90.0)
    edges = recording.pulses["cup"].time
    assert edges[-1] < recording.stop - 15_000_000_000
    estimator = make_estimator(station, SETTINGS)
    feed(estimator, messages(recording))
    estimator.flush()
    found = estimator.take_estimate_arrays()
    assert "stopped" in item(estimator, "cup").message
    speed = np.hypot(found.velocity[:, 0], found.velocity[:, 1])
    deviation = np.sqrt(found.covariance[:, 0, 0] + found.covariance[:, 1, 1])
    true = np.hypot(*truth_at(recording, found.time)[:, :2].T)
    late = found.time > edges[-1] + 5_000_000_000
    assert np.all(speed[late] < 0.6)
    assert np.all(np.abs(speed - true)[200:] < 3.0 * deviation[200:] + 0.1)


def test_an_abrupt_silence_is_an_outage_and_not_a_calm(recording: Recording) -> None:
    start = recording.start
    cut = start + 25_000_000_000
    stream = [m for m in messages(recording) if m[0] == "angle" or m[2] < cut]
    estimator, found = run(stream)
    assert item(estimator, "cup").level == HealthLevel.ERROR
    late = found.time > cut + 10_000_000_000
    speed = np.hypot(found.velocity[late, 0], found.velocity[late, 1])
    true = np.hypot(*truth_at(recording, found.time[late])[:, :2].T)
    deviation = np.sqrt(found.covariance[late, 0, 0] + found.covariance[late, 1, 1])
    assert np.all(np.abs(speed - true) < 3.0 * deviation)
    assert np.all(speed > 3.0)


@pytest.mark.parametrize("share", [0.1])
def test_lost_edges_are_restored(recording: Recording, share: float) -> None:
    chance = random.Random(9)
    stream = [m for m in messages(recording) if m[0] == "angle" or chance.random() > share]
    _, whole = run(messages(recording))
    estimator, found = run(stream)
    error = np.hypot(*(found.velocity - whole.velocity)[100:, :2].T)
    assert np.sqrt(np.mean(error**2)) < 0.25
    assert abs(np.hypot(*found.velocity[100:, :2].T).mean()
               / np.hypot(*whole.velocity[100:, :2].T).mean() - 1.0) < 0.003
    edges = item(estimator, "cup edges")
    assert edges.level == HealthLevel.WARN
    assert int(edges.values["lost edges"]) > 0.08 * len(recording.pulses["cup"].time)


def test_bouncing_contacts_are_left_out(recording: Recording) -> None:
    chance = random.Random(4)
    stream = messages(recording)
    false = [(k, n, t + 2_000_000, v) for k, n, t, v in stream if k == "pulse"]
    bounced = sorted(
        stream + [m for m in false if chance.random() < 0.05], key=lambda m: m[2]
    )
    _, clean = run(stream)
    estimator, found = run(bounced)
    error = np.hypot(*(found.velocity - clean.velocity)[100:, :2].T)
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert item(estimator, "cup edges").level == HealthLevel.WARN


def test_silence_of_everything_is_told_by_advance(recording: Recording) -> None:
    estimator = make_estimator(mast(), SETTINGS)
    feed(estimator, messages(recording))
    estimator.advance(recording.stop + 15_000_000_000)
    assert item(estimator, "vane").level == HealthLevel.STALE
    assert item(estimator, "cup").level == HealthLevel.STALE


def test_a_counter_or_an_encoder_serves_as_well_as_edges(recording: Recording) -> None:
    stream = messages(recording)
    _, by_edges = run(stream)
    estimator = make_estimator(mast(), SETTINGS)
    turns = 0
    for kind, name, time, value in stream:
        if kind == "pulse":
            turns += 1
            estimator.add_pulse(name, time, turns / 4.0)
        else:
            estimator.add_angle(name, time, value)
    estimator.flush()
    by_count = estimator.take_estimate_arrays()
    both = np.hypot(*(by_count.velocity - by_edges.velocity)[200:, :2].T)
    assert np.sqrt(np.mean(both**2)) < 0.1


def test_a_station_without_vane_is_refused_with_a_remedy() -> None:
    station = mast()
    lonely = station.model_copy(update={"instruments": station.instruments[:1]})
    with pytest.raises(UserError, match="vane"):
        make_estimator(lonely)


@pytest.mark.parametrize(
    ("silent", "what"), [("vane", "direction"), ("cup", "speed")], ids=["vane", "cup"]
)
def test_what_was_never_heard_makes_no_wind(recording: Recording, silent: str, what: str) -> None:
    empty = np.empty(0, dtype=np.int64)
    for unusable in ({}, {silent: Angles(empty, np.empty(0))}):
        pulses = {} if silent == "cup" else recording.pulses
        angles = {} if silent == "vane" else recording.angles
        lacking = replace(recording, pulses=pulses, angles={**angles, **unusable})
        with pytest.raises(UserError, match=f"'{silent}' .*/.*the wind's {what} is not known"):
            process(lacking)
    estimator = make_estimator(recording.station)
    stream = messages(recording)
    feed(estimator, [m for m in stream if m[1] != silent])
    assert not estimator.take_estimates(), "a wind before its instrument was heard is invented"
    estimator.flush()
    assert not estimator.take_estimates()
    assert not [w for w in estimator.take_windows() if w.complete > 0.0]


def test_means_are_refused_stated_or_not(recording: Recording) -> None:
    info = recording.station.recording.model_copy(update={"averaging_time": 600.0})
    station = recording.station.model_copy(update={"recording": info})
    with pytest.raises(UserError, match=r"means over 600 s.*`wind diagnose` compares means"):
        make_estimator(station)
    time = recording.start + np.arange(30, dtype=np.int64) * 600_000_000_000
    rows = replace(
        recording, pulses={"cup": Pulses(time, np.arange(30.0))},
        angles={"vane": Angles(time, np.zeros(30))},
    )
    with pytest.raises(UserError, match=r"29 of 30 stamps .*usually 600 s.*averaging_time"):
        process(rows)


def test_a_vane_that_comes_late_starts_the_estimate(recording: Recording) -> None:
    estimator = make_estimator(recording.station)
    first = recording.start + 25_000_000_000
    feed(estimator, [m for m in messages(recording) if m[1] != "vane" or m[2] >= first])
    estimator.flush()
    found = estimator.take_estimate_arrays()
    assert found.time.size
    assert found.time[0] > first - 2_000_000_000, "no wind before its direction was heard"
    settled = found.time > first + 5_000_000_000
    error = found.velocity[settled, :2] - truth_at(recording, found.time[settled])[:, :2]
    assert np.sqrt(np.mean(np.square(error))) < 0.5


def test_settings_out_of_range_name_themselves() -> None:
    with pytest.raises(UserError, match="smoother_lag"):
        EstimatorSettings(smoother_lag=-1.0)
