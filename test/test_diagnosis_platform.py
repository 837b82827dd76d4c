"""What a carrier does to the wind at its sensors: rotors that blow on them, and waves."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from wind_sensors.diagnosis.comparing.observation import where_untold
from wind_sensors.diagnosis.comparing.preparing import prepare
from wind_sensors.diagnosis.effects import catalogue
from wind_sensors.diagnosis.effects.definition import with_effect
from wind_sensors.diagnosis.explaining.fitting import fit
from wind_sensors.diagnosis.explaining.terms import planted, suggested
from wind_sensors.diagnosis.healthy.baseline import Baseline, default_channel
from wind_sensors.diagnosis.healthy.learning import default_baseline, learn
from wind_sensors.diagnosis.healthy.whitening import residual_of, trust_of, unstanding
from wind_sensors.diagnosis.verdict import diagnose
from wind_sensors.estimation import process
from wind_sensors.recordings.station_files import load_station
from wind_sensors.simulation import Scenario, Trajectory, simulate
from wind_sensors.simulation.trajectories import boat, multirotor
from wind_sensors.station.model import Downwash, Input, Reference, Station
from wind_sensors.station.signals import Recording
from wind_sensors.turbulence.synthesis import isotropic_spec


def uav(**downwash: float) -> Station:
    """The ready multirotor beside a reference, with the inflow stated here alone."""
    ready = load_station("multirotor")
    assert ready.platform is not None
    platform = ready.platform.model_copy(update={"downwash": Downwash(**downwash)})
    reference = Reference(topic=Input(topic="/reference/wind"), separation=0.5)
    return ready.model_copy(update={"platform": platform, "reference": reference})


def flown(station: Station, seed: int) -> Recording:
    """Legs at 3 m/s in a wind of its own, read with the station that knows of no inflow."""
    rng = np.random.default_rng(seed)
    wind = isotropic_spec(
        rng.uniform(4.0, 8.0), 0.15, 60.0, direction=rng.uniform(-3.0, 3.0), seed=seed
    )
    trajectory = multirotor(speed=3.0, seed=seed)
    recording = simulate(station, Scenario(wind, duration=400.0, seed=seed, trajectory=trajectory))
    return replace(recording, station=uav(), truth=None)


@lru_cache(maxsize=1)
def three_flights() -> Baseline:
    """What three healthy flights teach."""
    return learn([flown(uav(), seed) for seed in range(3)])


def test_flights_tell_the_inflow_of_their_rotors() -> None:
    """Each within its interval, which is wide for so short a flight, and on average to a tenth."""
    baseline = three_flights()
    told: dict[str, list[float]] = {"induced_velocity": [], "wake_skew": []}
    for seed in (50, 51, 52):
        flight = flown(uav(induced_velocity=3.0, wake_skew=0.3), seed)
        found = diagnose(flight, baseline, with_proof=seed == 50)
        assert found.verdict == "named"
        (finding,) = found.findings
        assert finding.term.key == ("rotor_downwash", "platform")
        for key, true in (("induced_velocity", 3.0), ("wake_skew", 0.3)):
            estimate = finding.parameters[key]
            assert estimate.low < true < estimate.high
            told[key].append(estimate.value)
        if seed == 50:
            assert finding.proof is not None
            assert finding.proof.excess_removed > 0.8
    assert np.mean(told["induced_velocity"]) == pytest.approx(3.0, rel=0.1)
    assert np.mean(told["wake_skew"]) == pytest.approx(0.3, rel=0.1)


def usv() -> Station:
    """The ready boat beside a reference."""
    reference = Reference(topic=Input(topic="/reference/wind"), separation=0.5)
    return load_station("usv").model_copy(update={"reference": reference})


def on_waves(seed: int, eddies: float, higher: float = 0.0) -> Recording:
    """The boat under way in a steady breeze with so much turbulence.

    Args:
        seed: Of the eddies; the waves are always the same.
        eddies: Intensity of the turbulence.
        higher: The sensors are mounted so much higher than described [m].
    """
    arm = {"dx": 0.0, "dy": 0.0, "dz": higher}
    sailing = with_effect(usv(), catalogue()["lever_arm"], "platform", arm)
    wind = isotropic_spec(8.0, eddies, 60.0, seed=seed)
    scenario = Scenario(wind, duration=600.0, seed=seed, trajectory=boat(seed=5))
    return replace(simulate(sailing, scenario), station=usv())


def test_waves_stay_in_full_where_a_vane_tells_nothing() -> None:
    """What is put in falls with the frequency as the eddies' likeness does; the waves do not."""
    sailed, elsewhere = on_waves(1, 0.06), on_waves(2, 0.06)
    (vane,) = sailed.angles
    readings = sailed.angles[vane]
    seconds = (readings.time - readings.time[0]) * 1e-9
    floats = seconds % 12.0 < 5.0
    chance = np.random.default_rng(7).uniform(-np.pi, np.pi, seconds.size)
    broken = replace(readings, angle=np.where(floats, chance, readings.angle))
    recording = replace(sailed, reference=elsewhere.reference, angles={vane: broken})
    comparison = prepare(recording)
    name = f"{vane}/vane_angle"
    untold = where_untold(comparison.recording.angles[vane], comparison.grid)
    waves = prepare(on_waves(3, 1e-3)).measured.series[name]
    assert 0.3 < np.mean(untold) < 0.6
    slope, _ = np.polyfit(waves[untold], comparison.measured.series[name][untold], 1)
    assert slope == pytest.approx(1.0, abs=0.15)


