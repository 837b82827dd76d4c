"""Sensors that stand still or ice up: found directly in the means, before anything is fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import stats

from wind_sensors.diagnosis.means.averages import BLOWING, Averages, BoolArray

FloatArray = npt.NDArray[np.float64]

LONGEST_REPEAT = 18
"""So many equal means in a blowing wind do not happen to a sensor that works."""

COLD = 1.5
"""Ice is looked for below this temperature [deg C], and its placebo above `WARM`."""
WARM = 5.0

FAMILY_P = 0.05
"""Probability that episodes on any rotor of the mast fall into the cold by chance."""

SLOWED = 0.12
"""A rotor is slow where it lags by this share of the wind: beyond what mounts and turbulence do to
a mean. A choice; a smaller one finds thinner ice and more of the wind's own differences."""

SHORTEST_EPISODE = 3
"""So many slow means in a row, half an hour, are an episode: ice does not come and go in less."""


@dataclass(frozen=True)
class Silence:
    """An interval in which a sensor repeats one value.

    Attributes:
        sensor: Rotor or vane.
        first, last: Rows.
        rows: How many of them had wind.
        value: What it repeats ([m/s] or [rad]).
    """

    sensor: str
    first: int
    last: int
    rows: int
    value: float


@dataclass(frozen=True)
class Ice:
    """Episodes in which a rotor lags behind its partner in the cold.

    Attributes:
        rotor: The slow one.
        partner: What it is compared with.
        episodes: First and last row of each.
        rows: Rows of all episodes together.
        cold_rows: Rows of blowing wind below `COLD`.
        warm_rows: Rows of blowing wind above `WARM`, with `warm_slow` of them as slow.
        warm_slow: See `warm_rows`.
        ratio: Median speed relative to what the partner leads to expect.
        ratios: Between these lie 95 % of the rows.
        p: Probability that so many of all episodes fall into the cold by chance.
    """

    rotor: str
    partner: str
    episodes: tuple[tuple[int, int], ...]
    rows: int
    cold_rows: int
    warm_rows: int
    warm_slow: int
    ratio: float
    ratios: tuple[float, float]
    p: float


def runs(flag: BoolArray, shortest: int) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flag.astype(np.int8), [0]))))
    return [
        (int(first), int(stop) - 1)
        for first, stop in zip(edges[::2], edges[1::2], strict=True)
        if stop - first >= shortest
    ]


def blowing(averages: Averages, without: str = "") -> BoolArray:
    """Rows in which at least half of the other rotors see wind."""
    others = [v for name, v in averages.speed.items() if name != without]
    strong = np.mean([np.where(np.isfinite(v), v, 0.0) > BLOWING for v in others], axis=0)
    found: BoolArray = strong >= 0.5
    return found


def silences(averages: Averages) -> list[Silence]:
    """Sensors that repeat a value while the wind blows."""
    found = []
    for columns in (averages.speed, averages.heading):
        for name, value in columns.items():
            windy = blowing(averages, name)
            same = np.zeros(len(averages), dtype=bool)
            step = np.abs(np.diff(value))
            same[1:] = step < 1e-9 * np.maximum(1.0, np.abs(value[1:]))
            for first, last in runs(same, 2):
                rows = int(np.count_nonzero(windy[first - 1 : last + 1]))
                if rows >= LONGEST_REPEAT:
                    found.append(
                        Silence(name, max(first - 1, 0), last, rows, float(value[last]))
                    )
    return _joined(found)


def _joined(found: list[Silence]) -> list[Silence]:
    """Silences of one sensor at one value with little between them are one."""
    out: list[Silence] = []
    for s in sorted(found, key=lambda s: (s.sensor, s.first)):
        last = out[-1] if out else None
        near = last is not None and s.first - last.last <= LONGEST_REPEAT
        if last is not None and near and last.sensor == s.sensor and last.value == s.value:
            out[-1] = Silence(s.sensor, last.first, s.last, last.rows + s.rows, s.value)
        else:
            out.append(s)
    return out


def without_silences(averages: Averages, found: list[Silence]) -> Averages:
    """The means with what a silent sensor repeats taken out."""
    speed = {k: v.copy() for k, v in averages.speed.items()}
    heading = {k: v.copy() for k, v in averages.heading.items()}
    for s in found:
        column = speed if s.sensor in speed else heading
        column[s.sensor][s.first : s.last + 1] = np.nan
    return replace(averages, speed=speed, heading=heading)


def ice(averages: Averages, rotor: str, partner: str, expected: FloatArray) -> Ice | None:
    """Episodes of ice on a rotor; None: none, or as many in warm air, which is not ice.

    Args:
        averages: The means, without silences.
        rotor, partner: A pair.
        expected: Speed that the partner leads to expect at the rotor [m/s], shape (n,).
    """
    if not np.isfinite(averages.temperature).any():
        return None
    windy = (averages.speed[partner] > BLOWING) & np.isfinite(averages.speed[rotor])
    ratio = averages.speed[rotor] / np.maximum(expected, 0.5)
    slow = windy & (ratio < 1.0 - SLOWED)
    cold = averages.temperature < COLD
    warm = averages.temperature > WARM
    episodes = runs(slow & cold, SHORTEST_EPISODE)
    warm_episodes = len(runs(slow & warm, SHORTEST_EPISODE))
    rows = sum(last - first + 1 for first, last in episodes)
    cold_rows, warm_rows = int(np.sum(windy & cold)), int(np.sum(windy & warm))
    if not episodes or cold_rows == 0 or warm_rows == 0:
        return None
    share = cold_rows / (cold_rows + warm_rows)
    p = float(stats.binom.sf(len(episodes) - 1, len(episodes) + warm_episodes, share))
    if p > FAMILY_P / len(averages.speed):
        return None
    warm_slow = sum(b - a + 1 for a, b in runs(slow & warm, SHORTEST_EPISODE))
    inside = np.concatenate([ratio[a : b + 1] for a, b in episodes])
    low, middle, high = np.nanquantile(inside, (0.025, 0.5, 0.975))
    return Ice(
        rotor, partner, tuple(episodes), rows, cold_rows, warm_rows, warm_slow, float(middle),
        (float(low), float(high)), p,
    )


def without_ice(averages: Averages, found: list[Ice], margin: int = 6) -> Averages:
    """The means without icy rows of the rotors concerned, and an hour around them."""
    speed = {k: v.copy() for k, v in averages.speed.items()}
    for episode in found:
        for first, last in episode.episodes:
            speed[episode.rotor][max(first - margin, 0) : last + margin + 1] = np.nan
    return replace(averages, speed=speed)
