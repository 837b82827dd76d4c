"""What may be left after a name, and what a name needs, on simulated recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import STATION, baseline, recorded
from scipy.optimize import minimize

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.comparing.turning import slow_departure, where_vanes_follow
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.acceptance import (
    EDDIES_AGAINST,
    PASSING_FORM_GAIN,
    PASSING_GAIN,
    gained_by_eddies,
    is_plausible,
    passing_gain,
)
from wind_sensors.diagnosis.explaining.explanation import empty_fit, judged
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.search import searcher_of
from wind_sensors.diagnosis.explaining.terms import ALWAYS, Term, planted
from wind_sensors.diagnosis.healthy.whitening import form_signatures, trust_of, unstanding
from wind_sensors.diagnosis.proving.findings import Estimate, Finding
from wind_sensors.diagnosis.proving.proof import Proof
from wind_sensors.diagnosis.proving.support import (
    UNSEEN_GAIN,
    borne_out,
    determined,
    made_up,
    passes_unseen,
)
from wind_sensors.diagnosis.regions import Found, Region
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.errors import UserError
from wind_sensors.motion import rotations
from wind_sensors.motion.platform_track import Motion
from wind_sensors.recordings.station_files import load_station
from wind_sensors.simulation import Scenario, simulate
from wind_sensors.simulation.drive import Drive
from wind_sensors.simulation.response import ResponseState, respond
from wind_sensors.station.model import Input, Reference
from wind_sensors.station.signals import Angles, Recording
from wind_sensors.turbulence.synthesis import isotropic_spec


def _with_readings(recording: Recording, shift: np.ndarray) -> Recording:
    """The recording with the vane's readings moved by so much [rad]."""
    angles = recording.angles["vane"]
    wrapped = np.angle(np.exp(1j * (angles.angle + shift)))
    return replace(recording, angles={"vane": Angles(angles.time, wrapped)})


def test_an_effect_of_another_form_keeps_its_name() -> None:
    # A fin that bends: the offset grows by a tenth from calm to gust.
    recording = recorded(STATION, 60)
    assert recording.reference is not None
    speed = np.hypot(*recording.reference.velocity[:, :2].T)
    rank = np.argsort(np.argsort(speed)) / speed.size
    found = diagnose(_with_readings(recording, np.radians(8.0) * (0.95 + 0.1 * rank)), baseline())
    assert [f.term.effect.name for f in found.findings] == ["vane_offset"]


def _slewed(recording: Recording, fastest: float) -> Recording:
    """The recording with a vane whose reading turns no faster than so much [rad/s]."""
    angles = recording.angles["vane"]
    shown = angles.angle.copy()
    for k in range(1, shown.size):
        step = np.angle(np.exp(1j * (angles.angle[k] - shown[k - 1])))
        most = fastest * (angles.time[k] - angles.time[k - 1]) * 1e-9
        shown[k] = shown[k - 1] + np.clip(step, -most, most)
    wrapped = np.angle(np.exp(1j * shown))
    return replace(recording, angles={"vane": Angles(angles.time, wrapped)})


def test_what_refuses_fast_turns_has_no_name() -> None:
    refusing = _slewed(recorded(STATION, 63), np.radians(14.0))
    assert diagnose(refusing, baseline()).verdict == "unknown"


def test_what_no_effect_describes_is_unknown() -> None:
    # A reading that creeps away and back within the record: not an offset, not a disc off centre.
    recording = recorded(STATION, 61)
    at = recording.angles["vane"].time * 1e-9
    creep = np.radians(12.0) * np.sin(2.0 * np.pi * at / 130.0)
    assert diagnose(_with_readings(recording, creep), baseline()).verdict == "unknown"


def test_a_louder_healthy_day_asks_for_more_than_a_small_effect_gives() -> None:
    station = with_effect(STATION, catalogue()["calibration_drift"], "cup", {"gain": 0.94})
    recording = recorded(station, 62)
    assert diagnose(recording, baseline()).verdict in {"named", "ambiguous"}
    loud = replace(baseline(), loudest={"cup": 1e4})
    assert diagnose(recording, loud).naming.fit.terms == ()


