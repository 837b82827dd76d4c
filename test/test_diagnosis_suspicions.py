"""Faults without an identifier: never named, but what they explain better is."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, diagnosed, recorded
from representatives import represented

from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect, with_keys
from wind_sensors.diagnosis.effects.suspected import SUSPECTS
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.search import PENALTY_PER_INTERVAL
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Interval, Term
from wind_sensors.diagnosis.proving.suspicions import suspicion_beside, suspicion_of
from wind_sensors.diagnosis.verdict import Diagnosis, diagnose
from wind_sensors.station.signals import Angles, Recording


def _behind_play(recording: Recording, play_deg: float) -> Recording:
    """The recording with a sensor that rests until the vane has turned back by the play."""
    vane = recording.angles["vane"]
    half = np.radians(play_deg) / 2.0
    nose = np.unwrap(vane.angle)
    shaft = nose.copy()
    for k in range(1, nose.size):
        shaft[k] = np.clip(shaft[k - 1], nose[k] - half, nose[k] + half)
    return replace(recording, angles={"vane": Angles(vane.time, np.angle(np.exp(1j * shaft)))})


@cache
def _diagnosed_with_play(play_deg: float) -> Diagnosis:
    return diagnose(_behind_play(recorded(STATION, 66), play_deg), baseline())


@cache
def _diagnosed_with_a_race_that_catches(to_one_side: float, width: float) -> Diagnosis:
    """Catching so many degrees to one side of where the vane points most [deg]."""
    seen = recorded(STATION, 67).angles["vane"].angle
    heading = float(np.degrees(np.angle(np.mean(np.exp(1j * seen))))) + to_one_side
    caught = {"catch_speed": 4.0, "catch_heading_deg": heading, "catch_width_deg": width}
    return diagnose(recorded(with_keys(STATION, "vane", caught), 67), baseline())


@pytest.mark.parametrize("play_deg", represented([14.0, 28.0], by=(14.0,)))
def test_play_is_no_friction_though_both_hold_the_reading_still(play_deg: float) -> None:
    found = _diagnosed_with_play(play_deg)
    assert found.verdict == "unknown"
    assert found.findings == ()
    assert "play between vane and sensor" in found.unexplained.description
    suspicion = suspicion_of(found.naming, STATION)
    assert suspicion is not None
    assert suspicion.fault.effect.name == "play"
    assert suspicion.fault.values["play"] == pytest.approx(play_deg, rel=0.1)


def test_an_unknown_beside_nothing_is_described_by_the_fault_that_explains_it() -> None:
    naming = _diagnosed_with_play(14.0).naming
    nothing = replace(naming, fit=fit(naming.whitener, STATION, []))
    suspicion = suspicion_beside(nothing, STATION)
    assert suspicion is not None
    assert (suspicion.fault.key, suspicion.effect) == (("play", "vane"), None)
    assert suspicion.fault.values["play"] == pytest.approx(14.0, rel=0.1)
    assert "would explain more, by" in suspicion.words
    assert suspicion_of(nothing, STATION) is None


@pytest.mark.parametrize("to_one_side, width", [(0.0, 8.0), (12.0, 17.0)])
def test_a_bearing_that_catches_at_one_heading_is_no_friction_of_all_headings(
    to_one_side: float, width: float
) -> None:
    found = _diagnosed_with_a_race_that_catches(to_one_side, width)
    assert found.verdict == "unknown"
    assert "catches at one heading" in found.unexplained.description


def test_a_bearing_that_catches_all_the_time_is_no_friction_that_begins() -> None:
    # Where the wind turns late, the vane comes late to the heading at which it catches.
    naming = _diagnosed_with_a_race_that_catches(0.0, 8.0).naming
    begun = Term(catalogue()["vane_friction"], "vane", {"friction_speed": 2.0}, (200.0, None))
    fitted = fit(naming.whitener, STATION, [begun])
    suspicion = suspicion_of(replace(naming, fit=fitted), STATION)
    assert suspicion is not None
    assert suspicion.fault.key == ("catch", "vane")
    assert suspicion.fault.interval == ALWAYS


def test_what_always_holds_is_spared_the_price_of_a_beginning_and_an_end() -> None:
    naming = _diagnosed_with_play(14.0).naming
    friction = Term(catalogue()["vane_friction"], "vane", {"friction_speed": 2.0})

    def gain_over(interval: Interval) -> float:
        held = fit(naming.whitener, STATION, [replace(friction, interval=interval)], None, 0)
        suspicion = suspicion_of(replace(naming, fit=held), STATION)
        assert suspicion is not None
        assert (suspicion.fault.effect.name, suspicion.fault.interval) == ("play", ALWAYS)
        own = naming.whitener.of(held.simulated)
        return suspicion.gain - float(own @ own)

    edges = 2.0 * PENALTY_PER_INTERVAL
    assert gain_over((0.5, 590.0)) - gain_over(ALWAYS) == pytest.approx(edges, abs=0.5)


def test_a_cable_that_the_vane_winds_up_is_no_weight_on_a_leaning_mast() -> None:
    wound = with_keys(STATION, "vane", {"cable_speed": 1.5, "cable_rest_deg": 150.0})
    naming = diagnose(recorded(wound, 68, mean=5.0), baseline(), with_proof=False).naming
    weight = {"imbalance": 4.0, "tilt_x": 1.0, "tilt_y": 0.5}
    heavy = Term(catalogue()["vane_imbalance"], "vane", weight)
    suspicion = suspicion_of(
        replace(naming, fit=fit(naming.whitener, STATION, [heavy])), STATION
    )
    assert suspicion is not None
    assert (suspicion.fault.key, suspicion.effect) == (("cable", "vane"), "vane_imbalance")
    assert suspicion.fault.values["speed"] == pytest.approx(1.5, rel=0.15)
    assert suspicion.fault.values["rest"] == pytest.approx(150.0, abs=12.0)


def test_a_fin_that_gives_way_is_no_heavy_vane() -> None:
    soft = with_keys(STATION, "vane", {"fin_yield_speed": 6.0})
    naming = diagnose(recorded(soft, 68, mean=6.0), baseline(), with_proof=False).naming
    heavy = Term(catalogue()["vane_inertia"], "vane", {"inertia_factor": 2.0})
    fitted = fit(naming.whitener, STATION, [heavy])
    suspicion = suspicion_of(replace(naming, fit=fitted), STATION)
    assert suspicion is not None
    assert suspicion.fault.key == ("soft_fin", "vane")
    assert suspicion.fault.values["yield_speed"] == pytest.approx(6.0, rel=0.25)
    assert "gives way" in suspicion.words


def test_a_fin_that_gives_way_is_no_thin_air() -> None:
    soft = with_keys(STATION, "vane", {"fin_yield_speed": 6.0})
    naming = diagnose(recorded(soft, 68, mean=6.0), baseline(), with_proof=False).naming
    thin = Term(catalogue()["air_density"], "station", {"density_ratio": 0.8})
    suspicion = suspicion_of(
        replace(naming, fit=fit(naming.whitener, STATION, [thin])), STATION
    )
    assert suspicion is not None
    assert suspicion.effect == "air_density"
    assert suspicion.fault.key == ("soft_fin", "vane")


def _with_shaded_reference(recording: Recording, depth: float, turn: float) -> Recording:
    """The recording by a sonic whose arms shade its paths: three dips a turn, a cosine's power."""
    assert recording.reference is not None
    velocity = recording.reference.velocity
    heading = np.arctan2(velocity[:, 1], velocity[:, 0]) - turn
    loss = depth * np.abs(np.cos(1.5 * heading)) ** 6
    seen = replace(recording.reference, velocity=velocity * (1.0 - loss)[:, None])
    return replace(recording, reference=seen)


