"""Instruments of a mast against each other, where only means were recorded."""

from __future__ import annotations

import csv
import gzip
import itertools
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from representatives import represented

from wind_sensors.diagnosis.explaining.terms import ALWAYS
from wind_sensors.diagnosis.means.averages import averages_of, indicated_speed, joined
from wind_sensors.diagnosis.means.diagnose import diagnose_means
from wind_sensors.diagnosis.means.healthy import learn_means
from wind_sensors.diagnosis.means.mean_response import mean_speed
from wind_sensors.diagnosis.outcome import outcome_json
from wind_sensors.errors import UserError
from wind_sensors.instruments.dynamics.rotor_record import integrate_rotor
from wind_sensors.report.names import names_of
from wind_sensors.report.outcome_page import outcome_page
from wind_sensors.station.model import Cup, Station, Vane
from wind_sensors.station.parameters import rotor_parameters
from wind_sensors.station.signals import Angles, Pulses, Recording, Series

FloatArray = npt.NDArray[np.float64]

MAST = Path(__file__).parents[2] / "shared" / "real" / "mast_10min" / "mast.csv.gz"
LENGTH = 0.24351
ROWS = 4000
PAIRS = (("one_a", "one_b"), ("two_a", "two_b"))
CUPS = tuple(itertools.chain(*PAIRS))


def station_of(cups: tuple[str, ...], vanes: tuple[str, ...]) -> Station:
    made = [
        {
            "name": name, "kind": "cup", "pulses_per_revolution": 2,
            "pulses": {"topic": f"/{name}", "type": "std_msgs/msg/Float64", "meaning": "value"},
            "calibration_distance": LENGTH, "starting_speed": 0.3, "distance_constant": 3.0,
        }
        for name in cups
    ]
    turning = [
        {
            "name": name, "kind": "vane", "distance_constant": 1.3, "damping_ratio": 0.3,
            "joint_states": {"topic": f"/{name}"},
        }
        for name in vanes
    ]
    return Station.model_validate(
        {
            "recording": {"averaging_time": 600.0, "measuring_height": 60.0},
            "instruments": made + turning,
        }
    )


def recording_of(
    station: Station, time: npt.NDArray[np.int64], speed: dict[str, FloatArray],
    heading: dict[str, FloatArray], temperature: FloatArray | None = None,
) -> Recording:
    seconds = np.diff(time) * 1e-9
    pulses = {}
    for name, values in speed.items():
        rate = np.maximum(values[1:] - 0.3, 0.0) / (2.0 * np.pi * LENGTH)
        pulses[name] = Pulses(time, np.concatenate([[0.0], np.cumsum(rate * seconds)]))
    return Recording(
        name="mast", station=station, start=int(time[0]), stop=int(time[-1]), pulses=pulses,
        angles={name: Angles(time, values) for name, values in heading.items()},
        temperature=None if temperature is None else Series(time, temperature),
    )


def weather(seed: int, rows: int = ROWS) -> dict[str, FloatArray]:
    """Wind, direction, shear and gusts of a made-up month; nothing of the package is in it."""
    rng = np.random.default_rng(seed)

    def slow(hours: float) -> FloatArray:
        memory = np.exp(-1.0 / (6.0 * hours))
        out = np.empty(rows)
        out[0] = rng.standard_normal()
        for i in range(1, rows):
            out[i] = memory * out[i - 1] + np.sqrt(1.0 - memory**2) * rng.standard_normal()
        return out

    wind = 7.5 * np.exp(0.4 * slow(18.0))
    out = {"wind": wind, "heading": np.cumsum(0.06 * rng.standard_normal(rows)) + slow(10.0)}
    shear = 0.04 + 0.012 * slow(6.0)
    for k, name in enumerate(CUPS):
        level = wind * (1.0 + shear * (k < 2))
        noise = 0.006 * wind * (0.6 * slow(1.0) + 0.8 * rng.standard_normal(rows))
        out[name] = level + noise
    for name in ("vane_a", "vane_b", "vane_c"):
        out[name] = out["heading"] + np.radians(0.6) * slow(12.0)
    return out


def made(
    seed: int, rows: int = ROWS
) -> tuple[Station, npt.NDArray[np.int64], dict[str, FloatArray]]:
    station = station_of(CUPS, ("vane_a", "vane_b", "vane_c"))
    time = np.arange(rows, dtype=np.int64) * 600_000_000_000
    return station, time, weather(seed, rows)


