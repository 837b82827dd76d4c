"""A moving platform whose wind nobody else measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wind_sensors.diagnosis.latent.diagnose import diagnose_latent
from wind_sensors.errors import UserError
from wind_sensors.report.diagnosis_page import VERDICTS
from wind_sensors.report.outcome_page import outcome_page, panel_figure
from wind_sensors.station.model import Station
from wind_sensors.station.signals import Angles, PlatformStates, Pulses, Recording

LENGTH = 0.2


def boat(
    seed: int,
    *,
    share_in_file: float = 1.0,
    turns: bool = True,
    vane_offset_deg: float = 0.0,
    earth_axes: bool = False,
    seconds: int = 7200,
) -> Recording:
    """A boat that tacks in a gusty wind; everything from plane trigonometry."""
    rng = np.random.default_rng(seed)
    t = np.arange(seconds)

    def slow(memory: float) -> np.ndarray:
        out = np.zeros(seconds)
        noise = rng.standard_normal(seconds)
        for i in range(1, seconds):
            out[i] = np.exp(-1.0 / memory) * out[i - 1] + np.sqrt(2.0 / memory) * noise[i]
        return out

    wind = 6.0 + 1.0j + (slow(2000.0) + 1j * slow(2000.0)) * 0.5
    gusts = 0.6 * (slow(6.0) + 1j * slow(6.0))
    legs = np.repeat(rng.uniform(0.0, 2.0 * np.pi, seconds // 150 + 1), 150)[:seconds]
    heading = legs if turns else np.full(seconds, 0.4)
    heading = np.angle(np.convolve(np.exp(1j * heading), np.full(15, 1 / 15), mode="same"))
    pace = 2.5 + (0.4 * slow(200.0) if turns else 0.0)
    velocity = pace * np.exp(1j * heading)
    felt = (wind + gusts - velocity) * np.exp(-1j * heading)
    nose = np.angle(-felt) + np.radians(vane_offset_deg) + 0.02 * rng.standard_normal(seconds)
    run = np.concatenate([[0.0], np.cumsum(np.abs(felt[1:]))])
    station = Station.model_validate(
        {
            "instruments": [
                {
                    "name": "cup", "kind": "cup", "pulses_per_revolution": 4,
                    "pulses": {"topic": "/cup", "type": "std_msgs/msg/Int64"},
                    "calibration_distance": LENGTH, "distance_constant": 2.0,
                },
                {
                    "name": "vane", "kind": "vane", "joint_states": {"topic": "/vane"},
                    "distance_constant": 1.0, "damping_ratio": 0.4,
                },
            ],
            "platform": {
                "odometry": {"topic": "/odom"}, "velocity_share": share_in_file,
                "velocity_axes": "earth" if earth_axes else "platform",
            },
        }
    )
    time = t.astype(np.int64) * 1_000_000_000
    zeros = np.zeros(seconds)
    attitude = np.stack([zeros, zeros, np.sin(heading / 2.0), np.cos(heading / 2.0)], 1)
    reported = velocity if earth_axes else pace + 0.0j * heading
    states = PlatformStates(
        time, attitude, np.stack([reported.real, reported.imag, zeros], 1), np.zeros((seconds, 3)),
        np.zeros((seconds, 3)),
    )
    return Recording(
        "boat", station, 0, int(time[-1]),
        pulses={"cup": Pulses(time, run / LENGTH / (2.0 * np.pi))},
        angles={"vane": Angles(time, nose)}, platform=states,
    )


def test_motion_is_found_where_the_station_leaves_it_out() -> None:
    outcome = diagnose_latent(boat(1, share_in_file=0.0))
    assert outcome.verdict == "named"
    (finding,) = outcome.findings
    assert finding.term.effect.name == "platform_velocity"
    share = finding.parameters["velocity_share"]
    assert share.low < 1.0 < share.high
    assert share.high - share.low < 0.3
    assert finding.proof is not None
    assert finding.proof.excess_removed > 0.4
    # Nobody knows how much of the misfit is gusts: the excess is all of it.
    assert finding.proof.floor == 0.0
    left = (finding.proof.after / finding.proof.before) ** 2
    assert finding.proof.excess_removed == pytest.approx(1.0 - left)
    assert finding.proof.placebo_removed is not None
    assert finding.proof.placebo_removed < 0.2 * finding.proof.excess_removed
    assert outcome.station.platform is not None
    assert outcome.station.platform.velocity_share == 1.0


@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_named_on_a_boat_as_described(seed: int) -> None:
    outcome = diagnose_latent(boat(seed + 20))
    assert outcome.verdict == "none"
    assert not outcome.findings
    (line,) = (line for line in outcome.declined if line.startswith("vane offset"))
    assert "lowers the misfit by" in line or "raises the misfit by" in line
    assert "needed)" in line and "counter-clockwise positive" in line
    # What was declined has a size that would have shown.
    assert {"vane_offset/vane", "calibration_drift/cup"} <= set(outcome.smallest_detectable)
    text = outcome_page(outcome)
    assert text.count(VERDICTS["none"]) == 1
    assert "Nothing that matters" not in text
    (figure,) = {p.title for p in outcome.panels}
    drawn = panel_figure(list(outcome.panels), outcome.start, 9.0)
    assert not any(axis.get_legend() for axis in drawn.axes), figure
    (legend,) = drawn.legends
    # Nothing was fitted: there is one curve, not one over the other.
    assert [text.get_text() for text in legend.get_texts()] == ["before"]


def test_a_turned_vane_is_not_told_from_a_compass_where_the_velocity_is_the_earths() -> None:
    recording = boat(3, vane_offset_deg=25.0, earth_axes=True)
    outcome = diagnose_latent(recording)
    found = {f.term.effect.name: f for f in outcome.findings}
    assert {"vane_offset", "heading_deviation"} <= set(found)
    assert found["vane_offset"].set_number == found["heading_deviation"].set_number == 1
    assert found["vane_offset"].term.values["offset"] == pytest.approx(25.0, abs=5.0)
    assert outcome.verdict == "ambiguous"
    assert outcome.station == recording.station
    assert any("corrected station has none of it" in line for line in outcome.declined)


def test_what_is_too_small_to_be_named_is_told_and_not_corrected() -> None:
    recording = boat(3, share_in_file=0.8)
    outcome = diagnose_latent(recording)
    assert not outcome.findings
    assert any("smaller than what is worth reporting" in line for line in outcome.declined)
    assert outcome.station == recording.station


def test_a_velocity_in_the_boats_axes_tells_the_vane_from_the_compass() -> None:
    outcome = diagnose_latent(boat(3, vane_offset_deg=25.0))
    (finding,) = outcome.findings
    assert finding.term.effect.name == "vane_offset"
    assert finding.term.values["offset"] == pytest.approx(25.0, abs=5.0)


def test_a_straight_course_is_inconclusive() -> None:
    outcome = diagnose_latent(boat(4, share_in_file=0.0, turns=False))
    assert outcome.verdict == "inconclusive"
    assert not outcome.findings


def test_what_cannot_be_compared_is_refused_in_words() -> None:
    with pytest.raises(UserError, match="too short"):
        diagnose_latent(boat(5, seconds=900))
    with pytest.raises(UserError, match="platform"):
        diagnose_latent(replace(boat(5), platform=None))
