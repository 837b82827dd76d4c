"""How fast the compiled equations of motion run, against a limit and against SciPy.

The limit is the chain of dependent operations: each Runge-Kutta stage needs the one before, so that
a core can use neither its vector units nor its parallel pipes. The least time of a step is the
number of links of that chain (multiply and add, strict order, as the same bits are wanted live and
offline) times the measured time of one link, plus four sines in the vane's. The script prints how
far the kernels are from it, and how much faster they are than SciPy's odeint in the same wind.

Run: python benchmarks/benchmark_kernels.py
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.table import Table
from scipy.integrate import odeint

from wind_sensors.compiled import compiled
from wind_sensors.diagnosis.comparing.observation import Grid, rate_series
from wind_sensors.diagnosis.comparing.raw_statistics.pulses import interval_statistics
from wind_sensors.simulation import Drive, edge_times, respond
from wind_sensors.simulation.pulses import rotor_signals
from wind_sensors.station.model import Cup, Input, Propeller, Station, Vane
from wind_sensors.station.signals import Pulses
from wind_sensors.turbulence.synthesis import isotropic_spec, synthesize

FloatArray = npt.NDArray[np.float64]

SECONDS, RATE = 900.0, 25.0
LINKS = {"cup": 4 * 4.5 + 1.5, "vane": 4 * 5.5 + 1.5}
"""Dependent multiply-adds in one step. A stage of the cup: difference, product, density, friction,
division (worth 1.5 links), new state; of the vane: component across, product, division, three
sums, new state. The last term is the weighted sum of the stages."""


@compiled
def _chain(count: int, x: float) -> float:
    """A chain of dependent multiply-adds that the compiler may not reorder."""
    for _ in range(count):
        x = x * 0.999999 + 1e-6
    return x


@compiled
def _sines(count: int, x: float) -> float:
    """A chain of dependent sines."""
    for _ in range(count):
        x = math.sin(x + 1.0)
    return x


@compiled
def _intervals_read(time: FloatArray) -> float:
    """Each interval read once: the least that a statistic of intervals does."""
    longest = 0.0
    for i in range(time.size - 1):
        longest = max(longest, time[i + 1] - time[i])
    return longest


def best(function: Callable[[], object], repeats: int = 9) -> float:
    """Shortest of several runs [s]."""
    function()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def _station(kind: str) -> Station:
    topic = Input(topic="/x")
    vane = Vane(name="vane", joint_states=topic, distance_constant=0.5, damping_ratio=0.3)
    cup = Cup(
        name="cup", pulses=topic, pulses_per_revolution=4, calibration_distance=0.2,
        distance_constant=1.7, a4=0.8, mu2=0.5,
    )
    propeller = Propeller(
        name="propeller", pulses=topic, pulses_per_revolution=2, calibration_distance=0.05,
        distance_constant=1.0, mounted_on="vane",
    )
    members = {"cup": (cup,), "vane": (vane,), "cup and vane": (vane, cup),
               "propeller-vane": (vane, propeller)}
    return Station(instruments=members[kind])


def _odeint_cup(wind: FloatArray, dt: float) -> FloatArray:
    t = dt * np.arange(wind.shape[0])
    h = np.hypot(wind[:, 0], wind[:, 1])
    forcing = h + 0.5 * (np.sqrt(h * h + wind[:, 2] ** 2) - h)

    def slope(state: FloatArray, now: float) -> list[float]:
        place = min(now / dt, wind.shape[0] - 1.000001)
        left = int(place)
        a = forcing[left] + (place - left) * (forcing[left + 1] - forcing[left])
        y = state[0]
        return [(a - y) * (0.8 * a + 0.2 * y) / 1.7, y / 0.2]

    out: FloatArray = odeint(slope, [forcing[0], 0.0], t, rtol=1e-6, atol=1e-6, hmax=dt)
    return out


def _odeint_vane(wind: FloatArray, dt: float) -> FloatArray:
    t = dt * np.arange(wind.shape[0])

    def slope(state: FloatArray, now: float) -> list[float]:
        place = min(now / dt, wind.shape[0] - 1.000001)
        left = int(place)
        x, y = wind[left, :2] + (place - left) * (wind[left + 1, :2] - wind[left, :2])
        pace = math.hypot(x, y) / 0.5
        turn = math.sin(state[0] - math.atan2(-y, -x))
        return [state[1], -2 * 0.3 * pace * state[1] - pace * pace * turn]

    start = math.atan2(-wind[0, 1], -wind[0, 0])
    out: FloatArray = odeint(slope, [start, 0.0], t, rtol=1e-6, atol=1e-6, hmax=dt)
    return out


def main() -> None:
    """Measure and print."""
    console = Console()
    dt = 1.0 / RATE
    spec = isotropic_spec(8.0, 0.15, 60.0, direction=0.5, seed=1)
    wind = synthesize(spec, RATE, int(SECONDS * RATE))
    drive = Drive(0, dt, wind)
    links = 2_000_000
    link = best(lambda: _chain(links, 0.5)) / links
    sine = best(lambda: _sines(links // 10, 0.5)) / (links // 10)
    console.print(
        f"one dependent multiply-add {link * 1e9:.2f} ns, one dependent sine {sine * 1e9:.1f} ns"
    )
    steps = {  # substeps that the kernels take for this wind, by their own rule
        "cup": np.mean(1 + np.floor(6.0 * dt * np.hypot(wind[:, 0], wind[:, 1]) / 1.7)),
        "vane": np.mean(1 + np.floor(2.0 * dt * np.hypot(wind[:, 0], wind[:, 1]) / 0.5)),
    }
    table = Table("15 min at 25 Hz", "time", "per step", "least time", "ratio", "odeint", "faster")
    reference = {"cup": _odeint_cup, "vane": _odeint_vane}
    for kind in ("cup", "vane"):
        station = _station(kind)
        spent = best(partial(respond, station, drive))
        count = len(drive) * float(steps[kind])
        least = count * (LINKS[kind] * link + (4 * sine if kind == "vane" else 0.0))
        begin = time.perf_counter()
        slow = reference[kind](wind, dt)
        scipy_time = time.perf_counter() - begin
        found = respond(station, drive)
        ours = found.rotors["cup"].y if kind == "cup" else found.angles["vane"].angle
        difference = float(np.abs(ours - slow[:, 0]).max())
        table.add_row(
            kind, f"{spent * 1e3:.2f} ms", f"{spent / count * 1e9:.0f} ns",
            f"{least * 1e3:.2f} ms", f"{spent / least:.1f}",
            f"{scipy_time * 1e3:.0f} ms (differs by {difference:.1g})",
            f"{scipy_time / spent:.0f} x",
        )
    for kind in ("cup and vane", "propeller-vane"):
        station = _station(kind)
        spent = best(partial(respond, station, drive))
        table.add_row(kind, f"{spent * 1e3:.2f} ms", "", "", "", "", f"{SECONDS / spent:.0f} real")
    console.print(table)
    found = respond(_station("cup"), drive)
    edges = edge_times(found, "cup")
    spent = best(lambda: edge_times(found, "cup"))
    console.print(
        f"{len(edges)} edges in {spent * 1e3:.2f} ms, {spent / len(edges) * 1e9:.0f} ns each"
    )
    _report_intervals(console, drive)


def _report_intervals(console: Console, drive: Drive) -> None:
    """The statistics of a disc of many slots, of which a diagnosis asks some thousand times."""
    rotor = _station("cup").instruments[0].model_copy(update={"pulses_per_revolution": 36})
    assert isinstance(rotor, Cup)
    station = Station(instruments=(rotor,))
    clean = rotor_signals(respond(station, drive), "cup")
    rng = np.random.default_rng(1)
    doubled = clean.time[rng.random(clean.time.size) < 0.03] + rng.integers(100_000, 1_000_000)
    bouncing = Pulses(np.sort(np.concatenate((clean.time, doubled))))
    grid = Grid(drive.start_ns, 0.1, int(SECONDS / 0.1))
    across, speed = np.ones(grid.n, dtype=np.complex128), np.full(grid.n, 8.0)
    for words, pulses in (("", clean), (" of a contact that bounces", bouncing)):
        seconds = grid.seconds(pulses.time)
        least = best(partial(_intervals_read, seconds))
        for what, function in (
            ("statistics", partial(interval_statistics, pulses, rotor, across, speed, grid)),
            ("rates", partial(rate_series, pulses, rotor, grid)),
        ):
            spent = best(function)
            console.print(
                f"{what} of {seconds.size} intervals{words} in {spent * 1e3:.2f} ms, "
                f"{spent / seconds.size * 1e9:.1f} ns each, {spent / least:.0f} times as long as "
                "reading them once"
            )


if __name__ == "__main__":
    main()