def test_a_vane_that_swings_past_the_opposite_direction_does_not_jump() -> None:
    # The slow direction cannot follow such a wind: the vane passes its opposite again and again,
    # measured and simulated not in the same instant. A turn too many is a residual of 2 pi.
    comparison = prepare(recorded(STATION, 63, swing=3.1))
    simulated = comparison.simulate(STATION)
    name = "vane/vane_angle"
    away = (comparison.measured.series[name] - simulated.series[name]) / comparison.speed
    assert np.abs(comparison.measured.series[name] / comparison.speed).max() > np.pi
    assert np.abs(away).max() < np.pi


@pytest.mark.parametrize(("begin", "end", "counts"), [(100.0, 106.0, False), (100.0, 190.0, True)])
def test_a_vane_that_turned_round_the_other_way_says_nothing(
    begin: float, end: float, counts: bool
) -> None:
    recording = recorded(STATION, 66)
    at = (recording.angles["vane"].time - recording.start) * 1e-9
    away = np.where((at >= begin) & (at < end), np.pi, 0.0)
    comparison = prepare(_with_readings(recording, away))
    if counts:
        assert comparison.mask is None
    else:
        assert comparison.mask is not None
        left_out = comparison.grid.centres[comparison.mask < 0.5]
        assert left_out.min() == pytest.approx(begin, abs=4.0)
        assert left_out.max() == pytest.approx(end, abs=4.0)
        assert diagnose(_with_readings(recording, away), baseline()).verdict == "none"


@pytest.mark.parametrize(("speed", "counts"), [(1.2, False), (5.0, True)])
def test_a_vane_that_a_calm_leaves_turned_round_says_nothing(speed: float, counts: bool) -> None:
    grid = Grid(0, 0.2, 4500)
    calm = (grid.centres > 300.0) & (grid.centres < 360.0)
    # It comes back the other way, a whole turn round.
    turned = np.interp(grid.centres, (300.0, 330.0, 360.0), (0.0, np.pi, 2.0 * np.pi))
    wind = np.where(calm, speed, 6.0)
    follows = where_vanes_follow([turned], wind, grid)
    assert follows[np.abs(grid.centres - 330.0) < 10.0].max() == float(counts)
    assert follows[~calm].min() == 1.0
    departure = slow_departure(turned, wind, grid)
    assert departure[-1] == pytest.approx(2.0 * np.pi if counts else 0.0, abs=1e-6)


def test_seconds_in_which_one_explanation_turns_round_hold_its_misfit() -> None:
    comparison = prepare(recorded(STATION, 64))
    right = comparison.simulate(STATION)
    name = "vane/vane_angle"
    moment = (comparison.grid.centres > 100.0) & (comparison.grid.centres < 105.0)
    turned = right.series[name] + np.pi * comparison.speed * moment
    rival = replace(right, series={**right.series, name: turned})
    assert comparison.where_vanes_follow([right]).min() == 1.0
    follows = comparison.where_vanes_follow([right, rival])
    assert not follows[moment].any()
    assert follows[comparison.grid.centres > 112.0].min() == 1.0
    assert comparison.misfit_outside(follows, rival) > 0.9
    assert comparison.misfit_outside(follows, right) < 0.1


def test_a_vane_that_counts_the_other_way_round_is_read_on_one_turn() -> None:
    # In a wind that goes all the way round, a mirrored vane comes to point backwards again and
    # again; near the cut a reading lies a turn above or below by chance, if nothing prevents it.
    mirrored = with_effect(STATION, catalogue()["sensor_swap"], "vane", {"reversed": 1.0})
    comparison = prepare(recorded(mirrored, 63, swing=1.7))
    name = "vane/vane_angle"
    right = comparison.simulate(mirrored)
    away = (comparison.measured.series[name] - right.series[name]) / comparison.speed
    assert np.abs(comparison.measured.series[name] / comparison.speed).max() > np.pi
    assert np.abs(away).max() < np.pi


