"""The demo: its comparisons on known numbers, and the whole of it on a short hour."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from wind_sensors.estimation.outputs import BiasTerm, ProcessedRecording, WindowStatistics
from wind_sensors.recordings import load_station, write_recording
from wind_sensors.report.demo_page import Circumstances, demo_page
from wind_sensors.report.demo_results import DemoResults, demo_results
from wind_sensors.report.live_agreement import Agreement, live_agreement, shortfalls
from wind_sensors.station.signals import FloatArray, Recording, Winds

SECONDS = 300
START = 1_800_000_000 * 10**9


def _processed(error: FloatArray, method: str) -> ProcessedRecording:
    """Estimates with known errors of a wind that blows to the north-east and back."""
    seconds = np.arange(0.0, SECONDS, 0.05)
    time = START + np.rint(seconds * 1e9).astype(np.int64)
    speed = 8.0 + np.sin(seconds)
    true = np.stack([0.6 * speed, 0.8 * speed, 0.0 * speed], axis=1)
    recording = Recording(
        name="made up", station=load_station("mast_cup_vane"), start=START,
        stop=int(time[-1]), truth=Winds(time, true),
    )
    covariance = np.tile(np.diag([0.04, 0.04, 1.0]), (len(time), 1, 1))
    velocity = true + error
    window = _window(true)
    return ProcessedRecording(
        recording=recording, method=method, time=time, velocity=velocity, covariance=covariance,
        apparent=velocity, apparent_covariance=covariance,
        to_earth=np.tile(np.eye(3), (len(time), 1, 1)), windows=(window,), health=(),
    )


def _window(true: FloatArray) -> WindowStatistics:
    stop = START + (SECONDS - 1) * 10**9
    inside = true[: 20 * (SECONDS - 1)]
    mean = inside.mean(axis=0)
    speed = float(np.hypot(mean[0], mean[1]))
    return WindowStatistics(
        start=START, stop=stop, complete=1.0, wind_run_mean=mean[:2] * 1.02, vector_mean=mean,
        vector_mean_covariance=np.eye(3) * 1e-4, bias=0.02 * mean, bias_covariance=np.eye(3) * 0.0,
        raw_scalar_mean=1.02 * speed, scalar_mean=speed, scalar_mean_uncertainty=0.01,
        direction=0.9, direction_uncertainty=0.0, direction_variance=0.0,
        corrected_direction_variance=0.0, direction_variance_uncertainty=0.0,
        turbulence=np.zeros(3), instrument="cup",
        bias_terms={"u": BiasTerm(0.005, 0.003), "v": BiasTerm(0.014, 0.004),
                    "arithmetic_mean": BiasTerm(0.5, 0.0)},
    )


def _noise(scale: float, seed: int) -> FloatArray:
    drawn = scale * np.random.default_rng(seed).standard_normal((SECONDS * 20, 3))
    return np.asarray(drawn)


@pytest.fixture(scope="module")
def results() -> DemoResults:
    return demo_results(_processed(_noise(0.2, 1), "kalman"), _processed(_noise(0.6, 2), "naive"),
                        None)


def test_errors_and_coverage_are_those_that_were_put_in(results: DemoResults) -> None:
    assert results.corrected_error == pytest.approx(0.2 * np.sqrt(2.0), rel=0.03)
    assert results.naive_error == pytest.approx(0.6 * np.sqrt(2.0), rel=0.03)
    assert results.coverage == pytest.approx(0.9, abs=0.015)


def test_biases_are_compared_term_by_term_without_that_of_another_mean(
    results: DemoResults,
) -> None:
    (window,) = results.windows
    assert window.predicted_bias == pytest.approx(0.019)
    assert window.predicted_uncertainty == pytest.approx(0.005)
    assert window.found_bias == pytest.approx(0.02, abs=1e-6)


DUE = START + (SECONDS - 1) * 10**9
"""Until here estimates must have come live; the last second may stay offline."""


def _written(folder: Path, live: ProcessedRecording) -> Path:
    write_recording(folder, live.recording, outputs=live)
    return folder


def _only(processed: ProcessedRecording, kept: np.ndarray) -> ProcessedRecording:
    """Some of the estimates, in the order of `kept`."""
    return replace(
        processed, time=processed.time[kept], velocity=processed.velocity[kept],
        covariance=processed.covariance[kept], apparent=processed.apparent[kept],
        apparent_covariance=processed.apparent_covariance[kept],
        to_earth=processed.to_earth[kept],
    )


def test_live_agreement_sees_one_changed_bit(tmp_path: Path) -> None:
    offline = _processed(_noise(0.2, 1), "kalman")
    live = _written(tmp_path / "live", offline)
    same = live_agreement(live, offline, DUE)
    assert same.is_exact
    assert same.is_complete
    assert same.compared == len(offline.time)
    assert shortfalls(same, 60.0) == []
    velocity = offline.velocity.copy()
    velocity[100, 0] = np.nextafter(velocity[100, 0], 100.0)
    changed = live_agreement(live, replace(offline, velocity=velocity), DUE)
    assert not changed.is_exact
    assert 0.0 < changed.largest_difference < 1e-14
    assert shortfalls(changed, 60.0)[0] == (
        "Live and offline differ, although it had the same messages."
    )


def test_lost_estimates_are_counted_and_the_others_compared(tmp_path: Path) -> None:
    offline = _processed(_noise(0.2, 1), "kalman")
    kept = np.ones(len(offline.time), dtype=bool)
    kept[1000:1400] = False
    kept[-15:] = False
    found = live_agreement(_written(tmp_path / "live", _only(offline, kept)), offline, DUE)
    assert found.lost == 400
    assert found.only_offline == 15
    assert found.compared == len(offline.time) - 415
    assert found.is_exact
    assert not found.is_complete
    sentences = shortfalls(found, 60.0)
    assert sentences[0].startswith("400 of 5985 live estimates and 0 of 1 window means did not")
    assert sentences[-1].endswith("wind demo --rate 15")


def test_a_live_run_without_estimates_is_complained_about_and_not_a_crash(tmp_path: Path) -> None:
    offline = _processed(_noise(0.2, 1), "kalman")
    empty = replace(_only(offline, np.zeros(len(offline.time), dtype=bool)), windows=())
    found = live_agreement(_written(tmp_path / "live", empty), offline, DUE)
    assert (found.compared, found.windows_compared, found.windows_lost) == (0, 0, 1)
    assert not found.is_exact
    assert not found.is_complete
    assert len(shortfalls(found, 60.0)) == 2


def test_estimates_that_begin_anew_are_told_from_those_that_are_lost(tmp_path: Path) -> None:
    offline = _processed(_noise(0.2, 1), "kalman")
    twice = np.concatenate((np.arange(200), np.arange(100, len(offline.time))))
    found = live_agreement(_written(tmp_path / "live", _only(offline, twice)), offline, DUE)
    assert found.restarts == 1
    assert found.is_complete
    reasons = shortfalls(
        Agreement(100, 0, 0, 0.5, 1, 0, 0.0, restarts=1, unheard=3, late=2), 2.0
    )
    assert reasons == [
        "Live and offline differ: 3 raw messages never reached the live estimator, 2 reached it "
        "too late to be used, 1 restarts after late messages, taken for a clock that jumps back.",
        "Run it again when the machine is less busy, or slower: wind demo --rate 1",
    ]


class _Outside(HTMLParser):
    """Collects what a page would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.identifiers: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in {"src", "href", "xlink:href"} and value and not value.startswith("#"):
                self.fetched.append(value)
            if name == "id" and value:
                self.identifiers.append(value)