def test_waves_are_expected_in_full_where_the_references_eddies_are_not() -> None:
    """What a mount does is known, however little the reference tells of the wind at the sensor."""
    sailed, elsewhere = on_waves(1, 0.06), on_waves(2, 0.06)
    comparison = prepare(replace(sailed, reference=elsewhere.reference))
    simulated = comparison.simulate(comparison.station)
    waves = prepare(on_waves(3, 1e-3)).measured
    known = default_channel(comparison.channels[0])
    for channel in comparison.channels:
        n = comparison.coefficients
        frequency = np.arange(n) / (2.0 * comparison.grid.n * comparison.grid.dt)
        here = (frequency > 0.08) & (frequency < 0.3)
        of_waves = waves.cosine[channel.name][:n][here]
        _, slope, left = residual_of(comparison, simulated, known, channel)
        assert np.mean(slope[here]) < 0.8
        share = float(of_waves @ left[here]) / float(of_waves @ of_waves)
        assert abs(share) < 0.1


def sailed(seed: int, axes: str) -> Recording:
    """The boat under way, its velocity reported in some axes, read as if in those of the platform.

    Args:
        seed: Of wind and course.
        axes: `platform` or `earth`.
    """
    platform = usv().platform
    assert platform is not None
    reporting = usv().model_copy(
        update={"platform": platform.model_copy(update={"velocity_axes": axes})}
    )
    wind = isotropic_spec(6.0, 0.1, 60.0, direction=1.0, seed=seed)
    scenario = Scenario(wind, duration=400.0, seed=seed, trajectory=boat(seed=seed))
    return replace(simulate(reporting, scenario), station=usv(), truth=None)


def test_a_velocity_in_earths_axes_is_a_frame_error() -> None:
    baseline = learn([sailed(seed, "platform") for seed in range(3)])
    found = diagnose(sailed(20, "earth"), baseline)
    assert found.verdict == "named"
    (finding,) = found.findings
    assert finding.term.key == ("frame_error", "platform")
    assert finding.term.values["other_axes"] == 1.0
    assert finding.proof is not None and finding.proof.excess_removed > 0.95
    assert found.station.platform is not None
    assert found.station.platform.velocity_axes == "earth"


def test_axes_that_are_mistaken_twice_are_right() -> None:
    wrong = suggested(
        "frame_error", "platform", roll=0.0, pitch=0.0, velocity_turn=0.0, other_axes=1.0
    )
    assert planted(usv(), [wrong]) != usv()
    assert planted(planted(usv(), [wrong]), [wrong]) == usv()


@pytest.mark.parametrize("seed", [1, 11])
def test_a_lever_arm_is_as_long_as_it_is_where_the_reference_knows_no_eddy(seed: int) -> None:
    reference = on_waves(seed + 1, 0.06).reference
    comparison = prepare(replace(on_waves(seed, 0.06, higher=1.0), reference=reference))
    arm = suggested("lever_arm", "platform", dx=0.0, dy=0.0, dz=1.0)
    trust = trust_of(
        comparison, comparison.simulate(planted(usv(), [arm])), default_baseline(usv())
    )
    short = replace(arm, values={**arm.values, "dz": 0.5})
    found = fit(unstanding(comparison, trust), usv(), [short])
    assert found.terms[0].values["dz"] == pytest.approx(1.0, abs=0.2)


def test_an_effect_adds_to_what_a_station_already_states() -> None:
    stated = uav(thrust=20.0, disc_area=0.5, sensor_share=0.2, wake_skew=0.1)
    more = with_effect(
        stated,
        catalogue()["rotor_downwash"],
        "platform",
        {"induced_velocity": 0.5, "wake_skew": 0.2, "forward": 0.1, "leftward": 0.0},
    )
    assert more.platform is not None
    found = more.platform.downwash
    assert (found.thrust, found.disc_area, found.sensor_share) == (20.0, 0.5, 0.2)
    assert found.induced_velocity == 0.5
    assert found.wake_skew == pytest.approx(0.3)
    assert found.spread == (0.1, 0.0)


