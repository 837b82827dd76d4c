"""Edges and readings: where slots pass, what the circuit keeps, what the encoder shows."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from wind_sensors.errors import UserError
from wind_sensors.simulation import (
    AngleEncoder,
    AngleResponse,
    Drive,
    PulseCircuit,
    Response,
    ResponseState,
    RotorResponse,
    angle_readings,
    edge_times,
    expected_signals,
    passed_slots,
    random_numbers,
    respond,
)
from wind_sensors.simulation.response import Stretch
from wind_sensors.station.changes import segments
from wind_sensors.station.model import (
    Change,
    Clock,
    Cup,
    Electronics,
    Input,
    Outage,
    Propeller,
    Station,
    Vane,
)
from wind_sensors.station.signals import FloatArray, TimeArray

TOPIC = Input(topic="/x")
START = 1_700_000_000_000_000_000


def cup(**changes: Any) -> Cup:
    constants: dict[str, Any] = dict(
        name="cup", pulses=TOPIC, pulses_per_revolution=4, calibration_distance=0.2,
        distance_constant=1.7,
    )
    return Cup(**{**constants, **changes})


def vane(**changes: Any) -> Vane:
    constants: dict[str, Any] = dict(
        name="vane", joint_states=TOPIC, distance_constant=0.6, damping_ratio=0.3
    )
    return Vane(**{**constants, **changes})


def moved(
    station: Station,
    psi: FloatArray | None = None,
    rate: FloatArray | None = None,
    angle: FloatArray | None = None,
    dt: float = 0.05,
) -> Response:
    """A response with a movement that the test chose instead of a wind."""
    movement = psi if psi is not None else angle
    assert movement is not None
    count = len(movement)
    drive = Drive(START, dt, np.zeros((count, 3)))
    rotors = {}
    if psi is not None:
        assert rate is not None
        rotors["cup"] = RotorResponse(dt, 1, np.asarray(rate) * 0.2, np.asarray(psi), rate)
    angles = {}
    if angle is not None:
        angles["vane"] = AngleResponse(np.asarray(angle), np.gradient(angle, dt))
    stretch = (Stretch(0, count - 1, segments(station)[0]),)
    return Response(station, drive, stretch, rotors, angles, ResponseState())


def steadily_turning(rotor: Cup, rate: float = 20.0, seconds: float = 60.0) -> Response:
    t = np.arange(0.0, seconds + 0.01, 0.05)
    return moved(Station(instruments=(rotor,)), rate * t, np.full(t.size, rate))


def seconds(times: TimeArray) -> FloatArray:
    return np.asarray((times - START) * 1e-9, dtype=np.float64)


@pytest.mark.parametrize("harmonic", [0.0, 0.15])
def test_edges_come_when_a_fine_integration_says(harmonic: float) -> None:
    """Crossings of the angle found by SciPy's event search, to a microsecond."""
    draw = np.random.default_rng(4)
    dt, count = 0.05, 200
    speed = 6.0 + np.convolve(draw.normal(size=count + 9), np.ones(10) / 5, "valid")
    wind = np.stack((speed, 0 * speed, 0 * speed), axis=1)
    rotor = cup(torque_harmonic=harmonic, a4=0.8)
    found = seconds(edge_times(respond(Station(instruments=(rotor,)), Drive(START, dt, wind)),
                               "cup"))
    grid = dt * np.arange(count)

    def slope(time: float, state: FloatArray) -> list[float]:
        a = np.interp(time, grid, speed)
        y, psi = state
        torque = (a - y) * (0.8 * a + 0.2 * y) + harmonic * a * a * np.cos(psi)
        return [torque / 1.7, y / 0.2]

    def passes(time: float, state: FloatArray) -> float:
        return float(np.sin(2.0 * state[1]))

    crossings: list[float] = []
    state = np.array([speed[0], 0.0])
    for k in range(count - 1):
        part = solve_ivp(
            slope, (grid[k], grid[k + 1]), state, events=passes, rtol=1e-11, atol=1e-12
        )
        assert part.t_events is not None
        crossings += [float(t) for t in part.t_events[0] if t > 1e-9]
        state = part.y[:, -1]
    edges = np.unique(np.round(crossings, 9))
    edges = edges[np.r_[True, np.diff(edges) > 1e-6]]
    assert abs(len(found) - len(edges)) <= 1
    both = min(len(found), len(edges))
    assert np.abs(found[:both] - edges[:both]).max() < 1e-6