def recorded(
    station: Station, time: npt.NDArray[np.int64], values: dict[str, FloatArray]
) -> Recording:
    return recording_of(
        station, time, {name: values[name] for name in CUPS},
        {name: values[name] for name in ("vane_a", "vane_b", "vane_c")},
    )


def names(recording: Recording, healthy: Recording | None = None) -> list[tuple[str, str, int]]:
    normal = None if healthy is None else learn_means([(healthy, {})])
    outcome = diagnose_means(recording, {}, normal)
    return [(f.term.effect.name, f.term.instrument, f.set_number) for f in outcome.findings]


def test_steady_means_agree_with_the_integrated_equation_of_motion() -> None:
    cup = station_of(("cup",), ()).instrument("cup")
    assert isinstance(cup, Cup)
    for keys in (
        {"friction_speed": 1.5}, {"calibration_gain": 0.95}, {"calibration_offset": -0.2},
        {"friction_speed": 1.0, "a4": 0.7}, {"friction_speed": 1.0, "a4": 1.4},
    ):
        changed = cup.model_copy(update=keys)
        station = station_of(("cup",), ()).model_copy(update={"instruments": (changed,)})
        for wind in (2.0, 4.0, 9.0):
            n = 400
            ones = np.ones(n)
            y, _ = integrate_rotor(
                rotor_parameters(changed), 0.0 * ones, wind * ones, 0.0 * ones, ones, 15.0 * ones,
                0.25, 1, wind, 0.0,
            )
            one = np.ones(1)
            shown = mean_speed(
                station, "cup", wind * one, 0.0 * one, 0.0 * one, 15.0 * one,
                1.225 * one, 0.0 * one,
            )
            assert shown[0] == pytest.approx(y[-1] + 0.3, abs=2e-3)