@pytest.mark.parametrize(
    ("axis", "frame"), [("tilt_x", {"pitch": 7.0}), ("tilt_y", {"roll": -7.0})]
)
def test_a_frame_that_leans_is_an_axis_that_leans(axis: str, frame: dict[str, float]) -> None:
    comparison = prepare(flown(uav(), 3))
    leaning = {
        "axis_tilt": ({"tilt_x": 0.0, "tilt_y": 0.0, axis: 7.0}, "station"),
        "frame_error": (
            {"roll": 0.0, "pitch": 0.0, "velocity_turn": 0.0, "other_axes": 0.0, **frame},
            "platform",
        ),
    }
    of_axis, of_frame = (
        comparison.simulate(with_effect(uav(), catalogue()[name], entry, values)).series
        for name, (values, entry) in leaning.items()
    )
    straight = comparison.simulate(uav()).series
    for name, series in of_axis.items():
        moved = np.nanstd(series - straight[name])
        assert moved > 0.0
        assert np.nanstd(series - of_frame[name]) < 0.01 * moved


def test_a_vane_that_circles_keeps_to_the_slow_wind_of_its_mount() -> None:
    """At 2 m/s round and round in 8 m/s the apparent wind swings by asin(2/8) to either side of the
    true one, however the nose points: a vane is never farther from the slow wind than that."""
    circle = Trajectory("circle", speed=2.0, turn_seconds=60.0)
    steady = isotropic_spec(8.0, 1e-3, 60.0, direction=0.4, seed=3)
    recording = simulate(uav(), Scenario(steady, duration=300.0, trajectory=circle))
    comparison = prepare(recording)
    assert np.ptp(comparison.direction) == pytest.approx(10.0 * np.pi, rel=0.05)
    for channel in comparison.channels:
        if channel.kind == "vane_angle":
            away = np.abs(comparison.measured.series[channel.name] / comparison.speed)
            assert np.quantile(away, 0.99) < np.arcsin(2.0 / 8.0) + np.radians(3.0)
            break
    else:
        pytest.fail("no vane")


def test_a_log_that_dies_is_found_with_its_end() -> None:
    known = three_flights()
    flight = flown(uav(), 51)
    assert flight.platform is not None
    since = (flight.platform.time - flight.start) * 1e-9
    velocity = np.where(since[:, None] > 150.0, 0.0, flight.platform.velocity)
    dead = replace(flight, platform=replace(flight.platform, velocity=velocity))
    found = diagnose(dead, known)
    assert [f.term.effect.name for f in found.findings] == ["platform_velocity"]
    begin, end = found.findings[0].term.interval
    assert begin == pytest.approx(150.0, abs=10.0)
    assert end is None


def test_a_dead_log_is_found_and_replaced_by_the_positions() -> None:
    known = three_flights()
    flight = flown(uav(), 51)
    assert flight.platform is not None
    still = np.zeros_like(flight.platform.velocity)
    dead = replace(flight, platform=replace(flight.platform, velocity=still))
    found = diagnose(dead, known)
    assert [f.term.effect.name for f in found.findings] == ["platform_velocity"]
    assert found.station.platform is not None
    assert found.station.platform.position_share > 0.9
    whole = process(flight).velocity
    wrong, right = (
        np.sqrt(np.mean(np.square(process(replace(dead, station=station)).velocity - whole)))
        for station in (uav(), found.station)
    )
    assert right < 0.3 * wrong


def test_a_log_in_knots_is_a_scale_of_the_velocity() -> None:
    flight = flown(uav(), 52)
    assert flight.platform is not None
    knots = flight.platform.velocity / 0.5144
    found = diagnose(
        replace(flight, platform=replace(flight.platform, velocity=knots)), three_flights()
    )
    (finding,) = found.findings
    assert finding.term.key == ("platform_velocity_scale", "platform")
    assert finding.parameters["velocity_scale"].value == pytest.approx(1.0 / 0.5144, rel=0.03)


def test_eddies_are_measured_by_the_wind_that_the_named_motion_gives() -> None:
    # With a dead log the air seems to pass the sensors as fast as it passes the ground.
    flight = flown(uav(), 51)
    assert flight.platform is not None
    still = np.zeros_like(flight.platform.velocity)
    dead = replace(flight, platform=replace(flight.platform, velocity=still))
    found = diagnose(dead, three_flights(), with_proof=False)
    right, wrong = prepare(flight).speed, prepare(dead).speed
    away = float(np.sqrt(np.mean(np.square(wrong - right))))
    assert away > 0.5
    assert np.sqrt(np.mean(np.square(found.comparison.speed - right))) < 0.2 * away
    # What is compared stays the station as it was described, seen in that wind.
    assert found.comparison.station.platform == uav().platform


def test_a_sensor_far_above_its_stated_place_is_found_there() -> None:
    # Ten metres are the masthead of a yacht whose file says the deck.
    stated = uav()
    assert stated.platform is not None
    x, y, z = stated.platform.sensor_position
    moved = stated.platform.model_copy(update={"sensor_position": (x, y, z + 10.0)})
    flight = flown(stated.model_copy(update={"platform": moved}), 53)
    found = diagnose(replace(flight, station=stated), three_flights(), with_proof=False)
    (finding,) = found.findings
    assert finding.term.key == ("lever_arm", "platform")
    assert finding.parameters["dz"].value == pytest.approx(10.0, abs=1.0)