def test_the_form_of_no_change_is_no_signature() -> None:
    comparison = prepare(recorded(STATION, 64))
    simulated = comparison.simulate(STATION)
    trust = trust_of(comparison, simulated, baseline())
    assert form_signatures(comparison, trust, simulated, simulated).shape[0] == 0
    turned = with_effect(STATION, catalogue()["vane_offset"], "vane", {"offset": 8.0})
    changed = comparison.simulate(turned)
    assert form_signatures(comparison, trust, simulated, changed).shape[0] > 0


def test_a_rotor_that_runs_away_is_refused_at_once() -> None:
    # With a4 above one the quadratic torque pushes a rotor that already turns too fast.
    comparison = prepare(recorded(STATION, 65))
    cup = STATION.instrument("cup").model_copy(update={"a4": 2.4, "inertia_factor": 0.2})
    station = STATION.model_copy(update={"instruments": (cup, STATION.instrument("vane"))})
    with pytest.raises(UserError, match="runs away"):
        respond(station, comparison.drive, ResponseState(rotors={"cup": (600.0, 0.0)}))


def test_a_rotor_turns_often_between_seldom_samples_of_the_reference() -> None:
    """A propeller by 200 rad in a second: with a slow reference it does not run away."""
    reference = Reference(topic=Input(topic="/reference/wind"), separation=0.5)
    station = load_station("mast_propeller_vane").model_copy(update={"reference": reference})
    wind = isotropic_spec(10.0, 1e-2, 60.0, seed=5)
    recording = simulate(station, Scenario(wind, duration=120.0, seed=5))
    known = recording.reference
    assert known is not None
    every = round(known.time.size / 120.0)
    seldom = replace(known, time=known.time[::every], velocity=known.velocity[::every])
    comparison = prepare(replace(recording, reference=seldom, truth=None))
    (rotor,) = (c.name for c in comparison.channels if c.kind == "rotor_rate")
    simulated = comparison.simulate(station).series[rotor]
    assert np.mean(simulated) == pytest.approx(np.mean(comparison.measured.series[rotor]), rel=0.02)


@pytest.mark.parametrize("instrument", ["vane", "station"])
def test_a_clock_belongs_to_one_instrument_or_to_all(instrument: str) -> None:
    station = with_effect(STATION, catalogue()["clock_drift"], instrument, {"drift": 4000.0})
    (finding,) = diagnose(recorded(station, 64), baseline(), with_proof=False).findings
    assert finding.term.key == ("clock_drift", instrument)
    assert finding.parameters["drift"].value == pytest.approx(4000.0, rel=0.2)


def test_light_air_makes_a_rotor_slow() -> None:
    station = with_effect(STATION, catalogue()["air_density"], "station", {"density_ratio": 0.8})
    light = prepare(recorded(STATION, 65)).respond(station, ("cup",)).rotors["cup"].rate
    usual = prepare(recorded(STATION, 65)).respond(STATION, ("cup",)).rotors["cup"].rate
    assert np.std(light) < np.std(usual)


def test_the_noise_that_an_explanation_leaves_counts() -> None:
    # With the cost in the null of the plain station alone, a lightly sticking vane wins over one
    # that sticks much: it stays closer to the simulation whose noise was taken.
    planted = with_effect(STATION, catalogue()["vane_friction"], "vane", {"friction_speed": 2.5})
    recording = recorded(planted, 66, mean=4.0)
    searcher = searcher_of(prepare(recording), baseline(), catalogue(), {})
    friction = catalogue()["vane_friction"]
    null = searcher.whitener(searcher.bank.without)
    fits = [
        fit(null, STATION, [Term(friction, "vane", {"friction_speed": u})], None, iterations=0)
        for u in (0.3, 2.5)
    ]
    best = judged(searcher, fits, iterations=0)[0]
    assert best.fit.terms[0].values["friction_speed"] == 2.5


