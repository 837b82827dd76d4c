"""The running comparison on simulated stations in which something goes wrong on the way."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from representatives import represented

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import learn
from wind_sensors.diagnosis.watch import Watch, WatchSettings, store
from wind_sensors.diagnosis.watch.replaying import replay
from wind_sensors.diagnosis.watch.sequential import SequentialTest
from wind_sensors.errors import UserError
from wind_sensors.recordings import load_station
from wind_sensors.simulation.run import simulate
from wind_sensors.simulation.scenario import Scenario
from wind_sensors.station.model import Input, Reference, Station
from wind_sensors.station.signals import Angles, Recording
from wind_sensors.turbulence.synthesis import TurbulenceSpec

BEGINNING = 480.0
LEARNING = 6
SECONDS = 1020.0

PLANTED = {
    "vane_offset": ("vane", {"offset": 3.0}),
    "vane_friction": ("vane", {"friction_speed": 1.5}),
    "timestamp_latency": ("vane", {"latency": 0.45}),
    "low_pass_filter": ("vane", {"time_constant": 0.3}),
    "missed_pulses": ("cup", {"dead_time": 0.0, "loss_probability": 0.03, "loss_growth": 0.0}),
    "extra_pulses": ("cup", {"bounce_probability": 0.03, "bounce_delay": 0.003}),
    "bearing_friction": ("cup", {"friction_speed": 1.5}),
}
"""Effects at three times the smallest size worth reporting."""


@lru_cache(maxsize=1)
def station() -> Station:
    reference = Reference(topic=Input(topic="/reference/wind"), separation=0.5, path_length=0.15)
    return load_station("mast_cup_vane").model_copy(update={"reference": reference})


def recorded(planted: Station, seconds: float = SECONDS, seed: int = 3) -> Recording:
    wind = TurbulenceSpec(
        mean_speed=7.0,
        direction=0.5,
        standard_deviations=(1.1, 0.9, 0.6),
        integral_lengths=(60.0, 40.0, 20.0),
        seed=seed,
    )
    return simulate(planted, Scenario(wind=wind, duration=seconds, seed=seed))


def watched(recording: Recording, drive: str = "reference") -> Watch:
    watch = Watch(station(), WatchSettings(drive=drive, learning=LEARNING))
    replay(recording, watch)
    return watch


def test_healthy_hours_raise_no_alarm() -> None:
    watch = watched(recorded(station(), 5400.0))
    assert watch.blocks > 85
    assert watch.skipped == 0
    assert watch.finding is None
    assert not watch.past


@pytest.mark.parametrize(
    "name", represented(PLANTED, by=("vane_friction", "missed_pulses"))
)
def test_an_effect_is_found_within_minutes_and_named_among_the_candidates(name: str) -> None:
    instrument, values = PLANTED[name]
    effect = catalogue()[name]
    complete = {p.name: p.healthy or 0.0 for p in effect.parameters} | values
    planted = with_effect(station(), effect, instrument, complete, (BEGINNING, None))
    recording = recorded(planted)
    watch = watched(recording)
    finding = watch.finding
    assert finding is not None
    assert BEGINNING < (finding.detected - recording.start) * 1e-9 < BEGINNING + 480.0
    assert abs((finding.onset - recording.start) * 1e-9 - BEGINNING) < 200.0
    assert name in [c.effect for c in finding.candidates]
    assert "wind diagnose" in finding.message()


def test_a_vane_that_sticks_is_told_by_its_readings() -> None:
    healthy = recorded(station(), 600.0)
    time, angle = healthy.angles["vane"].time, healthy.angles["vane"].angle.copy()
    stuck = (time - healthy.start) * 1e-9 > 500.0
    angle[stuck] = angle[stuck][0]
    watch = watched(replace(healthy, angles={"vane": Angles(time, angle)}))
    assert watch.finding is not None
    assert watch.finding.certain
    assert watch.finding.candidates[0].effect == "stuck_sensor"
    assert abs((watch.finding.onset - healthy.start) * 1e-9 - 500.0) < 1.0


def test_lost_pulses_are_found_without_any_reference() -> None:
    values = {"dead_time": 0.0, "loss_probability": 0.05, "loss_growth": 0.0}
    effect = catalogue()["missed_pulses"]
    planted = with_effect(station(), effect, "cup", values, (BEGINNING, None))
    without = replace(recorded(planted), reference=None)
    watch = watched(without, "estimate")
    assert watch.finding is not None
    assert "missed_pulses" in [c.effect for c in watch.finding.candidates]


def test_memory_does_not_grow_and_a_clock_set_back_is_survived() -> None:
    recording = recorded(station(), 300.0)
    watch = Watch(station(), WatchSettings(learning=LEARNING))
    replay(recording, watch)
    blocks = watch.blocks
    replay(recording, watch)
    assert watch.blocks == 2 * blocks
    held = sum(len(samples) for samples in watch._store._samples.values())
    assert held < 100.0 * (20.0 + 20.0 + 60.0)


def test_sums_pass_their_threshold_as_rarely_as_stated() -> None:
    rng = np.random.default_rng(1)
    test = SequentialTest(false_alarms_per_day=1.0, blocks_per_day=1440.0)
    test.resize(60)
    alarms = 0
    for block in range(14_400):
        test.add(block, rng.standard_normal(60), np.ones(60))
        if test.onset() is not None:
            alarms += 1
            test.up[:] = 0.0
            test.down[:] = 0.0
    assert alarms <= 10
    for block in range(14_400, 14_412):
        departure = rng.standard_normal(60)
        departure[7] += 3.0
        test.add(block, departure, np.ones(60))
    onset = test.onset()
    assert onset is not None
    assert 14_398 <= onset <= 14_404


@lru_cache(maxsize=1)
def commissioned() -> Baseline:
    return learn([recorded(station(), 420.0, seed) for seed in (21, 22, 23)])


def planted(name: str, values: dict[str, float], interval: tuple[float, float | None]) -> Station:
    effect = catalogue()[name]
    instrument = "vane" if name.startswith("vane") else "cup"
    complete = {p.name: p.healthy or 0.0 for p in effect.parameters} | values
    return with_effect(station(), effect, instrument, complete, interval)


def looked(recording: Recording, executor: Executor | None = None) -> Watch:
    watch = Watch(station(), WatchSettings(), commissioned(), executor)
    replay(recording, watch)
    return watch


def test_with_a_baseline_what_was_wrong_from_the_start_is_found() -> None:
    heavy = planted("rotor_inertia", {"inertia_factor": 2.6}, (0.0, None))
    recording = recorded(heavy, 460.0)
    finding = looked(recording).finding
    assert finding is not None
    assert (finding.detected - recording.start) * 1e-9 < 440.0
    assert finding.channel == "cup/rotor_rate"
    assert finding.candidates[0].effect == "rotor_inertia"
    assert finding.candidates[0].values["inertia_factor"] == pytest.approx(2.6, rel=0.2)


def test_with_a_baseline_a_healthy_quarter_of_an_hour_raises_no_alarm() -> None:
    watch = looked(recorded(station(), 900.0, seed=5))
    assert watch.learnt
    assert watch.finding is None
    assert not watch.past


def test_a_look_begins_where_the_store_still_holds_everything(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(store, "MOST_SAMPLES", 50)
    kept = store.SignalStore()
    for k in range(80):
        kept.add_pulse("cup", k * 10)
        if k % 4 == 0:
            kept.add_angle("vane", k * 10, 0.0)
    assert kept.complete_since == 300
    kept.clear()
    assert kept.complete_since == 0


class Later(Executor):
    """Runs what it is given when it is asked to, or breaks."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[object], Callable[[], object]]] = []

    def submit(self, fn: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.waiting.append((future, lambda: fn(*arguments, **options)))
        return future


def test_signals_do_not_wait_for_a_look_that_is_taken_beside() -> None:
    turned = planted("vane_offset", {"offset": 6.0}, (0.0, None))
    recording = recorded(turned, 460.0)
    beside = Later()
    watch = looked(recording, beside)
    assert watch.blocks == 7
    assert watch.finding is None
    ((future, work),) = beside.waiting
    future.set_result(work())
    watch.add_wind(recording.stop + 50_000_000, np.array([7.0, 0.0, 0.0]))
    assert watch.finding is not None
    assert watch.finding.channel == "vane/vane_angle"
    assert "vane_offset" in [c.effect for c in watch.finding.candidates]


def test_a_process_beside_that_dies_is_done_without() -> None:
    beside = Later()
    watch = looked(recorded(station(), 460.0), beside)
    ((future, _),) = beside.waiting
    future.set_exception(BrokenExecutor())
    assert not watch.learnt
    replay(recorded(station(), 460.0), watch)
    assert len(beside.waiting) == 1
    assert watch.learnt


def test_settings_that_do_not_fit_are_refused() -> None:
    with pytest.raises(UserError, match="nothing to compare"):
        WatchSettings(drive="hope")
    with pytest.raises(UserError, match="not clear"):
        WatchSettings(drive="instruments")
    with pytest.raises(UserError, match="no instrument 'cup2'"):
        Watch(station(), WatchSettings(drive="instruments", driving=("cup2",)))


def test_a_velocity_that_comes_apart_is_kept_apart_and_known_where_it_was_told() -> None:
    station = load_station("multirotor")
    kept = store.SignalStore()
    second = 10**9
    for time in range(0, 10 * second + 1, second):
        kept.add_platform(time, [0.0, 0.0, 0.0, 1.0, *[0.0] * 9])
        kept.add_wind(time, [5.0, 0.0, 0.0])
    for time in (0, 1, 2, 8, 10):
        kept.add_platform_velocity(time * second, [float(time), 0.0, 0.0])
    found = kept.recording(station, 0, 0, 10 * second)
    assert found is not None and found.platform is not None
    assert found.platform_velocity is not None
    assert found.platform_velocity.time.tolist() == [t * second for t in (0, 1, 2, 8, 10)]
    nan = np.nan
    np.testing.assert_allclose(
        found.platform.velocity[:, 0], [0, 1, 2, nan, nan, nan, nan, nan, 8, 9, 10]
    )
