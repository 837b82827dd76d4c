"""Where a mismatch sits: in time, speed, direction, heading, frequency and statistics.

Regions are judged by one maximum statistic over all of them, calibrated by drawing white vectors,
so that its p value already pays for looking everywhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from wind_sensors.diagnosis.comparing import activity, spectra
from wind_sensors.diagnosis.comparing.comparison import LOW_END, Comparison
from wind_sensors.diagnosis.comparing.observation import NORMALISED_BANDS, Channel
from wind_sensors.diagnosis.comparing.observing import BANDS, Simulated
from wind_sensors.diagnosis.comparing.raw_statistics import STATISTICS
from wind_sensors.diagnosis.healthy.whitening import Whitener
from wind_sensors.motion.frames import compass_from_yaw, heading_of

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

DRAWS = 499
_SHORTEST_SHARE = 0.02
_WEAKEST = 1e-3
_SECTOR_WIDTHS_DEG = (10.0, 30.0, 90.0)
_TIME_LEVELS = (2, 4, 8, 16)
_QUANTILES = 6

OF_POWER = frozenset({"frequency", "spectrum", "statistic", "activity"})
"""Kinds of regions in which no mean of the residual tells how large the mismatch is."""


@dataclass(frozen=True)
class Region:
    """A part of the data in which the residual may exceed the baseline.

    Attributes:
        channel: Name of the channel.
        kind: `time`, `speed`, `direction`, `heading`, `temperature`, `frequency`, `spectrum`,
            `statistic`, `activity` or `all`.
        low, high: Bounds: s, m/s, degrees clockwise from north (or from the bow), deg C, Hz.
        label: For people.
    """

    channel: str
    kind: str
    low: float
    high: float
    label: str


@dataclass(frozen=True)
class Found:
    """A region with its score.

    Attributes:
        region: Where.
        score: Drop of the cost if the residual is shifted there (frequency: excess of power).
        excess: Mean residual there, in the channel's unit (m/s, or degrees for a vane).
        unit: Its unit.
    """

    region: Region
    score: float
    excess: float
    unit: str


def _time_regions(comparison: Comparison) -> Iterator[tuple[str, float, float, str, BoolArray]]:
    at = comparison.grid.centres
    length = comparison.grid.n * comparison.grid.dt
    for parts in _TIME_LEVELS:
        for k in range(parts):
            low, high = k * length / parts, (k + 1) * length / parts
            yield "time", low, high, f"{low:.0f} to {high:.0f} s", (at >= low) & (at < high)


def _speed_regions(comparison: Comparison) -> Iterator[tuple[str, float, float, str, BoolArray]]:
    speed = comparison.speed
    edges = np.quantile(speed, np.linspace(0.0, 1.0, _QUANTILES + 1))
    for k in range(_QUANTILES):
        low, high = float(edges[k]), float(edges[k + 1])
        inside = (speed >= low) & (speed <= high)
        yield "speed", low, high, f"{low:.1f} to {high:.1f} m/s", inside
    middle = float(edges[_QUANTILES // 2])
    yield "speed", float(edges[0]), middle, f"below {middle:.1f} m/s", speed <= middle
    yield "speed", middle, float(edges[-1]), f"above {middle:.1f} m/s", speed > middle


def clockwise_from(comparison: Comparison) -> FloatArray:
    """Where the wind comes from, clockwise from north or, on a platform, the bow [deg, 0..360)."""
    if comparison.drive.motion is None:
        return compass_from_yaw(comparison.wind_from)
    return np.asarray(np.mod(-np.degrees(comparison.wind_from), 360.0))


def _sector_regions(
    comparison: Comparison,
) -> Iterator[tuple[str, float, float, str, BoolArray]]:
    clockwise = clockwise_from(comparison)
    of = "from the bow" if comparison.drive.motion is not None else "from north"
    for width in _SECTOR_WIDTHS_DEG:
        for low in np.arange(0.0, 360.0, width):
            inside = (clockwise >= low) & (clockwise < low + width)
            label = f"wind from {low:.0f} to {low + width:.0f} deg {of}"
            yield "direction", float(low), float(low + width), label, inside


def _heading_regions(
    comparison: Comparison,
) -> Iterator[tuple[str, float, float, str, BoolArray]]:
    motion = comparison.drive.motion
    if motion is None:
        return
    yaw = np.unwrap(heading_of(motion.attitude))
    at = np.arange(len(comparison.drive)) * comparison.drive.dt
    heading = compass_from_yaw(np.interp(comparison.grid.centres, at, yaw))
    for low in np.arange(0.0, 360.0, 45.0):
        inside = (heading >= low) & (heading < low + 45.0)
        yield "heading", float(low), float(low + 45.0), f"heading {low:.0f} deg", inside


def masks(comparison: Comparison) -> list[tuple[str, float, float, str, BoolArray]]:
    """All parts of the record: kind, bounds, label, bins inside."""
    everything = np.ones(comparison.grid.n, dtype=np.bool_)
    out = [("all", 0.0, comparison.grid.n * comparison.grid.dt, "everywhere", everything)]
    for part in (_time_regions, _speed_regions, _sector_regions, _heading_regions):
        out.extend(
            region for region in part(comparison) if np.mean(region[4]) > _SHORTEST_SHARE
        )
    return out


@dataclass(frozen=True)
class RegionBank:
    """White signatures of a shift in each region, and the null of their maximum.

    Attributes:
        regions: The regions with signatures (in series, then in activities), then the frequency
            bands, then the statistics.
        signatures: Unit vectors, one a row, for the first regions.
        bands: Start and stop in the white vector for each frequency band.
        statistics: Place in the white vector for each statistic.
        null: Maxima over everything in drawn white vectors.
    """

    regions: tuple[Region, ...]
    signatures: FloatArray
    bands: tuple[tuple[int, int], ...]
    statistics: tuple[int, ...]
    null: FloatArray

    def scores(self, vector: FloatArray) -> FloatArray:
        """Score of every region for one white vector, or for rows of them."""
        shifts = (vector @ self.signatures.T) ** 2
        powers = [
            np.maximum(np.sum(vector[..., a:b] ** 2, axis=-1) - (b - a), 0.0) ** 2
            / (2.0 * (b - a))
            for a, b in self.bands
        ]
        single = [vector[..., k] ** 2 for k in self.statistics]
        return np.concatenate(
            (shifts, np.stack(powers, axis=-1), np.stack(single, axis=-1)), axis=-1
        )

    def p_value(self, score: float) -> float:
        """Probability of a maximum as large when nothing is wrong."""
        return float((1 + np.count_nonzero(self.null >= score)) / (1 + self.null.size))


def _frequency_regions(
    comparison: Comparison, channel: Channel, begin: int
) -> Iterator[tuple[Region, tuple[int, int]]]:
    n = comparison.coefficients
    edges = spectra.band_edges(n)
    per = 1.0 / (2.0 * comparison.grid.n * comparison.grid.dt)
    groups = edges[2::2]
    for a, b in itertools.pairwise(groups):
        low, high = float(a * per), float(b * per)
        if low < LOW_END:
            continue
        label = f"{low:.3g} to {high:.3g} Hz"
        yield (
            Region(channel.name, "frequency", low, high, label),
            (begin + int(a), begin + int(b)),
        )


def region_bank(whitener: Whitener, simulated: Simulated, seed: int = 1) -> RegionBank:
    """Prepare the regions of a recording in a null.

    Args:
        whitener: The null.
        simulated: Simulation whose rotor rates scale the shifts of rotors.
        seed: Of the drawn white vectors.
    """
    comparison = whitener.comparison
    n = comparison.coefficients
    parts = masks(comparison)
    regions: list[Region] = []
    rows: list[FloatArray] = []
    bands: list[tuple[Region, tuple[int, int]]] = []
    total = whitener.of(simulated).size
    for number, channel in enumerate(comparison.channels):
        trust = whitener.trust[channel.name]
        scale = comparison.speed
        for kind, low, high, label, inside in parts:
            row = np.zeros(total)
            shift = spectra.to_cosine(comparison.masked(np.where(inside, scale, 0.0)))[:n]
            row[number * n : (number + 1) * n] = trust.slope * shift / trust.deviation
            white = whitener.through_standing(row)
            length = float(np.linalg.norm(white))
            if length > _WEAKEST:
                regions.append(Region(channel.name, kind, low, high, label))
                rows.append(white / length)
        bands.extend(_frequency_regions(comparison, channel, number * n))
    for region, row in _activity_regions(whitener, total):
        white = whitener.through_standing(row)
        length = float(np.linalg.norm(white))
        if length > _WEAKEST:
            regions.append(region)
            rows.append(white / length)
    statistics: list[tuple[Region, int]] = []
    place = n * len(comparison.channels)
    for channel in comparison.channels:
        size = comparison.measured.statistics[channel.name].size
        for k in range(size):
            kind = "spectrum" if k < BANDS else "statistic"
            label = (
                eddies(channel, NORMALISED_BANDS[k : k + 2])
                if k < BANDS
                else STATISTICS[channel.kind][k - BANDS]
            )
            statistics.append(
                (Region(channel.name, kind, float(k), float(k + 1), label), place + k)
            )
        place += size
    bank = RegionBank(
        regions=(*regions, *(r for r, _ in bands), *(r for r, _ in statistics)),
        signatures=np.array(rows),
        bands=tuple(span for _, span in bands),
        statistics=tuple(k for _, k in statistics),
        null=np.zeros(0),
    )
    rng = np.random.default_rng(seed)
    maxima = []
    for _ in range(0, DRAWS, 50):
        drawn = rng.standard_normal((50, total))
        maxima.append(bank.scores(drawn).max(axis=1))
    null = np.concatenate(maxima)[:DRAWS]
    return RegionBank(bank.regions, bank.signatures, bank.bands, bank.statistics, null)


def _activity_regions(whitener: Whitener, total: int) -> Iterator[tuple[Region, FloatArray]]:
    """Levels of quick eddies that rise in a part of the time, with the rise, noise-whitened."""
    comparison = whitener.comparison
    counted = comparison.measured.counted
    at = (np.arange(counted.size) + 0.5) * activity.SEGMENT
    length = comparison.grid.n * comparison.grid.dt
    place = total - sum(comparison.measured.levels[c.name].size for c in comparison.channels)
    for channel in comparison.channels:
        for band, deviation in enumerate(whitener.trust[channel.name].activity_deviation):
            for parts in _TIME_LEVELS[:-1]:
                for k in range(parts):
                    low, high = k * length / parts, (k + 1) * length / parts
                    inside = ((at >= low) & (at < high)).astype(float)
                    row = np.zeros(total)
                    rise = activity.contrasts(inside, counted) / deviation
                    row[place : place + counted.size] = rise
                    label = (
                        f"{eddies(channel, activity.EDGES[band : band + 2])} "
                        f"from {low:.0f} to {high:.0f} s"
                    )
                    yield Region(channel.name, "activity", low, high, label), row
            place += counted.size


def eddies(channel: Channel, edges: FloatArray) -> str:
    """What a band of a channel's spectrum shows, for people.

    Args:
        channel: The channel.
        edges: Of the band, in k times its length, shape (2,).
    """
    longest, shortest = 2.0 * np.pi * channel.length / edges
    return f"power of eddies of {shortest:.3g} to {longest:.3g} m"


def excess_in(
    comparison: Comparison, residual: Mapping[str, FloatArray], region: Region
) -> tuple[float, str]:
    """Mean residual of a channel in a region, and its unit (rms for a frequency band)."""
    channel = next(c for c in comparison.channels if c.name == region.channel)
    series = residual[region.channel]
    if channel.kind == "vane_angle":
        series, unit = np.degrees(series / comparison.speed), "deg"
    else:
        unit = "m/s"
    if region.kind in OF_POWER:
        return float(np.std(series)), unit
    for kind, low, high, _, inside in masks(comparison):
        if (kind, low, high) == (region.kind, region.low, region.high):
            return float(np.mean(series[inside])), unit
    return float(np.mean(series)), unit


def strongest(
    whitener: Whitener, bank: RegionBank, vector: FloatArray, simulated: Simulated, number: int = 5
) -> list[Found]:
    """The regions in which a white vector stands out most."""
    scores = bank.scores(vector)
    residual = whitener.comparison.residual_series(simulated, whitener.trust)
    out = []
    for k in np.argsort(-scores)[:number]:
        region = bank.regions[int(k)]
        excess, unit = excess_in(whitener.comparison, residual, region)
        out.append(Found(region, float(scores[k]), excess, unit))
    return out