def test_the_interpolant_is_inverted_to_a_nanosecond() -> None:
    """A movement that is a cubic between samples, so that its crossings are roots of cubics."""
    draw = np.random.default_rng(2)
    rate = 30.0 + 8.0 * draw.normal(size=80)
    psi = np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * 0.05)))
    psi[1:] += 0.05 * draw.normal(size=79)
    rotor = cup(pulses_per_revolution=3)
    found = seconds(edge_times(moved(Station(instruments=(rotor,)), psi, rate), "cup"))
    expected = []
    for k in range(79):
        a, b = psi[k], psi[k + 1]
        m, n = rate[k] * 0.05, rate[k + 1] * 0.05
        cubic = np.array([2 * (a - b) + m + n, 3 * (b - a) - 2 * m - n, m, a])
        levels = np.arange(np.ceil(a / (2 * np.pi / 3)), np.floor(b / (2 * np.pi / 3)) + 1)
        for level in levels:
            roots = np.roots(cubic - [0, 0, 0, level * 2 * np.pi / 3])
            real = roots[np.abs(roots.imag) < 1e-7].real
            inside = real[(real > 1e-12) & (real <= 1.0)]
            if inside.size:
                expected.append((k + inside.min()) * 0.05)
    np.testing.assert_allclose(found, expected, atol=2e-9)


@given(st.floats(0.5, 200.0), st.integers(1, 36))
@settings(max_examples=30)
def test_a_steady_rotor_gives_every_slot_once_per_turn(rate: float, slots: int) -> None:
    rotor = cup(pulses_per_revolution=slots)
    found = seconds(edge_times(steadily_turning(rotor, rate, 10.0), "cup"))
    width = 2 * np.pi / slots / rate
    np.testing.assert_allclose(found, width * np.arange(1, len(found) + 1), atol=2e-9)
    assert abs(len(found) - 10.0 / width) <= 1.0 + 1e-6


def test_slots_out_of_place_shift_their_own_edges_only() -> None:
    errors = (0.1, -0.2, 0.0, 0.05)
    rotor = cup(electronics=Electronics(slot_errors=errors))
    found = seconds(edge_times(steadily_turning(rotor), "cup"))
    width = 2 * np.pi / 4 / 20.0
    first = round(found[0] / width - 0.2)
    numbers = np.arange(len(found)) + first
    np.testing.assert_allclose(found / width - numbers, np.array(errors)[numbers % 4], atol=1e-6)


@pytest.mark.parametrize("errors", [(0.1, 0.2), (0.0, 1.2, 0.0, 0.0), (0.9, -0.3, 0.0, 0.0)])
def test_slot_errors_that_cannot_be_are_the_users_error(errors: tuple[float, ...]) -> None:
    rotor = cup(electronics=Electronics(slot_errors=errors))
    with pytest.raises(UserError, match="slot"):
        edge_times(steadily_turning(rotor, seconds=1.0), "cup")


@pytest.mark.parametrize("rate", [1e9, 1e30, np.nan])
def test_edges_that_find_no_room_are_the_users_error(rate: float) -> None:
    with pytest.raises(UserError, match="calibration_distance"):
        edge_times(steadily_turning(cup(), rate, seconds=1.0), "cup")


def test_a_rotor_that_turns_back_passes_its_slots_again() -> None:
    t = np.arange(0.0, 20.001, 0.05)
    psi, rate = 10.0 * np.sin(0.5 * t), 5.0 * np.cos(0.5 * t)
    rotor = cup()
    found = seconds(edge_times(moved(Station(instruments=(rotor,)), psi, rate), "cup"))
    fine = np.arange(0.0, 20.0, 1e-4)
    slots = np.floor(10.0 * np.sin(0.5 * fine) / (np.pi / 2))
    crossings = fine[1:][np.diff(slots) != 0]
    assert len(found) == len(crossings)
    np.testing.assert_allclose(found, crossings, atol=2e-4)


