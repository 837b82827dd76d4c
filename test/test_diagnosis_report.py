"""The report of a diagnosis: what a reader sees of it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from test_diagnosis_naming import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.raw_statistics import STATISTICS
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.fitting import ALWAYS, Interval, Term
from wind_sensors.diagnosis.healthy.baseline import ChannelBaseline
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.report.diagnosis_figures import activity_figure, statistics_figure
from wind_sensors.report.diagnosis_page import page, when_text


@lru_cache(maxsize=1)
def stepped() -> Diagnosis:
    """Of a vane whose readings come in steps of eight degrees."""
    steps = {"step": 8.0, "origin": 0.0}
    planted = with_effect(STATION, catalogue()["quantisation"], "vane", steps)
    return diagnose(recorded(planted, 71), baseline())


def of(diagnosis: Diagnosis, kind: str) -> Channel:
    return next(c for c in diagnosis.comparison.channels if c.kind == kind)


def test_steps_that_move_no_mean_are_drawn_before_and_after() -> None:
    found = stepped()
    vane = of(found, "vane_angle")
    known = found.baseline.channels[vane.name]
    made = statistics_figure(found.comparison, known, found.simulated, found.corrected, vane)
    assert made is not None
    (axes,) = made.axes
    drawn = {line.get_label(): np.asarray(line.get_xdata()) for line in axes.get_lines()}
    labels = [text.get_text() for text in axes.get_yticklabels()]
    steps = labels.index("steps of the readings")
    assert abs(drawn["before"][steps]) > 4.0
    assert abs(drawn["with it"][steps]) < 2.0
    assert set(STATISTICS["vane_angle"]) <= set(labels)


def test_what_departs_nowhere_is_not_drawn() -> None:
    found = stepped()
    cup = of(found, "rotor_rate")
    known = found.baseline.channels[cup.name]
    drawn = statistics_figure(found.comparison, known, found.simulated, found.corrected, cup)
    assert drawn is None


@pytest.mark.parametrize("far", [1e3, -1e3])
def test_what_departs_too_far_to_be_drawn_is_told_at_the_edge(far: float) -> None:
    found = stepped()
    vane = of(found, "vane_angle")
    known = found.baseline.channels[vane.name]
    mean = known.statistics_mean.copy()
    place = BANDS + STATISTICS["vane_angle"].index("steps of the readings")
    mean[place] -= far * known.statistics_deviation[place]

    def told_of_steps(baseline: ChannelBaseline) -> float:
        made = statistics_figure(found.comparison, baseline, found.simulated, None, vane)
        assert made is not None
        (axes,) = made.axes
        assert np.abs(axes.get_lines()[0].get_xdata()).max() <= 40.0
        return float(axes.texts[-1].get_text())

    moved = told_of_steps(replace(known, statistics_mean=mean))
    assert moved - told_of_steps(known) == pytest.approx(far, abs=2.0)


def test_eddies_that_grow_calm_inside_the_record_are_drawn() -> None:
    found = stepped()
    cup = of(found, "rotor_rate")
    known = found.baseline.channels[cup.name]
    simulated = found.simulated
    assert activity_figure(found.comparison, known, simulated, None, cup) is None
    levels = simulated.levels[cup.name].copy()
    half = levels.shape[1] // 2
    levels[1, half:] += np.log(4.0)
    livelier = replace(simulated, levels={**simulated.levels, cup.name: levels})
    made = activity_figure(found.comparison, known, livelier, simulated, cup)
    assert made is not None
    (axes,) = made.axes
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in axes.get_lines()}
    before, after = drawn["before"], drawn["with it"]
    # A quarter of the power than before, beside the mean over the record: half to twice as much.
    assert np.log(before[:half]).mean() == pytest.approx(np.log(2.0), abs=0.2)
    assert np.log(before[half:]).mean() == pytest.approx(-np.log(2.0), abs=0.2)
    assert np.abs(np.log(after)).mean() < 0.3
    assert "eddies" in axes.get_title(loc="left")


def test_the_page_tells_name_size_and_what_is_left() -> None:
    text = page(stepped())
    assert "<h1>Quantisation (vane)</h1>" in text
    assert "step 8 deg" in text
    assert "Raw signals, vane, vane angle" in text
    assert "usual to" in text


@pytest.mark.parametrize(
    ("effect", "values", "interval", "words"),
    [
        ("calibration_drift", {"gain": 1.03}, ALWAYS, "all the time"),
        ("calibration_drift", {"gain": 1.03}, (60.4, None), "from 60 s"),
        ("calibration_drift", {"gain": 1.03}, (0.0, 300.0), "from 0 s to 300 s"),
        ("stuck_sensor", {"start": 40.0, "stop": 80.0}, ALWAYS, ""),
    ],
)
def test_people_are_told_when_an_effect_holds(
    effect: str, values: dict[str, float], interval: Interval, words: str
) -> None:
    assert when_text(Term(catalogue()[effect], "cup", values, interval)) == words


def test_the_page_tells_why_a_name_was_withdrawn() -> None:
    found = stepped()
    reason = "lever_arm would fit, but with another size in parts of the record"
    left = replace(found.unexplained, description=f"somewhere; {reason}")
    withdrawn = replace(
        found, verdict="unknown", findings=(), unexplained=left, objection=reason
    )  # fmt: skip
    text = page(withdrawn)
    assert reason in text
    assert "is not borne out" not in text
    assert "is not borne out" in page(replace(withdrawn, objection=""))
