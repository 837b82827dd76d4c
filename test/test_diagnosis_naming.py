"""The diagnosis on recordings of the package's own simulator, with a reference that errs."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from diagnosis_cases import STATION, baseline, diagnosed, recorded
from representatives import represented

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.guesses import guesses_of
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.json_output import as_json
from wind_sensors.diagnosis.verdict import diagnose


@pytest.mark.parametrize("seed", [20, 21])
def test_nothing_is_named_on_a_healthy_day(seed: int) -> None:
    assert diagnose(recorded(STATION, seed), baseline()).verdict == "none"


PLANTED = {
    "calibration_drift": ("cup", "gain", 0.94),
    "rotor_inertia": ("cup", "inertia_factor", 3.0),
    "vane_offset": ("vane", "offset", 6.0),
    "vane_friction": ("vane", "friction_speed", 2.5),
    "timestamp_latency": ("vane", "latency", 0.8),
}


@pytest.mark.parametrize(
    "effect", represented(PLANTED, by=("calibration_drift", "rotor_inertia", "vane_friction"))
)
def test_a_planted_effect_gets_its_name_and_its_size(effect: str) -> None:
    instrument, parameter, value = PLANTED[effect]
    found = diagnosed(effect, instrument, **{parameter: value})
    assert found.verdict == "named"
    assert [f.term.key for f in found.findings] == [(effect, instrument)]
    estimate = found.findings[0].parameters[parameter]
    # A 95 % interval misses one time in twenty; three standard errors hardly ever.
    assert abs(estimate.value - value) < 1.5 * 0.5 * (estimate.high - estimate.low)
    healthy = found.findings[0].term.effect.parameters[0].healthy or 0.0
    assert estimate.value - healthy == pytest.approx(value - healthy, rel=0.2)
    proof = found.findings[0].proof
    assert proof is not None
    assert proof.excess_removed > 0.8


def test_of_a_vane_out_of_balance_on_a_mast_the_product_with_the_lean_is_told() -> None:
    values = {"imbalance": 7.0, "tilt_x": 5.0, "tilt_y": -4.0}
    found = diagnosed("vane_imbalance", "vane", **values)
    assert [f.term.key for f in found.findings] == [("vane_imbalance", "vane")]
    term = found.findings[0].term
    # Which lean it is with another imbalance, hangs a little on the flow past a leaning mast.
    pull = [term.values["imbalance"] * term.values[lean] for lean in ("tilt_x", "tilt_y")]
    assert pull == pytest.approx([35.0, -28.0], abs=8.0)
    assert term.relative_size == pytest.approx(7.0 * 6.4 / 0.45, rel=0.15)
    assert set(found.findings[0].parameters) == {"tilt_x", "tilt_y"}


def test_the_corrected_station_no_longer_differs() -> None:
    found = diagnosed("calibration_drift", "cup", gain=0.94)
    again = diagnose(
        replace(recorded(found.station, 50), name="again"),
        replace(baseline(), station=found.station),
    )
    assert again.verdict == "none"


def test_a_beginning_inside_the_record_is_part_of_the_finding() -> None:
    effect = catalogue()["vane_offset"]
    station = with_effect(STATION, effect, "vane", {"offset": 8.0}, (150.0, None))
    found = diagnose(recorded(station, 51), baseline())
    assert [f.term.key for f in found.findings] == [("vane_offset", "vane")]
    begin, end = found.findings[0].term.interval
    assert begin == pytest.approx(150.0, abs=15.0)
    assert end is None


def test_a_beginning_and_an_end_of_an_effect_that_depends_on_the_direction() -> None:
    effect = catalogue()["vane_eccentricity"]
    station = with_effect(
        STATION, effect, "vane", {"sine": 6.0, "cosine": 3.0}, (120.0, 290.0)
    )
    found = diagnose(recorded(station, 52, swing=1.0), baseline())
    assert [f.term.key for f in found.findings] == [("vane_eccentricity", "vane")]
    begin, end = found.findings[0].term.interval
    assert begin == pytest.approx(120.0, abs=15.0)
    assert end == pytest.approx(290.0, abs=15.0)


@pytest.mark.parametrize(
    "interval", represented([(170.0, None), (110.0, 260.0)], by=((170.0, None),))
)
def test_a_counter_that_loses_what_follows_too_soon_for_a_while(
    interval: tuple[float, float | None],
) -> None:
    effect = catalogue()["missed_pulses"]
    dead = {"dead_time": 0.013, "loss_probability": 0.0, "loss_growth": 0.0}
    station = with_effect(STATION, effect, "cup", dead, interval)
    found = diagnose(recorded(station, 53), baseline())
    assert [f.term.key for f in found.findings] == [("missed_pulses", "cup")]
    assert found.findings[0].term.values["dead_time"] == pytest.approx(0.013, rel=0.1)
    begin, end = found.findings[0].term.interval
    assert begin == pytest.approx(interval[0], abs=25.0)
    assert end == (None if interval[1] is None else pytest.approx(interval[1], abs=25.0))


def test_a_rotor_held_still_in_the_wind_suggests_a_bearing_that_sticks() -> None:
    sticky = {"friction_speed": 2.0, "temperature_coefficient": 0.0, "breakaway": 3.0}
    station = with_effect(STATION, catalogue()["bearing_friction"], "cup", sticky)
    for planted, suggested in ((station, True), (STATION, False)):
        guesses = guesses_of(prepare(recorded(planted, 54, mean=3.5)), STATION)
        forms = guesses.get(("bearing_friction", "cup"), [])
        assert any(term.values["breakaway"] > 1.0 for term in forms) == suggested


def test_the_json_has_the_stated_shape() -> None:
    content = as_json(diagnosed("vane_offset", "vane", offset=6.0))
    assert set(content) >= {
        "recording", "verdict", "null_calibrated", "findings", "unexplained", "smallest_detectable",
    }
    finding = content["findings"][0]
    assert set(finding) >= {"effect", "instrument", "located", "physics", "equation", "parameters",
                            "alternatives", "proof"}
    assert set(finding["located"]) >= {"channel", "time", "region", "excess", "unit", "share", "p"}
    assert set(finding["parameters"]["offset"]) == {"value", "low", "high", "unit"}


def test_a_baseline_survives_its_file() -> None:
    again = Baseline.from_json(baseline().to_json())
    assert again.station == baseline().station
    assert again.standing == dict(baseline().standing)
    for name, channel in baseline().channels.items():
        assert again.channels[name].exponent == pytest.approx(channel.exponent)


def test_a_baseline_with_other_statistics_is_none_of_this_version() -> None:
    content = json.loads(baseline().to_json())
    content["channels"]["cup/rotor_rate"]["statistics_mean"].pop()
    with pytest.raises(ValueError, match="other statistics of cup/rotor_rate"):
        Baseline.from_json(json.dumps(content))
