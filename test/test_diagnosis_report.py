"""The report of a diagnosis: what a reader sees of it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.observation import Channel
from wind_sensors.diagnosis.comparing.observing import BANDS
from wind_sensors.diagnosis.comparing.raw_statistics import STATISTICS
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.detectable import equals_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term
from wind_sensors.diagnosis.healthy.baseline import ChannelBaseline
from wind_sensors.diagnosis.json_output import as_json, finding_json
from wind_sensors.diagnosis.regions import Found, Region
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.report.diagnosis_figures import activity_figure, statistics_figure
from wind_sensors.report.diagnosis_page import page, when_text, where_text


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
    made = statistics_figure(
        found.comparison, known, found.simulated, found.corrected, vane, calibrated=True
    )
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
    drawn = statistics_figure(
        found.comparison, known, found.simulated, found.corrected, cup, calibrated=True
    )
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
        made = statistics_figure(
            found.comparison, baseline, found.simulated, None, vane, calibrated=True
        )
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
    ("kind", "label", "told"),
    [
        ("all", "everywhere", "over the whole record"),
        ("time", "0 to 57 s", "in the part of the record from 0 to 57 s"),
        ("speed", "4.1 to 5.5 m/s", "at wind speeds of 4.1 to 5.5 m/s"),
        ("speed", "below 5.5 m/s", "at wind speeds below 5.5 m/s"),
        ("direction", "wind from 0 to 10 deg from north", "in wind from 0 to 10 deg from north"),
        ("heading", "heading 45 deg", "at headings from 45 to 90 deg"),
        ("frequency", "0.0784 to 0.142 Hz", "at 0.0784 to 0.142 Hz"),
        ("spectrum", "power of eddies of 2 to 4 m", "in the power of eddies of 2 to 4 m"),
        ("statistic", "steps of the readings", "in the steps of the readings"),
    ],
)
def test_regions_are_parts_of_sentences(kind: str, label: str, told: str) -> None:
    assert where_text(Region("cup/rotor_rate", kind, 45.0, 90.0, label)) == told


def test_the_page_gives_the_evidence_for_a_name() -> None:
    found = stepped()
    finding = found.findings[0]
    region = Region("cup/rotor_rate", "frequency", 0.08, 0.14, "0.08 to 0.14 Hz")
    located = Found(region, 9.0, 0.485, "m/s")
    small = replace(finding, located=located, p=0.078, gain=88.12, share=0.5)
    text = page(replace(found, findings=(small,)))
    assert (
        "The mismatch is largest <b>at 0.08 to 0.14 Hz</b> (cup, rotor rate): the residual "
        "scatters by 0.485 m/s in all, p = 0.078 after looking everywhere. On the data that "
        "it was fitted to the effect removes 50 % of the whole misfit and lowers minus twice the "
        "log-likelihood by 88: that names it"
    ) in text
    assert finding_json(small, 400.0)["gain"] == 88.12
    assert finding_json(replace(small, gain=0.0), 400.0)["gain"] is None
    assert "that names it" not in page(replace(found, findings=(replace(small, p=0.002),)))


def test_grey_is_explained_where_there_is_grey() -> None:
    found = stepped()
    assert "grey is what healthy days show" in page(found), "the raw signals depart"
    elsewhere = Region("cup/rotor_rate", "all", 0.0, 0.0, "")
    only = replace(found.findings[0], located=Found(elsewhere, 9.0, 0.5, "m/s"))
    assert "grey" not in page(replace(found, findings=(only,)))


def test_without_healthy_days_nothing_is_measured_by_them() -> None:
    found = stepped()
    told = page(found)
    assert "deviations of healthy days" in told and "1 is what healthy days show" in told
    alone = replace(found, calibrated=False, baseline=replace(found.baseline, recordings=()))
    assert not alone.baseline.calibrated
    told = page(alone)
    assert "deviations that certificates allow" in told
    assert "grey is what certificates allow" in told
    assert "1 is what certificates allow" in told
    assert "No healthy recording is behind what counts as usual" in told
    assert "healthy days show" not in told and "of healthy days" not in told
    assert "what healthy days of stations with a baseline and simplified forms leave" in told


def test_what_was_compared_and_is_not_drawn_is_told() -> None:
    assert "Compared as well, and not drawn: cup, rotor rate." in page(stepped())


def test_names_in_equations_are_set_apart() -> None:
    effect = catalogue()["bearing_friction"]
    assert "`" in effect.equation
    found = stepped()
    term = replace(found.findings[0].term, effect=effect)
    told = page(replace(found, findings=(replace(found.findings[0], term=term, proof=None),)))
    assert "<i>breakaway</i>" in told


def test_nothing_blue_is_promised_where_nothing_is_named() -> None:
    found = stepped()
    assert "Blue: with the named physics" in page(found)
    assert "Blue" not in page(replace(found, verdict="unknown", findings=()))


def test_the_page_tells_why_nothing_can_be_told() -> None:
    found = stepped()
    reason = "the wind is below 4.0 m/s nearly all the time"
    left = replace(found.unexplained, description=reason)
    calm = replace(found, verdict="inconclusive", findings=(), unexplained=left)
    assert f"<p>{reason}.</p>" in page(calm)


def test_a_mast_is_not_told_to_look_along_a_keel() -> None:
    found = stepped()
    offset = Term(catalogue()["vane_offset"], "vane", {"offset": 5.0})
    turned = replace(found, findings=(replace(found.findings[0], term=offset),))
    assert "frame_error" in offset.effect.confusable
    text = page(turned)
    assert "What to measure next" in text
    assert "frame error" not in text
    assert "keel" not in text


def test_smallest_sizes_say_what_they_are_sizes_of() -> None:
    found = stepped()
    sizes = found.smallest_detectable
    assert sizes["air_density"].parameter == "density_ratio"
    assert sizes["flow_distortion"].parameter == "cosine_1 or sine_1 or cosine_2 or sine_2"
    assert all(size.parameter for size in sizes.values())
    text = page(found)
    value = f"{sizes['air_density'].value:.3g}"
    assert f"<td>density ratio {value} (share)</td>" in text
    assert "if everything else were known" in text
    told = as_json(found)["smallest_detectable"]["calibration_offset"]
    assert (told["parameter"], told["unit"]) == ("offset", "m/s")


@pytest.mark.parametrize(
    ("effect", "parameter", "equals"),
    [
        ("missed_pulses", "loss_probability", ["loss_probability"]),
        ("angular_response", "skewness", ["skewness"]),
        ("heading_deviation", "cosine", ["constant", "sine", "cosine"]),
    ],
)
def test_a_smallest_size_is_one_of_all_parameters_that_are_tried_alike(
    effect: str, parameter: str, equals: list[str]
) -> None:
    tried = catalogue()[effect]
    assert equals_of(tried, next(p for p in tried.parameters if p.name == parameter)) == equals


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
    )
    text = page(withdrawn)
    assert reason in text
    assert "is not borne out" not in text
    assert "is not borne out" in page(replace(withdrawn, objection=""))