def test_dead_time_passes_every_nth_edge_of_a_fast_rotor() -> None:
    rotor = cup(electronics=Electronics(dead_time=0.2))
    every = seconds(edge_times(steadily_turning(cup()), "cup"))
    kept = seconds(edge_times(steadily_turning(rotor), "cup"))
    # Edges every 0.0785 s: the third one after an accepted edge is the first beyond 0.2 s.
    np.testing.assert_allclose(kept, every[::3], atol=1e-9)


def test_lost_edges_are_the_stated_share_and_the_others_stay() -> None:
    rotor = cup(electronics=Electronics(loss_probability=0.3))
    every = edge_times(steadily_turning(cup(), seconds=600.0), "cup")
    kept = edge_times(steadily_turning(rotor, seconds=600.0), "cup", seed=3)
    assert set(kept) < set(every)
    share = len(kept) / len(every)
    assert abs(share - 0.7) < 4 * np.sqrt(0.21 / len(every))
    assert not np.array_equal(
        kept, edge_times(steadily_turning(rotor, seconds=600.0), "cup", seed=4)
    )


@pytest.mark.parametrize(
    ("rate", "lost"), [(12.5, 0.0125), (25.0, 0.05), (50.0, 0.2), (200.0, 0.95)], ids=str
)
def test_a_weak_pick_up_loses_more_edges_the_faster_the_rotor_turns(
    rate: float, lost: float
) -> None:
    weak = cup(electronics=Electronics(loss_probability=0.05, loss_growth=2.0, dead_time=1e-4))
    assert weak.calibration_distance == 0.2
    every = edge_times(steadily_turning(cup(), rate, 600.0), "cup")
    response = steadily_turning(weak, rate, 600.0)
    kept = edge_times(response, "cup", seed=3)
    assert set(kept) < set(every)
    error = np.sqrt(lost * (1.0 - lost) / len(every))
    assert 1.0 - len(kept) / len(every) == pytest.approx(lost, abs=4 * error)
    turns = expected_signals(response, "cup").turns
    assert turns is not None
    expected = np.diff(turns) * weak.pulses_per_revolution
    np.testing.assert_allclose(expected, 1.0 - lost, rtol=1e-6)


@pytest.mark.parametrize(
    ("electronics", "counts"),
    [
        (Electronics(loss_probability=0.3), 0.7),
        (Electronics(bounce_probability=0.2, bounce_delay=0.002), 1.2),
        (Electronics(bounce_probability=0.2, bounce_delay=0.002, dead_time=0.01), 1.0),
        (Electronics(bounce_probability=0.2, bounce_delay=0.002, dead_time=0.001), 1.15),
    ],
)
def test_on_average_each_edge_counts_for_what_chance_makes_of_it(
    electronics: Electronics, counts: float
) -> None:
    every = edge_times(steadily_turning(cup(), seconds=300.0), "cup")
    response = steadily_turning(cup(electronics=electronics), seconds=300.0)
    expected = expected_signals(response, "cup")
    np.testing.assert_array_equal(expected.time, every)
    slots = cup().pulses_per_revolution
    assert expected.turns is not None
    np.testing.assert_allclose(np.diff(expected.turns), counts / slots, rtol=1e-6)
    drawn = len(edge_times(response, "cup", seed=3)) / len(every)
    assert drawn == pytest.approx(counts, abs=0.03)


def test_bounces_follow_their_edges_and_dead_time_removes_them() -> None:
    bouncing = Electronics(bounce_probability=0.2, bounce_delay=0.002)
    every = seconds(edge_times(steadily_turning(cup(), seconds=300.0), "cup"))
    found = seconds(edge_times(steadily_turning(cup(electronics=bouncing), seconds=300.0), "cup"))
    extra = np.setdiff1d(np.round(found, 8), np.round(every, 8))
    assert abs(len(extra) / len(every) - 0.2) < 0.03
    later = extra - every[np.searchsorted(every, extra) - 1]
    assert later.max() < 0.004
    error = 0.004 / np.sqrt(12 * len(extra))
    assert later.mean() == pytest.approx(0.002, abs=4 * error)
    assert later.std() == pytest.approx(0.004 / np.sqrt(12), rel=0.15)
    blind = Electronics(bounce_probability=0.2, bounce_delay=0.002, dead_time=0.01)
    kept = seconds(edge_times(steadily_turning(cup(electronics=blind), seconds=300.0), "cup"))
    np.testing.assert_allclose(kept, every, atol=1e-9)