def test_indicated_speeds_come_back_from_turns() -> None:
    station, time, values = made(3, 300)
    cup = station.instrument("one_a")
    assert isinstance(cup, Cup)
    recording = recorded(station, time, values)
    _, speed = indicated_speed(cup, recording.pulses["one_a"])
    assert speed == pytest.approx(values["one_a"][1:], rel=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_named_on_healthy_means(seed: int) -> None:
    station, time, values = made(seed)
    _, _, before = made(seed + 100)
    assert names(recorded(station, time, values)) == []
    assert names(recorded(station, time, values), recorded(station, time, before)) == []


def test_a_tower_wake_is_found_at_its_bearing() -> None:
    station, time, values = made(11)
    away = (np.degrees(values["heading"]) - 40.0 + 180.0) % 360.0 - 180.0
    # A wake with straight sides, not the catalogue's Gaussian.
    values["one_b"] = values["one_b"] * (1.0 - 0.2 * np.clip(1.0 - np.abs(away) / 22.0, 0.0, 1.0))
    outcome = diagnose_means(recorded(station, time, values), {})
    found = {f.term.effect.name: f for f in outcome.findings if f.set_number == 0}
    assert set(found) == {"wake_shadow"}
    wake = found["wake_shadow"]
    assert wake.term.instrument == "one_b"
    assert wake.term.values["bearing_from"] % 360.0 == pytest.approx(40.0, abs=2.0)
    assert wake.term.values["depth"] == pytest.approx(0.19, abs=0.03)
    assert wake.proof is not None
    assert wake.proof.excess_removed > 0.8
    text = outcome_page(outcome)
    assert "<h1>Wake shadow (one_b)</h1>" in text
    assert text.count("<div class='wide'><svg") == text.count("<div class='narrow'><svg") > 0


def test_other_heights_say_which_of_two_cups_has_changed() -> None:
    station, time, values = made(12)
    _, _, before = made(112)
    values["one_b"] = values["one_b"] * 0.95
    found = names(recorded(station, time, values), recorded(station, time, before))
    assert ("calibration_drift", "one_b", 0) in found
    assert not any(name == "one_a" for _, name, _ in found)


def test_without_anything_else_a_gain_is_not_blamed_on_one_of_two_cups() -> None:
    station, time, values = made(12)
    values["one_b"] = values["one_b"] * 0.95
    found = names(recorded(station, time, values))
    gains = {(name, number) for effect, name, number in found if effect == "calibration_drift"}
    assert gains == {("one_a", 1), ("one_b", 1)}


def test_friction_is_told_from_gain_and_offset() -> None:
    station, time, values = made(13)
    _, _, before = made(113)
    values["two_a"] = np.maximum(values["two_a"] - 2.5 / values["two_a"], 0.0)
    found = names(recorded(station, time, values), recorded(station, time, before))
    assert ("bearing_friction", "two_a", 0) in found


def test_a_turned_vane_is_told_from_two_that_are_not() -> None:
    station, time, values = made(14)
    _, _, before = made(114)
    values["vane_b"] = values["vane_b"] + np.radians(7.0)
    normal = learn_means([(recorded(station, time, before), {})])
    outcome = diagnose_means(recorded(station, time, values), {}, normal)
    (finding,) = outcome.findings
    assert (finding.term.effect.name, finding.term.instrument) == ("vane_offset", "vane_b")
    estimate = finding.parameters["offset"]
    assert estimate.value == pytest.approx(7.0, abs=0.5)
    corrected = outcome.station.instrument("vane_b")
    assert isinstance(corrected, Vane)
    assert corrected.offset_deg == pytest.approx(estimate.value)


def test_a_constant_turn_without_healthy_means_is_declined_but_a_step_is_not() -> None:
    station, time, values = made(15)
    constant = {**values, "vane_b": values["vane_b"] + np.radians(7.0)}
    outcome = diagnose_means(recorded(station, time, constant), {})
    assert not outcome.findings
    assert any(line.startswith("vane_b") for line in outcome.declined)
    late = np.arange(ROWS) > ROWS // 2
    step = {**values, "vane_b": values["vane_b"] + np.radians(9.0) * late}
    outcome = diagnose_means(recorded(station, time, step), {})
    (finding,) = outcome.findings
    assert finding.term.instrument == "vane_b"
    assert finding.term.interval != ALWAYS
    assert abs(finding.term.values["offset"]) == pytest.approx(9.0, abs=1.0)


def test_a_sensor_that_stands_in_the_wind_is_stuck_and_takes_no_part() -> None:
    station, time, values = made(16)
    stuck = {**values, "vane_a": values["vane_a"].copy(), "two_b": values["two_b"].copy()}
    stuck["vane_a"][2500:] = stuck["vane_a"][2500]
    stuck["two_b"][3000:] = 0.0
    outcome = diagnose_means(recorded(station, time, stuck), {})
    found = {f.term.instrument: f for f in outcome.findings}
    assert set(found) == {"vane_a", "two_b"}
    assert all(f.term.effect.name == "stuck_sensor" for f in found.values())
    assert found["vane_a"].term.values["start"] == pytest.approx(2500 * 600.0, abs=1300.0)
    assert found["two_b"].term.values["start"] == pytest.approx(3000 * 600.0, abs=1300.0)
    # Rows of ten minutes from 1970 on: that at 20:00 began ten minutes earlier.
    assert found["two_b"].located.region.label.startswith("0 m/s from 1970-01-21 19:50 UTC to ")
    assert "stuck sensor" in outcome_page(outcome) and "since 1970-01-01 00:00 UTC" in outcome_page(
        outcome
    )


def test_ice_is_told_from_a_cup_that_is_slow_in_warm_air_too() -> None:
    station, time, values = made(17)
    temperature = 6.0 + 7.0 * np.sin(np.arange(ROWS) / 300.0)
    frozen = values["one_b"].copy()
    warm = values["one_b"].copy()
    rng = np.random.default_rng(5)
    for row in rng.choice(np.flatnonzero((temperature < 0.0) & (values["wind"] > 4.0)), 9):
        frozen[row : row + 8] *= 0.4
    for row in rng.choice(np.flatnonzero(values["wind"] > 4.0), 9):
        warm[row : row + 8] *= 0.4
    headings = {name: values[name] for name in ("vane_a", "vane_b", "vane_c")}
    for changed, expected in ((frozen, True), (warm, False)):
        speeds = {name: values[name] for name in CUPS} | {"one_b": changed}
        recording = recording_of(station, time, speeds, headings, temperature)
        assert (("icing", "one_b", 0) in names(recording)) is expected


def test_too_few_means_are_refused_in_words() -> None:
    station, time, values = made(1, 100)
    with pytest.raises(UserError, match="too few"):
        diagnose_means(recorded(station, time, values), {})


def mast_rows(count: int) -> tuple[npt.NDArray[np.int64], dict[str, FloatArray]]:
    with gzip.open(MAST, "rt", encoding="utf-8-sig", newline="") as file:
        rows = list(itertools.islice(csv.DictReader(file), count))
    stamps = [datetime.fromisoformat(r["Timestamp"]).replace(tzinfo=timezone.utc) for r in rows]
    time = np.array([int(s.timestamp()) for s in stamps], dtype=np.int64) * 1_000_000_000
    columns = ("Spd60mN", "Spd60mS", "Spd40mN", "Spd40mS", "Dir58mS", "Dir38mS", "Dir78mS")
    return time, {c: np.array([float(r[c]) for r in rows]) for c in columns}


@pytest.mark.skipif(not MAST.exists(), reason="shared material absent")
def test_on_the_real_mast_a_planted_gain_is_named_and_the_mast_as_it_is_gets_no_name() -> None:
    time, columns = mast_rows(13_000)
    cups = ("Spd60mN", "Spd60mS", "Spd40mN", "Spd40mS")
    vanes = ("Dir58mS", "Dir38mS", "Dir78mS")
    station = station_of(cups, vanes)

    def part(first: int, last: int, factor: float) -> Recording:
        rows = slice(first, last)
        speeds = {c: columns[c][rows] * (factor if c == "Spd40mS" else 1.0) for c in cups}
        headings = {v: np.radians(90.0 - columns[v][rows]) for v in vanes}
        return recording_of(station, time[rows], speeds, headings)

    healthy = part(0, 6500, 1.0)
    assert names(part(6500, 13_000, 1.0), healthy) == []
    assert names(part(6500, 13_000, 1.04), healthy)[0][:2] == ("calibration_drift", "Spd40mS")


def _stiff_in_the_cold(wind: FloatArray, temperature: FloatArray) -> FloatArray:
    """Integrates dy/dt = ((U - y) U - k(T)) / l0 until nothing moves: grease twice as stiff 20 K
    below the temperature of the calibration."""
    k = 2.5 * np.exp(-0.035 * (temperature - 15.0))
    y = wind.copy()
    for _ in range(400):
        y = np.maximum(y + 0.05 * ((wind - y) * wind - k) / 3.0 * 2.0, 0.0)
    return np.asarray(y)


@pytest.mark.parametrize("stiff", represented([True, False], by=(True,)))
def test_friction_follows_the_temperature_only_where_held_out_blocks_say_so(stiff: bool) -> None:
    station, time, values = made(13)
    _, _, before = made(113)
    season = 5.0 + 12.0 * np.sin(np.arange(ROWS) / 500.0) + 3.0 * np.sin(np.arange(ROWS) / 23.0)
    at = season if stiff else np.full(ROWS, 15.0)
    wind = values["two_a"] - 0.3
    values["two_a"] = np.maximum(_stiff_in_the_cold(wind, at), 0.0) + 0.3
    headings = {name: values[name] for name in ("vane_a", "vane_b", "vane_c")}
    speeds = {name: values[name] for name in CUPS}
    recording = recording_of(station, time, speeds, headings, season)
    normal = learn_means([(recorded(station, time, before), {})])
    found = {
        f.term.instrument: f
        for f in diagnose_means(recording, {}, normal).findings
        if f.term.effect.name == "bearing_friction"
    }
    assert set(found) == {"two_a"}
    estimates = found["two_a"].parameters
    assert estimates["friction_speed"].value == pytest.approx(np.sqrt(2.5), rel=0.12)
    if stiff:
        assert estimates["temperature_coefficient"].value == pytest.approx(-0.035, abs=0.01)
    else:
        assert "temperature_coefficient" not in estimates


def test_one_healthy_recording_is_enough_and_its_limits_are_told() -> None:
    station, time, values = made(13)
    _, _, before = made(113, 600)
    values["two_a"] = np.maximum(values["two_a"] - 4.0 / values["two_a"], 0.0)
    normal = learn_means([(recorded(station, time[:600], before), {})])
    outcome = diagnose_means(recorded(station, time, values), {}, normal)
    assert ("bearing_friction", "two_a") in [f.term.key for f in outcome.findings]
    assert any("one recording of 4 days" in note for note in outcome.declined)
    assert any("directions and speeds" in note for note in outcome.declined)


def test_several_healthy_recordings_are_one_with_gaps() -> None:
    station, time, values = made(20, 900)
    rows = (slice(0, 300), slice(600, 900))
    parts = []
    for chosen in rows:
        some = {name: column[chosen] for name, column in values.items()}
        parts.append(averages_of(recorded(station, time[chosen], some)))
    whole = averages_of(recorded(station, time, values))
    both = joined([parts[1], parts[0]])
    _, here, there = np.intersect1d(both.time, whole.time, return_indices=True)
    assert here.size == len(both) == 598
    assert both.speed["one_a"] == pytest.approx(whole.speed["one_a"][there])
    assert both.heading["vane_b"] == pytest.approx(whole.heading["vane_b"][there])
    assert np.diff(both.elapsed).max() == pytest.approx(302 * 600.0)


def test_sets_of_vanes_are_numbered_after_those_of_pairs() -> None:
    _, time, values = made(12)
    values["one_b"] = values["one_b"] * 0.95
    late = np.arange(ROWS) > ROWS // 2
    values["vane_b"] = values["vane_b"] + np.radians(9.0) * late
    vanes = ("vane_a", "vane_b")
    recording = recording_of(
        station_of(CUPS, vanes), time, {name: values[name] for name in CUPS},
        {name: values[name] for name in vanes},
    )
    phases: dict[str, float] = {}
    outcome = diagnose_means(recording, {}, progress=phases.__setitem__)
    sets: dict[int, set[tuple[str, str]]] = {}
    for f in outcome.findings:
        sets.setdefault(f.set_number, set()).add(f.term.key)
    assert sets == {
        1: {("calibration_drift", "one_a"), ("calibration_drift", "one_b")},
        2: {("vane_offset", "vane_a"), ("vane_offset", "vane_b")},
    }
    assert outcome.verdict == "ambiguous"
    assert names_of(outcome.findings) == (
        "calibration drift (one_a) or calibration drift (one_b), and vane offset (vane_a) or vane "
        "offset (vane_b)"
    )
    assert phases["vane_b and the other vanes"] == 1.0
    # Of two that disagree the corrected station must not turn the healthy one, and says so.
    assert outcome.station == recording.station
    assert [line for line in outcome.declined if "corrected station has none of it" in line] == [
        f"set {number}, {together}: the corrected station has none of it, for the data do not say "
        "what to correct."
        for number, together in (
            (1, "calibration drift (one_a) or calibration drift (one_b)"),
            (2, "vane offset (vane_a) or vane offset (vane_b)"),
        )
    ]


def test_the_corrected_station_holds_what_is_named_and_nothing_smaller() -> None:
    station, time, values = made(11)
    away = (np.degrees(values["heading"]) - 40.0 + 180.0) % 360.0 - 180.0
    values["one_b"] = values["one_b"] * (1.0 - 0.2 * np.exp(-0.5 * (away / 9.0) ** 2))
    values["two_a"] = 0.992 * values["two_a"]
    outcome = diagnose_means(recorded(station, time, values), {})
    (finding,) = outcome.findings
    assert any("smaller than what is worth reporting" in line for line in outcome.declined)
    for name in PAIRS[1]:
        assert outcome.station.instrument(name) == station.instrument(name)
    cup = outcome.station.instrument("one_b")
    assert isinstance(cup, Cup)
    (wake,) = cup.wake_shadows
    assert wake.depth == pytest.approx(finding.term.values["depth"])
    assert outcome.station == finding.term.planted(station)


def test_what_nobody_computed_has_no_number() -> None:
    station, time, values = made(16, 1500)
    values["two_b"] = values["two_b"].copy()
    values["two_b"][1000:] = 0.0
    outcome = diagnose_means(recorded(station, time, values), {})
    (stuck,) = outcome_json(outcome)["findings"]
    assert stuck["effect"] == "stuck_sensor"
    assert stuck["located"]["p"] is None
    assert stuck["located"]["share"] is None
    assert "p =" not in outcome_page(outcome)
    assert outcome.station == outcome.findings[0].term.planted(station)


def test_a_vane_is_not_proved_against_its_own_fit() -> None:
    station, time, values = made(14)
    _, _, before = made(114)
    # An eccentric disc with two lobes is in no catalogue: most of it is left.
    lobes = np.radians(5.0) * np.sin(2.0 * values["heading"])
    values["vane_b"] = values["vane_b"] + np.radians(7.0) + lobes
    normal = learn_means([(recorded(station, time, before), {})])
    (finding,) = diagnose_means(recorded(station, time, values), {}, normal).findings
    proof = finding.proof
    assert proof is not None
    assert proof.floor == 0.0
    assert proof.excess_removed == pytest.approx(1.0 - (proof.after / proof.before) ** 2)
    assert proof.excess_removed < 0.95