def test_a_filter_shows_in_the_power_of_eddies_or_is_none() -> None:
    low_pass, constant = catalogue()["low_pass_filter"], {"time_constant": 1.0}
    filtered = with_effect(STATION, low_pass, "vane", constant)
    gained = []
    for station in (filtered, STATION):
        searcher = searcher_of(prepare(recorded(station, 67)), baseline(), catalogue(), {})
        null = searcher.whitener(searcher.bank.without)
        after = fit(null, STATION, [Term(low_pass, "vane", constant)], None, iterations=0)
        before = empty_fit(null, searcher)
        gained.append(gained_by_eddies(null, before, after))
    assert gained[0] > EDDIES_AGAINST
    assert gained[1] < -EDDIES_AGAINST


def _finding(effect: str, instrument: str, share: float, p: float) -> Finding:
    region = Region("cup/rotor_rate", "all", 0.0, 1.0, "everywhere")
    proof = Proof(2.0, 1.0, 1.0, 1.0, 0.9, 1.0, None)
    term = Term(catalogue()[effect], instrument, {})
    return Finding(term, {}, Found(region, 50.0, 0.1, "m/s"), share, p, (), proof)


OFFSET = ("calibration_offset", "cup")
ASYMMETRY = ("torque_asymmetry", "cup")
LATE = ("timestamp_latency", "vane")
TURNED = ("vane_offset", "vane")
SLOW = ("low_pass_filter", "vane")


@pytest.mark.parametrize(
    ("effects", "gains", "ps", "verdict"),
    [
        ((OFFSET, ASYMMETRY), (60.0, 50.0), (0.002, 0.002), False),
        ((OFFSET, ASYMMETRY), (100.0, 90.0), (0.002, 0.002), True),
        ((OFFSET, LATE), (100.0, 90.0), (0.002, 0.002), False),
        ((OFFSET, ASYMMETRY), (60.0, 30.0), (0.002, 0.4), True),
        ((OFFSET, ASYMMETRY), (30.0, 110.0), (0.002, 0.4), False),
        ((OFFSET, LATE), (40.0, 70.0), (0.002, 0.4), False),
        ((OFFSET, TURNED), (60.0, 45.0), (0.002, 0.4), True),
        ((OFFSET, LATE), (60.0, 45.0), (0.002, 0.4), False),
        ((OFFSET, LATE), (60.0, 25.0), (0.002, 0.4), True),
        ((SLOW, LATE), (100.0, 90.0), (0.002, 0.002), True),
        ((SLOW, LATE), (100.0, 110.0), (0.002, 0.002), False),
        ((TURNED, LATE), (60.0, 55.0), (0.002, 0.4), False),
        ((TURNED, LATE), (60.0, 45.0), (0.002, 0.4), True),
        ((OFFSET,), (100.0,), (0.4,), False),
    ],
)
def test_two_effects_must_stand_out_one_by_one(
    effects: tuple[tuple[str, str], ...],
    gains: tuple[float, ...],
    ps: tuple[float, ...],
    verdict: bool,
) -> None:
    comparison = prepare(recorded(STATION, 65))
    found = tuple(
        replace(_finding(*e, g / 100.0, p), gain=g)
        for e, g, p in zip(effects, gains, ps, strict=True)
    )
    assert made_up(found, comparison, 100.0) is verdict


@pytest.mark.parametrize(("parameters", "verdict"), [(1, False), (4, True)])
def test_a_form_with_several_parameters_must_bring_more_where_nothing_stands_out(
    parameters: int, verdict: bool
) -> None:
    known = catalogue()["wake_shadow"].parameters[:parameters]
    estimates = {p.name: Estimate(1.0, 0.5, 1.5, p.unit) for p in known}
    wake = replace(_finding("wake_shadow", "cup", 0.1, 0.998), gain=54.0, parameters=estimates)
    turned = replace(_finding(*TURNED, 0.7, 0.002), gain=360.0)
    assert made_up((turned, wake), prepare(recorded(STATION, 65)), 420.0) is verdict


