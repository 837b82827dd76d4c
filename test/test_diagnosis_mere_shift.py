"""What goes with the direction is named where the wind came from enough sides to show it."""

from __future__ import annotations

import numpy as np
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_keys
from wind_sensors.diagnosis.proving.mere_shift import SHOWN, beyond_constants
from wind_sensors.diagnosis.verdict import diagnose

SEED = 67


def test_a_turned_vane_is_no_disc_off_centre_where_nobody_knows_of_turned_vanes() -> None:
    turned = recorded(with_keys(STATION, "vane", {"offset_deg": 6.0}), SEED)
    effects = {name: e for name, e in catalogue().items() if name != "vane_offset"}
    found = diagnose(turned, baseline(), effects)
    assert found.verdict == "unknown"
    assert "a constant would, too" in found.objection


def test_a_disc_off_centre_brings_more_than_any_constant() -> None:
    seen = recorded(STATION, SEED).angles["vane"].angle
    middle = float(np.degrees(np.angle(np.mean(np.exp(1j * seen)))))
    # The error is nought in the middle of the wind's directions, where a constant is none.
    keys = {"eccentricity_deg": 8.0, "eccentricity_phase_deg": -middle}
    naming = diagnose(
        recorded(with_keys(STATION, "vane", keys), SEED), baseline(), with_proof=False
    ).naming
    (term,) = naming.fit.terms
    assert term.effect.name == "vane_eccentricity"
    assert beyond_constants(naming, STATION, term) > SHOWN