def test_clock_and_outage_change_stamps_and_leave_the_rest() -> None:
    every = seconds(edge_times(steadily_turning(cup()), "cup"))
    late = cup(clock=Clock(latency=0.3, drift=1e-3), outages=(Outage(start=20.0, stop=25.0),))
    found = seconds(edge_times(steadily_turning(late), "cup"))
    left = every[(every < 20.0) | (every >= 25.0)]
    np.testing.assert_allclose(found, left * 1.001 + 0.3, atol=2e-9)


@pytest.mark.parametrize(
    "electronics",
    [
        Electronics(),
        Electronics(loss_probability=0.2, bounce_probability=0.3, dead_time=0.003),
        Electronics(bounce_probability=0.5, bounce_delay=0.3, dead_time=0.05),
        Electronics(loss_probability=0.1, loss_growth=2.0),
    ],
)
def test_a_circuit_fed_in_blocks_gives_what_it_gives_at_once(electronics: Electronics) -> None:
    station = Station(
        instruments=(cup(electronics=electronics, torque_harmonic=0.05),),
        changes=(Change(start=7.0, instrument="cup", set={"pulses_per_revolution": 6}),),
    )
    draw = np.random.default_rng(8)
    wind = np.stack((5 + draw.normal(size=401), np.zeros(401), np.zeros(401)), axis=1)
    whole = respond(station, Drive(START, 0.05, wind))
    at_once = PulseCircuit("cup", START, 5).edges(passed_slots(whole, "cup"))
    circuit, state, parts = PulseCircuit("cup", START, 5), None, []
    for first in range(0, 400, 80):
        drive = Drive(
            START + round(first * 0.05e9), 0.05, wind[first : first + 81], elapsed=first * 0.05
        )
        part = respond(station, drive, state)
        state = part.final
        parts.append(circuit.edges(passed_slots(part, "cup")))
    together = np.concatenate(parts)
    # Where a rotor is unequal its results lie as close as the block's strongest gust asks for.
    assert together.size == at_once.size
    assert np.abs(together - at_once).max() < 20_000


def test_a_propeller_blown_from_behind_still_gives_edges() -> None:
    reverse = Propeller(
        name="cup", pulses=TOPIC, pulses_per_revolution=2, calibration_distance=0.05,
        distance_constant=1.0, axis=(1.0, 0.0, 0.0),
    )
    wind = np.tile((-5.0, 0.0, 0.0), (200, 1))
    found = respond(Station(instruments=(reverse,)), Drive(START, 0.05, wind))
    assert found.rotors["cup"].y[-1] == pytest.approx(-5.0)
    edges = seconds(edge_times(found, "cup"))
    np.testing.assert_allclose(np.diff(edges), np.pi * 0.05 / 5.0, rtol=1e-6)


def read(v: Vane, angle: npt.ArrayLike, seed: int | None = None) -> FloatArray:
    turned = np.asarray(angle, dtype=float)
    response = moved(Station(instruments=(v,)), angle=turned)
    stamps = START + np.rint(np.arange(len(turned)) * 0.05e9).astype(np.int64)
    return angle_readings(response, "vane", stamps, seed)


def test_a_healthy_encoder_shows_the_heading_wrapped() -> None:
    turned = np.linspace(-10.0, 10.0, 201)
    np.testing.assert_allclose(read(vane(), turned), np.angle(np.exp(1j * turned)), atol=1e-12)


def test_offset_and_direction_of_counting() -> None:
    turned = np.linspace(-1.0, 1.0, 101)
    np.testing.assert_allclose(
        read(vane(offset_deg=7.0), turned), turned + np.radians(7.0), atol=1e-12
    )
    np.testing.assert_allclose(
        read(vane(offset_deg=7.0, reversed=True), turned), -turned - np.radians(7.0), atol=1e-12
    )