@pytest.mark.parametrize(
    ("noisy", "kind", "verdict"),
    [
        ("extra_pulses", "statistic", False),
        ("extra_pulses", "speed", True),
        ("torque_asymmetry", "statistic", True),
    ],
)
def test_what_chance_does_is_seen_beside_what_makes_it_good_in_the_mean(
    noisy: str, kind: str, verdict: bool
) -> None:
    region = Region("cup/rotor_rate", kind, 0.0, 1.0, "anywhere")
    bouncing = replace(
        _finding(noisy, "cup", 1.0, 0.002), gain=100.0, located=Found(region, 50.0, 0.1, "m/s")
    )
    found = (replace(_finding(*OFFSET, 0.9, 0.002), gain=90.0), bouncing)
    assert made_up(found, prepare(recorded(STATION, 65)), 100.0) is verdict


@pytest.mark.parametrize(("other", "verdict"), [(LATE, False), (ASYMMETRY, True)])
def test_alone_on_its_signals_an_effect_that_brings_much_stands_out_nowhere(
    other: tuple[str, str], verdict: bool
) -> None:
    found = tuple(
        replace(_finding(*e, 0.4, p), gain=60.0) for e, p in ((OFFSET, 0.002), (other, 0.4))
    )
    assert made_up(found, prepare(recorded(STATION, 65)), 120.0) is verdict


@pytest.mark.parametrize(
    ("effect", "interval", "removed", "p", "borne"),
    [
        (OFFSET, ALWAYS, 0.9, 0.4, True),
        (OFFSET, ALWAYS, 0.6, 0.002, False),
        (OFFSET, (300.0, None), 0.3, 0.002, True),
        (OFFSET, (300.0, None), 0.3, 0.4, False),
        (OFFSET, (300.0, None), -0.1, 0.002, False),
        (("wake_shadow", "cup"), ALWAYS, 0.3, 0.002, True),
    ],
)
def test_what_acts_seldom_cannot_be_asked_of_every_block(
    effect: tuple[str, str],
    interval: tuple[float, float | None],
    removed: float,
    p: float,
    borne: bool,
) -> None:
    found = _finding(*effect, 0.9, p)
    assert found.proof is not None
    found = replace(
        found,
        term=replace(found.term, interval=interval),
        proof=replace(found.proof, excess_removed=removed),
    )
    assert borne_out((found,)) is borne


@pytest.mark.parametrize(("of_all", "borne"), [(0.03, False), (0.45, True)])
def test_what_is_named_makes_up_a_part_of_all_that_is_wrong(of_all: float, borne: bool) -> None:
    found = _finding(*OFFSET, 0.9, 0.002)
    assert found.proof is not None
    proof = replace(found.proof, excess_removed=of_all, own_removed=0.87)
    assert borne_out((replace(found, proof=proof),)) is borne


@pytest.mark.parametrize(("low", "high", "known"), [(0.1, 0.5, True), (-0.5, 0.9, False)])
def test_a_name_needs_a_size_that_is_not_nought(low: float, high: float, known: bool) -> None:
    offset = {"offset": Estimate(0.3, low, high, "m/s")}
    found = replace(_finding(*OFFSET, 0.9, 0.002), parameters=offset)
    small, large = (
        replace(found, term=replace(found.term, values={"offset": size})) for size in (0.1, 0.5)
    )
    # Where only a product of two parameters shows, neither interval is narrow.
    for one, gain, enough in ((large, 40.0, known), (small, 400.0, known), (large, 400.0, True)):
        assert determined((replace(one, gain=gain),)) is enough
    # What is there or is not has no size to determine.
    swapped = _finding("sensor_swap", "vane", 0.9, 0.002)
    assert determined((replace(swapped, gain=40.0),))