def test_the_page_is_self_contained_and_its_figures_do_not_mix(results: DemoResults) -> None:
    page = demo_page(results, Circumstances("wind", 300.0, 0.0, 1234, (), 0.8))
    parser = _Outside()
    parser.feed(page)
    assert parser.fetched == []
    assert len(parser.identifiers) == len(set(parser.identifiers))
    used = set(re.findall(r'(?:xlink:href="|url\()#([^")]+)', page))
    assert used <= set(parser.identifiers)
    assert page.count("<svg") == 6
    assert "There is no rclpy" in page


def test_the_page_says_what_did_not_arrive(results: DemoResults) -> None:
    run = Circumstances("wind", 300.0, 10.0, 1234, ("sim_node",), 0.8)
    lost = replace(results, agreement=Agreement(5000, 7, 30, 0.0, 5, 0, 0.0))
    page = demo_page(lost, run)
    assert "7 of 5007 live estimates" in page
    assert "are the same numbers" not in page
    whole = replace(results, agreement=Agreement(5000, 0, 30, 0.0, 5, 0, 0.0))
    assert "are the same numbers" in demo_page(whole, run)


def test_the_demo_runs_live_and_finds_the_same_numbers_offline(tmp_path: Path) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    process = subprocess.run(
        [sys.executable, "-m", "wind_sensors.cli", "demo", "-o", str(tmp_path / "out"),
         "--duration", "120", "--rate", "30"],
        env=os.environ | {"ROS_LOG_DIR": str(tmp_path)}, capture_output=True, text=True,
        timeout=1800, check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    assert "largest difference 0\n" in process.stdout
    page = (tmp_path / "out" / "demo.html").read_text(encoding="utf-8")
    assert "to the last bit" in page
    again = subprocess.run(
        [sys.executable, "-m", "wind_sensors.cli", "demo", "-o", str(tmp_path / "out")],
        capture_output=True, text=True, timeout=600, check=False,
    )
    assert again.returncode == 2
    assert "exists already" in again.stderr