def test_eccentricity_is_a_sine_of_the_heading() -> None:
    turned = np.linspace(-3.0, 3.0, 301)
    found = read(vane(eccentricity_deg=4.0, eccentricity_phase_deg=30.0), turned)
    expected = turned + np.radians(4.0) * np.sin(turned - np.radians(30.0))
    np.testing.assert_allclose(found, np.angle(np.exp(1j * expected)), atol=1e-12)


def test_a_coarse_encoder_shows_multiples_of_its_step() -> None:
    found = np.degrees(read(vane(quantisation_deg=22.5), np.linspace(-3.1, 3.1, 500)))
    np.testing.assert_allclose(found / 22.5, np.round(found / 22.5), atol=1e-9)
    assert np.unique(np.round(found % 360.0)).size == 16


def test_a_dead_gap_holds_its_edges_or_its_reading() -> None:
    turned = np.linspace(0.0, 1.0, 201)
    gap = dict(gap_centre_deg=30.0, gap_width_deg=10.0)
    low, high = np.radians(25.0), np.radians(35.0)
    held = read(vane(**gap), turned)
    inside = (turned > low) & (turned < high)
    expected = np.where(inside, np.where(turned < np.radians(30.0), low, high), turned)
    np.testing.assert_allclose(held, expected, atol=1e-12)
    zeroed = read(vane(**gap, gap_reading_deg=0.0), turned)
    np.testing.assert_allclose(zeroed, np.where(inside, 0.0, turned), atol=1e-12)
    loose = read(vane(**gap, gap_reading_deg="floating"), turned)
    np.testing.assert_allclose(loose[~inside], turned[~inside], atol=1e-12)
    assert np.ptp(loose[inside]) > 3.0


def test_a_filter_lags_a_ramp_by_its_time_constant() -> None:
    t = 0.05 * np.arange(400)
    found = read(vane(filter_time_constant=0.8), 0.1 * t)
    expected = 0.1 * (t - 0.8 * (1 - np.exp(-t / 0.8)))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_play_lets_the_reading_rest_until_it_is_taken_up() -> None:
    t = 0.05 * np.arange(401)
    found = np.degrees(read(vane(play_deg=8.0), np.radians(20.0) * np.sin(2.0 * np.pi * t / 10.0)))
    turned = 20.0 * np.sin(2.0 * np.pi * t / 10.0)
    later = t > 2.5
    assert np.abs(found - turned).max() <= 4.0 + 1e-9
    assert found[later].max() == pytest.approx(16.0, abs=0.01)
    assert found[later].min() == pytest.approx(-16.0, abs=0.01)
    rests = later & (np.abs(np.diff(found, prepend=0.0)) < 1e-9)
    # Back by 8 degrees of 20: it rests while the sine falls from 1 to 0.6.
    period = (t > 5.0) & (t < 15.0)
    assert np.mean(rests[period]) == pytest.approx(np.arccos(0.6) / np.pi, abs=0.02)


def test_a_logger_that_refuses_to_turn_faster_ramps_after_a_jump() -> None:
    t = 0.05 * np.arange(200)
    jumping = np.radians(np.where(t < 2.0, 170.0, 230.0))
    found = np.degrees(np.unwrap(read(vane(slew_limit_deg_s=20.0), jumping)))
    np.testing.assert_allclose(found, np.clip(170.0 + 20.0 * (t - 1.95), 170.0, 230.0), atol=1e-6)


def test_latency_shows_the_heading_of_an_earlier_time() -> None:
    t = 0.05 * np.arange(400)
    angle = np.sin(0.8 * t)
    found = read(vane(clock=Clock(latency=0.123)), angle)
    np.testing.assert_allclose(found[10:], np.sin(0.8 * (t[10:] - 0.123)), atol=1e-4)


def test_a_stuck_sensor_repeats_its_last_reading() -> None:
    t = 0.05 * np.arange(400)
    angle = np.sin(0.8 * t)
    found = read(vane(outages=(Outage(start=5.0, stop=9.0),)), angle)
    stuck = (t >= 5.0 - 1e-9) & (t < 9.0 - 1e-9)
    np.testing.assert_allclose(found[stuck], angle[99], atol=1e-12)
    np.testing.assert_allclose(found[~stuck], angle[~stuck], atol=1e-12)