@pytest.mark.parametrize(
    ("effect", "instrument", "needed"),
    [
        ("calibration_drift", "cup", PASSING_GAIN),
        ("bearing_friction", "cup", PASSING_GAIN),
        ("wake_shadow", "cup", PASSING_GAIN),
        ("vane_imbalance", "vane", PASSING_FORM_GAIN),
        ("axis_tilt", "station", PASSING_FORM_GAIN),
    ],
)
def test_what_passes_in_many_forms_must_bring_more(
    effect: str, instrument: str, needed: float
) -> None:
    passing = Term(catalogue()[effect], instrument, {}, (100.0, 200.0))
    assert passing_gain(passing) == needed
    assert passing_gain(replace(passing, interval=ALWAYS)) == 0.0


@pytest.mark.parametrize(
    ("effect", "interval", "p", "unseen"),
    [
        (OFFSET, (300.0, 600.0), 0.4, True),
        (OFFSET, (300.0, 600.0), 0.002, False),
        (OFFSET, ALWAYS, 0.4, False),
        (("stuck_sensor", "vane"), (300.0, 600.0), 0.4, False),
    ],
)
def test_what_begins_or_ends_must_stand_out(
    effect: tuple[str, str], interval: tuple[float, float | None], p: float, unseen: bool
) -> None:
    found = _finding(*effect, 0.9, p)
    passing = replace(found, term=replace(found.term, interval=interval), gain=0.9 * UNSEEN_GAIN)
    assert passes_unseen((passing,)) is unseen
    assert not passes_unseen((replace(passing, gain=600.0),))
    # A rival in an ambiguous set needs no place of its own.
    assert not passes_unseen((replace(passing, proof=None),))


def test_what_acts_seldom_must_do_what_the_next_best_does() -> None:
    found = _finding("wake_shadow", "cup", 0.9, 0.002)
    assert found.proof is not None
    for rival, borne in ((0.2, True), (0.5, False)):
        proof = replace(found.proof, excess_removed=0.4, placebo_removed=rival)
        assert borne_out((replace(found, proof=proof),)) is borne


@pytest.mark.parametrize(
    ("effect", "after", "removed", "borne"),
    [
        ("extra_pulses", 1.0, 0.6, True),
        ("extra_pulses", 1.0, 0.4, False),
        ("extra_pulses", 1.3, 0.6, False),
        ("calibration_offset", 1.0, 0.6, False),
    ],
)
def test_what_is_drawn_at_random_differs_from_block_to_block(
    effect: str, after: float, removed: float, borne: bool
) -> None:
    found = _finding(effect, "cup", 0.9, 0.002)
    assert found.proof is not None
    proof = replace(found.proof, after=after, excess_removed=removed)
    assert borne_out((replace(found, proof=proof),)) is borne


@pytest.mark.parametrize(
    ("stuck", "damped", "together", "made"),
    [(1700.0, 200.0, 1050.0, False), (900.0, 800.0, 1050.0, True), (700.0, 400.0, 1050.0, False)],
)
def test_what_takes_back_a_part_of_the_other_is_real_if_that_one_shows_alone(
    stuck: float, damped: float, together: float, made: bool
) -> None:
    friction = replace(_finding("vane_friction", "vane", 0.9, 0.002), gain=stuck)
    damping = replace(_finding("vane_damping", "vane", 0.2, 0.002), gain=damped)
    assert made_up((friction, damping), prepare(recorded(STATION, 65)), together) is made


def test_mass_and_damping_of_one_swing_are_both_told_though_they_undo_each_other() -> None:
    heavy = replace(_finding("vane_inertia", "vane", 0.3, 0.002), gain=110.0)
    damped = replace(_finding("vane_damping", "vane", 0.9, 0.002), gain=900.0)
    comparison = prepare(recorded(STATION, 65))
    assert not made_up((damped, heavy), comparison, 280.0)
    # What stands out nowhere is put together still.
    unseen = replace(heavy, gain=30.0, p=0.4)
    assert made_up((damped, unseen), comparison, 280.0)


def test_a_rival_in_an_ambiguous_set_needs_no_place_of_its_own() -> None:
    rival = replace(_finding(*ASYMMETRY, 0.9, 0.5), proof=None)
    found = (_finding(*OFFSET, 0.9, 0.002), rival)
    assert not made_up(found, prepare(recorded(STATION, 65)), 100.0)


