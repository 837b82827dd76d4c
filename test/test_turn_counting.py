"""Turned angles from edges that electronics have lost, doubled or displaced."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from wind_sensors.estimation.turn_counting import TurnCounter
from wind_sensors.station.model import Cup, Electronics, Input

FloatArray = npt.NDArray[np.float64]

SLOTS = 4


def counted(
    seconds: FloatArray, electronics: Electronics, block: int = 10**9
) -> tuple[FloatArray, FloatArray]:
    """Times [s] and angles [slots] of the edges that count."""
    rotor = Cup(
        name="cup",
        pulses=Input(topic="/cup/pulses"),
        pulses_per_revolution=SLOTS,
        calibration_distance=0.14,
        distance_constant=1.7,
        electronics=electronics,
    )
    counter = TurnCounter(rotor, 0)
    stamps = np.round(seconds * 1e9).astype(np.int64)
    parts = [
        counter.count(rotor, stamps[first : first + block])
        for first in range(0, stamps.size, block)
    ]
    time, angle = (np.concatenate(each) for each in zip(*parts, strict=True))
    return time * 1e-9, angle * SLOTS / (2.0 * np.pi)


def edges(count: int, displaced: FloatArray | None = None, first: int = 0) -> FloatArray:
    """Of a rotor that turns faster and slower by a tenth within seconds, 20 to 25 a second."""
    number = np.arange(first, first + count)
    places = number + (0.0 if displaced is None else displaced[number % SLOTS])
    grid = np.linspace(0.0, 1.0e3, 400_001)
    turned = 22.0 * grid + 6.0 * np.sin(grid / 3.0)
    return np.asarray(np.interp(places, turned, grid))


@pytest.mark.parametrize("first", [0, 1, 2, 3])
@pytest.mark.parametrize("block", [10**9, 7])
def test_slots_out_of_their_places_do_not_change_the_angle(first: int, block: int) -> None:
    errors = np.array([0.26, -0.08, -0.09, -0.09])
    seconds = edges(2000, errors, first)
    _, angle = counted(seconds, Electronics(slot_errors=tuple(errors)), block)
    grid = np.linspace(0.0, 1.0e3, 400_001)
    true = np.interp(seconds, grid, 22.0 * grid + 6.0 * np.sin(grid / 3.0))
    off = (angle - true)[100:]
    assert np.ptp(off) < 0.01
    _, plain = counted(seconds, Electronics(), block)
    assert np.ptp((plain - true)[100:]) > 0.3


@pytest.mark.parametrize("spread", ["even", "exponential", "one"])
def test_a_contact_that_bounces_in_any_way_is_counted_once(spread: str) -> None:
    draw = np.random.default_rng(4)
    true = edges(4000)
    mean = 0.0015
    delay = {
        "even": draw.uniform(0.0002, 2.0 * mean - 0.0002, 800),
        "exponential": draw.exponential(mean, 800),
        "one": np.full(800, mean),
    }[spread]
    again = draw.choice(true[20:], 800, replace=False) + delay
    stated = Electronics(bounce_probability=0.2, bounce_delay=mean)
    time, angle = counted(np.sort(np.concatenate((true, again))), stated)
    missed = {"even": 0, "exponential": 80, "one": 0}[spread]
    assert abs(angle[-1] - true.size) < missed + 0.5
    assert np.isin(np.round(time[:100], 7), np.round(true[:120], 7)).mean() > 0.97


@pytest.mark.parametrize(
    ("longer", "passed"), [(1.4, 1), (1.52, 1), (1.9, 2), (2.1, 2)], ids=str
)
def test_an_edge_is_taken_for_lost_where_that_is_likelier_than_a_sudden_lull(
    longer: float, passed: int
) -> None:
    steps = np.full(200, 0.04)
    steps[100] *= longer
    _, angle = counted(np.cumsum(steps), Electronics(loss_probability=0.001))
    assert angle[100] - angle[99] == passed