def test_the_shadow_of_the_references_arms_is_no_distorted_flow() -> None:
    shaded = _with_shaded_reference(recorded(STATION, 69, swing=0.5), 0.1, 0.3)
    naming = diagnose(shaded, baseline(), with_proof=False).naming
    flow = {"cosine_1": 0.02, "sine_1": 0.0, "cosine_2": 0.02, "sine_2": 0.0, "deflection": 0.0}
    distorted = Term(catalogue()["flow_distortion"], "station", flow)
    suspicion = suspicion_of(
        replace(naming, fit=fit(naming.whitener, STATION, [distorted])), STATION
    )
    assert suspicion is not None
    assert suspicion.fault.key == ("reference_shadow", "station")
    assert suspicion.fault.values["depth"] == pytest.approx(0.1, abs=0.03)
    assert "three arms" in suspicion.words


def test_a_distorted_flow_keeps_its_name_beside_it() -> None:
    flow = {"cosine_1": 0.06, "sine_1": -0.04, "cosine_2": 0.03, "sine_2": 0.0, "deflection": 1.0}
    distorted = with_effect(STATION, catalogue()["flow_distortion"], "station", flow)
    found = diagnose(recorded(distorted, 70, swing=0.5), baseline())
    assert [f.term.effect.name for f in found.findings] == ["flow_distortion"]
    assert suspicion_of(found.naming, STATION) is None


def test_friction_keeps_its_name_beside_them() -> None:
    found = diagnosed("vane_friction", "vane", friction_speed=2.5)
    assert suspicion_of(found.naming, STATION) is None
    assert found.verdict == "named"


def test_suspects_bear_no_name_of_the_catalogue_but_can_be_mistaken_for_some() -> None:
    assert SUSPECTS
    for fault in SUSPECTS:
        assert fault.name not in catalogue()
        assert fault.confusable
        assert set(fault.confusable) <= set(catalogue())
