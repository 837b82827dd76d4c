"""Ice that grows: its stages, and what is found of it."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded

from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.fitting import Fit, fit
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Change, Station

FULL = {"gain": 0.9, "inertia_factor": 2.5, "friction_speed": 0.0}


def iced(growth: float, interval: tuple[float, float | None] | None = None) -> Station:
    values = {**FULL, "growth_time": growth}
    return with_effect(STATION, catalogue()["icing"], "cup", values, interval)


@pytest.mark.parametrize(("begin", "end"), [(0.0, None), (100.0, None), (100.0, 190.0)])
def test_the_stages_of_a_growth_hold_as_much_of_it_as_time_would(
    begin: float, end: float | None
) -> None:
    constant = 60.0
    changes = iced(constant, (begin, end)).changes
    assert changes[0].start == begin
    assert changes[-1].stop == end
    assert all(a.stop == b.start for a, b in itertools.pairwise(changes))
    lost = [1.0 - change.set["calibration_gain"] for change in changes]
    assert all(a < b for a, b in itertools.pairwise(lost))
    whole = [c for c in changes if c.stop is not None and c.stop <= begin + 2.6 * constant]
    if end is not None:
        whole = whole[:-1]
    stop = whole[-1].stop
    assert stop is not None
    at = np.linspace(begin, stop, 20001)
    grown = np.trapezoid(1.0 - np.exp(-(at - begin) / constant), at)
    staged = sum(
        (1.0 - c.set["calibration_gain"]) / 0.1 * (c.stop - c.start)
        for c in whole
        if c.stop is not None
    )
    assert staged == pytest.approx(grown, rel=1e-6)


@pytest.mark.parametrize("constant", [0.0, 5.0])
def test_what_does_not_grow_is_there_at_once(constant: float) -> None:
    """Nor does what would have grown in a few seconds."""
    assert not iced(constant).changes
    (change,) = iced(constant, (50.0, None)).changes
    assert change.start == 50.0
    assert change.set["calibration_gain"] == pytest.approx(0.9)


def test_ice_that_grows_is_told_with_its_time() -> None:
    constant, step = 80.0, 4.0
    at = np.arange(0.0, 400.0, step)
    share = 1.0 - np.exp(-(at + 0.5 * step) / constant)
    growing = STATION.model_copy(
        update={
            "changes": tuple(
                Change(
                    start=float(t), stop=float(t + step), instrument="cup",
                    set={
                        "calibration_gain": 1.0 - 0.1 * s, "inertia_factor": 1.0 + 1.5 * s,
                    },
                )
                for t, s in zip(at, share.tolist(), strict=True)
            )
        }
    )
    found = diagnose(recorded(growing, 53), baseline())
    (finding,) = found.findings
    assert finding.term.key == ("icing", "cup")
    assert finding.parameters["gain"].low < 0.9 < finding.parameters["gain"].high
    inertia = finding.parameters["inertia_factor"]
    assert inertia.low < 2.5 < inertia.high
    assert finding.parameters["growth_time"].value == pytest.approx(constant, rel=0.5)


def test_ice_that_brakes_the_bearing_is_one_effect() -> None:
    values = {**FULL, "growth_time": 80.0, "friction_speed": 1.2}
    iced_bearing = with_effect(STATION, catalogue()["icing"], "cup", values)
    found = diagnose(recorded(iced_bearing, 56), baseline())
    (finding,) = found.findings
    assert finding.term.key == ("icing", "cup")
    friction = finding.parameters["friction_speed"]
    assert friction.low < 1.2 < friction.high and friction.low > 0.0


def test_what_begins_may_grow_from_there_or_from_before_the_record() -> None:
    begins = Term(catalogue()["icing"], "cup", {**FULL, "growth_time": 0.0}, (95.0, None))
    from_there, halfway, from_before = begins.growing
    assert from_there.interval == (95.0, None) and from_there.grows
    grown = (95.0 - halfway.interval[0]) / halfway.values["growth_time"]
    assert halfway.grows and 1.0 - np.exp(-grown) == pytest.approx(0.5)
    assert from_before.interval == ALWAYS and from_before.grows
    assert from_there.growing == () == replace(begins, interval=ALWAYS).growing
    offset = Term(catalogue()["calibration_offset"], "cup", {"offset": -1.0}, (95.0, None))
    assert offset.growing == ()


def test_ice_makes_no_rotor_lighter() -> None:
    """A lighter rotor would follow an offset more closely."""
    offset = catalogue()["calibration_offset"]
    shifted = recorded(with_effect(STATION, offset, "cup", {"offset": -1.2}), 54)
    searcher = searcher_of(prepare(shifted), baseline(), catalogue(), {})
    null = searcher.whitener(searcher.bank.without)

    def fitted(effect: str, **values: float) -> Fit:
        return fit(null, STATION, [Term(catalogue()[effect], "cup", values)], None)

    true = fitted("calibration_offset", offset=-1.0)
    ice = fitted("icing", gain=0.93, inertia_factor=1.2, growth_time=0.0, friction_speed=0.0)
    assert ice.terms[0].values["inertia_factor"] >= 1.0
    assert ice.cost > true.cost + 12.0
