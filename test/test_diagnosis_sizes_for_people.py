"""Names and sizes as people read them: what is told apart, bearings, days, units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION
from hypothesis import given
from hypothesis import strategies as st

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.wording import number_text, parameter_text
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.json_output import finding_json
from wind_sensors.diagnosis.means.findings import too_small
from wind_sensors.diagnosis.proving.findings import Estimate, Finding
from wind_sensors.diagnosis.proving.proof import Proof
from wind_sensors.diagnosis.regions import Found, Region
from wind_sensors.recordings.station_files import shipped_profiles
from wind_sensors.report.corrected_station import corrected_station
from wind_sensors.report.diagnosis_page import when_text
from wind_sensors.report.names import names_of
from wind_sensors.report.removed import removed_text
from wind_sensors.report.sizes import sizes_of
from wind_sensors.station.model import Change, Platform, Station
from wind_sensors.station.reading import read_station


def finding(effect: str, **parameters: Estimate) -> Finding:
    values = {name: estimate.value for name, estimate in parameters.items()}
    term = Term(catalogue()[effect], "cup", values)
    place = Found(Region("cup/rotor_rate", "all", 0.0, 900.0, "everywhere"), 9.0, 0.1, "m/s")
    return Finding(term, parameters, place, 1.0, 0.001, (), None)


ON_A_BOAT = Station.model_validate(
    {
        **STATION.model_dump(exclude_none=True),
        "platform": Platform.model_validate({"odometry": {"topic": "/odom"}}).model_dump(
            exclude_none=True
        ),
    }
)


@given(st.floats(-700.0, 700.0), st.floats(0.5, 20.0))
def test_a_bearing_points_where_its_vector_points(heading: float, half: float) -> None:
    bearing = Estimate(heading, heading - half, heading + half, "deg")
    (size,) = sizes_of(finding("wake_shadow", bearing_from=bearing), STATION)
    assert size.unit == "deg from north"
    east, north = np.cos(np.radians(heading)), np.sin(np.radians(heading))
    told = np.radians(float(size.value))
    # Told to the degree.
    assert np.hypot(np.sin(told) - east, np.cos(told) - north) < np.radians(0.51)
    wide = (float(size.high) - float(size.low)) % 360.0
    assert wide == pytest.approx(2.0 * half, abs=1.01)


def test_on_a_platform_bearings_count_from_the_bow_to_starboard() -> None:
    # The instrument's x axis points forward, its y axis to port.
    port = Estimate(90.0, 80.0, 95.0, "deg")
    (size,) = sizes_of(finding("wake_shadow", bearing_from=port), ON_A_BOAT)
    assert size.text == "wind from 270 deg from the bow (265 to 280)"


def test_a_turned_sensor_does_not_turn_the_bow() -> None:
    assert ON_A_BOAT.platform is not None
    turned = ON_A_BOAT.platform.model_copy(update={"sensor_rotation_deg": (0.0, 0.0, 90.0)})
    boat = ON_A_BOAT.model_copy(update={"platform": turned})
    ahead = Estimate(-90.0, -95.0, -85.0, "deg")
    (size,) = sizes_of(finding("wake_shadow", bearing_from=ahead), boat)
    assert size.value == "0"


def test_the_corrected_station_tells_what_was_found_and_rounds() -> None:
    friction = Estimate(2.1466406783361855, 1.88, 2.41, "m/s")
    found = finding("bearing_friction", friction_speed=friction)
    change = Change(start=1_234_567.8, instrument="cup", set={"friction_speed": friction.value})
    cup = STATION.instrument("cup").model_copy(update={"friction_speed": friction.value})
    others = tuple(i for i in STATION.instruments if i.name != "cup")
    station = STATION.model_copy(update={"instruments": (cup, *others), "changes": (change,)})
    text = corrected_station("day\none", "named", [found], station)
    first, second, third = (line for line in text.splitlines() if line.startswith("#"))
    assert "`wind diagnose`" in first and "named" in first
    assert "95 %" in second
    told = "bearing friction (cup), all the time: friction speed 2.15 m/s (1.88 to 2.41)"
    assert third == f"# - {told}"
    again = read_station(text, "station_corrected.yaml", shipped_profiles())
    assert again.instrument("cup") == cup.model_copy(update={"friction_speed": 2.14664})
    assert again.changes == (
        change.model_copy(update={"set": {"friction_speed": 2.14664}}),
    ), "a late moment keeps its tenth of a second"


def test_late_moments_are_dates_and_early_ones_seconds() -> None:
    day = 86400.0
    long = finding("stuck_sensor", start=Estimate(10.5 * day, 10.5 * day, 10.51 * day, "s"))
    short = finding("stuck_sensor", start=Estimate(405.0, 404.0, 405.0, "s"))
    start = 1_452_353_400_000_000_000
    assert sizes_of(long, STATION, start)[0].text == (
        "start 2016-01-20 03:30 UTC (2016-01-20 03:30 UTC to 2016-01-20 03:44 UTC)"
    )
    assert sizes_of(short, STATION, start)[0].text == "start 405 s (404 to 405)"
    assert when_text(replace(long.term, interval=(0.0, 10.5 * day)), start) == (
        "from 2016-01-09 15:30 UTC to 2016-01-20 03:30 UTC"
    )
    told = finding_json(replace(long, share=float("nan")), 20.0 * day)
    # 10.51 days are 908064 s; to five digits they would be a minute late.
    assert told["parameters"]["start"]["high"] == 908_064.0
    assert told["relative_size"] is None, "nothing was fitted"
    turned = finding("vane_offset", offset=Estimate(3.0, 2.0, 4.0, "deg"))
    assert finding_json(turned, 9.0)["relative_size"] == 3.0


def test_alternatives_are_other_effects_each_once() -> None:
    found = replace(
        finding("vane_offset", offset=Estimate(3.0, 2.0, 4.0, "deg")),
        alternatives=(
            ("vane_offset", "cup", 2.0), ("vane_eccentricity", "cup", 5.0),
            ("vane_eccentricity", "cup", 3.0), ("vane_offset", "other", 4.0),
        ),
    )
    told = [tuple(a.values()) for a in finding_json(found, 9.0)["alternatives"]]
    assert told == [("vane_eccentricity", "cup", 3.0), ("vane_offset", "other", 4.0)]


def test_what_has_no_interval_shows_none() -> None:
    unknown = finding("calibration_drift", gain=Estimate(0.93, float("nan"), float("nan"), "1"))
    assert sizes_of(unknown, STATION)[0].text == "gain 0.93"


def test_what_is_so_or_not_is_told_in_a_word() -> None:
    oiled = finding(
        "vane_damping",
        damping_factor=Estimate(4.7, 3.3, 6.2, "1"),
        viscous=Estimate(1.0, 0.0, 1.0, "1"),
    )
    assert [size.text for size in sizes_of(oiled, STATION)] == [
        "damping factor 4.7 (3.3 to 6.2)",
        "viscous yes",
    ]
    # A number of forms is a number.
    stiff = finding("bearing_friction", breakaway=Estimate(2.2, 1.0, 5.0, "1"))
    assert sizes_of(stiff, STATION)[0].text == "breakaway 2.2 (1 to 5)"


def test_what_acts_together_and_what_is_not_told_apart_read_differently() -> None:
    late, offset, gain = (
        finding(name) for name in ("clock_drift", "calibration_offset", "calibration_drift")
    )
    assert names_of([]) == ""
    assert names_of([late]) == "clock drift (cup)"
    assert names_of([late, offset]) == "clock drift (cup) and calibration offset (cup)"
    either = [replace(offset, set_number=2), replace(gain, set_number=2)]
    assert names_of(either) == "calibration offset (cup) or calibration drift (cup)"
    # The second of two effects has an alternative, the first has none.
    assert names_of([late, *either]) == (
        "clock drift (cup), and calibration offset (cup) or calibration drift (cup)"
    )


@given(st.floats(1e-4, 9.9e5) | st.floats(-9.9e5, -1e-4), st.integers(2, 3))
def test_a_number_is_told_to_its_digits_without_a_power_of_ten(value: float, digits: int) -> None:
    text = number_text(value, digits)
    assert "e" not in text
    assert float(text) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))
    assert len(text.strip("-").replace(".", "").strip("0")) <= digits


def test_very_large_and_unknown_numbers_are_told_as_such() -> None:
    assert number_text(2.34e7) == "2.34e+07"
    assert number_text(float("nan")) == "?"


def test_what_is_not_claimed_counts_bearings_as_the_findings_do() -> None:
    wake = finding("wake_shadow", bearing_from=Estimate(99.0, 97.0, 101.0, "deg"))
    (told,) = (size.text for size in sizes_of(wake, STATION))
    assert told == "wind from 351 deg from north (349 to 353)"
    effect = wake.term.effect
    (bearing,) = (p for p in effect.parameters if p.name == "bearing_from")
    assert parameter_text(bearing, 99.0, STATION) == "wind from 351 deg from north"
    assert parameter_text(bearing, 90.0, ON_A_BOAT) == "wind from 270 deg from the bow"
    # Where nothing tells what the x axis points at, the text says how it counts.
    assert parameter_text(bearing, 99.0).endswith("99 deg counter-clockwise from the x axis")
    values = {"bearing_from": 99.0, "depth": 0.01, "width": 10.0, "flank": 0.0}
    assert "(wind from 351 deg from north, depth 0.01," in too_small(
        Term(effect, "cup", values), STATION
    )


def test_the_sign_of_a_turned_vane_is_told() -> None:
    turned = finding("vane_offset", offset=Estimate(-8.81, -9.1, -8.5, "deg"))
    assert sizes_of(turned, STATION)[0].text == (
        "offset -8.81 deg, counter-clockwise positive (-9.1 to -8.5)"
    )


def test_a_share_of_the_excess_is_not_told_as_one_of_the_misfit() -> None:
    proof = Proof(2.61, 2.25, 1.93, 0.565, 0.42, 0.65, None, None, None, None)
    told = removed_text(proof)
    assert told.startswith("56 % (42 to 65 %) of the excess misfit")
    assert "residual 2.61 before, 2.25 after, floor 1.93" in told
    whole = removed_text(replace(proof, floor=0.0))
    assert "of the whole misfit" in whole and "floor" not in whole
