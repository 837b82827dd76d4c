"""What effects of a given size change in the signals of the proving ground.

    python benchmarks/what_sizes_change.py                       # every effect at three minima
    python benchmarks/what_sizes_change.py 1 torque_asymmetry    # one of them at one minimum

Every effect is planted in a scene that is otherwise the same to the last bit, on two stations of
each kind. No diagnosis takes part: the table says what there is to be seen, before any noise of the
reference.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from rich.progress import track

from proving_ground.generate import Planted, healthy, plant, random_station
from proving_ground.measure import Signals, run_scene
from proving_ground.minimum_sizes import MINIMUM_SIZES, applicable
from proving_ground.scene import build_scene
from proving_ground.stations import Station
from wind_sensors.motion.frames import wrap

FloatArray = npt.NDArray[np.float64]

KINDS = "ABC"
STATIONS = (3, 4)
MINUTES = 6.0
SLOW, QUICK = 2.0, 0.5
"""Seconds that rates and angles are averaged over; differences of the second are called quick."""


@dataclass(frozen=True)
class Change:
    """What an effect changes on one station.

    Attributes:
        effect, kind: Its name; the kind of station.
        rate: Change of the rotor's mean rate, relative [1].
        rates: Standard deviation of the change of its means over 2 s, relative [1].
        quick: Change of the variance of its quick differences, relative [1].
        angle, angles: Mean and standard deviation of the change of the vane's means [deg].
    """

    effect: str
    kind: str
    rate: float
    rates: float
    quick: float
    angle: float
    angles: float


def recorded(station: Station, seed: int, effect: str | None, size: float) -> Signals:
    """Signals of a scene, with one effect or with none."""
    spec = healthy(station, seed, MINUTES)
    scene = build_scene(spec.station, spec.weather, spec.minutes, spec.seed)
    if effect is not None:
        plant(scene, Planted(effect, size))
    return run_scene(scene)


def rates(signals: Signals, slots: int, dt: float) -> FloatArray:
    """Mean rate of the rotor [turns/s] in successive intervals of dt [s]."""
    edges = np.arange(0.0, 60.0 * MINUTES, dt)
    turns = np.arange(signals.pulses.size) / slots
    return np.asarray(np.diff(np.interp(edges, signals.pulses, turns)) / dt)


def angles(signals: Signals, dt: float) -> FloatArray:
    """Mean angle of the vane [rad] in successive intervals of dt [s]."""
    place = (signals.vane_time / dt).astype(int)
    turned = np.unwrap(signals.vane)
    return np.asarray(np.bincount(place, turned) / np.maximum(np.bincount(place), 1))


def change(effect: str, station: Station, size: float, seed: int, without: Signals) -> Change:
    """What an effect changes in one scene."""
    found = recorded(station, seed, effect, size)
    slots = station.pulses_per_revolution
    before, after = (rates(signals, slots, SLOW) for signals in (without, found))
    jumps = [np.var(np.diff(rates(signals, slots, QUICK))) for signals in (without, found)]
    n = min(len(each) for each in (angles(without, SLOW), angles(found, SLOW)))
    turned = np.degrees(wrap(angles(found, SLOW)[:n] - angles(without, SLOW)[:n]))
    relative = (after - before) / before.mean()
    return Change(
        effect, station.kind, float(relative.mean()), float(relative.std()),
        float(jumps[1] / jumps[0] - 1.0), float(turned.mean()), float(turned.std()),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("size", nargs="?", type=float, default=3.0, help="in smallest sizes")
    parser.add_argument("effects", nargs="*", default=list(MINIMUM_SIZES), help="their names")
    arguments = parser.parse_args()
    stations = [random_station(kind, number) for kind in KINDS for number in STATIONS]
    jobs = [
        (station, effect)
        for station in stations
        for effect in applicable(station.kind, station.pulses_per_revolution)
        if effect in arguments.effects
    ]
    without = {
        (station.kind, station.seed): recorded(station, station.seed, None, 0.0)
        for station in stations
    }
    changes = [
        change(effect, station, min(arguments.size, MINIMUM_SIZES[effect].most), station.seed,
               without[station.kind, station.seed])
        for station, effect in track(jobs, "planting")
    ]
    print("| effect | station | mean rate | its 2 s means | quick changes | mean angle | its 2 s |")
    print("|---|---|---|---|---|---|---|")
    for each in sorted(changes, key=lambda c: (c.effect, c.kind)):
        print(
            f"| {each.effect} | {each.kind} | {100 * each.rate:+.2f} % | "
            f"{100 * each.rates:.2f} % | {100 * each.quick:+.0f} % | {each.angle:+.2f} deg | "
            f"{each.angles:.2f} deg |"
        )


if __name__ == "__main__":
    main()
