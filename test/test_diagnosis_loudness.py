"""How loud healthy days are: the wind's way and impossible effects do not make them so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, recorded

from wind_sensors.diagnosis.comparing.observing import Simulated
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.explaining.acceptance import needed_gain
from wind_sensors.diagnosis.explaining.fitting import Fit
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.signatures import Template, templates_of
from wind_sensors.diagnosis.explaining.terms import Term
from wind_sensors.diagnosis.healthy.baseline import Baseline
from wind_sensors.diagnosis.healthy.learning import default_baseline
from wind_sensors.diagnosis.healthy.reference_lag import lag_weights
from wind_sensors.diagnosis.healthy.standing import Evidence, loudest_gains

UNSEEN = Simulated({}, {}, {}, {}, np.zeros(0, dtype=np.bool_))
NOTHING = Fit((), 0.0, np.zeros(0), UNSEEN, np.zeros((0, 0)), 0)
QUIET, LOUD = 0.0, 60.0
POWER = 100.0


def days(effect: str, instrument: str, sign: float, lag: float) -> list[Evidence]:
    """Three healthy days, of which the last promises an effect a gain of `LOUD`.

    Args:
        effect, instrument: Which.
        sign: Of the amplitude.
        lag: Standard deviation of what the wind's way brings, in units of the effect's signature.
    """
    known = catalogue()[effect]
    probe = Template(known, instrument, 0, known.templates[0])
    gram, inner = np.full((1, 1), POWER), np.full((1, 1), POWER)
    none = np.zeros(1)
    return [
        Evidence((probe,), gram, np.array([sign * np.sqrt(POWER * gain)]), gram, inner, none, way)
        for gain in (QUIET, QUIET, LOUD)
        for way in [np.full((1, 1), lag) if lag else np.zeros((0, 1))]
    ]


def test_a_delay_of_the_winds_way_makes_no_day_loud() -> None:
    loud = loudest_gains(days("timestamp_latency", "vane", 1.0, 0.0))
    usual = loudest_gains(days("timestamp_latency", "vane", 1.0, 1.0))
    assert loud["timestamp_latency|vane"] > 20.0
    assert usual.get("timestamp_latency|vane", 0.0) < 1.0


def test_a_calm_day_is_no_measure_of_windy_ones_unless_there_are_few() -> None:
    quiet, loud = days("low_pass_filter", "vane", 1.0, 0.0)[1:]
    rows, calm = [quiet, quiet, quiet, loud], [False, False, False, True]
    filtered = "low_pass_filter|vane"
    assert loudest_gains(rows)[filtered] > 20.0
    assert loudest_gains(rows, calm).get(filtered, 0.0) < 1.0
    assert loudest_gains(rows[1:], calm[1:])[filtered] > 20.0


@pytest.mark.parametrize(
    ("promised", "raised"),
    [
        ("vane_eccentricity", {"vane_offset", "vane_eccentricity"}),
        (
            "low_pass_filter",
            {"vane_offset", "vane_inertia", "timestamp_latency", "low_pass_filter"},
        ),
        ("timestamp_latency", {"timestamp_latency"}),
        ("vane_imbalance", {"vane_imbalance"}),
    ],
)
def test_a_days_offset_delay_or_pull_does_not_raise_what_a_heavy_vane_must_bring(
    promised: str, raised: set[str]
) -> None:
    loudest = loudest_gains(days(promised, "vane", 1.0, 0.0))
    (most,) = loudest.values()
    assert most > 20.0
    known = replace(default_baseline(STATION), loudest=loudest, recordings=("a", "b", "c"))
    again = Baseline.from_json(known.to_json())
    for name in {"vane_offset", "vane_inertia", "timestamp_latency", promised}:
        needs = needed_gain(NOTHING, Term(catalogue()[name], "vane", {}), again)
        if name in raised:
            assert needs == pytest.approx(1.2 * most)
        else:
            assert needs < 20.0
    # Of other instruments a few days show little: what is loud on one stands in for all.
    elsewhere = {**loudest, f"{promised}|other": 2.0 * most}
    louder = replace(again, loudest=elsewhere)
    assert louder.loudness("vane", catalogue()[promised]) == pytest.approx(2.0 * most)


@pytest.mark.parametrize("effect", ["low_pass_filter", "wake_shadow"])
def test_what_cannot_be_makes_no_day_loud(effect: str) -> None:
    instrument = "vane" if effect == "low_pass_filter" else "cup"
    (gain,) = loudest_gains(days(effect, instrument, 1.0, 0.0)).values()
    assert gain > 20.0
    assert not loudest_gains(days(effect, instrument, -1.0, 0.0))


def test_the_way_is_that_of_the_separation_at_the_wind_speed() -> None:
    comparison = prepare(recorded(STATION, 77))
    templates = templates_of(comparison, STATION, catalogue())
    weights = lag_weights(comparison, templates)
    assert STATION.reference is not None
    way = STATION.reference.separation / float(np.mean(comparison.speed))
    for k, template in enumerate(templates):
        delays = weights[:, k] * template.values.get("latency", 0.0)
        if template.effect.name == "timestamp_latency" and template.number == 0:
            several = [] if template.instrument == "station" else [0.5 * way, 0.25 * way]
            assert np.sort(delays[delays > 0.0])[::-1] == pytest.approx(several)
        elif template.effect.name != "clock_drift":
            assert not weights[:, k].any()


def test_what_healthy_days_share_is_in_the_series_for_statistics_have_their_own_means() -> None:
    comparison = prepare(recorded(STATION, 77))
    templates = templates_of(comparison, STATION, catalogue())
    sticking = {t.key: 0.5 for t in templates if t.effect.name == "vane_friction"}
    known = replace(default_baseline(STATION), means=sticking)
    searcher = searcher_of(comparison, known, catalogue(), {})
    null = searcher.whitener(searcher.bank.without)
    series = comparison.coefficients * len(comparison.channels)
    assert np.abs(null.shared[:series]).max() > 0.1
    assert not null.shared[series:].any()


def test_delays_are_not_screened_at_larger_sizes() -> None:
    searcher = searcher_of(prepare(recorded(STATION, 77)), default_baseline(STATION),
                           catalogue(), {})
    larger = {t.effect.name for t in searcher.probes.templates if t.multiple != 1.0}
    assert "calibration_offset" in larger
    assert not larger & {"clock_drift", "timestamp_latency"}
