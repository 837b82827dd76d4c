"""Two racing yachts from their NMEA 0183 logs: the motion is removed without fitting anything."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from representatives import represented

from wind_sensors.cli.import_ import load_mapping
from wind_sensors.cli.main import main
from wind_sensors.errors import UserError
from wind_sensors.estimation import EstimatorSettings, process
from wind_sensors.recordings import read_recording
from wind_sensors.recordings.importing import import_files, write_imported
from wind_sensors.report.heading_scatter import heading_scatter
from wind_sensors.simulation import Scenario, Trajectory, simulate
from wind_sensors.station.model import Station
from wind_sensors.turbulence.synthesis import isotropic_spec

LOGS = Path(__file__).resolve().parents[2] / "shared" / "real" / "yacht_nmea"


@pytest.mark.parametrize(
    "name",
    represented(
        ["Irene_2013-08-03_Flensburg", "Psaros33_2014-08-05", "Psaros33_2014-08-20"],
        by=("Psaros33_2014-08-20",),
    ),
)
def test_removing_a_yachts_motion_takes_away_most_of_the_scatter(
    tmp_path: Path, name: str
) -> None:
    log = LOGS / f"{name}.txt.gz"
    if not log.exists():
        pytest.skip("shared material absent")
    mapping = load_mapping("nmea_yacht")
    folder = tmp_path / "yacht"
    write_imported(folder, import_files([log], mapping), mapping)
    settings = EstimatorSettings(output_rate=1.0, smoother_lag=10.0)
    scatter = heading_scatter(process(read_recording(folder), settings))
    assert len(scatter.blocks) >= 4
    assert scatter.ratio < 0.65


def test_the_commands_lead_from_a_log_to_the_wind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if not LOGS.exists():
        pytest.skip("shared material absent")
    log, folder, found = LOGS / "Psaros33_2014-08-20.txt.gz", tmp_path / "log", tmp_path / "wind"
    assert main(["import", str(log), "--mapping", "nmea_yacht", "-o", str(folder)]) == 0
    assert (
        main(
            [
                "process", str(folder), "-o", str(found), "--output-rate", "1",
                "--smoother-lag", "20", "--method", "inverse",
            ]
        )
        == 0
    )
    assert str(found) in capsys.readouterr().out.replace("\n", "")
    topics = (found / "bag" / "metadata.yaml").read_text(encoding="utf-8")
    assert {"/wind", "/wind/apparent", "/wind/mean"} <= set(re.findall(r"name: (\S+)", topics))


def circling() -> Station:
    """Cup and vane on something that moves."""
    return Station.model_validate(
        {
            "instruments": [
                {"kind": "cup", "name": "cup", "pulses": {"topic": "/c"},
                 "pulses_per_revolution": 8, "calibration_distance": 0.2,
                 "distance_constant": 1.5},
                {"kind": "vane", "name": "vane", "joint_states": {"topic": "/v"},
                 "distance_constant": 0.5, "damping_ratio": 0.4},
            ],
            "platform": {"odometry": {"topic": "/o"}},
        }
    )


def test_scatter_before_is_the_carriers_speed_and_after_it_the_winds_own() -> None:
    """On whole circles the felt wind scatters by the carrier's speed and the turbulence."""
    speed, intensity, wind = 3.0, 0.05, 8.0
    scenario = Scenario(
        isotropic_spec(wind, intensity, 60.0, seed=2), duration=600.0,
        trajectory=Trajectory("circle", speed=speed, turn_seconds=60.0), platform_noise=False,
    )
    recording = simulate(circling(), scenario)
    scatter = heading_scatter(process(recording, EstimatorSettings(output_rate=5.0)))
    assert recording.truth is not None
    own = float(recording.truth.velocity[:, :2].var(axis=0).sum())
    assert scatter.before == pytest.approx(np.sqrt(speed**2 + own), rel=0.03)
    assert scatter.after == pytest.approx(np.sqrt(own), rel=0.1)


def test_a_straight_course_cannot_show_it_and_says_so() -> None:
    scenario = Scenario(
        isotropic_spec(8.0, 0.05, 60.0, seed=2), duration=60.0,
        trajectory=Trajectory("hold", speed=3.0),
    )
    recording = simulate(circling(), scenario)
    with pytest.raises(UserError, match="several headings"):
        heading_scatter(process(recording, EstimatorSettings(output_rate=5.0)))