def test_noise_has_its_size_and_belongs_to_the_sample() -> None:
    angle = np.zeros(20_000)
    one = read(vane(noise_deg=2.0), angle, seed=1)
    assert np.degrees(one.std()) == pytest.approx(2.0, rel=0.03)
    assert abs(np.corrcoef(one[1:], one[:-1])[0, 1]) < 0.03
    np.testing.assert_array_equal(one, read(vane(noise_deg=2.0), angle, seed=1))
    assert not np.array_equal(one, read(vane(noise_deg=2.0), angle, seed=2))
    np.testing.assert_array_equal(read(vane(noise_deg=2.0), angle), angle)


def test_an_encoder_fed_in_blocks_gives_what_it_gives_at_once() -> None:
    v = vane(
        filter_time_constant=0.4, noise_deg=1.0, eccentricity_deg=5.0, play_deg=6.0,
        slew_limit_deg_s=60.0,
        outages=(Outage(start=4.5, stop=6.2),),
    )
    station = Station(
        instruments=(v,), changes=(Change(start=8.0, instrument="vane", set={"offset_deg": 9.0}),)
    )
    draw = np.random.default_rng(3)
    wind = np.array((5.0, 2.0, 0.0)) + draw.normal(size=(241, 3))
    whole = respond(station, Drive(START, 0.05, wind))
    stamps = START + np.rint(np.arange(240) * 0.05e9).astype(np.int64)
    at_once = AngleEncoder("vane", START, 7).readings(whole, stamps)
    encoder, state, parts = AngleEncoder("vane", START, 7), None, []
    for first in range(0, 240, 60):
        drive = Drive(int(stamps[first]), 0.05, wind[first : first + 61], elapsed=first * 0.05)
        part = respond(station, drive, state)
        state = part.final
        parts.append(encoder.readings(part, stamps[first : first + 60]))
    np.testing.assert_allclose(np.concatenate(parts), at_once, atol=1e-12)
    jump = at_once[161] - at_once[159]
    assert abs(jump - np.radians(9.0)) < np.radians(6.0)


def test_hashed_numbers_are_uniform_and_independent() -> None:
    index = np.arange(200_000)
    a = random_numbers.uniform(1, "a", index)
    b = random_numbers.uniform(1, "b", index)
    counts = np.histogram(a, 50, (0, 1))[0]
    chi_square = np.sum((counts - 4000.0) ** 2 / 4000.0)
    assert 20.0 < chi_square < 90.0, "49 degrees of freedom"
    for x, y in ((a, b), (a[1:], a[:-1]), (a, random_numbers.uniform(2, "a", index))):
        assert abs(np.corrcoef(x, y)[0, 1]) < 0.01
    n = random_numbers.normal(1, "n", index)
    assert abs(n.mean()) < 0.01 and abs(n.std() - 1.0) < 0.01
    assert np.mean(n**4) == pytest.approx(3.0, rel=0.05)


def test_a_shaft_angle_tells_which_way_a_propeller_turns() -> None:
    """A propeller blown backwards and forwards again: the angle goes back as the rotor does."""
    propeller = Propeller.model_validate(
        {
            "name": "propeller", "pulses": {"topic": "p", "type": "sensor_msgs/msg/JointState"},
            "pulses_per_revolution": 6, "calibration_distance": 0.05, "distance_constant": 1.0,
            "axis": (1.0, 0.0, 0.0),
        }
    )
    t = np.arange(401) * 0.05
    wind = np.stack([6.0 * np.sin(2.0 * np.pi * t / 10.0), np.zeros(401), np.zeros(401)], axis=1)
    response = respond(Station(instruments=(propeller,)), Drive(START, 0.05, wind))
    told = PulseCircuit("propeller", START, 0).signals(passed_slots(response, "propeller"))
    assert told.turns is not None
    psi = np.interp(seconds(told.time), t, response.rotors["propeller"].psi)
    np.testing.assert_allclose(2.0 * np.pi * told.turns, psi, atol=0.3)
    steps = np.diff(told.turns) * 6.0
    np.testing.assert_allclose(np.abs(steps[steps != 0.0]), 1.0)
    assert np.count_nonzero(steps < 0.0) > 100
    assert np.count_nonzero(steps > 0.0) > 100
