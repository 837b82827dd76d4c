"""What the page of a recording of means shows."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.means.averages import DAY
from wind_sensors.diagnosis.means.pair import Pair
from wind_sensors.diagnosis.means.vanes import VaneBench
from wind_sensors.diagnosis.outcome import Panel
from wind_sensors.motion.frames import compass_from_yaw
from wind_sensors.station.model import Station

FloatArray = npt.NDArray[np.float64]

_FEWEST = 8


def _panel(
    title: str,
    axis: str,
    unit: str,
    of: FloatArray,
    edges: FloatArray,
    before: FloatArray,
    after: FloatArray,
) -> Panel:
    rows = []
    for low, high in pairwise(edges):
        inside = (of >= low) & (of < high)
        count = int(np.count_nonzero(inside))
        if count >= _FEWEST:
            one, two = before[inside], after[inside]
            rows.append(
                (0.5 * (low + high), np.median(one), np.median(two),
                 1.25 * np.std(one) / np.sqrt(count))
            )
    at = np.array(rows).reshape(-1, 4)
    return Panel(title, axis, at[:, 0], at[:, 1], at[:, 2], at[:, 3], unit)


def of_pair(pair: Pair, station: Station, explained: Station) -> list[Panel]:
    """Residual of a pair over direction, speed and time, relative to the wind.

    Args:
        pair: The pair.
        station, explained: Before and after.
    """
    speed = pair.wind(explained)
    before = 100.0 * pair.residual(station) / speed
    after = 100.0 * pair.residual(explained) / speed
    from_north = compass_from_yaw(pair.heading)
    day = pair.averages.elapsed / DAY
    unit = "% of the wind"
    top = float(np.quantile(speed, 0.995))
    return [
        _panel(pair.name, "wind from [deg]", unit, from_north, np.arange(0.0, 361.0, 5.0),
               before, after),
        _panel(pair.name, "wind speed [m/s]", unit, speed, np.linspace(2.0, top, 20), before,
               after),
        _panel(pair.name, "day", unit, day, np.linspace(day[0], day[-1] + 1e-6, 60), before,
               after),
    ]


def of_vane(found: VaneBench, station: Station, explained: Station) -> Panel:
    """Difference of a vane from the others over time."""
    bench = found.bench
    everything = bench.everything
    before = np.degrees(bench.residual(station, everything))
    after = np.degrees(bench.residual(explained, everything))
    day = bench.elapsed / DAY
    edges = np.linspace(day[0], day[-1] + 1e-6, 60)
    return _panel(f"{found.vane} - other vanes", "day", "deg", day, edges, before, after)
