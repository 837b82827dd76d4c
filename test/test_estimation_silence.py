"""Silence of instruments: what is not measured is not told, and what is at rest is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from estimation_cases import Message, blown, feed, mast, messages

from wind_sensors.estimation import (
    EstimatorSettings,
    HealthItem,
    HealthLevel,
    Method,
    StreamingEstimator,
    make_estimator,
    process,
)
from wind_sensors.estimation.outputs import WindowStatistics
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Recording, Winds

SECOND = 1_000_000_000
CUT = 40.0
WINDOW = 20.0


@pytest.fixture(scope="module")
def recording() -> Recording:
    return blown(mast(), duration=130.0)


class Run:
    """An estimator that has heard some of a recording's messages."""

    def __init__(
        self,
        recording: Recording,
        heard: Callable[[str, float], bool],
        method: Method = "naive",
        station: Station | None = None,
        tail: float = 0.0,
    ) -> None:
        start = recording.start
        settings = EstimatorSettings(method=method, window=WINDOW)
        self.estimator = make_estimator(station or recording.station, settings)
        stream = [m for m in messages(recording) if heard(m[1], (m[2] - start) / SECOND)]
        feed(self.estimator, stream)
        for step in range(round(4 * tail)):
            self.estimator.advance(stream[-1][2] + step * SECOND // 4)
        found = self.estimator.take_estimate_arrays()
        self.velocity = found.velocity
        self.since = (found.time - start) / SECOND
        self.windows = self.estimator.take_windows()
        self.begins = [(w.start - start) / SECOND for w in self.windows]

    def window(self, begin: float) -> WindowStatistics:
        """The window that begins then [s]."""
        return next(w for b, w in zip(self.begins, self.windows, strict=True) if b == begin)


def item(estimator: StreamingEstimator, name: str, whole: bool = False) -> HealthItem:
    return next(i for i in estimator.health(whole) if i.name == name)


def told(window: WindowStatistics) -> list[float]:
    """Every number that a window tells."""
    return [
        *window.vector_mean, *window.bias, window.scalar_mean, window.direction,
        window.corrected_direction_variance, *window.turbulence,
        *(term.value for term in window.bias_terms.values()),
    ]


@pytest.mark.parametrize("method", ["kalman", "inverse", "naive"])
def test_where_nothing_speaks_the_wind_ends_and_no_mean_is_made_up(
    recording: Recording, method: Method
) -> None:
    run = Run(recording, lambda _, since: since < CUT, method, tail=70.0)
    stop_time = run.estimator.settings.stop_time
    assert run.since[-1] <= CUT + stop_time
    assert all(np.isfinite(told(run.window(CUT - WINDOW))))
    assert np.isnan(told(run.window(CUT))).all()
    assert run.window(CUT).complete < 0.1
    assert run.begins[-1] == CUT, "a window without any wind has no message"
    estimate = item(run.estimator, "estimate")
    assert estimate.level == HealthLevel.ERROR
    assert "Nothing has been measured" in estimate.message
    cup = item(run.estimator, "cup")
    assert cup.level == HealthLevel.STALE
    assert "its driver is dead" in cup.message
    assert item(run.estimator, "bias").level == HealthLevel.STALE


def test_the_wind_comes_back_with_its_signals(recording: Recording) -> None:
    run = Run(recording, lambda _, since: not CUT < since < 80.0, "kalman")
    silent = (run.since > CUT + 11.0) & (run.since < 79.0)
    assert not silent.any()
    assert np.count_nonzero(run.since > 81.0) > 900
    assert all(np.isfinite(told(run.window(100.0))))
    assert item(run.estimator, "estimate").level == HealthLevel.OK
    assert item(run.estimator, "clock").level == HealthLevel.OK
    assert all(item(run.estimator, name).values["ahead"] == "0" for name in ("cup", "vane"))


@pytest.mark.parametrize("method", ["kalman", "naive"])
def test_a_dead_cup_is_no_calm_though_the_vane_speaks(
    recording: Recording, method: Method
) -> None:
    run = Run(recording, lambda name, since: name == "vane" or since < CUT, method)
    assert np.isnan(told(run.window(CUT))).all()
    assert run.since[-1] <= CUT + 60.0
    assert item(run.estimator, "cup").level == HealthLevel.ERROR
    assert item(run.estimator, "vane").level == HealthLevel.OK
    estimate = item(run.estimator, "estimate")
    assert estimate.level == HealthLevel.ERROR
    assert "speed has not been measured" in estimate.message


def test_a_dead_vane_claims_no_direction(recording: Recording) -> None:
    run = Run(recording, lambda name, since: name == "cup" or since < CUT)
    assert np.isnan(told(run.window(CUT))).all()
    assert item(run.estimator, "vane").level == HealthLevel.STALE
    estimate = item(run.estimator, "estimate")
    assert estimate.level == HealthLevel.WARN
    assert "direction has not been measured" in estimate.message


def test_one_of_two_cups_is_enough_for_the_mean_and_not_for_its_bias(
    recording: Recording,
) -> None:
    station = recording.station
    cup, vane = station.instruments
    other = cup.model_copy(update={"name": "other"})
    both = station.model_copy(update={"instruments": (cup, other, vane)})
    edges = recording.pulses["cup"]
    twice = replace(recording, station=both, pulses={"cup": edges, "other": edges})
    run = Run(twice, lambda name, since: name != "cup" or since < CUT, "kalman", both)
    window = run.window(CUT)
    assert window.complete == 1.0
    assert np.isfinite([window.scalar_mean, *window.vector_mean_covariance.ravel()]).all()
    assert np.isnan([*window.bias, window.raw_scalar_mean]).all()
    assert np.isnan(window.corrected_direction_variance)
    assert item(run.estimator, "bias").level == HealthLevel.WARN


def _steady(station: Station, speeds: list[float], seconds: float) -> Recording:
    """Stretches of constant wind, one after the other."""
    time = np.arange(round(len(speeds) * seconds * 20.0)) * 50_000_000
    size = np.array(speeds)[np.minimum(time // round(seconds * SECOND), len(speeds) - 1)]
    wind = Winds(time, np.stack((0.9 * size, 0.436 * size, 0.0 * size), axis=1))
    return simulate(station, Scenario(wind=wind, duration=len(speeds) * seconds, seed=1))


def test_a_rotor_at_rest_in_a_calm_is_a_measurement() -> None:
    station = mast({"friction_speed": 0.15})
    recording = _steady(station, [3.0, 0.5, 0.3, 0.0, 0.0, 0.0], WINDOW)
    run = Run(recording, lambda *_: True)
    assert item(run.estimator, "cup").level == HealthLevel.WARN
    assert "has stopped" in item(run.estimator, "cup").message
    calm = run.window(4 * WINDOW)
    assert calm.complete == 1.0
    assert calm.scalar_mean < 0.3
    assert np.isnan(calm.corrected_direction_variance), "no run of wind weighs its directions"
    assert run.since[-1] > 6 * WINDOW - 2.0
    assert all(i.name != "estimate" for i in run.estimator.health())


def test_edges_seconds_apart_are_a_slow_wind() -> None:
    station = mast({"pulses_per_revolution": 1})
    recording = _steady(station, [0.5, 0.5, 0.5], WINDOW)
    assert np.diff(recording.pulses["cup"].time).max() > 2 * SECOND
    run = Run(recording, lambda *_: True)
    assert [w.complete for w in run.windows[1:]] == [1.0] * (len(run.windows) - 1)
    assert item(run.estimator, "cup").level == HealthLevel.OK


def _on_change(stream: list[Message], step: float) -> list[Message]:
    """A vane that tells its reading, in steps, only when it is another."""
    out: list[Message] = []
    last = np.nan
    for kind, name, time, value in stream:
        rounded = step * round(value / step) if kind == "angle" else value
        if kind != "angle" or rounded != last:
            out.append((kind, name, time, rounded))
        last = rounded if kind == "angle" else last
    return out


def test_a_vane_that_speaks_on_change_only_is_not_dead() -> None:
    recording = blown(mast(), duration=300.0, intensity=0.05)
    estimator = make_estimator(mast(), EstimatorSettings(method="naive", window=60.0))
    stream = _on_change(messages(recording), np.radians(8.0))
    readings = [m[2] for m in stream if m[0] == "angle"]
    assert np.diff(readings).max() > 5 * SECOND
    feed(estimator, stream)
    assert estimator.take_estimate_arrays().time.size > 5800
    windows = estimator.take_windows()
    assert all(np.isfinite(w.scalar_mean) for w in windows[2:])


def test_in_a_steady_wind_the_variance_of_its_direction_is_not_negative() -> None:
    run = Run(_steady(mast(vane={"noise_deg": 0.0}), [6.0, 6.0, 6.0], WINDOW), lambda *_: True)
    assert len(run.windows) >= 2
    for window in run.windows:
        assert 0.0 <= window.direction_variance < 1e-6
        assert window.corrected_direction_variance >= 0.0


def test_one_stamp_some_seconds_ahead_makes_no_wind_of_the_future(recording: Recording) -> None:
    stream = messages(recording)[:1500]
    stray = ("angle", "vane", stream[700][2] + 55 * SECOND, 0.3)
    settings = EstimatorSettings(method="naive", window=WINDOW)
    found = []
    for each in (stream, [*stream[:700], stray, *stream[700:]]):
        estimator = make_estimator(mast(), settings)
        feed(estimator, each)
        found.append(estimator.take_estimate_arrays())
    assert np.array_equal(found[0].time, found[1].time)
    assert np.array_equal(found[0].velocity, found[1].velocity)
    clock = item(estimator, "clock")
    assert clock.level == HealthLevel.WARN
    assert "1 of vane" in clock.message
    assert item(estimator, "vane").values["ahead"] == "1"


def test_messages_seconds_apart_are_used_though_each_is_ahead_of_the_clock() -> None:
    estimator = make_estimator(mast(), EstimatorSettings(method="naive"))
    for second in range(0, 60, 3):
        estimator.add_angle("vane", second * SECOND, 0.3)
        estimator.add_pulse("cup", second * SECOND)
    late = item(estimator, "vane")
    assert int(late.values["messages"]) >= 15
    assert (late.values["late"], item(estimator, "cup").values["late"]) == ("0", "0")
    stray = 300 * SECOND
    estimator.add_angle("vane", stray, 0.3)
    for second in range(60, 90, 3):
        estimator.add_pulse("cup", second * SECOND)
        estimator.add_angle("vane", second * SECOND, 0.3)
    assert estimator.take_estimates()[-1].time < 90 * SECOND
    assert item(estimator, "clock").values["implausible stamps"] == "1"
    assert item(estimator, "clock").values["jumps"] == "0"


@pytest.mark.parametrize(
    ("shift", "text"),
    [
        (-1.5, "1.5 s behind"), (-30.0, "30.0 s behind"), (-1.7e9, "19676 days behind"),
        (30.0, "30.0 s ahead"), (4e5, "5 days ahead"),
    ],
)
def test_an_input_on_another_clock_is_named_with_its_offset(shift: float, text: str) -> None:
    estimator = make_estimator(mast(), EstimatorSettings(method="naive"))
    start = 1_800_000_000 * SECOND
    for step in range(200):
        time = start + step * SECOND // 20
        estimator.add_pulse("cup", time)
        estimator.add_angle("vane", time + round(shift * SECOND), 0.3)
    assert item(estimator, "cup").level != HealthLevel.ERROR
    for name in ("vane", "clock"):
        problem = item(estimator, name)
        assert problem.level == HealthLevel.ERROR
        assert "messages of vane are stamped" in problem.message
        assert text in problem.message
        assert "clocks in step" in problem.message
    assert ("reordering_window" in item(estimator, "vane").message) == (shift == -1.5)


def test_levels_tell_the_present_state_and_values_the_whole_story(recording: Recording) -> None:
    stream = messages(recording)
    broken = [
        (k, n, t, np.nan if k == "angle" and 200 < i < 220 else v)
        for i, (k, n, t, v) in enumerate(stream)
    ]
    stray = ("angle", "vane", stream[300][2] + 55 * SECOND, 0.3)
    gap = [m for m in broken if not 10e9 < m[2] - stream[0][2] < 15e9 or m[1] != "vane"]
    gap.insert(300, stray)
    estimator = make_estimator(mast(), EstimatorSettings(method="naive"))
    feed(estimator, gap[:900])
    assert item(estimator, "vane").level == HealthLevel.WARN
    assert item(estimator, "clock").level == HealthLevel.WARN
    feed(estimator, gap[900:])
    vane = item(estimator, "vane")
    assert vane.level == HealthLevel.OK
    assert item(estimator, "clock").level == HealthLevel.OK
    assert int(vane.values["not a number"]) > 5
    assert int(vane.values["gaps"]) == 1
    assert item(estimator, "vane", whole=True).level == HealthLevel.WARN
    assert item(estimator, "clock", whole=True).level == HealthLevel.WARN


def test_a_recording_that_is_over_is_judged_as_a_whole(recording: Recording) -> None:
    angles = recording.angles["vane"]
    kept = (angles.time - recording.start < 10 * SECOND) | (
        angles.time - recording.start > 15 * SECOND
    )
    fewer = replace(angles, time=angles.time[kept], angle=angles.angle[kept])
    found = process(replace(recording, angles={"vane": fewer}), EstimatorSettings(method="naive"))
    vane = next(i for i in found.health if i.name == "vane")
    assert vane.level == HealthLevel.WARN
    assert "1 gaps, the longest 5.1 s" in vane.message
