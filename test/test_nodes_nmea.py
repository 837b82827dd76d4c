"""NMEA 0183 sentences against published examples and their checksums."""

from __future__ import annotations

import pytest

from wind_sensors.nodes.nmea import apparent_wind_sentence, true_wind_sentence
from wind_sensors.recordings.nmea import with_checksum


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,", "47"),
        ("WIMWV,214.8,R,0.1,K,A", "28"),
    ],
)
def test_checksums_of_published_sentences(body: str, expected: str) -> None:
    assert with_checksum(body) == f"${body}*{expected}"


def test_wind_from_starboard_has_an_angle_clockwise_from_the_bow() -> None:
    # Air that goes to the left comes from the right.
    assert apparent_wind_sentence((0.0, 6.0, 0.0)).startswith("$WIMWV,090.0,R,6.00,M,A*")


def test_wind_on_the_nose_has_angle_zero() -> None:
    assert apparent_wind_sentence((-6.0, -1e-9, 0.0)).startswith("$WIMWV,000.0,R,6.00,M,A*")


def test_true_wind_names_true_and_magnetic_direction_and_both_speeds() -> None:
    # Air that goes north comes from 180 degrees; 10 degrees less by a compass that points
    # 10 degrees east of north.
    text = true_wind_sentence((0.0, 5.144444, 0.0), declination_deg=10.0)
    assert text.startswith("$WIMWD,180.0,T,170.0,M,10.00,N,5.14,M*")
    assert text.endswith("\r\n")


def test_without_a_declination_the_magnetic_field_stays_empty() -> None:
    assert ",T,,M," in true_wind_sentence((1.0, 0.0, 0.0))
