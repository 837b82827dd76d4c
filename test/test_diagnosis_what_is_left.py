"""What a named effect leaves, and whether it speaks against the name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, drift, named, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.raw_statistics import STATISTICS
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.search import Searcher, searcher_of
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.proving.remainder import (
    REMAINDER_SCORE,
    REMAINDER_SCORES,
    STIRRED_TIMES,
    carriers_of,
    remainder_of,
    unstirred,
)
from wind_sensors.diagnosis.regions import Region, RegionBank, region_bank
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def searcher() -> Searcher:
    return searcher_of(prepare(recorded(STATION, 71)), baseline(), catalogue(), {})


def test_noise_is_judged_outside_a_wake(searcher: Searcher) -> None:
    comparison = searcher.comparison
    bearing = float(np.degrees(np.quantile(comparison.wind_from, 0.001)))
    values = {"bearing_from": bearing, "depth": 0.3, "width": 3.0, "flank": 0.0}
    wake = Term(catalogue()["wake_shadow"], "cup", values)
    away = np.angle(np.exp(1j * (comparison.wind_from - np.radians(bearing))))
    outside = unstirred(named(searcher, wake), STATION)
    assert outside is not None
    assert outside.mask is not None
    assert np.all(outside.mask[np.abs(away) < np.radians(3.0)] < 0.01)
    assert np.mean(outside.mask) > 0.15
    assert unstirred(named(searcher, drift()), STATION) is comparison


def test_what_is_left_before_an_effect_began_must_stand_out_by_itself() -> None:
    drifting = catalogue()["calibration_drift"]
    early = with_effect(STATION, drifting, "cup", {"gain": 1.1}, (0.0, 50.0))
    searcher = searcher_of(prepare(recorded(early, 94)), baseline(), catalogue(), {})
    passing = named(searcher, drift((200.0, None)))
    always = replace(passing, fit=replace(passing.fit, terms=(drift(),)))
    bank = region_bank(passing.adequate, searcher.bank.without)
    left = [
        remainder_of(one, bank, searcher.comparison, baseline()).score for one in (passing, always)
    ]
    assert left[1] > 0.5
    assert left[0] == pytest.approx(REMAINDER_SCORE * left[1])


def test_what_a_signal_shows_that_an_effect_hardly_changes_is_not_held_against_it() -> None:
    turned = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": 3.0})
    both = with_effect(turned, catalogue()["calibration_drift"], "cup", {"gain": 1.03})
    searcher = searcher_of(prepare(recorded(both, 95)), baseline(), catalogue(), {})
    bank = region_bank(searcher.whitener(searcher.bank.without), searcher.bank.without)
    # A gain reaches the cup alone, whatever the vane beside it shows.
    turn = Term(catalogue()["vane_offset"], "vane", {"offset": 1.0})
    for term, held in ((drift(), False), (turn, True)):
        remainder = remainder_of(named(searcher, term), bank, searcher.comparison, baseline())
        assert (remainder.score > 1.0) is held


@pytest.mark.parametrize("carried", [True, False])
def test_what_is_left_on_the_vane_that_carries_a_propeller_speaks_against_its_name(
    searcher: Searcher, carried: bool
) -> None:
    propeller = {
        "name": "propeller", "kind": "propeller", "pulses": {"topic": "/propeller/pulses"},
        "pulses_per_revolution": 6, "calibration_distance": 0.05, "distance_constant": 2.7,
        "mounted_on": "vane" if carried else "", "axis": None if carried else (-1.0, 0.0, 0.0),
    }
    station = Station.model_validate({"instruments": [propeller, STATION.instrument("vane")]})
    channels = tuple(
        replace(channel, name=f"{instrument}/{channel.kind}", instrument=instrument)
        for channel, instrument in zip(
            searcher.comparison.channels, ("propeller", "vane"), strict=True
        )
    )
    seen = replace(searcher.comparison, station=station, channels=channels)
    carriers = {"vane/vane_angle"} if carried else set()
    assert carriers_of(seen, {"propeller/rotor_rate"}) == carriers
    # What is left on the propeller is nothing against a name of its vane.
    assert carriers_of(seen, {"vane/vane_angle"}) == set()


class _Loud(RegionBank):
    """One region whose score is given."""

    def scores(self, vector: FloatArray) -> FloatArray:
        return np.array([300.0])


@pytest.mark.parametrize(
    ("effect", "kind", "times"),
    [
        ("wake_shadow", "frequency", STIRRED_TIMES),
        ("wake_shadow", "speed", 1.0),
        ("calibration_drift", "frequency", 1.0),
    ],
)
def test_a_wake_may_leave_some_more_eddies_than_the_simulation_knows(
    searcher: Searcher, effect: str, kind: str, times: float
) -> None:
    comparison = searcher.comparison
    bearing = float(np.degrees(np.median(comparison.wind_from)))
    values = {"bearing_from": bearing, "depth": 0.3, "width": 20.0, "flank": 0.0}
    values = values if effect == "wake_shadow" else {"gain": 1.1}
    naming = named(searcher, Term(catalogue()[effect], "cup", values))
    region = Region(comparison.channels[0].name, kind, 0.1, 0.5, "0.1 to 0.5 Hz")
    loud = _Loud((region,), np.zeros((0, 0)), (), (), np.zeros(0))
    left = remainder_of(naming, loud, comparison, baseline())
    assert left.score == pytest.approx(300.0 / REMAINDER_SCORES[kind] / times)


@pytest.mark.parametrize(
    ("effect", "label", "times"),
    [
        ("missed_pulses", "beat of the pulses with the wind, twice per turn", STIRRED_TIMES),
        ("missed_pulses", "unevenness of the slots once per turn", 1.0),
        ("calibration_drift", "beat of the pulses with the wind, twice per turn", 1.0),
    ],
)
def test_which_pulse_of_a_turn_a_dead_time_takes_is_not_held_against_it(
    searcher: Searcher, effect: str, label: str, times: float
) -> None:
    assert label in STATISTICS["rotor_rate"]
    values = {"dead_time": 0.02, "loss_probability": 0.1, "loss_growth": 0.0, "gain": 1.1}
    naming = named(searcher, Term(catalogue()[effect], "cup", values))
    region = Region(searcher.comparison.channels[0].name, "statistic", 0.0, 1.0, label)
    loud = _Loud((region,), np.zeros((0, 0)), (), (), np.zeros(0))
    left = remainder_of(naming, loud, searcher.comparison, baseline())
    assert left.score == pytest.approx(300.0 / REMAINDER_SCORES["statistic"] / times)


def test_what_a_vane_shows_beside_the_propeller_that_it_carries_has_to_stand_out_by_itself(
    searcher: Searcher,
) -> None:
    carried = {
        "name": "cup", "kind": "propeller", "pulses": {"topic": "/cup/pulses"},
        "pulses_per_revolution": 6, "calibration_distance": 0.05, "distance_constant": 2.7,
        "mounted_on": "vane",
    }
    station = Station.model_validate({"instruments": [carried, STATION.instrument("vane")]})
    seen = replace(searcher.comparison, station=station)
    naming = named(searcher, drift())
    left = [
        remainder_of(
            naming,
            _Loud((Region(name, "time", 0.0, 90.0, "0 to 90 s"),), np.zeros((0, 0)), (), (),
                  np.zeros(0)),
            seen, baseline(),
        ).score
        for name in ("cup/rotor_rate", "vane/vane_angle")
    ]
    assert left[0] == pytest.approx(300.0 / REMAINDER_SCORES["time"])
    assert left[1] == pytest.approx(REMAINDER_SCORE * left[0])
