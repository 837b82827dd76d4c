"""What an estimator finds travels on the documented output topics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Reader

from wind_sensors.errors import UserError
from wind_sensors.estimation.outputs import (
    BiasTerm,
    HealthItem,
    HealthLevel,
    ProcessedRecording,
    WindowStatistics,
)
from wind_sensors.recordings import read_recording, read_series, write_recording
from wind_sensors.recordings.bag import typestore
from wind_sensors.recordings.reading import read_estimates
from wind_sensors.recordings.serialising import TopicMessages
from wind_sensors.station.model import Cup, Input, Station
from wind_sensors.station.signals import Pulses, Recording

START = 1_767_225_600_000_000_000


def small_recording() -> Recording:
    cup = Cup(
        name="cup",
        pulses=Input(topic="/cup/pulses"),
        pulses_per_revolution=4,
        calibration_distance=0.2,
        distance_constant=1.7,
    )
    edges = START + np.arange(50, dtype=np.int64) * 40_000_000
    stop = int(edges[-1])
    return Recording("small", Station(instruments=(cup,)), START, stop, {"cup": Pulses(edges)})


def window(start: int, mean: float) -> WindowStatistics:
    return WindowStatistics(
        start=start,
        stop=start + 600_000_000_000,
        complete=1.0,
        wind_run_mean=np.asarray([mean, 0.0]),
        vector_mean=np.asarray([0.0, -mean, 0.0]),
        vector_mean_covariance=np.eye(3) * 0.01,
        bias=np.zeros(3),
        bias_covariance=np.eye(3) * 0.001,
        raw_scalar_mean=mean,
        scalar_mean=mean,
        scalar_mean_uncertainty=0.1,
        direction=0.0,
        direction_uncertainty=0.01,
        direction_variance=0.02,
        corrected_direction_variance=0.03,
        direction_variance_uncertainty=0.001,
        turbulence=np.ones(3),
        bias_terms={"u": BiasTerm(0.01, 0.001)},
        instrument="cup",
    )


def test_an_input_topic_among_the_outputs_is_refused(tmp_path: Path) -> None:
    recording = small_recording()
    taken = TopicMessages("/cup/pulses", "std_msgs/msg/Header", np.asarray([START]), [b"\0" * 20])
    with pytest.raises(UserError, match="/cup/pulses"):
        write_recording(tmp_path / "r", recording, outputs=[taken])
    assert not (tmp_path / "r").exists()


def test_estimates_become_the_documented_output_topics(tmp_path: Path) -> None:
    recording = small_recording()
    time = START + np.arange(20, dtype=np.int64) * 50_000_000
    rng = np.random.default_rng(7)
    spread = rng.normal(size=(20, 3, 3))
    covariance = spread @ spread.transpose(0, 2, 1)
    processed = ProcessedRecording(
        recording=recording,
        method="kalman",
        time=time,
        velocity=rng.normal(size=(20, 3)),
        covariance=covariance,
        apparent=rng.normal(size=(20, 3)),
        apparent_covariance=covariance,
        to_earth=np.tile(np.eye(3), (20, 1, 1)),
        windows=(window(START, 7.0), window(START + 600_000_000_000, 8.0)),
        health=(HealthItem("cup", HealthLevel.WARN, "slow", {"rate": "3 Hz"}),),
    )
    folder = write_recording(tmp_path / "r", recording, outputs=processed)
    found = read_estimates(folder)
    assert found is not None
    assert np.array_equal(found[0], time)
    assert np.array_equal(found[1], processed.velocity)
    assert np.array_equal(found[2], np.diagonal(covariance, axis1=1, axis2=2))
    assert read_series(folder, "/wind/speed").value.tolist() == [7.0, 8.0]
    assert read_series(folder, "wind/speed").value.tolist() == [7.0, 8.0]
    assert np.allclose(read_series(folder, "/wind/direction_from").value, 0.0)
    assert read_series(folder, "/wind/direction_variance").value.tolist() == [0.03, 0.03]
    assert read_series(folder, "/wind/bias/u").value.tolist() == [0.01, 0.01]
    with Reader(folder / "bag") as reader:
        types = {c.topic: c.msgtype for c in reader.connections}
        (raw,) = [raw for c, _, raw in reader.messages() if c.topic == "/diagnostics"]
    twist = "geometry_msgs/msg/TwistWithCovarianceStamped"
    for topic in ("/wind", "/wind/apparent", "/wind/mean", "/wind/bias"):
        assert types[topic] == twist
    assert types["/wind/vector"] == "geometry_msgs/msg/Vector3Stamped"
    told: Any = typestore().deserialize_cdr(raw, types["/diagnostics"])
    (status,) = told.status
    assert (status.name, status.message, int(status.level)) == ("cup", "slow", 1)
    assert "/wind/body" not in types
    again = read_recording(folder)
    assert np.array_equal(again.pulses["cup"].time, recording.pulses["cup"].time)
