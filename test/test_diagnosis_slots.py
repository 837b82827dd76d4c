"""Where the slots of a disc are, and since when: read off its pulses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from diagnosis_cases import STATION, baseline, recorded
from turned_disc import SLOTS, TURN, TURNS, edges

from wind_sensors.diagnosis.comparing.observation import Grid
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import (
    interval_statistics,
)
from wind_sensors.diagnosis.comparing.raw_statistics.slots import slot_intervals
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.effects.output import slot_values
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.station.model import Cup
from wind_sensors.station.signals import Pulses

FloatArray = npt.NDArray[np.float64]


def unevenness(time: FloatArray) -> tuple[float, float]:
    """Scatter of the slots and what swings once per turn."""
    grid = Grid(0, 0.1, round(TURNS * TURN / 0.1))
    cup = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": SLOTS})
    assert isinstance(cup, Cup)
    speed = np.full(grid.n, 2.0 * np.pi * cup.calibration_distance / TURN)
    pulses = Pulses(np.round(time * 1e9).astype(np.int64))
    found = interval_statistics(pulses, cup, np.ones(grid.n, dtype=complex), speed, grid)
    return float(found[2]), float(found[3])


@pytest.mark.parametrize(
    ("lost", "bounced", "followed"),
    [(0.02, 0.0, 0.9), (0.04, 0.0, 0.85), (0.0, 0.04, 0.95), (0.02, 0.02, 0.8)],
)
def test_slots_are_followed_past_lost_and_doubled_edges(
    lost: float, bounced: float, followed: float
) -> None:
    records = 40
    right = 0
    for seed in range(records):
        rng = np.random.default_rng(seed)
        displaced = np.clip(0.06 * rng.standard_normal(SLOTS), -0.2, 0.2)
        clean = edges(displaced)
        kept = clean[rng.random(clean.size) >= lost]
        again = kept[rng.random(kept.size) < bounced] + rng.uniform(0.0005, 0.003)
        expected, found = unevenness(clean), unevenness(np.sort(np.concatenate((kept, again))))
        # A wrong count anywhere spreads every slot over all of them, and next to nothing is left.
        right += found == pytest.approx(expected, abs=0.15 * max(expected))
    assert right >= followed * records


def test_slots_that_become_uneven_show_from_then_on() -> None:
    displaced = 0.05 * np.random.default_rng(3).standard_normal(SLOTS)
    cuts = np.linspace(0.0, TURNS * TURN, 13)
    shown = slot_intervals(edges(displaced, since=120.0), SLOTS).shown_in(cuts)
    begin = np.flatnonzero(cuts[:-1] >= 120.0)
    assert np.abs(shown[: begin[0] - 1]).max() < 0.1 * shown[begin].min()


@pytest.mark.parametrize("since", [0.0, 120.0])
def test_what_is_locked_to_a_wind_that_turns_is_not_the_disc(since: float) -> None:
    """Cups that pull more in one direction of the wind, once and three times per turn."""
    displaced = 0.03 * np.random.default_rng(3).standard_normal(SLOTS)
    displaced -= np.mean(displaced)
    time = edges(displaced, since)
    wind_from = 0.8 * np.sin(time / 40.0) + 0.004 * time
    angle = 2.0 * np.pi * np.arange(time.size) / SLOTS - wind_from
    pulled = time + TURN / SLOTS * (0.04 * np.cos(angle) + 0.02 * np.cos(3.0 * angle + 0.5))
    seen, even = (slot_intervals(t, SLOTS) for t in (pulled, time))
    aside, left = seen.without_what_turns(np.interp(seen.begin, time, wind_from))
    end = TURNS * TURN
    if since == 0.0:
        assert left < 0.1 * seen.left_by(0.0, end)
        assert aside.displacements(0.0, end) == pytest.approx(displaced, abs=0.003)
        assert np.abs(seen.displacements(0.0, end) - displaced).max() > 0.02
    # Slots that become uneven while the wind turns remain slots.
    _, left = even.without_what_turns(np.interp(even.begin, time, wind_from))
    assert (left > even.left_by(since, end)) is (since > 0.0)


def test_fewer_edges_than_a_turn_has_tell_nothing_of_slots() -> None:
    seen = slot_intervals(np.linspace(0.0, 50.0, 100), 120)
    aside, left = seen.without_what_turns(np.zeros(seen.begin.size))
    assert (aside.begin.size, left, seen.left_by(0.0, 50.0)) == (0, 0.0, 0.0)


def test_the_place_of_each_slot_is_read_off_the_pulses() -> None:
    displaced = np.clip(0.15 * np.random.default_rng(5).standard_normal(SLOTS), -0.3, 0.3)
    displaced -= np.mean(displaced)
    seen = slot_intervals(edges(displaced, since=120.0), SLOTS)
    assert seen.displacements(130.0, TURNS * TURN) == pytest.approx(displaced, abs=0.01)
    assert np.abs(seen.displacements(0.0, 110.0)).max() < 0.01


def test_a_disc_is_simulated_with_the_slots_that_its_pulses_show() -> None:
    slots = catalogue()["encoder_slot_error"]
    displaced = 0.1 * np.random.default_rng(6).standard_normal(12)
    displaced -= np.mean(displaced)
    cup = STATION.instrument("cup")
    assert isinstance(cup, Cup)
    values = slot_values(displaced.tolist())
    corrected = with_effect(STATION, slots, "cup", values).instrument("cup")
    assert isinstance(corrected, Cup)
    assert corrected.electronics.slot_errors == pytest.approx(displaced)


def test_the_beginning_of_uneven_slots_is_part_of_the_finding() -> None:
    slots = {"scatter": 0.04, "once_per_turn": 0.03}
    station = with_effect(
        STATION, catalogue()["encoder_slot_error"], "cup", slots, (220.0, None)
    )
    (finding,) = diagnose(recorded(station, 81), baseline()).findings
    assert finding.term.effect.name == "encoder_slot_error"
    assert finding.term.interval[0] == pytest.approx(220.0, abs=20.0)
    assert finding.term.interval[1] is None
    assert finding.parameters["scatter"].value == pytest.approx(0.04, rel=0.2)


def test_slots_are_counted_anew_after_a_silence() -> None:
    displaced = 0.05 * np.random.default_rng(5).standard_normal(SLOTS)
    whole = edges(displaced)
    # Of every record the disc goes on by another number of slots.
    for lost in range(3 * SLOTS, 4 * SLOTS):
        silent = (whole > 150.0) & (whole < 210.0)
        silent[np.flatnonzero(silent)[-1] + 1 + np.arange(lost)] = True
        assert unevenness(whole[~silent]) == pytest.approx(unevenness(whole), rel=0.1)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_beat_is_told_in_units_of_the_wind_across_whichever_way_the_rotor_turns(
    way: float,
) -> None:
    rng = np.random.default_rng(8)
    grid = Grid(0, 0.1, round(TURNS * TURN / 0.1))
    gusts = rng.standard_normal((2, grid.n // 30 + 2))
    across = np.asarray(0.1 * np.repeat(gusts[0] + 1j * gusts[1], 30)[: grid.n], dtype=complex)
    time = edges(np.zeros(SLOTS))
    place = np.minimum((time / grid.dt).astype(int), grid.n - 1)
    angle = way * 2.0 * np.pi / SLOTS * np.arange(time.size)
    amplitude = 0.004
    # What an interval is longer by, in its own lengths.
    longer = amplitude * (across[place] * np.exp(-1j * angle)).real
    moved = time + np.cumsum(longer - longer.mean()) * TURN / SLOTS
    rotor = STATION.instrument("cup").model_copy(update={"pulses_per_revolution": SLOTS})
    assert isinstance(rotor, Cup)
    speed = np.full(grid.n, 2.0 * np.pi * rotor.calibration_distance / TURN)
    found = [
        float(
            interval_statistics(
                Pulses(np.round(seen * 1e9).astype(np.int64)), rotor, across, speed, grid
            )[4]
        )
        for seen in (time, moved)
    ]
    # A little less: beside gusts in the plane of rotation that hardly blow nothing is made of it.
    power = np.mean(np.abs(across) ** 2)
    known = power / (power + 0.05**2)
    assert found[1] == pytest.approx(amplitude * known, rel=0.1)
    assert found[0] < 0.2 * amplitude