def test_a_compass_shows_twice_a_turn_only_where_the_carrier_turns() -> None:
    effect = catalogue()["heading_deviation"]
    twice = next(p for p in effect.parameters if p.name == "sine_2")
    assert twice.free is not None
    n = 800
    rest = [np.zeros((n, 3)) for _ in range(3)]
    for turn, free in ((0.3 * np.pi, False), (2.0 * np.pi, True)):
        yaw = np.linspace(0.0, turn, n)
        attitude = rotations.from_roll_pitch_yaw(0.0 * yaw, 0.0 * yaw, yaw)
        drive = Drive(0, 0.05, np.ones((n, 3)), motion=Motion(attitude, *rest))
        assert twice.free(drive) is free
    assert not twice.free(Drive(0, 0.05, np.ones((n, 3))))


def test_a_fit_with_derivatives_carried_along_ends_where_an_exact_one_does() -> None:
    """Against a search that knows no derivatives, on three parameters that act together."""
    known = baseline()
    truth = {"sine": 6.0, "cosine": -4.0}
    effects = catalogue()
    station = with_effect(STATION, effects["vane_eccentricity"], "vane", truth)
    station = with_effect(station, effects["low_pass_filter"], "vane", {"time_constant": 0.8})
    comparison = prepare(recorded(station, 64), known.station)
    trust = trust_of(comparison, comparison.simulate(station), known)
    whitener = unstanding(comparison, trust)
    terms = [
        Term(effects["vane_eccentricity"], "vane", {"sine": 0.0, "cosine": 0.0}),
        Term(effects["low_pass_filter"], "vane", {"time_constant": 0.1}),
    ]
    found = fit(whitener, known.station, terms, iterations=20)

    def cost(values: np.ndarray) -> float:
        tried = [
            replace(terms[0], values={"sine": values[0], "cosine": values[1]}),
            replace(terms[1], values={"time_constant": values[2]}),
        ]
        white = whitener.of_station(planted(known.station, tried))
        return float(white @ white)

    best = minimize(
        cost, [5.0, -3.0, 0.6], method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-2}
    )
    # Shares of small turns are counts of readings: steps of a thousandth of a parameter move the
    # cost by some tenths. An interval of 95 % spans 3.8.
    assert found.cost == pytest.approx(best.fun, abs=1.0)
    np.testing.assert_allclose(
        [found.terms[0].values["sine"], found.terms[0].values["cosine"],
         found.terms[1].values["time_constant"]],
        best.x, rtol=0.03,
    )


@pytest.mark.parametrize(("width", "possible"), [(12.0, True), (23.0, True), (25.0, False)])
def test_a_wake_as_wide_as_the_search_allows_is_none(width: float, possible: bool) -> None:
    values = {"bearing_from": 200.0, "depth": 0.3, "width": width, "flank": 0.0}
    assert is_plausible(Term(catalogue()["wake_shadow"], "cup", values)) is possible


@pytest.mark.parametrize(("larger", "possible"), [(1.0, True), (3.0, True), (6.0, False)])
def test_no_flow_past_a_mast_changes_the_speed_by_half(larger: float, possible: bool) -> None:
    """None of the harmonics is at its bound: they add up where no wind need have come from."""
    values = {"cosine_1": 0.044, "sine_1": 0.042, "cosine_2": -0.03, "sine_2": -0.015}
    grown = {name: larger * value for name, value in values.items()}
    term = Term(catalogue()["flow_distortion"], "station", {**grown, "deflection": 0.0})
    assert is_plausible(term) is possible


@pytest.mark.parametrize(("deflection", "possible"), [(0.0, True), (1.0, True), (1.5, False)])
def test_a_flow_past_a_mast_bends_as_potential_flow_does(deflection: float, possible: bool) -> None:
    values = {"cosine_1": 0.05, "sine_1": 0.0, "cosine_2": 0.03, "sine_2": 0.0}
    term = Term(catalogue()["flow_distortion"], "station", {**values, "deflection": deflection})
    assert is_plausible(term) is possible
