"""What a diagnosis says of how much is done: never less than before, and all of it in the end."""

from __future__ import annotations

import itertools

from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.progress import Phases
from wind_sensors.diagnosis.verdict import diagnose

DISTORTION = {
    "cosine_1": 0.08, "sine_1": -0.04, "cosine_2": 0.05, "sine_2": 0.05, "deflection": 1.0,
}


def test_a_phase_that_runs_again_goes_on_from_where_it_was() -> None:
    told: list[float] = []
    phases = Phases(lambda phase, share: told.append(share))
    for _ in range(3):
        run = phases.run("searching")
        for share in (0.0, 0.5, 1.0):
            run(share)
    assert told == sorted(told)
    assert told[0] == 0.0
    assert told[-1] < 1.0
    phases.done()
    assert told[-1] == 1.0
    phases.run("searching")(0.0)
    assert told[-1] == 1.0


def test_progress_of_a_diagnosis_never_falls() -> None:
    # What moves the whole station and has several parameters is searched for twice.
    names = ("flow_distortion", "calibration_drift", "vane_offset")
    effects = {name: catalogue()[name] for name in names}
    planted = with_effect(STATION, effects["flow_distortion"], "station", DISTORTION)
    told: dict[str, list[float]] = {}
    diagnose(
        recorded(planted, 58), baseline(), effects,
        progress=lambda phase, share: told.setdefault(phase, []).append(share), with_proof=False,
    )
    assert set(told) == {"simulating the catalogue", "fitting effects", "locating", "proving"}
    for shares in told.values():
        assert all(later >= earlier for earlier, later in itertools.pairwise(shares))
        assert shares[-1] == 1.0
    assert len(told["fitting effects"]) > 6
